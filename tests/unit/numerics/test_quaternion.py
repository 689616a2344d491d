"""Rotation by quaternions against the paper's matrix, its differential equation, and SciPy."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from sand.numerics.quaternion import quaternion_of, turn, turned, turned_back

angle = st.tuples(*[st.floats(-0.1, 0.1)] * 3)
quaternion = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1)


def normalised(q):
    return tuple((np.array(q) / np.linalg.norm(q)).tolist())


def paper_matrix(q):
    """Eq. 30."""
    a, b, c, d = q
    return np.array(
        [
            [a * a - b * b - c * c + d * d, 2 * (a * b - c * d), 2 * (a * c + b * d)],
            [2 * (a * b + c * d), -a * a + b * b - c * c + d * d, 2 * (b * c - a * d)],
            [2 * (a * c - b * d), 2 * (b * c + a * d), -a * a - b * b + c * c + d * d],
        ]
    )


@given(quaternion, angle)
def test_turned_equals_the_papers_matrix(q, v):
    """R(ϱ) v of Eq. 30, SciPy's active rotation (scalar last), and the inverse."""
    q = normalised(q)
    assert turned(q, v) == pytest.approx(paper_matrix(q) @ v, abs=1e-15)
    assert turned(q, v) == pytest.approx(Rotation.from_quat(q).apply(v), abs=1e-15)
    assert turned_back(q, turned(q, v)) == pytest.approx(v, abs=1e-15)


@given(quaternion, angle)
def test_turn_is_a_rotation_in_the_laboratory_frame(q, step):
    """ϱ after ω dt equals exp(ω dt)·R; error of the angle h⁷/420 with h half of it, here ≤ 9e-11."""
    q = normalised(q)
    exact = Rotation.from_rotvec(step) * Rotation.from_quat(q)
    found = Rotation.from_quat(turn(q, step))
    assert (found * exact.inv()).magnitude() < (0.5 * np.linalg.norm(step)) ** 7 / 400 + 1e-14
    assert np.linalg.norm(turn(q, step)) == pytest.approx(1.0, abs=2e-15)


def test_turn_follows_the_papers_differential_equation():
    """Eq. 31: dϱ/dt; central difference, error dt² ω³/24 ~ 1e-9."""
    q, w, dt = normalised((0.3, -0.5, 0.2, 0.7)), (0.4, -1.1, 0.8), 1e-5
    a, b, c, d = q
    rate = (
        (d * w[0] + c * w[1] - b * w[2]) / 2,
        (d * w[1] - c * w[0] + a * w[2]) / 2,
        (b * w[0] - a * w[1] + d * w[2]) / 2,
        -(c * w[2] + b * w[1] + a * w[0]) / 2,
    )
    ahead, behind = turn(q, tuple(dt * x for x in w)), turn(q, tuple(-dt * x for x in w))
    assert [(f - g) / (2 * dt) for f, g in zip(ahead, behind, strict=True)] == pytest.approx(rate, abs=1e-9)


def test_turn_by_the_opposite_angle_is_the_inverse():
    """turn(turn(ϱ, a), −a) = ϱ to rounding; dissipation is computed from this earlier orientation."""
    q = normalised((0.1, 0.9, -0.3, 0.2))
    step = (0.01, -0.02, 0.03)
    assert turn(turn(q, step), tuple(-x for x in step)) == pytest.approx(q, abs=1e-15)


def test_ten_thousand_turns_stay_normalised():
    """Renormalisation keeps |ϱ| = 1 to rounding, and the angles add up."""
    q = (0.0, 0.0, 0.0, 1.0)
    for _ in range(10_000):
        q = turn(q, (0.0, 0.0, 2 * math.pi / 1000))
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-15)
    assert Rotation.from_quat(q).magnitude() == pytest.approx(0.0, abs=1e-9)


@given(quaternion)
def test_a_quaternion_of_its_matrix(q):
    """ϱ → R(ϱ) → ±ϱ: rows of 4 ϱ ϱᵀ, of which the longest is at least 2 long, have errors of a few ε = 2.2e-16."""
    q = np.array(normalised(q))
    found = quaternion_of(paper_matrix(q))
    assert abs(found @ q) == pytest.approx(1.0, rel=0.0, abs=2e-15)
    assert found * np.sign(found @ q) == pytest.approx(q, rel=0.0, abs=4e-15)
