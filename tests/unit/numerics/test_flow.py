"""The flow of a box that is deformed: relative velocities, drifts, and how far it carries anchors of lists."""

import numpy as np
import pytest

from sand.basics.box import Box, MovingSpan, TiltedSpan
from sand.numerics import flow

BOX = Box.periodic(3e-6, 2e-6, 4e-6)
RATES = np.array([2e5, -3e5, 1e5])
MOVING, STILL, DT = MovingSpan(*BOX.span, *RATES), BOX.span, 1e-8
TILTED = TiltedSpan(*MOVING, 7e-7, 4e5)
X, U = (4e-7, -9e-7, 1.2e-6), (0.3, -0.1, 0.02)


def test_a_box_that_keeps_its_shape_has_no_flow():
    """The same objects, so that nothing is computed; rates and strains of 0."""
    assert flow.with_flow(U, X, STILL) is U and flow.carried(X, np.ones(3), STILL) is X
    assert flow.rate_of_strain(STILL) == flow.strain_since(np.ones(3), STILL) == 0.0
    assert flow.squared_approach(0.09, 1e-6, STILL) == 4.0 * 0.09


def test_a_drift_keeps_the_velocity_in_the_laboratory():
    """u′ + A′ x′ = u + A x, x′ = x + (u + A x) dt, L′ = (1 + A dt) L, and A′ of the same dL/dt; to rounding."""
    then, position = flow.after_step(DT, MOVING), flow.drifted_with_flow(X, U, MOVING, DT)
    velocity = flow.slowed(U, MOVING, DT)
    before = np.array(flow.with_flow(U, X, MOVING))
    assert before == pytest.approx(np.array(U) + RATES * X, rel=1e-15, abs=0.0)
    assert flow.with_flow(velocity, position, then) == pytest.approx(before, rel=1e-14, abs=0.0)
    assert position == pytest.approx(np.array(X) + DT * before, rel=1e-15, abs=0.0)
    lengths = np.array(BOX.lengths) * (1.0 + RATES * DT)
    assert then[:3] == pytest.approx(lengths, rel=1e-15, abs=0.0)
    assert np.multiply(then[:3], then[3:6]) == pytest.approx(np.ones(3), rel=1e-15, abs=0.0)
    assert np.multiply(then[:3], then[6:]) == pytest.approx(RATES * BOX.lengths, rel=1e-15, abs=0.0)


def test_the_flow_carries_anchors_and_bounds_approaches():
    """A point at rest in the flow stays at its anchor; two points approach by at most Σ|L/L₀ − 1| of their distance."""
    built, now, position = np.array([*BOX.lengths, 0.0]), MOVING, X
    rng = np.random.default_rng(3)
    points = rng.uniform(-0.5, 0.5, (20, 3)) * built[:3]
    moved = points.copy()
    for _ in range(50):
        position = flow.drifted_with_flow(position, (0.0, 0.0, 0.0), now, DT)
        moved = np.array([flow.drifted_with_flow(tuple(x), (0.0, 0.0, 0.0), now, DT) for x in moved])
        now = flow.after_step(DT, now)
    assert flow.carried(X, built, now) == pytest.approx(position, rel=1e-13, abs=0.0)
    strain = flow.strain_since(built, now)
    assert strain == pytest.approx(50 * DT * np.abs(RATES).sum(), rel=1e-12, abs=0.0)
    i, j = np.triu_indices(20, 1)
    before, after = (np.linalg.norm(x[i] - x[j], axis=1) for x in (points, moved))
    assert (before - after <= strain * before).all() and (before - after > 0.1 * strain * before).any()
    approach = np.sqrt(flow.squared_approach(0.25, 2e-7, MOVING))
    assert approach == pytest.approx(1.0 + 2e-7 * np.abs(RATES).sum(), rel=1e-14, abs=0.0)


def of(span):
    """H and A of a tilted box."""
    return (
        np.array([[span.x, 0, span.tilt], [0, span.y, 0], [0, 0, span.z]]),
        np.array([[span.rate_x, 0, span.rate_xz], [0, span.rate_y, 0], [0, 0, span.rate_z]]),
    )


def test_a_drift_in_a_sheared_box():
    """u′ + A′ x′ = u + A x, x′ = x + (u + A x) dt, H′ = (1 + A dt) H, and A′ H′ = A H; to rounding."""
    then, position = flow.after_step(DT, TILTED), flow.drifted_with_flow(X, U, TILTED, DT)
    (box, rate), (box_then, rate_then) = of(TILTED), of(then)
    before = np.array(U) + rate @ X
    assert flow.with_flow(U, X, TILTED) == pytest.approx(before, rel=1e-14, abs=0.0)
    velocity = flow.slowed(U, TILTED, DT)
    assert np.array(velocity) + rate_then @ position == pytest.approx(before, rel=1e-14, abs=0.0)
    assert position == pytest.approx(np.array(X) + DT * before, rel=1e-14, abs=0.0)
    assert box_then == pytest.approx(box + DT * rate @ box, rel=1e-14, abs=0.0)
    assert rate_then @ box_then == pytest.approx(rate @ box, rel=1e-14, abs=1e-16)
    assert then[3:6] == pytest.approx(1.0 / np.diag(box_then), rel=1e-14, abs=0.0)


def test_shear_carries_anchors_and_bounds_approaches():
    """As in a box that is stretched; points approach by at most Σ|F − 1| of their distance, F = H H₀⁻¹."""
    built, now = np.zeros(4), TILTED
    flow.store_box(built, TILTED)
    assert built.tolist() == [*BOX.lengths, 7e-7]
    points = np.random.default_rng(3).uniform(-0.5, 0.5, (20, 3)) * built[:3]
    moved = points.copy()
    for _ in range(50):
        moved = np.array([flow.drifted_with_flow(tuple(x), (0.0, 0.0, 0.0), now, DT) for x in moved])
        now = flow.after_step(DT, now)
    carried = np.array([flow.carried(tuple(x), built, now) for x in points])
    assert carried == pytest.approx(moved, rel=0.0, abs=1e-13 * 4e-6)
    strain = flow.strain_since(built, now)
    change = of(now)[0] @ np.linalg.inv(of(TILTED)[0]) - np.eye(3)
    assert strain == pytest.approx(np.abs(change).sum(), rel=1e-10, abs=0.0)
    i, j = np.triu_indices(20, 1)
    before, after = (np.linalg.norm(x[i] - x[j], axis=1) for x in (points, moved))
    assert (before - after <= strain * before).all()
    assert flow.rate_of_strain(TILTED) == pytest.approx(1e6, rel=1e-14, abs=0.0)
