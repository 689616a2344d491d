"""Vectors as a user gives them: three components, or one size along an axis of the frame."""

from __future__ import annotations

from typing import Any

from ..errors import BadInput
from ..units import si


def components(value: Any) -> list[Any] | None:
    """The entries of what was given, or None for a single quantity (a number, text, a quantity with a unit)."""
    if isinstance(value, str):
        return None
    try:
        return list(value)
    except TypeError:
        return None


def three(value: Any, unit: str, name: str) -> tuple[float, float, float]:
    """Three finite components in SI.

    Parameters
    ----------
    value
        three numbers in SI, texts with a unit or quantities, one for each axis.
    unit : str
        the SI unit, "1" for pure numbers.
    name : str
        how the user called it, for the message.

    Raises
    ------
    BadInput
        not three, or one line for each component that is wrong.
    """
    parts = components(value)
    if parts is None or len(parts) != 3:
        wanted = "numbers, such as [0, 0, 1]" if unit == "1" else f"components, in {unit}"
        raise BadInput(f"{name} = {value!r} must be three {wanted}")
    numbers, problems = [], []
    for part, axis in zip(parts, "xyz", strict=True):
        try:
            numbers.append(si(part, unit, f"{name} {axis}"))
        except BadInput as error:
            problems += error.problems
    if problems:
        raise BadInput(problems)
    return numbers[0], numbers[1], numbers[2]


def along_z(value: Any, unit: str, name: str, sense: float = 1.0) -> tuple[float, float, float]:
    """Three finite components in SI, or one size along +z, or along −z if `sense` is −1.

    Raises
    ------
    BadInput
        neither one nor three, or one line for each component that is wrong.
    """
    parts = components(value)
    if parts is None:
        return 0.0, 0.0, 0.0 + sense * si(value, unit, f"{name} z")
    if len(parts) != 3:
        axis = "z" if sense > 0.0 else "−z"
        raise BadInput(f"{name} = {value!r} must be one size along {axis} or three components, in {unit}")
    return three(parts, unit, name)
