"""Aggregates that grow by meeting of clusters: each pair is turned at random, flies or diffuses until it touches."""

import math

from ...compiler.jit import kernel, loop
from ...numerics.quaternion import normalised, turned
from ...numerics.random import normal_pair, random_words, uniform
from ...numerics.vec import add, axpy, load, norm, put, scale, sub
from .aggregation import OFFSET, TURN1, TURN2, pulled, walk_in
from .hash_grid import (
    APART,
    EMPTY,
    HashGrid,
    add_to_cell,
    cell_key,
    cell_on_axis,
    clear,
    join_hash_grid,
    place_of,
    places_for,
    rest_between,
    touches_other,
)

CLOSE_ENOUGH = 0.003
"""A meeting is taken at once if its distance of centres is the wanted one to this part."""


@loop
def middle_of(position, grain_set, first, last):
    """Centre of mass of grains first … last − 1, and their mass."""
    total, x = 0.0, (0.0, 0.0, 0.0)
    for i in range(first, last):
        total += grain_set.mass[i]
        x = axpy(grain_set.mass[i], load(position, i), x)
    return scale(1.0 / total, x), total


@loop
def gyration_square(position, grain_set, first, last, middle, total):
    """Σ m |x − x₀|² / Σ m [m²]"""
    square = 0.0
    for i in range(first, last):
        d = sub(load(position, i), middle)
        square += grain_set.mass[i] * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    return square / total


@loop
def random_turn(seed, number, grain, stream):
    """ϱ of a rotation, evenly over all (Shoemake 1992)."""
    a, b, c, d = random_words(seed, number, grain, stream)
    x, y = normal_pair(a, b)
    z, w = normal_pair(c, d)
    return normalised((x, y, z, w))


@loop
def lay(position, work, grain_set, first, last, middle, q):
    """Put the cluster into `work`, its centre at the origin and turned by q; returns its outer radius [m]."""
    outer = 0.0
    for i in range(first, last):
        x = turned(q, sub(load(position, i), middle))
        put(work, i, x)
        outer = max(outer, norm(x) + grain_set.radius[i])
    return outer


@loop
def column(x, y, step, width):
    """The column of cells `step` further, 4 being that of x, y."""
    return cell_key(0, cell_on_axis(x, width) + step % 3 - 1, cell_on_axis(y, width) + step // 3 - 1, 0)


@loop
def met(crowd, work, grain_set, middle, last, dx, dy):
    """Height at which the second cluster, coming from below at dx, dy, touches the first; and the two grains."""
    height, one, other = math.inf, EMPTY, EMPTY
    for b in range(middle, last):
        x, y, z = work[0, b] + dx, work[1, b] + dy, work[2, b]
        for step in range(9):
            key = column(x, y, step, crowd.width)
            at = place_of(crowd, key)
            j = crowd.head[at] if crowd.key[at] == key else EMPTY
            while j != EMPTY:
                miss = (x - work[0, j]) ** 2 + (y - work[1, j]) ** 2
                if (
                    miss < (grain_set.radius[b] + grain_set.radius[j]) ** 2
                    and work[2, j] - z - 2.0 * grain_set.largest < height
                ):
                    rest = rest_between(grain_set, b, j)
                    if miss < rest * rest and work[2, j] - math.sqrt(rest * rest - miss) - z < height:
                        height, one, other = work[2, j] - math.sqrt(rest * rest - miss) - z, b, j
                j = crowd.before[j]
    return height, one, other


@loop
def strained(crowd, work, grain_set, middle, last, shift, one, other):
    """Whether any pair of the two clusters touches but these two."""
    for b in range(middle, last):
        x = add(load(work, b), shift)
        for step in range(9):
            key = column(x[0], x[1], step, crowd.width)
            at = place_of(crowd, key)
            j = crowd.head[at] if crowd.key[at] == key else EMPTY
            while j != EMPTY:
                touch = (grain_set.radius[b] + grain_set.radius[j]) * (1.0 + APART)
                d = sub(x, load(work, j))
                if d[0] * d[0] + d[1] * d[1] + d[2] * d[2] <= touch * touch and not (b == one and j == other):
                    return True
                j = crowd.before[j]
    return False


@loop
def flown(table, position, work, grain_set, ends, middles, address, wanted):
    """One flight of the second cluster into the first, along z; both lie in `work`.

    Parameters
    ----------
    ends
        the clusters are grains ends[0] … ends[1] − 1 and ends[1] … ends[2] − 1.
    wanted
        distance of centres that is wished for [m], not met by flights further out; infinite: any.

    Returns
    -------
    result
        Whether they met (in one contact), and the shift of the second cluster.
    """
    seed, number, grain = address
    first, middle, last = ends
    reach = lay(position, work, grain_set, first, middle, middles[0], random_turn(seed, number, grain, TURN1))
    reach += lay(position, work, grain_set, middle, last, middles[1], random_turn(seed, number, grain, TURN2))
    crowd = HashGrid(table.key, table.head, table.before, places_for(middle - first, table.mask + 1) - 1, table.width)
    clear(crowd)
    for i in range(first, middle):
        add_to_cell(crowd, column(work[0, i], work[1, i], 4, crowd.width), i)
    words = random_words(seed, number, grain, OFFSET)
    offset = min(reach, wanted) * math.sqrt(uniform(words[0]))
    angle = 2.0 * math.pi * uniform(words[1])
    dx, dy = offset * math.cos(angle), offset * math.sin(angle)
    height, one, other = met(crowd, work, grain_set, middle, last, dx, dy)
    shift = (dx, dy, height)
    return one != EMPTY and not strained(crowd, work, grain_set, middle, last, shift, one, other), shift


@loop
def settle(position, work, ends, shift):
    """The two clusters as they lie in `work` are one now."""
    first, middle, last = ends
    for i in range(first, middle):
        put(position, i, load(work, i))
    for i in range(middle, last):
        put(position, i, add(load(work, i), shift))


@loop
def wanted_distance(goal, squares, masses):
    """Γ of Filippov et al. (2000) [m]: Γ² = M²/(M1M2) (R² − (M1R1² + M2R2²)/M), 0 if the clusters are too wide."""
    total = masses[0] + masses[1]
    rest = goal * goal - (masses[0] * squares[0] + masses[1] * squares[1]) / total
    return math.sqrt(max(rest * total * total / (masses[0] * masses[1]), 0.0))


@kernel
def join_ballistic(table, position, work, grain_set, joins, goals, seed, tries, choices):
    """Pairs of clusters fly into each other, one pair after the other; each becomes one cluster.

    Parameters
    ----------
    joins
        (3, K) the clusters of join k are grains joins[0] … joins[1] − 1 and joins[1] … joins[2] − 1.
    goals
        (K,) radius of gyration [m] wanted of each new cluster; infinite: whatever chance gives.
    choices
        meetings to choose from where one is wanted.

    Returns
    -------
    result
        Number of joins done; less than K where two did not meet in `tries` tries.
    """
    for k in range(goals.size):
        ends = (joins[0, k], joins[1, k], joins[2, k])
        middle1, mass1 = middle_of(position, grain_set, ends[0], ends[1])
        middle2, mass2 = middle_of(position, grain_set, ends[1], ends[2])
        wanted = math.inf
        if goals[k] < math.inf:
            square1 = gyration_square(position, grain_set, ends[0], ends[1], middle1, mass1)
            square2 = gyration_square(position, grain_set, ends[1], ends[2], middle2, mass2)
            wanted = wanted_distance(goals[k], (square1, square2), (mass1, mass2))
        best, chosen, found = math.inf, -1, 0
        for number in range(tries):
            address = (seed, number, joins[1, k])
            good, shift = flown(table, position, work, grain_set, ends, (middle1, middle2), address, wanted)
            if good:
                found += 1
                wrong = abs(norm(shift) - wanted) if wanted < math.inf else 0.0
                if wrong < best:
                    best, chosen = wrong, number
                if found == choices or wrong <= CLOSE_ENOUGH * wanted or wanted == math.inf:
                    break
        if chosen < 0:
            return k
        address = (seed, chosen, joins[1, k])
        good, shift = flown(table, position, work, grain_set, ends, (middle1, middle2), address, wanted)
        settle(position, work, ends, shift)
    return goals.size


@kernel
def join_diffusing(table, position, work, bound, grain_set, joins, seed, tries):
    """As `join_ballistic`, for clusters that diffuse without turning; `bound` is room for N numbers."""
    for k in range(joins.shape[1]):
        ends = (joins[0, k], joins[1, k], joins[2, k])
        middle1, _ = middle_of(position, grain_set, ends[0], ends[1])
        middle2, _ = middle_of(position, grain_set, ends[1], ends[2])
        places = places_for(ends[1] - ends[0], table.mask + 1)
        crowd = HashGrid(table.key, table.head, table.before, places - 1, table.width)
        done = False
        for number in range(tries):
            inner = lay(position, work, grain_set, ends[0], ends[1], middle1, random_turn(seed, number, ends[1], TURN1))
            size = inner + lay(
                position, work, grain_set, ends[1], ends[2], middle2, random_turn(seed, number, ends[1], TURN2)
            )
            clear(crowd)
            for i in range(ends[0], ends[1]):
                join_hash_grid(crowd, i, load(work, i))
            address = (seed, number, ends[1])
            x, one, other, _ = walk_in(crowd, work, grain_set, ends[1], ends[2], bound, inner, size, address)
            if other == EMPTY:
                continue
            x = pulled(work, grain_set, x, load(work, one), one, other)
            alone = True
            for b in range(ends[1], ends[2]):
                if touches_other(crowd, work, grain_set, b, add(x, load(work, b)), other if b == one else EMPTY):
                    alone = False
                    break
            if alone:
                settle(position, work, ends, x)
                done = True
                break
        if not done:
            return k
    return joins.shape[1]
