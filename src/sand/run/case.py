"""Case files: TOML that builds the same objects as a script."""

from __future__ import annotations

import dataclasses
import typing
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from ..core.box import Box, as_box
from ..core.errors import BadInput, did_you_mean
from ..core.grains import Grains, moment_size
from ..core.material import PRESETS, Material, material_named
from ..core.units import si
from ..forces.contact import Contact
from ..forces.dipoles import Dipoles
from ..forces.field import Field as MagneticField
from ..setup.gas import SPINS, gas
from ..stepping.verlet import Verlet
from .simulation import Simulation

INTEGRATORS = {"verlet": Verlet}


def quantity(unit: str, **bounds: float) -> Any:
    """A number with a unit, as text or in SI."""

    def read(value: Any, info: ValidationInfo) -> float:
        return si(value, unit, str(info.field_name), **bounds)

    return Annotated[Any, BeforeValidator(read)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", arbitrary_types_allowed=True)


class RunSection(_Section):
    """[run]: how long, how often, which seed, where to."""

    until: quantity("s", above=0.0)  # type: ignore[valid-type]
    frame_every: quantity("s", above=0.0) | None = None  # type: ignore[valid-type]
    seed: Annotated[int, Field(ge=0, strict=True)] = 0
    out: str | None = None


class BoxSection(_Section):
    """[box]: periodic = one length or three, "open" for an open axis; nothing: open space."""

    periodic: Any = None

    @field_validator("periodic", mode="after")
    @classmethod
    def _read(cls, value: Any) -> Box:
        if isinstance(value, list):
            value = [None if v == "open" else v for v in value]
        return as_box(value)


class MaterialSection(_Section):
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
            return material_named(self.like).but(name=name, **given)
        needed = ("density", "surface_energy", "young_modulus", "poisson_ratio")
        missing = [key for key in needed if key not in given]
        if missing:
            raise BadInput(f"{name} lacks {', '.join(missing)}; give them, or like = 'iron'")
        return Material(name, **given)


class GrainsSection(_Section):
    """[grains]: a gas of grains; "given" marks runs whose grains came from a script."""

    kind: Literal["gas", "given"] = "gas"
    number: Annotated[int, Field(ge=1, strict=True)]
    radius: quantity("m", above=0.0) | None = None  # type: ignore[valid-type]
    material: str | list[str] = "iron"
    moment: Any = None
    temperature: quantity("K", least=0.0) = 0.0  # type: ignore[valid-type]
    spins: str = "kT/2"

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
        if self.kind == "gas" and self.radius is None:
            raise ValueError("radius is missing; add it, for example radius = '10 nm'")
        return self


class ForcesSection(_Section):
    """[forces.*]: each table switches one force on."""

    contact: Contact | None = None
    dipoles: Dipoles | None = None
    field: MagneticField | None = None

    def build(self) -> list[Any]:
        """The forces that are given, in a fixed order."""
        return [f for f in (self.contact, self.dipoles, self.field) if f is not None]


class Case(_Section):
    """A whole case file."""

    run: RunSection
    box: BoxSection = BoxSection()
    grains: GrainsSection
    materials: dict[str, MaterialSection] = {}
    forces: ForcesSection = ForcesSection()
    stepping: Verlet = Verlet()

    @field_validator("stepping", mode="before")
    @classmethod
    def _method(cls, value: Any) -> Any:
        if isinstance(value, dict) and "method" in value:
            value = dict(value)
            method = value.pop("method")
            if method not in INTEGRATORS:
                raise ValueError(f"method = {method!r}; {did_you_mean(str(method), list(INTEGRATORS))}")
        return value

    def library(self) -> dict[str, Material]:
        """Presets and the case's own materials by name.  Raises BadInput."""
        own, problems = {}, []
        for name, section in self.materials.items():
            try:
                own[name] = section.build(name)
            except BadInput as error:
                problems += error.at("materials").problems
        names = [self.grains.material] if isinstance(self.grains.material, str) else self.grains.material
        known = {**PRESETS, **own}
        for name in names:
            if name not in known and name not in self.materials:
                problems.append(
                    f"grains.material: unknown material '{name}'; {did_you_mean(name, list(known))}"
                )
        if problems:
            raise BadInput(problems)
        return known


def read_case(path: str | Path) -> Case:
    """Read and check a case file.

    Raises:
        BadInput: every mistake of the file, one line each, with its place.
    """
    from ..files.folder import read_toml

    return check_case(read_toml(path), str(path))


def check_case(content: dict[str, Any], name: str) -> Case:
    """A Case from a dictionary; `name` stands in front of each complaint.  Raises BadInput."""
    try:
        case = Case.model_validate(content)
    except ValidationError as error:
        lines = [f"{name}: {line}" for slip in error.errors() for line in _complaints(slip)]
        raise BadInput(lines) from None
    try:
        case.library()
    except BadInput as error:
        raise error.at(name) from None
    return case


def _complaints(slip: Any) -> list[str]:
    """pydantic's error as our lines: place, what is wrong, what to do."""
    place = ".".join(str(part) for part in slip["loc"] if not str(part).startswith("function-"))
    if slip["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        keys = _keys_at(slip["loc"][:-1])
        return [f"{place}: there is no such key; {did_you_mean(str(slip['loc'][-1]), keys)}"]
    if slip["type"] == "missing":
        return [f"{place} is missing; add it"]
    if slip["type"] == "value_error":
        return [f"{place}: {line}" for line in str(slip["ctx"]["error"]).splitlines()]
    return [f"{place} = {slip['input']!r}: {slip['msg'][0].lower()}{slip['msg'][1:]}"]


def _keys_at(places: tuple[Any, ...]) -> list[str]:
    """The keys allowed at a place of the case file."""
    here: Any = Case
    for place in places:
        fields = _annotations(here)
        if place not in fields:
            here = fields.get("*", here)
            continue
        here = fields[place]
    return [k for k in _annotations(here) if k != "*"]


def _annotations(kind: Any) -> dict[str, Any]:
    inner = [a for a in typing.get_args(kind) if a is not type(None)]
    if typing.get_origin(kind) is dict:
        return {"*": inner[1]}
    for candidate in (kind, *inner):
        if isinstance(candidate, type) and issubclass(candidate, BaseModel):
            return {k: f.annotation for k, f in candidate.model_fields.items()}
        if dataclasses.is_dataclass(candidate):
            extra = ["method"] if candidate in INTEGRATORS.values() else []
            return dict.fromkeys([*extra, *(f.name for f in dataclasses.fields(candidate))])
    return {}


def simulation_of(case: Case, out: str | Path | None, **options: Any) -> Simulation:
    """The simulation a case describes.

    Args:
        out: folder for its files, None for none.
        options: passed on to `Simulation` (observers, overwrite).

    Raises:
        BadInput: what only shows when grains, forces and box come together.
    """
    if case.grains.kind != "gas":
        raise BadInput(
            "grains.kind = 'given': these grains came from a script; use `sand resume` on the folder"
        )
    section, library = case.grains, case.library()
    if not isinstance(section.material, str):
        raise BadInput("grains.material of a gas must be one name")
    grains = gas(
        section.number,
        case.box.periodic,
        radius=section.radius,
        material=library[section.material],
        moment=section.moment,
        temperature=section.temperature,
        spins=section.spins,
        seed=case.run.seed,
    )
    simulation = Simulation(
        grains,
        case.forces.build(),
        box=case.box.periodic,
        stepping=case.stepping,
        seed=case.run.seed,
        out=out,
        frame_every=case.run.frame_every,
        **options,
    )
    simulation.recipe = section.model_dump(exclude_none=True)
    return simulation


def case_of(simulation: Simulation, until: float) -> dict[str, Any]:
    """The case of a simulation, all defaults filled in, SI; what `sand resume` reads back."""
    materials = simulation.grains.materials
    recipe = simulation.recipe or {"kind": "given", "number": len(simulation.grains)}
    names = [m.name for m in materials]
    run = {"until": until, "frame_every": simulation.frame_every, "seed": simulation.seed or 0}
    forces = {}
    for force in simulation.forces:
        forces[force.name] = dict(force.parameters())
        if isinstance(force, Dipoles):
            radius = force.choose(simulation.start, simulation.box).radius
            forces[force.name]["cutoff"] = "none" if radius is None else radius
    lengths = ["open" if v is None else v for v in simulation.box.lengths]
    return {
        "run": {k: v for k, v in run.items() if v is not None and v < float("inf")},
        "box": {} if simulation.box.is_open else {"periodic": lengths},
        "grains": {**recipe, "material": names[0] if len(names) == 1 else names},
        "materials": {
            m.name: {k: v for k, v in dataclasses.asdict(m).items() if k != "name" and v is not None}
            for m in materials
        },
        "forces": forces,
        "stepping": simulation.stepping.parameters(),
    }


def resume_simulation(folder: str | Path, **options: Any) -> tuple[Simulation, float]:
    """The simulation of a folder at its newest checkpoint, and the time [s] it was to reach.

    Raises:
        BadInput: no checkpoint, a damaged one, or a case that needs forces SAND does not know.
    """
    from ..files.checkpoint import newest_checkpoint
    from ..files.folder import CASE

    place = Path(folder)
    if not place.is_dir():
        raise BadInput(f"there is no folder {place}")
    case = read_case(place / CASE)
    arrays, meta = newest_checkpoint(place)
    names = [case.grains.material] if isinstance(case.grains.material, str) else case.grains.material
    library = case.library()
    try:
        part = {name.split("/", 1)[1]: array for name, array in arrays.items() if name.startswith("grains/")}
        grains = Grains(
            part["position"].T,
            part["radius"],
            [library[names[i]] for i in part["material"]],
            velocity=part["velocity"].T,
            spin=part["spin"].T,
            moment=part["body_moment"].T,
            charge=part["charge"],
            mass=part["mass"],
        )
    except (KeyError, IndexError) as error:
        raise BadInput(f"the checkpoint in {place} does not fit its case.toml ({error})") from None
    simulation = Simulation(
        grains,
        case.forces.build(),
        box=case.box.periodic,
        stepping=case.stepping,
        seed=case.run.seed,
        out=place,
        frame_every=case.run.frame_every,
        restart=(arrays, meta),
        **options,
    )
    if case.grains.kind == "gas":
        simulation.recipe = case.grains.model_dump(exclude_none=True)
    return simulation, meta["until"] if meta["until"] is not None else case.run.until
