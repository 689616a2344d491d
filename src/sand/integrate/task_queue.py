"""A task queue in memory: threads share the blocks of large loops, with results independent of the number of threads.

A loop is divided into blocks, by the size of the problem alone, and the same stage processes each block, whoever calls
it.  The driver's own thread takes blocks from the front, workers take them from the back, until they meet: most blocks
are then processed by the same thread in every step and stay in its cache.  A worker that starts late or is descheduled
only processes fewer blocks.
"""

from typing import Any, NamedTuple

import numpy as np

from ..compiler.atomics import fetch_add, read, write, yield_cpu
from ..compiler.jit import caller, loop, rare
from ..compiler.program import call_stage, stage_fails
from ..compiler.stage import stage
from ..forces.pair.long_range_loops import PARALLEL_FROM
from .motion import BLOCK_OF_GRAINS

WORD, SHARED, FAILED_BLOCK, FINISHED, ACTIVE = 0, 1, 2, 8, 16
"""Indices into `TaskQueue.words`: the current task; 1 if blocks are shared among threads; 1 plus the number of a block
that failed in a worker, or 0; the number of finished blocks; the number of active workers.  The last two have cache
lines of their own."""
QUEUE_LENGTH = 24
SPINS_BEFORE_YIELD = 4000
"""Reads of the queue before a waiting thread yields its core."""
CONTACTS_PER_BLOCK = 512
GRAINS_PER_BLOCK = 2 * int(BLOCK_OF_GRAINS)
"""Contacts and grains per block: 3 to 10 µs of work, whole SIMD vectors, and whole blocks of `contact.gather`."""
WORKERS_FROM = 8 * CONTACTS_PER_BLOCK
"""Least number of contacts for which workers save time if there are no long-range sums to share."""
_BITS = 18
_MASK = (1 << _BITS) - 1
FRONT, BACK, BLOCKS, TASK = 0, _BITS, 2 * _BITS, 3 * _BITS
"""Bit offsets in a task word: blocks taken from the front, blocks taken from the back, number of blocks, stage."""
QUIT = (1 << (63 - TASK)) - 1
"""In place of the number of a stage: the work ends."""


def uses_task_queue(grains: int) -> bool:
    """Whether a simulation of so many grains divides its loops among threads."""
    return grains >= PARALLEL_FROM


def benefits_from_workers(pair_forces: int, contacts: int) -> bool:
    """Whether workers save time: without long-range sums, few contacts are finished before a worker has started."""
    return pair_forces > 0 or contacts >= WORKERS_FROM


class TaskQueue(NamedTuple):
    """Data of the blocks of one call of the driver, besides the state."""

    words: Any  # (24,) int64: task word and counters
    passed: Any  # (B, 16) float64: sums of each block of contacts, contact.update
    speeds: Any  # (G, 2) float64: largest squares of speed [m²/s²] and spin [1/s²] in each block of grains


def new_task_queue(grains: int, contacts: int) -> TaskQueue:
    """An empty queue for a number of grains and a capacity of contacts."""
    passed = np.zeros((contacts // CONTACTS_PER_BLOCK + 1, 16))
    speeds = np.zeros((grains // GRAINS_PER_BLOCK + 1, 2))
    words = np.zeros(QUEUE_LENGTH, np.int64)
    words[SHARED] = uses_task_queue(grains)
    return TaskQueue(words, passed, speeds)


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
def field_of(word, offset):
    """The field of a task word at a bit offset."""
    return (word >> offset) & _MASK


@loop
def has_block_left(word):
    """Whether the task has a block that no thread has taken."""
    return field_of(word, FRONT) + field_of(word, BACK) < field_of(word, BLOCKS)


@rare
def share_blocks(s, number, blocks):
    """Process all blocks of a stage together with the workers."""
    words = s.queue.words
    write(words, FINISHED, 0)
    write(words, FAILED_BLOCK, 0)
    write(words, WORD, (number << TASK) | (blocks << BLOCKS))
    word = fetch_add(words, WORD, 1 << FRONT)
    while has_block_left(word):
        call_stage(s, number, field_of(word, FRONT))
        fetch_add(words, FINISHED, 1)
        word = fetch_add(words, WORD, 1 << FRONT)
    spins = 0
    while read(words, FINISHED) < blocks:
        spins += 1
        if spins > SPINS_BEFORE_YIELD:
            yield_cpu()
    if read(words, FAILED_BLOCK) > 0:  # a worker cannot raise an exception: the block is processed again, here
        call_stage(s, number, read(words, FAILED_BLOCK) - 1)


@caller
def for_each_block(s, number, blocks):
    """Process the blocks 0 … blocks − 1 of a stage, together with the workers where there are any."""
    if s.queue.words[SHARED] == 1:
        share_blocks(s, number, blocks)
    else:
        for b in range(blocks):
            call_stage(s, number, b)


@stage("the work of other threads", parts=("program", "queue"))
def take_blocks(s):
    """Work of a worker thread: take blocks from the back of the queue until the task is QUIT."""
    words = s.queue.words
    fetch_add(words, ACTIVE, 1)
    spins = 0
    word = read(words, WORD)
    while word >> TASK != QUIT:
        spins += 1
        if has_block_left(word):
            # the task may have changed since the read: the word returned here identifies the block taken
            word = fetch_add(words, WORD, 1 << BACK)
            if has_block_left(word):
                block = field_of(word, BLOCKS) - 1 - field_of(word, BACK)
                if stage_fails(s, word >> TASK, block):
                    write(words, FAILED_BLOCK, block + 1)
                fetch_add(words, FINISHED, 1)
            spins = 0
        elif spins > SPINS_BEFORE_YIELD:
            yield_cpu()
        word = read(words, WORD)
    fetch_add(words, ACTIVE, -1)
    return 0


@rare
def join_workers(s):
    """End the workers and wait until the last has returned, so that no other thread accesses the arrays."""
    words = s.queue.words
    write(words, WORD, QUIT << TASK)
    while read(words, ACTIVE) > 0:
        yield_cpu()
