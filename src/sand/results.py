"""A run's folder to be looked at: frames, ledger, contacts, summary, each read when asked for."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .analysis.clusters import cluster_labels
from .analysis.ledger_columns import Books
from .arguments import checked
from .config.case import read_case
from .errors import BadInput, NoSuchKey, did_you_mean, shown
from .io import run_folder as files
from .io.export import export_frames
from .io.ledger_table import read_ledger
from .io.trajectory import Frame, Frames
from .optional import optional
from .setup.from_frame import from_frame
from .simulation.simulation import Simulation
from .units import si
from .viewer.simulation_view import read_field, view_folder

if TYPE_CHECKING:
    from .plotting.render.still import Still


class Columns(dict[str, np.ndarray]):
    """Columns by name; a name that is none of them is refused with the nearest one."""

    def __missing__(self, name: Any) -> np.ndarray:
        """Raises BadInput, which is a KeyError too."""
        raise NoSuchKey(f"there is no column {shown(name)}; {did_you_mean(str(name), list(self))}")


@checked
class Run:
    """What `sand.open(DIR)` gives; nothing is read before it is asked for; only `export` and `view` write.

    A run that is still going can be looked at: open it again to see what has come since.

    Parameters
    ----------
    folder : str or Path
        of a run.

    Raises
    ------
    BadInput
        there is no run in it.
    """

    def __init__(self, folder: str | Path):
        self.folder = Path(folder)
        if not self.folder.is_dir():
            raise BadInput(f"there is no folder {folder}")
        if not (self.folder / files.TRAJECTORY).exists():
            if (self.folder / files.CASE).exists():
                raise BadInput(f"{folder} has no {files.TRAJECTORY} yet; wait until its run has written a frame")
            raise BadInput(f"{folder} is not the folder of a run: there is no {files.TRAJECTORY} in it")

    @cached_property
    def frames(self) -> Frames:
        """The frames, a sequence; each is read when asked for.  Raises BadInput for a broken trajectory."""
        return Frames(self.folder / files.TRAJECTORY)

    @cached_property
    def ledger(self) -> dict[str, np.ndarray]:
        """Columns of the ledger by name (K,), SI.  Raises BadInput."""
        books = Books.of(read_ledger(self.folder / files.LEDGER))
        return Columns({name: books[name] for name in books.columns})

    @cached_property
    def case(self) -> dict[str, Any]:
        """The case as understood.  Raises BadInput."""
        return files.read_toml(self.folder / files.CASE)

    @property
    def summary(self) -> dict[str, Any]:
        """How the run ended; raises BadInput while it has not."""
        return files.read_json(self.folder / files.SUMMARY)

    @checked
    def contacts(self, frame: int = -1) -> dict[str, np.ndarray]:
        """Contacts of a frame: pair (C, 2), overlap [m], formed [s] (C,), force on the first [N] (C, 3)."""
        one = self.frames[frame]
        return Columns({"pair": one.pair, "overlap": one.overlap, "formed": one.formed, "force": one.force})

    @checked
    def at(self, frame: int = -1) -> Simulation:
        """A new simulation in memory, its clock at 0, with the grains, contacts, box and forces of a frame.

        Its `loads()`, `at_grains()` and `contacts` say what a frame does not hold: energies, fields, torques.

        Raises
        ------
        BadInput
            see `setup.from_frame`; or a force that a case file cannot name.
        """
        case = read_case(self.folder / files.CASE)
        start = from_frame(self.frames[frame], case.materials_by_name())
        return Simulation(
            start.grains,
            case.forces.build(),
            box=start.box,
            contacts=start.contacts,
            stepping=case.stepping,
            neighbours=case.neighbours,
            seed=case.run.seed,
        )

    @checked
    def view(self, path: str | Path | None = None) -> Any:
        """The grains in motion, as `Simulation.view`.

        Parameters
        ----------
        path : str or Path or None, optional
            of the page; view.html in the run's folder by default.

        Raises
        ------
        BadInput
            there is no frame yet, or the trajectory is broken.
        """
        return view_folder(self.folder, path, lambda: self.at(-1).figure())

    @checked
    def flux_density(self, time: Any) -> np.ndarray | None:
        """Of the outside magnetic field of the case at a time [s], (3,) [T]; None without one, see `read_field`."""
        now, field = si(time, "s", "time"), read_field(self.folder)
        return None if field is None else np.asarray(field[1](now))

    @checked
    def picture(self, frame: int = -1, **how: Any) -> Still:
        """A still picture of a frame, with the outside field of the case; it shows itself in a notebook.

        Parameters
        ----------
        how
            see `plotting.render.still.still_picture`: colour, bonds, arrows, view, size, dark, transparent, cluster, …

        Raises
        ------
        BadInput
            no such frame, an unknown quantity or view, one line for each mistake.
        """
        from .plotting.render.still import still_picture

        one = self.frames[frame]
        return still_picture(one, **({"field": self.flux_density(one.time)} | how))

    @checked
    def export(self, form: str, stem: str | Path | None = None, frames: slice = slice(None)) -> list[Path]:
        """Write frames for another program; returns the files.

        Parameters
        ----------
        form : str
            "xyz", "lammps-dump", "lammps-data" or "vtk".
        stem : str or Path or None, optional
            path without ending; "trajectory" in the run's folder by default.
        frames : slice, optional
            which.

        Raises
        ------
        BadInput
            an unknown format, no frame, no such folder.
        """
        place = self.folder / "trajectory" if stem is None else Path(stem)
        return export_frames(self.frames[frames], place, form, cluster_labels)

    def to_xarray(self) -> Any:
        """All frames as an xarray Dataset with dimensions frame, grain and axis, SI; xarray has to be installed."""
        xarray = optional("xarray", "to_xarray")
        whole: list[Frame] = list(self.frames)
        vectors = ("position", "velocity", "moment", "spin")
        data = {
            name: (("frame", "grain", "axis"), np.array([getattr(one, name) for one in whole]), {"units": unit})
            for name, unit in zip(vectors, ("m", "m/s", "A m^2", "rad/s"), strict=True)
        }
        labels = np.array([cluster_labels(len(one), one.pair) for one in whole])
        coordinates = {
            "time": ("frame", np.array([one.time for one in whole]), {"units": "s"}),
            "step": ("frame", np.array([one.step for one in whole])),
            "radius": ("grain", whole[0].radius, {"units": "m"}),
            "material": ("grain", np.array(whole[0].materials)[whole[0].material]),
            "axis": ("axis", list("xyz")),
        }
        return xarray.Dataset(data | {"cluster": (("frame", "grain"), labels)}, coords=coordinates)

    def to_pandas(self) -> Any:
        """The ledger as a pandas DataFrame; pandas has to be installed."""
        return optional("pandas", "to_pandas").DataFrame(self.ledger)

    def __repr__(self) -> str:
        return f"<run in {self.folder}: {len(self.frames)} frames>"


open = Run
"""`sand.open(DIR)`: a run's folder to be looked at."""
