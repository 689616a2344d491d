"""A part of a state: some grains with all their contacts, copied to a smaller state and back."""

from __future__ import annotations

import math

import numpy as np

from ..basics.arrays import ContactArrays
from ..basics.state import CONTACTS, State
from ..contact.gather import resort_contacts_by_grain

NOT_COPIED = ("pair", "constants", "every_step", "side", "start", "gather_order")
CONTACT_COLUMNS = tuple(name for name in ContactArrays._fields if name not in NOT_COPIED)
"""Arrays of contacts that a part needs and changes; pairs are numbered anew, the others follow."""
MOVING = ("position", "velocity", "orientation", "spin", "moment", "image")
MOVING_BODIES = ("centre", "orientation", "momentum", "angular_momentum")
"""Arrays of grains and of bodies that change in a step."""


def copy_grains(state: State, part: State, index: np.ndarray) -> None:
    """Copy the grains with these indices, in ascending order, to the state of a part."""
    for name, array in part.grains.arrays._asdict().items():
        getattr(state.grains.arrays, name).take(index, axis=-1, out=array)


def copy_contacts(state: State, part: State, index: np.ndarray, columns: np.ndarray) -> None:
    """Copy the contacts in these columns, all those of the grains `index`, to the state of a part."""
    used = len(columns)
    if part.contacts.pair.shape[1] < used:
        part.grow_contacts(used)
    contacts, own = state.contacts, part.contacts
    own.pair[:, :used] = np.searchsorted(index, contacts.pair[:, columns])
    for name in CONTACT_COLUMNS:
        if getattr(own, name).shape[-1]:
            getattr(own, name)[..., :used] = getattr(contacts, name)[..., columns]
    if state.uniform_contacts:
        own.constants[...] = contacts.constants
    else:
        own.constants[:, :used] = contacts.constants[:, columns]
    own.every_step[:] = 0
    part.count[CONTACTS] = used


def store_grains(state: State, part: State, index: np.ndarray) -> None:
    """Copy what has moved in a part back to the grains of the state."""
    for name in MOVING:
        getattr(state.grains.arrays, name)[..., index] = getattr(part.grains.arrays, name)


def store_contacts(state: State, part: State, index: np.ndarray, columns: np.ndarray, *, changed: bool) -> np.ndarray:
    """Copy the contacts of a part back; returns their columns in the state.

    If some have formed or broken (`changed`), the contacts of all other grains come first, then those of the part.
    """
    used = int(part.count[CONTACTS])
    if not changed:
        for name in CONTACT_COLUMNS:
            if getattr(state.contacts, name).shape[-1]:
                getattr(state.contacts, name)[..., columns] = getattr(part.contacts, name)[..., :used]
        return columns
    kept = np.setdiff1d(np.arange(state.count[CONTACTS]), columns)
    first, end = len(kept), len(kept) + used
    if state.contacts.pair.shape[1] < end:
        state.grow_contacts(end)
    contacts, pairs = state.contacts, index[part.contacts.pair[:, :used]]
    for name in ("pair", *CONTACT_COLUMNS, "constants"):
        array = getattr(contacts, name)
        if not array.shape[-1]:
            continue
        if name == "constants" and state.uniform_contacts:
            array[...] = part.contacts.constants
            continue
        array[..., :first] = array[..., kept]
        array[..., first:end] = pairs if name == "pair" else getattr(part.contacts, name)[..., :used]
    state.count[CONTACTS] = end
    state.pair_list.anchor[...] = math.inf  # the list of candidates says which pairs are in contact
    resort_contacts_by_grain(state.grains.arrays, contacts, state.count)
    return np.arange(first, end)
