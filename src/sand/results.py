"""Results of a run, or of several, read from its folder: frames, ledger, contacts and summary."""

from __future__ import annotations

import glob
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from .analysis.clusters import cluster_labels
from .analysis.ledger_columns import LedgerColumns
from .basics.arguments import checked
from .basics.errors import BadInput, ErrorCollector, import_optional, shown
from .basics.paths import user_path
from .basics.units import format_quantity, si
from .config.build import simulation_from
from .config.case import read_case
from .config.folders import without_run
from .io import run_folder as files
from .io.export import export_frames
from .io.frame import FrameArrays
from .io.ledger_table import read_ledger
from .io.optics import Optics
from .io.sweep_files import DONE, LAST, STATE, TABLE, read_lines, read_runs, read_sweep
from .io.trajectory import Frame, Frames
from .simulation.contact_table import Columns
from .simulation.simulation import Simulation
from .viewer.external_field import read_field
from .viewer.show import view_folder

if TYPE_CHECKING:
    from .plotting.render.still import Still


@checked
class Run:
    """The results of a run, as returned by `sand.open(DIR)`; each part is read on first access.

    Only `export` and `view` write files. The run may still be going: open it again to see new frames and rows.

    Parameters
    ----------
    folder : str or Path
        Folder of the run.

    Raises
    ------
    BadInput
        If it does not hold a run.
    """

    def __init__(self, folder: str | Path):
        self.folder = user_path(folder)
        if self.folder.is_file():
            raise BadInput(f"{folder} is a file; give the folder of a run")
        if not self.folder.is_dir():
            raise BadInput(f"there is no folder {folder}")
        if not (self.folder / files.TRAJECTORY).exists():
            raise BadInput(without_run(self.folder))

    @cached_property
    def frames(self) -> Frames:
        """The frames, as a sequence; each is read on access.  Raises BadInput for a broken trajectory."""
        return Frames(self.folder / files.TRAJECTORY)

    def arrays(self, name: str) -> FrameArrays:
        """One array of each frame, such as "position", as a sequence that reads frames on access.  Raises BadInput."""
        return self.frames.arrays(name)

    @cached_property
    def ledger(self) -> Columns:
        """Columns of the ledger by name, (K,), SI.  Raises BadInput."""
        ledger = LedgerColumns.from_rows(read_ledger(self.folder / files.LEDGER))
        return Columns({name: ledger[name] for name in ledger.columns})

    @cached_property
    def case(self) -> dict[str, Any]:
        """The case with all defaults filled in.  Raises BadInput."""
        return files.read_toml(self.folder / files.CASE)

    @property
    def summary(self) -> dict[str, Any]:
        """Summary of the run.  Raises BadInput before the run has ended."""
        return files.read_json(self.folder / files.SUMMARY)

    @checked
    def contacts(self, frame: int = -1) -> Columns:
        """Contacts of a frame: pair (C, 2), overlap [m], formed [s] (C,), force on the first grain [N] (C, 3)."""
        contacts = self.frames[frame]
        names = ("pair", "overlap", "formed", "force")
        return Columns({name: getattr(contacts, name) for name in names})

    @checked
    def at(self, frame: int = -1) -> Simulation:
        """Create a simulation in memory from a frame: its grains, contacts, box and forces, with the time set to 0.

        Its `loads()`, `at_grains()` and `contacts` give quantities that frames lack: energies, fields, torques.

        Raises
        ------
        BadInput
            As `setup.from_frame`; or if a case file cannot describe one of the forces.
        """
        case = read_case(self.folder / files.CASE)
        return simulation_from(self.frames[frame], case)

    @checked
    def view(self, path: str | Path | None = None) -> Any:
        """Show the grains in motion, as `Simulation.view`.

        Parameters
        ----------
        path : str or Path or None, optional
            File of the page; by default view.html in the run's folder.

        Raises
        ------
        BadInput
            If there is no frame yet, or the trajectory is broken.
        """
        return view_folder(self.folder, path, lambda: self.at(-1).figure())

    @checked
    def flux_density(self, time: Any) -> np.ndarray | None:
        """External magnetic flux density (3,) [T] of the case at a time [s]; None if the case has no such field."""
        now, field = si(time, "s", "time"), read_field(self.folder)
        return None if field is None else np.asarray(field[1](now))

    @checked
    def picture(self, frame: int = -1, **how: Any) -> Still:
        """Draw a still picture of a frame, with the external field of the case; notebooks display it.

        Parameters
        ----------
        frame : int, optional
            Index of the frame, as in Python.
        how
            Further arguments of `plotting.render.still.still_picture`: colour, bonds, arrows, view, size, dark, …

        Raises
        ------
        BadInput
            If there is no such frame, or a quantity or view is unknown; all problems at once.
        """
        from .plotting.render.still import still_picture

        one = self.frames[frame]
        return still_picture(one, **({"field": self.flux_density(one.time)} | how))

    @checked
    def export(
        self,
        form: str,
        stem: str | Path | None = None,
        frames: slice = slice(None),
        *,
        spacing: Any = None,
        indices: Mapping[str, complex] | None = None,
    ) -> list[Path]:
        """Write frames for another program.

        Parameters
        ----------
        form : str
            "xyz", "lammps-dump", "lammps-data", "vtk"; for optics "adda", "ddscat" or "mstm".
        stem : str or Path or None, optional
            Path without suffix; by default "trajectory" in the run's folder.
        frames : slice, optional
            Frames to write, by default all.
        spacing : float or str, optional
            Spacing of dipoles [m], for "adda" and "ddscat"; by default a tenth of the smallest diameter.
        indices : mapping of str to complex, optional
            Refractive indices n + ik of materials, for "mstm".

        Returns
        -------
        list[Path]
            The files written.

        Raises
        ------
        BadInput
            If the format is unknown, there is no frame, or the folder does not exist.
        """
        place = self.folder / "trajectory" if stem is None else Path(stem)
        length = None if spacing is None else si(spacing, "m", "spacing", above=0.0)
        return export_frames(self.frames, place, form, cluster_labels, frames, Optics(length, indices or {}))

    def to_xarray(self) -> Any:
        """Convert all frames to an xarray Dataset with dimensions frame, grain and axis, SI; needs xarray.

        Raises
        ------
        BadInput
            If grains were removed or added in the run.
        """
        xarray = import_optional("xarray", "to_xarray")
        whole: list[Frame] = list(self.frames)
        if any(not np.array_equal(one.id, whole[0].id) for one in whole):
            raise BadInput(f"to_xarray: the grains of {self.folder} change; use its frames one by one, and their id")
        vectors = ("position", "velocity", "moment", "spin", "image")
        data: dict[str, Any] = {
            name: (("frame", "grain", "axis"), np.array([getattr(one, name) for one in whole]), {"units": unit})
            for name, unit in zip(vectors, ("m", "m/s", "A m^2", "rad/s", "1"), strict=True)
        }
        if all(one.stored_virial is not None for one in whole):  # of runs with stress
            shares = np.array([one.virial for one in whole])
            data["virial"] = (("frame", "grain", "axis", "along"), shares, {"units": "J"})
        labels = np.array([cluster_labels(len(one), one.pair) for one in whole])
        rest = [one.at_rest for one in whole if one.at_rest is not None]
        of_grains = {"cluster": labels} | ({"at_rest": np.array(rest)} if rest and len(rest) == len(whole) else {})
        coordinates = {
            "time": ("frame", np.array([one.time for one in whole]), {"units": "s"}),
            "step": ("frame", np.array([one.step for one in whole])),
            "radius": ("grain", whole[0].radius, {"units": "m"}),
            "mass": ("grain", whole[0].mass, {"units": "kg"}),
            "material": ("grain", np.array(whole[0].materials)[whole[0].material]),
            "axis": ("axis", list("xyz")),
        }
        charge = np.array([one.charge for one in whole])
        columns: dict[str, Any] = {"charge": (("frame", "grain"), charge, {"units": "C"})}
        columns |= {name: (("frame", "grain"), values) for name, values in of_grains.items()}
        columns |= {
            name: (("frame", "grain"), np.array([one.own[name] for one in whole]), {"units": unit})
            for name, unit in whole[0].own.units.items()
        }
        return xarray.Dataset(data | columns, coords=coordinates)

    def to_pandas(self) -> Any:
        """Convert the ledger to a pandas DataFrame; needs pandas."""
        return self.ledger.to_pandas()

    def __repr__(self) -> str:
        return f"<run in {self.folder}: {len(self.frames)} frames>"


class Runs(Sequence[Run]):
    """The results of several runs, as returned by `sand.open(DIR, DIR, …)`, in the order given.

    Parameters
    ----------
    folders : Iterable[str or Path]
        Folders of the runs.

    Raises
    ------
    BadInput
        If one of them does not hold a run; one line for each.
    """

    def __init__(self, folders: Iterable[str | Path]):
        errors = ErrorCollector()
        self.runs = [errors.take(Run, folder) for folder in folders]
        errors.done()
        if not self.runs:
            raise BadInput("there is no folder of a run; give some, such as sand.open('seed-1', 'seed-2')")

    def __len__(self) -> int:
        return len(self.runs)

    @overload
    def __getitem__(self, index: int) -> Run: ...
    @overload
    def __getitem__(self, index: slice) -> Runs: ...

    def __getitem__(self, index: Any) -> Any:
        return Runs(run.folder for run in self.runs[index]) if isinstance(index, slice) else self.runs[index]

    def summary(self) -> Columns:
        """One row for each run: folder, seed, grains, time [s], mean_cluster_size, contacts, outcome.

        Runs that go on, or were killed, have the outcome "running" and the numbers of their last row of the ledger.
        """
        rows = [_summary_row(run) for run in self.runs]
        return Columns({name: np.array([row[name] for row in rows]) for name in rows[0]})

    @property
    def ledger(self) -> Columns:
        """Columns of all ledgers, one run below the other, and the number `run` of each row's run, from 0.

        Columns that not all runs have, such as the energy of a force, are left out.
        """
        ledgers = [run.ledger for run in self.runs]
        names = [name for name in ledgers[0] if all(name in one for one in ledgers)]
        number = np.repeat(np.arange(len(ledgers)), [len(one["step"]) for one in ledgers])
        return Columns({"run": number} | {name: np.concatenate([one[name] for one in ledgers]) for name in names})

    def to_pandas(self) -> Any:
        """Convert the ledgers to a pandas DataFrame with the column `run`; needs pandas."""
        return self.ledger.to_pandas()

    def __repr__(self) -> str:
        table = self.summary()
        texts = [[name, *(_cell(name, value) for value in column)] for name, column in table.items()]
        widths = [max(map(len, column)) for column in texts]
        lines = ["  ".join(t.ljust(w) for t, w in zip(row, widths, strict=True)) for row in zip(*texts, strict=True)]
        return "\n".join([f"<{len(self)} runs>", *(line.rstrip() for line in lines)])


LABORATORY = "laboratory"
"""Name of the figure of packings that are loaded."""
SHOWN = ("growth_efficiency", "largest_remnant", "sigma", "mean_cluster_size")
"""Columns of results, the first of which in the table of a sweep is drawn if none is asked for."""


@checked
class Sweep:
    """The results of a sweep, as returned by `sand.open(DIR)`: one table with a row for each run that has ended.

    Parameters
    ----------
    folder : str or Path
        Folder of the sweep.

    Raises
    ------
    BadInput
        If it does not hold the table of a sweep.
    """

    def __init__(self, folder: str | Path):
        self.folder = user_path(folder)
        if not (self.folder / files.SWEEP_CSV).exists():
            raise BadInput(f"{folder} is not the folder of a sweep, or its table is not written yet")

    @cached_property
    def table(self) -> Columns:
        """Columns by name, (K,): keys, seed, state, results, message, seconds, cpu_seconds, version, run.

        Empty cells are NaN in columns of numbers.  Raises BadInput.
        """
        return Columns(read_sweep(self.folder))

    @cached_property
    def rows(self) -> Columns:
        """Rows of the tables that runs have of their own, as those of packings: keys, seed, columns, run.

        Raises BadInput if no run has such a table.
        """
        return Columns(read_lines(self.folder))

    @property
    def loaded(self) -> list[dict[str, Any]]:
        """Results of packings that were loaded, as in laboratory.json; `group` names the values of the keys."""
        runs = [one for one in read_runs(self.folder) if TABLE in one]
        texts = [", ".join(f"{key.rpartition('.')[2]} = {one[key]}" for key in self.keys) for one in runs]
        return [one | {"group": text} for one, text in zip(runs, texts, strict=True)]

    @property
    def keys(self) -> list[str]:
        """The keys that change: the columns before `seed`."""
        return list(self.table)[: list(self.table).index("seed")]

    @property
    def results(self) -> list[str]:
        """The columns of results: those after `state`, but for message, cost, version and name."""
        names = list(self.table)
        return [name for name in names[names.index(STATE) + 1 :] if name not in LAST]

    @property
    def shown(self) -> list[str]:
        """What `sand plot` draws: the outcome, and the first result of `SHOWN`; of packings `LABORATORY`."""
        if (self.folder / files.ROWS_CSV).exists() and "pressure_scale" in self.table:
            return [LABORATORY]
        telling = [name for name in SHOWN if name in self.table]
        return [name for name in ("outcome", *telling[:1]) if name in self.table]

    @property
    def done(self) -> Columns:
        """The rows of runs that are done."""
        chosen = self.table[STATE] == DONE
        return Columns({name: column[chosen] for name, column in self.table.items()})

    @checked
    def run(self, row: int) -> Run:
        """The run of a row of the table.  Raises BadInput if the sweep keeps no files of its runs."""
        return Run(self.folder / files.RUNS / str(self.table["run"][row]))

    def to_pandas(self) -> Any:
        """Convert the table to a pandas DataFrame; needs pandas."""
        return self.table.to_pandas()

    def __repr__(self) -> str:
        return f"<sweep in {self.folder}: {len(self.table['seed'])} runs over {', '.join(self.keys)}>"


def _cell(name: str, value: Any) -> str:
    if name == "time":
        return format_quantity(float(value), "s")
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _summary_row(run: Run) -> dict[str, Any]:
    try:
        found = run.summary
    except BadInput:
        found = {name: column[-1] for name, column in run.ledger.items()} | {"grains": len(run.frames[-1])}
    seed = found.get("seed", run.case.get("run", {}).get("seed"))
    numbers = {name: found[name] for name in ("grains", "time", "mean_cluster_size", "contacts")}
    return {"folder": str(run.folder), "seed": seed, **numbers, "outcome": found.get("outcome", "running")}


@overload
def open(folder: Path) -> Any: ...
@overload
def open(folder: str) -> Any: ...
@overload
def open(folder: str | Path, other: str | Path, /, *others: str | Path) -> Runs: ...
@overload
def open(folder: Sequence[str | Path]) -> Runs: ...


@checked
def open(folder: Any, *others: Any) -> Any:
    """Open the results of the run in a folder, of several runs, or of a sweep.

    Parameters
    ----------
    folder : str or Path or sequence of these
        Folder of a run; or a list of folders; or a pattern such as "runs/seed-*".
    others : str or Path
        Folders of further runs, or patterns.

    Returns
    -------
    Run or Runs or Sweep
        `Run` for one folder, `Runs` for several folders, a list or a pattern, `Sweep` for the folder of a sweep.

    Raises
    ------
    BadInput
        If a folder does not hold a run, or no folder has such a name; one line for each.
    """
    several = bool(others) or isinstance(folder, (list, tuple))
    folders: list[str | Path] = []
    for one in (*(folder if isinstance(folder, (list, tuple)) else [folder]), *others):
        if not isinstance(one, (str, Path)):
            raise BadInput(f"folder = {shown(one)} must be a path, or several of them")
        one = str(user_path(one, "folder")) if isinstance(one, str) else one
        if isinstance(one, str) and glob.has_magic(one) and not Path(one).exists():
            several = True
            found = [name for name in glob.glob(one) if Path(name).is_dir()]
            if not found:
                raise BadInput(f"no folder has a name like {one}")
            folders += sorted(found, key=lambda name: _natural(str(name)))
        else:
            folders.append(one)
    if several:
        return Runs(folders)
    is_sweep = (Path(folders[0]) / files.SWEEP_CSV).exists()
    return Sweep(folders[0]) if is_sweep else Run(folders[0])


def _natural(name: str) -> list[tuple[int, str]]:
    """Key of an order in which seed-2 precedes seed-10."""
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", name)]
