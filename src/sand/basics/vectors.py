"""Vectors in user input: three components, or a magnitude along a coordinate axis."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from .errors import BadInput, shown
from .units import si


def components(value: Any) -> list[Any] | None:
    """The entries of a sequence; None for a single quantity (a number, text, a quantity with a unit)."""
    if isinstance(value, (str, bytes, Mapping)):
        return None
    try:
        return list(value)
    except TypeError:
        return None


def three(value: Any, unit: str, name: str, *, read: Callable[..., float] = si) -> tuple[float, float, float]:
    """Convert three components to SI.

    Parameters
    ----------
    value : sequence
        Three SI numbers, texts with a unit, or quantities.
    unit : str
        The SI unit, "1" for dimensionless numbers.
    name : str
        Name of the parameter in error messages.
    read : callable, optional
        Converts one component, as `units.si` does.

    Returns
    -------
    tuple[float, float, float]
        Finite numbers.

    Raises
    ------
    BadInput
        If there are not three components; one line for each invalid component.
    """
    entries = components(value)
    if entries is None or len(entries) != 3:
        expected = "numbers, such as [0, 0, 1]" if unit == "1" else f"components, in {unit}"
        raise BadInput(f"{name} = {shown(value)} must be three {expected}")
    numbers, problems = [], []
    for entry, axis in zip(entries, "xyz", strict=True):
        try:
            numbers.append(read(entry, unit, f"{name} {axis}"))
        except BadInput as error:
            problems += error.problems
    if problems:
        raise BadInput(problems)
    return numbers[0], numbers[1], numbers[2]


def along_z(value: Any, unit: str, name: str, direction: float = 1.0) -> tuple[float, float, float]:
    """Convert three components, or one value along +z (−z if `direction` is −1), to SI.

    Raises
    ------
    BadInput
        If there are neither one nor three components; one line for each invalid component.
    """
    entries = components(value)
    if entries is None:
        return 0.0, 0.0, 0.0 + direction * si(value, unit, f"{name} z")
    if len(entries) != 3:
        axis = "z" if direction > 0.0 else "−z"
        raise BadInput(f"{name} = {shown(value)} must be one value along {axis} or three components, in {unit}")
    return three(entries, unit, name)
