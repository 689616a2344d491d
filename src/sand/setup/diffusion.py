"""Aggregates from diffusion: particle–cluster (DLA) and cluster–cluster (DLCA)."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arguments import checked
from ..grains import Grains
from ._kernels.aggregation import begin_hash_grid, grow_diffusing
from ._kernels.cluster_cluster import join_diffusing
from .ballistic import ADVICE
from .growing import TRIES, halves, require_all_placed, room
from .moments import magnetised
from .population import centred_grains, population, streams, whole


@checked
def dla(
    grains: int, *, radius: Any, material: Any, moment: Any = None, moments: str = "random", magnetic: Any = 1.0,
    seed: int = 0,
) -> Grains:  # fmt: skip
    """Diffusion-limited particle–cluster aggregate (Witten & Sander 1981): grains diffuse in one by one and stay.

    Off-lattice: each walk is exact to 1e-3 of the largest radius, on spheres that reach to the nearest grain; a grain
    that leaves comes back where Brownian motion would, or never.  Fractal dimension about 2.5.  Arguments and errors as
    for `bpca`.
    """
    chance = streams(seed)
    made = population(whole(grains, "grains of an aggregate"), radius, material, chance.population)
    count, crowd = len(made.radius), room(made.grain_set)
    position = np.zeros((3, count))
    begin_hash_grid(crowd, position)
    size = float(made.radius[0])
    done, _ = grow_diffusing(crowd, position, np.zeros(count), made.grain_set, 1, count, size, chance.places, TRIES)
    require_all_placed(done, count, f"grain {done}", ADVICE)
    return magnetised(centred_grains(position.T, made), moment, moments, magnetic, chance.moments)


@checked
def dlca(
    grains: int, *, radius: Any, material: Any, moment: Any = None, moments: str = "random", magnetic: Any = 1.0,
    seed: int = 0,
) -> Grains:  # fmt: skip
    """Diffusion-limited cluster–cluster aggregate: halves, made the same way, diffuse until they touch.

    Clusters are turned at random before they meet and do not turn on their way.  Fractal dimension about 1.8.
    Arguments and errors as for `bpca`.
    """
    chance = streams(seed)
    made = population(whole(grains, "grains of an aggregate"), radius, material, chance.population)
    position, plan = np.zeros((3, len(made.radius))), halves(0, len(made.radius))
    joins = np.array(plan, dtype=np.int64).reshape(-1, 3).T.copy()
    spare = np.zeros_like(position), np.zeros(len(made.radius))
    done = join_diffusing(room(made.grain_set), position, *spare, made.grain_set, joins, chance.places, TRIES)
    require_all_placed(done, len(plan), "a cluster", ADVICE)
    return magnetised(centred_grains(position.T, made), moment, moments, magnetic, chance.moments)
