"""Location of the first contact of two grains within a Runge–Kutta step.

Within a step the separation of a pair is interpolated by the polynomial of degree 5 (quintic Hermite) that matches
positions, velocities and accelerations at both ends; its error is of sixth order in the step, like that of the step
itself.  It is stored as the six control points P_k of a Bézier curve: the curve lies within their convex hull, which
excludes most pairs without a search.
"""

import math

import numpy as np

from ..basics.box import nearest_image
from ..compiler.jit import formula, loop, rare
from ..numerics.vec import add, axpy, dot, load, norm, scale, sub
from .runge_kutta import STAGES, V, X, rows3

OVERLAP_TOLERANCE = 1e-12
"""Largest overlap at first contact, in units of r1 + r2; a step that ends with less is accepted."""
ROUNDING = 1e-15
"""The same in units of the largest coordinate, where rounding errors dominate."""
SAMPLES = 16
"""Intervals of a step, each assumed to contain at most one minimum of the distance of a pair."""
BISECTIONS = 60
"""Bisections of an interval; they locate a root to rounding."""
NEVER = 2.0
"""Contact time returned if there is no contact within the step."""


@formula
def between(a, b, part):
    """Linear interpolation a + part (b − a)."""
    return axpy(part, sub(b, a), a)


@formula
def curve_at(points, part):
    """Point and derivative of the Bézier curve of six control points at 0 ≤ part ≤ 1 (de Casteljau's algorithm)."""
    a, b, c, d, e, f = points
    a, b, c, d, e = (
        between(a, b, part),
        between(b, c, part),
        between(c, d, part),
        between(d, e, part),
        between(e, f, part),
    )
    a, b, c, d = between(a, b, part), between(b, c, part), between(c, d, part), between(d, e, part)
    a, b, c = between(a, b, part), between(b, c, part), between(c, d, part)
    a, b = between(a, b, part), between(b, c, part)
    return between(a, b, part), scale(5.0, sub(b, a))


@loop
def separation_curve(grains, runge_kutta, span, i, j, dt):
    """Control points [m] of the separation x_i − x_j over the step."""
    start, rate, last = runge_kutta.start, runge_kutta.rate, STAGES - 1
    s0 = nearest_image(sub(rows3(start, X, i), rows3(start, X, j)), span)
    moved1, moved2 = (
        sub(load(grains.position, i), rows3(start, X, i)),
        sub(load(grains.position, j), rows3(start, X, j)),
    )
    s1 = add(s0, sub(moved1, moved2))
    v0 = scale(dt / 5.0, sub(rows3(rate[0], X, i), rows3(rate[0], X, j)))
    v1 = scale(dt / 5.0, sub(rows3(rate[last], X, i), rows3(rate[last], X, j)))
    a0 = scale(dt * dt / 20.0, sub(rows3(rate[0], V, i), rows3(rate[0], V, j)))
    a1 = scale(dt * dt / 20.0, sub(rows3(rate[last], V, i), rows3(rate[last], V, j)))
    return s0, add(s0, v0), add(axpy(2.0, v0, s0), a0), add(axpy(-2.0, v1, s1), a1), sub(s1, v1), s1


@formula
def stays_away(points, limit):
    """Whether the curve stays farther than `limit` from the origin, by a bound from its control points."""
    largest = 0.0
    for k in range(1, 6):
        offset = sub(points[k], points[0])
        largest = max(largest, dot(offset, offset))
    return norm(points[0]) - math.sqrt(largest) > limit


@rare
def first_crossing(points, limit):
    """First parameter 0 … 1 at which the curve comes closer to the origin than `limit` [m], or NEVER."""
    before = 0.0
    _, slope = curve_at(points, 0.0)
    was_approaching = dot(points[0], slope) < 0.0
    for k in range(1, SAMPLES + 1):
        after = k / SAMPLES
        point, slope = curve_at(points, after)
        approaching = dot(point, slope) < 0.0
        high = after
        if was_approaching and not approaching:  # a minimum in between
            low = before
            for _ in range(BISECTIONS):
                middle = 0.5 * (low + high)
                point, slope = curve_at(points, middle)
                if dot(point, slope) < 0.0:
                    low = middle
                else:
                    high = middle
            point, _ = curve_at(points, high)
        if dot(point, point) <= limit * limit:
            low = before
            for _ in range(BISECTIONS):
                middle = 0.5 * (low + high)
                point, _ = curve_at(points, middle)
                if dot(point, point) <= limit * limit:
                    high = middle
                else:
                    low = middle
            return high
        before, was_approaching = after, approaching
    return NEVER


@loop
def contact_time_of_pair(grains, runge_kutta, span, i, j, dt):
    """Time of first contact of grains i and j in units of the step; 1 for contact at its end, NEVER for none."""
    reach = grains.radius[i] + grains.radius[j]
    points = separation_curve(grains, runge_kutta, span, i, j, dt)
    if stays_away(points, reach):
        return NEVER
    largest = max(norm(load(grains.position, i)), norm(load(grains.position, j)))
    allowed = OVERLAP_TOLERANCE * reach + ROUNDING * largest
    overlap = reach - norm(points[5])
    if 0.0 <= overlap <= allowed and dot(points[5], sub(points[5], points[4])) < 0.0:
        return 1.0
    return first_crossing(points, reach - 0.5 * allowed)


@loop
def first_contact_time(grains, long_range, runge_kutta, span, search, dt):
    """Time of the first contact of any pair in units of the step; NEVER if there is none.

    With a Verlet list only listed pairs can touch: pairs that are not listed were farther apart than the reach, at
    least r1 + r2 plus the margin Δr, and a grain moves by at most Δr/4 between the construction of the list and the
    start of a step, and by at most Δr/4 in the step.
    """
    listed = search.listed
    first = NEVER
    for k in range(grains.mass.size):
        begin, end = (long_range.start[k], long_range.start[k + 1]) if listed else (np.uint32(0), np.uint32(k))
        i = long_range.order[k] if listed else np.uint32(k)
        for m in range(begin, end):
            j = long_range.order[long_range.neighbour[m]] if listed else np.uint32(m)
            if j < i:
                first = min(first, contact_time_of_pair(grains, runge_kutta, span, i, j, dt))
    return first
