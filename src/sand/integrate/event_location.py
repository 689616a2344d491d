"""When two grains come to touch within a Runge–Kutta step.

Between the two ends of a step the separation of a pair is the polynomial of degree 5 that has its values, velocities
and accelerations; it errs by the sixth power of the step, as the step itself.  It is kept as six points P_k in
Bézier's form: the curve lies within their hull, which parameters out most pairs without any search.
"""

import math

import numpy as np

from ..box import nearest_image
from ..compiler.jit import formula, loop, rare
from ..numerics.vec import add, axpy, dot, load, norm, scale, sub
from .runge_kutta import STAGES, V, X, rows3

TOUCH_ERROR = 1e-12
"""Largest overlap at a touch, in r1 + r2; a step that ends with it is not shortened any more."""
ROUNDING = 1e-15
"""The same in parts of the coordinates, where these are so large that rounding is more."""
LOOKS = 16
"""Places within a step at which the distance of a pair is looked at; between two there is one minimum at most."""
HALVINGS = 60
"""Of an interval of a step, to find a root to rounding."""
NEVER = 2.0
"""A touch after the end of the step, or none at all."""


@formula
def between(a, b, part):
    """The point at `part` of the way from a to b."""
    return axpy(part, sub(b, a), a)


@formula
def curve_at(points, part):
    """Place and slope of the curve with six points at 0 ≤ part ≤ 1 (de Casteljau's scheme)."""
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
def separation_curve(grains, stages, span, i, j, dt):
    """The six points [m] of the separation x_i − x_j in the step."""
    start, rate, last = stages.start, stages.rate, STAGES - 1
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
    """True if the curve cannot come closer to the origin than `limit`: no point is that far from the first."""
    largest_displacement = 0.0
    for k in range(1, 6):
        way = sub(points[k], points[0])
        largest_displacement = max(largest_displacement, dot(way, way))
    return norm(points[0]) - math.sqrt(largest_displacement) > limit


@rare
def first_crossing(points, limit):
    """The first part of the step at which the curve comes closer than `limit` [m], or NEVER."""
    before = 0.0
    _, slope = curve_at(points, 0.0)
    falling = dot(points[0], slope) < 0.0
    for k in range(1, LOOKS + 1):
        after = k / LOOKS
        place, slope = curve_at(points, after)
        falls = dot(place, slope) < 0.0
        high = after
        if falling and not falls:  # a minimum in between
            low = before
            for _ in range(HALVINGS):
                middle = 0.5 * (low + high)
                place, slope = curve_at(points, middle)
                if dot(place, slope) < 0.0:
                    low = middle
                else:
                    high = middle
            place, _ = curve_at(points, high)
        if dot(place, place) <= limit * limit:
            low = before
            for _ in range(HALVINGS):
                middle = 0.5 * (low + high)
                place, _ = curve_at(points, middle)
                if dot(place, place) <= limit * limit:
                    high = middle
                else:
                    low = middle
            return high
        before, falling = after, falls
    return NEVER


@loop
def contact_time_of_pair(grains, stages, span, i, j, dt):
    """The part of the step at which grains i and j touch first: 1 if they do at its end, to rounding, or NEVER."""
    reach = grains.radius[i] + grains.radius[j]
    points = separation_curve(grains, stages, span, i, j, dt)
    if stays_away(points, reach):
        return NEVER
    long_range = max(norm(load(grains.position, i)), norm(load(grains.position, j)))
    allowed = TOUCH_ERROR * reach + ROUNDING * long_range
    overlap = reach - norm(points[5])
    if 0.0 <= overlap <= allowed and dot(points[5], sub(points[5], points[4])) < 0.0:
        return 1.0
    return first_crossing(points, reach - 0.5 * allowed)


@loop
def first_contact_time(grains, long_range, stages, parameters, dt):
    """The part of the step at which the first of all pairs comes to touch; NEVER if none does.

    With a list, its pairs are all that can: a pair was either listed or farther apart than the reach, r1 + r2 and more
    plus Δr, and each grain has gone at most Δr/4 since the list was made when a step begins, and Δr/4 in it.
    """
    listed = parameters.search.listed
    first = NEVER
    for k in range(grains.mass.size):
        begin, end = (long_range.start[k], long_range.start[k + 1]) if listed else (np.uint32(0), np.uint32(k))
        i = long_range.order[k] if listed else np.uint32(k)
        for m in range(begin, end):
            j = long_range.order[long_range.neighbour[m]] if listed else np.uint32(m)
            if j < i:
                first = min(first, contact_time_of_pair(grains, stages, parameters.span, i, j, dt))
    return first
