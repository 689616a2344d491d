"""How slowly straight chains of damped grains come to rest: linear modes beside simulations.

The slowest mode of a chain is bending.  Dashpots act on the motion of neighbours relative to each other, which is
small in a long wave, so that its decay time grows with the fourth power of the number of grains.

Linear modes: M q'' + C q' + K q = 0 for the positions and rotations of all grains, with K and C of one contact from
finite differences of the package's formulas.  Simulation: velocities of the slowest bending mode, and a straight line
through the logarithm of the energy over time.
"""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
from scipy.linalg import eig

import sand
from sand.contact.damping import damping_load, dashpots_of, loads_on_grains, relative_motion, surface_rotation
from sand.contact.law import LAWS, contact_constants
from sand.contact.mechanics import contact_load, pose_of

TABLE = Path(__file__).parents[1] / "docs" / "physics" / "settling.csv"
COLUMNS = (
    *("grains", "period [ns]", "decay time of the amplitude [ns]", "decay time of the energy [ns]"),
    "decay time of the energy, simulated [ns]",
)
LENGTHS = (2, 4, 8, 16, 32)
RADIUS, MATERIAL, RATIO = 1e-8, sand.IRON, 0.2
CONTACT = sand.Contact(damping="critical", damping_ratio=RATIO)


def turned(vector: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """A vector after a rotation by the vector `rotation` [rad]."""
    angle = float(np.linalg.norm(rotation))
    if angle == 0.0:
        return vector
    axis = rotation / angle
    along = axis * (axis @ vector)
    return along + math.cos(angle) * (vector - along) + math.sin(angle) * np.cross(axis, vector)


def pair_loads(moved: np.ndarray, rates: np.ndarray, distance: float, constants) -> np.ndarray:
    """Forces and torques on grain 1 at `distance` · x and grain 2 at the origin, (12,).

    `moved`, `rates`: displacements, rotations and their rates in the same order, force directions of grain 1, rotation
    of grain 1, then grain 2.
    """
    x, rotation = moved.reshape(2, 2, 3)[:, 0], moved.reshape(2, 2, 3)[:, 1]
    v, w = rates.reshape(2, 2, 3)[:, 0], rates.reshape(2, 2, 3)[:, 1]
    axis = np.array([1.0, 0.0, 0.0])
    separation = distance * axis + x[0] - x[1]
    apart = float(np.linalg.norm(separation))
    pointers = tuple(turned(-axis, rotation[0])), tuple(turned(axis, rotation[1]))
    pose = pose_of(tuple(separation), *pointers, float((rotation[0] - rotation[1]) @ axis))
    law, overlap = LAWS[CONTACT.law], 2 * RADIUS - apart
    y = law.radius_root(overlap, constants)
    elastic = contact_load(pose, law.force(overlap, y, constants), RADIUS, RADIUS, constants)
    rolling = surface_rotation(tuple(w[0]), tuple(w[1]), 0.5)
    n, motion = pose.n, relative_motion(tuple(separation), tuple(v[0] - v[1]), rolling, tuple(w[0]), tuple(w[1]))
    dashpots = dashpots_of(law.contact_radius(overlap, y, constants), constants)
    damped = loads_on_grains(damping_load(motion, n, dashpots), tuple(separation), 0.5)
    force, torque1, torque2 = (np.add(a, b) for a, b in zip(elastic, damped, strict=True))
    return np.concatenate([force, torque1, -force, torque2])


def chain_matrices(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Inverse masses (6n,), stiffness and damping (6n, 6n) of a chain along x, by central differences."""
    numbers = sand.theory.contact(MATERIAL, RADIUS)
    mass = MATERIAL.density * 4 / 3 * math.pi * RADIUS**3
    constants = contact_constants(LAWS[CONTACT.law])(CONTACT.pairing(MATERIAL, MATERIAL), RADIUS, RADIUS, mass, mass)
    distance, zero = 2 * RADIUS - numbers.rest_overlap, np.zeros(12)
    # displacements of 1e-4 δ_c, and rates that such displacements have in a period
    step = 1e-4 * numbers.pull_off_overlap * np.tile(np.repeat([1.0, 1.0 / RADIUS], 3), 2)
    stiffness, damping = np.empty((12, 12)), np.empty((12, 12))
    for k, h in enumerate(step):
        unit = h * np.eye(12)[k]
        rate = unit / numbers.slide_period
        change = pair_loads(unit, zero, distance, constants) - pair_loads(-unit, zero, distance, constants)
        stiffness[:, k] = -change / (2 * h)
        change = pair_loads(zero, rate, distance, constants) - pair_loads(zero, -rate, distance, constants)
        damping[:, k] = -change / (2 * rate[k])
    whole = np.zeros((2, 6 * count, 6 * count))
    for i in range(count - 1):
        rows = np.r_[6 * (i + 1) : 6 * (i + 2), 6 * i : 6 * (i + 1)]  # grain 1 of a contact is the next one along x
        whole[0][np.ix_(rows, rows)] += stiffness
        whole[1][np.ix_(rows, rows)] += damping
    inverse = np.tile(np.repeat([1.0 / mass, 1.0 / (0.4 * mass * RADIUS**2)], 3), count)
    return inverse, whole[0], whole[1]


def slowest_bending(count: int) -> tuple[complex, np.ndarray]:
    """Eigenvalue −γ + iΩ [1/s] of the slowest mode of motion across x in the plane xy, and its shape (n, 6)."""
    inverse, stiffness, damping = chain_matrices(count)
    plane = np.flatnonzero(np.tile([False, True, False, False, False, True], count))  # y, and rotation about z
    size = plane.size
    unit = 1e10  # 1/s, for entries of similar sizes
    system = np.zeros((2 * size, 2 * size))
    system[:size, size:] = np.eye(size)
    system[size:, :size] = -inverse[plane, None] * stiffness[np.ix_(plane, plane)] / unit**2
    system[size:, size:] = -inverse[plane, None] * damping[np.ix_(plane, plane)] / unit
    values, vectors = eig(system)
    values = values * unit
    rigid = np.abs(values) < 1e-4 * np.abs(values).max()  # two rigid motions, each with displacement and velocity
    if rigid.sum() != 4:
        raise ValueError(f"{rigid.sum()} rigid motions of {count} grains in place of 4")
    moving = np.flatnonzero(~rigid & (values.imag > 0.0))
    slowest = moving[np.argmin(np.abs(values[moving]))]
    shape = np.zeros(6 * count)
    vector = vectors[:size, slowest]
    shape[plane] = (vector / vector[np.argmax(np.abs(vector) * np.where(np.arange(size) % 2, RADIUS, 1.0))]).real
    return values[slowest], shape.reshape(count, 6)


def simulated_decay(count: int, value: complex, shape: np.ndarray) -> float:
    """Decay time [s] of the energy in a simulation that starts with the velocities of the mode."""
    numbers = sand.theory.contact(MATERIAL, RADIUS)
    position = np.zeros((count, 3))
    position[:, 0] = (2 * RADIUS - numbers.rest_overlap) * np.arange(count)
    size = 1e-3 * numbers.pull_off_overlap * abs(value)  # small amplitudes, for which the springs are linear
    motion = size * shape / np.abs(shape[:, :3]).max() if count > 2 else size / RADIUS * shape / np.abs(shape).max()
    grains = sand.Grains(position, RADIUS, MATERIAL, velocity=motion[:, :3], spin=motion[:, 3:])
    period, decay = 2 * math.pi / abs(value.imag), 0.5 / abs(value.real)
    sim = sand.Simulation(grains, [CONTACT], frame_every=period / 40)
    sim.run(until=max(decay, 4 * period))
    rows = sim.ledger
    energy = sum(rows[name] for name in ("translation", "rotation", "normal", "sliding", "rolling", "twisting"))
    energy -= rows["normal"][0]
    # whole periods: the energy falls in steps, twice a period
    periods = math.floor((rows["time"][-1] - 0.5 * period) / period)
    used = rows["time"] > rows["time"][-1] - periods * period
    return -1.0 / float(np.polyfit(rows["time"][used], np.log(energy[used]), 1)[0])


def rows_of(lengths: tuple[int, ...] = LENGTHS) -> list[list[str]]:
    """Rows of the table: number of grains, and times in ns."""
    found = []
    for count in lengths:
        value, shape = slowest_bending(count)
        times = 2 * math.pi / value.imag, -1.0 / value.real, -0.5 / value.real, simulated_decay(count, value, shape)
        found.append([str(count), *(f"{float(f'{1e9 * time:.3g}'):g}" for time in times)])
    return found


def write() -> str:
    """Measure, write the table, and return its path."""
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([COLUMNS, *rows_of()])
    return str(TABLE)
