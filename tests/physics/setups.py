"""Initial conditions and helpers that several physics tests share."""

from __future__ import annotations

import math

import numpy as np

import sand
from sand.contact.jkr import rest_overlap, rest_radius
from sand.contact.model import Contact


def rest_distance(a: sand.Material, r1: float, r2: float, b: sand.Material | None = None) -> float:
    """Equilibrium distance of two centres in contact [m]."""
    p = Contact().pairing(a, b or a)
    reduced = r1 * r2 / (r1 + r2)
    return r1 + r2 - rest_overlap(rest_radius(p.surface_energy, reduced, p.modulus), reduced)


def different(first: sand.Simulation, second: sand.Simulation) -> list[str]:
    """Names of arrays of two regular states that differ in a bit."""
    one, other = first.regular_state.to_arrays(), second.regular_state.to_arrays()
    return [name for name in one if one[name].tobytes() != other[name].tobytes()]


def momenta(sim: sand.Simulation) -> tuple[np.ndarray, np.ndarray]:
    """Momenta m v and angular momenta m x×v + I ω of the grains of the regular state, both (N, 3)."""
    g = sim.regular_state.grains
    p = g.mass[:, None] * g.velocity
    return p, np.cross(g.position, p) + g.inertia[:, None] * g.spin


def struck_chain(
    material: sand.Material = sand.IRON,
    radius: float = 1e-8,
    length: int = 7,
    speed: float = 100.0,
    offset: float = 0.0,
    steps_per_period: float = 25.0,
    **options,
) -> sand.Simulation:
    """A straight chain at rest along x whose end grain is hit by a grain from above; `offset` along x in radii."""
    pitch = rest_distance(material, radius, radius)
    position = np.zeros((length + 1, 3))
    position[:length, 0] = pitch * np.arange(length)
    position[length] = [pitch * (length - 1) + offset * radius, 2.2 * radius, 0.1 * radius]
    velocity = np.zeros((length + 1, 3))
    velocity[length, 1] = -speed
    grains = sand.Grains(position, radius, material, velocity=velocity, **options)
    return sand.Simulation(grains, [sand.Contact()], stepping=sand.Verlet(steps_per_period=steps_per_period))


def random_aggregate(
    count: int, seed: int, *, radii: tuple[float, float] = (1e-8, 1e-8), material=sand.SILICA, **options
) -> sand.Grains:
    """Aggregate of grains added one by one, each in equilibrium contact with a random earlier grain; no overlaps."""
    rng = np.random.default_rng(seed)
    radius = rng.uniform(*radii, size=count)
    position = np.zeros((count, 3))
    for i in range(1, count):
        while True:
            j = int(rng.integers(i))
            direction = rng.normal(size=3)
            direction /= np.linalg.norm(direction)
            position[i] = position[j] + rest_distance(material, radius[i], radius[j]) * direction
            gap = np.linalg.norm(position[:i] - position[i], axis=1) - radius[:i] - radius[i]
            if np.all(np.delete(gap, j) > 0.02 * radius[i]):
                break
    given = {"velocity": 0.3 * rng.normal(size=(count, 3)), "spin": 1e7 * rng.normal(size=(count, 3))}
    return sand.Grains(position, radius, material, **(given | options))


class PrescribedMotion:
    """A simulation with prescribed motion: grains are moved, contacts are updated, forces are ignored."""

    def __init__(self, grains, contact=None):
        self.sim = sand.Simulation(grains, [contact or sand.Contact()], stepping=sand.Verlet(step=1.0))
        self.sim.loads()

    def step(self, velocity, spin):
        """One step of 1 s at these velocities (N, 3) [m/s] and spins [rad/s]; the kick of Verlet is undone."""
        g = self.sim.state.grains.arrays
        g.force[...] = 0.0
        g.torque[...] = 0.0
        g.velocity[...] = np.transpose(velocity)
        g.spin[...] = np.transpose(spin)
        self.sim._engine.advance(math.inf, 1)
