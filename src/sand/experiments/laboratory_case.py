"""Case files of `sand compress`, `sand stretch`, `sand shear` and `sand elastic`."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from ..basics.errors import BadInput, ErrorCollector
from ..basics.grains import Grains
from ..basics.material import Material
from ..basics.settings import For, Number, Whole, Word
from ..config.case import ForcesSection, MaterialSection, library_of, material_errors, read_content
from ..config.commands import command_for
from ..config.folders import without_run
from ..config.key_errors import validate
from ..config.sections import Moment, PathName, Section, Seeds, Stepping, with_integrator, with_keys
from ..integrate.verlet import Verlet
from ..io.frame import Frame
from ..io.run_folder import TRAJECTORY
from ..io.trajectory import Frames
from ..setup.aggregates import KINDS
from ..setup.deposit import deposit
from ..setup.from_file import from_trajectory, is_own_trajectory
from ..setup.from_frame import Start
from .collision_case import BodySection
from .elastic import Begun, Elastic, begin
from .laboratory import Plan, filling_factor, plan
from .laboratory_loading import Loading


class PackingSection(BodySection):
    """Section [aggregate]: an aggregate or deposit (another for each seed if it is random), a file, or a frame."""

    kind: Annotated[str, Word("file", "deposit", among=KINDS)]
    """Builder (as for `sand build`), `deposit` for a cake between walls, or `file`."""
    width: Annotated[
        Any, Number("m", above=0.0), For("kind", "deposit", needed="the side of its column, such as '6 um'")
    ] = None
    """Side of the column on which the grains of a deposit fall [m]; it is periodic along x and y."""
    contacts: Annotated[int | None, Whole(1, 3), For("kind", "deposit")] = None
    """Number of contacts to which a falling grain of a deposit rolls on: 1, at which it sticks at its first touch, by
    default; 2 or 3."""
    moment: Annotated[Moment, For("kind", "deposit", *KINDS)] = None
    """Moment of each magnetic grain [A m^2], per mass ("200 A m^2/kg"), or "material"; none: no moments."""
    frame: Annotated[int | None, Whole(-(2**31), 2**31 - 1), For("kind", "file")] = None
    """Index of the frame, if `file` is a run of SAND; −1, the last, by default. Of a folder with seed-1, seed-2, … each
    seed takes its own run."""
    filling: Annotated[Any, Number(above=0.0, below=1.0), For("kind", "file")] = None
    """Filling factor of the frame to take, instead of its index: the frame that is nearest to it."""

    def contradictions(self) -> Iterator[str]:
        """As those of a body, and two ways to choose a frame."""
        yield from super().contradictions()
        if self.frame is not None and self.filling is not None:
            yield "frame and filling both choose a frame; leave one of them out"
        for name in ("shape", "dimension", "prefactor") if self.kind == "deposit" else ():
            if getattr(self, name) is not None:
                yield f"{name} is not used by kind = 'deposit'; leave it out"

    def packing(self, materials: dict[str, Material], seed: int) -> Grains | Start:
        """The body, a deposit, or the frame with its contacts and box.  Raises BadInput."""
        if self.kind == "file":
            path = Path(str(self.file))
            path = own if (own := path / f"seed-{seed}").is_dir() else path
            if path.is_dir() and not (path / TRAJECTORY).exists():
                raise BadInput(f"file, for seed {seed}: {without_run(path)}")
            if is_own_trajectory(path):
                if extra := sorted(self.model_fields_set - {"kind", "file", "frame", "filling"}):
                    raise BadInput(f"{extra[0]}: the run {path} has it; leave {extra[0]} out")
                number = -1 if self.frame is None else self.frame
                if self.filling is not None:
                    number = frame_with(path, self.filling)
                return from_trajectory(path, number, materials)
        if self.kind == "deposit":
            names = ("radius", "width", "contacts", "moment", "moments", "magnetic")
            given = {name: value for name in names if (value := getattr(self, name)) is not None}
            return deposit(self.grains or 0, material=materials[self.material], seed=seed, **given)
        named = [name for name in ("frame", "filling") if getattr(self, name) is not None]
        if named and Path(str(self.file)).exists():
            raise BadInput(f"{named[0]} is for a run of SAND; {self.file} is another file: leave {named[0]} out")
        return self.build(materials, seed)


def frame_with(path: Path, filling: float) -> int:
    """Index of the frame of a run whose filling factor is nearest.  Raises BadInput if it is beyond all of them."""
    with contextlib.closing(Frames(path / TRAJECTORY if path.is_dir() else path)) as frames:
        found = np.array([_filling(frame) for frame in frames])
    if not found.size or not found.min() * (1.0 - 0.02) <= filling <= found.max() * (1.0 + 0.02):
        ends = f"from {found.min():.3g} to {found.max():.3g}" if found.size else "none"
        raise BadInput(f"filling = {filling:g}: the filling factors of the frames in {path} are {ends}")
    return int(np.abs(found - filling).argmin())


def _filling(frame: Frame) -> float:
    """Filling factor of a frame, along open axes within the extent of the grains."""
    position, radius = frame.position, frame.radius[:, None]
    extent = (position + radius).max(axis=0) - (position - radius).min(axis=0)
    lengths = [extent[k] if length is None else length for k, length in enumerate(frame.box.lengths)]
    return filling_factor(frame.radius, lengths)


class SeedsSection(Section):
    """Table of a command with one part for each seed."""

    kind: ClassVar[str]
    seeds: Seeds = Field(default_factory=lambda: [1])
    """One run for each seed."""
    out: PathName | None = None
    """Folder of the results."""

    def contradictions(self) -> Iterator[str]:
        """Those of the settings."""
        errors = ErrorCollector()
        errors.take(self.settings)
        yield from errors.problems

    def settings(self) -> Any:
        """The settings.  Raises BadInput."""
        raise NotImplementedError


@with_keys(Loading, "kind")
class LoadingSection(SeedsSection):
    """How the aggregate is loaded."""

    def settings(self) -> Loading:
        """The settings.  Raises BadInput."""
        return Loading(self.kind, **self.model_dump(exclude={"seeds", "out"}))


@with_keys(Elastic)
class ElasticSection(SeedsSection):
    """Section [elastic]: how moduli and speed of sound of a packing at rest are measured."""

    kind = "elastic"

    def settings(self) -> Elastic:
        """The settings.  Raises BadInput."""
        return Elastic(**self.model_dump(exclude={"seeds", "out"}))


class CompressionSection(LoadingSection):
    """Section [compression]: how the aggregate is compressed, by its periodic box or between two walls."""

    kind = "compress"


class StretchSection(LoadingSection):
    """Section [stretch]: how the aggregate is stretched, by its periodic box or between two walls."""

    kind = "stretch"


class ShearSection(LoadingSection):
    """Section [shear]: how the aggregate is sheared, by its periodic box or between two walls."""

    kind = "shear"


class PackingCase(Section):
    """Case file of a packing, without the table of the command."""

    aggregate: PackingSection
    materials: dict[str, MaterialSection] = Field(default_factory=dict)
    forces: ForcesSection = ForcesSection()
    stepping: Stepping = Verlet()

    @property
    def section(self) -> Any:
        """The table of the command."""
        return next(table for table in vars(self).values() if isinstance(table, SeedsSection))

    def physics(self) -> list[Any] | None:
        """Forces, as `laboratory.plan` takes them."""
        return self.forces.build() or None

    def packing(self, seed: int) -> Grains | Start:
        """The packing of a seed.  Raises BadInput."""
        return self.aggregate.packing(library_of(self.materials), seed)

    def first_plan(self) -> Any:
        """The plan of the first seed; files of all others are read, too, to find errors.  Raises BadInput."""
        first = self.plan(self.section.seeds[0])
        for seed in self.section.seeds[1:] if self.aggregate.kind == "file" else ():
            self.plan(seed)
        return first

    def plan(self, seed: int) -> Any:
        """The packing of a seed, and what is done with it.  Raises BadInput."""
        raise NotImplementedError


class LaboratoryCase(PackingCase):
    """Case file of `sand compress`, `sand stretch` or `sand shear`, without the table of the command."""

    def plan(self, seed: int) -> Plan:
        """The packing of a seed, and how it is loaded.  Raises BadInput."""
        return plan(self.packing(seed), self.section.settings(), self.physics())


class ElasticCase(PackingCase):
    """Case file of `sand elastic`."""

    elastic: ElasticSection

    def plan(self, seed: int) -> Begun:
        """The beginning of the measurement of a seed.  Raises BadInput."""
        return begin(self.packing(seed), self.section.settings(), self.physics(), {"stepping": self.stepping})


class CompressionCase(LaboratoryCase):
    """Case file of `sand compress`."""

    compression: CompressionSection


class StretchCase(LaboratoryCase):
    """Case file of `sand stretch`."""

    stretch: StretchSection


class ShearCase(LaboratoryCase):
    """Case file of `sand shear`."""

    shear: ShearSection


OF_COMMAND = {"compress": "compression", "stretch": "stretch", "shear": "shear", "elastic": "elastic"}
"""Table of the command."""
CASES: dict[str, type[PackingCase]] = {
    "compress": CompressionCase,
    "stretch": StretchCase,
    "shear": ShearCase,
    "elastic": ElasticCase,
}
"""Models of the case files, by command."""


def model_of(content: dict[str, Any], command: str | None = None) -> Any:
    """The model of a case file of a command, by default of that which its tables show."""
    return with_integrator(CASES[command or command_for(content) or ""], content)


def check_laboratory(content: dict[str, Any], name: str, command: str | None = None) -> Any:
    """Validate the content of a case file; `name` begins each message.  Raises BadInput."""
    problems = material_errors(content, ("aggregate",), "silica")
    return validate(model_of(content, command), content, name, problems)


def read_laboratory(path: str | Path, command: str) -> Any:
    """Read and check a case file of a command.  Raises BadInput, all errors of the file, one line each."""
    return check_laboratory(read_content(path, command), str(path), command)
