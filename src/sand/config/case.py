"""Case files: TOML that builds the same objects as a script."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, PrivateAttr, ValidationError, create_model, field_validator, model_validator

from ..box import Box, as_box
from ..contact.model import Contact
from ..errors import BadInput, did_you_mean
from ..forces.external.electric_field import ElectricField
from ..forces.external.gravity import Gravity
from ..forces.external.magnetic_field import Field as MagneticField
from ..forces.gas.model import Gas
from ..forces.pair.dipoles import Dipoles
from ..forces.pair.inverse_square import Attraction, Charges
from ..grains import moment_size
from ..integrate.adaptive import Adaptive
from ..integrate.verlet import Verlet
from ..io.run_folder import read_toml
from ..material import PRESETS, Material, like_preset
from ..neighbours.settings import Neighbours
from ..setup.gas import SPINS
from .commands import refuse_other_command
from .errors import validation_errors
from .sections import Count, Duration, PathName, Section, Seed, Steps, quantity

INTEGRATORS: dict[str, type] = {"verlet": Verlet, "adaptive": Adaptive}


class RunSection(Section):
    """[run]: how long (a time, or a number of steps), how often, which seed, where to."""

    until: Duration | None = None
    """End of the run [s], simulated time; either this or `steps` is required."""
    steps: Steps | None = None
    """End of the run as a number of steps, completed to the end of the cycle; with both, whichever is reached first."""
    frame_every: Duration | None = None
    """Time between frames and rows of the ledger [s]; by default 1/200 of the run."""
    seed: Seed = 0
    """Seed of all random numbers: initial conditions and random kicks of a gas."""
    out: PathName | None = None
    """Folder of the run."""

    @model_validator(mode="after")
    def _ends(self) -> RunSection:
        if self.until is None and self.steps is None:
            raise ValueError("until is missing; add it, for example until = '5 us'")
        return self


class BoxSection(Section):
    """[box]: periodic = one length or three, "open" for an open axis; nothing: open space."""

    periodic: Any = None
    """Length of a cube or list of three lengths [m], "open" for an open axis; none: open space."""

    @field_validator("periodic", mode="after")
    @classmethod
    def _read(cls, value: Any) -> Box:
        if isinstance(value, list):
            value = [None if v == "open" else v for v in value]
        return as_box(value)


class MaterialSection(Section):
    """[materials.NAME]: a new material, or changes to the one it is `like`."""

    like: str | None = None
    density: Any = None
    surface_energy: Any = None
    young_modulus: Any = None
    poisson_ratio: Any = None
    rolling_limit: Any = None
    specific_moment: Any = None

    def build(self, name: str) -> Material:
        """Raises BadInput for missing or impossible numbers."""
        given = {k: v for k, v in self.model_dump(exclude={"like"}).items() if v is not None}
        if self.like is not None:
            return like_preset(self.like, name).but(name=name, **given)
        needed = ("density", "young_modulus", "poisson_ratio")
        missing = [key for key in needed if key not in given]
        if missing:
            raise BadInput(f"{name} lacks {', '.join(missing)}; give them, or like = 'iron'")
        return Material(name, **({"surface_energy": None} | given))


class GrainsSection(Section):
    """[grains]: a gas of grains, or those of a `file`: a frame of a trajectory, or a body; "given": from a script."""

    kind: Literal["gas", "file", "given"] = "gas"
    """`gas`: random positions; `file`: grains of a frame or body; `given`: case file of a run from a script."""
    number: Count | None = None
    """Number of grains."""
    radius: quantity("m", above=0.0) | None = None  # type: ignore[valid-type]
    """Radius of each grain [m]; for a body from a file only if the file has none."""
    material: str | list[str] = "iron"
    """Preset or name in [materials]; for a body from a file it takes precedence over the file's material."""
    moment: Any = None
    """Moment of each grain [A m^2], per mass ("200 A m^2/kg"), or "material"; none: no moment."""
    charge: quantity("C") | None = None  # type: ignore[valid-type]
    """Charge of each grain [C]; none: no charge."""
    temperature: quantity("K", least=0.0) = 0.0  # type: ignore[valid-type]
    """Temperature of velocities and spins [K]."""
    spins: str = "kT/2"
    """Mean rotational energy: `kT/2`, `equipartition` (3/2 kT) or `none`."""
    file: PathName | None = None
    """Trajectory or body (`.gsd`), run folder, extended XYZ (`.xyz`), or columns x y z [r] (`.txt`, `.dat`)."""
    frame: Annotated[int, Field(ge=-(2**31), lt=2**31, strict=True)] = -1
    """Index of the frame of a trajectory; −1 is the last."""
    length: str | None = None
    """Unit of the file's lengths, such as 1 nm; default 1 Å in extended XYZ, 1 m in columns."""

    @field_validator("moment")
    @classmethod
    def _moment(cls, value: Any) -> Any:
        if value is not None:
            moment_size(value, np.ones(1))
        return value

    @field_validator("spins")
    @classmethod
    def _spins(cls, value: str) -> str:
        if value not in SPINS:
            raise ValueError(f"spins = {value!r}; {did_you_mean(value, list(SPINS))}")
        return value

    @model_validator(mode="after")
    def _whole(self) -> GrainsSection:
        needed, foreign = GRAINS_NEED[self.kind]
        problems = [
            f"{name} is missing; add it, for example {name} = {example}"
            for name, example in needed.items()
            if getattr(self, name) is None
        ]
        told = [name for name in foreign if name in self.model_fields_set]
        problems += [f"{name} is not for kind = '{self.kind}'; remove it, or change kind" for name in told]
        if problems:
            raise ValueError("\n".join(problems))
        return self

    def recipe(self) -> dict[str, Any]:
        """What a case file says to have these grains, all defaults filled in."""
        _, foreign = GRAINS_NEED[self.kind]
        return self.model_dump(exclude_none=True, exclude=set(foreign))


GRAINS_NEED: dict[str, tuple[dict[str, str], tuple[str, ...]]] = {
    "gas": ({"number": "125", "radius": "'10 nm'"}, ("file", "frame", "length")),
    "file": ({"file": "'run/trajectory.gsd'"}, ("number", "moment", "charge", "temperature", "spins")),
    "given": ({"number": "125"}, ("file", "frame", "length")),
}
"""By kind: keys it cannot do without, with an example, and keys that it has no use for."""


class ForcesSection(Section):
    """[forces.*]: each table switches one force on."""

    contact: Contact | None = None
    dipoles: Dipoles | None = None
    field: MagneticField | None = None
    gravity: Gravity | None = None
    electric: ElectricField | None = None
    charges: Charges | None = None
    attraction: Attraction | None = None
    gas: Gas | None = None
    _order: tuple[str, ...] = PrivateAttr(())

    @model_validator(mode="wrap")
    @classmethod
    def _in_order(cls, value: Any, handler: Any) -> Any:
        section = handler(value)
        if isinstance(value, dict):
            section._order = tuple(value)
        return section

    def build(self) -> list[Any]:
        """The forces that are given, in the order of the file: sums are added in it."""
        given = {key: getattr(self, key) for key in type(self).model_fields}
        order = [*(key for key in self._order if key in given), *given]
        return [given[key] for key in dict.fromkeys(order) if given[key] is not None]


def integrator(value: Any) -> Any:
    """[stepping] without its `method`, which has picked the model by then (`with_integrator`)."""
    if isinstance(value, dict) and "method" in value:
        value = dict(value)
        method = value.pop("method")
        if str(method) not in INTEGRATORS:
            raise ValueError(f"method = {method!r}; {did_you_mean(str(method), list(INTEGRATORS))}")
    return value


def with_integrator(model: type[Any], content: dict[str, Any]) -> type[Any]:
    """The model of a case file whose [stepping] has the keys of the method that `content` names."""
    given = content.get("stepping")
    kind = INTEGRATORS.get(str(given.get("method", "verlet"))) if isinstance(given, dict) else None
    if kind is None or kind is model.model_fields["stepping"].annotation:
        return model
    return create_model(model.__name__, __base__=model, stepping=(kind, kind()))


class Case(Section):
    """A whole case file."""

    run: RunSection
    box: BoxSection = BoxSection()
    grains: GrainsSection
    materials: dict[str, MaterialSection] = Field(default_factory=dict)
    forces: ForcesSection = ForcesSection()
    stepping: Verlet = Verlet()
    neighbours: Neighbours = Neighbours()

    @field_validator("stepping", mode="before")
    @classmethod
    def _method(cls, value: Any) -> Any:
        return integrator(value)

    def materials_by_name(self) -> dict[str, Material]:
        """Presets and the case's own materials by name.  Raises BadInput."""
        own, problems = {}, []
        for name, section in self.materials.items():
            try:
                own[name] = section.build(name)
            except BadInput as error:
                problems += error.at("materials").problems
        if problems:
            raise BadInput(problems)
        return {**PRESETS, **own}


def wrong_materials(content: dict[str, Any]) -> list[str]:
    """Complaints about numbers in [materials], where a mistake elsewhere keeps the case from being built."""
    problems: list[str] = []
    own = content.get("materials", {})
    for name, section in own.items() if isinstance(own, dict) else ():
        try:
            MaterialSection.model_validate(section).build(name)
        except ValidationError:
            continue  # told with the rest
        except BadInput as error:
            problems += error.at("materials").problems
    return problems


def _unknown_materials(content: dict[str, Any]) -> list[str]:
    """Complaints about names in [grains] that are neither presets nor in [materials]."""
    grains, own = content.get("grains"), content.get("materials", {})
    given = grains.get("material", []) if isinstance(grains, dict) else []
    names = [given] if isinstance(given, str) else given if isinstance(given, list) else []
    known = [*PRESETS, *(own if isinstance(own, dict) else [])]
    return [
        f"grains.material: unknown material '{name}'; {did_you_mean(str(name), known)}"
        for name in names
        if str(name) not in known
    ]


def read_case(path: str | Path) -> Case:
    """Read and check a case file.

    Raises
    ------
    BadInput
        every mistake of the file, one line each, with its place.
    """
    content = read_toml(path)
    refuse_other_command(content, path, "run")
    case = check_case(content, str(path))
    if case.grains.file is not None:  # as seen from the case file
        case.grains.file = str((Path(path).parent / Path(case.grains.file).expanduser()).absolute())
    return case


def check_case(content: dict[str, Any], name: str) -> Case:
    """A Case from a dictionary; `name` stands in front of each complaint.  Raises BadInput."""
    kinds: dict[type, list[str]] = {k: ["method"] for k in INTEGRATORS.values()}
    model = with_integrator(Case, content)
    problems = _unknown_materials(content)
    try:
        case = model.model_validate(content)
        case.materials_by_name()
    except ValidationError as error:
        problems += wrong_materials(content)
        problems += [line for slip in error.errors() for line in validation_errors(slip, model, kinds)]
    except BadInput as error:
        problems += error.problems
    if problems:
        raise BadInput(f"{name}: {problem}" for problem in problems)
    return case
