"""The large loops of a step: on one thread, or in blocks shared by threads."""

import functools
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..compiler.jit import loop
from ..contact.gather import gather_in_index_order
from ..contact.update import contact_pass_loop, load_slip_sums, log_slip_sums
from ..numerics.simd import float_bits, float_from_bits, magnitude_bits
from ..state.state import CONTACTS, STEP
from .kernel_spec import KernelSpec
from .motion import gather_and_kick, kick_and_drift_for
from .task_queue import (
    CONTACT_PASS,
    CONTACTS_PER_BLOCK,
    DRIFT,
    GATHER,
    GATHER_AND_KICK,
    GRAINS_PER_BLOCK,
    LONG_RANGE,
    blocks_of,
    drift_span,
    worker_loops,
)


class LargeLoops(NamedTuple):
    """The large loops of a step."""

    pass_contacts: Callable  # update of all contacts; True if any has to be settled one by one
    gather: Callable  # sums of the contact loads per grain
    gather_and_kick: Callable  # these sums and a kick
    long_range_loads: Callable
    drift: Callable  # kick dt/2 and drift; returns the largest displacement [m]


@functools.cache
def large_loops(spec: KernelSpec) -> LargeLoops:
    """The large loops for one specification."""
    return _shared_loops(spec) if spec.queue else _serial_loops(spec)


@loop
def _serial_gather(grains, contacts, long_range, count, parameters):
    gather_in_index_order(grains, contacts, np.uint64(0), np.uint64(grains.mass.size))


@loop
def _serial_gather_and_kick(grains, contacts, long_range, count, parameters, dt):
    fastest, fastest_spin = gather_and_kick(grains, contacts, np.uint64(0), np.uint64(grains.mass.size), dt)
    return float_from_bits(fastest), float_from_bits(fastest_spin)


def _serial_loops(spec: KernelSpec) -> LargeLoops:
    sum_long_range, kick_and_drift = spec.long_range.loads, kick_and_drift_for(spec.magnetic)
    contact_pass = contact_pass_loop(spec.law)

    @loop
    def pass_contacts(grains, contacts, long_range, clock, count, lost, parameters):
        last = np.uint64(count[CONTACTS])
        passed = contact_pass(grains, contacts, np.uint64(0), last, parameters.span, parameters.contact, clock[STEP])
        log_slip_sums(count, lost, passed)
        return passed.pending > 0.0

    @loop
    def long_range_loads(grains, contacts, long_range, count, parameters):
        sum_long_range(grains, long_range, parameters.span, parameters.long_range)

    @loop
    def drift(grains, contacts, long_range, count, parameters, dt):
        return kick_and_drift(grains, drift_span(parameters), dt)

    return LargeLoops(pass_contacts, _serial_gather, _serial_gather_and_kick, long_range_loads, drift)


def _shared_loops(spec: KernelSpec) -> LargeLoops:
    share, _ = worker_loops(spec)
    begin, _, end, long_range_blocks = spec.long_range.blocked

    @loop
    def pass_contacts(grains, contacts, long_range, clock, count, lost, parameters):
        parameters.queue.step[0] = clock[STEP]
        blocks = blocks_of(count[CONTACTS], CONTACTS_PER_BLOCK)
        share(CONTACT_PASS, blocks, grains, contacts, long_range, count, parameters)
        waiting = False
        for b in range(blocks):
            passed = load_slip_sums(parameters.queue.passed, b)
            waiting |= passed.pending > 0.0
            log_slip_sums(count, lost, passed)
        return waiting

    @loop
    def gather(grains, contacts, long_range, count, parameters):
        blocks = blocks_of(grains.mass.size, GRAINS_PER_BLOCK)
        share(GATHER, blocks, grains, contacts, long_range, count, parameters)

    @loop
    def gather_and_kick(grains, contacts, long_range, count, parameters, dt):
        parameters.queue.step[0] = dt
        blocks = blocks_of(grains.mass.size, GRAINS_PER_BLOCK)
        share(GATHER_AND_KICK, blocks, grains, contacts, long_range, count, parameters)
        fastest = fastest_spin = float_bits(0.0)
        for b in range(blocks):
            fastest = max(fastest, magnitude_bits(parameters.queue.speeds[b, 0]))
            fastest_spin = max(fastest_spin, magnitude_bits(parameters.queue.speeds[b, 1]))
        return float_from_bits(fastest), float_from_bits(fastest_spin)

    @loop
    def long_range_loads(grains, contacts, long_range, count, parameters):
        begin(grains, long_range, parameters.span, parameters.long_range)
        share(LONG_RANGE, long_range_blocks(grains), grains, contacts, long_range, count, parameters)
        end(grains, long_range, parameters.span, parameters.long_range)

    @loop
    def drift(grains, contacts, long_range, count, parameters, dt):
        parameters.queue.step[0] = dt
        blocks = blocks_of(grains.mass.size, GRAINS_PER_BLOCK)
        share(DRIFT, blocks, grains, contacts, long_range, count, parameters)
        fastest = float_bits(0.0)
        for b in range(blocks):
            fastest = max(fastest, magnitude_bits(parameters.queue.speeds[b, 0]))
        return dt * math.sqrt(float_from_bits(fastest))

    return LargeLoops(pass_contacts, gather, gather_and_kick, long_range_loads, drift)
