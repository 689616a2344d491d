"""Random ballistic deposits in a periodic column, and compact spherical aggregates cut from them (RBD)."""

from __future__ import annotations

import heapq
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..basics.arguments import checked
from ..basics.box import Box, least_side
from ..basics.errors import BadInput
from ..basics.grains import Grains
from ..basics.material import Material
from ..basics.units import format_quantity, si, whole_number
from ..contact.jkr import rest_overlap, rest_radius
from ._kernels.deposition import Ground, drop
from .checks import largest_cluster
from .from_frame import Start
from .growing import CELL, empty_hash_grid, require_all_placed
from .moments import assign_moments
from .population import (
    Lognormal,
    Population,
    PowerLaw,
    centred_grains,
    grain_count,
    grain_set_of,
    population,
    radii_of,
    random_streams,
)

FILLING = 0.23
"""Approximate filling factor of a deposit of equal grains with one rolling step."""
SPARE = 1.6
"""Number of grains of the first deposit, relative to the sphere."""
DOUBLINGS = 6
"""Number of deposits, each twice as large as the one before."""


@checked
def rbd(
    grains: int, *, radius: Any, material: Any, moment: Any = None, moments: str = "random", magnetic: Any = 1.0,
    seed: int = 0,
) -> Grains:  # fmt: skip
    """A compact sphere cut from a random ballistic deposit.

    Grains fall one by one onto a plane. A deposit without rolling has a filling factor of 0.15 but consists of separate
    trees, from which no connected sphere can be cut. Each grain therefore rolls once, over the grain it landed on, to
    the nearest position where it touches a second one, as in the BAM1 aggregates of Shen, Draine & Johnson (2008); the
    filling factor is then about 0.23. The sphere is the smallest one about the centre that contains a connected cluster
    of N grains; surplus grains are removed from the outside as long as the cluster stays connected.

    Parameters
    ----------
    grains, radius, material, moment, moments, magnetic, seed
        As for `bpca`, but without individual radii or materials, since most grains of the deposit are cut off.

    Raises
    ------
    BadInput
        As for `bpca`.
    """
    count, rng = grain_count(grains, "grains of an aggregate"), random_streams(seed)
    distribution = radii_of(radius)
    if isinstance(distribution, np.ndarray) or not isinstance(material, (str, Material, Mapping)):
        raise BadInput(
            "an rbd is cut from a deposit of more grains; give one radius or a distribution, and no list of materials"
        )
    for doublings in range(DOUBLINGS):
        spare = SPARE * 2**doublings
        heap, side = _deposit_grains(count, distribution, material, rng.population, spare)
        position = dropped(heap, side, heap.radius, 2, rng.positions)
        kept = cut_sphere(position, heap.radius, count)
        if len(kept):
            break
    else:
        raise BadInput(f"no deposit contained a connected cluster of {count} grains; try another seed")
    kinds = [heap.material[k] for k in kept]
    cut = Population(heap.radius[kept], kinds, grain_set_of(heap.radius[kept], kinds))
    return assign_moments(centred_grains(position[kept], cut), moment, moments, magnetic, rng.moments)


@checked
def deposit(
    grains: int, *, width: Any, radius: Any, material: Any, contacts: int = 1, moment: Any = None,
    moments: str = "random", magnetic: Any = 1.0, seed: int = 0,
) -> Start:  # fmt: skip
    """A cake: a random ballistic deposit on a floor at z = 0, in a column that is periodic along x and y.

    Grains fall along −z, one after another, and stick at the first touch of the floor or of another grain, periodic
    images included; all contacts are at the equilibrium distance. Equal grains have a filling factor of about 0.15.
    Grains that roll on after their first touch, `contacts` = 2 or 3, as in the aggregates BAM1 and BAM2 of Shen, Draine
    & Johnson (2008), make denser deposits, whose filling factors fall with height from 0.26 to 0.22 and 0.36 to 0.29.
    The cake is one body by its floor alone.

    Parameters
    ----------
    grains, radius, material, moment, moments, magnetic, seed
        As for `bpca`.
    width : float or str
        Side of the column [m]; at least two diameters of the largest grain and one of the smallest.
    contacts : int, optional
        Number of contacts to which a grain that lands on another one rolls, if it can: 1, without rolling, 2 or 3.

    Returns
    -------
    Start
        Grains, and the box, which is open along z: arguments of `sand.Simulation`.

    Raises
    ------
    BadInput
        If an argument is invalid, or the column is too narrow.
    """
    side, rng = si(width, "m", "width", above=0.0), random_streams(seed)
    most = whole_number(contacts, "contacts", 1, 3)
    cake = population(grain_count(grains, "grains of a deposit"), radius, material, rng.population)
    if side < (least := least_side(cake.radius)):
        given, needed = (format_quantity(float(f"{v:.3g}"), "m") for v in (side, least))
        raise BadInput(f"width = {given} is so narrow that grains could touch through two images; at least {needed}")
    position = dropped(cake, side, _rest_heights(cake), most, rng.positions) - [0.5 * side, 0.5 * side, 0.0]
    body = assign_moments(Grains(position, cake.radius, cake.material), moment, moments, magnetic, rng.moments)
    return Start(body, None, Box((side, side, None)), f"a ballistic deposit on a floor at z = 0, seed {seed}")


def _rest_heights(cake: Population) -> np.ndarray:
    """Heights (N,) [m] at which grains rest on a floor of their own material, in the limit of an infinite sphere."""
    of, radius = cake.grain_set, cake.radius
    own = [(of.surface_energy[k, k], of.modulus[k, k]) for k in of.material]
    return np.array(
        [r - rest_overlap(rest_radius(gamma, r, modulus), r) for r, (gamma, modulus) in zip(radius, own, strict=True)]
    )


def dropped(heap: Population, side: float, floor: np.ndarray, contacts: int, seed: np.uint64) -> np.ndarray:
    """Positions (N, 3) [m] of grains that fall on a periodic square 0 … `side`.

    Parameters
    ----------
    heap : Population
        The grains, in the order in which they fall.
    side : float
        Side of the square [m].
    floor : ndarray
        Heights (N,) at which they rest on the floor [m].
    contacts : int
        Number of contacts to which they roll.
    seed : int
        Seed of the random numbers.

    Raises
    ------
    BadInput
        If a grain finds no place.
    """
    columns, position = max(3, int(side / (CELL * heap.grain_set.largest))), np.zeros((3, len(heap.radius)))
    grid = empty_hash_grid(heap.grain_set, side / columns)
    done = drop(grid, position, heap.grain_set, Ground(side, columns, floor), contacts, seed)
    require_all_placed(done, len(heap.radius), f"grain {done} of the deposit")
    return position.T


def _deposit_grains(
    count: int, distribution: float | Lognormal | PowerLaw, material: Any, rng: np.random.Generator, spare: float
) -> tuple[Population, float]:
    """Grains of a cubic deposit of `spare` times the volume of the sphere plus a margin, and its side [m]."""
    sample = population(max(count, 100), distribution, material, rng)
    volume = 4.0 / 3.0 * math.pi * float((sample.radius**3).mean())
    side = (spare * count * volume / FILLING) ** (1.0 / 3.0) + 3.0 * CELL * sample.grain_set.largest
    return population(int(FILLING * side**3 / volume) + 10, distribution, material, rng), side


def cut_sphere(position: np.ndarray, radius: np.ndarray, count: int) -> np.ndarray:
    """Select one compact, connected cluster around the centre of a heap of grains.

    Parameters
    ----------
    position, radius : ndarray
        (M, 3) and (M,) [m] of the heap.
    count : int
        Number of grains to select.

    Returns
    -------
    ndarray
        Indices (count,); empty if no cluster is that large.
    """
    pairs = Box.open().close_pairs(position, 2.0 * float(radius.max()))
    distance = np.linalg.norm(position[pairs[:, 0]] - position[pairs[:, 1]], axis=1)
    pairs = pairs[distance < radius[pairs].sum(axis=1) * (1.0 + 1e-9)]
    centre = np.median(position[largest_cluster(pairs, len(position))], axis=0)
    order = np.argsort(np.linalg.norm(position - centre, axis=1), kind="stable")
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    bonds = rank[pairs]  # grains are numbered by their distance from the centre
    low, high = count, len(order)
    if len(largest_cluster(bonds, high)) < count:
        return np.zeros(0, dtype=np.int64)
    while low < high:  # bisection for the smallest sphere with a cluster of `count` grains
        trial = (low + high) // 2
        low, high = (low, trial) if len(largest_cluster(bonds, trial)) >= count else (trial + 1, high)
    return np.sort(order[_trimmed(bonds, largest_cluster(bonds, high), count)])


def _trimmed(bonds: np.ndarray, cluster: np.ndarray, count: int) -> np.ndarray:
    """Remove the outermost grains of a connected cluster down to `count` grains, keeping it connected."""
    neighbours: dict[int, set[int]] = {int(k): set() for k in cluster}
    for i, j in bonds[np.isin(bonds, cluster).all(axis=1)].tolist():
        neighbours[i].add(j)
        neighbours[j].add(i)
    # first grains with one contact, then those whose neighbours stay connected without them, a costly search
    ends = [-k for k, others in neighbours.items() if len(others) <= 1]
    heapq.heapify(ends)
    while len(neighbours) > count:
        removed = -heapq.heappop(ends) if ends else _dispensable(neighbours)
        for neighbour in neighbours.pop(removed):
            neighbours[neighbour].discard(removed)
            if len(neighbours[neighbour]) == 1:
                heapq.heappush(ends, -neighbour)
    return np.array(sorted(neighbours))


def _dispensable(neighbours: dict[int, set[int]]) -> int:
    """The outermost grain whose removal leaves the others connected."""
    for removed in sorted(neighbours, reverse=True):
        start = next(iter(neighbours[removed]))
        seen, front = {start, removed}, [start]
        while front:
            front = [k for i in front for k in neighbours[i] if k not in seen and not seen.add(k)]  # type: ignore[func-returns-value]
        if len(seen) == len(neighbours):
            return removed
    raise BadInput("the cluster cannot be cut to size")  # pragma: no cover
