"""Expected numbers of steps of a run, from the kinetics of touches: before the first touch, with contacts, of bodies.

Bodies collide as in the coagulation equation with a constant kernel K: their number is N(t) = N₀/(1 + t/τ), with
τ = 2V/(K N₀) in a volume V (Smoluchowski 1916), and the first of N₀ bodies touch after about τ/N₀.  K = σ ⟨v⟩, with the
mean relative speed ⟨v⟩ = √(16⟨v²⟩/3π) of a Maxwell distribution and the largest of the cross-sections π (r₁ + r₂)²,
focused by charges, and of magnetic capture.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..analysis.clusters import cluster_labels
from ..constants import BOLTZMANN, COULOMB, MAGNETIC
from ..contact.law import contact_constants
from ..contact.model import Contact
from ..forces.gas.model import Gas
from ..integrate.rigid_clusters import RigidClusters
from ..integrate.step_control import FLIGHT_FRACTION, MAX_FIELD_PHASE, MAX_SPIN_ANGLE

CAPTURE = 0.5
"""c of the magnetic cross-section (Eq. 14) of grains with random moments and spins."""
AWAKE = 3.0
"""Time for which a cluster is awake after a touch, in units of the shortest possible, `RigidLimits.longest_awake`."""
NEAREST = 0.22
"""Distance of the nearest two bodies, which limit the step of all, in mean distances; at least that of touch."""

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


class Bodies(NamedTuple):
    """The bodies of the initial state: clusters, and single grains."""

    number: int
    mass: np.ndarray  # (K,) [kg]
    radius: np.ndarray  # (K,) of the sphere about the centre of mass that holds all grains [m]
    square: float  # mean of v² [m²/s²]
    charge: np.ndarray  # (K,) [C]
    moment: np.ndarray  # (K,) magnitude of the sum of all moments [A m²]


def bodies_of(simulation: Simulation) -> Bodies:
    """The bodies of a simulation at its start."""
    grains, box = simulation.start, simulation.box
    labels = cluster_labels(len(grains), grains.touching(box)[0])
    count = int(labels.max()) + 1

    def summed(values: np.ndarray) -> np.ndarray:
        return np.column_stack([np.bincount(labels, each, count) for each in np.atleast_2d(values.T)])

    mass = summed(grains.mass)[:, 0]
    first = grains.position[np.unique(labels, return_index=True)[1]]
    apart = box.nearest(grains.position - first[labels])
    centre = summed(grains.mass[:, None] * apart) / mass[:, None]
    reach = np.linalg.norm(apart - centre[labels], axis=1) + grains.radius
    radius = np.zeros(count)
    np.maximum.at(radius, labels, reach)
    velocity = summed(grains.mass[:, None] * grains.velocity) / mass[:, None]
    moment = np.linalg.norm(summed(np.asarray(grains.moment)), axis=1)
    return Bodies(count, mass, radius, float((velocity**2).sum(axis=1).mean()), summed(grains.charge)[:, 0], moment)


def coagulation_time(simulation: Simulation, bodies: Bodies) -> float:
    """τ [s]; infinite in an open box, where bodies need not meet, and if nothing moves."""
    sides = [side for side in simulation.box.lengths if side is not None]
    if len(sides) < 3 or bodies.number < 2:
        return math.inf
    volume, mass, radius = math.prod(sides), float(bodies.mass.mean()), float(bodies.radius.mean())
    energy = mass * bodies.square / 3.0
    gases = [force for force in simulation.forces if isinstance(force, Gas) and force.brownian]
    energy = max([energy, *(BOLTZMANN * float(gas.temperature) for gas in gases)])
    names, spacing = {force.name for force in simulation.forces}, (volume / bodies.number) ** (1.0 / 3.0)
    strength = 0.0  # α of U = −α/r³
    if "dipoles" in names:
        strength = 2.0 * MAGNETIC * float((bodies.moment**2).mean())
        energy = max(energy, strength / spacing**3)  # of bodies that begin at rest
    if energy <= 0.0:
        return math.inf
    touching = 2.0 * radius
    area = math.pi * touching**2
    if "charges" in names:
        area *= max(1.0, _focusing(bodies.charge, touching, energy))
    area = max(area, CAPTURE * 3.0 * math.pi * (strength / energy) ** (2.0 / 3.0))
    return 2.0 * volume / (area * math.sqrt(16.0 * energy / (math.pi * mass)) * bodies.number)


def _focusing(charge: np.ndarray, touching: float, energy: float) -> float:
    """Mean of 1 − U/k_B T at touch over all pairs, at least 0 each: the factor of charges in their cross-section."""
    kinds, numbers = np.unique(charge, return_counts=True)
    share = numbers / numbers.sum()
    potential = COULOMB * np.multiply.outer(kinds, kinds) / touching
    return float((np.maximum(1.0 - potential / energy, 0.0) * np.multiply.outer(share, share)).sum())


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
    if isinstance(simulation.stepping, RigidClusters):
        limits = simulation._engine.parameters.flight_limits
        step = body_step(simulation, limits, bodies.number)
        span = min(end, last_step * step)
        touches = bodies.number * _share(span / time)
        awake = min(touches * AWAKE * limits.longest_awake, span) / of_contacts
        return Steps(
            bodies=span / step,
            awake=awake,
            contacts=begun + bodies.number * _mean_share(span / time),
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
        free=free, contact=contact, contacts=begun + bodies.number * _mean_share(span / time), span=span, bound=bound
    )


def body_step(simulation: Simulation, limits: Any, number: int) -> float:
    """Step [s] of so many bodies: η over the rate at which their loads change, that of the nearest two."""
    grains, criteria = simulation.start, simulation._engine.parameters.criteria
    sides = [side for side in simulation.box.lengths if side is not None]
    apart = NEAREST * (math.prod(sides) / number) ** (1.0 / 3.0) if len(sides) == 3 else 0.0
    apart = max(apart, 2.0 * limits.smallest_radius)
    field = criteria.outer_field + field_at(simulation, apart)
    swing = math.sqrt(float((np.linalg.norm(grains.moment, axis=1) / grains.inertia).max()) * field)
    flight = math.sqrt(float((grains.velocity**2).sum(axis=1).mean())) / apart
    longest = min(limits.longest_step, criteria.longest)
    return float(min(longest, limits.step_fraction / max(swing, flight, limits.friction_rate, 1e-300)))


def _share(x: float) -> float:
    """Share 1 − N/N₀ = x/(1 + x) of the bodies that have merged after the time x τ."""
    return x / (1.0 + x) if math.isfinite(x) else 1.0


def _mean_share(x: float) -> float:
    """Mean of x/(1 + x) from 0 to x: 1 − ln(1 + x)/x."""
    return 1.0 - math.log1p(x) / x if x > 1e-6 else 0.5 * x
