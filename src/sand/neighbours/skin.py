"""How fast grains are, and how far they can have flown: what spares looking at each of them in every step.

A list is sound as long as no grain is farther than some limit from where it was when the list was made.  Its leeway is
how far grains may still fly before one of them can be: the fastest grain spends it, and all are looked at only when
it is spent.  So lists are made anew in the very steps in which they would be if all were looked at in each.  What
may touch soon is picked anew without a look, which would save few picks and need positions of its own.
"""

import math

from ..box import nearest_image
from ..compiler.jit import loop
from ..contact.pair_types import kinds
from ..numerics.float_order import rank, rank_for_most, ranked
from ..numerics.vec import dot, load, sub
from ..state.state import FAR_LEEWAY, FASTEST, HARMLESS, NEAR_LEEWAY, QUICKEST, SOON_LEEWAY

UNKNOWN = -1.0
"""What stands for a speed that must be looked up, or a leeway that is spent."""
SPARED = 0.999
"""Part of a limit that is leeway: positions are rounded in every step, and what is left is far more than that."""


@loop
def forget_speeds(near):
    """Grains were kicked by something that keeps no watch."""
    near.watch[FASTEST] = near.watch[QUICKEST] = UNKNOWN


@loop
def forget_ways(near):
    """Grains were moved by something that keeps no watch."""
    near.watch[FAR_LEEWAY] = near.watch[NEAR_LEEWAY] = near.watch[SOON_LEEWAY] = UNKNOWN


@loop
def look_up_harmless(near, count):
    """The speed [m/s] that is δ_c in the step of a contact, for the pair of the list for which it is least."""
    harmless = math.inf
    for k in range(kinds(near, count)):
        harmless = min(harmless, near.length[k] / near.step[k] if near.length[k] > 0.0 else math.inf)
    near.watch[HARMLESS] = harmless


@loop
def begin_watch(near, count):
    """At the start of a call of the driver: grains may be elsewhere, and lists have been read from a file."""
    forget_speeds(near)
    forget_ways(near)
    look_up_harmless(near, count)


@loop
def largest_speeds(grains):
    """Squares of the largest speed [m²/s²] and spin [1/s²]."""
    fastest = quickest = rank(0.0)
    for i in range(grains.mass.size):
        v, w = load(grains.velocity, i), load(grains.spin, i)
        fastest, quickest = max(fastest, rank_for_most(dot(v, v))), max(quickest, rank_for_most(dot(w, w)))
    return ranked(fastest), ranked(quickest)


@loop
def spend(near, way):
    """No grain flew farther than this [m]."""
    near.watch[FAR_LEEWAY] -= way
    near.watch[NEAR_LEEWAY] -= way
    near.watch[SOON_LEEWAY] -= way


@loop
def look_up_speeds(grains, near):
    """See to it that the largest speeds are known."""
    if near.watch[FASTEST] < 0.0:
        near.watch[FASTEST], near.watch[QUICKEST] = largest_speeds(grains)


@loop
def farthest(grains, anchor, span):
    """Largest displacement [m] of a grain from its anchor; not a number for an anchor at infinity.

    What counts is the displacement, not the way: a grain that rings in its cluster moves as the cluster does, to
    within its amplitude, and does not make a list stale.
    """
    most = rank(0.0)
    for i in range(grains.mass.size):
        moved = nearest_image(sub(load(grains.position, i), load(anchor, i)), span)
        most = max(most, rank_for_most(dot(moved, moved)))
    return math.sqrt(ranked(most))


@loop
def is_stale(grains, anchor, span, limit, watch, leeway):
    """True once a grain is farther than `limit` [m] from its anchor; `leeway` is the place of this list's."""
    if watch[leeway] > 0.0:
        return False
    strayed = farthest(grains, anchor, span)
    watch[leeway] = SPARED * limit - strayed
    # written so that an anchor at infinity (no list yet) counts as strayed
    return not strayed <= limit
