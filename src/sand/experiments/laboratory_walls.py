"""Packings between two walls: a floor at rest, and a lid that moves; see `laboratory`."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ..basics.errors import BadInput
from ..basics.grains import ROUNDED
from ..basics.ramps import Ramp
from ..config.wall_section import WallSection
from ..contact.model import Contact
from ..setup.from_frame import Start
from .laboratory_box import in_box

if TYPE_CHECKING:
    from .laboratory import Plan
    from .laboratory_loading import Loading

FLOOR, LID = "floor", "lid"
FACTOR = 1.05
"""Largest ratio of the pressures at two points of the ramp of a load that grows exponentially."""
CHANGES = 20
"""Changes of the load between two of these points."""


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


def joined(body: Start, contact: Contact) -> np.ndarray:
    """Pairs (K, 2) of grains that floor or lid join: of a frame, whose contacts with walls are unknown, all grains."""
    height, radius = body.grains.position[:, 2], body.grains.radius
    if body.contacts is not None:
        found = [np.arange(len(radius))]
    else:
        low, high = _planes(body, contact)
        gaps = (height - radius - low, high - height - radius)
        found = [np.flatnonzero(gap < ROUNDED * radius) for gap in gaps]
    return np.concatenate([np.column_stack([np.full(len(on), on[0]), on]) for on in found])


def load_on_lid(plan: Plan) -> dict[str, Any]:
    """Mass of a lid on which a pressure acts, that of all grains, and force [N], constant or a ramp."""
    loads, area = plan.loading.pressure, float(plan.sides[0] * plan.sides[1])
    if loads is None:
        return {}
    force: Any = loads[0] * area
    if len(loads) > 1:
        given, ends = np.log(loads), np.linspace(0.0, plan.until, len(loads))
        points = max(2, math.ceil(float(np.abs(np.diff(given)).max()) / math.log(FACTOR)))
        times = np.unique(np.concatenate([np.linspace(a, b, points) for a, b in itertools.pairwise(ends)]))
        force = Ramp((area * np.exp(np.interp(times, ends, given))).tolist(), times.tolist(), CHANGES)
    return {"mass": math.fsum(plan.start.grains.mass), "force": force}


def moved(plan: Plan, contact: Contact) -> dict[str, Any]:
    """The walls, as an argument of `Simulation`."""
    grains, loading = plan.start.grains, plan.loading
    material = grains.materials[int(grains.material[0])]
    low, high = _planes(plan.start, contact)
    speed = 0.0 if loading.load_is_given else plan.rate * float(plan.sides[2])
    velocity = {"compress": (0.0, 0.0, -speed), "stretch": (0.0, 0.0, speed), "shear": (speed, 0.0, 0.0)}[loading.kind]
    both = {"material": material.name}
    floor = both | {"name": FLOOR, "point": [0.0, 0.0, low], "normal": [0, 0, 1]}
    lid = both | {"name": LID, "point": [0.0, 0.0, high], "normal": [0, 0, -1], "velocity": velocity}
    lid |= load_on_lid(plan)
    return {"walls": [WallSection.model_validate(one).build({material.name: material}) for one in (floor, lid)]}


def times(loading: Loading, filling: float, rate: float) -> tuple[float, float]:
    """Times of the end and between two rows [s]; the lid of a compressed packing is at L₀(1 − rate t)."""
    if loading.load_is_given:
        return loading.until, loading.every * loading.until
    if loading.kind == "compress":
        left = filling / loading.to
        return (1.0 - left) / rate, loading.every * left / rate
    return loading.to / rate, loading.every / rate


def last_sides(plan: Plan) -> np.ndarray:
    """Lengths (3,) at the end [m]; with a given load those of the start."""
    loading, change = plan.loading, 0.0 if plan.loading.load_is_given else plan.rate * plan.until
    factor = {"compress": 1.0 - change, "stretch": 1.0 + change, "shear": 1.0}[loading.kind]
    return plan.sides * np.array([1.0, 1.0, factor])


def sides(plan: Plan, row: dict[str, float]) -> np.ndarray:
    """Lengths (3,) [m] at a row of the ledger."""
    # positions are those along the normals, which point to the grains
    gap = -(row[f"{FLOOR}_position"] + row[f"{LID}_position"])
    return np.array([*plan.sides[:2], gap])


def means(plan: Plan, before: dict[str, float] | None, row: dict[str, float]) -> dict[str, float]:
    """Means [Pa] between two rows of the ledger, from the impulses of the grains on the walls over area and time.

    The stress, positive if it opposes the motion of the lid, and the pressures on floor and lid.
    """
    found = dict.fromkeys(("stress", "mean_pressure_floor", "mean_pressure_lid"), math.nan)
    if before is None:
        return found
    unit = float(plan.sides[0] * plan.sides[1]) * (row["time"] - before["time"])

    def mean(wall: str, axis: str) -> float:
        return (row[f"{wall}_impulse_{axis}"] - before[f"{wall}_impulse_{axis}"]) / unit

    floor, lid = -mean(FLOOR, "z"), mean(LID, "z")
    stress = {"compress": lid, "stretch": -lid, "shear": -mean(LID, "x")}[plan.loading.kind]
    return dict(zip(found, (stress, floor, lid), strict=True))
