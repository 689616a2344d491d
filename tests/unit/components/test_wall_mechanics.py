"""Formulas of a contact with a wall, not compiled: gradients of the energy, and the limit r2 → ∞ of two grains."""

import math
from operator import attrgetter

import numpy as np
import pytest

import sand
from sand.components.wall_formulas import WallPose, wall_constants, wall_displacements, wall_load, wall_pointers
from sand.contact.constants_table import constant_names
from sand.contact.jkr import LAW
from sand.contact.law import contact_constants
from sand.contact.mechanics import contact_load, displacements_of, energies, pose_of, stored_energies
from sand.contact.tangential import pointers_for

R1, MASS = 1e-7, 1e-17
PAIRING = sand.Contact(damping="critical").pairing(sand.SILICA, sand.ICE)
CONSTANTS = wall_constants(LAW)(PAIRING, R1, MASS, math.inf)
TILTED = (0.48, 0.6, 0.64)  # a normal without special directions


def turned(v, angle):
    """Rotation of v by the vector `angle` (Rodrigues)."""
    size = np.linalg.norm(angle)
    k = np.asarray(angle) / size
    return v * math.cos(size) + np.cross(k, v) * math.sin(size) + k * (k @ v) * (1.0 - math.cos(size))


def pose_at(x, angle, n=TILTED, anchor=(2e-9, -1e-9, 3e-9)):
    """Pose of a grain at x, rotated by a vector from the orientation in which its pointer is −n tilted by 0.02."""
    n = np.array(n)
    start = turned(-n, 0.02 * np.cross(n, [1.0, 0.0, 0.0]))
    pointer = turned(start, angle) if np.any(angle) else start
    offset = np.asarray(x) - anchor
    offset = offset - (offset @ n) * n
    return WallPose(tuple(n), float(np.asarray(x) @ n), tuple(offset), tuple(pointer), 0.01 + float(np.dot(angle, n)))


def energy(x, angle):
    """Energy of the four modes [J]; for the normal mode that of the law."""
    found = wall_displacements(pose_at(x, angle), R1)
    y = LAW.radius_root(found.overlap, CONSTANTS)
    return np.array(stored_energies(found, LAW.energy(found.overlap, y, CONSTANTS), CONSTANTS))


@pytest.mark.parametrize("mode", range(4), ids=["normal", "sliding", "rolling", "twisting"])
def test_loads_are_gradients_of_the_energy(mode):
    """F = −∂U/∂x and M = −∂U/∂θ of each mode alone, by central differences.

    Their error is h²/6 of the third derivative and rounding, 1e-16 U/h: below 1e-5 of the largest component for
    h = 1e-6 of the scales r1 δ0 and 1.
    """
    x, zero = np.array(TILTED) * (R1 - 4e-10) + np.array([3e-10, 1e-10, -2e-10]), np.zeros(3)
    stiffness = [CONSTANTS.slide_stiffness, CONSTANTS.roll_stiffness, CONSTANTS.twist_stiffness]
    only = CONSTANTS._replace(
        slide_stiffness=stiffness[0] * (mode == 1),
        roll_stiffness=stiffness[1] * (mode == 2),
        derived=CONSTANTS.derived._replace(roll_torque_stiffness=CONSTANTS.derived.roll_torque_stiffness * (mode == 2)),
        twist_stiffness=stiffness[2] * (mode == 3),
    )
    pose = pose_at(x, zero)
    found = wall_displacements(pose, R1)
    normal = LAW.force(found.overlap, LAW.radius_root(found.overlap, CONSTANTS), CONSTANTS) if mode == 0 else 0.0
    force, torque, _ = wall_load(pose, found.slide, normal, R1, only)
    h, turn = 1e-13, 1e-5
    by_x = [-(energy(x + h * e, zero) - energy(x - h * e, zero))[mode] / (2 * h) for e in np.eye(3)]
    by_angle = [-(energy(x, turn * e) - energy(x, -turn * e))[mode] / (2 * turn) for e in np.eye(3)]
    assert np.abs(np.array(force) - by_x).max() <= 1e-5 * max(np.abs(by_x).max(), 1e-20)
    assert np.abs(np.array(torque) - by_angle).max() <= 1e-5 * max(np.abs(by_angle).max(), 1e-30)
    assert max(np.abs(force).max() > 0.0, np.abs(torque).max() > 0.0)


@pytest.mark.parametrize("ratio", [1e3, 1e5])
def test_limit_of_a_huge_sphere(ratio):
    """Displacements, loads, energies and constants of a sphere with r2 = `ratio` r1 and mass `ratio`³ m1.

    The differences are of the order r1/r2; rounding adds 1e-16 r2/ζ ≈ 1e-16 `ratio` r1/ζ to sliding.
    """
    n, r2 = np.array([0.0, 0.0, 1.0]), ratio * R1
    slide, roll, overlap = np.array([2e-10, 1e-10, 0.0]), np.array([5e-10, -7e-10, 0.0]), 3e-10
    both = contact_constants(LAW)(PAIRING, R1, r2, MASS, MASS * ratio**3)
    n1, n2 = pointers_for(tuple(slide), tuple(roll), tuple(n), R1, r2)
    pose = pose_of(tuple((R1 + r2 - overlap) * n), n1, n2, 0.01)
    pointer, offset = wall_pointers(tuple(slide), tuple(roll), tuple(n), R1)
    at_wall = WallPose(tuple(n), R1 - overlap, offset, pointer, 0.01)
    grains, wall = displacements_of(pose, overlap, R1, r2, both), wall_displacements(at_wall, R1)
    tolerance = 3.0 / ratio + 1e-16 * ratio * R1 / 2e-10

    def agree(a, b):
        assert np.abs(np.subtract(a, b)).max() <= tolerance * np.abs(b).max()

    agree(grains.slide, wall.slide)
    agree(wall.slide, slide)
    agree(grains.roll, wall.roll)
    agree(pointer, n1)
    of_sphere = {"derived.radius2", "derived.inverse_radius2", "derived.inverse_sum"}  # ∞, 0 and 0 at a wall
    for name in set(constant_names(LAW)) - of_sphere:
        agree(attrgetter(name)(both), attrgetter(name)(CONSTANTS))
    assert [attrgetter(name)(CONSTANTS) for name in sorted(of_sphere)] == [0.0, 0.0, math.inf]
    force, torque, _ = contact_load(pose, 2e-9, R1, r2, both)
    force_w, torque_w, _ = wall_load(at_wall, wall.slide, 2e-9, R1, CONSTANTS)
    agree(force, force_w)
    agree(torque, torque_w)
    agree(energies(pose, 1e-17, R1, r2, both), stored_energies(wall, 1e-17, CONSTANTS))
