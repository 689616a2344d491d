"""Aggregates: grains in contact at rest, to collide or to look at."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..core.errors import BadInput
from ..core.grains import Grains
from ..core.material import Material, material_named
from ..core.units import si
from ..physics.adhesion import rest_overlap, rest_radius
from ..physics.mixing import pairing_between

START = 4.0
"""Particles of `pca` start this many cluster radii away."""
TRIES = 10_000


def _of(material: Material | str) -> Material:
    return material_named(material) if isinstance(material, str) else material


def _whole(number: Any, name: str, least: int = 1) -> int:
    if isinstance(number, bool) or not isinstance(number, (int, np.integer)) or number < least:
        raise BadInput(f"{name} = {number!r} must be a whole number of at least {least}")
    return int(number)


def rest_distance(material: Material | str, radius: float) -> float:
    """Distance of the centres of two equal grains in contact at rest [m]: 2r − δ0."""
    m = _of(material)
    if not (m.surface_energy or 0.0) > 0.0:
        return 2.0 * radius
    both = pairing_between(m, m)
    return 2.0 * radius - rest_overlap(rest_radius(both.surface_energy, 0.5 * radius, both.modulus), 0.5 * radius)


def grain(*, radius: Any, material: Material | str, moment: Any = None) -> Grains:
    """A single grain at the origin."""
    return chain(1, radius=radius, material=material, moment=moment)


def chain(grains: int, *, radius: Any, material: Material | str, moment: Any = None) -> Grains:
    """A straight chain along x, contacts at rest, centred; moments point along it, head to tail.

    Args:
        grains: N ≥ 1.
        radius: r [m] > 0 of each.
        moment: size of each, as for `sand.Grains`.

    Raises:
        BadInput: a chain of length 0, a radius that is not positive.
    """
    count, r = _whole(grains, "grains of a chain"), si(radius, "m", "radius", above=0.0)
    position = np.zeros((count, 3))
    position[:, 0] = rest_distance(material, r) * (np.arange(count) - 0.5 * (count - 1))
    made = Grains(position, r, material, moment=moment)
    made.arrays.body_moment[...] = made.arrays.body_moment[[2, 0, 1]]  # from z to x
    made.arrays.moment[...] = made.arrays.body_moment
    return made


def lattice(nx: int, ny: int | None = None, nz: int | None = None, *, radius: Any, material: Material | str) -> Grains:
    """A cubic lattice of nx × ny × nz equal grains, contacts at rest, centred (a cube if only nx is given)."""
    sides = [_whole(n, "side of a lattice") for n in (nx, nx if ny is None else ny, nx if nz is None else nz)]
    r = si(radius, "m", "radius", above=0.0)
    grid = np.stack(np.meshgrid(*(np.arange(n) - 0.5 * (n - 1) for n in sides), indexing="ij"), -1)
    return Grains(rest_distance(material, r) * grid.reshape(-1, 3), r, material)


def pca(grains: int, *, radius: Any, material: Material | str, seed: int = 0) -> Grains:
    """Ballistic particle–cluster aggregation: grains fly in one by one on straight random lines and stay.

    Args:
        grains: N ≥ 1; seed: same seed, same aggregate.
    """
    count, r = _whole(grains, "grains of an aggregate"), si(radius, "m", "radius", above=0.0)
    reach = rest_distance(material, r)
    rng = np.random.default_rng(_whole(seed, "seed", 0))
    position = np.zeros((count, 3))
    for n in range(1, count):
        position[n] = _flown_in(position[:n], reach, rng)
    position -= position.mean(axis=0)
    return Grains(position, r, material)


def _flown_in(cluster: np.ndarray, reach: float, rng: np.random.Generator) -> np.ndarray:
    """Where a particle on a random straight line first comes to `reach` from a grain of the cluster."""
    middle = cluster.mean(axis=0)
    size = float(np.linalg.norm(cluster - middle, axis=1).max()) + reach
    for _ in range(TRIES):
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        aside = np.cross(direction, rng.normal(size=3))
        aside *= size * np.sqrt(rng.random()) / np.linalg.norm(aside)
        start = middle + aside - START * size * direction
        to = cluster - start
        along = to @ direction
        miss = (to**2).sum(axis=1) - along**2
        hits = miss < reach**2
        if hits.any():
            way = (along[hits] - np.sqrt(reach**2 - miss[hits])).min()
            return start + way * direction
    raise BadInput(f"no particle met the aggregate in {TRIES} tries")  # pragma: no cover


KINDS: dict[str, Any] = {"grain": grain, "chain": chain, "lattice": lattice, "pca": pca}
"""Builders by the name a case file gives them."""
