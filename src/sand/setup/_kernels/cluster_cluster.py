"""Cluster–cluster aggregation: pairs of clusters in random orientation approach ballistically or by diffusion."""

import math

from ...compiler.jit import kernel, loop
from ...numerics.quaternion import normalised, turned
from ...numerics.random import normal_pair, random_words, uniform
from ...numerics.vec import add, axpy, load, norm, put, scale, sub
from .aggregation import OFFSET, TURN1, TURN2, pull_to_rest, walk_on_spheres
from .hash_grid import (
    APART,
    EMPTY,
    TRIES,
    HashGrid,
    cell_key,
    cell_on_axis,
    clear,
    first_in_cell,
    insert_grain,
    insert_in_cell,
    pair_rest_distance,
    table_size,
    touches_other,
)

CHOICES = 100
"""Number of successful collisions of two clusters from which the one nearest to the target is taken."""
DISTANCE_TOLERANCE = 0.003
"""Relative error of the distance of centres at which a collision is accepted without further attempts."""


@loop
def centre_of_mass(position, grain_set, first, last):
    """Centre of mass [m] and mass [kg] of grains first … last − 1."""
    total, x = 0.0, (0.0, 0.0, 0.0)
    for i in range(first, last):
        total += grain_set.mass[i]
        x = axpy(grain_set.mass[i], load(position, i), x)
    return scale(1.0 / total, x), total


@loop
def squared_gyration_radius(position, grain_set, first, last, middle, total):
    """Squared radius of gyration Σ m |x − x₀|² / Σ m [m²]."""
    square = 0.0
    for i in range(first, last):
        d = sub(load(position, i), middle)
        square += grain_set.mass[i] * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    return square / total


@loop
def random_rotation(seed, number, grain, stream):
    """Random quaternion, uniform over all rotations (Shoemake 1992)."""
    a, b, c, d = random_words(seed, number, grain, stream)
    x, y = normal_pair(a, b)
    z, w = normal_pair(c, d)
    return normalised((x, y, z, w))


@loop
def place_rotated(position, work, grain_set, first, last, middle, q):
    """Write the cluster to `work`, centred at the origin and rotated by q; return its outer radius [m]."""
    outer = 0.0
    for i in range(first, last):
        x = turned(q, sub(load(position, i), middle))
        put(work, i, x)
        outer = max(outer, norm(x) + grain_set.radius[i])
    return outer


@loop
def place_both(position, work, grain_set, ends, middles, counter):
    """Write both clusters to `work`, each centred at the origin in a random orientation; return their outer radii [m].

    Parameters as for `try_merge`.
    """
    seed, number, grain = counter
    q1, q2 = random_rotation(seed, number, grain, TURN1), random_rotation(seed, number, grain, TURN2)
    reach1 = place_rotated(position, work, grain_set, ends[0], ends[1], middles[0], q1)
    return reach1, place_rotated(position, work, grain_set, ends[1], ends[2], middles[1], q2)


@loop
def empty_grid(table, grains):
    """Empty grid for this number of grains in the memory of `table`."""
    size = table_size(grains, table.mask + 1)
    grid = HashGrid(table.key, table.head, table.next_in_cell, size - 1, table.width)
    clear(grid)
    return grid


@loop
def column_key(x, y, step, width):
    """Key of the column of cells number `step` of the 3 × 3 columns around (x, y); number 4 contains it."""
    return cell_key(0, cell_on_axis(x, width) + step % 3 - 1, cell_on_axis(y, width) + step // 3 - 1, 0)


@loop
def contact_height(grid, work, grain_set, middle, last, dx, dy):
    """Shift along z of the second cluster, coming from below with offset (dx, dy), at its first contact.

    Returns
    -------
    height : float
        Shift [m]; infinite for a miss.
    one, other : int
        Grains of the second and the first cluster in contact, or EMPTY.
    """
    height, one, other = math.inf, EMPTY, EMPTY
    for b in range(middle, last):
        x, y, z = work[0, b] + dx, work[1, b] + dy, work[2, b]
        for step in range(9):
            j = first_in_cell(grid, column_key(x, y, step, grid.width))
            while j != EMPTY:
                miss = (x - work[0, j]) ** 2 + (y - work[1, j]) ** 2
                if (
                    miss < (grain_set.radius[b] + grain_set.radius[j]) ** 2
                    and work[2, j] - z - 2.0 * grain_set.largest < height
                ):
                    rest = pair_rest_distance(grain_set, b, j)
                    if miss < rest * rest and work[2, j] - math.sqrt(rest * rest - miss) - z < height:
                        height, one, other = work[2, j] - math.sqrt(rest * rest - miss) - z, b, j
                j = grid.next_in_cell[j]
    return height, one, other


@loop
def has_other_contact(grid, work, grain_set, middle, last, shift, one, other):
    """Whether any pair of grains of the two clusters other than (`one`, `other`) is in contact."""
    for b in range(middle, last):
        x = add(load(work, b), shift)
        for step in range(9):
            j = first_in_cell(grid, column_key(x[0], x[1], step, grid.width))
            while j != EMPTY:
                touch = (grain_set.radius[b] + grain_set.radius[j]) * (1.0 + APART)
                d = sub(x, load(work, j))
                if d[0] * d[0] + d[1] * d[1] + d[2] * d[2] <= touch * touch and not (b == one and j == other):
                    return True
                j = grid.next_in_cell[j]
    return False


@loop
def try_merge(table, position, work, grain_set, ends, middles, counter, target):
    """Collide two clusters along z, with random orientations and a random offset; both are written to `work`.

    Parameters
    ----------
    table : HashGrid
        Work space for the grid of the first cluster.
    position, work : ndarray
        (3, N) [m].
    grain_set : GrainSet
        Properties of the grains.
    ends : tuple of int
        The clusters are grains ends[0] … ends[1] − 1 and ends[1] … ends[2] − 1.
    middles : tuple
        Centres of mass of the clusters in `position` [m].
    counter : tuple of int
        Seed, attempt and grain of the random numbers.
    target : float
        Target distance of the centres of mass [m], the upper limit of the offset; infinite: no target.

    Returns
    -------
    merged : bool
        Whether the clusters touch in exactly one contact.
    shift : tuple of float
        Shift of the second cluster [m].
    """
    seed, number, grain = counter
    first, middle, last = ends
    reach1, reach2 = place_both(position, work, grain_set, ends, middles, counter)
    grid = empty_grid(table, middle - first)
    for i in range(first, middle):
        insert_in_cell(grid, column_key(work[0, i], work[1, i], 4, grid.width), i)
    words = random_words(seed, number, grain, OFFSET)
    offset = min(reach1 + reach2, target) * math.sqrt(uniform(words[0]))
    angle = 2.0 * math.pi * uniform(words[1])
    dx, dy = offset * math.cos(angle), offset * math.sin(angle)
    height, one, other = contact_height(grid, work, grain_set, middle, last, dx, dy)
    shift = (dx, dy, height)
    return one != EMPTY and not has_other_contact(grid, work, grain_set, middle, last, shift, one, other), shift


@loop
def merge(position, work, ends, shift):
    """Copy two clusters from `work` to `position`, the second one shifted."""
    first, middle, last = ends
    for i in range(first, middle):
        put(position, i, load(work, i))
    for i in range(middle, last):
        put(position, i, add(load(work, i), shift))


@loop
def target_distance(goal, squares, masses):
    """Distance of centres of mass Γ [m] for a radius of gyration R of the pair; 0 if the clusters are too wide.

    Γ² = M²/(M1M2) (R² − (M1R1² + M2R2²)/M)

    References
    ----------
    Filippov, Zurita & Rosner (2000), J. Colloid Interface Sci. 229, 261.
    """
    total = masses[0] + masses[1]
    rest = goal * goal - (masses[0] * squares[0] + masses[1] * squares[1]) / total
    return math.sqrt(max(rest * total * total / (masses[0] * masses[1]), 0.0))


@kernel
def join_ballistic(table, position, work, grain_set, joins, goals, seed):
    """Merge pairs of clusters by ballistic collisions.

    Parameters
    ----------
    table : HashGrid
        Work space for the grid of the first cluster.
    position, work : ndarray
        (3, N) [m]; `position` is modified.
    grain_set : GrainSet
        Properties of the grains.
    joins : ndarray
        (3, K); pair k is grains joins[0] … joins[1] − 1 and joins[1] … joins[2] − 1.
    goals : ndarray
        (K,) target radius of gyration of each merged cluster [m]; infinite: none.
    seed : int
        Seed of the random numbers.

    Returns
    -------
    int
        Number of merged pairs; less than K if a pair found no single contact in `TRIES` attempts.
    """
    for k in range(goals.size):
        ends = (joins[0, k], joins[1, k], joins[2, k])
        middle1, mass1 = centre_of_mass(position, grain_set, ends[0], ends[1])
        middle2, mass2 = centre_of_mass(position, grain_set, ends[1], ends[2])
        target = math.inf
        if goals[k] < math.inf:
            square1 = squared_gyration_radius(position, grain_set, ends[0], ends[1], middle1, mass1)
            square2 = squared_gyration_radius(position, grain_set, ends[1], ends[2], middle2, mass2)
            target = target_distance(goals[k], (square1, square2), (mass1, mass2))
        best, chosen, found = math.inf, -1, 0
        for number in range(TRIES):
            counter = (seed, number, joins[1, k])
            merged, shift = try_merge(table, position, work, grain_set, ends, (middle1, middle2), counter, target)
            if merged:
                found += 1
                error = abs(norm(shift) - target) if target < math.inf else 0.0
                if error < best:
                    best, chosen = error, number
                if found == CHOICES or error <= DISTANCE_TOLERANCE * target or target == math.inf:
                    break
        if chosen < 0:
            return k
        counter = (seed, chosen, joins[1, k])
        merged, shift = try_merge(table, position, work, grain_set, ends, (middle1, middle2), counter, target)
        merge(position, work, ends, shift)
    return goals.size


@kernel
def join_diffusing(table, position, work, bound, grain_set, joins, seed):
    """Merge pairs of clusters by diffusion without rotation.

    As `join_ballistic`; `bound` is a work array (N,).
    """
    for k in range(joins.shape[1]):
        ends = (joins[0, k], joins[1, k], joins[2, k])
        middle1, _ = centre_of_mass(position, grain_set, ends[0], ends[1])
        middle2, _ = centre_of_mass(position, grain_set, ends[1], ends[2])
        done = False
        for number in range(TRIES):
            counter = (seed, number, ends[1])
            inner, outer = place_both(position, work, grain_set, ends, (middle1, middle2), counter)
            grid = empty_grid(table, ends[1] - ends[0])
            for i in range(ends[0], ends[1]):
                insert_grain(grid, i, load(work, i))
            x, one, other = walk_on_spheres(
                grid, work, grain_set, (ends[1], ends[2]), bound, inner, inner + outer, counter
            )
            if other == EMPTY:
                continue
            x = pull_to_rest(work, grain_set, x, load(work, one), one, other)
            single = True
            for b in range(ends[1], ends[2]):
                if touches_other(grid, work, grain_set, b, add(x, load(work, b)), other if b == one else EMPTY):
                    single = False
                    break
            if single:
                merge(position, work, ends, x)
                done = True
                break
        if not done:
            return k
    return joins.shape[1]
