"""The worlds that are timed."""

from __future__ import annotations

import numpy as np

import sand
from sand.core.constants import MAGNETIC
from sand.physics.adhesion import rest_overlap, rest_radius


def rest_distance(material: sand.Material, radius: float) -> float:
    """Distance [m] of two equal grains whose contact is at rest."""
    p = sand.Contact().pairing(material, material)
    return 2 * radius - rest_overlap(rest_radius(p.surface_energy, radius / 2, p.modulus), radius / 2)


def lattice(side: int) -> sand.Simulation:
    """side³ silica grains of 0.6 µm diameter on a cubic lattice, all contacts at rest, a little shaken."""
    radius = 3e-7
    grid = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), -1).reshape(-1, 3)
    velocity = 1e-3 * np.random.default_rng(1).normal(size=grid.shape)
    grains = sand.Grains(grid * rest_distance(sand.SILICA, radius), radius, sand.SILICA, velocity=velocity)
    return sand.Simulation(grains, [sand.Contact()])


def cloud(count: int) -> sand.Simulation:
    """Magnetic iron grains in open space, dipoles over all pairs, no contacts."""
    side = round(count ** (1 / 3)) + 1
    grid = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), -1).reshape(-1, 3)[:count]
    rng = np.random.default_rng(2)
    moment = rng.normal(size=(count, 3))
    moment *= 6.6e-18 / np.linalg.norm(moment, axis=1)[:, None]
    grains = sand.Grains(grid * 2.4e-7, 1e-8, sand.IRON, moment=moment)
    return sand.Simulation(grains, [sand.Dipoles()])


def gas(count: int) -> sand.Simulation:
    """The main job's density with `count` grains: contacts and dipoles, periodic."""
    box = sand.Box.periodic(1.2e-6 * (count / 100) ** (1 / 3))
    grains = sand.setup.gas(
        count, box, radius=1e-8, material=sand.IRON, moment="200 A m^2/kg", temperature=100.0, seed=1
    )
    return sand.Simulation(grains, [sand.Contact(), sand.Dipoles()], box=box)


def dipoles_in_numpy(position: np.ndarray, moment: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Forces and torques of all pairs the way one writes it in NumPy: the peer of the dipole row."""
    r = position[:, None] - position[None]
    square = (r**2).sum(-1)
    np.fill_diagonal(square, np.inf)
    three = 3 * MAGNETIC * square**-2.5
    along_j = np.einsum("ijk,jk->ij", r, moment)
    along_i = np.einsum("ijk,ik->ij", r, moment)
    both = moment @ moment.T
    force = (three * along_i) @ moment + (three * along_j).sum(1)[:, None] * moment
    force += np.einsum("ij,ijk->ik", three * (both - 5 * along_i * along_j / square), r)
    field = np.einsum("ij,ijk->ik", three * along_j, r) - (MAGNETIC * square**-1.5) @ moment
    return force, np.cross(moment, field)
