"""Grains that fall one by one onto a plane and stay where they land, or roll until they touch a second one."""

import math

from ...compiler.jit import kernel, loop
from ...numerics.random import random_words, uniform
from ...numerics.vec import across, axpy, dot, norm, put, scale
from .aggregation import START
from .hash_grid import APART, EMPTY, add_to_cell, cell_key, cell_on_axis, clear, place_of, rest_between


@loop
def wrapped_key(x, y, step, width, count):
    """The column `step` further, of count × count with a periodic rim."""
    cx = (cell_on_axis(x, width) + step % 3 - 1) % count
    cy = (cell_on_axis(y, width) + step // 3 - 1) % count
    return cell_key(0, cx, cy, 0)


@loop
def nearest_apart(d, side):
    """The shortest image of a difference on a periodic axis."""
    return d - side * math.floor(d / side + 0.5)


@loop
def landing(crowd, position, grain_set, b, x, y, side, count):
    """Height at which grain b, falling at x, y, comes to rest, and on which grain; EMPTY: on the floor at 0."""
    height, mate = grain_set.radius[b], EMPTY
    for step in range(9):
        at = place_of(crowd, wrapped_key(x, y, step, crowd.width, count))
        j = crowd.head[at] if crowd.key[at] != EMPTY else EMPTY
        while j != EMPTY:
            dx, dy = nearest_apart(x - position[0, j], side), nearest_apart(y - position[1, j], side)
            miss = dx * dx + dy * dy
            if miss < (grain_set.radius[b] + grain_set.radius[j]) ** 2:
                rest = rest_between(grain_set, b, j)
                if miss < rest * rest and position[2, j] + math.sqrt(rest * rest - miss) > height:
                    height, mate = position[2, j] + math.sqrt(rest * rest - miss), j
            j = crowd.before[j]
    return height, mate


@loop
def image_near(position, j, x, side):
    """The centre of grain j, on that side of the periodic square that is nearest to x."""
    return (
        x[0] - nearest_apart(x[0] - position[0, j], side),
        x[1] - nearest_apart(x[1] - position[1, j], side),
        position[2, j],
    )


@loop
def touching_here(crowd, position, grain_set, b, x, side, count, one, other):
    """Whether grain b at x touches any grain but these two."""
    for step in range(9):
        at = place_of(crowd, wrapped_key(x[0], x[1], step, crowd.width, count))
        j = crowd.head[at] if crowd.key[at] != EMPTY else EMPTY
        while j != EMPTY:
            there = image_near(position, j, x, side)
            d = (x[0] - there[0], x[1] - there[1], x[2] - there[2])
            touch = (grain_set.radius[b] + grain_set.radius[j]) * (1.0 + APART)
            if dot(d, d) <= touch * touch and j != one and j != other:
                return True
            j = crowd.before[j]
    return False


@loop
def rolled(crowd, position, grain_set, b, x, mate, side, count):
    """Where grain b, at x on its mate, comes to rest at a second grain by rolling as little as can be; that grain."""
    origin = image_near(position, mate, x, side)
    arm = rest_between(grain_set, b, mate)
    own = scale(1.0 / arm, (x[0] - origin[0], x[1] - origin[1], x[2] - origin[2]))
    best, place, second = -1.0, x, EMPTY
    for step in range(9):
        at = place_of(crowd, wrapped_key(x[0], x[1], step, crowd.width, count))
        k = crowd.head[at] if crowd.key[at] != EMPTY else EMPTY
        while k != EMPTY:
            there = image_near(position, k, x, side)
            to = (there[0] - origin[0], there[1] - origin[1], there[2] - origin[2])
            rest = rest_between(grain_set, b, k)
            far = norm(to)
            if k != mate and abs(arm - rest) < far < arm + rest:
                e = scale(1.0 / far, to)
                c = (arm * arm + far * far - rest * rest) / (2.0 * arm * far)
                aside = across(own, e)
                size = norm(aside)
                if size > 0.0 and abs(c) < 1.0:
                    way = axpy(math.sqrt(1.0 - c * c) / size, aside, scale(c, e))
                    new = axpy(arm, way, origin)
                    nearer = dot(way, own) > best and new[2] >= grain_set.radius[b]
                    if nearer and not touching_here(crowd, position, grain_set, b, new, side, count, mate, k):
                        best, place, second = dot(way, own), new, k
            k = crowd.before[k]
    return place, second


@kernel
def deposit(crowd, position, grain_set, side, count, seed, tries):
    """All grains fall one by one on a periodic square of this side [m], of count × count columns.

    One that has landed on another rolls on it to the nearest place where it touches a second.

    Returns
    -------
    result
        The next grain to fall: less than all if one touched more than it may in each of `tries` tries.
    """
    clear(crowd)
    for b in range(grain_set.radius.size):
        placed = False
        for number in range(tries):
            words = random_words(seed, number, b, START)
            x, y = side * uniform(words[0]), side * uniform(words[1])
            z, mate = landing(crowd, position, grain_set, b, x, y, side, count)
            place, second = (x, y, z), EMPTY
            if mate != EMPTY:
                place, second = rolled(crowd, position, grain_set, b, place, mate, side, count)
            if second != EMPTY or not touching_here(crowd, position, grain_set, b, place, side, count, mate, second):
                place = (place[0] % side, place[1] % side, place[2])
                put(position, b, place)
                add_to_cell(crowd, wrapped_key(place[0], place[1], 4, crowd.width, count), b)
                placed = True
                break
        if not placed:
            return b
    return grain_set.radius.size
