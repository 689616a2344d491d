"""How fast grains are, and how far they can have flown: what spares looking at each of them in every step.

A list is sound as long as no grain is farther than some limit from where it was when the list was made.  Its leeway is
how far grains may still fly before one of them can be: the fastest grain spends it, and all are looked at only when
it is spent.  So lists are made anew in the very steps in which they would be if all were looked at in each.  What
may touch soon is picked anew without a look, which would save few picks and need positions of its own.
"""

import math

from ..box import nearest_image
from ..compiler.jit import loop
from ..contact.pair_types import pair_type_count
from ..numerics.simd import float_bits, float_from_bits, magnitude_bits
from ..numerics.vec import dot, load, sub
from ..state.state import INNER_SKIN, LARGEST_SPEED, LARGEST_SPIN, LONG_RANGE_SKIN, PAIR_LIST_SKIN, SAFE_SPEED

UNKNOWN = -1.0
"""What stands for a speed that must be looked up, or a leeway that is spent."""
SKIN_SAFETY = 0.999
"""Part of a limit that is leeway: positions are rounded in every step, and what is left is far more than that."""


@loop
def invalidate_speeds(pair_list):
    """Grains were kicked by something that keeps no watch."""
    pair_list.skin[LARGEST_SPEED] = pair_list.skin[LARGEST_SPIN] = UNKNOWN


@loop
def invalidate_skins(pair_list):
    """Grains were moved by something that keeps no watch."""
    pair_list.skin[LONG_RANGE_SKIN] = pair_list.skin[PAIR_LIST_SKIN] = pair_list.skin[INNER_SKIN] = UNKNOWN


@loop
def update_safe_speed(pair_list, count):
    """The speed [m/s] that is δ_c in the step of a contact, for the pair of the list for which it is least."""
    harmless = math.inf
    for k in range(pair_type_count(pair_list, count)):
        harmless = min(harmless, pair_list.length[k] / pair_list.step[k] if pair_list.length[k] > 0.0 else math.inf)
    pair_list.skin[SAFE_SPEED] = harmless


@loop
def reset_skins(pair_list, count):
    """At the start of a call of the driver: grains may be elsewhere, and lists have been read from a file."""
    invalidate_speeds(pair_list)
    invalidate_skins(pair_list)
    update_safe_speed(pair_list, count)


@loop
def largest_speeds(grains):
    """Squares of the largest speed [m²/s²] and spin [1/s²]."""
    fastest = fastest_spin = float_bits(0.0)
    for i in range(grains.mass.size):
        v, w = load(grains.velocity, i), load(grains.spin, i)
        fastest, fastest_spin = max(fastest, magnitude_bits(dot(v, v))), max(fastest_spin, magnitude_bits(dot(w, w)))
    return float_from_bits(fastest), float_from_bits(fastest_spin)


@loop
def consume_skins(pair_list, way):
    """No grain flew farther than this [m]."""
    pair_list.skin[LONG_RANGE_SKIN] -= way
    pair_list.skin[PAIR_LIST_SKIN] -= way
    pair_list.skin[INNER_SKIN] -= way


@loop
def update_speeds(grains, pair_list):
    """See to it that the largest speeds are known."""
    if pair_list.skin[LARGEST_SPEED] < 0.0:
        pair_list.skin[LARGEST_SPEED], pair_list.skin[LARGEST_SPIN] = largest_speeds(grains)


@loop
def largest_displacement(grains, anchor, span):
    """Largest displacement [m] of a grain from its anchor; not a number for an anchor at infinity.

    What counts is the displacement, not the way: a grain that rings in its cluster moves as the cluster does, to
    within its amplitude, and does not make a list stale.
    """
    most = float_bits(0.0)
    for i in range(grains.mass.size):
        moved = nearest_image(sub(load(grains.position, i), load(anchor, i)), span)
        most = max(most, magnitude_bits(dot(moved, moved)))
    return math.sqrt(float_from_bits(most))


@loop
def list_is_stale(grains, anchor, span, limit, skin, skin_index):
    """True once a grain is farther than `limit` [m] from its anchor; `leeway` is the place of this list's."""
    if skin[skin_index] > 0.0:
        return False
    strayed = largest_displacement(grains, anchor, span)
    skin[skin_index] = SKIN_SAFETY * limit - strayed
    # written so that an anchor at infinity (no list yet) counts as strayed
    return not strayed <= limit
