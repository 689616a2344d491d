"""Case files of collisions."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import as_completed
from functools import partial
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationError, field_validator, model_validator

from ..arguments import MOST_GRAINS
from ..config.bodies import body_from_file
from ..config.case import (
    INTEGRATORS,
    ForcesSection,
    MaterialSection,
    Section,
    integrator,
    quantity,
    with_integrator,
    wrong_materials,
)
from ..config.commands import BODIES, refuse_other_command
from ..config.errors import validation_errors
from ..config.sections import Count, PathName, Seed
from ..errors import BadInput, did_you_mean
from ..grains import Grains, moment_size
from ..integrate.verlet import Verlet
from ..io.run_folder import read_toml
from ..material import PRESETS, Material
from ..setup.aggregates import build
from ..setup.encounters import offset_of
from ..setup.moments import MOMENT_MODES
from ..setup.population import radii_of
from ..simulation.simulation import Simulation
from .collision import Approach, Collision, approach, prepare, resume_collision, run_to_end

BodyKind = Literal[
    "grain", "chain", "lattice", "hexagonal", "bpca", "pca", "bcca", "dla", "dlca", "fractal", "rbd", "file"
]
"""The builders, `setup.aggregates.KINDS`, and a file."""


class BodySection(Section):
    """[target] and [projectile]: an aggregate of some kind (another for each seed where chance makes it), or a file."""

    kind: BodyKind
    path: PathName | None = None
    length: str | None = None
    grains: Count | None = None
    shape: list[Count] | None = None
    radius: Any = None
    material: str = "silica"
    moment: Any = None
    moments: str | None = None
    magnetic: Any = None
    dimension: Any = None
    prefactor: Any = None

    @field_validator("radius")
    @classmethod
    def _radius(cls, value: Any) -> Any:
        return value if value is None else radii_of(value)

    @field_validator("moments")
    @classmethod
    def _moments(cls, value: str | None) -> str | None:
        if value is not None and value not in MOMENT_MODES:
            raise ValueError(f"moments = {value!r}; {did_you_mean(value, list(MOMENT_MODES))}")
        return value

    @field_validator("moment")
    @classmethod
    def _moment(cls, value: Any) -> Any:
        if value is not None:
            import numpy as np

            moment_size(value, np.ones(1))
        return value

    @model_validator(mode="after")
    def _whole(self) -> BodySection:
        if self.kind == "file" and self.path is None:
            raise ValueError("path is missing: which file holds the grains?")
        if self.kind != "file" and self.radius is None:
            raise ValueError("radius is missing; add it, for example radius = '0.1 um'")
        regular = self.kind in ("lattice", "hexagonal")
        if self.kind not in ("grain", "file") and not regular and self.grains is None:
            raise ValueError(f"grains is missing: how many does the {self.kind} have?")
        if regular and (self.shape is None or len(self.shape) != 3):
            raise ValueError("shape is missing: three whole numbers, such as [5, 5, 5]")
        if self.shape is not None and math.prod(self.shape) > MOST_GRAINS:
            raise ValueError(f"shape = {self.shape} has more than {MOST_GRAINS:.0e} grains")
        if self.moment is not None and self.kind == "file":
            raise ValueError("moment: a file brings its own moments; leave it out")
        return self

    def build(self, materials: dict[str, Material], seed: int) -> Grains:
        """Raises BadInput."""
        if self.kind == "file":
            own = materials[self.material]
            one = own if "material" in self.model_fields_set else None
            return body_from_file(str(self.path), one, self.radius, self.length, materials, otherwise=own)
        names = ("radius", "moment", "moments", "magnetic", "dimension", "prefactor")
        given = {name: getattr(self, name) for name in names}
        return build(self.kind, self.grains, shape=self.shape, seed=seed, material=materials[self.material], **given)


class ImpactSection(Section):
    """[impact]: how they meet, and how often."""

    speed: quantity("m/s", above=0.0)  # type: ignore[valid-type]
    impact_parameter: Any = 0.0
    along: Literal["x", "y", "z"] = "x"
    turn: bool = True
    seeds: list[Seed] = Field(default_factory=lambda: [1], min_length=1)
    out: PathName | None = None

    @field_validator("impact_parameter")
    @classmethod
    def _offset(cls, value: Any) -> Any:
        offset_of(value, 1.0)
        return value


class CollisionCase(Section):
    """A whole case file of `sand collide`."""

    target: BodySection
    projectile: BodySection
    impact: ImpactSection
    materials: dict[str, MaterialSection] = Field(default_factory=dict)
    forces: ForcesSection = ForcesSection()
    stepping: Verlet = Verlet()

    @field_validator("stepping", mode="before")
    @classmethod
    def _method(cls, value: Any) -> Any:
        return integrator(value)

    def approach(self, seed: int) -> Approach:
        """The bodies of one collision; with `turn` they are turned at random by the seed.  Raises BadInput."""
        materials = {**PRESETS, **{name: section.build(name) for name, section in self.materials.items()}}
        return approach(
            self.target.build(materials, 2 * seed),
            self.projectile.build(materials, 2 * seed + 1),
            speed=self.impact.speed,
            impact_parameter=self.impact.impact_parameter,
            along=self.impact.along,
            seed=seed if self.impact.turn else None,
        )

    def prepare(self, start: Approach, **options: Any) -> Simulation:
        """The simulation of one collision at its start; options as for `Simulation`.  Raises BadInput."""
        return prepare(start, self.forces.build() or None, self.stepping, **options)

    def resume_collision(self, start: Approach, folder: Path, **options: Any) -> Simulation:
        """The simulation of a collision that was interrupted, see `collision.resume_collision`.  Raises BadInput."""
        return resume_collision(start, folder, self.forces.build() or None, self.stepping, **options)

    def check(self) -> Simulation:
        """The first collision at its start, in memory, so that all that can be wrong with it is found.

        Raises
        ------
        BadInput
            what only shows when bodies, forces and materials come together.
        """
        return self.prepare(self.approach(self.impact.seeds[0]))

    def run(self, seed: int, **options: Any) -> tuple[Collision, Simulation]:
        """One collision; options as for `Simulation`.  Raises BadInput."""
        start = self.approach(seed)
        simulation = self.prepare(start, **options)
        return run_to_end(start, simulation), simulation


def wrong_bodies(content: dict[str, Any]) -> list[str]:
    """What is wrong with the materials of a case with a target and a projectile."""
    problems = wrong_materials(content)
    own = content.get("materials", {})
    known = [*PRESETS, *(own if isinstance(own, dict) else [])]
    for body in ("target", "projectile"):
        given = content.get(body)
        name = given.get("material", "silica") if isinstance(given, dict) else "silica"
        if str(name) not in known:
            problems.append(f"{body}.material: unknown material '{name}'; {did_you_mean(str(name), known)}")
    return problems


def with_absolute_paths(content: dict[str, Any]) -> dict[str, Any]:
    """The case with the bodies' files named so that they are found from any folder."""
    whole = dict(content)
    for body in BODIES & content.keys():
        given = content[body]
        if isinstance(given, dict) and isinstance(given.get("path"), str):
            whole[body] = {**given, "path": str(Path(given["path"]).absolute())}
    return whole


def read_collision(path: str | Path) -> CollisionCase:
    """Read and check a case file of `sand collide`.

    Raises
    ------
    BadInput
        every mistake of the file, one line each, with its place.
    """
    content = read_toml(path)
    refuse_other_command(content, path, "collide")
    problems = wrong_bodies(content)
    case, model = None, with_integrator(CollisionCase, content)
    try:
        case = model.model_validate(content)
    except ValidationError as error:
        extra: dict[type, list[str]] = {k: ["method"] for k in INTEGRATORS.values()}
        problems += [line for slip in error.errors() for line in validation_errors(slip, model, extra)]
    if problems or case is None:
        raise BadInput(f"{path}: {problem}" for problem in problems)
    return case


def run_seed(text: str, seed: int, observers: Sequence[Any] = ()) -> dict[str, Any]:
    """One collision of a case given as JSON, its outcome as a dictionary: what worker processes run."""
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        content = json.loads(text)
        case = with_integrator(CollisionCase, content).model_validate(content)
        return case.run(seed, observers=list(observers))[0].to_dict()


def run_seeds(
    case: dict[str, Any],
    seeds: list[int],
    executor: Any = None,
    known: dict[int, dict[str, Any]] | None = None,
    keep: Callable[[int, dict[str, Any]], None] | None = None,
    observers: Sequence[Any] = (),
) -> list[dict[str, Any]]:
    """The outcomes for many seeds in their order, on any `concurrent.futures.Executor` or here.

    Parameters
    ----------
    case : dict[str, Any]
        content of a case file that `read_collision` has accepted.
    known : dict[int, dict[str, Any]] or None, optional
        outcomes by seed that need not be computed again.
    keep : Callable[[int, dict[str, Any]], None] or None, optional
        called with each seed and its outcome as soon as it is there, in any order.
    observers : Sequence[Any], optional
        of the simulations, where there is no executor.
    """
    own: dict[str, Any] = {} if executor is not None else {"observers": observers}
    work, found = partial(run_seed, json.dumps(case), **own), dict(known or {})
    left = [seed for seed in dict.fromkeys(seeds) if seed not in found]
    for seed, outcome in _outcomes(work, left, executor):
        found[seed] = outcome
        if keep is not None:
            keep(seed, outcome)
    return [found[seed] for seed in seeds]


def _outcomes(
    work: Callable[[int], dict[str, Any]], seeds: list[int], executor: Any
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Each seed and its outcome, as they come."""
    if executor is None:
        yield from ((seed, work(seed)) for seed in seeds)
        return
    waiting = {executor.submit(work, seed): seed for seed in seeds}
    for future in as_completed(waiting):
        yield waiting[future], future.result()
