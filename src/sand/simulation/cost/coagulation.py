"""Bodies of the initial state and the kinetics of their touches.

Bodies collide as in the coagulation equation with a constant kernel K: their number is N(t) = N₀/(1 + t/τ), with
τ = 2V/(K N₀) in a volume V (Smoluchowski 1916), and the first of N₀ bodies touch after about τ/N₀.  K = σ ⟨v⟩, with the
mean relative speed ⟨v⟩ = √(8/π) s, s = √(k_B T/m̄), of a Maxwell distribution and the cross-section π (r₁ + r₂)²,
focused by charges; or K = ⟨σv⟩ of magnetic capture, σ ∝ v^(−4/3), if that is larger.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ...basics.clusters import labels_of
from ...basics.constants import BOLTZMANN, COULOMB, MAGNETIC
from ...forces.gas import Gas

CAPTURE = 0.5
"""c of the magnetic cross-section (Eq. 14) of grains with random moments and spins."""
MEAN_SPEED, MEAN_CAPTURE = math.sqrt(8.0 / math.pi), 2.0 ** (-1.0 / 6.0) * math.gamma(4.0 / 3.0) / math.gamma(1.5)
"""⟨v⟩/s of a Maxwell distribution, and ⟨σv⟩/(σ(s) s) of magnetic capture."""

Simulation = Any
"""`sand.Simulation`."""


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
    labels = labels_of(len(grains), grains.touching(box)[0])
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
    volume = volume_of(simulation)
    if math.isinf(volume) or bodies.number < 2:
        return math.inf
    energy, mass = thermal_energy(simulation, bodies), float(bodies.mass.mean())
    if energy <= 0.0:
        return math.inf
    touching, captured = cross_sections(simulation, bodies, energy)
    kernel = max(MEAN_SPEED * touching, MEAN_CAPTURE * captured) * math.sqrt(2.0 * energy / mass)
    return 2.0 * volume / (kernel * bodies.number)


def volume_of(simulation: Simulation) -> float:
    """Volume of the box [m³], infinite if it is open."""
    return math.prod(math.inf if side is None else side for side in simulation.box.lengths)


def thermal_energy(simulation: Simulation, bodies: Bodies) -> float:
    """k_B T [J] of the translation of bodies: a third of m v², that of a gas, or that of the mean attraction."""
    energy = float(bodies.mass.mean()) * bodies.square / 3.0
    gases = [force for force in simulation.forces if isinstance(force, Gas) and force.brownian]
    energy = max([energy, *(BOLTZMANN * float(gas.temperature) for gas in gases)])
    # of bodies that begin at rest; 0 in an open box
    return max(energy, _attraction(simulation, bodies) * bodies.number / volume_of(simulation))


def cross_sections(simulation: Simulation, bodies: Bodies, energy: float) -> tuple[float, float]:
    """σ [m²] of two mean bodies at m̄ v² = E [J], m̄ the reduced mass: without, and by, magnetic capture."""
    names, touching = {force.name for force in simulation.forces}, 2.0 * float(bodies.radius.mean())
    area = math.pi * touching**2
    if "charges" in names:
        area *= max(1.0, _focusing(bodies.charge, touching, energy))
    attraction = _attraction(simulation, bodies)
    return area, CAPTURE * 3.0 * math.pi * (attraction / energy) ** (2.0 / 3.0)


def _attraction(simulation: Simulation, bodies: Bodies) -> float:
    """α [J m³] of U = −α/r³, the largest attraction of two dipoles; 0 without these."""
    if not any(force.name == "dipoles" for force in simulation.forces):
        return 0.0
    return 2.0 * MAGNETIC * float((bodies.moment**2).mean())


def _focusing(charge: np.ndarray, touching: float, energy: float) -> float:
    """Mean of 1 − U/k_B T at touch over all pairs, at least 0 each: the factor of charges in their cross-section."""
    kinds, numbers = np.unique(charge, return_counts=True)
    share = numbers / numbers.sum()
    potential = COULOMB * np.multiply.outer(kinds, kinds) / touching
    return float((np.maximum(1.0 - potential / energy, 0.0) * np.multiply.outer(share, share)).sum())


def merged(x: float) -> float:
    """Share 1 − N/N₀ = x/(1 + x) of the bodies that have merged after the time x τ."""
    return x / (1.0 + x) if math.isfinite(x) else 1.0


def mean_merged(x: float) -> float:
    """Mean of x/(1 + x) from 0 to x: 1 − ln(1 + x)/x."""
    return 1.0 - math.log1p(x) / x if x > 1e-6 else 0.5 * x
