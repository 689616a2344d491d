"""Initial state and outcome of a collision."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple

import numpy as np

from ..analysis.clusters import cluster_labels
from ..analysis.quantities import material_names
from ..analysis.shape import gyration_radius
from ..basics.grains import Grains
from ..basics.state import LOST
from ..basics.units import format_quantity
from ..simulation.simulation import Simulation

ENDS = {"stick": "they stick", "bounce": "they bounce", "fragment": "they break up", "miss": "they miss"}
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
        first = len(self.target)
        parts = [slice(first), slice(first, None)]
        centres = [np.average(self.grains.position[p], axis=0, weights=self.grains.mass[p]) for p in parts]
        offset = centres[1] - centres[0]
        flight = self.grains.velocity[-1] - self.grains.velocity[0]
        flight = flight / np.linalg.norm(flight)
        return float(np.linalg.norm(offset - (offset @ flight) * flight))

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
        "stick" (one body), "bounce" (two bodies of the same grains as before), "miss", or "fragment".
    speed, impact_parameter : float
        Initial values [m/s], [m].
    seed : int or None
        Seed of the orientations; None: as given.
    fragments : tuple of int
        Numbers of grains of the final bodies, by decreasing mass.
    largest_remnant : float
        Mass of the largest body over the total mass.
    made, moved, broken : int
        Contacts formed, slipped (steps in which a limit was exceeded), and broken.
    contacts_before, contacts_after : int
        Numbers of contacts.
    impact_energy : float
        Energy of the relative motion m̄v²/2 [J].
    lost : dict of str to float
        Energy dissipated per mechanism [J].
    gyration_before : tuple of float
        Radii of gyration of target and projectile [m].
    gyration_after : float
        Radius of gyration of the largest remnant [m].
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
    grains, row = simulation.grains, simulation.ledger.rows[-1]
    labels = cluster_labels(len(grains), simulation.contacts["pair"])
    masses = np.bincount(labels, weights=grains.mass)
    order = np.argsort(-masses, kind="stable")
    counts = np.bincount(labels)
    largest = labels == order[0]
    m1, m2 = float(target.mass.sum()), float(projectile.mass.sum())
    return Collision(
        outcome=_outcome(labels, len(target), int(row["made"])),
        speed=speed,
        impact_parameter=start.impact_parameter,
        seed=start.seed,
        fragments=tuple(int(counts[k]) for k in order),
        largest_remnant=float(masses[order[0]] / masses.sum()),
        made=int(row["made"]),
        moved=int(row["moved"]),
        broken=int(row["broken"]),
        contacts_before=before,
        contacts_after=int(row["contacts"]),
        impact_energy=0.5 * m1 * m2 / (m1 + m2) * speed**2,
        lost={name: row[f"lost_{name}"] for name in LOST},
        gyration_before=(
            gyration_radius(target.position, target.mass),
            gyration_radius(projectile.position, projectile.mass),
        ),
        gyration_after=gyration_radius(grains.position[largest], grains.mass[largest]),
        rebound=_rebound(grains, labels, order),
        time=simulation.time,
        steps=simulation.steps,
        drift=simulation.ledger.drift,
        quiet=bool(end),
        end=end or "stopped before the outcome was decided",
    )


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
