"""Conditions under which growth in dilute dust is a sequence of encounters of two bodies; refused with both numbers."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..basics.errors import BadInput, warn
from ..basics.grains import Grains
from ..basics.ramps import ramps_of
from ..basics.units import format_quantity
from ..contact.model import Contact
from ..forces.base import Force
from ..forces.gas import Gas
from ..theory.magnetic_limits import magnetic_limits
from .dilute_body import Body
from .dilute_flight import RigidFlights, kepler_start, start_distance
from .dilute_majorant import Majorant
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
"""Least time between two encounters of a body, in stopping times."""


def check_forces(forces: Sequence[Any], hits: str) -> tuple[Contact, list[Force], Gas | None]:
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
        uniforms = event_uniforms(PROBE_SEED, event)
        i, j, kernel = population.draw(*uniforms[1:3])
        a, b = population.bodies[i], population.bodies[j]
        approach = population.majorant.draw(sizes_of(a), sizes_of(b), uniforms[3:6])
        start = kepler_start(a, b, approach[:2], start_distance(a, b, approach.bound))
        flight = start and rigid_flights.thermal(a, b, *start, (PROBE_SEED, event))
        if flight and flight.end == HIT:
            sums = float(population.sums[i] + population.sums[j])
            found.append((sums - 2.0 * kernel) / population.volume * flight.time)
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


def check_gas(gas: Gas | None, grains: Grains, population: Population) -> None:
    """Refuse a gas that acts within encounters, or does not thermalise bodies between them.

    Raises BadInput.
    """
    if gas is None:
        return
    time, majorant = gas.shortest_time(grains), population.majorant
    slowest = population.bodies[int(np.argmax(population.sizes.mass))]
    size = sizes_of(slowest)
    speed = math.sqrt(3.0 * majorant.heat / slowest.mass)
    reach, length = float(majorant.bound(size, size, speed)) + 2.0 * slowest.extent, speed * time
    between = len(population.bodies) / (2.0 * population.rate)
    problems = []
    if length < BALLISTIC * reach:
        problems.append(
            f"gas: the stopping length of grains, {format_quantity(length, 'm')}, is less than {BALLISTIC:g} times "
            f"{format_quantity(reach, 'm')}, the distance of an encounter: flights would feel the gas; grow boxes "
            "(kind = 'boxes'), or give a thinner gas"
        )
    if between < THERMALISED * time:
        problems.append(
            f"gas: bodies meet after {format_quantity(between, 's')}, and the gas thermalises them in "
            f"{format_quantity(time, 's')}; between = 'thermal' needs {THERMALISED:g} times as long: give a lower "
            "number_density, or grow boxes (kind = 'boxes')"
        )
    if problems:
        raise BadInput(problems)


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
        flight = _flight_time(population.bodies[0], population.majorant)
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


def _flight_time(body: Body, majorant: Majorant) -> float:
    """Time [s] of a typical flight of two such bodies."""
    size, speed = sizes_of(body), math.sqrt(2.0 * majorant.heat / body.mass)
    return 2.0 * start_distance(body, body, float(majorant.bound(size, size, speed))) / speed
