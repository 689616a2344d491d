"""Groups of neighbouring grains of a rigid aggregate, which act as one dipole or one charge at a distance."""

from __future__ import annotations

import numpy as np

from .rigid_flight import ChargeGroups, Groups

GROUP = 4
"""Members of a group of the next level."""


def groups_of(x: np.ndarray, moment: np.ndarray) -> Groups:
    """Grains at x (n, 3) [m] with moments (n, 3) [A m²] in the frame of a body, and all levels of groups of them.

    A group of level l has up to 4ˡ neighbouring grains: the sum of their moments at the mean of their positions,
    weighted by |μ|, about which the next term of equal dipoles vanishes. Of other dipoles it is Σ|μ| a/d of the first
    one, |Σμ|, with the radius a of the group in a distance d: so `reach` is the largest a Σ|μ|/|Σμ|, and a level with a
    group whose moments cancel is not used at any distance.
    """
    strength = np.linalg.norm(moment, axis=1)
    weight = np.maximum(strength, 1e-6 * strength.max()) if strength.any() else np.ones(len(x))
    points, moments, strengths, first, reach = [x], [moment], [strength], [0, len(x)], [0.0]
    order = _neighbours_together(x, np.arange(len(x)))
    size = 1
    while size < len(x):
        size *= GROUP
        begin = np.arange(0, len(x), size)
        group = np.repeat(np.arange(len(begin)), np.diff([*begin, len(x)]))
        total = np.add.reduceat(np.column_stack([weight, weight[:, None] * x, moment, strength])[order], begin)
        centre = total[:, 1:4] / total[:, :1]
        points.append(centre)
        moments.append(total[:, 4:7])
        strengths.append(total[:, 7])
        first.append(first[-1] + len(begin))
        radius = np.maximum.reduceat(np.linalg.norm(x[order] - centre[group], axis=1), begin)
        net, moving = np.linalg.norm(total[:, 4:7], axis=1), total[:, 7]
        ratio = np.where(moving > 0.0, net / np.where(moving > 0.0, moving, 1.0), 1.0)
        with np.errstate(divide="ignore"):
            reach.append(float(np.where(radius > 0.0, radius / ratio, 0.0).max()))
    point = np.ascontiguousarray(np.concatenate(points).T)
    return Groups(
        point,
        np.ascontiguousarray(np.concatenate(moments).T),
        np.concatenate(strengths),
        np.array(first),
        np.array(reach),
    )


def charge_groups_of(x: np.ndarray, charge: np.ndarray) -> ChargeGroups:
    """Groups of the charges (n,) [C] at x (n, 3) [m] in the frame of a body; level 0 has each charge that is not 0.

    A group of level l has up to 4ˡ neighbouring charges of one sign: their sum at their centre of charge, about which
    they have no dipole moment; the next term is at most (a/d)² of the potential, for the radius a and the distance d.
    """
    signs = [np.flatnonzero(charge > 0.0), np.flatnonzero(charge < 0.0)]
    orders = [_neighbours_together(x, own) for own in signs if len(own)]
    points, charges, first, reach = [], [], [0], []
    size, most = 1, max(map(len, orders), default=0)
    while True:
        radius = 0.0
        for order in orders:
            begin = np.arange(0, len(order), size)
            total = np.add.reduceat(charge[order], begin)
            centre = np.add.reduceat(charge[order, None] * x[order], begin) / total[:, None]
            apart = x[order] - np.repeat(centre, np.diff([*begin, len(order)]), axis=0)
            radius = max(radius, float(np.linalg.norm(apart, axis=1).max()) if size > 1 else 0.0)
            points.append(centre)
            charges.append(total)
        first.append(sum(map(len, charges)))
        reach.append(radius)
        if size >= most:
            break
        size *= GROUP
    point = np.ascontiguousarray(np.concatenate([np.zeros((0, 3)), *points]).T)
    return ChargeGroups(point, np.concatenate([np.zeros(0), *charges]), np.array(first), np.array(reach))


def _neighbours_together(x: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Order of grains `own` in which any 4ˡ at a multiple of 4ˡ are neighbours: bisection along the longest axis."""
    if len(own) <= GROUP:
        return own
    apart = x[own] - x[own].mean(axis=0)
    along = apart @ np.linalg.eigh(apart.T @ apart)[1][:, 2]
    own = own[np.argsort(along, kind="stable")]
    size = GROUP
    while size * GROUP < len(own):
        size *= GROUP
    half = size * (-(-len(own) // size) // 2)
    return np.concatenate([_neighbours_together(x, own[:half]), _neighbours_together(x, own[half:])])
