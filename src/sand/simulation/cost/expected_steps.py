"""Expected numbers of steps of a run: before the first touch, with contacts, of bodies.

Touches are those of the coagulation equation (`coagulation`).  Bodies of rigid clusters have the step that the nearest
two, a gas, or the fastest rotor requires: a grain in thermal motion, or a cluster that turns with the angular momentum
of its touch.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ...basics.constants import MAGNETIC
from ...contact.law import contact_constants
from ...contact.model import Contact
from ...integrate.integrator import moves_bodies
from ...integrate.rigid.rigid_driver import LARGEST_TURN, TURN_PER_FRACTION
from ...integrate.step_control import FLIGHT_FRACTION, MAX_FIELD_PHASE, MAX_SPIN_ANGLE
from .coagulation import (
    Bodies,
    bodies_of,
    coagulation_time,
    cross_sections,
    mean_merged,
    merged,
    thermal_energy,
    volume_of,
)

AWAKE = 3.0
"""Time for which a cluster is awake after a touch, in units of the shortest possible, `RigidLimits.longest_awake`."""
NEAREST = 0.28
"""Distance of the nearest two bodies that limit the step of all, in mean distances; at least that of touch.  Nearer
ones, 9 % of bodies at random places, take substeps."""
HALVINGS = math.log(2.0)
"""Mean of 1/h over all rates, inverted, in units of the longest step allowed: h is a half, a quarter, … of one step."""

Simulation = Any
"""`sand.Simulation`."""


class Steps(NamedTuple):
    """Expected steps of a run, and the state of the simulation in them."""

    free: float = 0.0  # steps without contacts
    contact: float = 0.0  # steps with contacts, of grains
    bodies: float = 0.0  # steps of bodies, with rigid clusters
    awake: float = 0.0  # contact steps of awake clusters within these
    contacts: float = 0.0  # mean number of contacts
    span: float = 0.0  # length of the run [s]
    bound: str = ""  # "at most" where a condition may end the run earlier, or the time of the first touch is not known

    @property
    def total(self) -> float:
        """Steps as they are counted: those of awake clusters are within steps of bodies."""
        return self.free + self.contact + self.bodies


def contact_step(simulation: Simulation) -> float:
    """Step [s] while there are contacts, 2π/ω_max over the steps per period; infinite where there can be none."""
    grains, contact = simulation.start, next((f for f in simulation.forces if isinstance(f, Contact)), None)
    if contact is None or len(grains) < 2:
        return math.inf
    smallest = [
        min(np.flatnonzero(grains.material == k), key=lambda i: float(grains.radius[i]))
        for k in range(len(grains.materials))
    ]
    formula, fastest = contact_constants(contact.contact_law), 0.0
    for i in smallest:
        for j in smallest:
            pairing = contact.pairing(*(grains.materials[grains.material[k]] for k in (i, j)))
            sizes = (float(grains.radius[i]), float(grains.radius[j]), float(grains.mass[i]), float(grains.mass[j]))
            fastest = max(fastest, formula(pairing, *sizes).max_squared_frequency)
    per_period = float(simulation.stepping.contact_stepping.steps_per_period)
    return 2.0 * math.pi / math.sqrt(fastest) / per_period if fastest > 0.0 else math.inf


def flight_step(simulation: Simulation) -> float:
    """Step [s] without contacts: by flight, spin, and the fields of dipoles at touch and of the user."""
    grains, criteria = simulation.start, simulation._engine.parameters.criteria
    speed, spin = (float(np.linalg.norm(v, axis=1).max()) for v in (grains.velocity, grains.spin))
    limits = [criteria.longest]
    limits += [FLIGHT_FRACTION * criteria.pair_gap / speed] if speed else []
    limits += [MAX_SPIN_ANGLE / spin] if spin else []
    field = criteria.outer_field + field_at(simulation)
    rate = math.sqrt(float((np.linalg.norm(grains.moment, axis=1) / grains.inertia).max()) * field)
    return float(min([*limits, *([MAX_FIELD_PHASE / rate] if rate else [])]))


def field_at(simulation: Simulation, distance: float = 0.0) -> float:
    """Flux density [T] of the largest moment along its axis, at a distance [m], at least that of touch."""
    if not any(force.name == "dipoles" for force in simulation.forces):
        return 0.0
    moment = np.linalg.norm(simulation.start.moment, axis=1)
    k = int(np.argmax(moment))
    return float(2.0 * MAGNETIC * moment[k] / max(2.0 * simulation.start.radius[k], distance) ** 3)


def expected_steps(simulation: Simulation, end: float, last_step: float, *, may_end_earlier: bool = False) -> Steps:
    """Expected steps of a run of a simulation that has not begun.

    Parameters
    ----------
    end, last_step : float
        Planned end: time [s] and step, infinite where not set; one of them is finite.
    may_end_earlier : bool, optional
        Whether a condition may end the run.
    """
    bodies, fixed = bodies_of(simulation), simulation._engine.parameters.criteria.fixed
    bound = "at most" if may_end_earlier else ""
    time = coagulation_time(simulation, bodies)
    of_contacts, of_flight = (fixed, fixed) if fixed > 0.0 else (contact_step(simulation), flight_step(simulation))
    of_contacts = min(of_contacts, of_flight) if math.isinf(of_contacts) else of_contacts
    begun = len(simulation.start) - bodies.number
    if moves_bodies(simulation.stepping):
        limits = simulation._engine.parameters.flight_limits
        step = body_step(simulation, bodies, 0.0 if math.isinf(end) else end)
        if math.isinf(end):
            step = body_step(simulation, bodies, last_step * step)
        span = min(end, last_step * step)
        touches = bodies.number * merged(span / time)
        awake = min(touches * AWAKE * limits.longest_awake, span) / of_contacts
        return Steps(
            bodies=span / step,
            awake=awake,
            contacts=begun + bodies.number * mean_merged(span / time),
            span=span,
            bound=bound,
        )
    alone = not any(isinstance(force, Contact) for force in simulation.forces)
    first = 0.0 if begun else math.inf if alone else time / bodies.number
    if math.isinf(first) and not alone and math.isinf(time):
        first, bound = 0.0, "at most"  # it is not known when the first two touch
    free = min(first, end) / of_flight
    free = min(free, last_step)
    left = max(end - first, 0.0)
    contact = min(left / of_contacts, last_step - free) if last_step > free else 0.0
    span = min(end, free * of_flight + contact * of_contacts)
    return Steps(
        free=free, contact=contact, contacts=begun + bodies.number * mean_merged(span / time), span=span, bound=bound
    )


def body_step(simulation: Simulation, bodies: Bodies, span: float) -> float:
    """Mean step [s] of bodies in a run of a length [s].

    1/Δt is the largest of: the rate at which the loads of the nearest two bodies change, and that of a gas, over η, and
    the largest spin over the angle that a body may turn in a step.
    """
    grains, criteria = simulation.start, simulation._engine.parameters.criteria
    limits, volume = simulation._engine.parameters.flight_limits, volume_of(simulation)
    apart = 0.0 if math.isinf(volume) else NEAREST * (volume / bodies.number) ** (1.0 / 3.0)
    apart = max(apart, 2.0 * limits.smallest_radius)
    field = criteria.outer_field + field_at(simulation, apart)
    swing = math.sqrt(float((np.linalg.norm(grains.moment, axis=1) / grains.inertia).max()) * field)
    flight = math.sqrt(float((grains.velocity**2).sum(axis=1).mean())) / apart
    turn = min(LARGEST_TURN, TURN_PER_FRACTION * limits.step_fraction)
    rate = max(swing, flight, limits.friction_rate) / limits.step_fraction
    rate = max(rate, fastest_spin(simulation, bodies, span) / turn)
    longest = float(min(limits.longest_step, criteria.longest))
    return HALVINGS / rate if rate * longest > 1.0 else longest


def fastest_spin(simulation: Simulation, bodies: Bodies, span: float) -> float:
    """Largest spin [1/s] of all bodies in a run of a length [s].

    Bodies begin with their spins, which a gas replaces by thermal ones within a stopping time.  A touch leaves a
    cluster with the angular momentum of the approach; as long as a gas does not slow it, it stays.
    """
    decay, gas = simulation._engine.parameters.flight_limits.friction_rate, simulation._engine.parameters.gas.gas
    touches = bodies.number * merged(span / coagulation_time(simulation, bodies))
    spin = float(np.linalg.norm(simulation.start.spin, axis=1).max())
    if decay * span > 1.0:
        spin, touches = thermal_spin(gas.temperature_energy, bodies), touches / (decay * span)
    return max(spin, touch_spin(simulation, bodies, touches))


def thermal_spin(energy: float, bodies: Bodies) -> float:
    """Largest spin [1/s] of bodies at k_B T [J].

    x = I ω²/2k_B T of a sphere has the distribution Γ(3/2).  The largest x of j bodies is the one that a single body
    exceeds with the probability 1/(j + 1), here for those j that turn most easily.
    """
    from scipy.special import gammainccinv

    inertia = np.sort(0.4 * bodies.mass * bodies.radius**2)
    x = gammainccinv(1.5, 1.0 / np.arange(2, bodies.number + 2))
    return math.sqrt(2.0 * energy * float((x / inertia).max()))


def touch_spin(simulation: Simulation, bodies: Bodies, number: float) -> float:
    """Largest spin [1/s] of so many clusters of two bodies, which touched at thermal speeds.

    Two bodies of mass M and radius R with the reduced mass m̄ = M/2 have L² = m̄ e b² with e = m̄ v², and a mean b² of
    half of σ(e)/π.  e is 2 k_B T: of σ ∝ e^(−2/3), that of dipoles, L² ∝ e^(1/3) has the mean of e = 2.05 k_B T.  The
    two turn with I = 2 (2/5 + 1) M R².  Energies L²/2I are distributed as those of thermal rotors, so that the largest
    of n is ln(n + 1) times the mean: of 649 pairs of grains in `examples/growth-coasting.toml` the mean was
    32 k_B T (29 by this formula), a tenth was above 68 k_B T, and the largest was 161 k_B T.
    """
    energy = thermal_energy(simulation, bodies)
    if energy <= 0.0 or number <= 0.0:
        return 0.0
    mass, radius = float(bodies.mass.mean()), float(bodies.radius.mean())
    area = max(cross_sections(simulation, bodies, 2.0 * energy))
    square = 0.5 * mass * 2.0 * energy * area / (2.0 * math.pi)
    return math.sqrt(square * math.log1p(number)) / (2.8 * mass * radius**2)
