"""Loads of the contacts of clusters at rest: whether a cluster may stay at rest, or has to wake."""

from __future__ import annotations

import numpy as np

from ...basics.state import CONTACTS, State
from ...compiler.table import Table
from ...contact.law import ContactLaw
from ...contact.static_loads import ROWS, responses, responses_stage, shares_of_limits
from ...integrate.rigid.awake_clusters import store_known_loads
from ...numerics.quaternion import matrix_of
from .cluster_bodies import body_number, members

LARGEST_SWING, LEAST_CHANGE = 0.9, 0.02
"""A cluster that wakes swings about the displacements that balance its loads, at first by as much as they have changed.
It wakes before a contact would swing to LARGEST_SWING of its limit.  A contact that is near, or at, its limit at rest,
which is common in rings, whose contacts load each other, wakes its cluster when its load has changed by LEAST_CHANGE of
the limit."""
SMALLEST_RESERVE = 0.01
"""A cluster wakes if the loads of its contacts may grow by less than this, in units of their limits."""


def reserve_of(shares: np.ndarray, changes: np.ndarray) -> float:
    """By how much the loads of contacts may grow, in units of their limits, before their cluster wakes.

    Parameters
    ----------
    shares, changes : ndarray
        Loads, and their changes since the cluster came to rest, in units of their limits; of the same shape.
    """
    return float(np.maximum(0.5 * (LARGEST_SWING - shares - changes), LEAST_CHANGE - changes).min())


def rest_with_loads(state: State, first: int, strain: float) -> None:
    """Set the reserve of a body that comes to rest, from the largest displacement `strain` of its contacts."""
    bodies = state.bodies
    bodies.reserve[first] = reserve_of(np.array(strain), np.array(0.0))
    bodies.changed[first] = bodies.load[first] = 0.0


def may_stay_at_rest(state: State, law: ContactLaw, table: Table, first: int) -> bool:
    """Compute the loads of the contacts of a body; if none is near a limit, they become the known ones.

    Contacts carry what they carried at rest, and the changes of the loads on the grains since then, less inertia, by
    `contact.static_loads`.
    """
    bodies = state.bodies
    own = members(state, first)
    pair = state.contacts.pair[:, : state.count[CONTACTS]]
    columns = np.flatnonzero(bodies.first[pair[0]] == first)
    rows = np.zeros((ROWS, state.contacts.pair.shape[1]))
    responses_stage(law).run(table, (rows,))
    store_known_loads.run(table, (), body_number(state, first))
    turn = matrix_of(bodies.orientation[:, first])
    force = (turn @ (bodies.known_force[:, own] - bodies.rest_force[:, own])).T
    torque = (turn @ (bodies.known_torque[:, own] - bodies.rest_torque[:, own])).T
    shares, changes = shares_of_limits(
        responses(rows[:, columns]), np.searchsorted(own, pair[:, columns]).T, force, torque
    )
    bodies.reserve[first], bodies.changed[first] = reserve_of(shares, changes), changes.max()
    return bool(bodies.reserve[first] > SMALLEST_RESERVE)


def virial_at_rest(state: State, force: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """Virial (3, 3) [J] of the contacts of all clusters at rest, W_ab = Σ s_a (m a − F)_b over their grains.

    At s from the centre of mass a grain has the acceleration a = A + α×s + ω×(ω×s) of the rigid motion; what the other
    forces F do not give, its contacts do, and Σ s_a f_b of these forces is Σ l_a f_b over the contacts.
    (Clusters that extend over half of the box, and those joined to their own image among them, never come to rest.)

    Parameters
    ----------
    state : State
        The state.
    force, torque : ndarray
        (N, 3) loads on the grains [N, N m], without those of contacts in clusters at rest.
    """
    grains, bodies, found = state.grains.arrays, state.bodies, np.zeros((3, 3))
    order, sizes = np.argsort(bodies.first, kind="stable"), np.bincount(bodies.first)
    for own in np.split(order, np.cumsum(sizes[sizes > 0])[:-1]):
        if len(own) == 1 or not bodies.asleep[own[0]]:
            continue
        s = (matrix_of(bodies.orientation[:, own[0]]) @ bodies.offset[:, own]).T
        m, spin = grains.mass[own], grains.spin[:, own[0]]
        inertia = (grains.inertia[own].sum() + (m @ s**2).sum()) * np.eye(3) - (s.T * m) @ s
        moment = np.cross(s, force[own]).sum(axis=0) + torque[own].sum(axis=0)
        turning = np.linalg.solve(inertia, moment - np.cross(spin, inertia @ spin))
        moved = force[own].sum(axis=0) / m.sum() + np.cross(turning, s) + np.cross(spin, np.cross(spin, s))
        found += s.T @ (m[:, None] * moved - force[own])
    return found
