"""Arrays of contacts, candidate pairs, long-range forces, clusters and bodies, and their allocation."""

from __future__ import annotations

from collections.abc import Collection
from typing import Annotated, NamedTuple

import numpy as np

from .alignment import padded_size
from .array_groups import FEWEST_COLUMNS, GRAINS, INNER, SIDES, USED, Array, new_group, saved_in

ALWAYS_RECORDED = 4
"""Loss channels recorded per contact with every contact law; the others only with damping or variable stiffnesses."""


DAMPING_ROWS = 12
"""Rows of `ContactArrays.damping`: relative velocity and spin of the last step, force and torque of the dashpots."""


# sizes besides those of `array_groups`: "grains + 1" starts of rows, "sorted" grains by sorted index, "padded" those in
# whole SIMD vectors
class ContactArrays(NamedTuple):
    """Contacts, one column each; the first count[CONTACTS] columns are in use.

    They are in order of formation or, with spatial sorting, in the order of their grains.  `side` and `start` list the
    contacts per grain in compressed sparse row form: the entries of grain g are side[start[g] : start[g + 1]].
    """

    # grains 1 and 2
    pair: Annotated[np.ndarray, Array((2, USED), dtype="u4", rule="two grains", names=(GRAINS, GRAINS))]
    pointer1: Annotated[np.ndarray, Array((3, USED))]  # contact pointer of grain 1: unit vector, body frame
    pointer2: Annotated[np.ndarray, Array((3, USED))]  # contact pointer of grain 2
    twist: Annotated[np.ndarray, Array((USED,), "rad")]  # φ
    formed: Annotated[np.ndarray, Array((USED,), "s")]  # time of formation; the start time for initial contacts
    # constants of the law; CONTACTS_AT_ONCE identical columns if uniform, one of them in a checkpoint
    constants: Annotated[np.ndarray, Array(("constants", USED), fewer=1)]
    # energy dissipated so far, the first 4 or all 6 losses of state.RECORDED
    lost: Annotated[np.ndarray, Array(("channels", USED), "J", summed=True)]
    # motion and loads of the dashpots, rows of contact.damping; no columns without damping
    damping: Annotated[np.ndarray, Array((DAMPING_ROWS, USED), fewer=0)]
    # ζ and R (n1 + n2) [m] at the start of a step, and which step, see contact.slip_rules
    kept: Annotated[np.ndarray, Array((7, USED), required=False)]
    # force on grain 1, and torques; with r-RESPA impulses they also have the pair forces of the two grains
    force: Annotated[np.ndarray, Array((3, USED), "N")]
    torque1: Annotated[np.ndarray, Array((3, USED), "N m")]
    torque2: Annotated[np.ndarray, Array((3, USED), "N m")]
    # 0 within all limits, else one of the flags of contact.transitions
    flag: Annotated[np.ndarray, Array((USED,), dtype="u1", rule="any")]
    # 1 where the long-range force of the pair acts in every step
    every_step: Annotated[np.ndarray, Array((USED,), dtype="u1", rule="boolean")]
    side: Annotated[np.ndarray, Array((SIDES,), dtype="u4", rule="order")]  # 2 × contact, plus 1 for grain 2; by grain
    start: Annotated[np.ndarray, Array(("grains + 1",), dtype="u4", rule="starts")]  # first entry of each grain in side
    # grains in the order of contact.gather, then GATHER_CLASSES counters; no columns for the order of their indices
    gather_order: Annotated[np.ndarray, Array(("gather",), dtype="u4", saved=False)]


class PairList(NamedTuple):
    """Candidate pairs for contacts: pairs that may touch soon; the first count[PAIRS] columns are in use."""

    pair: Annotated[np.ndarray, Array((2, USED), dtype="u4", rule="two grains", names=(GRAINS, GRAINS))]
    in_contact: Annotated[np.ndarray, Array((USED,), dtype="u1", rule="boolean")]  # 1 for pairs in contact
    # time step that the contact needs; one column if uniform, as of the next
    step: Annotated[np.ndarray, Array((USED,), "s", rule="no nan", fewer=1)]
    # −δ at which the contact breaks: δ_c, 0 without adhesion
    break_overlap: Annotated[np.ndarray, Array((USED,), "m", fewer=1)]
    # positions when the list was built; a buffer while it is built from cells
    anchor: Annotated[np.ndarray, Array((3, GRAINS), "m", rule="no nan", initial=np.inf)]
    # lengths of the box when the list was built, 0 on open axes, and its tilt
    built: Annotated[np.ndarray, Array((4,), "m", required=False, earlier=3)]
    # inner list, the pairs that may touch next, skin[INNER_COUNT] of them; unused if there are too many
    inner: Annotated[np.ndarray, Array((INNER,), dtype="u4", saved=False)]
    # remaining skins, largest speeds: indices in basics.state, explained in neighbours.skin
    skin: Annotated[np.ndarray, Array((7,), initial=-1.0, saved=False)]


class LongRangeArrays(NamedTuple):
    """Verlet list for long-range forces, and the loads of their last summation; no columns where an array is not used.

    The list is a full neighbour list in compressed sparse row form, sorted by cell (see neighbours.cell_list): grain
    order[s] has the sorted index s.
    """

    # positions when the list was built
    anchor: Annotated[np.ndarray, Array((3, GRAINS), "m", rule="no nan", initial=np.inf, fewer=0)]
    # lengths of the box when the list was built, 0 on open axes, and its tilt
    built: Annotated[np.ndarray, Array((4,), "m", required=False, earlier=3)]
    order: Annotated[np.ndarray, Array(("sorted",), dtype="u4", names=(GRAINS,), saved=False)]  # grain
    start: Annotated[np.ndarray, Array(("grains + 1",), dtype="u4", saved=False)]  # first entry of rows in neighbour
    neighbour: Annotated[np.ndarray, Array(("neighbours",), dtype="u4", saved=False)]  # sorted indices
    cell_of: Annotated[np.ndarray, Array(("sorted",), dtype="u4", saved=False)]  # cell of each grain
    cell_start: Annotated[np.ndarray, Array(("cells",), dtype="u4", saved=False)]  # first sorted index of each cell
    # positions and moments by sorted index; by grain in sums over all pairs
    packed_position: Annotated[np.ndarray, Array((3, "padded"), "m", saved=False)]
    packed_moment: Annotated[np.ndarray, Array((3, "padded"), "A m^2", saved=False)]
    # whether each candidate of one grain is within reach, while a list is built
    near: Annotated[np.ndarray, Array(("padded",), dtype="i8", saved=False)]
    # position, moment, charge, mass, radius by sorted index, for generic pair forces
    packed_grain: Annotated[np.ndarray, Array((9, "sorted"), saved=False)]
    force: Annotated[np.ndarray, Array((3, GRAINS), "N", fewer=0)]  # long-range forces
    torque: Annotated[np.ndarray, Array((3, GRAINS), "N m", fewer=0)]
    # constant force: the part that acts in every step of an r-RESPA cycle
    constant_force: Annotated[np.ndarray, Array((3, GRAINS), "N", fewer=0)]
    constant_torque: Annotated[np.ndarray, Array((3, GRAINS), "N m", fewer=0)]
    # time derivatives of the loads (Taylor scheme)
    force_rate: Annotated[np.ndarray, Array((3, GRAINS), "N/s", saved=False)]
    torque_rate: Annotated[np.ndarray, Array((3, GRAINS), "N m/s", saved=False)]
    # positions and moments at the last summation, or the one before
    past_position: Annotated[np.ndarray, Array((3, GRAINS), "m", fewer=0)]
    past_moment: Annotated[np.ndarray, Array((3, GRAINS), "A m^2", fewer=0)]
    # time integral of the displacement since the last summation
    path: Annotated[np.ndarray, Array((3, GRAINS), "m s", fewer=0)]
    # forces and flux densities of each block of a sum over all pairs
    block_sums: Annotated[np.ndarray, Array(("blocks", 3, "padded"), saved=False)]


class CellArrays(NamedTuple):
    """A box that is deformed, and what its deformation has done."""

    # the words of basics.box.TiltedSpan, of which the first are those of MovingSpan
    span: Annotated[np.ndarray, Array((11,), earlier=9)]
    # lengths at the start, 0 on open axes
    start: Annotated[np.ndarray, Array((3,), "m")]
    # rates that are prescribed: dL/dt / L, or dL/dt over the length at the start, or the largest ones; that of shear
    rate: Annotated[np.ndarray, Array((4,), "1/s", earlier=3)]
    # pressure that the rates follow, and the present running means along each axis
    goal: Annotated[np.ndarray, Array((1,), "Pa")]
    pressure: Annotated[np.ndarray, Array((3,), "Pa")]
    # virial W_aa of contacts and dipoles, and W_zx, when it was last summed; strains that go with them, and time, since
    virial: Annotated[np.ndarray, Array((4,), "J", earlier=3)]
    strain: Annotated[np.ndarray, Array((4,), earlier=3)]
    # shear strain since the start
    shear: Annotated[np.ndarray, Array((1,), required=False)]
    elapsed: Annotated[np.ndarray, Array((1,), "s")]
    # time from which a row of the ledger may begin a mean: that of the last change of rates or, just after it, of a box
    changed: Annotated[np.ndarray, Array((1,), "s", required=False)]
    # work of the boundaries on the grains, by the deformation along each axis and by shear, up to then
    work: Annotated[np.ndarray, Array((4,), "J", summed=True, earlier=3)]


class ClusterArrays(NamedTuple):
    """Memory for the settling of clusters, one at a time.  Not saved."""

    member: Annotated[np.ndarray, Array((GRAINS,), dtype="u4", saved=False)]  # grains of the cluster
    listed: Annotated[np.ndarray, Array((GRAINS,), dtype="u1", saved=False)]  # 1 for grains whose cluster was listed
    # vectors from the first grain, then from the centre of mass
    offset: Annotated[np.ndarray, Array((3, GRAINS), "m", saved=False)]


class BodyArrays(NamedTuple):
    """Clusters, and single grains, that move as rigid bodies or are awake: their grains take contact steps.

    Columns of a body are those of its first grain.  Vectors "in the body" are in the frame of its principal axes.
    """

    first: Annotated[np.ndarray, Array((GRAINS,), dtype="u4", rule="bodies")]  # first grain of the body of each grain
    asleep: Annotated[np.ndarray, Array((GRAINS,), dtype="u1", rule="boolean")]  # 1 in bodies that move as rigid bodies
    mass: Annotated[np.ndarray, Array((GRAINS,), "kg", rule="no nan")]  # of a body
    inertia: Annotated[np.ndarray, Array((3, GRAINS), "kg m^2", rule="no nan")]  # principal moments of a body
    centre: Annotated[np.ndarray, Array((3, GRAINS), "m", rule="no nan")]  # centre of mass of a body
    momentum: Annotated[np.ndarray, Array((3, GRAINS), "kg m/s", rule="no nan")]  # of a body
    # of a body: rotation from its principal axes to the laboratory frame
    orientation: Annotated[np.ndarray, Array((4, GRAINS), rule="no nan")]
    angular_momentum: Annotated[np.ndarray, Array((3, GRAINS), "J s", rule="no nan")]  # of a body, in the body
    # growth of the bound of contact loads after which the loads of a body are looked at anew
    reserve: Annotated[np.ndarray, Array((GRAINS,), rule="no nan")]
    # largest change of a contact load since the body came to rest, when last looked at
    changed: Annotated[np.ndarray, Array((GRAINS,), rule="no nan")]
    # smallest force [N] and torque [N m] at which a contact of a body slips or breaks
    strength: Annotated[np.ndarray, Array((2, GRAINS), rule="no nan")]
    event: Annotated[np.ndarray, Array((GRAINS,), "s", rule="no nan")]  # time at which contacts of a body last changed
    # time at which the vibrational energy of a body was last above the limit
    vibration: Annotated[np.ndarray, Array((GRAINS,), "s", rule="no nan")]
    offset: Annotated[np.ndarray, Array((3, GRAINS), "m", rule="no nan")]  # of a grain from the centre, in the body
    turn: Annotated[np.ndarray, Array((4, GRAINS), rule="no nan")]  # orientation of a grain, in the body
    # load on a grain, less its inertia, when its body came to rest, in the body
    rest_force: Annotated[np.ndarray, Array((3, GRAINS), "N", rule="no nan")]
    rest_torque: Annotated[np.ndarray, Array((3, GRAINS), "N m", rule="no nan")]
    # likewise, when the loads of the contacts were last looked at
    known_force: Annotated[np.ndarray, Array((3, GRAINS), "N", rule="no nan")]
    known_torque: Annotated[np.ndarray, Array((3, GRAINS), "N m", rule="no nan")]
    # flux density of the other grains of its body at a grain, in the body
    inner_field: Annotated[np.ndarray, Array((3, GRAINS), "T", rule="no nan")]
    # not saved: they follow from the others, or are used within a step
    member: Annotated[np.ndarray, Array((GRAINS,), dtype="u4", saved=False)]  # grains, sorted by body
    start: Annotated[np.ndarray, Array(("grains + 1",), dtype="u4", saved=False)]  # first entry of bodies in member
    # load of all other grains and external forces on a body, about its centre of mass
    force: Annotated[np.ndarray, Array((3, GRAINS), "N", saved=False)]
    torque: Annotated[np.ndarray, Array((3, GRAINS), "N m", saved=False)]
    # rates of the modes of friction of a body in a gas; no columns without gas, as of the next
    decay: Annotated[np.ndarray, Array((6, GRAINS), "1/s", saved=False)]
    # these modes, one after the other, see rigid.body_friction
    mode: Annotated[np.ndarray, Array((36, GRAINS), saved=False)]
    # bound of the change of the loads of the contacts of a body, in units of their limits
    load: Annotated[np.ndarray, Array((GRAINS,), saved=False)]
    # what the first grain of a body says of the next step, see `rigid.body_touches`
    near: Annotated[np.ndarray, Array((GRAINS,), dtype="u1", saved=False)]
    # square of the largest rate that limits the step of a body
    rate: Annotated[np.ndarray, Array((GRAINS,), "1/s^2", saved=False)]
    # whether a body takes substeps within the present step, see `rigid.substeps`
    quick: Annotated[np.ndarray, Array((GRAINS,), dtype="u1", saved=False)]
    # load on a grain that does not kick its body, see `rigid.substeps`
    excluded_force: Annotated[np.ndarray, Array((3, GRAINS), "N", saved=False)]
    excluded_torque: Annotated[np.ndarray, Array((3, GRAINS), "N m", saved=False)]


SAVED_BODIES, SAVED_LONG_RANGE = tuple(saved_in(BodyArrays)), tuple(saved_in(LongRangeArrays))
"""Arrays of bodies and long-range arrays in a checkpoint; the others follow from them."""
FORCE_ARRAYS = ("force", "torque")
CELL_ARRAYS = ("order", "cell_of", "cell_start", "near")
LIST_ARRAYS = ("anchor", "start", "packed_position", *CELL_ARRAYS)
PACKED_ARRAYS = ("packed_position", "packed_moment", "packed_grain")
RESPA_ARRAYS = ("constant_force", "constant_torque", "past_position", "path")
RATE_ARRAYS = ("force_rate", "torque_rate", "past_position", "past_moment")
"""Long-range arrays needed only with long-range forces, cells, a Verlet list, copies for some pair forces
(`LongRangeSums.arrays`), r-RESPA cycles or Taylor series."""
GATHER_CLASSES = 64
"""Classes of grains by contact count; as many entries of `gather_order`, behind those of the grains, are counters."""
GATHER_ORDER_FROM = 4000
"""Fewest grains for which contact.gather sorts grains by contact count; branch predictors learn the counts of fewer."""
CONTACTS_AT_ONCE = 128
"""Contacts whose loops follow each other while they are in the cache, a multiple of the SIMD width; blocks of contacts
that threads share (`integrate.task_queue`) consist of several."""
OVER_ALLOCATION = 1.1
"""Initial over-allocation of tables."""
PAIRS_PER_INNER_ENTRY = 8
"""Candidate pairs per entry of the inner list; if the inner list is too short, all candidate pairs are searched."""
CELLS_PER_GRAIN = 4
"""Largest number of cells per grain; in dilute systems cells are larger than the reach."""


def empty_long_range_arrays(
    grains: int, capacity: int, blocks: int = 1, *, unused: Collection[str] = ()
) -> LongRangeArrays:
    """Allocate long-range arrays.  The anchors are at infinity, so that the first step builds the list.

    Parameters
    ----------
    grains : int
        Number of grains.
    capacity : int
        Allocated length of the Verlet list.
    blocks : int, optional
        Blocks of a sum over all pairs; 0 without such a sum.
    unused : Collection[str], optional
        Arrays that no kernel of this simulation accesses; they get no columns.
    """
    sizes = {GRAINS: grains, "sorted": grains, "grains + 1": grains + 1, "padded": padded_size(grains)}
    sizes |= {"cells": CELLS_PER_GRAIN * grains + 28, "neighbours": max(int(capacity), FEWEST_COLUMNS)}
    sizes |= {"blocks": 2 * blocks}
    return new_group(LongRangeArrays, sizes, dict.fromkeys(unused, 0))


def empty_contact_arrays(
    grains: int,
    capacity: int,
    constant_count: int,
    *,
    uniform_contacts: bool = False,
    channels: int = 6,
    damped: bool = False,
) -> ContactArrays:
    """Allocate contact arrays.

    Parameters
    ----------
    grains : int
        Number of grains.
    capacity : int
        Number of contacts to allocate.
    constant_count : int
        Constants of the contact law per contact.
    uniform_contacts : bool, optional
        Whether one set of constants serves all contacts.
    channels : int, optional
        Number of loss channels recorded per contact.
    damped : bool, optional
        Whether contacts have dashpots.
    """
    used = padded_size(max(int(capacity), FEWEST_COLUMNS))
    gather = grains + GATHER_CLASSES if grains >= GATHER_ORDER_FROM else 0
    sizes = {USED: used, SIDES: 2 * used, "constants": constant_count, "channels": channels, "gather": gather}
    columns = ({} if damped else {"damping": 0}) | ({"constants": CONTACTS_AT_ONCE} if uniform_contacts else {})
    return new_group(ContactArrays, sizes | {"grains + 1": grains + 1}, columns)


def empty_pair_list(grains: int, capacity: int, *, uniform_contacts: bool = False) -> PairList:
    """Allocate a pair list.  The anchors are at infinity, so that the first step builds the list."""
    used = padded_size(max(int(capacity), FEWEST_COLUMNS))
    columns = {"step": 1, "break_overlap": 1} if uniform_contacts else {}
    return new_group(PairList, {USED: used, GRAINS: grains, INNER: used // PAIRS_PER_INNER_ENTRY}, columns)


def cluster_arrays(grains: int) -> ClusterArrays:
    """Allocate the memory for the settling of clusters; `grains` is 0 without it."""
    return new_group(ClusterArrays, {GRAINS: grains})


def body_arrays(grains: int, *, in_gas: bool = False) -> BodyArrays:
    """Allocate the arrays of rigid bodies; `grains` is 0 without them."""
    return new_group(BodyArrays, {GRAINS: grains, "grains + 1": grains + 1}, {} if in_gas else {"decay": 0, "mode": 0})
