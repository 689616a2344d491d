"""The arrays of a state after grains were removed, added or moved to another box."""

from __future__ import annotations

import copy

import numpy as np

from ..analysis.clusters import cluster_labels, unwrapped
from ..basics.array_groups import kept_arrays, saved_in
from ..basics.box import Box
from ..basics.errors import BadInput, first_problems
from ..basics.grains import GrainArrays, Grains
from ..basics.own_quantities import joined as joined_own
from ..basics.state import CONTACT_LIMIT, CONTACTS, CUT_FIRST, CUT_SECOND, GRAIN1, GRAIN2, PAIRS, State

SAME_SEPARATION = 1e-9
"""Largest change of the separation of two grains in contact, in their radii, that counts as rounding."""
MOST_NAMED = 10
"""Contacts that are named one by one in a message."""


def subset(grains: Grains, index: np.ndarray) -> Grains:
    """The grains with these indices, with the orientations, loads and identities that they have."""
    other = copy.copy(grains)
    other.arrays = GrainArrays(*(np.ascontiguousarray(array[..., index]) for array in grains.arrays))
    return other


def joined(first: Grains, second: Grains, identity: np.ndarray) -> Grains:
    """All grains of two sets; those of the second set have no loads and these identities (uint32).

    Raises BadInput if their own quantities differ.
    """
    materials = tuple(dict.fromkeys((*first.materials, *second.materials)))
    number = np.array([materials.index(own) for own in second.materials], np.uint32)
    joined_own([first.own, second.own], ["add: the grains of the simulation have", "add: the grains added have"])
    own = np.array([second.own[name] for name in first.own_units]).reshape(-1, len(second))
    nothing = {name: np.zeros_like(getattr(second.arrays, name)) for name in ("force", "torque", "field", "image")}
    more = second.arrays._replace(material=number[second.arrays.material], id=identity, own=own, **nothing)
    other = copy.copy(first)
    other.arrays = GrainArrays(*(np.concatenate(both, axis=-1) for both in zip(first.arrays, more, strict=True)))
    object.__setattr__(other, "materials", materials)
    return other


def refuse_cut_contacts(before: Grains, box: Box, after: Grains, new_box: Box, pair: np.ndarray) -> None:
    """Refuse a box in which two grains in contact would no longer be where they touch.

    Parameters
    ----------
    before, after : Grains
        The same grains in both boxes.
    pair : ndarray
        Contacts (C, 2).

    Raises
    ------
    BadInput
        With the first ten contacts.
    """
    old = box.nearest(before.position[pair[:, 0]] - before.position[pair[:, 1]])
    new = new_box.nearest(after.position[pair[:, 0]] - after.position[pair[:, 1]])
    wrong = np.flatnonzero(np.abs(new - old).max(axis=1) > SAME_SEPARATION * after.radius[pair].min(axis=1))
    problems = [
        f"box: the contact of grains {pair[k, 0]} and {pair[k, 1]} would be cut by the boundary of the new box, "
        f"{new_box.describe()}; remove one of them, or use scale_box, which moves clusters whole"
        for k in wrong[:MOST_NAMED]
    ]
    if problems:
        raise BadInput(first_problems(problems, len(wrong), "contacts"))


def scaled_positions(grains: Grains, pair: np.ndarray, box: Box, factors: np.ndarray) -> np.ndarray:
    """Positions (N, 3) [m] after the centre of mass R of each cluster moved to f R: x + (f − 1) R.

    Parameters
    ----------
    pair : ndarray
        Contacts (C, 2).
    box : Box
        The box before, across whose boundaries clusters are put together.
    factors : ndarray
        Factor f of each axis (3,).
    """
    labels = cluster_labels(len(grains), pair)
    whole = unwrapped(grains.position, pair, box)
    mass = np.bincount(labels, grains.mass)
    centre = np.stack([np.bincount(labels, grains.mass * x) / mass for x in whole.T], axis=1)
    return whole + (factors - 1.0) * centre[labels]


def regrouped_arrays(state: State, kept: np.ndarray, grains: Grains, target: State) -> dict[str, np.ndarray]:
    """Arrays, as of `State.to_arrays`, of a state with other grains or another box.

    Contacts between grains that stay keep all that is stored for them. Lists of neighbours are empty, so that the next
    step builds them, and long-range loads are 0 until they are summed.

    Parameters
    ----------
    state : State
        The state before.
    kept : ndarray
        Indices of the grains that stay, ascending; they come first.
    grains : Grains
        All grains after the change.
    target : State
        New state of these grains, which has the shapes of the arrays.
    """
    saved, fresh = state.to_arrays(), target.to_arrays()
    out = {name: saved[name].copy() for name in ("clock", "count", "lost", "cutoff")}
    out |= {f"grains/{name}": array.copy() for name, array in grains.arrays._asdict().items()}
    new_index = np.full(len(state.grains), -1, np.int64)
    new_index[kept] = np.arange(len(kept))
    for group, arrays in (("contacts", state.contacts), *state.of_components.items()):
        declared = {f"{group}/{name}": each for name, each in saved_in(arrays).items()}
        out |= kept_arrays(declared, saved, fresh, new_index)
    pair, constants, uniform = out["contacts/pair"], out["contacts/constants"], target.uniform_contacts
    if state.uniform_contacts and not uniform:
        constants = np.repeat(saved["contacts/constants"][:, :1], pair.shape[1], axis=1)
    elif uniform:  # one column, also without contacts
        constants = saved["contacts/constants"][:, :1] if constants.size else np.zeros((len(constants), 1))
    out["contacts/constants"] = constants
    out["contacts/kept"][:] = 0.0  # grains may have been moved: displacements are computed in the next step
    owner = pair.T.ravel()  # entry 2c + k is grain k of contact c
    out["contacts/side"] = np.argsort(owner, kind="stable").astype(np.uint32)
    starts = np.concatenate([[0], np.cumsum(np.bincount(owner, minlength=len(grains)))])
    out["contacts/start"] = starts.astype(np.uint32)
    out |= {name: array for name, array in fresh.items() if name.startswith(("pair_list/", "long_range/"))}
    count, clock, cutoff = out["count"], out["clock"], out["cutoff"]
    count[CONTACTS], count[PAIRS] = pair.shape[1], 0
    count[GRAIN1] = count[GRAIN2] = -1
    clock[CONTACT_LIMIT] = np.inf
    cutoff[[CUT_FIRST, CUT_SECOND]] = 0.0  # chosen anew before the next step
    return out
