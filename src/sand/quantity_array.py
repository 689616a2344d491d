"""Arrays of SI numbers to which a user may assign text and quantities with a unit."""

from __future__ import annotations

from typing import Any

import numpy as np

from .errors import BadInput
from .units import si_array


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
        if self.unit_of_entries is not None:
            value = si_array(value, self.unit_of_entries, self.name)
        try:
            super().__setitem__(index, value)
        except ValueError as error:  # of NumPy, about the shape
            raise BadInput(f"{self.name}: {error}") from None

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        """Return the result of arithmetic as a plain array, but in-place arithmetic as this one."""
        if array is self:
            return self
        return array[()] if return_scalar else np.asarray(array)
