"""Diffusion-limited aggregation: particle–cluster (DLA) and cluster–cluster (DLCA)."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arguments import checked
from ..grains import Grains
from ._kernels.aggregation import grow_diffusing, place_first_grain
from ._kernels.cluster_cluster import join_diffusing
from .growing import TRIES, empty_hash_grid, halves, require_all_placed
from .moments import assign_moments
from .population import centred_grains, grain_count, population, random_streams


@checked
def dla(
    grains: int, *, radius: Any, material: Any, moment: Any = None, moments: str = "random", magnetic: Any = 1.0,
    seed: int = 0,
) -> Grains:  # fmt: skip
    """Diffusion-limited particle–cluster aggregate: grains arrive by Brownian motion and stay at first contact.

    Off-lattice walks on spheres whose radius is the gap to the nearest grain, accurate to 1e-3 of the largest radius. A
    grain that leaves the enclosing sphere returns with the probability and at the position of Brownian motion. Fractal
    dimension about 2.5. Parameters and errors as for `bpca`.

    References
    ----------
    Witten & Sander (1981), Phys. Rev. Lett. 47, 1400.
    """
    rng = random_streams(seed)
    sample = population(grain_count(grains, "grains of an aggregate"), radius, material, rng.population)
    count, grid = len(sample.radius), empty_hash_grid(sample.grain_set)
    position = np.zeros((3, count))
    place_first_grain(grid, position)
    size = float(sample.radius[0])
    done, _ = grow_diffusing(grid, position, np.zeros(count), sample.grain_set, 1, count, size, rng.positions, TRIES)
    require_all_placed(done, count, f"grain {done}")
    return assign_moments(centred_grains(position.T, sample), moment, moments, magnetic, rng.moments)


@checked
def dlca(
    grains: int, *, radius: Any, material: Any, moment: Any = None, moments: str = "random", magnetic: Any = 1.0,
    seed: int = 0,
) -> Grains:  # fmt: skip
    """Diffusion-limited cluster–cluster aggregate: recursively built halves diffuse until they touch.

    Clusters have random orientations and do not rotate while they diffuse. Fractal dimension about 1.8. Parameters and
    errors as for `bpca`.
    """
    rng = random_streams(seed)
    sample = population(grain_count(grains, "grains of an aggregate"), radius, material, rng.population)
    position, plan = np.zeros((3, len(sample.radius))), halves(0, len(sample.radius))
    joins = np.array(plan, dtype=np.int64).reshape(-1, 3).T.copy()
    spare = np.zeros_like(position), np.zeros(len(sample.radius))
    done = join_diffusing(
        empty_hash_grid(sample.grain_set), position, *spare, sample.grain_set, joins, rng.positions, TRIES
    )
    require_all_placed(done, len(plan), "a cluster")
    return assign_moments(centred_grains(position.T, sample), moment, moments, magnetic, rng.moments)
