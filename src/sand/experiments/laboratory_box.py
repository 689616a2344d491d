"""Packings in a periodic box that moves; see `laboratory`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ..basics.box import Box
from ..basics.errors import BadInput
from ..basics.units import format_quantity
from ..config.case import COMPONENTS
from ..contact.model import Contact
from ..setup.from_frame import Start

if TYPE_CHECKING:
    from .laboratory import Plan
    from .laboratory_loading import Loading

LOST = "lost_box"
"""Column of the ledger: energy [J] that the moving box took from grains and contacts."""
GAP = 0.1
"""Gap between a body and its image in the box that just holds it, in radii."""


def in_box(box: Box | None, body: Start, axes: str) -> Start:
    """A packing in a box that is periodic along these axes: that of its frame, or a body in one, given or its own.

    Raises
    ------
    BadInput
        If the frame has another box, or the body does not fit into the given one.
    """
    if not body.box.is_open:
        if box is not None:
            raise BadInput(f"box: the packing has its own, {body.box.describe()}; leave box out")
        if open_axes := [axis for axis in axes if body.box.lengths["xyz".index(axis)] is None]:
            raise BadInput(
                f"the box of the packing is open along {open_axes[0]}; it must be periodic along {', '.join(axes)}"
                + "; `sand compress`, `stretch` and `shear` load a packing that is open along z with by = 'walls'"
                * (open_axes == ["z"])
            )
        return body
    grains = body.grains.copy()
    reach = grains.radius[:, None]
    low, high = (grains.position - reach).min(axis=0), (grains.position + reach).max(axis=0)
    cube = float((high - low).max()) + GAP * float(grains.radius.mean())
    lengths: list[Any] = [cube, cube, cube] if box is None else list(box.lengths)
    for k, axis in enumerate("xyz"):
        if axis not in axes:
            lengths[k] = None
        elif lengths[k] is None:
            raise BadInput(f"box: its {axis} axis is open; give a length")
        elif lengths[k] < high[k] - low[k]:
            given, needed = (format_quantity(float(v), "m") for v in (lengths[k], high[k] - low[k]))
            raise BadInput(
                f"box: {given} along {axis} is less than the body, {needed}; give a larger box, or leave it out"
            )
    grains.arrays.position[...] -= (0.5 * (low + high))[:, None]
    return Start(grains, body.contacts, Box(tuple(lengths)), body.note)


def placed(loading: Loading, body: Start, contact: Contact) -> tuple[Start, np.ndarray]:
    """The packing in its box, and the lengths of the box."""
    start = in_box(loading.box, body, "xyz")
    return start, np.array(start.box.lengths, float)


def joined(body: Start, contact: Contact) -> np.ndarray:
    """Pairs (0, 2) of grains that are joined by more than their contacts: none."""
    return np.zeros((0, 2), np.int64)


def moved(plan: Plan, contact: Contact) -> dict[str, Any]:
    """The motion of the box, as an argument of `Simulation`."""
    if plan.loading.kind == "shear":
        return {"deformation": COMPONENTS["deformation"](shear=plan.rate)}
    sign = -1.0 if plan.loading.kind == "compress" else 1.0
    rates = [sign * plan.rate if axis in plan.loading.axes else 0.0 for axis in "xyz"]
    return {"deformation": COMPONENTS["deformation"](rates)}


def times(loading: Loading, filling: float, rate: float) -> tuple[float, float]:
    """Times of the end and between two rows [s]; sides that change do so as e^(∓rate t)."""
    number = len(loading.axes)
    if loading.kind == "compress":
        return math.log(loading.to / filling) / (number * rate), loading.every / (number * rate)
    return (loading.to if loading.kind == "shear" else math.log1p(loading.to)) / rate, loading.every / rate


def last_sides(plan: Plan) -> np.ndarray:
    """Lengths (3,) at the end [m]."""
    if plan.loading.kind == "shear":
        return plan.sides
    factor = math.exp((-1.0 if plan.loading.kind == "compress" else 1.0) * plan.rate * plan.until)
    return plan.sides * np.array([factor if axis in plan.loading.axes else 1.0 for axis in "xyz"])


def sides(plan: Plan, row: dict[str, float]) -> np.ndarray:
    """Lengths (3,) [m] at a row of the ledger."""
    return np.array([row[f"box_{axis}"] for axis in "xyz"])


def means(plan: Plan, before: dict[str, float] | None, row: dict[str, float]) -> dict[str, float]:
    """Mean stress [Pa] between two rows of the ledger: the work over the change of volume, or over V dγ in shear."""
    if before is None:
        return {"stress": math.nan}
    if plan.loading.kind == "shear":
        work = row["work_shear"] - before["work_shear"]
        return {"stress": float(work / (np.prod(plan.sides) * (row["shear"] - before["shear"])))}
    first, last = (float(np.prod(sides(plan, one))) for one in (before, row))
    return {"stress": float((before[LOST] - row[LOST]) / abs(last - first))}
