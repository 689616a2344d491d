"""Bodies of a state: lists of their grains, and what makes a body of a grain, or of a cluster that comes to rest."""

from __future__ import annotations

import math

import numpy as np

from ...basics.box import nearest_image
from ...basics.clusters import labels_of
from ...basics.state import BODIES, CONTACTS, State
from ...forces.gas_loops import GasParameters
from ...integrate.rigid.body_friction import friction_modes
from ...numerics.quaternion import matrix_of, quaternion_of
from ...numerics.rotor import principal_frame, product

OF_MEMBERS = ("offset", "rest_force", "rest_torque", "known_force", "known_torque", "inner_field")
"""Arrays of vectors of the grains of a body, in the body."""


def members(state: State, first: int) -> np.ndarray:
    """Grains of the body with this first grain."""
    return np.flatnonzero(state.bodies.first == first)


def body_number(state: State, first: int) -> int:
    """Number of the body with this first grain."""
    bodies = state.bodies
    return int(np.searchsorted(bodies.member[bodies.start[: state.count[BODIES]]], first))


def contacts_of(state: State, chosen: np.ndarray) -> np.ndarray:
    """Columns of the contacts of some clusters; `chosen` says (N,) which grains are theirs."""
    return np.flatnonzero(chosen[state.contacts.pair[0, : state.count[CONTACTS]]])


def sort_members(state: State) -> None:
    """Fill the lists of the grains of each body."""
    bodies = state.bodies
    bodies.member[:] = np.argsort(bodies.first, kind="stable")
    first = bodies.first[bodies.member]
    starts = np.append(0, np.flatnonzero(first[1:] != first[:-1]) + 1)
    state.count[BODIES] = len(starts)
    bodies.start[: len(starts)], bodies.start[len(starts) :] = starts, len(state.grains)


def form_bodies(state: State, held: np.ndarray) -> None:
    """Make a body of each grain without contacts, at rest, and of each cluster, awake and not yet described.

    Single grains among the `held` ones are awake, too.
    """
    bodies, n = state.bodies, len(state.grains)
    labels = labels_of(n, state.contacts.pair[:, : state.count[CONTACTS]].T)
    first = np.full(labels.max(initial=-1) + 1, n)
    np.minimum.at(first, labels, np.arange(n))
    bodies.first[:], bodies.asleep[:] = first[labels], 0
    bodies.event[:] = bodies.vibration[:] = state.time
    sort_members(state)
    for name in OF_MEMBERS:
        getattr(bodies, name)[...] = 0.0
    bodies.turn[...] = np.array([[0.0], [0.0], [0.0], [1.0]])
    bodies.changed[:] = bodies.load[:] = 0.0
    bodies.reserve[:] = math.inf
    bodies.strength[...] = math.inf
    for i in np.setdiff1d(np.flatnonzero(np.bincount(bodies.first, minlength=n) == 1), held).tolist():
        rest_grain(state, i)


def rest_grain(state: State, i: int) -> None:
    """Make a body of a single grain."""
    bodies, grains = state.bodies, state.grains.arrays
    bodies.asleep[i] = 1
    bodies.mass[i], bodies.inertia[:, i] = grains.mass[i], grains.inertia[i]
    bodies.centre[:, i], bodies.orientation[:, i] = grains.position[:, i], grains.orientation[:, i]
    bodies.momentum[:, i] = grains.mass[i] * grains.velocity[:, i]
    bodies.angular_momentum[:, i] = grains.inertia[i] * (matrix_of(grains.orientation[:, i]).T @ grains.spin[:, i])
    for name in OF_MEMBERS:
        getattr(bodies, name)[:, i] = 0.0
    bodies.turn[:, i] = 0.0, 0.0, 0.0, 1.0
    bodies.changed[i] = bodies.load[i] = 0.0
    bodies.reserve[i] = math.inf
    bodies.strength[:, i] = math.inf


def describe_body(state: State, index: np.ndarray, offset: np.ndarray) -> None:
    """Store mass, centre, principal axes and moments of inertia of a cluster, and where its grains are in these axes.

    Parameters
    ----------
    index : ndarray
        (n,) grains, in ascending order.
    offset : ndarray
        (3, n) their vectors from the centre of mass [m].
    """
    bodies, first, grains = state.bodies, int(index[0]), state.grains.arrays
    m, inertia = grains.mass[index], grains.inertia[index]
    principal, axes = principal_frame(m, inertia, offset)
    bodies.mass[first], bodies.inertia[:, first] = m.sum(), principal
    bodies.centre[:, first] = nearest_image(grains.position[:, first] - offset[:, 0], state.box.span)
    bodies.orientation[:, first] = quaternion_of(axes)
    bodies.offset[:, index] = axes.T @ offset


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products of vectors (3, n), faster than `np.cross` for few, and in its order of memory, as sums need it."""
    return np.asfortranarray(a[[1, 2, 0]] * b[[2, 0, 1]] - a[[2, 0, 1]] * b[[1, 2, 0]])


def rest_cluster(state: State, index: np.ndarray) -> float:
    """Replace the velocities of a described cluster by the rigid motion with its P and L; from now on it is at rest.

    Returns
    -------
    float
        Kinetic energy removed [J].
    """
    bodies, grains, first = state.bodies, state.grains.arrays, int(index[0])
    q = bodies.orientation[:, first]
    turn = matrix_of(q)
    m, inertia = grains.mass[index], grains.inertia[index]
    v, w = grains.velocity[:, index], grains.spin[:, index]
    s = turn @ bodies.offset[:, index]
    momentum = (m * v).sum(axis=1)
    u, flow = v - (momentum / m.sum())[:, None], 0.0
    if state.cell is not None and state.cell.span[6:9].any():  # A s, relative to which they have the velocities
        flow = state.cell.span[6:9, None] * s
        u = u + flow
    angular = turn.T @ (m * _cross(s, u) + inertia * w).sum(axis=1)
    bodies.momentum[:, first], bodies.angular_momentum[:, first] = momentum, angular
    inverse = np.array([-1.0, -1.0, -1.0, 1.0]) * q
    for i in index:
        bodies.turn[:, i] = product(tuple(inverse), tuple(grains.orientation[:, i]))
    spin = (turn @ (angular / bodies.inertia[:, first]))[:, None]
    new_v = (momentum / m.sum())[:, None] + _cross(spin, s) - flow
    removed = 0.5 * float((m * (v - new_v) * (v + new_v)).sum())
    removed += 0.5 * float((inertia * (w - spin) * (w + spin)).sum())
    grains.velocity[:, index], grains.spin[:, index] = new_v, spin
    bodies.asleep[index] = 1
    return removed


def set_friction(state: State, gas: GasParameters, index: np.ndarray) -> None:
    """Store the modes of friction of the body of the grains `index` in a gas."""
    bodies, first = state.bodies, int(index[0])
    numbers = gas.density, gas.mean_speed, gas.accommodation
    radius, offset = state.grains.arrays.radius[index], bodies.offset[:, index]
    bodies.decay[:, first], modes = friction_modes(
        radius, offset, bodies.mass[first], bodies.inertia[:, first], numbers
    )
    bodies.mode[:, first] = modes.T.ravel()
