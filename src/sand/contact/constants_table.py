"""Constants of the contacts, stored as the columns of a table; the rows follow from the names of the constants."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

from ..compiler.jit import loop
from .law import ContactConstants, ContactLaw, Pairing, contact_constants


class ConstantAccess(NamedTuple):
    """Access to the constants of contacts, for one contact law."""

    load: Callable  # (table, c) → ContactConstants in column c
    store: Callable  # (table, c, constants): write column c
    at: Callable  # (contacts, c) → ContactConstants of contact c
    of_pair: Callable  # (grains, pairings, i, j) → ContactConstants of a contact between grains i and j


@loop
def uniform_contacts(contacts):
    """Whether one set of constants serves all contacts.

    Uniform constants are stored as CONTACTS_PER_BLOCK identical columns, individual ones as one column per allocated
    contact.  If as many contacts are allocated the two cannot be distinguished; the answer False is then also correct.
    """
    return contacts.constants.shape[1] != contacts.flag.size


def constant_names(law: ContactLaw) -> list[str]:
    """Names of the stored constants of a contact: those of all laws, then "normal.…" of this law."""
    own: tuple[str, ...] = law.constants_type._fields  # type: ignore[attr-defined]
    return [*ContactConstants._fields[:-1], *(f"normal.{name}" for name in own)]


FASTEST_MODE = ContactConstants._fields.index("max_squared_frequency")
"""Row of the largest squared frequency of a contact [1/s²]."""


@functools.cache
def column_loops(law: ContactLaw) -> ConstantAccess:
    """Access to the constants of contacts, for one contact law."""
    names, of_materials = constant_names(law), contact_constants(law)
    rows = [f"table[{row}, c]" for row in range(len(names))]
    common = len(ContactConstants._fields) - 1
    # the compiler needs the rows spelled out
    source = (
        "def load(table, c):\n"
        f"    return ContactConstants({', '.join(rows[:common])}, NormalConstants({', '.join(rows[common:])}))\n"
        "def store(table, c, constants):\n"
        + "".join(f"    {row} = constants.{name}\n" for row, name in zip(rows, names, strict=True))
    )
    scope: dict[str, Any] = {
        "ContactConstants": ContactConstants,
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
