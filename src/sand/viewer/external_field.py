"""Description of the external magnetic field of a run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from math import hypot
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..basics.errors import BadInput
from ..basics.ramps import ramps_of
from ..basics.units import format_quantity
from ..forces.magnetic_field import Field
from ..io.run_folder import CASE, read_toml


class FieldDescription(NamedTuple):
    """External magnetic field: text for display, and the flux density [T] as a function of time [s]."""

    text: str
    flux_density: Callable[[float], Sequence[float]]


def describe_field(forces: Iterable[Any]) -> FieldDescription | None:
    """Describe the sum of the external magnetic fields among `forces`.

    Returns
    -------
    FieldDescription or None
        None if there is no field, or all fields are zero.
    """
    fields = [f for f in forces if hasattr(f, "flux_density_at") and f.flux_density_size() > 0.0]
    if not fields:
        return None
    text = " + ".join(_field_text(f) if isinstance(f, Field) else f.name for f in fields)
    return FieldDescription(text, lambda time: np.sum([f.flux_density_at(time) for f in fields], axis=0))


def read_field(folder: Path) -> FieldDescription | None:
    """Describe the external magnetic field in the case file of a run folder.

    Returns
    -------
    FieldDescription or None
        None if the case has no field, or the case file is missing or invalid.
    """
    try:
        settings = read_toml(folder / CASE).get("forces", {}).get("field")
        return None if settings is None else describe_field([Field(**settings)])
    except (BadInput, TypeError, AttributeError):
        return None


def _field_text(field: Field) -> str:
    constant = format_quantity(hypot(*field.flux_density), "T")
    if ramps_of(field):
        return f"{constant} at first, {field.shape}, changing with a ramp"
    if field.shape == "constant":
        return f"{constant}, constant"
    if field.shape == "ramp":
        return (
            f"from {constant} at {format_quantity(field.start, 's')} to {format_quantity(hypot(*field.final), 'T')} at "
            + format_quantity(field.end, "s")
        )
    amplitude = format_quantity(hypot(*field.amplitude), "T")
    varying = f"{amplitude}, {field.shape} at {format_quantity(field.frequency, 'Hz')}"
    return f"{constant}, constant, and {varying}" if hypot(*field.flux_density) > 0.0 else varying
