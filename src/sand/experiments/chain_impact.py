"""Impact of a grain on the end of a straight chain (Dominik & Nübold 2002, Figure 4).

The paper shows one example of a linear chain that becomes T-shaped after the fast impact of another grain, which
hit-and-stick growth cannot produce. It gives neither speed nor impact position nor size; `shape_map` shows which lead
to a T.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..analysis.clusters import cluster_labels
from ..basics.arguments import MOST_GRAINS, checked
from ..basics.errors import BadInput
from ..basics.material import Material
from ..basics.units import si, whole_number
from ..contact.model import Contact
from ..integrate.verlet import Verlet
from ..setup.aggregates import chain, rest_distance
from ..setup.encounters import combined
from ..simulation.simulation import Simulation

PERPENDICULAR = 30.0
"""Largest deviation of the crossbar of a T from perpendicular [°]."""
STRAIGHT = 20.0
"""Largest angle between neighbouring links of a straight chain [°]."""
FLIGHT = 40.0
"""Duration of a run, in units of radius over speed."""
FINE = 100.0
"""Steps per fastest period; results of fast impacts are not converged with the usual 25."""
START = 2.3
"""Initial height of the projectile above the chain's axis, in radii."""


class Shape(NamedTuple):
    """Shape of a chain after an impact."""

    name: str  # T, branched, bent, straight, ring, broken or gone
    crossbar: float  # angle between crossbar and stem [°], 90 for a perfect T; NaN without a branch
    rolled: float  # rolling angle of the struck end grain about its neighbour [°]; NaN if it broke off


@checked
def strike(
    material: Material | str,
    radius: Any,
    *,
    speed: Any,
    place: float,
    grains: int = 8,
    contact: Contact | None = None,
    stepping: Verlet | None = None,
    **options: Any,
) -> Simulation:
    """Simulate one impact: a grain moving along −y hits the end of a chain at rest along x.

    Parameters
    ----------
    material : Material or str
        Material of all grains.
    radius : float or str
        Radius r of all grains [m].
    speed : float or str
        Speed of the projectile [m/s] > 0.
    place : float
        Impact position: distance of the line of flight from the centre of the end grain in radii, positive beyond the
        end.
    grains : int, optional
        Number of grains N ≥ 4 of the chain.
    contact : Contact, optional
        Contact model.
    stepping : Verlet, optional
        Integrator; by default with `FINE` steps per period.
    **options
        Options of `Simulation` (out, observers, frame_every).

    Returns
    -------
    Simulation
        The simulation at its end.

    Raises
    ------
    BadInput
        If an argument is invalid.
    """
    r, v = si(radius, "m", "radius", above=0.0), si(speed, "m/s", "speed", above=0.0)
    if not grains >= 4:
        raise BadInput(f"grains of a chain = {grains!r}: the chain needs at least 4")
    body = chain(grains, radius=r, material=material)
    above = body.position[-1] + r * np.array([place, START, 0.0])
    projectile = chain(1, radius=r, material=material)
    both = combined([body, projectile], shifts=[np.zeros(3), above], velocities=[np.zeros(3), np.array([0.0, -v, 0.0])])
    options.setdefault("frame_every", FLIGHT * r / v)
    fine = stepping or Verlet(steps_per_period=FINE)
    simulation = Simulation(both, [contact or Contact()], stepping=fine, **options)
    simulation.run(until=FLIGHT * r / v)
    return simulation


@checked
def shape_of(simulation: Simulation) -> Shape:
    """Classify the final state of `strike`; the last grain is the projectile."""
    return shape(simulation.grains.position, simulation.contacts["pair"], len(simulation.grains) - 1)


@checked
def shape(position: np.ndarray, pairs: np.ndarray, grains: int) -> Shape:
    """Classify chain and projectile.

    "T": a node has three neighbours, the line through the ends of the two short branches deviates by at most 30° from
    perpendicular to the link of the long branch, and the struck end grain has rolled by more than 30°. "branched": any
    other node with three neighbours. "ring": a closed loop. "bent", "straight": still a chain. "broken". "gone": the
    projectile missed or separated.

    Parameters
    ----------
    position : ndarray
        (N + 1, 3) [m], projectile last.
    pairs : ndarray
        Contacts (C, 2).
    grains : int
        Number of grains N of the chain.
    """
    labels = cluster_labels(grains + 1, pairs)
    neighbours: list[list[int]] = [[] for _ in range(grains + 1)]
    for a, b in np.asarray(pairs).tolist():
        neighbours[a].append(b)
        neighbours[b].append(a)
    rolled = _rolled(position, neighbours, grains)
    if labels.max() > 0:
        whole = len(set(labels[:grains].tolist())) == 1
        return Shape("gone" if whole else "broken", np.nan, rolled)
    if len(pairs) > grains:
        return Shape("ring", np.nan, rolled)
    if max(map(len, neighbours)) > 3:
        return Shape("branched", np.nan, rolled)
    nodes = [k for k in range(grains + 1) if len(neighbours[k]) == 3]
    if not nodes:
        return Shape("straight" if _largest_bend(position[:grains]) < STRAIGHT else "bent", np.nan, rolled)
    best = max(_crossbar(position, pairs, neighbours[node], node) for node in nodes)
    is_t = best > 90.0 - PERPENDICULAR and rolled > PERPENDICULAR
    return Shape("T" if is_t else "branched", best, rolled)


@checked
def first_touch(
    material: Material | str, radius: float, place: float, grains: int = 8
) -> tuple[np.ndarray, list[list[int]]]:
    """Positions (N + 1, 3) [m] and contacts of hit-and-stick: the projectile stays at its first contact."""
    whole_number(grains, "grains", 1, MOST_GRAINS)
    pitch = rest_distance(material, radius)
    position = np.zeros((grains + 1, 3))
    position[:grains, 0] = pitch * (np.arange(grains) - (grains - 1))
    across = position[:grains, 0] - place * radius
    height = np.where(np.abs(across) < pitch, np.sqrt(np.maximum(pitch**2 - across**2, 0.0)), 0.0)
    position[grains] = [place * radius, height.max() or -10.0 * radius, 0.0]
    pairs = [[k, k + 1] for k in range(grains - 1)]
    if height.max() > 0.0:
        pairs += [[k, grains] for k in range(grains) if np.isclose(height[k], height.max(), rtol=1e-9, atol=0.0)]
    return position, pairs


@checked
def stick_at_first_touch(material: Material | str, radius: float, place: float, grains: int = 8) -> Shape:
    """Shape that results from hit-and-stick, without rolling."""
    position, pairs = first_touch(material, radius, place, grains)
    return shape(position, np.array(pairs), grains)


@checked
def shape_map(
    material: Material | str, radius: Any, speeds: Sequence[float], places: Sequence[float], **options: Any
) -> np.ndarray:
    """Names of the shapes for all speeds [m/s] and impact positions, (speeds, places); options as for `strike`."""
    return np.array(
        [[shape_of(strike(material, radius, speed=v, place=p, **options)).name for p in places] for v in speeds]
    )


def _angle(u: np.ndarray, v: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip(u @ v / np.linalg.norm(u) / np.linalg.norm(v), -1.0, 1.0))))


def _largest_bend(position: np.ndarray) -> float:
    links = np.diff(position, axis=0)
    return max(_angle(a, b) for a, b in itertools.pairwise(links))


def _rolled(position: np.ndarray, neighbours: list[list[int]], grains: int) -> float:
    """Rolling angle [°] of the end grain about its neighbour, from the line of the chain; NaN if it broke off."""
    end, last = grains - 1, grains - 2
    if last not in neighbours[end]:
        return float("nan")
    return _angle(position[end] - position[last], position[last] - position[last - 1])


def _crossbar(position: np.ndarray, pairs: np.ndarray, neighbours: list[int], node: int) -> float:
    """Angle [°], up to 90, between the stem (the longest branch) and the line through the other two neighbours."""
    branches = cluster_labels(len(position), pairs[(pairs != node).all(axis=1)])
    sizes = np.bincount(branches)
    stem = max(neighbours, key=lambda k: sizes[branches[k]])
    one, other = (k for k in neighbours if k != stem)
    lean = _angle(position[stem] - position[node], position[one] - position[other])
    return min(lean, 180.0 - lean)
