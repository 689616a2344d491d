"""The worlds that are timed."""

from __future__ import annotations

import numpy as np

import sand
from sand.basics.constants import MAGNETIC
from sand.contact.jkr import rest_overlap, rest_radius

PEER = sand.SILICA.but(name="silica as in LAMMPS", density=2000.0, rolling_limit="2 angstrom")
"""The material of worlds that are beside LAMMPS: E* = 27.8 GPa, γ = 25 mJ/m²."""
RADIUS = 6e-7
"""Of their grains [m]."""
LARGEST = 10_000
"""Grains of the largest cluster that is built in one piece; more are several clusters side by side."""
STEP = 1e-10
"""Seconds of a step of LAMMPS, a little less than SAND takes in contacts."""
SPEED = 0.05
"""Largest speed of a grain along each axis [m/s]: contacts ring and roll, and none breaks."""
SLOW = 0.005
"""The same where grains are not to meet, and contacts not to move."""


def shaken(position: np.ndarray, moment: str | None = None, speed: float = SPEED) -> sand.Grains:
    """Grains of PEER at these places (N, 3) [m], a little shaken; moments of random direction."""
    rng = np.random.default_rng(4)
    velocity = rng.uniform(-speed, speed, position.shape)
    grains = sand.Grains(position - position.mean(0), RADIUS, PEER, velocity=velocity)
    if moment is None:
        return grains
    arrow = rng.normal(size=position.shape)
    arrow *= sand.Grains([[0, 0, 0]], RADIUS, PEER, moment=moment).moment[0, 2] / np.linalg.norm(arrow, axis=1)[:, None]
    return sand.Grains(grains.position, RADIUS, PEER, velocity=velocity, moment=arrow)


def loose(count: int, whole: int = LARGEST) -> np.ndarray:
    """Places (N, 3) [m] of a ballistic particle-cluster aggregate, or of equal ones of `whole` grains side by side."""
    body = sand.setup.bpca(min(count, whole), radius=RADIUS, material=PEER, seed=1).position
    copies = -(-count // whole)
    side = np.ptp(body, axis=0).max() + 4.0 * RADIUS
    grid = np.stack(np.meshgrid(*[np.arange(np.ceil(copies ** (1 / 3) - 1e-9))] * 3, indexing="ij"), -1)
    return (side * grid.reshape(-1, 1, 3)[:copies] + body).reshape(-1, 3)[:count]


def dense(count: int) -> np.ndarray:
    """Places of the innermost grains of a face-centred cubic packing, all contacts at rest: 12 of each grain."""
    edge = np.sqrt(2.0) * rest_distance(PEER, RADIUS)
    cells = int(0.4 * count ** (1 / 3)) + 2  # a sphere of N grains is 0.39 N^(1/3) edges wide, from its centre
    grid = np.stack(np.meshgrid(*[np.arange(-cells, cells + 1)] * 3, indexing="ij"), -1).reshape(-1, 1, 3)
    place = edge * (grid + np.array([[0, 0, 0], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]])).reshape(-1, 3)
    away = (place**2).sum(1)
    inner = np.sort(np.argsort(away, kind="stable")[:count])
    if count and np.sqrt(away[inner].max()) > cells * edge:
        raise ValueError("the packing is cut off by the box it is made in")
    return place[inner]


def sparse(count: int) -> np.ndarray:
    """Places of grains that touch nothing, about three radii apart."""
    side = int(np.ceil(count ** (1 / 3) - 1e-9))
    grid = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), -1).reshape(-1, 3)[:count]
    return RADIUS * (3.0 * grid + np.random.default_rng(3).uniform(-0.2, 0.2, grid.shape))


def stepping(kind: str) -> sand.Verlet:
    """Steps as SAND chooses them; LAMMPS' own where nothing touches, or they would be far longer."""
    return sand.Verlet(step=STEP) if kind == "gas" else sand.Verlet()


PLACES = {"loose": loose, "fcc": dense, "gas": sparse}


def points(count: int) -> tuple[np.ndarray, float]:
    """About so many points (N, 3) in a periodic cube at density 1, on jittered sites, in random order; its side."""
    side = round(count ** (1 / 3))
    rng = np.random.default_rng(5)
    grid = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), -1).reshape(-1, 3)
    place = grid + 0.5 - 0.5 * side + rng.uniform(-0.25, 0.25, grid.shape)
    return rng.permutation(place), float(side)


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


def gas(count: int, periodic: str = "nearest image") -> sand.Simulation:
    """The main job's density with `count` grains: contacts and dipoles, periodic."""
    box = sand.Box.periodic(1.2e-6 * (count / 100) ** (1 / 3))
    grains = sand.setup.gas(
        count, box, radius=1e-8, material=sand.IRON, moment="200 A m^2/kg", temperature=100.0, seed=1
    )
    return sand.Simulation(grains, [sand.Contact(), sand.Dipoles(periodic=periodic)], box=box)


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
