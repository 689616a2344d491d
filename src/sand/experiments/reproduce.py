"""Reproduction of a figure of a paper: a sweep, the comparison of its table with the paper, and the figure."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

from ..analysis.collision_kinds import growth_efficiency
from ..basics.errors import BadInput, did_you_mean
from ..contact.model import Contact
from ..io.run_folder import COMPARISON, FIGURE, LABORATORY, RESULTS, SWEEP_CSV, read_toml, write_toml
from ..io.sweep_files import DONE, FAILED, LAST, STATE, TABLE, read_runs, write_sweep
from ..io.table import write_table
from ..plotting.papers import panels_figure
from ..plotting.run_figure import save
from ..theory import contact
from . import paper_cake, paper_chain, paper_compression, paper_growth, paper_packings
from .job import Progress, ignored
from .laboratory_case import LaboratoryCase
from .laboratory_job import LaboratoryJob
from .paper_figure import Compared, PaperFigure, Row
from .sweep_case import Expected
from .sweep_cases import SweptLoading
from .sweep_design import changed_content
from .sweep_job import ROW_BYTES, SweepJob
from .sweep_row import Row as Run

FIGURES: dict[str, PaperFigure] = {
    one.name: one
    for module in (paper_growth, paper_compression, paper_chain, paper_packings, paper_cake)
    for one in module.FIGURES
}
"""Figures by name; a further one is a `PaperFigure` in `FIGURES` of a module named here."""
NAMES = {name: one for one in FIGURES.values() for name in (one.name, *one.also)}
"""The same, also by their further names."""
NO_PHYSICS = "small version: a test of the installation, no result of physics"
"""Verdict on each number of a small version."""
KEPT = (
    *("seed", STATE, "outcome", "largest", "second", "fragments", "impact_energy", "contacts_before", "contacts_after"),
    *("gyration_after", "time", "steps", "drift", "end", *LAST),
)
"""Columns of the table besides the keys that change."""

DIGITS = 7
"""Digits that are kept of the numbers in the tables of the runs."""
COMPRESSED = "compressed"
"""Subfolder of the packings with which runs begin, and name of their case."""
MEASURED = ("impact_energy", "contacts_after", "gyration_after")
"""Columns that `Reproduction` converts to the units of the figures."""


def papers_folder() -> Path:
    """Folder of the cases and of the tables that come with SAND: in the package, or in the source tree beside it."""
    here = Path(__file__).resolve()
    inside = here.with_name("papers")
    return inside if inside.is_dir() else here.parents[3] / "examples" / "papers"


class Reproduction(SweepJob):
    """The sweep of a figure of a paper, its comparison with the paper, and the figure.

    Parameters
    ----------
    name : str
        A name of `FIGURES`.
    folder : str or Path or None, optional
        Output folder, by default the name.
    small : bool, optional
        Whether the small version is computed, a test of the installation whose results mean nothing physically.
    known : bool, optional
        Whether rows of the table that comes with SAND are taken as they are.
    retry : bool, optional
        As for `SweepJob`.

    Raises
    ------
    BadInput
        If there is no such figure.

    Attributes
    ----------
    figure : PaperFigure
        What is reproduced.
    names : list of str
        Names of all runs.
    known : list of dict
        Rows of the table that comes with SAND.
    """

    AGAIN = "nothing is lost: to continue, call the same command again"

    def __init__(
        self,
        name: str,
        folder: str | Path | None = None,
        *,
        small: bool = False,
        known: bool = False,
        retry: bool = False,
    ):
        if name not in NAMES:
            raise BadInput(f"there is no figure '{name}'; {did_you_mean(name, list(NAMES))}")
        self.figure, self.small, place = NAMES[name], small, papers_folder()
        figure, name = self.figure, self.figure.name
        path, folder = place / f"{name}.toml", Path(folder or f"{name}{'-small' * small}")
        content = changed_content(read_toml(path), figure.small if small else {})
        self.first: dict[str, Any] | None = None
        if figure.compressed is not None:
            before = read_toml(place / f"{name}-compression.toml")
            self.first = changed_content(before, figure.compressed if small else {})
            content = changed_content(content, {"aggregate.file": str((folder / COMPRESSED).absolute())})
        settings = figure.small_sweep if small else {}
        super().__init__(path, folder, settings, content=content, retry=retry)
        self.names = [row.name for row in self.rows]
        self._offsets = len({row.values.get("impact.impact_parameter") for row in self.rows})
        rows = [cells for cells in self._cells(place / name) if cells["run"] in self.names]
        self._measured = {} if small else {cells["run"]: float(cells["cpu_seconds"]) for cells in rows}
        self.known = rows if known else []
        have = {cells["run"] for cells in self.known}
        # cheap runs first, and all of one seed before those of the next
        self.rows = sorted(
            (row for row in self.rows if row.name not in have),
            key=lambda row: (sum(n for key, n in row.values.items() if key.endswith(".grains")), row.seed),
        )

    def named_by(self, case: dict[str, Any]) -> dict[str, Any]:
        """What names a run: its case without the folder of the packings, which other machines do not have."""
        return case if self.first is None else changed_content(case, {"aggregate.file": COMPRESSED})

    def expected(self, left: Sequence[Run]) -> Expected:
        """As `SweepJob.expected`, with the measured CPU times of runs that are in the table that comes with SAND.

        Before packings are compressed, their cost, and that of runs with a packing.
        """
        found = self._estimated(left)
        if not all(row.name in self._measured for row in left) or self.first is not None:
            return found
        return found._replace(seconds=math.fsum(self._measured[row.name] for row in left))

    def _estimated(self, left: Sequence[Run]) -> Expected:
        """Cost without measured times."""
        if self.first is None or not left or (self.folder / COMPRESSED / LABORATORY).exists():
            return super().expected(left)
        body, self._is_set_up = self.first["aggregate"], True
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of rates that are too fast for packings that are not compressed
            cases = (SweptLoading({**case, "aggregate": body}, str(self.path)) for case in (self.first, self.content))
            costs = [one.expected(self.seeds[0]) for one in cases]
        numbers = len(self.seeds), len(left)
        seconds = [n * one.seconds for n, one in zip(numbers, costs, strict=True) if one.seconds is not None]
        disk = numbers[0] * (costs[0].disk or 0.0) + numbers[1] * ROW_BYTES
        return Expected(math.fsum(seconds) if len(seconds) == 2 else None, costs[0].memory, disk)

    def run(
        self, executor: Executor | None = None, observers: Sequence[Any] = (), progress: Progress = ignored
    ) -> dict[str, Any]:
        """Compute the runs that are left, and conclude, also if that is interrupted; see `SweepJob.run`."""
        content: dict[str, Any] = {"folder": str(self.folder), **dict.fromkeys(("runs", DONE, FAILED, "left"), 0)}
        content["failures"] = {}
        try:
            if self.rows:
                self._compress(executor, observers, progress)
                content = super().run(executor, observers, progress)
        finally:
            found = self.conclude()
        return content | found

    def _compress(self, executor: Executor | None, observers: Sequence[Any], progress: Progress) -> None:
        """Compress the packings with which runs begin, or go on with this, unless all are there."""
        place = self.folder / COMPRESSED
        if self.first is None or (place / LABORATORY).exists():
            return
        self.refuse_others()
        self.begin()
        case = place.with_suffix(".toml")
        write_toml(case, self.first, f"packings with which {self.figure.name} begins")
        LaboratoryJob(case, place, self.seeds, resume=place.exists()).run(executor, observers, progress)

    def conclude(self) -> dict[str, Any]:
        """Write table, comparison and figure of all runs that are done.

        Returns
        -------
        dict
            Numbers of rows and of all runs, their CPU time [s], and the comparison.
        """
        found = {one["run"]: one for one in (*self.known, *(self._cells(self.folder) if self.rows else ()))}
        cells = [found[name] for name in self.names if name in found and found[name][STATE] == DONE]
        place, compared = self.folder / RESULTS, list[Compared]()
        total = len(self.names)
        seconds = math.fsum(float(one["cpu_seconds"]) for one in cells)
        if cells:
            place.mkdir(parents=True, exist_ok=True)
            write_sweep(place, cells)
            rows = [row for one in cells for row in self._rows_of(one)]
            compared = self.figure.compare(rows)
            if self.small:
                compared = [one._replace(verdict=NO_PHYSICS) for one in compared]
            count = f"{len(cells)} of {total}, {seconds / 3600.0:.2g} core-hours"
            done = Compared("runs that are done", "", count, NO_PHYSICS * self.small)
            write_table(place / COMPARISON, [one._asdict() for one in (done, *compared)])
            part = "" if len(cells) == total else f"; {len(cells)} of {total} runs"
            small = f"; {NO_PHYSICS}" if self.small else ""
            save(panels_figure(self.figure.panels(rows), f"{self.figure.title}{small}{part}"), place / FIGURE)
        results = [one._asdict() for one in compared]
        note = {"note": NO_PHYSICS} if self.small else {}
        return {"rows": len(cells), "design": total, "cpu_seconds": seconds, "comparison": results} | note

    def _rows_of(self, cells: dict[str, Any]) -> list[Row]:
        """Rows as figures take them of one row of the table, one for each row of the table of its run if it has one."""
        columns, own = cells.get(TABLE, {}), {name: cell for name, cell in cells.items() if name != TABLE}
        table = [dict(zip(columns, line, strict=True)) for line in zip(*columns.values(), strict=True)]
        values = {key: cells[key] for key in self.keys}
        case: Any = self.kind(changed_content(self.content, values), str(self.path)).case
        if isinstance(case, LaboratoryCase):
            return [own | line for line in table if not math.isnan(line["stress"])]  # the first row has no mean values
        material, radius = case.materials_by_name()[case.target.material], float(case.target.radius)
        limit = next((f.rolling_limit for f in case.forces.build() if isinstance(f, Contact)), None)
        numbers = contact(material, radius, rolling_limit=limit)
        shared = own | {
            "speed": case.impact.speed,
            "offset": float(str(case.impact.impact_parameter).rstrip(" bc")),
            "offsets": self._offsets,
            "grain_mass": material.density * 4.0 / 3.0 * math.pi * radius**3,
            "roll_energy": numbers.roll_energy_clamped,
            "break_energy": numbers.break_energy,
        }
        if case.projectile is None:
            return [shared | _sizes(line["largest"], radius, *(line[name] for name in MEASURED)) for line in table]
        target, projectile = case.target.grains, case.projectile.grains
        growth = {"bodies": f"{target} + {projectile} grains", "mass_ratio": target / projectile}
        growth["growth_efficiency"] = growth_efficiency(target, projectile, cells["largest"])
        sizes = _sizes(target + projectile, radius, *(cells[name] for name in MEASURED))
        return [shared | growth | sizes | {"largest_remnant": cells["largest"] / (target + projectile)}]

    def _cells(self, folder: Path) -> list[dict[str, Any]]:
        """Rows of the table of a sweep with the columns that are kept; sizes of fragments are summarised."""
        if not (folder / SWEEP_CSV).exists():
            return []
        found = []
        for cells in read_runs(folder):
            if TABLE in cells:
                table = {name: cells[TABLE][name] for name in self.figure.columns}
                rounded = {name: [float(f"{v:.{DIGITS}g}") for v in column] for name, column in table.items()}
                found.append(cells | {TABLE: rounded})
                continue
            if "fragments" in cells and "largest" not in cells:  # numbers of grains, in decreasing order
                sizes = [int(size) for size in str(cells["fragments"]).split()] + [0]
                cells |= {"largest": sizes[0], "second": sizes[1], "fragments": len(sizes) - 1}
            found.append({name: cell for name, cell in cells.items() if name in KEPT or "." in name})
        return found


def _sizes(grains: float, radius: float, energy: float, contacts: float, gyration: float) -> Row:
    """Impact energy, contacts per grain, and radius of gyration in radii of a grain, of bodies that have collided."""
    sizes = {"contacts_per_grain": contacts / grains, "gyration": gyration / radius}
    return {"grains": grains, "impact_energy": energy, **sizes}
