"""Exact area of the union of discs, for projected areas of aggregates."""

import math

from ..compiler.jit import kernel, loop


@loop
def _covered(x, y, r, i, reach, start, end):
    """Arcs of circle i covered by other discs: their number, with limits in `start` and `end`; −1 if all is covered."""
    n, found = x.size, 0
    for way in (-1, 1):
        j = i + way
        while 0 <= j < n and abs(x[j] - x[i]) < r[i] + reach:
            dx, dy = x[j] - x[i], y[j] - y[i]
            d = math.sqrt(dx * dx + dy * dy)
            # of two identical discs, the later one is covered
            if d + r[i] < r[j] or (d + r[i] == r[j] and (r[j] > r[i] or j < i)):
                return -1
            if d < r[i] + r[j] and d + r[j] > r[i]:
                half = math.acos(max(-1.0, min(1.0, (d * d + r[i] * r[i] - r[j] * r[j]) / (2.0 * d * r[i]))))
                middle = math.atan2(dy, dx)
                low, high = middle - half, middle + half
                if low < -math.pi:
                    start[found], end[found] = low + 2.0 * math.pi, math.pi
                    found += 1
                    low = -math.pi
                if high > math.pi:
                    start[found], end[found] = -math.pi, high - 2.0 * math.pi
                    found += 1
                    high = math.pi
                start[found], end[found] = low, high
                found += 1
            j += way
    return found


@loop
def _arc(x, y, r, low, high):
    """Contribution ½∮(x dy − y dx) of an arc of a circle."""
    turned = r * (high - low) + x * (math.sin(high) - math.sin(low)) - y * (math.cos(high) - math.cos(low))
    return 0.5 * r * turned


@loop
def _sort(start, end, count):
    """Sort arcs by their start (insertion sort)."""
    for a in range(1, count):
        low, high, b = start[a], end[a], a - 1
        while b >= 0 and start[b] > low:
            start[b + 1], end[b + 1] = start[b], end[b]
            b -= 1
        start[b + 1], end[b + 1] = low, high


@kernel
def area_of_union(x, y, r, reach, start, end):
    """Area [m²] of the union of discs by Green's theorem: sum over the uncovered arcs of all circles.

    `x` is sorted, `reach` the largest radius [m]; `start` and `end` are work arrays of length 2N + 2.
    """
    area = 0.0
    for i in range(x.size):
        count = _covered(x, y, r, i, reach, start, end)
        if count < 0:
            continue
        _sort(start, end, count)
        at = -math.pi
        for k in range(count):
            if start[k] > at:
                area += _arc(x[i], y[i], r[i], at, start[k])
            at = max(at, end[k])
        if at < math.pi:
            area += _arc(x[i], y[i], r[i], at, math.pi)
    return area
