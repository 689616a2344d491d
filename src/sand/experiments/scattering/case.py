"""Case files of `sand scatter`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator

from ...config.case import MaterialSection, material_errors
from ...config.commands import refuse_other_command
from ...config.errors import validate
from ...config.sections import PathName, Section, Seed
from ...errors import BadInput
from ...io.run_folder import read_toml
from ...material import PRESETS
from ..collision_case import BodyKind, BodySection
from .encounters import Flight
from .problem import ErrorCollector, flight, impact_parameter


class ScatterBody(BodySection):
    """Sections [projectile] and [target]: a grain, or an aggregate as in `sand collide`."""

    kind: BodyKind = "grain"
    """Builder (as for `sand build`), or `file`."""


class FlightSection(Section):
    """Section [flight]: initial conditions, with the arguments of `sand.experiments.scattering.flight`."""

    temperature: Any = 0.0
    speed: Any = None
    speed_unit: str = "m/s"
    spin: Any = "none"
    start: Any = "auto"
    start_shape: str = "plane"
    orientation: str = "random"
    target_velocity: Any = None
    field: Any = None
    escape: Any = "auto"
    outcome: str = "hit"
    tolerance: Any = 1e-8


class MeasureSection(Section):
    """Section [measure]: what to compute, and its accuracy."""

    job: Literal["cross-section", "map", "trajectories"] = "cross-section"
    """Quantity to compute: cross-sections, a map of hit probabilities, or trajectories."""
    relative_error: Any = 0.02
    """Relative standard error of cross-sections at which sampling stops, 1e-4 … 0.5."""
    impact_parameters: list[Any] = Field(default_factory=list)
    """Impact parameters of trajectories [m], or as text "0.95 b_max"."""
    spins: list[Any] = Field(default_factory=list)
    """Spins of trajectories, each as `flight.spin`; they replace it."""
    cells: Annotated[int, Field(ge=1, le=1000, strict=True)] = 24
    """Cells of a map along the impact parameter."""
    per_cell: Annotated[int, Field(ge=1, le=10**9, strict=True)] = 64
    """Trajectories per cell of a map."""
    seed: Seed = 0
    """Seed of all random numbers."""
    out: PathName | None = None
    """Folder of the results."""

    @field_validator("relative_error")
    @classmethod
    def _error(cls, value: Any) -> Any:
        if not isinstance(value, (int, float)) or isinstance(value, bool) or not 1e-4 <= value <= 0.5:
            raise ValueError(f"relative_error = {value!r} must be a number in 1e-4 … 0.5")
        return value


class ScatterCase(Section):
    """Case file of `sand scatter`."""

    projectile: ScatterBody
    target: ScatterBody | None = None
    flight: FlightSection
    measure: MeasureSection = MeasureSection()
    materials: dict[str, MaterialSection] = Field(default_factory=dict)

    def flights(self) -> list[Flight]:
        """One set-up for each speed, and for trajectories for each of `spins`.

        Raises
        ------
        BadInput
            All errors of bodies and initial conditions.
        """
        errors = ErrorCollector()
        materials = {**PRESETS, **{name: section.build(name) for name, section in self.materials.items()}}
        bodies = {
            name: errors.take(lambda body=body, k=k: body.build(materials, 2 * self.measure.seed + k))  # type: ignore[misc]
            for k, (name, body) in enumerate((("projectile", self.projectile), ("target", self.target)))
            if body is not None
        }
        given = self.flight.model_dump()
        speeds = _list(given.pop("speed"))
        spins = self.measure.spins or [given.pop("spin")]
        given.pop("spin", None)
        if not speeds:
            errors.problems.append("flight.speed is missing; give one, or a list of them")
        if len(speeds) > 1 and self.measure.job == "trajectories":
            errors.problems.append("flight.speed: trajectories are computed for a single speed; give one")
        if self.measure.job != "trajectories":
            errors.problems += [
                f"measure.{name} is for job = 'trajectories'; leave it out"
                for name in ("spins", "impact_parameters")
                if getattr(self.measure, name)
            ]
        found = [
            errors.take(lambda speed=speed, spin=spin: flight(**bodies, **given, speed=speed, spin=spin))  # type: ignore[misc]
            for spin in spins
            for speed in speeds
            if bodies.get("projectile") is not None
        ]
        b = [
            errors.take(lambda value=value: impact_parameter(value, found[0], "measure.impact_parameters"))  # type: ignore[misc]
            for value in self.measure.impact_parameters
            if found and found[0] is not None
        ]
        if self.measure.job == "trajectories" and not b and not errors.problems:
            errors.problems.append(
                "measure.impact_parameters is missing: which trajectories? for example ['0.95 b_max']"
            )
        errors.problems = list(dict.fromkeys(errors.problems))  # errors common to all speeds are reported once
        errors.done()
        if self.measure.job == "map":
            found.sort(key=lambda one: one.speed)
            if len({one.speed for one in found}) < len(found):
                raise BadInput("flight.speed: a map needs speeds that differ")
        return found

    def impact_parameters(self, setup: Flight) -> list[float]:
        """Impact parameters of the trajectories [m]."""
        return [impact_parameter(value, setup) for value in self.measure.impact_parameters]


def _list(value: Any) -> Sequence[Any]:
    if value is None:
        return []
    return list(value) if isinstance(value, (list, tuple, np.ndarray)) else [value]


def read_scattering(path: str | Path) -> tuple[ScatterCase, list[Flight]]:
    """Read and check a case file of `sand scatter`.

    Raises
    ------
    BadInput
        All errors of the file, one line each, with their keys.
    """
    content = read_toml(path)
    refuse_other_command(content, path, "scatter")
    problems = material_errors(content, ("target", "projectile"), "silica")
    case = validate(ScatterCase, content, str(path), problems)
    try:
        return case, case.flights()
    except BadInput as error:
        raise error.at(str(path)) from None
