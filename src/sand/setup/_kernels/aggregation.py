"""Particle–cluster aggregation: grains arrive one by one, ballistically from all directions or by diffusion.

Random numbers are counter-based (`numerics.random`): functions of the seed, the attempt, the grain and the purpose
only.
"""

import math

from ...compiler.jit import kernel, loop
from ...numerics.random import normal_pair, random_words, uniform
from ...numerics.vec import across, add, axpy, dot, load, norm, put, scale, sub
from .hash_grid import (
    EMPTY,
    TRIES,
    empty_distance,
    gap_to_nearest,
    head_of_neighbour_cell,
    insert_grain,
    pair_rest_distance,
    touches_other,
)

DIRECTION, OFFSET, START, STEPS, RETURN, SIDEWAYS, TURN1, TURN2 = range(8)
"""Purposes of random numbers."""
TOUCH = 1e-3
"""Gap, in radii of the largest grain, at which a walk ends; the grains are then moved into contact."""
MOST_WALK_STEPS = 100_000
"""Largest number of steps of one walk."""


@loop
def random_direction(seed, number, grain, stream):
    """Random isotropic unit vector, and a random number uniform in 0 … 1."""
    a, b, _, d = random_words(seed, number, grain, stream)
    z, angle = 2.0 * uniform(a) - 1.0, 2.0 * math.pi * uniform(b)
    flat = math.sqrt(1.0 - z * z)
    return (flat * math.cos(angle), flat * math.sin(angle), z), uniform(d)


@loop
def random_point_on_disc(seed, number, grain, u):
    """Random point, uniform on the unit disc perpendicular to the unit vector u."""
    a, b, c, d = random_words(seed, number, grain, OFFSET)
    x, y = normal_pair(a, b)
    side = across((x, y, normal_pair(c, d)[0]), u)
    return scale(math.sqrt(uniform(random_words(seed, number, grain, START)[0])) / norm(side), side)


@loop
def first_contact_on_line(grid, position, grain_set, b, start, u, longest):
    """Find the first contact of grain b on the line from `start` along the unit vector u.

    Returns
    -------
    path : float
        Distance from `start` at which b is at its equilibrium distance from a grain; `longest` if there is none.
    neighbour : int
        The grain in contact, or EMPTY.
    """
    reach = grain_set.radius[b] + grain_set.largest
    path = 0.0
    while path < longest:
        x = axpy(path, u, start)
        free = empty_distance(grid, x)
        if free > 0.0:
            path += free - reach
            continue
        best, neighbour = grid.width - reach, EMPTY
        for step in range(27):
            j = head_of_neighbour_cell(grid, x, step)
            while j != EMPTY:
                to = sub(load(position, j), x)
                along = dot(to, u)
                miss = dot(to, to) - along * along
                if miss < (grain_set.radius[b] + grain_set.radius[j]) ** 2:
                    rest = pair_rest_distance(grain_set, b, j)
                    # grains behind x were passed without contact, and cannot satisfy this condition
                    if miss < rest * rest and along - math.sqrt(rest * rest - miss) <= best:
                        best, neighbour = along - math.sqrt(rest * rest - miss), j
                j = grid.next_in_cell[j]
        path += best
        if neighbour != EMPTY:
            return path, neighbour
    return longest, EMPTY


@loop
def try_place(grid, position, grain_set, b, x, neighbour):
    """Place grain b at x, in contact with `neighbour`, if it touches no other grain; return whether it was placed."""
    if touches_other(grid, position, grain_set, b, x, neighbour):
        return False
    put(position, b, x)
    insert_grain(grid, b, x)
    return True


@kernel
def grow_ballistic(grid, position, grain_set, seed):
    """Grow an aggregate around grain 0 at the origin: grains arrive on random straight lines, stay at first contact.

    Parameters
    ----------
    grid : HashGrid
        An empty grid.
    position : ndarray
        (3, N) [m], zeros; modified.
    grain_set : GrainSet
        Properties of the grains.
    seed : int
        Seed of the random numbers.

    Returns
    -------
    int
        Number of grains placed; less than N if a grain found no single contact in `TRIES` attempts.
    """
    insert_grain(grid, 0, (0.0, 0.0, 0.0))
    extent = grain_set.radius[0]
    for b in range(1, grain_set.radius.size):
        size = extent + grain_set.radius[b]
        placed = False
        for number in range(TRIES):
            u, _ = random_direction(seed, number, b, DIRECTION)
            offset = scale(size, random_point_on_disc(seed, number, b, u))
            back = math.sqrt(max(size * size - dot(offset, offset), 0.0))
            start = axpy(-back, u, offset)
            path, neighbour = first_contact_on_line(grid, position, grain_set, b, start, u, 2.0 * back)
            x = axpy(path, u, start)
            if neighbour != EMPTY and try_place(grid, position, grain_set, b, x, neighbour):
                extent = max(extent, norm(x) + grain_set.radius[b])
                placed = True
                break
        if not placed:
            return b
    return grain_set.radius.size


@loop
def return_to_sphere(seed, number, grain, x, size):
    """Random first-return point on a sphere of radius R = `size` about the origin, for Brownian motion from x outside.

    The return probability is R/|x|. For the distance s of the return point from x, 1/s is uniformly distributed
    (Poisson kernel of the exterior of a sphere).

    Returns
    -------
    point : tuple of float
        Return point [m]; x if there is none.
    returns : bool
        Whether the walker returns.
    """
    distance = norm(x)
    words = random_words(seed, number, grain, RETURN)
    if uniform(words[0]) * distance > size:
        return x, False
    ratio = distance / size
    inverse = 1.0 / (ratio + 1.0) + uniform(words[1]) * 2.0 / (ratio * ratio - 1.0)
    c = min(max((1.0 + ratio * ratio - 1.0 / (inverse * inverse)) / (2.0 * ratio), -1.0), 1.0)
    u = scale(1.0 / distance, x)
    side = across(random_direction(seed, number, grain, SIDEWAYS)[0], u)
    sine = math.sqrt(1.0 - c * c) / norm(side)
    return scale(size, axpy(sine, side, scale(c, u))), True


@loop
def walk_on_spheres(grid, position, grain_set, body, bound, inner, size, counter):
    """Diffuse the grains of a body, without rotation, until it touches the aggregate at the origin.

    Walk on spheres: each step has a random direction and the length of a lower bound of the gap to the aggregate.

    Parameters
    ----------
    grid : HashGrid
        Contains the grains of the aggregate.
    position : ndarray
        (3, N) [m]; those of the body relative to its centre.
    grain_set : GrainSet
        Properties of the grains.
    body : tuple of int
        (first, last) for the grains first … last − 1.
    bound : ndarray
        Work array (N,): a lower bound of the gap of each grain [m], so that few gaps are computed per step.
    inner : float
        Outer radius of the aggregate about the origin [m].
    size : float
        Radius [m] of the sphere on which the body starts; contact is impossible with its centre farther out.
    counter : tuple of int
        Seed, attempt and grain of the random numbers.

    Returns
    -------
    x : tuple of float
        Centre of the body [m].
    one, other : int
        Grains of the body and of the aggregate that are about to touch; `other` is EMPTY if the walk did not end.
    """
    (seed, number, grain), (first, last) = counter, body
    u, _ = random_direction(seed, number, grain, START)
    x = scale(size, u)
    length, start = math.inf, first
    for step in range(MOST_WALK_STEPS):
        draw = number * MOST_WALK_STEPS + step
        best, one, other = math.inf, first, EMPTY
        for k in range(last - first):
            b = start + k if start + k < last else start + k - (last - first)
            place = add(x, load(position, b))
            bound[b] = bound[b] - length if length < math.inf else norm(place) - grain_set.radius[b] - inner
            if bound[b] < best:
                bound[b], j = gap_to_nearest(grid, position, grain_set, b, place)
                if bound[b] < best:
                    best, one, other = bound[b], b, j
        start = one
        if other != EMPTY and best < TOUCH * grain_set.largest:
            return x, one, other
        length = max(best, TOUCH * grain_set.largest)
        u, _ = random_direction(seed, draw, grain, STEPS)
        x = axpy(length, u, x)
        if norm(x) > size * (1.0 + 1e-9):
            x, back = return_to_sphere(seed, draw, grain, x, size)
            if not back:  # replaced by another walker from infinity, uniform on the sphere
                x = scale(size, random_direction(seed, draw, grain, DIRECTION)[0])
            length = math.inf
    return x, first, EMPTY


@loop
def pull_to_rest(position, grain_set, x, offset, b, j):
    """Centre of a body at x, moved so that its grain b, at `offset`, is at its equilibrium distance from grain j."""
    separation = sub(add(x, offset), load(position, j))
    distance = norm(separation)
    return axpy((pair_rest_distance(grain_set, b, j) - distance) / distance, separation, x)


@kernel
def grow_diffusing(grid, position, grain_set, seed, bound):
    """Grow an aggregate by diffusion, as `grow_ballistic`; `bound` is a work array (N,)."""
    insert_grain(grid, 0, (0.0, 0.0, 0.0))
    extent = grain_set.radius[0]
    for b in range(1, grain_set.radius.size):
        size = extent + grain_set.radius[b]
        placed = False
        for number in range(TRIES):
            x, _, neighbour = walk_on_spheres(
                grid, position, grain_set, (b, b + 1), bound, extent, size, (seed, number, b)
            )
            if neighbour == EMPTY:
                continue
            x = pull_to_rest(position, grain_set, x, (0.0, 0.0, 0.0), b, neighbour)
            if try_place(grid, position, grain_set, b, x, neighbour):
                extent = max(extent, norm(x) + grain_set.radius[b])
                placed = True
                break
        if not placed:
            return b
    return grain_set.radius.size
