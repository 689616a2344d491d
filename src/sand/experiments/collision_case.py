"""Case files of collisions."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, field_validator, model_validator

from ..core.errors import BadInput, did_you_mean
from ..core.grains import Grains, moment_size
from ..core.material import PRESETS, Material
from ..files.folder import read_toml
from ..run.bodies import body_from_file
from ..run.case import (
    INTEGRATORS,
    ForcesSection,
    MaterialSection,
    Section,
    integrator,
    quantity,
    with_integrator,
    wrong_materials,
)
from ..run.mistakes import complaints
from ..setup.aggregates import build
from ..setup.moments import WAYS
from ..setup.population import radii_of
from ..stepping.verlet import Verlet
from .collision import Collision, collide

Kind = Literal["grain", "chain", "lattice", "hexagonal", "bpca", "pca", "bcca", "dla", "dlca", "fractal", "rbd", "file"]
"""The builders, `setup.aggregates.KINDS`, and a file."""


class BodySection(Section):
    """[target] and [projectile]: an aggregate of some kind (another for each seed where chance makes it), or a file."""

    kind: Kind
    path: str | None = None
    length: str | None = None
    grains: Annotated[int, Field(ge=1, strict=True)] | None = None
    shape: list[Annotated[int, Field(ge=1, strict=True)]] | None = None
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
        if value is not None and value not in WAYS:
            raise ValueError(f"moments = {value!r}; {did_you_mean(value, list(WAYS))}")
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
    seeds: list[Annotated[int, Field(ge=0, strict=True)]] = Field(default_factory=lambda: [1], min_length=1)
    out: str | None = None


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

    def run(self, seed: int, **options: Any) -> tuple[Collision, Any]:
        """One collision; with `turn` the bodies are turned at random by the seed.  Raises BadInput."""
        materials = {**PRESETS, **{name: section.build(name) for name, section in self.materials.items()}}
        return collide(
            self.target.build(materials, 2 * seed),
            self.projectile.build(materials, 2 * seed + 1),
            speed=self.impact.speed,
            impact_parameter=self.impact.impact_parameter,
            along=self.impact.along,
            seed=seed if self.impact.turn else None,
            forces=self.forces.build() or None,
            stepping=self.stepping,
            **options,
        )


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


def read_collision(path: str | Path) -> CollisionCase:
    """Read and check a case file of `sand collide`.

    Raises:
        BadInput: every mistake of the file, one line each, with its place.
    """
    content = read_toml(path)
    problems = wrong_bodies(content)
    case, model = None, with_integrator(CollisionCase, content)
    try:
        case = model.model_validate(content)
    except ValidationError as error:
        extra: dict[type, list[str]] = {k: ["method"] for k in INTEGRATORS.values()}
        problems += [line for slip in error.errors() for line in complaints(slip, model, extra)]
    if problems or case is None:
        raise BadInput(f"{path}: {problem}" for problem in problems)
    return case


def run_seed(text: str, seed: int) -> dict[str, Any]:
    """One collision of a case given as JSON, its outcome as a dictionary: what worker processes run."""
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        content = json.loads(text)
        return with_integrator(CollisionCase, content).model_validate(content).run(seed)[0].to_dict()


def run_seeds(case: dict[str, Any], seeds: list[int], executor: Any = None) -> list[dict[str, Any]]:
    """The outcomes for many seeds in their order, on any `concurrent.futures.Executor` or here.

    Args:
        case: content of a case file that `read_collision` has accepted.
    """
    work = partial(run_seed, json.dumps(case))
    return list(executor.map(work, seeds)) if executor is not None else [work(seed) for seed in seeds]
