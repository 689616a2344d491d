"""A task queue in memory: threads share the large loops of a step, with results independent of the number of threads.

A loop is divided into blocks, by the size of the problem alone, and the same compiled function processes each block.
The driver's own thread takes blocks from the front, workers take them from the back, until they meet: most blocks are
then processed by the same thread in every step and stay in its cache.  A worker that starts late or is descheduled
only processes fewer blocks.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..compiler.atomics import fetch_add, read, write, yield_cpu
from ..compiler.jit import HAS_NOINLINE, kernel, loop, noinline, rare
from ..contact.gather import gather
from ..contact.update import contact_pass_loop, store_slip_sums
from ..forces.pair.loops import PARALLEL_FROM
from ..grains import GrainArrays
from ..numerics.simd import float_from_bits
from ..state.state import CONTACTS
from .kernel_spec import KernelSpec
from .motion import BLOCK_OF_GRAINS, UNBOUNDED, drift_for, gather_and_kick

WORD, FINISHED, ACTIVE = 0, 8, 16
"""Indices into `TaskQueue.words`, one cache line apart: the current task, its finished blocks, the active workers."""
QUEUE_LENGTH = 24
SPINS_BEFORE_YIELD = 4000
"""Reads of the queue before a waiting thread yields its core."""
CONTACTS_PER_BLOCK = 512
GRAINS_PER_BLOCK = 2 * int(BLOCK_OF_GRAINS)
"""Contacts and grains per block: 3 to 10 µs of work, whole SIMD vectors, and whole blocks of `contact.gather`."""
WORKERS_FROM = 8 * CONTACTS_PER_BLOCK
"""Least number of contacts for which workers save time if there are no long-range sums to share."""
_BITS = 20
_MASK = (1 << _BITS) - 1
FRONT, BACK, BLOCKS, TASK = 0, _BITS, 2 * _BITS, 3 * _BITS
"""Bit offsets in a task word: blocks taken from the front, blocks taken from the back, number of blocks, task."""
CONTACT_PASS, GATHER, GATHER_AND_KICK, LONG_RANGE, DRIFT, QUIT = range(1, 7)
"""Tasks: contact update, sums of contact loads per grain, these with a kick, long-range loads, drift, end of work."""


def uses_task_queue(grains: int) -> bool:
    """Whether a simulation of so many grains divides its loops into blocks, for any number of threads."""
    return HAS_NOINLINE and grains >= PARALLEL_FROM


def benefits_from_workers(spec: KernelSpec, grains: GrainArrays, contacts: int) -> bool:
    """Whether workers save time: without long-range sums, few contacts are finished before a worker has started."""
    return spec.long_range.blocked.blocks(grains) > 0 or contacts >= WORKERS_FROM


class TaskQueue(NamedTuple):
    """Data shared by the threads of one call of the driver, besides the state."""

    words: Any  # (24,) int64: task word and counters
    step: Any  # (1,) float64: length of the present step or kick [s]
    passed: Any  # (B, 8) float64: slip sums of each block of contacts, contact.update
    speeds: Any  # (G, 2) float64: largest squares of speed [m²/s²] and spin [1/s²] in each block of grains


def new_task_queue(grains: int, contacts: int) -> TaskQueue:
    """An empty queue for a number of grains and a capacity of contacts."""
    passed = np.zeros((contacts // CONTACTS_PER_BLOCK + 1, 8))
    speeds = np.zeros((grains // GRAINS_PER_BLOCK + 1, 2))
    return TaskQueue(np.zeros(QUEUE_LENGTH, np.int64), np.zeros(1), passed, speeds)


def release_workers(queue: TaskQueue) -> None:
    """End the workers of a driver that raised an exception, and wait until they have returned."""
    queue.words[WORD] = QUIT << TASK
    while queue.words[ACTIVE] > 0:
        yield_cpu()


@loop
def blocks_of(number, block):
    """Number of blocks of `block` elements that cover `number` elements."""
    return (number + block - 1) // block


@loop
def drift_span(parameters):
    """The box used by drifts: unbounded if the work of crossing a periodic boundary is logged afterwards."""
    return UNBOUNDED if parameters.external_work.position_dependent else parameters.span


@loop
def field_of(word, offset):
    """The field of a task word at a bit offset."""
    return (word >> offset) & _MASK


@loop
def has_block_left(word):
    """Whether the task has a block that no thread has taken."""
    return field_of(word, FRONT) + field_of(word, BACK) < field_of(word, BLOCKS)


@functools.cache
def worker_loops(spec: KernelSpec) -> tuple[Callable, Callable]:
    """The function by which the driver shares a task among all threads, and the kernel that each worker runs."""
    long_range_block, drift_some = spec.long_range.blocked.block, drift_for(spec.magnetic)
    contact_pass = contact_pass_loop(spec.law)

    @noinline
    def do_block(task, b, grains, contacts, long_range, count, parameters):
        if task == CONTACT_PASS:
            first = b * CONTACTS_PER_BLOCK
            last = min(first + CONTACTS_PER_BLOCK, count[CONTACTS])
            span, settings, step = parameters.span, parameters.contact, parameters.queue.step[0]
            found = contact_pass(grains, contacts, np.uint64(first), np.uint64(last), span, settings, step)
            store_slip_sums(parameters.queue.passed, b, found)
        elif task == GATHER:
            first = b * GRAINS_PER_BLOCK
            last = min(first + GRAINS_PER_BLOCK, grains.mass.size)
            gather(grains, contacts, np.uint64(first), np.uint64(last))
        elif task == GATHER_AND_KICK:
            first = b * GRAINS_PER_BLOCK
            last = min(first + GRAINS_PER_BLOCK, grains.mass.size)
            v, w = gather_and_kick(grains, contacts, np.uint64(first), np.uint64(last), parameters.queue.step[0])
            parameters.queue.speeds[b, 0], parameters.queue.speeds[b, 1] = float_from_bits(v), float_from_bits(w)
        elif task == LONG_RANGE:
            long_range_block(grains, long_range, parameters.span, parameters.long_range, b)
        elif task == DRIFT:
            first = b * GRAINS_PER_BLOCK
            last = min(first + GRAINS_PER_BLOCK, grains.mass.size)
            span, step = drift_span(parameters), parameters.queue.step[0]
            v = drift_some(grains, np.uint64(first), np.uint64(last), span, step)
            parameters.queue.speeds[b, 0] = float_from_bits(v)

    @noinline
    def share(task, blocks, grains, contacts, long_range, count, parameters):
        words = parameters.queue.words
        write(words, FINISHED, 0)
        write(words, WORD, (task << TASK) | (blocks << BLOCKS))
        word = fetch_add(words, WORD, 1 << FRONT)
        while has_block_left(word):
            do_block(task, field_of(word, FRONT), grains, contacts, long_range, count, parameters)
            fetch_add(words, FINISHED, 1)
            word = fetch_add(words, WORD, 1 << FRONT)
        spins = 0
        while read(words, FINISHED) < blocks:
            spins += 1
            if spins > SPINS_BEFORE_YIELD:
                yield_cpu()

    def worker_loop(grains, contacts, long_range, count, parameters):
        """Take blocks from the back of the queue until the task is QUIT."""
        words = parameters.queue.words
        fetch_add(words, ACTIVE, 1)
        spins = 0
        word = read(words, WORD)
        while word >> TASK != QUIT:
            spins += 1
            if has_block_left(word):
                # the task may have changed since the read: the word returned here identifies the block taken
                word = fetch_add(words, WORD, 1 << BACK)
                if has_block_left(word):
                    b = field_of(word, BLOCKS) - 1 - field_of(word, BACK)
                    do_block(word >> TASK, b, grains, contacts, long_range, count, parameters)
                    fetch_add(words, FINISHED, 1)
                spins = 0
            elif spins > SPINS_BEFORE_YIELD:
                yield_cpu()
            word = read(words, WORD)
        fetch_add(words, ACTIVE, -1)

    return share, kernel(
        worker_loop, cached=spec.keep, nogil=True, long_vectors=spec.wide, purpose="the time steps of worker threads"
    )


@loop
def no_workers(parameters):
    """Without a task queue."""


@rare
def join_workers(parameters):
    """End the workers and wait until the last has returned, so that no other thread accesses the arrays."""
    words = parameters.queue.words
    write(words, WORD, QUIT << TASK)
    while read(words, ACTIVE) > 0:
        yield_cpu()
