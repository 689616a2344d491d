"""Static loads of the contacts of a cluster: the displacements at which its contacts balance loads on its grains.

With the displacements u and rotations θ of all grains, small changes of the displacements q of the contacts are
q = B (u, θ), and minimum elastic energy ½ Σ k q² − Σ (f·u + t·θ) gives

    Bᵀ k B (u, θ) = (f, t)

In a tree of grains the loads alone determine the load of each contact; in rings, also the stiffnesses.  Loads must be
balanced: with inertia, f = F − m a and t = M − I α, their sum and their torque vanish.
"""

from typing import NamedTuple

import numpy as np

from ..basics.state import CONTACTS
from ..compiler.recipes import factory
from ..compiler.stage import Stage, stage
from ..numerics.vec import across
from .constants_table import column_loops
from .law import ContactLaw
from .mechanics import displacements_of, scaled_stiffness
from .poses import pose_at
from .tangential import sliding


class Responses(NamedTuple):
    """Poses, displacements, stiffnesses and limits of C contacts."""

    n: np.ndarray  # (C, 3) normal, from grain 2 to grain 1
    n1: np.ndarray  # (C, 3) contact pointers
    n2: np.ndarray
    slide: np.ndarray  # (C, 3) sliding displacement [m]
    roll: np.ndarray  # (C, 3) rolling displacement, tangential part [m]
    twist: np.ndarray  # (C,) [rad]
    normal_force: np.ndarray  # [N], positive in compression
    distance: np.ndarray  # [m]
    along: np.ndarray  # (r1 n1 − r2 n2)·n [m]
    radius1: np.ndarray  # [m]
    radius2: np.ndarray
    reduced_radius: np.ndarray
    normal_stiffness: np.ndarray  # [N/m]
    slide_stiffness: np.ndarray  # [N/m]
    roll_stiffness: np.ndarray  # [N/m]
    twist_stiffness: np.ndarray  # [N m/rad]
    break_force: np.ndarray  # [N]
    slide_limit: np.ndarray  # [m]
    roll_limit: np.ndarray  # [m]
    twist_limit: np.ndarray  # [rad]


VECTORS = 5
"""The first fields of `Responses` are vectors."""
ROWS = 2 * VECTORS + len(Responses._fields)


def responses(rows: np.ndarray) -> Responses:
    """What the stage of `responses_stage` has filled into the array (ROWS, C)."""
    return Responses(*(rows[3 * k : 3 * k + 3].T for k in range(VECTORS)), *rows[3 * VECTORS :])


@factory
def responses_stage(law: ContactLaw) -> Stage:
    """The stage that measures poses, displacements, stiffnesses and limits of all contacts, for one contact law."""
    constants_at, radius_root, at_break = column_loops(law).at, law.radius_root, law.at_break
    normal_force, normal_stiffness = law.force, law.stiffness

    @stage("the stiffnesses of contacts")
    def measure_responses(grains, contacts, count, span, settings, parameters):
        """Fill the array parameters[0] (ROWS, C) with `Responses`, three rows for a vector."""
        out = parameters[0]
        for c in range(count[CONTACTS]):
            i, j = contacts.pair[0, c], contacts.pair[1, c]
            r1, r2 = grains.radius[i], grains.radius[j]
            pose, frozen = pose_at(grains, contacts, span, c, contacts.twist[c]), constants_at(contacts, c)
            overlap = r1 + r2 - pose.distance
            y = radius_root(overlap, frozen)
            own = scaled_stiffness(frozen, y, settings.follow)
            moved = displacements_of(pose, overlap, r1, r2, own)
            vectors = (pose.n, pose.n1, pose.n2, moved.slide, across(moved.roll, pose.n))
            for k in range(5):
                for axis in range(3):
                    out[3 * k + axis, c] = vectors[k][axis]
            scalars = (
                pose.twist,
                normal_force(overlap, y, own),
                pose.distance,
                sliding(pose.n1, pose.n2, pose.n, r1, r2)[1],
                r1,
                r2,
                own.reduced_radius,
                normal_stiffness(overlap, y, own),
                own.slide_stiffness,
                own.roll_stiffness,
                own.twist_stiffness,
                abs(at_break(own)[1]),
                own.slide_limit,
                own.roll_limit,
                own.twist_limit,
            )
            for k in range(15):
                out[15 + k, c] = scalars[k]
        return 0

    return measure_responses


def tangents(n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors (C, 3) perpendicular to the unit vectors n (C, 3) and to each other."""
    axis = np.eye(3)[np.abs(n).argmin(axis=1)]
    first = np.cross(n, axis)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return first, np.cross(n, first)


def displacement_changes(
    contacts: Responses, pair: np.ndarray, force: np.ndarray, torque: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Changes of the displacements of the contacts of one cluster by additional balanced loads on its grains.

    Parameters
    ----------
    contacts : Responses
        The contacts of the cluster.
    pair : ndarray
        (C, 2) grains of each contact, numbered within the cluster from 0.
    force, torque : ndarray
        (n, 3) additional force [N] and torque about its centre [N m] on each grain.

    Returns
    -------
    tuple of ndarray
        Changes of the overlap (C,) [m], of the sliding displacement (C, 3) [m], of the rolling displacement (C, 3) [m],
        and of the twist (C,) [rad].  Infinite if the stiffnesses do not determine them.
    """
    from scipy.sparse import csc_matrix, diags
    from scipy.sparse.linalg import splu

    count, grains = len(pair), len(force)
    length = float(np.mean(contacts.reduced_radius))  # unknown rotations are length·θ, so that all have one scale
    e1, e2 = tangents(contacts.n)
    zero = np.zeros_like(e1)
    r1, r2, reduced = (x[:, None] for x in (contacts.radius1, contacts.radius2, contacts.reduced_radius))
    tilt = (-contacts.along / contacts.distance)[:, None]
    # rows: coefficients of u1, u2, θ1, θ2; e·(θ×n1) = θ·(n1×e)
    modes = [(-contacts.n, contacts.n, zero, zero)]
    modes += [(tilt * e, -tilt * e, r1 * np.cross(contacts.n1, e), -r2 * np.cross(contacts.n2, e)) for e in (e1, e2)]
    modes += [(zero, zero, reduced * np.cross(contacts.n1, e), reduced * np.cross(contacts.n2, e)) for e in (e1, e2)]
    modes += [(zero, zero, contacts.n, -contacts.n)]
    row = np.repeat(np.arange(6 * count), 12)
    at = 6 * pair[:, :, None] + np.arange(3)  # columns of u; those of θ follow
    column = np.tile(np.concatenate([at[:, 0], at[:, 1], at[:, 0] + 3, at[:, 1] + 3], axis=1), (6, 1)).ravel()
    values = np.concatenate([np.concatenate([u1, u2, w1 / length, w2 / length], axis=1) for u1, u2, w1, w2 in modes])
    # the first grain is held: the loads are balanced, so that it needs no reaction
    matrix = csc_matrix((values.ravel(), (row, column)), shape=(6 * count, 6 * grains))[:, 6:]
    stiffness = [contacts.normal_stiffness, *[contacts.slide_stiffness] * 2, *[contacts.roll_stiffness] * 2]
    k = np.concatenate([*stiffness, contacts.twist_stiffness])
    load = np.concatenate([force, torque / length], axis=1).ravel()[6:]
    try:
        moved = matrix @ splu((matrix.T @ diags(k) @ matrix).tocsc()).solve(load)
    except RuntimeError:  # singular, such as contacts that do not resist sliding
        beyond = np.full((count, 3), np.inf)
        return beyond[:, 0], beyond, beyond, beyond[:, 0]
    overlap, slide1, slide2, roll1, roll2, twist = moved.reshape(6, count)
    slide = slide1[:, None] * e1 + slide2[:, None] * e2
    return overlap, slide, roll1[:, None] * e1 + roll2[:, None] * e2, twist


def shares_of_limits(
    contacts: Responses, pair: np.ndarray, force: np.ndarray, torque: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Loads of contacts with additional balanced loads on the grains, and their changes, in units of their limits.

    Parameters as for `displacement_changes`.

    Returns
    -------
    tuple of ndarray
        Both (C, 4), one column for each of MODES: pull over the force at which the contact breaks, and displacements
        over their limits; and the sizes of their changes.
    """
    overlap, slide, roll, twist = displacement_changes(contacts, pair, force, torque)
    pull = -contacts.normal_stiffness * overlap
    limits = (contacts.break_force, contacts.slide_limit, contacts.roll_limit, contacts.twist_limit)

    def size(vectors: np.ndarray) -> np.ndarray:
        return np.linalg.norm(vectors, axis=1)

    now = (pull - contacts.normal_force, size(contacts.slide + slide), size(contacts.roll + roll))
    change = (np.abs(pull), size(slide), size(roll), np.abs(twist))

    def shares(sizes: tuple[np.ndarray, ...]) -> np.ndarray:
        with np.errstate(divide="ignore"):
            return np.column_stack([x / limit for x, limit in zip(sizes, limits, strict=True)])

    return shares((*now, np.abs(contacts.twist + twist))), shares(change)
