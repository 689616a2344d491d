"""Packings between two walls: a floor at rest, and a lid that moves; see `laboratory`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..basics.errors import BadInput
from ..config.wall_section import WallSection
from ..contact.model import Contact
from ..setup.from_frame import Start
from .laboratory_box import in_box

if TYPE_CHECKING:
    from .laboratory import Loading, Plan

FLOOR, LID = "floor", "lid"
LOST = "lost_walls"
"""Column of the ledger: energy [J] that the moving lid took from grains and contacts."""


def placed(loading: Loading, body: Start, contact: Contact) -> tuple[Start, np.ndarray]:
    """The packing in a box that is open along z, and the lengths of the box, along z the distance of the walls."""
    if not body.box.is_open and body.box.lengths[2] is not None:
        raise BadInput(
            "by = 'walls': the frame is periodic along z, where the walls are; start from a body, or between walls"
        )
    start = in_box(loading.box, body, "xy")
    low, high = _planes(start, contact)
    return start, np.array([*start.box.lengths[:2], high - low])


def _planes(start: Start, contact: Contact) -> tuple[float, float]:
    """Heights of floor and lid [m]: where the outermost grains are at rest on them."""
    grains, law = start.grains, contact.contact_law
    height, radius = grains.position[:, 2], grains.radius
    found = []
    for side in (-1.0, 1.0):
        k = int((side * height + radius).argmax())
        material = grains.materials[int(grains.material[k])]
        pairing = contact.pairing(material, material)
        rest = law.normal_mode(pairing.surface_energy, pairing.modulus, float(radius[k])).rest_overlap
        found.append(float(height[k] + side * (radius[k] - rest)))
    return found[0], found[1]


def moved(plan: Plan, contact: Contact) -> dict[str, Any]:
    """The walls, as an argument of `Simulation`."""
    grains, loading = plan.start.grains, plan.loading
    material = grains.materials[int(grains.material[0])]
    low, high = _planes(plan.start, contact)
    speed = plan.rate * float(plan.sides[2])
    velocity = {"compress": (0.0, 0.0, -speed), "stretch": (0.0, 0.0, speed), "shear": (speed, 0.0, 0.0)}[loading.kind]
    both = {"material": material.name}
    floor = both | {"name": FLOOR, "point": [0.0, 0.0, low], "normal": [0, 0, 1]}
    lid = both | {"name": LID, "point": [0.0, 0.0, high], "normal": [0, 0, -1], "velocity": velocity}
    return {"walls": [WallSection.model_validate(one).build({material.name: material}) for one in (floor, lid)]}


def times(loading: Loading, filling: float, rate: float) -> tuple[float, float]:
    """Times of the end and between two rows [s]; the lid of a compressed packing is at L₀(1 − rate t)."""
    if loading.kind == "compress":
        left = filling / loading.to
        return (1.0 - left) / rate, loading.every * left / rate
    return loading.to / rate, loading.every / rate


def last_sides(plan: Plan) -> np.ndarray:
    """Lengths (3,) at the end [m]."""
    loading, change = plan.loading, plan.rate * plan.until
    factor = {"compress": 1.0 - change, "stretch": 1.0 + change, "shear": 1.0}[loading.kind]
    return plan.sides * np.array([1.0, 1.0, factor])


def sides(plan: Plan, row: dict[str, float]) -> np.ndarray:
    """Lengths (3,) [m] at a row of the ledger."""
    # positions are those along the normals, which point to the grains
    gap = -(row[f"{FLOOR}_position"] + row[f"{LID}_position"])
    return np.array([*plan.sides[:2], gap])


def stress(plan: Plan, before: dict[str, float], row: dict[str, float]) -> float:
    """Mean stress [Pa] between two rows of the ledger: the work of the lid over its area and the distance moved."""
    distance = plan.rate * float(plan.sides[2]) * (row["time"] - before["time"])
    return float((before[LOST] - row[LOST]) / (plan.sides[0] * plan.sides[1] * distance))
