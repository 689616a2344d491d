"""How awake clusters become bodies: whether they are the same as before, whether they fit, and what becomes of them."""

from __future__ import annotations

import numpy as np

from ...basics.state import QUIETING, RESTED, State
from ...integrate.rigid.awake_clusters import store_rest
from ..engine import Engine
from .cluster_bodies import body_number, describe_body, rest_cluster, set_friction
from .rigid_loads import rest_with_loads

SPANS = (
    "a cluster spans half of the box or more, and acts on itself through the images of the box: it is not moved as a "
    "rigid body, and takes contact steps all the time; use a larger box"
)


def rename_clusters(state: State, grains: np.ndarray, firsts: np.ndarray) -> np.ndarray:
    """New first grains of the clusters of the awake grains, after contacts formed or broke.

    Returns whether the cluster of each awake grain has other grains than before.
    """
    bodies, n = state.bodies, len(state.grains)
    before = bodies.first[grains]
    # a cluster is the same if all of its grains had its first grain, and no other grain had
    other = np.bincount(firsts, before != firsts, n) + np.bincount(before, before != firsts, n)
    changed = other[firsts] > 0
    bodies.event[firsts[changed]] = bodies.vibration[firsts[changed]] = state.time
    bodies.first[grains] = firsts
    return changed


def fits_in_box(engine: Engine, offset: np.ndarray) -> bool:
    """Whether a cluster extends over less than half of the box along each periodic axis.

    Larger ones stay awake, with a warning: their grains may act on each other through the images of the box.
    `offset` (3, n): vectors of its grains from its centre of mass [m].
    """
    extent = offset.max(axis=1) - offset.min(axis=1)
    lengths = engine.regular_state.box.lengths
    fits = all(side is None or size < 0.5 * side for size, side in zip(extent, lengths, strict=True))
    if not fits and SPANS not in engine.warnings:
        engine.warnings.append(SPANS)
    return fits


def rest_as_body(engine: Engine, index: np.ndarray, offset: np.ndarray, strain: float, strength: np.ndarray) -> None:
    """Make a body of the grains of a cluster, at vectors `offset` from its centre of mass.

    `strain` and `strength` are those of `ClusterMeasures`.
    """
    state, first = engine.regular_state, int(index[0])
    describe_body(state, index, offset)
    state.lost[QUIETING] += rest_cluster(state, index)
    rest_with_loads(state, first, strain)
    state.bodies.strength[:, first] = strength
    store_rest.run(engine.table_of(state), (), body_number(state, first))
    if engine.parameters.gas.gas.on:
        set_friction(state, engine.parameters.gas.gas, index)
    state.count[RESTED] += 1
