"""Conditions under which growth in dilute dust is a sequence of encounters of two bodies; refused with both numbers."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..basics.constants import BOLTZMANN
from ..basics.errors import BadInput, warn
from ..basics.grains import GrainArrays, Grains
from ..basics.ramps import ramps_of
from ..basics.units import format_quantity
from ..contact.model import Contact
from ..forces.base import Force
from ..forces.gas import Gas
from ..forces.gas_drag import rotation_friction, translation_friction
from ..theory.magnetic_limits import magnetic_limits
from .dilute_encounters import draw_flight
from .dilute_flight import RigidFlights, start_distance
from .dilute_population import Population, sizes_of
from .scattering.event_draws import event_uniforms
from .scattering.flight_driver import HIT

FEWEST = 100
"""Fewest bodies of a population."""
MOST_OTHERS, NOTED_OTHERS = 0.1, 0.03
"""Mean number of encounters with others during a flight that ends in a hit, from which encounters are not binary: an
error, and a note."""
PROBES = 256
"""Encounters by which this number is estimated at the start."""
PROBE_SEED = 2**63
"""Seed of these encounters, beside those of populations."""
BALLISTIC = 10.0
"""Least stopping length of a body in the gas, in units of the largest b at which it is captured."""
THERMALISED = 3.0
"""Least time between two encounters of a body, in stopping times, if the gas thermalises it."""
KEPT = 1.0 / 3.0
"""Largest time between two encounters of a body, in stopping times, if it keeps momentum and spin."""


def check_forces(forces: Sequence[Any], between: str, hits: str) -> tuple[Contact, list[Force], Gas | None]:
    """The contact model, the forces of contact phases, and the gas.

    Raises
    ------
    BadInput
        For forces that encounters do not have, a missing or undamped contact model, cut-offs and Ewald sums.
    """
    problems: list[str] = []
    own: list[Force] = []
    contact: Contact | None = None
    gas: Gas | None = None
    for force in forces:
        if isinstance(force, Gas):
            gas = force  # between encounters; `check_gas` says whether it may be left out within them
        elif isinstance(force, Contact):
            contact = force
            own.append(force)
        elif force.name == "field" and between == "own":
            problems.append(
                "field: bodies that keep their spins (between = 'own') would precess in it between encounters, which "
                "this method does not know; leave it out, or give between = 'thermal'"
            )
        elif force.name == "field" and field_of([force]) is not None:
            own.append(force)
        elif force.name in ("dipoles", "charges"):
            if force.cutoff not in (None, "auto"):
                problems.append(
                    f"{force.name}: a cut-off is not for encounters, which begin far apart; leave cutoff out"
                )
            own.append(dataclasses.replace(force, cutoff=None))
        else:
            problems.append(f"{force.name}: this force is not for encounters; leave it out, or grow boxes")
    if contact is None:
        problems.append("contact: bodies that touch need sand.Contact(); add it to the forces")
    elif hits == "resolve" and contact.damping == "none" and contact.settling_time is None:
        problems.append(
            "contact: hits = 'resolve' computes contacts until they are at rest, which undamped ones never are; give "
            "damping = 'critical', settling_time, or hits = 'stick'"
        )
    if problems or contact is None:
        raise BadInput(problems)
    return contact, own, gas


def field_of(forces: Sequence[Any]) -> tuple[float, float, float] | None:
    """The constant flux density [T] of the forces, 0 without a field; None if it depends on time."""
    fields = [force for force in forces if force.name == "field"]
    if any(force.time_dependent or ramps_of(force) for force in fields):
        return None
    x, y, z = (float(sum(force.flux_density[k] for force in fields)) for k in range(3))
    return x, y, z


def check_charges(forces: Sequence[Any], grains: Grains) -> None:
    """Refuse charged grains without their force, and this force without charges.  Raises BadInput."""
    if grains.charge.any() != any(force.name == "charges" for force in forces):
        raise BadInput("charges: charged grains need sand.Charges() among the forces, and this needs charged grains")


def others_meanwhile(population: Population, rigid_flights: RigidFlights, draws: int = PROBES) -> float:
    """Mean expected number of encounters with others of two bodies during a flight that ends in a hit, at the start."""
    found = []
    for event in range(draws):
        drawn = draw_flight(population, rigid_flights, (PROBE_SEED, event), event_uniforms(PROBE_SEED, event))
        if drawn.flight is not None and drawn.flight.end == HIT:
            found.append(drawn.others)
    return float(np.mean(found)) if found else 0.0


def check_population(population: Population, rigid_flights: RigidFlights, density: float) -> None:
    """Refuse too few bodies, and a gas that is too dense for encounters of two.

    Raises BadInput.
    """
    if len(population.bodies) < FEWEST:
        raise BadInput(
            f"{len(population.bodies)} bodies are too few for a population; give at least {FEWEST} (number in [grains])"
        )
    others = others_meanwhile(population, rigid_flights)
    if others > MOST_OTHERS:
        raise BadInput(
            f"number_density = {density:.3g} /m^3: during a flight that ends in a hit the two bodies meet {others:.2g} "
            f"others on average, and encounters of two need at most {MOST_OTHERS:g}; give at most "
            f"{density * MOST_OTHERS / others:.2g} /m^3, or grow boxes (kind = 'boxes')"
        )
    if others > NOTED_OTHERS:
        warn(
            f"number_density = {density:.3g} /m^3: during a flight that ends in a hit the two bodies meet {others:.2g} "
            "others on average; growth is not quite a sequence of encounters of two"
        )


def check_gas(gas: Gas | None, grains: Grains, population: Population, between: str) -> None:
    """Refuse a gas that acts within encounters, does not do what `between` says, or is not as warm as thermal bodies.

    Stopping times are those of grains: of the body whose flights feel the gas most, and of the slowest grain if the gas
    thermalises bodies, or the fastest one if it must not.

    Raises BadInput.
    """
    if gas is None:
        return
    majorant, size, problems = population.majorant, population.sizes, []
    temperature = majorant.heat / BOLTZMANN
    if between == "thermal" and not math.isclose(gas.temperature, temperature, rel_tol=1e-9):
        problems.append(
            f"gas: its temperature is {gas.temperature:g} K, and that of the bodies {temperature:g} K; thermal bodies "
            "have that of the gas: give one temperature"
        )
    speed = np.sqrt(3.0 * majorant.heat / size.mass)
    lengths = speed * [float(_stopping_times(body.grains, gas).min()) for body in population.bodies]
    reaches = majorant.bound(size, size._replace(charge=-size.charge), speed) + 2.0 * size.extent
    worst = int(np.argmin(lengths / reaches))
    length, reach = float(lengths[worst]), float(reaches[worst])
    times = _stopping_times(grains.arrays, gas)
    time = float(times.max() if between == "thermal" else times.min())
    free = len(population.bodies) / (2.0 * population.rate)
    if length < BALLISTIC * reach:
        problems.append(
            f"gas: the stopping length of grains, {format_quantity(length, 'm')}, is less than {BALLISTIC:g} times "
            f"{format_quantity(reach, 'm')}, the distance of an encounter: flights would feel the gas; grow boxes "
            "(kind = 'boxes'), or give a thinner gas"
        )
    both = f"gas: bodies meet after {format_quantity(free, 's')}, and the gas thermalises them in "
    both += f"{format_quantity(time, 's')}; "
    if between == "thermal" and free < THERMALISED * time:
        problems.append(
            f"{both}between = 'thermal' needs {THERMALISED:g} times as long: give a lower number_density, or grow "
            "boxes (kind = 'boxes')"
        )
    if between == "own" and free > KEPT * time:
        problems.append(
            f"{both}between = 'own' needs at most {KEPT:.2g} of that: give a thinner gas or a higher number_density, "
            "between = 'thermal', or grow boxes (kind = 'boxes')"
        )
    if problems:
        raise BadInput(problems)


def _stopping_times(grains: GrainArrays, gas: Gas) -> np.ndarray:
    """Stopping times [s] of velocity and spin of grains, (2, n); those of a rigid body of them lie in their range."""
    law = gas.numbers()
    numbers = law.density, law.mean_speed, law.accommodation
    frictions = translation_friction(grains.radius, *numbers), rotation_friction(grains.radius, *numbers)
    return np.stack([grains.mass / frictions[0], grains.inertia / frictions[1]])


def check_moments(grains: Grains, temperature: float, population: Population) -> None:
    """Warn if thermal flips turn moments within grains before the first encounters.

    Raises BadInput if they do so within a flight.
    """
    moments = np.linalg.norm(grains.moment, axis=1)
    between = len(population.bodies) / (2.0 * population.rate)
    for k in np.unique(grains.material[moments > 0.0]):
        material = grains.materials[int(k)]
        if not (material.specific_moment > 0.0 and material.anisotropy and material.exchange_stiffness):
            continue
        radius = float(grains.radius[(grains.material == k) & (moments > 0.0)].min())
        time = magnetic_limits(material, radius, temperature).relaxation_time
        flight = _flight_time(population)
        grain = f"{material.name} grains of {format_quantity(radius, 'm')}"
        flips = f"moments of {grain} flip after {format_quantity(time, 's')}"
        if time < flight:
            raise BadInput(
                f"{flips} at {temperature:g} K, within a flight of {format_quantity(flight, 's')}: they are "
                "superparamagnetic, and not fixed in the grains; give a lower temperature or larger grains"
            )
        if time < between:
            warn(
                f"{flips} at {temperature:g} K, and a body meets another one only after "
                f"{format_quantity(between, 's')}: they are superparamagnetic, and turn within their grains between "
                "encounters, which this method does not know"
            )


def _flight_time(population: Population) -> float:
    """Longest time [s] of typical flights of two equal magnetic bodies."""
    found, majorant = [0.0], population.majorant
    for body in population.bodies:
        if body.moment_sum > 0.0:
            size, speed = sizes_of(body), math.sqrt(2.0 * majorant.heat / body.mass)
            found.append(2.0 * start_distance(body, body, speed, float(majorant.bound(size, size, speed))) / speed)
    return max(found)
