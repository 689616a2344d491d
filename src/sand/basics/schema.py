"""Table of the per-grain quantities, the source of storage, validation, file layout, labels and reference."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .errors import BadInput
from .units import in_unit, not_a_quantity, too_large


class GrainField(NamedTuple):
    """Description of one per-grain quantity."""

    name: str
    width: int  # numbers per grain
    unit: str
    # "fixed": constant; "moving": integrated in time; "load": computed from the others
    kind: str
    meaning: str
    symbol: str


FIELDS = (
    GrainField("radius", 1, "m", "fixed", "radius of the sphere", "r"),
    GrainField("mass", 1, "kg", "fixed", "mass", "m"),
    GrainField("inertia", 1, "kg m^2", "fixed", "moment of inertia, (2/5) m r²", "I"),
    GrainField("charge", 1, "C", "fixed", "electric charge", "q"),
    GrainField("body_moment", 3, "A m^2", "fixed", "magnetic moment in the frame of the grain", "μ_body"),
    GrainField("position", 3, "m", "moving", "centre, laboratory frame", "r"),
    GrainField("velocity", 3, "m/s", "moving", "velocity of the centre, laboratory frame", "v"),
    GrainField("orientation", 4, "1", "moving", "rotation parameters, vector 1..3 then scalar 4", "ϱ"),
    GrainField("spin", 3, "rad/s", "moving", "angular velocity, laboratory frame", "ω"),
    GrainField("moment", 3, "A m^2", "load", "magnetic moment, laboratory frame", "μ"),
    GrainField("force", 3, "N", "load", "sum of all forces, laboratory frame", "F"),
    GrainField("torque", 3, "N m", "load", "sum of all torques, laboratory frame", "M"),
    GrainField("field", 3, "T", "load", "flux density at the centre from the other grains", "B"),
)

BY_NAME = {field.name: field for field in FIELDS}
CHANGEABLE = ("velocity", "spin", "moment", "charge")
"""Quantities that `Simulation.change` can change."""
REST = "at_rest"
"""Name of the array of a frame that says which grains belong to clusters at rest."""
MODES = ("stretch", "slide", "roll", "twist")
"""Modes of a contact: columns of `share` of a frame."""


def public(array: np.ndarray) -> np.ndarray:
    """Read-only view in public shape: (N,) or (N, width)."""
    view = array.T if array.ndim == 2 else array.view()
    view.flags.writeable = False
    return view


def stored(field: GrainField, values: Any, count: int, *, positive: bool = False, called: str = "") -> np.ndarray:
    """Convert values of a quantity to an array of stored shape, (N,) or (width, N).

    Parameters
    ----------
    field : GrainField
        Quantity to convert to.
    values : array_like or str or quantity
        SI numbers, text with a unit, or a quantity. One value (width 1) or one vector (width 3) applies to all grains.
    count : int
        Number of grains N.
    positive : bool, optional
        Require all numbers to be above 0.
    called : str, optional
        Name for messages, if it is not the name of the field.

    Returns
    -------
    ndarray
        New contiguous array.

    Raises
    ------
    BadInput
        If the unit or the shape is wrong, or a value is not finite; names the first such grain.
    """
    name = called or field.name
    array = in_unit(values, field.unit)
    if array is None:
        raise not_a_quantity(values, field.unit, name)
    array = np.asarray(array, dtype=np.float64)
    if array.ndim == 0 and field.width == 1:
        array = np.full(count, float(array))
    if field.width == 3 and array.shape == (3,):
        array = np.tile(array, (count, 1))
    shape = (count,) if field.width == 1 else (count, field.width)
    if array.shape != shape:
        raise BadInput(
            f"{name} has shape {array.shape} but must be {shape} for {count} grains"
            f"{', or three numbers for all' if field.width == 3 else ''} ({field.meaning}, in {field.unit})"
        )
    rows = array.reshape(count, -1)
    bad = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if bad.size:
        raise BadInput(
            f"{name} of grain {bad[0]} is {array[bad[0]]}: numbers must be finite, in {field.unit}"
            f" ({bad.size} of {count} grains affected)"
        )
    if field.kind != "own" and (reason := too_large(float(np.abs(rows).max()), field.unit)):
        large = int(np.abs(rows).max(axis=1).argmax())
        raise BadInput(f"{name} of grain {large} is {array[large]}, {reason}")
    if positive and (low := np.flatnonzero(~(rows > 0.0).all(axis=1))).size:
        raise BadInput(f"{name} of grain {low[0]} is {array[low[0]]:g} {field.unit}: it must be above 0")
    return np.array(array.T, order="C")
