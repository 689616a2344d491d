"""Aggregates that grow grain by grain: on straight lines from all sides, or by diffusion.

Chance comes from `numerics.random`, by seed, number of the try, grain and purpose: an aggregate depends on nothing else.
"""

import math

from ...compiler.jit import kernel, loop
from ...numerics.random import normal_pair, random_words, uniform
from ...numerics.vec import across, add, axpy, dot, load, norm, put, scale, sub
from .hash_grid import EMPTY, clear, free_width, gap_at, head_around, join_hash_grid, rest_between, touches_other

DIRECTION, OFFSET, START, STEPS, RETURN, SIDEWAYS, TURN1, TURN2 = range(8)
"""What random numbers are for."""
TOUCH = 1e-3
"""A walk ends where surfaces are this close, in radii of the largest grain; then the grains are pulled together."""
MOST_STEPS = 100_000


@loop
def random_direction(seed, number, grain, stream):
    """A unit vector, evenly spread, and a number evenly spread over 0 … 1."""
    a, b, _, d = random_words(seed, number, grain, stream)
    z, angle = 2.0 * uniform(a) - 1.0, 2.0 * math.pi * uniform(b)
    flat = math.sqrt(1.0 - z * z)
    return (flat * math.cos(angle), flat * math.sin(angle), z), uniform(d)


@loop
def random_across(seed, number, grain, u):
    """A point of the unit disc across the unit vector u, evenly spread."""
    a, b, c, d = random_words(seed, number, grain, OFFSET)
    x, y = normal_pair(a, b)
    side = across((x, y, normal_pair(c, d)[0]), u)
    return scale(math.sqrt(uniform(random_words(seed, number, grain, START)[0])) / norm(side), side)


@loop
def first_touch(crowd, position, grain_set, b, start, u, way):
    """Where on the line from `start` along u grain b first comes to rest at another, and which; `way` for a miss."""
    reach = grain_set.radius[b] + grain_set.largest
    done = 0.0
    while done < way:
        here = axpy(done, u, start)
        free = free_width(crowd, here)
        if free > 0.0:
            done += free - reach
            continue
        best, mate = crowd.width - reach, EMPTY
        for step in range(27):
            j = head_around(crowd, here, step)
            while j != EMPTY:
                to = sub(load(position, j), here)
                along = dot(to, u)
                miss = dot(to, to) - along * along
                if miss < (grain_set.radius[b] + grain_set.radius[j]) ** 2:
                    rest = rest_between(grain_set, b, j)
                    # grains that are behind have been missed; none of them comes this far
                    if miss < rest * rest and along - math.sqrt(rest * rest - miss) <= best:
                        best, mate = along - math.sqrt(rest * rest - miss), j
                j = crowd.before[j]
        done += best
        if mate != EMPTY:
            return done, mate
    return way, EMPTY


@loop
def stays(crowd, position, grain_set, b, x, mate):
    """Put grain b at x, where it touches its mate, unless it touched another there; whether it stays."""
    if touches_other(crowd, position, grain_set, b, x, mate):
        return False
    put(position, b, x)
    join_hash_grid(crowd, b, x)
    return True


@kernel
def grow_ballistic(crowd, position, grain_set, first, last, extent, seed, tries):
    """Grains first … last − 1 fly in from all sides, one by one, and stay where they touch first.

    Parameters
    ----------
    crowd
        those before `first`, within `extent` [m] of the origin.

    Returns
    -------
    result
        The next grain to fly (less than `last` if one met nobody in `tries` tries, or touched two), and the extent.
    """
    for b in range(first, last):
        size = extent + grain_set.radius[b]
        placed = False
        for number in range(tries):
            u, _ = random_direction(seed, number, b, DIRECTION)
            offset = scale(size, random_across(seed, number, b, u))
            back = math.sqrt(max(size * size - dot(offset, offset), 0.0))
            start = axpy(-back, u, offset)
            way, mate = first_touch(crowd, position, grain_set, b, start, u, 2.0 * back)
            x = axpy(way, u, start)
            if mate != EMPTY and stays(crowd, position, grain_set, b, x, mate):
                extent = max(extent, norm(x) + grain_set.radius[b])
                placed = True
                break
        if not placed:
            return b, extent
    return last, extent


@loop
def returned(seed, number, grain, x, size):
    """Where a walker outside a sphere comes back to it first, and whether it ever does.

    It does with probability R/|x|; s, the distance of that point from x, has 1/s evenly spread (Poisson's kernel).
    """
    far = norm(x)
    words = random_words(seed, number, grain, RETURN)
    if uniform(words[0]) * far > size:
        return x, False
    ratio = far / size
    inverse = 1.0 / (ratio + 1.0) + uniform(words[1]) * 2.0 / (ratio * ratio - 1.0)
    c = min(max((1.0 + ratio * ratio - 1.0 / (inverse * inverse)) / (2.0 * ratio), -1.0), 1.0)
    u = scale(1.0 / far, x)
    side = across(random_direction(seed, number, grain, SIDEWAYS)[0], u)
    sine = math.sqrt(1.0 - c * c) / norm(side)
    return scale(size, axpy(sine, side, scale(c, u))), True


@loop
def walk_in(crowd, position, grain_set, first, last, bound, inner, size, address):
    """Grains first … last − 1, placed about their own centre, diffuse as one until they touch the crowd at the origin.

    A walk on spheres: each step goes as far as nothing can be touched, in any direction.  `bound` keeps for each grain
    how far it is from touching at least, so that few have to be looked at in a step.

    Parameters
    ----------
    inner
        the crowd lies within this radius [m].
    size
        where the centre of the body is farther out nothing can be touched [m].

    Returns
    -------
    result
        The centre, the two grains that are about to touch (EMPTY if the walk did not end), and the gap [m].
    """
    seed, number, grain = address
    u, _ = random_direction(seed, number, grain, START)
    x = scale(size, u)
    moved, near = math.inf, first
    for step in range(MOST_STEPS):
        turn = number * MOST_STEPS + step
        best, who, whom = math.inf, first, EMPTY
        for k in range(last - first):
            b = near + k if near + k < last else near + k - (last - first)
            here = add(x, load(position, b))
            bound[b] = bound[b] - moved if moved < math.inf else norm(here) - grain_set.radius[b] - inner
            if bound[b] < best:
                bound[b], j = gap_at(crowd, position, grain_set, b, here)
                if bound[b] < best:
                    best, who, whom = bound[b], b, j
        near = who
        if whom != EMPTY and best < TOUCH * grain_set.largest:
            return x, who, whom, best
        moved = max(best, TOUCH * grain_set.largest)
        u, _ = random_direction(seed, turn, grain, STEPS)
        x = axpy(moved, u, x)
        if norm(x) > size * (1.0 + 1e-9):
            x, back = returned(seed, turn, grain, x, size)
            if not back:  # another comes from far away, from anywhere
                x = scale(size, random_direction(seed, turn, grain, DIRECTION)[0])
            moved = math.inf
    return x, first, EMPTY, 0.0


@loop
def pulled(position, grain_set, x, offset, b, j):
    """The centre of a body once its grain b has been pulled to rest at grain j, along the line of their centres."""
    apart = sub(add(x, offset), load(position, j))
    distance = norm(apart)
    return axpy((rest_between(grain_set, b, j) - distance) / distance, apart, x)


@kernel
def grow_diffusing(crowd, position, bound, grain_set, first, last, extent, seed, tries):
    """As `grow_ballistic` for grains that diffuse, all at the origin before; `bound` is room for N numbers."""
    for b in range(first, last):
        placed = False
        for number in range(tries):
            size = extent + grain_set.radius[b]
            x, _, mate, _ = walk_in(crowd, position, grain_set, b, b + 1, bound, extent, size, (seed, number, b))
            if mate == EMPTY:
                continue
            x = pulled(position, grain_set, x, (0.0, 0.0, 0.0), b, mate)
            if stays(crowd, position, grain_set, b, x, mate):
                extent = max(extent, norm(x) + grain_set.radius[b])
                placed = True
                break
        if not placed:
            return b, extent
    return last, extent


@kernel
def begin_hash_grid(crowd, position):
    """The first grain is there, at the origin."""
    clear(crowd)
    put(position, 0, (0.0, 0.0, 0.0))
    join_hash_grid(crowd, 0, (0.0, 0.0, 0.0))
