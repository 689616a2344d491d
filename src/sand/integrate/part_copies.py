"""Stages of a part of the grains that takes steps of its own: copies to it and back, its start, and its sums.

Columns of many arrays are copied in one call.  The arrays are given by their addresses, so that one loop serves all
groups of arrays (`basics.array_groups`).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np

from ..basics.alignment import address
from ..basics.array_groups import GRAINS, arrays_of
from ..basics.state import (
    CHECKED,
    COMPARED,
    CONTACT_LIMIT,
    CONTACT_STEPS,
    CONTACTS,
    EVENTS,
    EXTREMES,
    GRAINS_AWAKE,
    IMPACT_SPEED,
    KICKED,
    LARGEST_IMPACT,
    SETTLED,
    STEP_INCREASES,
    STEPS,
    SUMS,
    TIME,
)
from ..compiler.addresses import bytes_at, half_words_at, words_at
from ..compiler.jit import formula
from ..compiler.stage import stage
from ..contact.gather import sort_contacts_by_grain
from .step_control import INCREASE_INTERVAL

SOURCE, TARGET, SOURCE_COLUMNS, TARGET_COLUMNS, ROWS, NUMBER_SIZE, OF_GRAINS, NAMES_GRAINS = range(8)
"""Columns of `ColumnCopies.arrays`: addresses, lengths of rows, number of rows, bytes of a number, whether the columns
are those of grains, and whether the numbers are indices of grains."""


class ColumnCopies(NamedTuple):
    """Which columns of which arrays are copied, and to which."""

    arrays: np.ndarray  # (A, 8) int64, a row for each pair of arrays
    grain: np.ndarray  # (2, n) int64: columns of grains in the source, and in the target
    contact: np.ndarray  # (2, c) int64: columns of contacts in the source, and in the target
    number: np.ndarray  # int64: index in the target of each grain of the source that is copied


NO_COPIES = ColumnCopies(*(np.zeros((1,) * each, np.int64) for each in (2, 2, 2, 1)))
"""Copies of the types of all others."""


def array_pairs(source: Any, target: Any, names: Iterable[str], indices: Collection[str] = ()) -> Iterator[list[int]]:
    """Rows of `ColumnCopies.arrays` for the arrays of two groups with these names, without empty ones.

    `indices` are the names of arrays of indices of grains.
    """
    declared = arrays_of(source)
    for name in names:
        one, other = getattr(source, name), getattr(target, name)
        if one.size and other.size:
            sizes = one.shape[-1], other.shape[-1], one.size // one.shape[-1], one.itemsize
            yield [address(one), address(other), *sizes, declared[name].shape[-1] == GRAINS, name in indices]


@formula
def _copy_array(source, target, sizes, columns):
    """Copy columns of the rows of two arrays; sizes = (rows, lengths of a row in the source, and in the target)."""
    for r in range(sizes[0]):
        one, other = r * sizes[1], r * sizes[2]
        for k in range(columns.shape[1]):
            target[other + columns[1, k]] = source[one + columns[0, k]]


@formula
def _copy_columns(arrays, a, columns, number):
    """Copy the columns of the pair of arrays in row a."""
    source, target, rows, width = arrays[a, SOURCE], arrays[a, TARGET], arrays[a, ROWS], arrays[a, TARGET_COLUMNS]
    sizes = rows, arrays[a, SOURCE_COLUMNS], width
    one, other = rows * arrays[a, SOURCE_COLUMNS], rows * width
    if arrays[a, NUMBER_SIZE] == 8:
        _copy_array(words_at(source, one), words_at(target, other), sizes, columns)
    elif arrays[a, NUMBER_SIZE] == 1:
        _copy_array(bytes_at(source, one), bytes_at(target, other), sizes, columns)
    else:
        copied = half_words_at(target, other)
        _copy_array(half_words_at(source, one), copied, sizes, columns)
        if arrays[a, NAMES_GRAINS] == 1:
            for r in range(rows):
                for k in range(columns.shape[1]):
                    at = r * width + columns[1, k]
                    copied[at] = number[copied[at]]


@stage("the copies of some grains and their contacts")
def copy_columns(parameters):
    """Copy what `ColumnCopies` says, one pair of arrays after the other, and their columns in order."""
    for a in range(parameters.arrays.shape[0]):
        if parameters.arrays[a, OF_GRAINS] == 1:
            _copy_columns(parameters.arrays, a, parameters.grain, parameters.number)
        else:
            _copy_columns(parameters.arrays, a, parameters.contact, parameters.number)
    return 0


@stage("the start of a part of the grains")
def begin_part(grains, contacts, pair_list, long_range, clock, count, lost, parameters):
    """Set everything but grains, contacts and bodies as at a start.

    parameters[0] has the time [s], that of the last settling [s], the number of contact steps so far, and of contacts.
    """
    count[:] = 0
    clock[:] = 0.0
    lost[:] = 0.0
    count[COMPARED] = -1
    count[CHECKED] = count[STEP_INCREASES] = -INCREASE_INTERVAL
    clock[TIME] = clock[KICKED] = parameters[0][0]
    clock[SETTLED], clock[CONTACT_LIMIT] = parameters[0][1], math.inf
    # the kicks of the gas are counted with the steps of grains, so that no random number is used twice
    count[CONTACT_STEPS], count[CONTACTS] = int(parameters[0][2]), int(parameters[0][3])
    contacts.every_step[:] = 0
    contacts.kept[:] = 0.0  # displacements of another step, before the clusters moved as rigid bodies
    long_range.anchor[:] = math.inf
    for loads in (long_range.force, long_range.torque, long_range.constant_force, long_range.constant_torque):
        loads[:] = 0.0
    for past in (long_range.past_position, long_range.past_moment, long_range.path):
        past[:] = 0.0
    pair_list.anchor[:] = math.inf
    sort_contacts_by_grain(contacts, count, grains.mass.size)
    return 0


@stage("the sums of a part of the grains")
def add_sums_of_part(clock, count, lost, parameters):
    """Add what a part has counted and lost; `parameters`: its clock, count, lost, and (steps are, share of grains)."""
    part_clock, part_count, part_lost, numbers = parameters
    for number in EVENTS:
        count[number] += part_count[number]
    count[CONTACT_STEPS] = part_count[CONTACT_STEPS]
    count[int(numbers[0])] += part_count[STEPS]
    for k in range(lost.size):
        lost[k] += part_lost[k]
    for k in SUMS:
        clock[k] += part_clock[k]
    for k in EXTREMES:
        clock[k] = max(clock[k], part_clock[k])
    clock[SETTLED] = part_clock[SETTLED]
    clock[GRAINS_AWAKE] += part_clock[GRAINS_AWAKE] * numbers[1]
    if part_clock[LARGEST_IMPACT] > clock[LARGEST_IMPACT]:
        clock[LARGEST_IMPACT], clock[IMPACT_SPEED] = part_clock[LARGEST_IMPACT], part_clock[IMPACT_SPEED]
    return 0
