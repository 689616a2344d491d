"""Stages of a part of the grains that takes contact steps within a step of all bodies: its start, and its sums."""

import math

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
from ..compiler.stage import stage
from ..contact.gather import sort_contacts_by_grain
from .step_control import INCREASE_INTERVAL


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
