"""A grain strikes the end of a straight chain: the paper's Figure 4, and the map around it.

The paper shows one picture: a linear chain that ends T-shaped after the fast impact of another grain, which
hit-and-stick would not give.  Speed, place of impact and size are not stated; the map shows where a T arises.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..analysis.clusters import cluster_labels
from ..arguments import checked
from ..contact.model import Contact
from ..errors import BadInput
from ..integrate.verlet import Verlet
from ..material import Material
from ..setup.aggregates import chain, rest_distance
from ..setup.encounters import combined
from ..simulation.simulation import Simulation
from ..units import si

SHAPES = ("T", "branched", "bent", "straight", "ring", "broken", "gone")
PERPENDICULAR = 30.0
"""Degrees by which the crossbar of a T may lean from perpendicular to the chain."""
STRAIGHT = 20.0
"""Largest angle between neighbouring links of a chain that counts as straight [°]."""
FLIGHT = 40.0
"""Length of a run, in times the projectile needs for one grain radius."""
FINE = 100.0
"""Steps per fastest period: released displacements and the fate of a fast impact need more than the usual 25."""
START = 2.3
"""Height at which the projectile starts, in radii above the chain's axis."""


class Shape(NamedTuple):
    """What a struck chain has become."""

    name: str  # one of SHAPES
    crossbar: float  # angle between crossbar and stem [°], 90 for a perfect T; nan without a branch
    rolled: float  # how far the struck end grain went round its neighbour [°]; nan if it broke off


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
    """Run one impact: a chain at rest along x, a grain flying along −y onto its end.

    Parameters
    ----------
    radius
        r [m] of all grains; speed: [m/s] > 0.
    place : float
        where the projectile's line of flight crosses the chain, in radii from the centre of the end grain,
        positive beyond the end.
    grains : int, optional
        N ≥ 4 of the chain.
    options
        passed on to `Simulation` (out, observers, frame_every).

    Raises
    ------
    BadInput
        numbers out of range.
    """
    r, v = si(radius, "m", "radius", above=0.0), si(speed, "m/s", "speed", above=0.0)
    if not grains >= 4:
        raise BadInput(f"grains of a chain = {grains!r}: a struck chain needs at least 4")
    body = chain(grains, radius=r, material=material)
    above = body.position[-1] + r * np.array([place, START, 0.0])
    projectile = chain(1, radius=r, material=material)
    met = combined([body, projectile], shifts=[np.zeros(3), above], velocities=[np.zeros(3), np.array([0.0, -v, 0.0])])
    options.setdefault("frame_every", FLIGHT * r / v)
    fine = stepping or Verlet(steps_per_period=FINE)
    simulation = Simulation(met, [contact or Contact()], stepping=fine, **options)
    simulation.run(until=FLIGHT * r / v)
    return simulation


@checked
def shape_of(simulation: Simulation) -> Shape:
    """What the chain of `strike` has become; the last grain is the projectile."""
    return shape(simulation.grains.position, simulation.contacts["pair"], len(simulation.grains) - 1)


@checked
def shape(position: np.ndarray, pairs: np.ndarray, grains: int) -> Shape:
    """Classify chain and projectile.

    "T": a node with three neighbours, and the line between the two ends of its short branches stands within 30° of
    perpendicular to the link to the long branch, the struck end grain having rolled by more than 30°; "branched":
    any other node of three; "ring": a closed loop; "bent" and "straight": a chain still; "broken"; "gone": the
    projectile missed or left again.

    Parameters
    ----------
    position : ndarray
        (N + 1, 3) [m], the projectile last; pairs: (C, 2) contacts; grains: N of the chain.
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
    leans = [_crossbar(position, neighbours, node) for node in nodes]
    best = max(leans)
    is_t = best > 90.0 - PERPENDICULAR and rolled > PERPENDICULAR
    return Shape("T" if is_t else "branched", best, rolled)


@checked
def first_touch(
    material: Material | str, radius: float, place: float, grains: int = 8
) -> tuple[np.ndarray, list[list[int]]]:
    """Positions (N + 1, 3) [m] and contacts of the same impact with sticking at the first touch: hit-and-stick."""
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
    """What hit-and-stick makes of the same impact: nothing rolls."""
    position, pairs = first_touch(material, radius, place, grains)
    return shape(position, np.array(pairs), grains)


@checked
def shape_map(
    material: Material | str, radius: Any, speeds: Sequence[float], places: Sequence[float], **options: Any
) -> np.ndarray:
    """Names of the shapes for every speed [m/s] and place, (speeds, places); options as for `strike`."""
    return np.array(
        [[shape_of(strike(material, radius, speed=v, place=p, **options)).name for p in places] for v in speeds]
    )


def _angle(u: np.ndarray, v: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip(u @ v / np.linalg.norm(u) / np.linalg.norm(v), -1.0, 1.0))))


def _largest_bend(position: np.ndarray) -> float:
    links = np.diff(position, axis=0)
    return max(_angle(a, b) for a, b in itertools.pairwise(links))


def _rolled(position: np.ndarray, neighbours: list[list[int]], grains: int) -> float:
    """Angle [°] by which the end grain left the line of the chain, about its neighbour."""
    end, last = grains - 1, grains - 2
    if last not in neighbours[end]:
        return float("nan")
    return _angle(position[end] - position[last], position[last] - position[last - 1])


def _crossbar(position: np.ndarray, neighbours: list[list[int]], node: int) -> float:
    """Angle [°], up to 90, between the stem (the longest branch) and the line through the two other neighbours."""
    stem = max(neighbours[node], key=lambda k: _branch(neighbours, node, k))
    one, other = (k for k in neighbours[node] if k != stem)
    lean = _angle(position[stem] - position[node], position[one] - position[other])
    return min(lean, 180.0 - lean)


def _branch(neighbours: list[list[int]], node: int, start: int) -> int:
    """Number of grains beyond `start`, seen from `node`."""
    seen, queue = {node, start}, [start]
    while queue:
        for k in neighbours[queue.pop()]:
            if k not in seen:
                seen.add(k)
                queue.append(k)
    return len(seen) - 1
