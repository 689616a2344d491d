"""Arrays of contacts, candidate pairs, long-range forces, clusters, walls and bodies, and their allocation."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, NamedTuple

import numpy as np

from .alignment import all_aligned, padded_size

ALWAYS_RECORDED = 4
"""Loss channels recorded per contact with every contact law; the others only with damping or variable stiffnesses."""


DAMPING_ROWS = 12
"""Rows of `ContactArrays.damping`: relative velocity and spin of the last step, force and torque of the dashpots."""


KEPT_ROWS = 7
"""Rows of `ContactArrays.kept`."""


class ContactArrays(NamedTuple):
    """Contacts, one column each; the first count[CONTACTS] columns are in use.

    They are in order of formation or, with spatial sorting, in the order of their grains.  `side` and `start` list the
    contacts per grain in compressed sparse row form: the entries of grain g are side[start[g] : start[g + 1]].
    """

    pair: np.ndarray  # (2, C) uint32: grains 1 and 2
    pointer1: np.ndarray  # (3, C) contact pointer of grain 1: unit vector to the contact, body frame
    pointer2: np.ndarray  # (3, C) contact pointer of grain 2
    twist: np.ndarray  # (C,) φ [rad]
    formed: np.ndarray  # (C,) time of formation [s]; the start time for initial contacts
    constants: np.ndarray  # (K, C) constants of the law; (K, CONTACTS_PER_BLOCK) identical columns if uniform
    lost: np.ndarray  # (L, C) energy dissipated so far [J], the first 4 or all 6 losses of state.RECORDED
    damping: np.ndarray  # (12, C) motion and loads of the dashpots, rows of contact.damping; (12, 0) without damping
    # (7, C) ζ and R (n1 + n2) [m] at the end of a step, and the step after it for which they are kept, plus 1; rows of
    # contact.slip_rules
    kept: np.ndarray
    force: np.ndarray  # (3, C) force on grain 1 [N]
    torque1: np.ndarray  # (3, C) [N m]
    torque2: np.ndarray  # (3, C) [N m]
    flag: np.ndarray  # (C,) uint8: 0 within all limits, else one of the flags of contact.transitions
    every_step: np.ndarray  # (C,) uint8: 1 where the long-range force of the pair acts in every step
    side: np.ndarray  # (2C,) uint32: 2 × contact, plus 1 for grain 2; sorted by grain
    start: np.ndarray  # (N+1,) uint32: first entry of each grain in `side`
    # (N + GATHER_CLASSES,) uint32: grains in the order of contact.gather; (0,) for the order of their indices
    gather_order: np.ndarray


class PairList(NamedTuple):
    """Candidate pairs for contacts: pairs that may touch soon; the first count[PAIRS] columns are in use."""

    pair: np.ndarray  # (2, P) uint32: grains
    in_contact: np.ndarray  # (P,) uint8: 1 for pairs in contact
    step: np.ndarray  # (P,) time step that the contact needs [s]; (1,) if uniform
    break_overlap: np.ndarray  # (P,) −δ at which the contact breaks [m]: δ_c, 0 without adhesion; (1,) if uniform
    anchor: np.ndarray  # (3, N) positions when the list was built [m]; a buffer while it is built from cells
    # (P/8,) uint32: inner list, the pairs that may touch next, skin[INNER_COUNT] of them; unused if there are too many
    inner: np.ndarray
    skin: np.ndarray  # (7,) remaining skins, largest speeds: indices in basics.state, explained in neighbours.skin


class LongRangeArrays(NamedTuple):
    """Verlet list for long-range forces, and the loads of their last summation.

    The list is a full neighbour list in compressed sparse row form, sorted by cell (see neighbours.cell_list): grain
    order[s] has the sorted index s.
    """

    anchor: np.ndarray  # (3, N) positions when the list was built [m]
    order: np.ndarray  # (N,) uint32: grain of each sorted index
    start: np.ndarray  # (N+1,) uint32: first entry of each row in `neighbour`
    neighbour: np.ndarray  # (P,) uint32: sorted indices of the neighbours
    cell_of: np.ndarray  # (N,) uint32: cell of each grain
    cell_start: np.ndarray  # (M+1,) uint32: first sorted index of each cell
    packed_position: np.ndarray  # (3, V) positions by sorted index [m]; by grain in sums over all pairs
    packed_moment: np.ndarray  # (3, V) moments, likewise
    squared_distance: np.ndarray  # (V,) squared distances of the candidates of one grain, while a list is built [m²]
    packed_grain: np.ndarray  # (9, N) position, moment, charge, mass, radius by sorted index, for generic pair forces
    force: np.ndarray  # (3, N) long-range forces [N]; (3, 0) if there are none
    torque: np.ndarray  # (3, N) long-range torques [N m]; likewise
    constant_force: np.ndarray  # (3, N) constant force: the part that acts in every step of an r-RESPA cycle [N]
    constant_torque: np.ndarray  # (3, N) [N m]
    force_rate: np.ndarray  # (3, N) time derivatives of the loads (Taylor scheme) [N/s]
    torque_rate: np.ndarray  # (3, N) [N m/s]
    past_position: np.ndarray  # (3, N) positions at the last summation, or the one before [m]
    past_moment: np.ndarray  # (3, N) [A m²]
    path: np.ndarray  # (3, N) time integral of the displacement since the last summation [m s]
    block_sums: np.ndarray  # (2B, 3, V) forces and flux densities of each of the B blocks of a sum over all pairs


class WallArrays(NamedTuple):
    """Walls, one column each."""

    position: np.ndarray  # (3, W) a point of the plane [m]
    normal: np.ndarray  # (3, W) unit vector towards the grains
    velocity: np.ndarray  # (3, W) [m/s]
    force: np.ndarray  # (3, W) force of the grains on the wall at the end of the last step [N]
    impulse: np.ndarray  # (3, W) its integral over time since the start [N s]
    work: np.ndarray  # (W,) energy that the wall has given to grains and contacts by its motion [J]
    # used within a step
    velocity_before: np.ndarray  # (3, W) velocity and impulse at the start of the step
    impulse_before: np.ndarray  # (3, W)
    contacts: np.ndarray  # (W,) number of contacts
    touching: np.ndarray  # (W, N) uint8: 1 for grains in contact with the wall


class ClusterArrays(NamedTuple):
    """Memory for the settling of clusters, one at a time.  Not saved."""

    member: np.ndarray  # (N,) uint32: grains of the cluster
    listed: np.ndarray  # (N,) uint8: 1 for grains whose cluster has been listed
    offset: np.ndarray  # (3, N) vectors from the first grain, then from the centre of mass [m]


class BodyArrays(NamedTuple):
    """Clusters, and single grains, that move as rigid bodies or are awake: their grains take contact steps.

    Columns of a body are those of its first grain.  Vectors "in the body" are in the frame of its principal axes.
    """

    first: np.ndarray  # (N,) uint32: first grain of the body of each grain
    asleep: np.ndarray  # (N,) uint8: 1 for grains of bodies that move as rigid bodies
    mass: np.ndarray  # (N,) of a body [kg]
    inertia: np.ndarray  # (3, N) principal moments of inertia of a body [kg m²]
    centre: np.ndarray  # (3, N) centre of mass of a body [m]
    momentum: np.ndarray  # (3, N) of a body [kg m/s]
    orientation: np.ndarray  # (4, N) of a body: rotation from its principal axes to the laboratory frame
    angular_momentum: np.ndarray  # (3, N) of a body, in the body [J s]
    reserve: np.ndarray  # (N,) growth of the bound of contact loads after which the loads of a body are looked at anew
    changed: np.ndarray  # (N,) largest change of a contact load since the body came to rest, when last looked at
    strength: np.ndarray  # (2, N) smallest force [N] and torque [N m] at which a contact of a body slips or breaks
    event: np.ndarray  # (N,) time at which the contacts of a body last changed [s]
    vibration: np.ndarray  # (N,) time at which the vibrational energy of a body was last above the limit [s]
    offset: np.ndarray  # (3, N) of a grain from the centre of its body, in the body [m]
    turn: np.ndarray  # (4, N) orientation of a grain, in the body
    rest_force: np.ndarray  # (3, N) force on a grain, less its inertia, when its body came to rest, in the body [N]
    rest_torque: np.ndarray  # (3, N) likewise [N m]
    known_force: np.ndarray  # (3, N) likewise, when the loads of the contacts were last looked at [N]
    known_torque: np.ndarray  # (3, N) likewise [N m]
    inner_field: np.ndarray  # (3, N) flux density of the other grains of its body at a grain, in the body [T]
    # not saved: they follow from the others, or are used within a step
    member: np.ndarray  # (N,) uint32: grains, sorted by body
    start: np.ndarray  # (N+1,) uint32: first entry of each body in `member`
    force: np.ndarray  # (3, N) of all other grains and external forces on a body [N]
    torque: np.ndarray  # (3, N) likewise, about its centre of mass [N m]
    decay: np.ndarray  # (6, N) rates of the modes of friction of a body in a gas [1/s]; (6, 0) without gas
    mode: np.ndarray  # (36, N) these modes, one after the other, see rigid.body_friction; (36, 0) likewise
    load: np.ndarray  # (N,) bound of the change of the loads of the contacts of a body, in units of their limits
    near: np.ndarray  # (N,) uint8: what the first grain of a body says of the next step, see `rigid.body_touches`
    rate: np.ndarray  # (N,) square of the largest rate that limits the step of a body [1/s²]
    quick: np.ndarray  # (N,) uint8: whether a body takes substeps within the present step, see `rigid.substeps`
    excluded_force: np.ndarray  # (3, N) force on a grain that does not kick its body, see `rigid.substeps` [N]
    excluded_torque: np.ndarray  # (3, N) likewise [N m]


LOADS_OF_BODIES = ("rest_force", "rest_torque", "known_force", "known_torque")
FLAGS_OF_BODIES = ("asleep", "near", "quick")
SAVED_BODIES = BodyArrays._fields[: BodyArrays._fields.index("member")]
"""Arrays of the bodies in a checkpoint."""
SAVED_LONG_RANGE = (
    "anchor",
    "force",
    "torque",
    "constant_force",
    "constant_torque",
    "past_position",
    "past_moment",
    "path",
)
"""Long-range arrays in a checkpoint; the others follow from them."""
FORCE_ARRAYS = ("force", "torque")
CELL_ARRAYS = ("order", "cell_of", "cell_start", "squared_distance")
LIST_ARRAYS = ("anchor", "start", "packed_position", *CELL_ARRAYS)
PACKED_ARRAYS = ("packed_position", "packed_moment", "packed_grain")
RESPA_ARRAYS = ("constant_force", "constant_torque", "past_position", "path")
RATE_ARRAYS = ("force_rate", "torque_rate", "past_position", "past_moment")
"""Long-range arrays needed only with long-range forces, cells, a Verlet list, copies for some pair forces
(`LongRangeSums.arrays`), r-RESPA cycles or Taylor series."""
UNIFORM_ARRAYS = ("constants", "step", "break_overlap")
"""Arrays of contacts and candidate pairs with identical columns if all grains are equal."""
SAVED_WALLS = ("position", "normal", "velocity", "force", "impulse", "work")
"""Arrays of the walls in a checkpoint."""
NOT_SAVED = ("inner", "skin", "gather_order")
"""Arrays of contacts and candidate pairs that are not in a checkpoint, but recomputed."""
GATHER_CLASSES = 64
"""Classes of grains by contact count; as many entries of `gather_order`, behind those of the grains, are counters."""
GATHER_ORDER_FROM = 4000
"""Fewest grains for which contact.gather sorts grains by contact count; branch predictors learn the counts of fewer."""
CONTACTS_PER_BLOCK = 128
"""Contacts per block of the pass over contacts, a multiple of the SIMD width."""
OVER_ALLOCATION, GROWTH = 1.1, 1.25
"""Initial over-allocation (×1.1), and growth factor on overflow (×1.25)."""
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
    vectors: dict[str, np.ndarray] = {name: np.zeros((3, grains)) for name in LongRangeArrays._fields}
    vectors["anchor"], vectors["packed_grain"] = np.full((3, grains), np.inf), np.zeros((9, grains))
    v, p = padded_size(grains), max(int(capacity), 16)
    vectors |= {name: np.zeros((3, v)) for name in ("packed_position", "packed_moment")}
    vectors |= {"squared_distance": np.zeros(v), "block_sums": np.zeros((2 * blocks, 3, v))}
    sizes = {"order": grains, "start": grains + 1, "neighbour": p, "cell_of": grains}
    sizes["cell_start"] = CELLS_PER_GRAIN * grains + 28
    arrays = vectors | {name: np.zeros(size, np.uint32) for name, size in sizes.items()}
    return LongRangeArrays(**(arrays | {name: arrays[name][..., :0].copy() for name in unused}))


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
    c = padded_size(max(int(capacity), 16))
    vectors = {k: np.zeros((3, c)) for k in ("pointer1", "pointer2", "force", "torque1", "torque2")}
    numbers = {"twist": np.zeros(c), "formed": np.zeros(c), "damping": np.zeros((DAMPING_ROWS, c if damped else 0))}
    numbers["kept"] = np.zeros((KEPT_ROWS, c))
    return ContactArrays(
        pair=np.zeros((2, c), np.uint32),
        constants=np.zeros((constant_count, CONTACTS_PER_BLOCK if uniform_contacts else c)),
        flag=np.zeros(c, np.uint8),
        every_step=np.zeros(c, np.uint8),
        lost=np.zeros((channels, c)),
        side=np.zeros(2 * c, np.uint32),
        start=np.zeros(grains + 1, np.uint32),
        gather_order=np.zeros(grains + GATHER_CLASSES if grains >= GATHER_ORDER_FROM else 0, np.uint32),
        **(vectors | numbers),
    )


def empty_pair_list(grains: int, capacity: int, *, uniform_contacts: bool = False) -> PairList:
    """Allocate a pair list.  The anchors are at infinity, so that the first step builds the list."""
    p, anchor = padded_size(max(int(capacity), 16)), np.full((3, grains), np.inf)
    pair, in_contact = np.zeros((2, p), np.uint32), np.zeros(p, np.uint8)
    inner = np.zeros(p // PAIRS_PER_INNER_ENTRY, np.uint32)
    types = np.zeros((2, 1 if uniform_contacts else p))
    return PairList(pair, in_contact, types[0], types[1], anchor, inner, np.full(7, -1.0))


def wall_arrays(walls: int, grains: int) -> WallArrays:
    """Allocate the arrays of the walls."""
    vectors = {name: np.zeros((3, walls)) for name in WallArrays._fields[:8] if name != "work"}
    return WallArrays(
        work=np.zeros(walls), contacts=np.zeros(walls), touching=np.zeros((walls, grains), np.uint8), **vectors
    )


def cluster_arrays(grains: int) -> ClusterArrays:
    """Allocate the memory for the settling of clusters; `grains` is 0 without it."""
    return ClusterArrays(np.zeros(grains, np.uint32), np.zeros(grains, np.uint8), np.zeros((3, grains)))


def body_arrays(grains: int, *, in_gas: bool = False) -> BodyArrays:
    """Allocate the arrays of rigid bodies; `grains` is 0 without them."""
    vectors = ("inertia", "centre", "momentum", "angular_momentum", "offset")
    widths = dict.fromkeys((*vectors, *LOADS_OF_BODIES, "inner_field", "force", "torque"), 3)
    widths |= {"excluded_force": 3, "excluded_torque": 3}
    widths |= {"orientation": 4, "turn": 4, "strength": 2}
    found = {name: np.zeros((widths[name], grains) if name in widths else grains) for name in BodyArrays._fields}
    for name, kind in {"first": np.uint32, "member": np.uint32, **dict.fromkeys(FLAGS_OF_BODIES, np.uint8)}.items():
        found[name] = np.zeros(grains, kind)
    found |= {name: np.zeros((rows, grains if in_gas else 0)) for name, rows in (("decay", 6), ("mode", 36))}
    return BodyArrays(**(found | {"start": np.zeros(grains + 1, np.uint32)}))


def grown(arrays: Any, unchanged: Collection[str], minimum: int) -> Any:
    """Arrays with more columns, for at least `minimum` contacts or pairs; the `unchanged` ones keep theirs."""
    columns = arrays.pair.shape[1]
    capacity, longer = padded_size(max(int(GROWTH * columns) + 1, minimum)), {}
    for name, old in arrays._asdict().items():
        if name in unchanged:
            longer[name] = old
            continue
        new = np.zeros((*old.shape[:-1], capacity * old.shape[-1] // columns), old.dtype)
        new[..., : old.shape[-1]] = old
        longer[name] = new
    return all_aligned(type(arrays)(**longer))
