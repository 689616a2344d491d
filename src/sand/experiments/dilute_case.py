"""Case files of `sand grow` with [method] kind = "encounters": checks, and one population of a seed."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from ..basics.constants import MAGNETIC
from ..basics.errors import BadInput, ErrorCollector, naming
from ..basics.settings import For, Number, Word
from ..basics.units import format_quantity
from ..config.build import start_of
from ..config.case import Case, check_case
from ..config.key_errors import validate
from ..config.sections import Section
from ..io import run_folder as files
from ..simulation.condition import read_condition
from .dilute_body import NO_CONTACTS
from .dilute_conditions import FEWEST, check_forces, check_gas, check_moments
from .dilute_growth import BETWEEN, HITS, Grown, bodies_of, grow
from .dilute_majorant import Majorant
from .dilute_population import Population
from .scattering.rigid_flight import contact_energy

METHOD = "method"
"""The table of the method."""
NOT_FOR = {
    "box": "encounters have no box, but a number density: number_density in [grains]",
    "walls": "encounters are in open space",
    "driven": "grains of encounters are free",
    "deformation": "encounters have no box",
    "neighbours": "all pairs of grains count",
    "stepping": "flights and contact steps choose their own steps",
}
"""Tables of `sand run` that encounters do not have, and why."""
NOT_OF_RUN = ("steps", "frame_every", "row_every", "checkpoint_every", "stress", "out")
NOT_OF_GRAINS = ("extent", "spins", "exact_temperature")


class MethodSection(Section):
    """Section [method] of `sand grow`: N-body boxes, or encounters of two bodies in thin dust."""

    kind: Annotated[str, Word("boxes", "encounters")] = "boxes"
    """`boxes`: N-body simulations of boxes; `encounters`: a Monte Carlo of encounters of two bodies in thin dust, whose
    cost does not depend on the density."""
    between: Annotated[str, Word(*BETWEEN), For("kind", "encounters")] = "thermal"
    """What happens between encounters. `thermal`: the gas thermalises speed, spin and orientation of all bodies; `own`:
    bodies keep momentum and spin, as without a gas."""
    hits: Annotated[str, Word(*HITS), For("kind", "encounters")] = "resolve"
    """What becomes of two bodies that touch. `resolve`: contacts are computed until they are at rest; `stick`: the
    bodies join at the first touch."""


class DensitySection(Section):
    """Keys of [grains] that only encounters have."""

    number_density: Annotated[Any, Number("1/m^3", above=0.0)] = None
    """Number density of bodies at the start [1/m^3], with [method] kind = "encounters"."""

    def contradictions(self) -> Iterator[str]:
        """It is required."""
        if self.number_density is None:
            yield "number_density is missing; add it, for example number_density = '3e8 /m^3'"


class DiluteCase(NamedTuple):
    """A checked case."""

    case: Case  # of its grains and forces
    density: float  # [1/m³]
    method: MethodSection


def is_dilute(content: dict[str, Any]) -> bool:
    """Whether a case of `sand grow` is one of encounters."""
    table = content.get(METHOD)
    return isinstance(table, dict) and table.get("kind") == "encounters"


def check_dilute(content: dict[str, Any], name: str) -> DiluteCase:
    """Validate the content of a case of encounters; `name` begins each message.

    Raises BadInput, one line for each mistake.
    """
    own, errors = copy.deepcopy(content), ErrorCollector()
    method = errors.take(validate, MethodSection, own.pop(METHOD), name, table=METHOD)
    grains = _table(own, "grains")
    density = {"number_density": grains.pop("number_density")} if "number_density" in grains else {}
    section = errors.take(validate, DensitySection, density, name, table="grains")
    for table, reason in NOT_FOR.items():
        if own.pop(table, None) is not None:
            errors.problems.append(f"{name}: [{table}] is not for encounters: {reason}; leave it out")
    for table, keys in (("run", NOT_OF_RUN), ("grains", NOT_OF_GRAINS)):
        given = _table(own, table)
        for key in keys:
            if given.pop(key, None) is not None:
                errors.problems.append(f"{name}: {table}.{key} is not for encounters; leave it out")
    if grains.get("kind", "gas") == "gas":
        grains |= {"extent": 1.0, "spins": "equipartition"}  # positions of bodies do not matter
    case = errors.take(check_case, own, name)
    if case is not None and method is not None:
        errors.take(_check_forces, case, method, name)
        few = case.grains.number
        if case.grains.kind == "gas" and not case.grains.classes and few is not None and few < FEWEST:
            errors.problems.append(f"{name}: grains.number = {few} is too few for a population; give at least {FEWEST}")
        if not case.grains.temperature:
            errors.problems.append(f"{name}: grains.temperature is missing; add it, for example temperature = '100 K'")
    errors.done()
    return DiluteCase(case, section.number_density, method)


def _check_forces(case: Case, method: MethodSection, name: str) -> None:
    """Refuse forces that encounters do not have.  Raises BadInput."""
    with naming(f"{name}: forces"):
        check_forces(case.forces.build(), method.between, method.hits)


def _table(content: dict[str, Any], name: str) -> dict[str, Any]:
    """A table of a case; an empty one if it has none, which the check of the case reports."""
    found = content.get(name)
    return found if isinstance(found, dict) else {}


COST = {"thermal": {"resolve": 0.7e-3, "stick": 0.2e-3}, "own": {"resolve": 1.4e-3, "stick": 0.7e-3}}
"""Processor time [s] of a population per grain and unit of S at its end, measured for magnetic iron to S = 30.

Without a gas it is 2 and 4 times as long, measured to S = 4 and 8: slower growth needs more draws.
"""


def expected_cost(checked: DiluteCase, grains: int) -> float:
    """Rough processor time [s] of a population until its condition on S holds; NaN without one."""
    stop = checked.case.run.stop
    if stop is None:
        return math.nan
    condition = read_condition(stop)
    sizes = [10.0 ** (0.05 * k) for k in range(81)]
    rows = (dict.fromkeys(condition.names, 0.0) | {"mean_cluster_size": size} for size in sizes)
    reached = next((row["mean_cluster_size"] for row in rows if condition.holds(row)), math.nan)
    return COST[checked.method.between][checked.method.hits] * grains * reached


def describe_population(content: dict[str, Any], seed: int) -> tuple[list[tuple[str, str]], dict[str, Any]]:
    """What `sand info` says of a case: rows for people, and numbers; nothing is compiled."""
    checked = check_dilute(content, "case")
    checked.case.run.seed = seed
    start, temperature = start_of(checked.case), float(checked.case.grains.temperature)
    method = checked.method
    _, _, gas = check_forces(checked.case.forces.build(), method.between, method.hits)
    majorant, density = Majorant(temperature), checked.density
    bodies = bodies_of(start.grains, start.contacts or NO_CONTACTS)
    population = Population(bodies, len(bodies) / density, majorant)
    check_gas(gas, start.grains, population, method.between)
    check_moments(start.grains, temperature, population)
    strongest = float(population.sizes.moment_sum.max())
    capture = math.sqrt(3.0) * (contact_energy(strongest, strongest, 1.0, MAGNETIC) / majorant.heat) ** (1.0 / 3.0)
    between = len(bodies) / (2.0 * population.rate)
    numbers = {"bodies": len(bodies), "number_density": density, "capture_length": capture, "between": between}
    rows = [
        ("bodies", f"{len(bodies)} bodies, {len(start.grains)} grains, {density:.3g} /m^3"),
        (
            "encounters",
            f"a body has one within the bound of b about every {format_quantity(between, 's')} at the start",
        ),
    ]
    if capture > 0.0:
        text = f"{format_quantity(capture, 'm')} at {temperature:g} K; n b^3 = {density * capture**3:.2g}"
        rows.append(("thermal capture", text))
    hits = "contact steps of all grains until at rest" if method.hits == "resolve" else "joined at the touch"
    cost = expected_cost(checked, len(start.grains))
    if cost > 0.0:
        rows.append(("wall time", f"about {format_quantity(float(f'{cost:.2g}'), 's')} a population, a rough estimate"))
    kept = "keep momentum and spin" if method.between == "own" else "are thermalised by the gas"
    return [*rows, ("between", f"bodies {kept}"), ("hits", hits)], numbers | {"cost": cost}


def population_of(content: dict[str, Any], seed: int, folder: str | Path, observers: Sequence[Any] = ()) -> Grown:
    """Grow the population of a seed to its end, from its checkpoint if there is one.

    Raises
    ------
    BadInput
        If the case has errors, the dust is too dense, or the folder holds something else.
    """
    if content.get("grains", {}).get("kind") == "given":
        raise BadInput("these grains came from a script: call dilute_growth.grow again with the same arguments")
    checked = check_dilute(content, "case")
    checked.case.run.seed = seed
    start, run = start_of(checked.case), checked.case.run
    described = content | {"run": content.get("run", {}) | {"seed": seed}}
    described.pop("grow", None)
    if not (Path(folder) / files.CASE).exists() and Path(folder).is_dir() and files.is_used(Path(folder)):
        raise BadInput(f"{folder} is not empty, and holds no population; give another folder")
    return grow(
        start.grains,
        checked.case.forces.build(),
        number_density=checked.density,
        temperature=checked.case.grains.temperature,
        out=folder,
        stop=run.stop,
        until=run.until,
        seed=seed,
        between=checked.method.between,
        hits=checked.method.hits,
        contacts=start.contacts,
        observers=observers,
        case=described,
    )
