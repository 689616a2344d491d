"""Case files of `sand run`: TOML that describes the same objects as a script."""

from __future__ import annotations

import copy
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator, Field, PrivateAttr, ValidationError, create_model, model_validator

from ..basics.arguments import MOST_GRAINS, MOST_STEPS
from ..basics.box import Box, as_box
from ..basics.errors import BadInput, ErrorCollector, did_you_mean, naming
from ..basics.material import NEAREST, Library, Material, like_preset
from ..basics.settings import Flag, For, Number, Reading, Whole, Word
from ..components.deformation import Deformation, DeformedBox, box_columns
from ..components.driven import Driven
from ..forces.own import IMPORT, own_force
from ..forces.registry import FORCES
from ..integrate.integrator import INTEGRATORS, moves_bodies
from ..integrate.verlet import Verlet
from ..io.run_folder import read_toml
from ..neighbours.search import Neighbours
from ..setup.gas import SPINS
from ..setup.grain_classes import GrainClass, Materials, Radii, class_numbers
from ..simulation.condition import GIVEN, read_condition
from ..simulation.ledger import Ledger
from .commands import OF_FILES, refuse_other_command
from .key_errors import validate
from .sections import (
    Cadence,
    Duration,
    Moment,
    PathName,
    SaveCadence,
    Section,
    Seed,
    Stepping,
    method_of,
    with_integrator,
    with_keys,
)
from .wall_section import WallSection, wall_columns, wall_errors


def _condition(value: Any, name: str) -> Any:
    """Check a condition that ends a run.  Raises BadInput."""
    if value != GIVEN:
        read_condition(value)
    return value


class RunSection(Section):
    """[run]: end (a time, a number of steps, or a condition), cadences of output, seed and output folder."""

    until: Duration = None
    """End of the run [s], simulated time; this, `steps` or `stop` is required; with several, the first one reached."""
    steps: Annotated[int | None, Whole(1, MOST_STEPS)] = None
    """End of the run as a number of steps, completed to the end of the cycle."""
    stop: Annotated[str | None, Reading(_condition)] = None
    """Condition that ends the run, such as "clusters == 1" or "mean_cluster_size >= 20 and time > 1 us": columns of the
    ledger compared (< <= > >= == !=) with numbers with units; checked every 100 steps, with rigid clusters in every
    step. "wall > 23 h" stops the run after this wall time, to be continued. See `Simulation.run`."""
    frame_every: Cadence = None
    """Frames: a time between them [s], "1000 steps", or "log(10 per decade, from 1 ns)"; by default 1/200
    of the run."""
    row_every: Cadence = None
    """Further rows of the ledger, in the same forms; every frame has a row."""
    checkpoint_every: SaveCadence = None
    """Checkpoints, in the same forms or by wall time, "30 s wall"; by default at least every minute of wall time."""
    stress: Annotated[bool, Flag()] = False
    """Whether rows of the ledger have the pressure tensor, and frames the shares of the grains in it; see
    `Simulation.stress`."""
    seed: Seed = 0
    """Seed of all random numbers: initial conditions and random kicks of a gas."""
    out: PathName | None = None
    """Folder of the run."""

    def contradictions(self) -> Iterator[str]:
        """A run without an end."""
        if self.until is None and self.steps is None and self.stop is None:
            yield "until is missing; add it, for example until = '5 us'"


def _box(value: Any, name: str) -> Box:
    """The box of one length or three.  Raises BadInput."""
    return as_box([None if v == "open" else v for v in value] if isinstance(value, list) else value)


class BoxSection(Section):
    """[box]: periodic = one length or three, "open" for an open axis; without it, open space."""

    periodic: Annotated[Any, Reading(_box)] = None
    """Length of a cube or list of three lengths [m], "open" for an open axis; none: open space."""
    tilt: Annotated[Any, Number("m")] = None
    """Displacement [m] along x of the image one length beyond along z, as shear leaves it."""

    def contradictions(self) -> Iterator[str]:
        """A tilt of a box that is not periodic along all axes."""
        if self.tilt and (self.periodic is None or None in self.periodic.lengths):
            yield "tilt is for a box that is periodic along x, y and z; leave it out"

    @property
    def space(self) -> Any:
        """The box; None for open space."""
        return self.periodic and Box(self.periodic.lengths, self.tilt or 0.0)


@with_keys(Material, "name", optional=True)
class MaterialSection(Section):
    """[materials.NAME]: a new material, or changes to the one given by `like`."""

    like: str | None = None
    """Preset to start from. Without it, density, young_modulus and poisson_ratio are required."""

    def build(self, name: str) -> Material:
        """Build the material.  Raises BadInput for missing or impossible numbers."""
        given = {k: v for k, v in self.model_dump(exclude={"like"}).items() if v is not None}
        if self.like is not None:
            with naming(f"{name}.like"):
                preset = like_preset(self.like, name)
            return preset.but(name=name, **given)
        missing = [key for key in ("density", "young_modulus", "poisson_ratio") if key not in given]
        if missing:
            raise BadInput(f"{name} lacks {', '.join(missing)}; give them, or like = 'iron'")
        return Material(name, **({"surface_energy": None} | given))


def library_of(materials: dict[str, MaterialSection]) -> Library:
    """Presets and the materials of a case.  Raises BadInput for missing or impossible numbers."""
    return Library({name: section.build(name) for name, section in materials.items()})


class GrainsSection(Section):
    """[grains]: a gas of grains, or grains of a `file`: a frame, free grains or bodies; "given": from a script."""

    kind: Literal["gas", "file", "given"] = "gas"
    """`gas`: random positions; `file`: grains of a frame or body; `given`: case file of a run from a script."""
    number: Annotated[int | None, Whole(1, MOST_GRAINS), For("kind", "gas", "given")] = None
    """Number of grains. With `classes` the number of their members, grains and aggregates, of which each class has its
    `share`; where classes have a `number` each, this is the sum, and may be left out."""
    radius: Radii = None
    """Radius [m]: a length, `lognormal(MEDIAN, SIGMA, LEAST, MOST)`, `power law(EXPONENT, LEAST, MOST)`, or a list with
    one length for each grain; for a body from a file one length, only if the file has none."""
    material: Materials = "iron"
    """Preset or name in [materials], or fractions with the sum 1, `{silica = 0.7, iron = 0.3}`; for a body from a file
    it takes precedence over the file's material."""
    moment: Annotated[Moment, For("kind", "gas", "given")] = None
    """Moment of each grain [A m^2], per mass ("200 A m^2/kg"), or "material"; none: no moment."""
    charge: Annotated[Any, Number("C"), For("kind", "gas", "given")] = None
    """Charge of each grain [C]; none: no charge."""
    temperature: Annotated[Any, Number("K", least=0.0), For("kind", "gas", "given")] = 0.0
    """Temperature of velocities and spins [K]."""
    spins: Annotated[str, Word(among=SPINS), For("kind", "gas", "given")] = "kT/2"
    """Mean rotational energy: `kT/2`, `equipartition` (3/2 kT) or `none`."""
    exact_temperature: Annotated[bool, Flag(), For("kind", "gas", "given")] = True
    """Whether velocities and spins are scaled to exactly this temperature; otherwise they are random draws."""
    classes: Annotated[list[GrainClass], For("kind", "gas")] = Field(default_factory=list)
    """Classes of grains and aggregates, each a table [[grains.classes]]; see below."""
    extent: Annotated[Any, For("kind", "gas")] = None
    """Length of the gas along open axes of the box [m]: one, or three with "periodic" along periodic axes; the gas is
    centred on the origin, and its members are wholly inside."""
    file: Annotated[PathName | None, For("kind", "file", needed="one, such as file = 'run/trajectory.gsd'")] = None
    """Run folder, trajectory or body of SAND, or a file of another program: XYZ, columns, CSV, LAMMPS data and dump,
    GSD; its content tells the format."""
    frame: Annotated[int, Whole(-(2**31), 2**31 - 1), For("kind", "file")] = -1
    """Index of the frame; −1 is the last."""
    length: Annotated[str | None, For("kind", "file")] = None
    """Unit of the file's lengths, such as 1 nm; default 1 Å in XYZ, 1 m in columns; GSD of other programs needs it."""

    def contradictions(self) -> Iterator[str]:
        """Numbers and radii that are missing, or do not fit the classes; fractions of a file."""
        if self.kind != "gas" and isinstance(self.material, dict):
            yield "material: fractions are for kind = 'gas'; give one name"
        if self.kind != "file" and self.number is None and not self.classes:
            yield "number is missing; add it, for example number = 125"
        if self.kind == "gas" and self.radius is None and not self.classes:
            yield "radius is missing; add it, for example radius = '10 nm'"
        if self.kind == "gas" and self.classes:
            errors = ErrorCollector()
            errors.take(class_numbers, self.classes, self.number)
            yield from errors.problems
            for k, one in enumerate(self.classes):
                if one.kind != "file" and one.radius is None and self.radius is None:
                    yield f"classes[{k}]: radius is missing; add it here, or to [grains]"

    def recipe(self) -> dict[str, Any]:
        """The [grains] table that describes these grains, all defaults filled in."""
        foreign = {name for name, condition in self.conditions().items() if self.kind not in condition.values}
        described = self.model_dump(exclude_none=True, exclude=foreign)
        return described if self.classes else {k: v for k, v in described.items() if k != "classes"}


THERMAL = ("temperature", "spins", "exact_temperature")
"""Keys of velocities and spins, which a file gives itself."""


class _Forces(Section):
    """[forces.*]: each table adds one force."""

    _order: tuple[str, ...] = PrivateAttr(())
    _own: dict[str, dict[str, Any]] = PrivateAttr(default_factory=dict)  # forces of the user, which are not imported

    @model_validator(mode="wrap")
    @classmethod
    def _in_order(cls, value: Any, handler: Any) -> Any:
        if not isinstance(value, dict):
            return handler(value)
        own = {key: table for key, table in value.items() if isinstance(table, dict) and IMPORT in table}
        section = handler({key: table for key, table in value.items() if key not in own})
        section._order, section._own = tuple(value), own
        return section

    def build(self) -> list[Any]:
        """Build the forces in the order of the file, in which loads are summed.

        Raises
        ------
        BadInput
            If a force of the user has not been imported, or its parameters are invalid.
        """
        given = {key: getattr(self, key) for key in type(self).model_fields}
        for key, table in self._own.items():
            with naming(f"forces.{key}"):
                given[key] = own_force(table)
        order = [*(key for key in self._order if key in given), *given]
        return [given[key] for key in dict.fromkeys(order) if given[key] is not None]


def _table_of(force: type) -> Any:
    """What reads the table of a force; that of contacts may name a paper by `like`."""
    if not hasattr(force, "with_paper"):
        return force | None

    def read(table: Any) -> Any:
        """The table with the settings of the paper; without an unknown one, which `material_errors` reports."""
        try:
            return force.with_paper(table)
        except BadInput:
            return {key: value for key, value in table.items() if key != "like"}

    return Annotated[force | None, BeforeValidator(read)]


if TYPE_CHECKING:

    class ForcesSection(_Forces):
        """[forces.*], with one key for each registered force."""
else:
    ForcesSection = create_model(
        "ForcesSection",
        __base__=_Forces,
        __module__=__name__,
        __doc__=_Forces.__doc__,
        **{name: (_table_of(force), None) for name, force in FORCES.items()},
    )


COMPONENTS: dict[str, type] = {"walls": WallSection, "driven": Driven, "deformation": Deformation}
"""The tables of components, and what reads them."""


class Case(Section):
    """The content of a case file of `sand run`."""

    run: RunSection
    box: BoxSection = BoxSection()
    grains: GrainsSection
    materials: dict[str, MaterialSection] = Field(default_factory=dict)
    forces: ForcesSection = ForcesSection()
    walls: list[WallSection] = Field(default_factory=list)
    stepping: Stepping = Verlet()
    neighbours: Neighbours = Neighbours()
    driven: list[Driven] = Field(default_factory=list)
    deformation: Deformation | None = None

    def components(self) -> dict[str, Any]:
        """What the case has of each component, by its keyword of `sand.Simulation`."""
        walls = [wall.build(self.materials_by_name()) for wall in self.walls]
        return {"walls": walls, "driven": self.driven, "deformation": self.deformation}

    def materials_by_name(self) -> Library:
        """Presets and the materials of the case, by name."""
        return library_of(self.materials)


def material_errors(content: dict[str, Any], tables: Iterable[str], default: str | None = None) -> list[str]:
    """Error messages for numbers in [materials] and [[walls]], and for materials and presets that do not exist.

    Parameters
    ----------
    content : dict[str, Any]
        The content of a case file, not validated yet.
    tables : Iterable[str]
        Tables with a key `material`.
    default : str, optional
        Value of this key where it is missing; None if there is none.
    """
    problems: list[str] = []
    materials = content.get("materials", {})
    own = materials if isinstance(materials, dict) else {}
    for name, section in own.items():
        try:
            MaterialSection.model_validate(section).build(name)
        except ValidationError:
            continue  # reported by the validation of the whole file
        except BadInput as error:
            problems += error.at("materials").problems
    known = Library(own)
    for table in tables:
        section = content.get(table)
        if not isinstance(section, dict):
            continue
        classes = section.get("classes")
        parts = {table: section.get("material", default)}
        for k, one in enumerate(classes if isinstance(classes, list) else []):
            parts[f"{table}.classes[{k}]"] = one.get("material") if isinstance(one, dict) else None
        for place, given in parts.items():
            for name in given if isinstance(given, (list, dict)) else [] if given is None else [given]:
                if isinstance(name, str) and name not in known:
                    problems.append(
                        f"{place}.material: unknown material '{name}'; {did_you_mean(name, list(known), NEAREST)}"
                    )
    forces, errors = content.get("forces"), ErrorCollector()
    contact: Any = FORCES["contact"]
    errors.take(contact.with_paper, forces.get("contact") if isinstance(forces, dict) else None)
    problems += [f"forces.contact.{line}" for line in errors.problems]
    return problems + wall_errors(content.get("walls"), known)


def condition_errors(content: dict[str, Any]) -> list[str]:
    """Error messages for quantities in run.stop that the ledger will not have; `content` is not validated yet."""
    run, forces = content.get("run"), content.get("forces")
    text = run.get("stop") if isinstance(run, dict) else None
    names = list(forces) if isinstance(forces, dict) else []
    columns = [str(getattr(FORCES.get(name), "column", name)) for name in names if name != "contact"]
    try:
        condition = read_condition(text)
    except BadInput:  # reported by the validation of the whole file
        return []
    try:
        table = content.get("stepping")
        awake = isinstance(table, dict) and moves_bodies(INTEGRATORS.get(method_of(table)))
        stress = isinstance(run, dict) and run.get("stress") is True
        if isinstance(deformation := content.get("deformation"), dict):
            columns += [*box_columns(sheared="shear" in deformation), *DeformedBox(()).losses()]
        condition.check([*Ledger(awake=awake, stress=stress).columns, *columns, *wall_columns(content.get("walls"))])
    except BadInput as error:
        return error.at("run").problems
    return []


def read_case(path: str | Path) -> Case:
    """Read and check a case file.

    Raises
    ------
    BadInput
        If the file has errors; all of them, one line each, with their place.
    """
    return check_case(read_content(path, "run"), str(path))


def read_content(path: str | Path, command: str) -> dict[str, Any]:
    """Content of a case file of this command, with absolute paths of files.  Raises BadInput."""
    content = read_toml(path)
    refuse_other_command(content, path, command)
    return with_absolute_files(content, path)


def with_absolute_files(content: dict[str, Any], path: str | Path) -> dict[str, Any]:
    """The content of a case file with absolute paths, from names relative to the case file, of grains and bodies."""
    whole = {name: copy.deepcopy(table) if name in OF_FILES else table for name, table in content.items()}
    tables = [whole[name] for name in OF_FILES if isinstance(whole.get(name), dict)]
    for table in [*tables, *(one for each in tables for one in _tables_in(each.get("classes")))]:
        file = table.get("file")
        if isinstance(file, str) and file.strip() and "\0" not in file:  # others are reported by the validation
            table["file"] = str((Path(path).parent / os.path.expanduser(file)).absolute())
    return whole


def _tables_in(value: Any) -> list[dict[str, Any]]:
    """The tables of a list; none of anything else."""
    return [one for one in value if isinstance(one, dict)] if isinstance(value, list) else []


def check_case(content: dict[str, Any], name: str) -> Case:
    """Validate the content of a case file; `name` begins each message.  Raises BadInput."""
    problems = [*material_errors(content, ["grains"]), *condition_errors(content)]
    return validate(with_integrator(Case, content), content, name, problems)
