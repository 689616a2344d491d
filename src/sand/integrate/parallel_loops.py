"""The large loops of a step, by one thread or by a crew."""

import functools
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..compiler.jit import loop
from ..contact.gather import gather_by_number
from ..contact.slip import book_passed, contact_pass, kept_passed
from ..numerics.float_order import rank, rank_for_most, ranked
from ..state.state import CONTACTS, STEP
from .kernel_spec import Plan
from .motion import gather_and_kick, kick_and_drift_for
from .task_queue import (
    CONTACTS_AT_ONCE,
    DRIFT,
    FAR,
    GATHER,
    GATHER_AND_KICK,
    GRAINS_AT_ONCE,
    PASS,
    blocks_of,
    crew_for,
    span_of_drift,
)


@loop
def _pass_alone(grains, contacts, far, clock, count, lost, rules):
    last = np.uint64(count[CONTACTS])
    passed = contact_pass(grains, contacts, np.uint64(0), last, rules.span, rules.contact, clock[STEP])
    book_passed(count, lost, passed)
    return passed.waiting > 0.0


@loop
def _gather_alone(grains, contacts, far, count, rules):
    gather_by_number(grains, contacts, np.uint64(0), np.uint64(grains.mass.size))


@loop
def _gather_and_kick_alone(grains, contacts, far, count, rules, dt):
    fastest, quickest = gather_and_kick(grains, contacts, np.uint64(0), np.uint64(grains.mass.size), dt)
    return ranked(fastest), ranked(quickest)


class Large(NamedTuple):
    """The large loops of a step."""

    pass_contacts: Callable  # over all contacts; True if any wait
    gather: Callable  # their loads at grains
    gather_and_kick: Callable  # these, and a kick
    far_loads: Callable
    drift: Callable  # half a kick and a drift; the longest way [m]


@functools.cache
def large_loops(plan: Plan) -> Large:
    """The large loops for one plan."""
    return _by_a_crew(plan) if plan.crew else _alone(plan)


def _alone(plan: Plan) -> Large:
    sum_far, kick_and_drift = plan.far.loads, kick_and_drift_for(plan.magnetic)

    @loop
    def far_alone(grains, contacts, far, count, rules):
        sum_far(grains, far, rules.span, rules.far)

    @loop
    def drift_alone(grains, contacts, far, count, rules, dt):
        return kick_and_drift(grains, span_of_drift(rules), dt)

    return Large(_pass_alone, _gather_alone, _gather_and_kick_alone, far_alone, drift_alone)


def _by_a_crew(plan: Plan) -> Large:
    share, _ = crew_for(plan)
    begin, _, end, far_blocks = plan.far.parts

    @loop
    def pass_together(grains, contacts, far, clock, count, lost, rules):
        rules.crew.step[0] = clock[STEP]
        blocks = blocks_of(count[CONTACTS], CONTACTS_AT_ONCE)
        share(PASS, blocks, grains, contacts, far, count, rules)
        waiting = False
        for b in range(blocks):
            passed = kept_passed(rules.crew.passed, b)
            waiting |= passed.waiting > 0.0
            book_passed(count, lost, passed)
        return waiting

    @loop
    def gather_together(grains, contacts, far, count, rules):
        blocks = blocks_of(grains.mass.size, GRAINS_AT_ONCE)
        share(GATHER, blocks, grains, contacts, far, count, rules)

    @loop
    def gather_and_kick_together(grains, contacts, far, count, rules, dt):
        rules.crew.step[0] = dt
        blocks = blocks_of(grains.mass.size, GRAINS_AT_ONCE)
        share(GATHER_AND_KICK, blocks, grains, contacts, far, count, rules)
        fastest = quickest = rank(0.0)
        for b in range(blocks):
            fastest = max(fastest, rank_for_most(rules.crew.speeds[b, 0]))
            quickest = max(quickest, rank_for_most(rules.crew.speeds[b, 1]))
        return ranked(fastest), ranked(quickest)

    @loop
    def far_together(grains, contacts, far, count, rules):
        begin(grains, far, rules.span, rules.far)
        share(FAR, far_blocks(grains), grains, contacts, far, count, rules)
        end(grains, far, rules.span, rules.far)

    @loop
    def drift_together(grains, contacts, far, count, rules, dt):
        rules.crew.step[0] = dt
        blocks = blocks_of(grains.mass.size, GRAINS_AT_ONCE)
        share(DRIFT, blocks, grains, contacts, far, count, rules)
        fastest = rank(0.0)
        for b in range(blocks):
            fastest = max(fastest, rank_for_most(rules.crew.speeds[b, 0]))
        return dt * math.sqrt(ranked(fastest))

    return Large(pass_together, gather_together, gather_and_kick_together, far_together, drift_together)
