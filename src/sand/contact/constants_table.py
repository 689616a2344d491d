"""Constants of the contacts, stored as the columns of a table; the rows follow from the names of the constants."""

import functools
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from ..compiler.jit import loop
from .law import ContactConstants, ContactLaw, Derived, Pairing, contact_constants, derived_constants


class ConstantAccess(NamedTuple):
    """Access to the constants of contacts, for one contact law."""

    load: Callable  # (table, c) → ContactConstants in column c
    store: Callable  # (table, c, constants): write column c
    at: Callable  # (contacts, c) → ContactConstants of contact c
    of_pair: Callable  # (grains, pairings, i, j) → ContactConstants of a contact between grains i and j


@loop
def uniform_contacts(contacts):
    """Whether one set of constants serves all contacts.

    Uniform constants are stored as CONTACTS_AT_ONCE identical columns, individual ones as one column per allocated
    contact.  If as many contacts are allocated the two cannot be distinguished; the answer False is then also correct.
    """
    return contacts.constants.shape[1] != contacts.flag.size


def constant_names(law: ContactLaw) -> list[str]:
    """Names of the stored constants of a contact: those of all laws, "normal.…" of this law, and "derived.…"."""
    own: tuple[str, ...] = law.constants_type._fields  # type: ignore[attr-defined]
    derived = (f"derived.{name}" for name in Derived._fields)
    return [*ContactConstants._fields[:COMMON], *(f"normal.{name}" for name in own), *derived]


def with_derived(law: ContactLaw, saved: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Arrays of a checkpoint, with the derived constants of contacts, which earlier versions did not store."""
    names, found = constant_names(law), dict(saved)
    needed = ("reduced_radius", "roll_stiffness", "slide_limit", "roll_limit", "break_overlap")
    for group in ("contacts", "wall_contacts"):
        table = found.get(f"{group}/constants")
        if table is not None and len(table) == len(names) - len(Derived._fields):
            radius, (first, second) = saved["grains/radius"], saved[f"{group}/pair"]
            radii = radius[first], radius[second] if group == "contacts" else np.full(first.size, np.inf)
            # one column serves equal contacts
            resized = [np.resize(own if first.size else radius, table.shape[1]) for own in radii]
            given = zip(*(table[names.index(name)] for name in needed), *resized, strict=True)
            derived = np.array([derived_constants(*column) for column in given])
            found[f"{group}/constants"] = np.concatenate([table, derived.reshape(-1, len(Derived._fields)).T])
    return found


COMMON = ContactConstants._fields.index("normal")
"""Number of constants that all laws have."""
FASTEST_MODE = ContactConstants._fields.index("max_squared_frequency")
"""Row of the largest squared frequency of a contact [1/s²]."""


@functools.cache
def column_loops(law: ContactLaw) -> ConstantAccess:
    """Access to the constants of contacts, for one contact law."""
    names, of_materials = constant_names(law), contact_constants(law)
    rows = [f"table[{row}, c]" for row in range(len(names))]
    first, last = COMMON, len(names) - len(Derived._fields)
    # the compiler needs the rows spelled out
    source = (
        "def load(table, c):\n"
        f"    normal, derived = NormalConstants({', '.join(rows[first:last])}), Derived({', '.join(rows[last:])})\n"
        f"    return ContactConstants({', '.join(rows[:first])}, normal, derived)\n"
        "def store(table, c, constants):\n"
        + "".join(f"    {row} = constants.{name}\n" for row, name in zip(rows, names, strict=True))
    )
    scope: dict[str, Any] = {
        "ContactConstants": ContactConstants,
        "Derived": Derived,
        "NormalConstants": law.constants_type,
        "__name__": __name__,
    }
    exec(compile(source, f"<columns of {law.name}>", "exec"), scope)
    load, store = loop(scope["load"]), loop(scope["store"])

    @loop
    def at(contacts, c):
        return load(contacts.constants, 0 if uniform_contacts(contacts) else c)

    @loop
    def of_pair(grains, pairings, i, j):
        pairing = load_pairing(pairings, grains.material[i], grains.material[j])
        return of_materials(pairing, grains.radius[i], grains.radius[j], grains.mass[i], grains.mass[j])

    return ConstantAccess(load, store, at, of_pair)


_PAIRING = ", ".join(f"pairings[{row}, a, b]" for row in range(len(Pairing._fields)))
_SCOPE: dict[str, Any] = {"Pairing": Pairing, "__name__": __name__}
exec(f"def load_pairing(pairings, a, b):\n    return Pairing({_PAIRING})", _SCOPE)
load_pairing = loop(_SCOPE["load_pairing"])
"""Parameters of materials a and b, from the (11, M, M) table."""
