"""Ballistic deposition on a plane, with one rolling step from the first to a second contact."""

import math

from ...compiler.jit import kernel, loop
from ...numerics.random import random_words, uniform
from ...numerics.vec import across, axpy, dot, norm, put, scale
from .aggregation import START
from .hash_grid import APART, EMPTY, TRIES, cell_key, cell_on_axis, first_in_cell, insert_in_cell, pair_rest_distance


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
def landing_height(grid, position, grain_set, b, x, y, side, count):
    """Height at which grain b, falling at (x, y), lands, and the grain below it; EMPTY: the floor at z = 0."""
    height, neighbour = grain_set.radius[b], EMPTY
    for step in range(9):
        j = first_in_cell(grid, periodic_column_key(x, y, step, grid.width, count))
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
def touches_other_periodic(grid, position, grain_set, b, x, side, count, known):
    """Whether grain b at x touches any grain other than the two `known` ones, periodic images included."""
    for step in range(9):
        j = first_in_cell(grid, periodic_column_key(x[0], x[1], step, grid.width, count))
        while j != EMPTY:
            image = nearest_image(position, j, x, side)
            d = (x[0] - image[0], x[1] - image[1], x[2] - image[2])
            touch = (grain_set.radius[b] + grain_set.radius[j]) * (1.0 + APART)
            if dot(d, d) <= touch * touch and j != known[0] and j != known[1]:
                return True
            j = grid.next_in_cell[j]
    return False


@loop
def roll_to_second_contact(grid, position, grain_set, b, x, neighbour, side, count):
    """Nearest position to which grain b, at x on `neighbour`, can roll to touch a second grain.

    Returns
    -------
    place : tuple of float
        New centre [m]; x if there is none.
    second : int
        The second grain, or EMPTY.
    """
    origin = nearest_image(position, neighbour, x, side)
    arm = pair_rest_distance(grain_set, b, neighbour)
    own = scale(1.0 / arm, (x[0] - origin[0], x[1] - origin[1], x[2] - origin[2]))
    best, place, second = -1.0, x, EMPTY
    for step in range(9):
        k = first_in_cell(grid, periodic_column_key(x[0], x[1], step, grid.width, count))
        while k != EMPTY:
            image = nearest_image(position, k, x, side)
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
                    nearer = dot(way, own) > best and new[2] >= grain_set.radius[b]
                    if nearer and not touches_other_periodic(
                        grid, position, grain_set, b, new, side, count, (neighbour, k)
                    ):
                        best, place, second = dot(way, own), new, k
            k = grid.next_in_cell[k]
    return place, second


@kernel
def deposit(grid, position, grain_set, side, count, seed):
    """Drop all grains one by one on a periodic square.

    A grain that lands on another rolls over it to the nearest position where it touches a second one.

    Parameters
    ----------
    grid : HashGrid
        An empty grid.
    position : ndarray
        (3, N) [m], set here.
    grain_set : GrainSet
        Properties of the grains.
    side : float
        Side of the square [m].
    count : int
        Number of columns of the grid along each side.
    seed : int
        Seed of the random numbers.

    Returns
    -------
    int
        Number of grains placed; less than N if each of `TRIES` attempts of a grain had too many contacts.
    """
    for b in range(grain_set.radius.size):
        placed = False
        for number in range(TRIES):
            words = random_words(seed, number, b, START)
            x, y = side * uniform(words[0]), side * uniform(words[1])
            z, neighbour = landing_height(grid, position, grain_set, b, x, y, side, count)
            place, second = (x, y, z), EMPTY
            if neighbour != EMPTY:
                place, second = roll_to_second_contact(grid, position, grain_set, b, place, neighbour, side, count)
            if second != EMPTY or not touches_other_periodic(
                grid, position, grain_set, b, place, side, count, (neighbour, second)
            ):
                place = (place[0] % side, place[1] % side, place[2])
                put(position, b, place)
                insert_in_cell(grid, periodic_column_key(place[0], place[1], 4, grid.width, count), b)
                placed = True
                break
        if not placed:
            return b
    return grain_set.radius.size
