"""Broken contacts are removed from the arrays; all columns of the other contacts move together."""

import numpy as np
import pytest

from sand.basics.arrays import ContactArrays, empty_contact_arrays
from sand.basics.state import CONTACTS, COUNT
from sand.contact.events import compact_contacts
from sand.contact.transitions import BROKEN_FLAG

BY_GRAIN = {"side", "start", "gather_order"}
"""Arrays that are rebuilt from the pairs."""


@pytest.mark.parametrize("broken", [[0], [1, 2, 5], [6], [], list(range(7))])
def test_each_column_moves_with_its_contact(broken):
    """Seven contacts with random values: each array equals NumPy's selection of it, to the bit.

    There is room for more contacts, constants and losses are per contact, and damping is on, so that every array is
    covered.  The loop runs as plain Python.
    """
    contacts = empty_contact_arrays(9, 20, 15, channels=6, damped=True)
    rng, count = np.random.default_rng(4), np.zeros(len(COUNT), np.int64)
    count[CONTACTS] = 7
    for name in set(ContactArrays._fields) - BY_GRAIN:
        array = getattr(contacts, name)
        array[...] = rng.integers(1, 9, array.shape) if array.dtype.kind == "u" else rng.normal(size=array.shape)
    contacts.flag[contacts.flag == BROKEN_FLAG] = 0
    contacts.flag[broken] = BROKEN_FLAG
    kept = [c for c in range(7) if c not in broken]
    expected = {name: getattr(contacts, name)[..., kept].copy() for name in set(ContactArrays._fields) - BY_GRAIN}
    count[CONTACTS] = compact_contacts(contacts, count[CONTACTS])
    assert count[CONTACTS] == len(kept)
    for name, array in expected.items():
        assert (getattr(contacts, name)[..., : len(kept)] == array).all(), name
