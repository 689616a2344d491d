"""Case files of `sand scatter`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field

from ...basics.errors import BadInput, ErrorCollector, naming
from ...basics.settings import For, Number, Whole
from ...config.case import MaterialSection, library_of, material_errors, read_content
from ...config.key_errors import validate
from ...config.sections import PathName, Section, Seed, with_keys
from ..collision_case import BodyKind, BodySection
from .encounters import Flight
from .problem import flight, impact_parameter


class ScatterBody(BodySection):
    """Sections [projectile] and [target]: a grain, or an aggregate as in `sand collide`."""

    kind: BodyKind = "grain"
    """Builder (as for `sand build`), or `file`."""


@with_keys(flight, "radius", "material", "moment", "projectile", "target", "speed")
class FlightSection(Section):
    """Section [flight]: initial conditions, with the arguments of `sand.experiments.scattering.flight`."""

    if TYPE_CHECKING:
        spin: Any
    speed: Any = None
    """Speed v∞ of the projectile > 0 [m/s], or in units of its v_th = √(k_B T/m) with `speed_unit="thermal"`. One, or a
    list."""


class MeasureSection(Section):
    """Section [measure]: what to compute, and its accuracy."""

    job: Literal["cross-section", "map", "trajectories"] = "cross-section"
    """Quantity to compute: cross-sections, a map of hit probabilities, or trajectories."""
    relative_error: Annotated[float, Number(least=1e-4, most=0.5)] = 0.02
    """Relative standard error of cross-sections at which sampling stops, 1e-4 … 0.5."""
    impact_parameters: Annotated[list[Any], For("job", "trajectories")] = Field(default_factory=list)
    """Impact parameters of trajectories [m], or as text "0.95 b_max"."""
    spins: Annotated[list[Any], For("job", "trajectories")] = Field(default_factory=list)
    """Spins of trajectories, each as `flight.spin`; they replace it."""
    cells: Annotated[int, Whole(1, 1000)] = 24
    """Cells of a map along the impact parameter."""
    per_cell: Annotated[int, Whole(1, 10**9)] = 64
    """Trajectories per cell of a map."""
    seed: Seed = 0
    """Seed of all random numbers."""
    out: PathName | None = None
    """Folder of the results."""


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
        errors, measure = ErrorCollector(), self.measure
        materials = library_of(self.materials)
        sections = {"projectile": self.projectile, "target": self.target}
        bodies = {
            name: errors.take(section.build, materials, 2 * measure.seed + k)
            for k, (name, section) in enumerate(sections.items())
            if section is not None
        }
        given = self.flight.model_dump()
        speed, spin = given.pop("speed"), given.pop("spin")
        speeds = speed if isinstance(speed, list) else [] if speed is None else [speed]
        if not speeds:
            errors.problems.append("flight.speed is missing; give one, or a list of them")
        if measure.job == "trajectories" and len(speeds) > 1:
            errors.problems.append("flight.speed: trajectories are computed for a single speed; give one")
        found = [
            errors.take(flight, **bodies, **given, speed=v, spin=w)
            for w in measure.spins or [spin]
            for v in speeds
            if bodies["projectile"] is not None
        ]
        if found and found[0] is not None:
            for value in measure.impact_parameters:
                errors.take(impact_parameter, value, found[0], "measure.impact_parameters")
        if measure.job == "trajectories" and not measure.impact_parameters and not errors.problems:
            errors.problems.append(
                "measure.impact_parameters is missing: which trajectories? for example ['0.95 b_max']"
            )
        errors.problems = list(dict.fromkeys(errors.problems))  # errors common to all speeds are reported once
        errors.done()
        if measure.job == "map":
            found.sort(key=lambda one: one.speed)
            if len({one.speed for one in found}) < len(found):
                raise BadInput("flight.speed: a map needs speeds that differ")
        return found

    def impact_parameters(self, setup: Flight) -> list[float]:
        """Impact parameters of the trajectories [m]."""
        return [impact_parameter(value, setup) for value in self.measure.impact_parameters]


def read_scattering(path: str | Path) -> tuple[ScatterCase, list[Flight]]:
    """Read and check a case file of `sand scatter`.

    Raises
    ------
    BadInput
        All errors of the file, one line each, with their keys.
    """
    content = read_content(path, "scatter")
    problems = material_errors(content, ("target", "projectile"), "silica")
    case = validate(ScatterCase, content, str(path), problems)
    with naming(path):
        return case, case.flights()
