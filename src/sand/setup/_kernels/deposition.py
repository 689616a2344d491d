"""Ballistic deposition on a plane, with rolling from the first to a second and a third contact."""

import math
from typing import Any, NamedTuple

from ...compiler.jit import kernel, loop
from ...numerics.random import random_words, uniform
from ...numerics.vec import across, axpy, cross, dot, norm, put, scale, sub
from .aggregation import START
from .hash_grid import APART, EMPTY, TRIES, cell_key, cell_on_axis, first_in_cell, insert_in_cell, pair_rest_distance


class Ground(NamedTuple):
    """The periodic square on which grains fall, at z = 0."""

    side: float  # [m]
    count: Any  # number of columns of the grid along each side
    height: Any  # (N,) heights [m] at which the grains rest on the floor


@loop
def periodic_column_key(x, y, step, width, count):
    """Key of column number `step` of the 3 × 3 columns around (x, y), in a periodic grid of count × count columns."""
    cx = (cell_on_axis(x, width) + step % 3 - 1) % count
    cy = (cell_on_axis(y, width) + step // 3 - 1) % count
    return cell_key(0, cx, cy, 0)


@loop
def minimum_image(d, side):
    """Minimum-image difference on a periodic axis of length `side`."""
    return d - side * math.floor(d / side + 0.5)


@loop
def landing_height(grid, position, grain_set, b, x, y, ground):
    """Height at which grain b, falling at (x, y), lands, and the grain below it; EMPTY: the floor at z = 0."""
    height, neighbour, side = ground.height[b], EMPTY, ground.side
    for step in range(9):
        j = first_in_cell(grid, periodic_column_key(x, y, step, grid.width, ground.count))
        while j != EMPTY:
            dx, dy = minimum_image(x - position[0, j], side), minimum_image(y - position[1, j], side)
            miss = dx * dx + dy * dy
            if miss < (grain_set.radius[b] + grain_set.radius[j]) ** 2:
                rest = pair_rest_distance(grain_set, b, j)
                if miss < rest * rest and position[2, j] + math.sqrt(rest * rest - miss) > height:
                    height, neighbour = position[2, j] + math.sqrt(rest * rest - miss), j
            j = grid.next_in_cell[j]
    return height, neighbour


@loop
def nearest_image(position, j, x, side):
    """Centre of the periodic image of grain j that is nearest to x."""
    return (
        x[0] - minimum_image(x[0] - position[0, j], side),
        x[1] - minimum_image(x[1] - position[1, j], side),
        position[2, j],
    )


@loop
def touches_other_periodic(grid, position, grain_set, b, x, ground, known):
    """Whether grain b at x touches any grain other than the three `known` ones, periodic images included."""
    for step in range(9):
        j = first_in_cell(grid, periodic_column_key(x[0], x[1], step, grid.width, ground.count))
        while j != EMPTY:
            image = nearest_image(position, j, x, ground.side)
            d = (x[0] - image[0], x[1] - image[1], x[2] - image[2])
            touch = (grain_set.radius[b] + grain_set.radius[j]) * (1.0 + APART)
            if dot(d, d) <= touch * touch and j != known[0] and j != known[1] and j != known[2]:
                return True
            j = grid.next_in_cell[j]
    return False


@loop
def roll_to_second_contact(grid, position, grain_set, b, x, neighbour, ground):
    """Nearest position to which grain b, at x on `neighbour`, can roll to touch a second grain.

    Returns
    -------
    place : tuple of float
        New centre [m]; x if there is none.
    second : int
        The second grain, or EMPTY.
    """
    origin = nearest_image(position, neighbour, x, ground.side)
    arm = pair_rest_distance(grain_set, b, neighbour)
    own = scale(1.0 / arm, (x[0] - origin[0], x[1] - origin[1], x[2] - origin[2]))
    best, place, second = -1.0, x, EMPTY
    for step in range(9):
        k = first_in_cell(grid, periodic_column_key(x[0], x[1], step, grid.width, ground.count))
        while k != EMPTY:
            image = nearest_image(position, k, x, ground.side)
            to = (image[0] - origin[0], image[1] - origin[1], image[2] - origin[2])
            rest = pair_rest_distance(grain_set, b, k)
            distance = norm(to)
            if k != neighbour and abs(arm - rest) < distance < arm + rest:
                e = scale(1.0 / distance, to)
                c = (arm * arm + distance * distance - rest * rest) / (2.0 * arm * distance)
                perpendicular = across(own, e)
                size = norm(perpendicular)
                if size > 0.0 and abs(c) < 1.0:
                    way = axpy(math.sqrt(1.0 - c * c) / size, perpendicular, scale(c, e))
                    new = axpy(arm, way, origin)
                    nearer = dot(way, own) > best and new[2] >= ground.height[b]
                    if nearer and not touches_other_periodic(
                        grid, position, grain_set, b, new, ground, (neighbour, k, EMPTY)
                    ):
                        best, place, second = dot(way, own), new, k
            k = grid.next_in_cell[k]
    return place, second


@loop
def roll_to_third_contact(grid, position, grain_set, b, x, pair, ground):
    """Nearest position to which grain b, at x in contact with a `pair`, can roll about both to touch a third grain.

    Centres in contact with both lie on a circle about the line through them.

    Returns
    -------
    place : tuple of float
        New centre [m]; x if there is none.
    third : int
        The third grain, or EMPTY.
    """
    first = nearest_image(position, pair[0], x, ground.side)
    axis = sub(nearest_image(position, pair[1], x, ground.side), first)
    e = scale(1.0 / norm(axis), axis)
    middle = axpy(dot(sub(x, first), e), e, first)
    circle = norm(sub(x, middle))
    own = scale(1.0 / circle, sub(x, middle))
    best, place, third = -1.0, x, EMPTY
    for step in range(9):
        k = first_in_cell(grid, periodic_column_key(x[0], x[1], step, grid.width, ground.count))
        while k != EMPTY:
            to, rest = sub(nearest_image(position, k, x, ground.side), middle), pair_rest_distance(grain_set, b, k)
            off = across(to, e)
            size = norm(off)
            c = (dot(to, to) + circle * circle - rest * rest) / (2.0 * circle * size) if size > 0.0 else 2.0
            if k != pair[0] and k != pair[1] and abs(c) < 1.0:
                sideways = scale(math.sqrt(1.0 - c * c) / size, cross(e, off))
                for sign in (-1.0, 1.0):
                    way = axpy(c / size, off, scale(sign, sideways))
                    new = axpy(circle, way, middle)
                    if (
                        dot(way, own) > best
                        and new[2] >= ground.height[b]
                        and not touches_other_periodic(grid, position, grain_set, b, new, ground, (pair[0], pair[1], k))
                    ):
                        best, place, third = dot(way, own), new, k
            k = grid.next_in_cell[k]
    return place, third


@kernel
def drop(grid, position, grain_set, ground, contacts, seed):
    """Drop all grains one by one on a periodic square; each sticks at its first touch.

    A grain that lands on another one rolls over it to the nearest position where it touches a second one if `contacts`
    is 2 or 3, and then about both to the nearest position where it touches a third one if it is 3; it stays where it is
    if there is none.

    Parameters
    ----------
    grid : HashGrid
        An empty grid.
    position : ndarray
        (3, N) [m], set here.
    grain_set : GrainSet
        Properties of the grains.
    ground : Ground
        The square.
    contacts : int
        Number of contacts to which a grain rolls, 1 to 3.
    seed : int
        Seed of the random numbers.

    Returns
    -------
    int
        Number of grains placed; less than N if each of `TRIES` attempts of a grain had too many contacts.
    """
    side = ground.side
    for b in range(grain_set.radius.size):
        placed = False
        for number in range(TRIES):
            words = random_words(seed, number, b, START)
            x, y = side * uniform(words[0]), side * uniform(words[1])
            z, neighbour = landing_height(grid, position, grain_set, b, x, y, ground)
            place, second, third = (x, y, z), EMPTY, EMPTY
            if neighbour != EMPTY and contacts > 1:
                place, second = roll_to_second_contact(grid, position, grain_set, b, place, neighbour, ground)
            if second != EMPTY and contacts > 2:
                place, third = roll_to_third_contact(grid, position, grain_set, b, place, (neighbour, second), ground)
            known = (neighbour, second, third)
            if second != EMPTY or not touches_other_periodic(grid, position, grain_set, b, place, ground, known):
                place = (place[0] % side, place[1] % side, place[2])
                put(position, b, place)
                insert_in_cell(grid, periodic_column_key(place[0], place[1], 4, grid.width, ground.count), b)
                placed = True
                break
        if not placed:
            return b
    return grain_set.radius.size
