"""Skins of neighbour lists: how far grains may still move before a list must be rebuilt.

A list is valid as long as no grain is farther than a limit from its anchor, its position when the list was built.  The
remaining skin is a lower bound of the distance that any grain may still move before this limit can be exceeded; each
step reduces it by the displacement of the fastest grain.  Only when it is used up are the displacements of all grains
computed: if one exceeds the limit, the list is rebuilt; otherwise the remaining skin is set to the difference.  Lists
are therefore rebuilt in the same steps as if all displacements were computed in every step.

The inner list is rebuilt as soon as its skin is used up: checking displacements would avoid few rebuilds and would need
separate anchors.
"""

import math

from ..basics.state import INNER_SKIN, LONG_RANGE_SKIN, PAIR_LIST_SKIN, SAFE_SPEED, SQUARED_SPEED, SQUARED_SPIN
from ..compiler.jit import loop
from ..contact.pair_types import pair_type_count
from ..numerics.flow import carried, strain_since
from ..numerics.simd import float_bits, float_from_bits, magnitude_bits
from ..numerics.vec import dot, load, nearest_image, sub

UNKNOWN = -1.0
"""Marks a speed that must be recomputed, and a skin that is used up."""
SKIN_SAFETY = 0.999
"""Fraction of a limit that is used as skin; the rest exceeds accumulated rounding errors of positions by far."""


@loop
def invalidate_speeds(pair_list):
    """Mark the largest speeds as unknown, after velocities were changed without updating them."""
    pair_list.skin[SQUARED_SPEED] = pair_list.skin[SQUARED_SPIN] = UNKNOWN


@loop
def invalidate_skins(pair_list):
    """Mark all skins as used up, after grains were moved without reducing them."""
    pair_list.skin[LONG_RANGE_SKIN] = pair_list.skin[PAIR_LIST_SKIN] = pair_list.skin[INNER_SKIN] = UNKNOWN


@loop
def update_safe_speed(pair_list, count):
    """Set the smallest speed [m/s] of all candidate pairs that moves a pair by δ_c in a step that contacts allow."""
    safe_speed = math.inf
    for k in range(pair_type_count(pair_list, count)):
        safe_speed = min(
            safe_speed, pair_list.break_overlap[k] / pair_list.step[k] if pair_list.break_overlap[k] > 0.0 else math.inf
        )
    pair_list.skin[SAFE_SPEED] = safe_speed


@loop
def reset_skins(pair_list, count):
    """Invalidate all speeds and skins, at the start of a call of the driver: positions and lists may have changed."""
    invalidate_speeds(pair_list)
    invalidate_skins(pair_list)
    update_safe_speed(pair_list, count)


@loop
def largest_squared_speeds(grains):
    """Squares of the largest speed [m²/s²] and spin [1/s²]."""
    fastest = fastest_spin = float_bits(0.0)
    for i in range(grains.mass.size):
        v, w = load(grains.velocity, i), load(grains.spin, i)
        fastest, fastest_spin = max(fastest, magnitude_bits(dot(v, v))), max(fastest_spin, magnitude_bits(dot(w, w)))
    return float_from_bits(fastest), float_from_bits(fastest_spin)


@loop
def consume_skins(pair_list, displacement):
    """Reduce all skins by an upper bound of the displacement of any grain [m]."""
    pair_list.skin[LONG_RANGE_SKIN] -= displacement
    pair_list.skin[PAIR_LIST_SKIN] -= displacement
    pair_list.skin[INNER_SKIN] -= displacement


@loop
def update_speeds(grains, pair_list):
    """Recompute the largest speeds if they are unknown."""
    if pair_list.skin[SQUARED_SPEED] < 0.0:
        pair_list.skin[SQUARED_SPEED], pair_list.skin[SQUARED_SPIN] = largest_squared_speeds(grains)


@loop
def largest_displacement(grains, anchor, built, span):
    """Largest distance [m] of a grain from its anchor; NaN for an anchor at infinity.

    In a box that is deformed, the flow carries the anchors since the box was `built` (lengths, tilt).  The displacement
    counts, not the length of the path: a grain that oscillates in an aggregate does not invalidate a list.
    """
    largest = float_bits(0.0)
    for i in range(grains.mass.size):
        displacement = nearest_image(sub(load(grains.position, i), carried(load(anchor, i), built, span)), span)
        largest = max(largest, magnitude_bits(dot(displacement, displacement)))
    return math.sqrt(float_from_bits(largest))


@loop
def list_is_stale(grains, listed, span, limit, reach, skin, skin_index):
    """Whether a grain is farther than `limit` [m] from its anchor, so that the list must be rebuilt.

    The strain ε of a box that is deformed brings pairs at the reach [m] of the list closer by ε times the reach, as if
    each grain had moved by half of that.

    Parameters
    ----------
    listed : PairList or LongRangeArrays
        Its anchors (3, N), and the lengths and tilt `built` (4,) of the box [m], are those when the list was built.
    skin : ndarray
        Remaining skins; that of this list, with the index `skin_index`, is updated.
    """
    if skin[skin_index] > 0.0:
        return False
    displacement = largest_displacement(grains, listed.anchor, listed.built, span)
    limit -= 0.5 * reach * strain_since(listed.built, span)
    skin[skin_index] = SKIN_SAFETY * limit - displacement
    # true also for NaN, from anchors at infinity (no list yet)
    return not displacement <= limit
