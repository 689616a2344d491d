"""Arrays of SI numbers to which a user may assign text and quantities with a unit."""

from __future__ import annotations

from typing import Any

import numpy as np

from .errors import BadInput
from .units import has_unit_within, si_array

WRITERS = {
    np.copyto: (1, "src"),
    np.put: (2, "v"),
    np.place: (2, "vals"),
    np.putmask: (2, "values"),
    np.fill_diagonal: (1, "val"),
}
"""Functions of NumPy that write into their first argument: position and name of the argument that they write."""


class QuantityArray(np.ndarray):
    """A copy of an array in SI whose entries can be assigned as numbers, text or quantities, which are converted.

    Views of it, such as `velocity[3]`, do the same; results of arithmetic are plain arrays.

    Parameters
    ----------
    values : array_like
        Numbers in `unit`, text or quantities.
    unit : str
        SI unit.
    name : str
        Name in messages.

    Raises
    ------
    BadInput
        If values, here or in an assignment, are not quantities in `unit`.
    """

    unit_of_entries: str | None = None
    name: str = ""

    def __new__(cls, values: Any, unit: str, name: str) -> QuantityArray:
        """Copy the values."""
        made = np.array(si_array(values, unit, name), dtype=np.float64).view(cls)
        made.unit_of_entries, made.name = unit, name
        return made

    def __array_finalize__(self, source: Any) -> None:
        """Take the unit of the array of which this is a view."""
        self.unit_of_entries = getattr(source, "unit_of_entries", None)
        self.name = getattr(source, "name", "")

    def __setitem__(self, index: Any, value: Any) -> None:
        """Assign values in SI, text or quantities.  Raises BadInput."""
        numbers = self._in_si(value)
        try:
            super().__setitem__(index, numbers)
        except ValueError as error:  # of NumPy, about the shape
            raise BadInput(f"{self.name}: {error}") from None

    def _in_si(self, value: Any) -> Any:
        """What is written into the array, as numbers.  Raises BadInput."""
        return value if self.unit_of_entries is None else si_array(value, self.unit_of_entries, self.name)

    def fill(self, value: Any) -> None:
        """Assign a value to all entries, as `array[...] = value`.  Raises BadInput."""
        self[...] = value

    def put(self, indices: Any, values: Any, mode: Any = "raise") -> None:
        """Assign values in SI, text or quantities to entries of the flattened array.  Raises BadInput."""
        super().put(indices, self._in_si(values), mode)

    def __iadd__(self, other: Any) -> Any:  # type: ignore[misc]
        """Add numbers in SI, text or quantities.  Raises BadInput."""
        return super().__iadd__(self._in_si(other) if has_unit_within(other) else other)

    def __isub__(self, other: Any) -> Any:  # type: ignore[misc]
        """Subtract numbers in SI, text or quantities.  Raises BadInput."""
        return super().__isub__(self._in_si(other) if has_unit_within(other) else other)

    def __array_function__(self, function: Any, types: Any, args: Any, named: Any) -> Any:
        """Convert what a function of NumPy writes into this array.  Raises BadInput."""
        if function in WRITERS and (args or named) and next(iter((*args, *named.values()))) is self:
            at, name = WRITERS[function]
            args = tuple(self._in_si(one) if k == at else one for k, one in enumerate(args))
            named = {key: self._in_si(one) if key == name else one for key, one in named.items()}
            types = [type(self)]
        return super().__array_function__(function, types, args, named)

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        """Return the result of arithmetic as a plain array, but in-place arithmetic as this one."""
        if array is self:
            return self
        return array[()] if return_scalar else np.asarray(array)
