"""The compiled driver: thousands of velocity Verlet steps per call from Python.

One step:  choose dt → kick dt/2, drift and turn dt → near pairs checked → contacts: pass, break or move, form
→ forces (contacts, dipoles, per grain) → kick dt/2.  The driver comes back for the end of the time asked for,
for longer arrays, or because no step can be taken.  It may come back in the middle of a step (STAGE) and goes
on from there, so that growing arrays changes no number.
"""

import functools
from collections.abc import Callable
from enum import IntEnum
from typing import Any, NamedTuple

from ..core.box import nearest_image
from ..core.jit import kernel, loop
from ..core.vec import dot, load, sub
from ..core.world import (
    CONTACTS,
    GRAIN1,
    GRAIN2,
    STAGE,
    STEP,
    STEPS,
    TIME,
)
from ..kernels.contacts import contact_pass, contact_step, gather, sort_sides
from ..kernels.dipoles import dipole_loads
from ..kernels.events import book_stiffness, damp_contacts, drop_broken, make_contacts, new_touches, settle_flagged
from ..kernels.motion import drift, kick
from ..kernels.neighbours import FULL, list_is_stale, make_list
from ..kernels.outside import outside_loads
from .control import CHECK_EVERY, choose_step


class Stop(IntEnum):
    """Why the driver came back."""

    STEPS_DONE = 0
    TIME_REACHED = 1
    CONTACTS_FULL = 2
    PAIRS_FULL = 3
    NOT_FINITE = 4
    NO_STEP = 5
    FLEW_TOO_FAR = 6
    CRUSHED = 7
    SPUN_TOO_FAR = 8


class ContactRules(NamedTuple):
    """The contact law's run-time numbers."""

    on: bool  # False: grains pass through each other
    pairings: Any  # (10, M, M) table: what two materials make together
    release: bool  # displacement beyond its limit: False clamp, True release
    follow: bool  # stiffnesses: False frozen at a₀, True following the contact radius
    damped: bool  # is there any damping
    per_period: float  # steps per fastest period


class Rules(NamedTuple):
    """All that does not change during a run."""

    span: Any
    contact: ContactRules
    dipoles: Any
    outside: Any
    control: Any


class DipoleRules(NamedTuple):
    """How magnetic loads are summed."""

    way: int
    k: float
    cutoff: Any


LONGEST_TURN = 0.5
"""Largest turn in one step [rad] for which `rotation.turn` is sound."""


@loop
def _moves_too_far(grains, reach, dt):
    """Stop and grain if one would fly more than half the smallest radius, or turn too far, in one step."""
    for i in range(grains.mass.size):
        v, w = load(grains.velocity, i), load(grains.spin, i)
        if dt * dt * dot(v, v) > 0.25 * reach * reach:
            return Stop.FLEW_TOO_FAR, i
        if dt * dt * dot(w, w) > LONGEST_TURN**2:
            return Stop.SPUN_TOO_FAR, i
    return Stop.STEPS_DONE, -1


@loop
def _crushed(grains, contacts, count, span):
    """The first contact in which a centre lies inside the other grain, or −1."""
    for c in range(count[CONTACTS]):
        i, j = contacts.pair[0, c], contacts.pair[1, c]
        apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
        limit = max(grains.radius[i], grains.radius[j])
        if dot(apart, apart) < limit * limit:
            return c
    return -1


@functools.cache
def driver_for(outside: Callable, keep: bool = True) -> Callable:
    """The compiled `advance` for one composed per-grain formula; `keep` it on disk if all of it is ours.

    A world starts at STAGE 1 with a step of 0 s: the second half of such a step finds the pairs and the
    contacts that are there and works out the first loads (what it counts and books is not part of a run).
    """
    add_outside = outside_loads(outside)

    @loop
    def sum_loads(grains, contacts, time, rules):
        gather(grains, contacts)
        dipole_loads(grains, rules.span, rules.dipoles)
        add_outside(grains, time, rules.outside)

    @loop
    def first_half(grains, contacts, near, clock, count, rules):
        """Choose the step, kick half of it, drift; anything but STEPS_DONE: no step was taken."""
        count[GRAIN1] = count[GRAIN2] = -1
        dt = choose_step(grains, contacts.start, near, clock, count, rules.span, rules.control)
        if not dt > 0.0:
            return Stop.NOT_FINITE
        if clock[TIME] + dt == clock[TIME]:
            return Stop.NO_STEP
        stop, stray = _moves_too_far(grains, rules.control.reach, dt)
        if stop != Stop.STEPS_DONE:
            count[GRAIN1] = stray
            return stop
        if count[STEPS] % CHECK_EVERY == 0:
            c = _crushed(grains, contacts, count, rules.span)
            if c >= 0:
                count[GRAIN1], count[GRAIN2] = contacts.pair[0, c], contacts.pair[1, c]
                return Stop.CRUSHED
        kick(grains, 0.5 * dt)
        drift(grains, rules.span, dt)
        clock[STEP] = dt
        count[STAGE] = 1
        return Stop.STEPS_DONE

    @loop
    def second_half(grains, contacts, near, clock, count, lost, rules):
        """Contacts, loads, the other half kick; may be entered again after arrays have grown."""
        span, law, dt = rules.span, rules.contact, clock[STEP]
        reach = rules.control.reach
        stale = list_is_stale(grains, near, span, reach)
        if stale and make_list(grains, contacts, near, count, span, reach, law) == FULL:
            return Stop.PAIRS_FULL
        fresh = new_touches(grains, near, count, span)
        if count[CONTACTS] + fresh > contacts.pair.shape[1]:
            return Stop.CONTACTS_FULL
        flagged = contact_pass(grains, contacts, count, span, law, dt)
        if law.follow:
            book_stiffness(grains, contacts, count, lost, span, dt)
        parted = flagged and settle_flagged(grains, contacts, near, count, lost, span, law, dt)
        if parted:
            drop_broken(contacts, count)
        if law.damped:
            damp_contacts(grains, contacts, count, lost, span, dt)
        if fresh > 0:
            make_contacts(grains, contacts, near, count, lost, clock, span, law, dt)
        if parted or fresh > 0:
            sort_sides(contacts, count, grains.mass.size)
        if parted or fresh > 0 or stale:
            contact_step(contacts, near, count, grains.mass.size, clock, law.per_period)
        sum_loads(grains, contacts, clock[TIME] + dt, rules)
        kick(grains, 0.5 * dt)
        clock[TIME] += dt
        count[STEPS] += 1
        count[STAGE] = 0
        return Stop.STEPS_DONE

    def advance(grains, contacts, near, clock, count, lost, rules, until, most_steps):
        """Take up to `most_steps` steps, or as many as bring the time to `until` [s]; returns a Stop."""
        for _ in range(most_steps):
            if count[STAGE] == 0:
                if clock[TIME] >= until:
                    return Stop.TIME_REACHED
                stop = first_half(grains, contacts, near, clock, count, rules)
                if stop != Stop.STEPS_DONE:
                    return stop
            stop = second_half(grains, contacts, near, clock, count, lost, rules)
            if stop != Stop.STEPS_DONE:
                return stop
        return Stop.TIME_REACHED if clock[TIME] >= until else Stop.STEPS_DONE

    return kernel(advance, keep=keep)
