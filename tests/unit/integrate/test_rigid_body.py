"""The free rotor, and the bound of contact loads, against exact solutions and sums over the parts of a body."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from scipy.special import ellipj

import sand
from sand.basics.arrays import body_arrays
from sand.basics.state import BODIES
from sand.integrate.rigid.rigid_body import contact_loads_bound, move_body, sum_body_loads
from sand.numerics.rotor import asymmetric_rotation, free_sphere

INERTIA = (1.0, 2.0, 3.5)


def free_top(time):
    """Angular velocity of a free top with principal moments I₁ < I₂ < I₃ by elliptic functions, in the body.

    Landau & Lifshitz, Mechanics, §37, for L² > 2 E I₂: with τ = t √((I₃ − I₂)(L² − 2 E I₁)/(I₁ I₂ I₃)) and
    m = (I₂ − I₁)(2 E I₃ − L²)/((I₃ − I₂)(L² − 2 E I₁)),
    Ω₁ = √((2 E I₃ − L²)/(I₁ (I₃ − I₁))) cn τ, Ω₂ = √((2 E I₃ − L²)/(I₂ (I₃ − I₂))) sn τ,
    Ω₃ = √((L² − 2 E I₁)/(I₃ (I₃ − I₁))) dn τ.
    """
    one, two, three = INERTIA
    start = np.array([0.8, 0.0, 0.9])
    twice, square = np.dot(INERTIA, start**2), np.dot(np.square(INERTIA), start**2)
    low, high = twice * three - square, square - twice * one
    tau = time * math.sqrt((three - two) * high / (one * two * three))
    sn, cn, dn, _ = ellipj(tau, (two - one) * low / ((three - two) * high))
    return np.array(
        [
            math.sqrt(low / (one * (three - one))) * cn,
            math.sqrt(low / (two * (three - two))) * sn,
            math.sqrt(high / (three * (three - one))) * dn,
        ]
    )


def rotate(steps, end):
    """Orientation and angular momentum in the body after `steps` pieces of the free rotor."""
    q, angular = (0.0, 0.0, 0.0, 1.0), tuple(np.array(INERTIA) * free_top(0.0))
    for _ in range(steps):
        q, angular = asymmetric_rotation(q, angular, INERTIA, end / steps)
    return np.array(free_sphere(q, angular, INERTIA[1], end)), np.array(angular)


@pytest.mark.validates("closed form", "A free asymmetric top turns as Jacobi's elliptic functions say")
@pytest.mark.compiled("contacts")
def test_a_free_top_follows_the_elliptic_functions(record_bound):
    """Angular velocity after 10 time units: errors fall by 4 ± 2 % per halved step (order 2), to 1e-5 with 6400 steps.

    The next term of the error is h² ω² ≈ (10/1600)² smaller.
    """
    exact = free_top(10.0)
    errors = [np.abs(rotate(steps, 10.0)[1] / INERTIA - exact).max() for steps in (1600, 3200, 6400)]
    for longer, shorter in (errors[:2], errors[1:]):
        record_bound("error over that of half the step, over 4", longer / shorter / 4.0, least=0.98, most=1.02)
    record_bound("error of ω after 10 units of time, 6400 steps", errors[2], most=1e-5)


@pytest.mark.compiled("contacts")
def test_a_free_top_keeps_its_angular_momentum():
    """R L is constant to the rounding of 4000 steps, about √4000 × 1e-16 × a few, and |L| likewise."""
    start = np.array(INERTIA) * free_top(0.0)
    q, angular = rotate(4000, 40.0)
    assert np.allclose(Rotation.from_quat(q).apply(angular), start, rtol=0.0, atol=1e-13 * np.linalg.norm(start))


@pytest.mark.compiled("contacts")
def test_a_sphere_rotates_exactly():
    """One step of any length is the rotation by |L| t/I about L, in the body."""
    start, angular = Rotation.from_euler("xyz", [0.3, -0.7, 1.1]), np.array([0.2, -0.5, 0.7])
    found = Rotation.from_quat(free_sphere(tuple(start.as_quat()), tuple(angular), 0.4, 9.0))
    assert (found.inv() * start * Rotation.from_rotvec(angular * 9.0 / 0.4)).magnitude() < 1e-14


class Arrays:
    """Arrays of grains as attributes."""

    def __init__(self, **arrays):
        self.__dict__.update(arrays)


def tumbling_chain(count, seed):
    """Random loads on a crooked chain of unit spheres that tumbles, as one body at rest in its frame."""
    rng = np.random.default_rng(seed)
    step = rng.normal(size=(count, 3))
    position = np.cumsum(2.0 * step / np.linalg.norm(step, axis=1)[:, None], axis=0)
    mass, inertia = np.full(count, 1.5), np.full(count, 0.6)
    s = position - position.mean(axis=0)
    tensor = ((1.5 * s**2).sum() + 0.6 * count) * np.eye(3) - 1.5 * s.T @ s
    principal, axes = np.linalg.eigh(tensor)
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    bodies, number = body_arrays(count), np.zeros(64, np.int64)
    bodies.member[:], bodies.start[1:], number[BODIES] = np.arange(count), count, 1
    bodies.mass[0], bodies.inertia[:, 0] = mass.sum(), principal
    bodies.orientation[:, 0] = Rotation.from_matrix(axes).as_quat()
    bodies.offset[...] = axes.T @ s.T
    bodies.angular_momentum[:, 0] = rng.normal(size=3) * 5.0
    bodies.strength[:, 0] = 1.0, 1.0
    grains = Arrays(mass=mass, inertia=inertia, force=rng.normal(size=(3, count)), torque=rng.normal(size=(3, count)))
    return grains, bodies, number, s, tensor, axes


@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("loaded", [1.0, 0.0])
@pytest.mark.parametrize("seed", range(5))
def test_the_bound_of_contact_loads_holds_for_every_contact_of_a_tumbling_chain(seed, loaded):
    """The load of a contact, by inverse dynamics of the part behind it, never exceeds the bound, nor a hundredth of it.

    With acceleration a and angular acceleration α, the contact behind grains 0 … k carries Σ (m a − F) and, about the
    contact, Σ (I α − M + (s − c)×(m a − F)).  The loads at rest are 0 here; with `loaded` = 0 there is inertia alone.
    """
    grains, bodies, number, s, tensor, axes = tumbling_chain(9, seed)
    grains.force *= loaded
    grains.torque *= loaded
    loads = Arrays(**vars(grains))
    sum_body_loads(loads, bodies, number, False)
    bounds = []
    for strength in ((1.0, np.inf), (np.inf, 1.0)):  # the bound of the force alone, and of the torque
        bodies.strength[:, 0] = strength
        bounds.append(contact_loads_bound(loads, bodies, 0))
    angular = axes @ bodies.angular_momentum[:, 0]
    spin = np.linalg.solve(tensor, angular)
    force = grains.force.T
    torque = (grains.torque.T + np.cross(s, force)).sum(axis=0)
    rate = np.linalg.solve(tensor, torque - np.cross(spin, angular))
    linear = force.sum(axis=0) / grains.mass.sum()
    f = grains.mass[:, None] * (linear + np.cross(rate, s) + np.cross(spin, np.cross(spin, s))) - force
    m = grains.inertia[:, None] * rate - grains.torque.T
    # the whole body carries nothing: the loads balance
    assert np.abs(f.sum(axis=0)).max() < 1e-12 and np.abs((m + np.cross(s, f)).sum(axis=0)).max() < 1e-11
    carried = [], []
    for k in range(1, 9):
        c = 0.5 * (s[k - 1] + s[k])
        carried[0].append(np.linalg.norm(f[:k].sum(axis=0)))
        carried[1].append(np.linalg.norm((m[:k] + np.cross(s[:k] - c, f[:k])).sum(axis=0)))
    for largest, bound in zip(map(max, carried), bounds, strict=True):
        assert 0.01 * bound < largest <= bound


def rotor(inertia, angular):
    """A body of two grains with these principal moments of inertia and angular momentum, in its frame."""
    bodies = body_arrays(2)
    bodies.member[:], bodies.start[1:], bodies.mass[0] = np.arange(2), 2, 1.0
    bodies.inertia[:, 0], bodies.angular_momentum[:, 0] = inertia, angular
    bodies.orientation[:, 0] = 0.0, 0.0, 0.0, 1.0
    return bodies


def exact_rotor(inertia, angular, end):
    """Orientation, as a rotation, by Euler's equations: q̇ = ½ q ω, L̇ = L×ω; DOP853 to 1e-13."""

    def rate(_, y):
        spin, q = y[4:] / inertia, Rotation.from_quat(y[:4], scalar_first=False).as_quat()
        w, v = q[3], q[:3]
        return np.concatenate([0.5 * (w * spin + np.cross(v, spin)), [-0.5 * v @ spin], np.cross(y[4:], spin)])

    start = np.concatenate([[0.0, 0.0, 0.0, 1.0], angular])
    found = solve_ivp(rate, (0.0, end), start, method="DOP853", rtol=1e-13, atol=1e-14)
    return Rotation.from_quat(found.y[:4, -1])


L_OF_SIX = (1.0, 3.885, 4.654)
"""Principal moments of inertia of four grains in a row with two more at a right angle, in units of the smallest."""


@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("direction", [(0.01, 1.0, 0.01), (0.6, 0.5, 0.6), (1.0, 0.1, 0.1), (0.1, 0.1, 1.0)])
def test_errors_of_a_tumbling_body_fall_with_the_square_of_the_pieces(direction):
    """9.5 turns of an L of six grains in one step: the error of the orientation is that of the pieces, of order 2.

    Halved pieces err by a quarter, to the next order, 0.1² of it with some tens of a factor where neighbouring motions
    part, ± 5 %.  With |L| = 1, α = 1/I₁ − 1/I₂ = 0.74 and β = 1/I₂ − 1/I₃ = 0.04, a piece t = 0.1/√(αβ) errs by at most
    t³αβ (α/24 + β/12) (nested commutators), so the time 60 I₂ by 60·3.9·0.1² (0.74/24 + 0.04/12) = 0.081.  In 60 steps
    of 1 rad, whose pieces are no longer, errors are no larger.
    """
    inertia, angular = np.array(L_OF_SIX), np.array(direction) / np.linalg.norm(direction)
    end = 9.5 * 2.0 * math.pi / np.linalg.norm(angular / inertia)
    exact = exact_rotor(inertia, angular, end)

    def error(piece, steps):
        bodies = rotor(inertia, angular)
        for _ in range(steps):
            move_body(bodies, 0, sand.Box.open().span, end / steps, piece)
        return (Rotation.from_quat(bodies.orientation[:, 0]) * exact.inv()).magnitude()

    errors = [error(piece, 1) for piece in (0.1, 0.05, 0.025)]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05, abs=0.0)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.05, abs=0.0)
    assert max(errors[0], error(0.1, 60)) < 0.081


@pytest.mark.compiled("contacts")
@pytest.mark.parametrize(
    "inertia", [(1.0, 3.0, 3.0), (1.0, 1.0, 1.8), (2.0, 2.0, 2.0)], ids=["chain", "ring", "sphere"]
)
def test_symmetric_bodies_rotate_exactly(inertia):
    """Straight chains, rings and spheres: with one piece of any length Euler's equations hold, to those of 1e-13."""
    angular = np.array([0.7, -0.4, 0.5])
    bodies = rotor(inertia, angular)
    move_body(bodies, 0, sand.Box.open().span, 20.0, 100.0)
    difference = Rotation.from_quat(bodies.orientation[:, 0]) * exact_rotor(np.array(inertia), angular, 20.0).inv()
    assert difference.magnitude() < 1e-11
