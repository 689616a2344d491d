"""The large loops of a step, by one thread or by a crew."""

import functools
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..compiler.jit import loop
from ..contact.gather import gather_in_index_order
from ..contact.slip import contact_pass, load_slip_sums, log_slip_sums
from ..numerics.simd import float_bits, float_from_bits, magnitude_bits
from ..state.state import CONTACTS, STEP
from .kernel_spec import KernelSpec
from .motion import gather_and_kick, kick_and_drift_for
from .task_queue import (
    CONTACTS_PER_BLOCK,
    DRIFT,
    FAR,
    GATHER,
    GATHER_AND_KICK,
    GRAINS_PER_BLOCK,
    PASS,
    blocks_of,
    span_of_drift,
    worker_loops,
)


@loop
def _pass_alone(grains, contacts, long_range, clock, count, lost, rules):
    last = np.uint64(count[CONTACTS])
    passed = contact_pass(grains, contacts, np.uint64(0), last, rules.span, rules.contact, clock[STEP])
    log_slip_sums(count, lost, passed)
    return passed.pending > 0.0


@loop
def _gather_alone(grains, contacts, long_range, count, rules):
    gather_in_index_order(grains, contacts, np.uint64(0), np.uint64(grains.mass.size))


@loop
def _gather_and_kick_alone(grains, contacts, long_range, count, rules, dt):
    fastest, fastest_spin = gather_and_kick(grains, contacts, np.uint64(0), np.uint64(grains.mass.size), dt)
    return float_from_bits(fastest), float_from_bits(fastest_spin)


class Large(NamedTuple):
    """The large loops of a step."""

    pass_contacts: Callable  # over all contacts; True if any wait
    gather: Callable  # their loads at grains
    gather_and_kick: Callable  # these, and a kick
    far_loads: Callable
    drift: Callable  # half a kick and a drift; the longest way [m]


@functools.cache
def large_loops(plan: KernelSpec) -> Large:
    """The large loops for one plan."""
    return _by_a_crew(plan) if plan.queue else _alone(plan)


def _alone(plan: KernelSpec) -> Large:
    sum_far, kick_and_drift = plan.long_range.loads, kick_and_drift_for(plan.magnetic)

    @loop
    def far_alone(grains, contacts, long_range, count, rules):
        sum_far(grains, long_range, rules.span, rules.long_range)

    @loop
    def drift_alone(grains, contacts, long_range, count, rules, dt):
        return kick_and_drift(grains, span_of_drift(rules), dt)

    return Large(_pass_alone, _gather_alone, _gather_and_kick_alone, far_alone, drift_alone)


def _by_a_crew(plan: KernelSpec) -> Large:
    share, _ = worker_loops(plan)
    begin, _, end, far_blocks = plan.long_range.parts

    @loop
    def pass_together(grains, contacts, long_range, clock, count, lost, rules):
        rules.queue.step[0] = clock[STEP]
        blocks = blocks_of(count[CONTACTS], CONTACTS_PER_BLOCK)
        share(PASS, blocks, grains, contacts, long_range, count, rules)
        waiting = False
        for b in range(blocks):
            passed = load_slip_sums(rules.queue.passed, b)
            waiting |= passed.pending > 0.0
            log_slip_sums(count, lost, passed)
        return waiting

    @loop
    def gather_together(grains, contacts, long_range, count, rules):
        blocks = blocks_of(grains.mass.size, GRAINS_PER_BLOCK)
        share(GATHER, blocks, grains, contacts, long_range, count, rules)

    @loop
    def gather_and_kick_together(grains, contacts, long_range, count, rules, dt):
        rules.queue.step[0] = dt
        blocks = blocks_of(grains.mass.size, GRAINS_PER_BLOCK)
        share(GATHER_AND_KICK, blocks, grains, contacts, long_range, count, rules)
        fastest = fastest_spin = float_bits(0.0)
        for b in range(blocks):
            fastest = max(fastest, magnitude_bits(rules.queue.speeds[b, 0]))
            fastest_spin = max(fastest_spin, magnitude_bits(rules.queue.speeds[b, 1]))
        return float_from_bits(fastest), float_from_bits(fastest_spin)

    @loop
    def combined_sums(grains, contacts, long_range, count, rules):
        begin(grains, long_range, rules.span, rules.long_range)
        share(FAR, far_blocks(grains), grains, contacts, long_range, count, rules)
        end(grains, long_range, rules.span, rules.long_range)

    @loop
    def drift_together(grains, contacts, long_range, count, rules, dt):
        rules.queue.step[0] = dt
        blocks = blocks_of(grains.mass.size, GRAINS_PER_BLOCK)
        share(DRIFT, blocks, grains, contacts, long_range, count, rules)
        fastest = float_bits(0.0)
        for b in range(blocks):
            fastest = max(fastest, magnitude_bits(rules.queue.speeds[b, 0]))
        return dt * math.sqrt(float_from_bits(fastest))

    return Large(pass_together, gather_together, gather_and_kick_together, combined_sums, drift_together)
