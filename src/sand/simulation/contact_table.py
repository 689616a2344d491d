"""Table of contacts: displacements, shares of their limits, loads, energies and losses."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..basics.errors import NoSuchKey, did_you_mean, import_optional, shown
from ..basics.state import CONTACTS, RECORDED, State
from ..contact.law import ContactLaw
from ..contact.measure import CONTACT_LOADS, CONTACT_ROWS, CONTACT_VECTORS, contacts_stage

COLUMNS = (
    ("pair", "", "the two grains"),
    ("formed", "s", "time at which the contact formed; the start for initial contacts"),
    *CONTACT_ROWS,
    *CONTACT_VECTORS,
    ("force", "N", "force on the first grain; the second one's is the opposite"),
    ("torque1", "N m", "torque on the first grain"),
    ("torque2", "N m", "torque on the second grain"),
    *((f"lost_{name}", "J", f"dissipated so far: {name}") for name in RECORDED),
)
"""Name, unit and meaning of every column."""


class Columns(dict[str, np.ndarray]):
    """Columns by name; an unknown name is refused with a suggestion."""

    def __missing__(self, name: Any) -> np.ndarray:
        """Raise BadInput, which is also a KeyError."""
        raise NoSuchKey(f"there is no column {shown(name)}; {did_you_mean(str(name), list(self))}")

    def __repr__(self) -> str:
        rows = len(next(iter(self.values()), ()))
        return f"<{rows} row{'' if rows == 1 else 's'} of {', '.join(self)}>"

    def _flat(self) -> dict[str, np.ndarray]:
        """One-dimensional columns: vectors split into components, pairs into grain1 and grain2."""
        flat: dict[str, np.ndarray] = {}
        for name, column in self.items():
            if name == "pair":
                flat |= {"grain1": column[:, 0], "grain2": column[:, 1]}
            elif column.ndim == 2:
                flat |= {f"{name}_{axis}": column[:, k] for k, axis in enumerate("xyz")}
            else:
                flat[name] = column
        return flat

    def to_pandas(self) -> Any:
        """Convert to a pandas DataFrame; needs pandas."""
        return import_optional("pandas", "to_pandas").DataFrame(self._flat())


def measured_columns(state: State, law: ContactLaw, table: Any) -> dict[str, np.ndarray]:
    """Columns of a `ContactTable`, without those of losses; vectors are not contiguous."""
    used = int(state.count[CONTACTS])
    scalars, names = len(CONTACT_ROWS), [*(name for name, _, _ in CONTACT_VECTORS), *CONTACT_LOADS]
    rows = np.zeros((scalars + 3 * len(names), used))
    contacts_stage(law).run(table, (rows,))
    found = {"pair": state.contacts.pair[:, :used].T, "formed": state.contacts.formed[:used].copy()}
    found |= {name: rows[k] for k, (name, _, _) in enumerate(CONTACT_ROWS)}
    return found | {name: rows[scalars + 3 * k : scalars + 3 * k + 3].T for k, name in enumerate(names)}


class Contacts(Columns):
    """Columns of contacts, (C,) or (C, 3), with their units by name."""

    def __init__(self, columns: dict[str, np.ndarray], units: dict[str, str]):
        super().__init__(columns)
        self.units = units

    def __repr__(self) -> str:
        return f"<{len(self['force'])} contacts: {', '.join(self)}>"

    def to_xarray(self) -> Any:
        """Convert to an xarray Dataset with dimension `contact` and units as attributes; needs xarray."""
        xarray = import_optional("xarray", "to_xarray")
        variables = {
            name: ("contact", column, {"units": self.units.get(name, self.units.get(name[:-2], ""))})
            for name, column in self._flat().items()
        }
        return xarray.Dataset(variables)


class ContactTable(Contacts):
    """A snapshot of all contacts: one row per contact, columns by name (`COLUMNS`), such as `table["roll_share"]`.

    Columns have shape (C,), `pair` (C, 2) and vectors (C, 3), in the laboratory frame.  `table` is the table of the
    stages with the arrays of the state.
    """

    def __init__(self, state: State, law: ContactLaw, table: Any):
        super().__init__({}, {name: unit for name, unit, _ in COLUMNS})
        found, contacts, used = measured_columns(state, law, table), state.contacts, int(state.count[CONTACTS])
        self.update({name: column.copy() if column.ndim == 2 else column for name, column in found.items()})
        for k, name in enumerate(RECORDED):
            is_recorded = k < len(contacts.lost)
            self[f"lost_{name}"] = contacts.lost[k, :used].copy() if is_recorded else np.zeros(used)
