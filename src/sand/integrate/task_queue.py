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

from ..compiler.atomics import fetch_add, give_way, read, write
from ..compiler.jit import CAN_SHARE, kernel, loop, rare, shared
from ..contact.gather import gather
from ..contact.slip import contact_pass, keep_passed
from ..forces.pair.loops import CREW_FROM
from ..grains import GrainArrays
from ..numerics.float_order import ranked
from ..state.state import CONTACTS
from .kernel_spec import Plan
from .motion import AT_ONCE, OPEN, drift_for, gather_and_kick

WORD, DONE, INSIDE = 0, 8, 16
"""Places on the board, a line of the cache apart: the work at hand, its finished blocks, helpers at work."""
PLACES = 24
PATIENCE = 4000
"""Looks at the board before a waiting thread lets others run on its core."""
CONTACTS_AT_ONCE = 512
GRAINS_AT_ONCE = 2 * int(AT_ONCE)
"""Contacts and grains in a block: 3 to 10 µs of work, whole vectors, and whole blocks of the gathering."""
HELP_FROM = 8 * CONTACTS_AT_ONCE
"""Contacts from which a helper saves more time than handing it work takes, where nothing else can be shared."""
_BITS = 20
_MASK = (1 << _BITS) - 1
"""A word is the task, the number of blocks, and how many were taken from the back and from the front, so long each."""
FRONT, BACK, BLOCKS, TASK = 0, _BITS, 2 * _BITS, 3 * _BITS
"""Where they begin."""


def is_large(grains: int) -> bool:
    """True if a simulation of so many grains is for a crew, be it of one thread."""
    return CAN_SHARE and grains >= CREW_FROM


def wants_help(plan: Plan, grains: GrainArrays, contacts: int) -> bool:
    """True if helpers save time: without sums to share, a thousand contacts are done before a helper has begun."""
    return plan.far.parts.blocks(grains) > 0 or contacts >= HELP_FROM


PASS, GATHER, GATHER_AND_KICK, FAR, DRIFT, LEAVE = range(1, 7)
"""What a word asks for: contacts, their loads at grains, these and a kick, long-range loads, a drift, the end."""


class Crew(NamedTuple):
    """What the threads share besides the world."""

    board: Any  # (24,) int64; made anew for every call of the driver
    step: Any  # (1,) float64: length of the step at hand, or of the kick [s]
    passed: Any  # (B, 8) float64: what the pass over each block of contacts found, by `Passed`
    speeds: Any  # (G, 2) float64: largest squares of speed [m²/s²] and spin [1/s²] in each block of grains


def new_crew(grains: int, contacts: int) -> Crew:
    """A board without work, for so many grains and up to so many contacts."""
    passed = np.zeros((contacts // CONTACTS_AT_ONCE + 1, 8))
    return Crew(np.zeros(PLACES, np.int64), np.zeros(1), passed, np.zeros((grains // GRAINS_AT_ONCE + 1, 2)))


def send_away(crew: Crew) -> None:
    """Let the helpers of a driver that did not come to its end leave, and wait until they have."""
    crew.board[WORD] = LEAVE << TASK
    while crew.board[INSIDE] > 0:
        give_way()


@loop
def blocks_of(number, at_once):
    """How many blocks of `at_once` there are in `number`."""
    return (number + at_once - 1) // at_once


@loop
def span_of_drift(rules):
    """The box in which grains drift: without walls where what the walls cost is booked afterwards."""
    return OPEN if rules.books.moored else rules.span


@loop
def part_of(word, place):
    """What a word says at this place."""
    return (word >> place) & _MASK


@loop
def is_left(word):
    """Is there a block that nobody has taken?"""
    return part_of(word, FRONT) + part_of(word, BACK) < part_of(word, BLOCKS)


@functools.cache
def crew_for(plan: Plan) -> tuple[Callable, Callable]:
    """The function that shares a task among all threads, and the kernel that a helper runs meanwhile."""
    far_block, drift_some = plan.far.parts.block, drift_for(plan.magnetic)

    @shared
    def do_block(task, b, grains, contacts, far, count, rules):
        if task == PASS:
            first = b * CONTACTS_AT_ONCE
            last = min(first + CONTACTS_AT_ONCE, count[CONTACTS])
            span, law, step = rules.span, rules.contact, rules.crew.step[0]
            found = contact_pass(grains, contacts, np.uint64(first), np.uint64(last), span, law, step)
            keep_passed(rules.crew.passed, b, found)
        elif task == GATHER:
            first = b * GRAINS_AT_ONCE
            last = min(first + GRAINS_AT_ONCE, grains.mass.size)
            gather(grains, contacts, np.uint64(first), np.uint64(last))
        elif task == GATHER_AND_KICK:
            first = b * GRAINS_AT_ONCE
            last = min(first + GRAINS_AT_ONCE, grains.mass.size)
            v, w = gather_and_kick(grains, contacts, np.uint64(first), np.uint64(last), rules.crew.step[0])
            rules.crew.speeds[b, 0], rules.crew.speeds[b, 1] = ranked(v), ranked(w)
        elif task == FAR:
            far_block(grains, far, rules.span, rules.far, b)
        elif task == DRIFT:
            first = b * GRAINS_AT_ONCE
            last = min(first + GRAINS_AT_ONCE, grains.mass.size)
            v = drift_some(grains, np.uint64(first), np.uint64(last), span_of_drift(rules), rules.crew.step[0])
            rules.crew.speeds[b, 0] = ranked(v)

    @shared
    def share(task, blocks, grains, contacts, far, count, rules):
        board = rules.crew.board
        write(board, DONE, 0)
        write(board, WORD, (task << TASK) | (blocks << BLOCKS))
        word = fetch_add(board, WORD, 1 << FRONT)
        while is_left(word):
            do_block(task, part_of(word, FRONT), grains, contacts, far, count, rules)
            fetch_add(board, DONE, 1)
            word = fetch_add(board, WORD, 1 << FRONT)
        looks = 0
        while read(board, DONE) < blocks:
            looks += 1
            if looks > PATIENCE:
                give_way()

    def help_along(grains, contacts, far, count, rules):
        """Take blocks until the board says LEAVE."""
        board = rules.crew.board
        fetch_add(board, INSIDE, 1)
        looks = 0
        word = read(board, WORD)
        while word >> TASK != LEAVE:
            looks += 1
            if is_left(word):
                # what is at hand may have changed since the look: what was taken is what this says
                word = fetch_add(board, WORD, 1 << BACK)
                if is_left(word):
                    b = part_of(word, BLOCKS) - 1 - part_of(word, BACK)
                    do_block(word >> TASK, b, grains, contacts, far, count, rules)
                    fetch_add(board, DONE, 1)
                looks = 0
            elif looks > PATIENCE:
                give_way()
            word = read(board, WORD)
        fetch_add(board, INSIDE, -1)

    return share, kernel(help_along, keep=plan.keep, alone=True, wide=plan.wide)


@loop
def nobody_to_dismiss(rules):
    """Where there is no crew."""


@rare
def dismiss(rules):
    """Send the helpers away, and wait until the last has left: then the arrays are the driver's alone."""
    board = rules.crew.board
    write(board, WORD, LEAVE << TASK)
    while read(board, INSIDE) > 0:
        give_way()
