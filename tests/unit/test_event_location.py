"""Path of two grains within a Runge–Kutta step, against motions that the interpolation reproduces exactly."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial

import sand
from sand.basics.arrays import runge_kutta_arrays
from sand.integrate.event_location import curve_at, first_crossing, separation_curve
from sand.integrate.runge_kutta import STAGES, V, X

STEP = 0.3


def quintic_motion(rng, box):
    """Two grains on polynomials of degree 5 in time: stage values of a step, and the exact separation as function."""
    ways = [[Polynomial(rng.normal(size=6)) for _ in range(3)] for _ in range(2)]
    grains, stages = sand.Grains(np.zeros((2, 3)), 1.0, sand.SILICA).arrays, runge_kutta_arrays(2)
    for g, way in enumerate(ways):
        for axis, x in enumerate(way):
            stages.start[X + axis, g], grains.position[axis, g] = x(0.0), x(STEP)
            for stage, time in ((0, 0.0), (STAGES - 1, STEP)):
                stages.rate[stage, X + axis, g] = x.deriv(1)(time)
                stages.rate[stage, V + axis, g] = x.deriv(2)(time)
    apart = np.array([a(0.0) - b(0.0) for a, b in zip(*ways, strict=True)])
    image = box.nearest(apart) - apart
    return grains, stages, lambda time: np.array([a(time) - b(time) for a, b in zip(*ways, strict=True)]) + image


@pytest.mark.parametrize("box", [sand.Box.open(), sand.Box.periodic(1.5)])
@pytest.mark.parametrize("seed", range(5))
def test_interpolation_of_quintic_motion_is_exact(box, seed):
    """One polynomial of degree 5 has these positions, velocities and accelerations at both ends.

    Position and slope at eleven times, to the rounding of terms of about 10: 1e-13.  In a periodic box the image
    nearest at the start is followed.  In plain Python.
    """
    grains, stages, apart = quintic_motion(np.random.default_rng(seed), box)
    points = separation_curve(grains, stages, box.span, 0, 1, STEP)
    for part in np.linspace(0.0, 1.0, 11):
        separation, slope = curve_at(points, part)
        h = 1e-3
        nearby = [apart((part + k * h) * STEP) for k in (-2, -1, 1, 2)]
        assert separation == pytest.approx(apart(part * STEP), abs=1e-13)
        # fourth-order differences have an error of h⁴/30 of the fifth derivative, about 1e-9
        assert slope == pytest.approx((nearby[0] - 8 * nearby[1] + 8 * nearby[2] - nearby[3]) / (12 * h), abs=1e-8)


@pytest.mark.parametrize("seed", range(5))
def test_first_time_within_a_distance(seed):
    """The first of 2001 sampled times at which the distance is below the limit, to one sampling interval."""
    grains, stages, apart = quintic_motion(np.random.default_rng(seed), sand.Box.open())
    parts = np.linspace(0.0, 1.0, 2001)
    distance = np.linalg.norm([apart(part * STEP) for part in parts], axis=1)
    limit = distance.min() + 0.3 * (distance[0] - distance.min())
    points = separation_curve(grains, stages, sand.Box.open().span, 0, 1, STEP)
    if distance.argmin() == 0:  # the grains separate: no entry below the initial distance
        assert first_crossing(points, 0.999 * distance[0]) > 1.0
    else:
        assert first_crossing(points, limit) == pytest.approx(parts[np.argmax(distance <= limit)], abs=1e-3)
