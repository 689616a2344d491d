"""A crew: threads that take parts of a step's large loops; who takes which changes no bit of the result.

A loop is cut into blocks, by the size of the problem alone, and each block is done by the same compiled function.  The
driver's own thread takes them from the front, helpers from the back, until they meet: so most blocks are done by the
same thread in each step, which has them in its cache.  A helper that comes late, or that the system puts aside, only
does less.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..compiler.atomics import fetch_add, read, write, yield_cpu
from ..compiler.jit import CAN_SHARE, kernel, loop, rare, shared
from ..contact.gather import gather
from ..contact.slip import contact_pass, store_slip_sums
from ..forces.pair.loops import PARALLEL_FROM
from ..grains import GrainArrays
from ..numerics.float_order import float_from_bits
from ..state.state import CONTACTS
from .kernel_spec import KernelSpec
from .motion import BLOCK_OF_GRAINS, OPEN, drift_for, gather_and_kick

WORD, DONE, ACTIVE = 0, 8, 16
"""Places on the board, a line of the cache apart: the work at hand, its finished blocks, helpers at work."""
PLACES = 24
SPINS_BEFORE_YIELD = 4000
"""Looks at the board before a waiting thread lets others run on its core."""
CONTACTS_PER_BLOCK = 512
GRAINS_PER_BLOCK = 2 * int(BLOCK_OF_GRAINS)
"""Contacts and grains in a block: 3 to 10 µs of work, whole vectors, and whole blocks of the gathering."""
WORKERS_FROM = 8 * CONTACTS_PER_BLOCK
"""Contacts from which a helper saves more time than handing it work takes, where nothing else can be shared."""
_BITS = 20
_MASK = (1 << _BITS) - 1
"""A word is the task, the number of blocks, and how many were taken from the back and from the front, so long each."""
FRONT, BACK, BLOCKS, TASK = 0, _BITS, 2 * _BITS, 3 * _BITS
"""Where they begin."""


def uses_task_queue(grains: int) -> bool:
    """True if a simulation of so many grains is for a crew, be it of one thread."""
    return CAN_SHARE and grains >= PARALLEL_FROM


def benefits_from_workers(plan: KernelSpec, grains: GrainArrays, contacts: int) -> bool:
    """True if helpers save time: without sums to share, a thousand contacts are done before a helper has begun."""
    return plan.long_range.blocked.blocks(grains) > 0 or contacts >= WORKERS_FROM


PASS, GATHER, GATHER_AND_KICK, FAR, DRIFT, QUIT = range(1, 7)
"""What a word asks for: contacts, their loads at grains, these and a kick, long-range loads, a drift, the end."""


class TaskQueue(NamedTuple):
    """What the threads share besides the world."""

    words: Any  # (24,) int64; made anew for every call of the driver
    step: Any  # (1,) float64: length of the step at hand, or of the kick [s]
    passed: Any  # (B, 8) float64: what the pass over each block of contacts found, by `Passed`
    speeds: Any  # (G, 2) float64: largest squares of speed [m²/s²] and spin [1/s²] in each block of grains


def new_task_queue(grains: int, contacts: int) -> TaskQueue:
    """A board without work, for so many grains and up to so many contacts."""
    passed = np.zeros((contacts // CONTACTS_PER_BLOCK + 1, 8))
    return TaskQueue(np.zeros(PLACES, np.int64), np.zeros(1), passed, np.zeros((grains // GRAINS_PER_BLOCK + 1, 2)))


def release_workers(queue: TaskQueue) -> None:
    """Let the helpers of a driver that did not come to its end leave, and wait until they have."""
    queue.words[WORD] = QUIT << TASK
    while queue.words[ACTIVE] > 0:
        yield_cpu()


@loop
def blocks_of(number, at_once):
    """How many blocks of `at_once` there are in `number`."""
    return (number + at_once - 1) // at_once


@loop
def span_of_drift(rules):
    """The box in which grains drift: without walls where what the walls cost is booked afterwards."""
    return OPEN if rules.external_work.position_dependent else rules.span


@loop
def part_of(word, place):
    """What a word says at this place."""
    return (word >> place) & _MASK


@loop
def is_left(word):
    """Is there a block that nobody has taken?"""
    return part_of(word, FRONT) + part_of(word, BACK) < part_of(word, BLOCKS)


@functools.cache
def worker_loops(plan: KernelSpec) -> tuple[Callable, Callable]:
    """The function that shares a task among all threads, and the kernel that a helper runs meanwhile."""
    far_block, drift_some = plan.long_range.blocked.block, drift_for(plan.magnetic)

    @shared
    def do_block(task, b, grains, contacts, long_range, count, rules):
        if task == PASS:
            first = b * CONTACTS_PER_BLOCK
            last = min(first + CONTACTS_PER_BLOCK, count[CONTACTS])
            span, law, step = rules.span, rules.contact, rules.queue.step[0]
            found = contact_pass(grains, contacts, np.uint64(first), np.uint64(last), span, law, step)
            store_slip_sums(rules.queue.passed, b, found)
        elif task == GATHER:
            first = b * GRAINS_PER_BLOCK
            last = min(first + GRAINS_PER_BLOCK, grains.mass.size)
            gather(grains, contacts, np.uint64(first), np.uint64(last))
        elif task == GATHER_AND_KICK:
            first = b * GRAINS_PER_BLOCK
            last = min(first + GRAINS_PER_BLOCK, grains.mass.size)
            v, w = gather_and_kick(grains, contacts, np.uint64(first), np.uint64(last), rules.queue.step[0])
            rules.queue.speeds[b, 0], rules.queue.speeds[b, 1] = float_from_bits(v), float_from_bits(w)
        elif task == FAR:
            far_block(grains, long_range, rules.span, rules.long_range, b)
        elif task == DRIFT:
            first = b * GRAINS_PER_BLOCK
            last = min(first + GRAINS_PER_BLOCK, grains.mass.size)
            v = drift_some(grains, np.uint64(first), np.uint64(last), span_of_drift(rules), rules.queue.step[0])
            rules.queue.speeds[b, 0] = float_from_bits(v)

    @shared
    def share(task, blocks, grains, contacts, long_range, count, rules):
        words = rules.queue.words
        write(words, DONE, 0)
        write(words, WORD, (task << TASK) | (blocks << BLOCKS))
        word = fetch_add(words, WORD, 1 << FRONT)
        while is_left(word):
            do_block(task, part_of(word, FRONT), grains, contacts, long_range, count, rules)
            fetch_add(words, DONE, 1)
            word = fetch_add(words, WORD, 1 << FRONT)
        looks = 0
        while read(words, DONE) < blocks:
            looks += 1
            if looks > SPINS_BEFORE_YIELD:
                yield_cpu()

    def worker_loop(grains, contacts, long_range, count, rules):
        """Take blocks until the board says QUIT."""
        words = rules.queue.words
        fetch_add(words, ACTIVE, 1)
        looks = 0
        word = read(words, WORD)
        while word >> TASK != QUIT:
            looks += 1
            if is_left(word):
                # what is at hand may have changed since the look: what was taken is what this says
                word = fetch_add(words, WORD, 1 << BACK)
                if is_left(word):
                    b = part_of(word, BLOCKS) - 1 - part_of(word, BACK)
                    do_block(word >> TASK, b, grains, contacts, long_range, count, rules)
                    fetch_add(words, DONE, 1)
                looks = 0
            elif looks > SPINS_BEFORE_YIELD:
                yield_cpu()
            word = read(words, WORD)
        fetch_add(words, ACTIVE, -1)

    return share, kernel(worker_loop, keep=plan.keep, alone=True, wide=plan.wide)


@loop
def no_workers(rules):
    """Where there is no crew."""


@rare
def join_workers(rules):
    """Send the helpers away, and wait until the last has left: then the arrays are the driver's alone."""
    words = rules.queue.words
    write(words, WORD, QUIT << TASK)
    while read(words, ACTIVE) > 0:
        yield_cpu()
