"""Initial state and outcome of a collision."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple

import numpy as np

from ..analysis.clusters import cluster_labels
from ..analysis.collision_kinds import UNDECIDED, collision_kind, growth_efficiency
from ..analysis.quantities import material_names
from ..analysis.shape import coordination, filling_factor, gyration_radius
from ..basics.box import Box
from ..basics.grains import Grains
from ..basics.state import LOST
from ..basics.units import format_quantity
from ..setup.encounters import outer_radius
from ..simulation.simulation import Simulation
from .settled import strength_of

ENDS = {
    "stick": "they stick",
    "bounce": "they bounce",
    "fragment": "they break up",
    "miss": "they miss",
    UNDECIDED: "no contact yet",
}
"""Outcomes in words."""
ROUNDING = 1e-15
"""Impact parameter [m] below which it is one of rounding."""


class Approach(NamedTuple):
    """Two bodies on a collision course before contact."""

    target: Grains
    projectile: Grains
    grains: Grains  # grains of both, target first
    flight: float  # approximate time of the earliest possible contact [s]
    speed: float  # [m/s]
    seed: int | None

    @property
    def impact_parameter(self) -> float:
        """Distance of the centres of mass perpendicular to the flight [m]."""
        offset, _ = self._apart(self.grains)
        flight = self.grains.velocity[-1] - self.grains.velocity[0]
        flight = flight / np.linalg.norm(flight)
        return float(np.linalg.norm(offset - (offset @ flight) * flight))

    def has_parted(self, grains: Grains) -> bool:
        """Whether target and projectile, at later places of the grains, recede and are farther apart than here."""
        (before, _), (now, velocity) = (self._apart(each) for each in (self.grains, grains))
        return bool(now @ velocity > 0.0 and now @ now > before @ before)

    def _apart(self, grains: Grains) -> tuple[np.ndarray, np.ndarray]:
        """Separation [m] and relative velocity [m/s] of the centres of mass."""
        first = len(self.target)
        parts = [slice(first), slice(first, None)]
        target, projectile = (
            [np.average(values[p], axis=0, weights=grains.mass[p]) for values in (grains.position, grains.velocity)]
            for p in parts
        )
        return projectile[0] - target[0], projectile[1] - target[1]

    @property
    def reach(self) -> float:
        """Sum of the outer radii of both bodies [m], beyond which no impact parameter can hit."""
        return outer_radius(self.target) + outer_radius(self.projectile)

    def bodies(self) -> str:
        """The bodies in words, such as '64 + 3 grains of silica'."""
        names = [", ".join(material_names(body)) for body in (self.target, self.projectile)]
        first, second = len(self.target), len(self.projectile)
        if names[0] == names[1]:
            return f"{first} + {second} grains of {names[0]}"
        return " + ".join(f"{n} grain{'s' * (n > 1)} of {m}" for n, m in zip((first, second), names, strict=True))

    @property
    def unit_of_time(self) -> float:
        """Unit of the times of a collision [s]: 0.1 r/v of the smallest grain, a twentieth of the time of its diameter.

        At least 30 sound crossing times of its radius.
        """
        smallest = float(self.grains.radius.min())
        sound = max(math.sqrt(m.density / m.young_modulus) for m in self.grains.materials)
        return max(0.1 * smallest / self.speed, 30.0 * smallest * sound)


@dataclass(frozen=True)
class Collision:
    """Outcome of one collision; SI.

    Attributes
    ----------
    outcome : str
        "stick" (one body), "bounce" (two bodies of the same grains as before), "miss" (no contact formed),
        "undecided" (none formed until the end, but one still may), or "fragment" (all else).
    kind : str
        One of `analysis.collision_kinds.KINDS`, by the masses of the fragments.
    speed : float
        Initial relative speed [m/s].
    impact_parameter : float
        Initial distance of the lines of flight [m].
    seed : int or None
        Seed of the orientations; None: as given.
    fragments : tuple of int
        Numbers of grains of the final bodies, by decreasing mass.
    largest_remnant, second_remnant : float
        Masses of the largest and the second largest body over the total mass.
    growth_efficiency : float
        f = (M_largest − M_target)/M_projectile, see `analysis.collision_kinds.growth_efficiency`.
    reach : float
        Sum of the outer radii of both bodies [m].
    grains_before : tuple of int
        Numbers of grains of target and projectile.
    made, moved, broken : int
        Contacts formed, slipped (steps in which a limit was exceeded), and broken.
    contacts_before, contacts_after : int
        Numbers of contacts.
    impact_energy : float
        Energy of the relative motion m̄v²/2 [J].
    lost : dict of str to float
        Energy dissipated per mechanism [J].
    break_energy, roll_energy : float
        E_break, and E_roll = 12π²γRξ_c, of a contact [J]: means over the initial contacts, or of one between the
        bodies where there are none.
    gyration_before : tuple of float
        Radii of gyration of target and projectile [m].
    gyration_after : float
        Radius of gyration of the largest remnant [m].
    filling_before, filling_after, coordination_before, coordination_after : tuple of float, float
        Filling factors and mean numbers of contacts of a grain, of the same bodies.
    rebound : float
        Final relative speed of the two largest bodies [m/s], 0 for a single body.
    time : float
        Simulated time [s].
    steps : int
        Number of steps.
    drift : float
        Relative energy error of the ledger.
    quiet : bool
        False if the simulation was stopped before its outcome was decided.
    end : str
        Why the simulation ended.
    """

    outcome: str
    speed: float
    impact_parameter: float
    seed: int | None
    fragments: tuple[int, ...]
    largest_remnant: float
    made: int
    moved: int
    broken: int
    contacts_before: int
    contacts_after: int
    impact_energy: float
    lost: dict[str, float] = field(hash=False)
    gyration_before: tuple[float, float] = (0.0, 0.0)
    gyration_after: float = 0.0
    rebound: float = 0.0
    time: float = 0.0
    steps: int = 0
    drift: float = 0.0
    quiet: bool = True
    end: str = ""
    kind: str = ""
    second_remnant: float = 0.0
    growth_efficiency: float = 0.0
    reach: float = 0.0
    grains_before: tuple[int, int] = (0, 0)
    break_energy: float = 0.0
    roll_energy: float = 0.0
    filling_before: tuple[float, float] = (0.0, 0.0)
    filling_after: float = 0.0
    coordination_before: tuple[float, float] = (0.0, 0.0)
    coordination_after: float = 0.0

    def to_dict(self) -> dict[str, Any]:
        """Dictionary for JSON."""
        return asdict(self)


def collision_title(results: Sequence[dict[str, Any]], bodies: str) -> str:
    """Title of a figure: number of collisions, bodies, speed, impact parameter, and the outcome if there is one.

    Parameters
    ----------
    results : sequence of dict
        Outcomes as dictionaries, see `Collision.to_dict`.
    bodies : str
        The bodies in words, see `Approach.bodies`.
    """
    offsets = [r["impact_parameter"] for r in results]
    low, high = (format_quantity(float(f"{value:.3g}"), "m") for value in (min(offsets), max(offsets)))
    offset = f"impact parameter {low if low == high else f'{low} to {high}'}" if max(offsets) > ROUNDING else "head-on"
    what = f"Collision of {bodies}" if len(results) == 1 else f"{len(results)} collisions of {bodies}"
    end = f": {ENDS[results[0]['outcome']]}" if len(results) == 1 else ""
    text = f"{what} at {format_quantity(results[0]['speed'], 'm/s')}, {offset}{end}"
    return text.replace(" um", " µm")


def classify_collision(simulation: Simulation, start: Approach, before: int, end: str) -> Collision:
    """Classify the outcome of a collision and measure the final bodies.

    Parameters
    ----------
    simulation : Simulation
        Simulation at its end.
    start : Approach
        Initial state.
    before : int
        Initial number of contacts.
    end : str
        Why the simulation ended; "" if it was stopped before its outcome was decided.
    """
    target, projectile, speed = start.target, start.projectile, start.speed
    grains, row, pairs = simulation.grains, simulation.ledger.rows[-1], simulation.contacts["pair"].astype(np.int64)
    labels = cluster_labels(len(grains), pairs)
    masses = np.bincount(labels, weights=grains.mass)
    order = np.argsort(-masses, kind="stable")
    counts = np.bincount(labels)
    largest, heaviest = labels == order[0], masses[order[:2]].tolist()
    m1, m2 = float(target.mass.sum()), float(projectile.mass.sum())
    equal = np.ptp(grains.mass) == 0.0  # numbers of grains are exact: 1 where bodies stick, 0 where they miss
    sizes = (len(target), len(projectile), int(counts[order[0]])) if equal else (m1, m2, heaviest[0])
    made, broken, bodies = int(row["made"]), int(row["broken"]), (target, projectile)
    touching = [body.touching(Box.open())[0] for body in bodies]
    joined = np.vstack((touching[0], touching[1] + len(target)))
    strength: Any = strength_of(simulation, joined if len(joined) else np.array([[0, len(target)]]))
    per_grain = coordination(len(grains), pairs)
    return Collision(
        outcome=_outcome(labels, len(target), made) if made or end else UNDECIDED,
        kind=collision_kind(
            m1,
            m2,
            masses.tolist(),
            max(made - 1 + broken, 0) / max(before, 1),
            touched=made > 0 if made or end else None,
        ),
        speed=speed,
        impact_parameter=start.impact_parameter,
        reach=start.reach,
        seed=start.seed,
        fragments=tuple(int(counts[k]) for k in order),
        grains_before=(len(target), len(projectile)),
        largest_remnant=float(masses[order[0]] / masses.sum()),
        second_remnant=float([*heaviest, 0.0][1] / masses.sum()),
        growth_efficiency=growth_efficiency(*sizes),
        made=made,
        moved=int(row["moved"]),
        broken=broken,
        contacts_before=before,
        contacts_after=int(row["contacts"]),
        impact_energy=0.5 * m1 * m2 / (m1 + m2) * speed**2,
        break_energy=float(strength.breaking.mean()),
        roll_energy=math.pi * float(strength.rolling.mean()),
        lost={name: row[f"lost_{name}"] for name in LOST},
        gyration_before=_pair(gyration_radius(body.position, body.mass) for body in bodies),
        gyration_after=gyration_radius(grains.position[largest], grains.mass[largest]),
        filling_before=_pair(filling_factor(body.position, body.radius, body.mass) for body in bodies),
        filling_after=filling_factor(grains.position[largest], grains.radius[largest], grains.mass[largest]),
        coordination_before=_pair(2.0 * len(own) / len(body) for own, body in zip(touching, bodies, strict=True)),
        coordination_after=float(per_grain[largest].mean()),
        rebound=_rebound(grains, labels, order),
        time=simulation.time,
        steps=simulation.steps,
        drift=simulation.ledger.drift,
        quiet=bool(end),
        end=end or "stopped before the outcome was decided",
    )


def _pair(values: Iterable[float]) -> tuple[float, float]:
    one, other = values
    return one, other


def _outcome(labels: np.ndarray, first: int, made: int) -> str:
    if not labels.any():
        return "stick"
    if (labels != (np.arange(len(labels)) >= first)).any():  # target 0 and projectile 1, as they were
        return "fragment"
    return "bounce" if made else "miss"


def _rebound(grains: Grains, labels: np.ndarray, order: np.ndarray) -> float:
    if len(order) < 2:
        return 0.0
    mean = [np.average(grains.velocity[labels == k], axis=0, weights=grains.mass[labels == k]) for k in order[:2]]
    return float(np.linalg.norm(mean[0] - mean[1]))
