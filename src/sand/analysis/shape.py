"""Size and shape of an aggregate: gyration tensor, filling factor, projected area."""

from __future__ import annotations

import math

import numpy as np

from ..basics.arguments import MOST_GRAINS, checked
from ..basics.errors import BadInput, shown
from ..basics.units import MOST, whole_number
from .clusters import checked_pairs
from .projection import area_of_union

DIRECTIONS = 64
"""Number of directions of view over which a projected area is averaged."""
MOST_VIEWS = 1_000_000
"""Largest number of directions of view."""


def _centred(position: np.ndarray, mass: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    x = np.asarray(position, dtype=np.float64)
    if x.ndim != 2 or x.shape[1] != 3 or not len(x):
        raise BadInput(f"positions must be (N, 3) with N ≥ 1, not {x.shape}")
    weight = np.ones(len(x)) if mass is None else np.asarray(mass, dtype=np.float64)
    if weight.shape != (len(x),) or not weight.sum() > 0.0:
        raise BadInput(f"mass must have one entry for each of {len(x)} grains, above 0 together")
    return x - np.average(x, axis=0, weights=weight), weight


def _of_each(radius: np.ndarray | float, count: int) -> np.ndarray:
    """Radii (N,) of grains.  Raises BadInput."""
    given = np.asarray(radius, float)
    if given.shape not in ((), (count,)) or not (np.isfinite(given) & (given >= 0.0) & (given < MOST)).all():
        raise BadInput(f"radius = {shown(radius)} must be one number or (N,), with N = {count}, in m, finite and ≥ 0")
    return np.broadcast_to(given, count)


@checked
def gyration_radius(
    position: np.ndarray, mass: np.ndarray | None = None, radius: np.ndarray | float | None = None
) -> float:
    """Radius of gyration r_g = √(Σ m (|x − x̄|² + ⅗r²)/Σ m) [m].

    Parameters
    ----------
    position : ndarray
        (N, 3) [m], unwrapped (see `clusters.unwrapped`); a cluster that touches its own periodic image has no size.
    mass : ndarray or None, optional
        (N,) [kg]; equal by default.
    radius : ndarray or float or None, optional
        Radii of the grains (N,) [m], to include their own extent; by default only the centres count.
    """
    return math.sqrt(np.trace(gyration_tensor(position, mass, radius)))


@checked
def gyration_tensor(
    position: np.ndarray, mass: np.ndarray | None = None, radius: np.ndarray | float | None = None
) -> np.ndarray:
    """Gyration tensor Σ m (x − x̄)(x − x̄)ᵀ/Σ m (3, 3) [m²]; with `radius`, r²/5 is added on the diagonal.

    Parameters as for `gyration_radius`.
    """
    x, weight = _centred(position, mass)
    tensor = (x * weight[:, None]).T @ x / weight.sum()
    own = 0.0 if radius is None else float(np.average(_of_each(radius, len(x)) ** 2, weights=weight))
    return tensor + np.eye(3) * own / 5.0


@checked
def inertia_tensor(position: np.ndarray, mass: np.ndarray, radius: np.ndarray | float) -> np.ndarray:
    """Moment of inertia tensor about the centre of mass (3, 3) [kg m²], with ⅖mr² of each sphere.

    Parameters as for `gyration_radius`.
    """
    tensor = gyration_tensor(position, mass, radius)
    return float(np.sum(mass)) * (np.trace(tensor) * np.eye(3) - tensor)


@checked
def principal_lengths(
    position: np.ndarray, mass: np.ndarray | None = None, radius: np.ndarray | float | None = None
) -> np.ndarray:
    """Square roots of the eigenvalues of the gyration tensor (3,) [m], largest first.

    Parameters as for `gyration_radius`.
    """
    values = np.linalg.eigvalsh(gyration_tensor(position, mass, radius))
    return np.sqrt(np.clip(values[::-1], 0.0, None))


@checked
def elongation(position: np.ndarray, mass: np.ndarray | None, radius: np.ndarray | float) -> float:
    """Ratio of the largest to the smallest principal length, extent of the grains included: 1 for a sphere.

    Parameters as for `gyration_radius`.
    """
    lengths = principal_lengths(position, mass, radius)
    return float(lengths[0] / lengths[2])


@checked
def characteristic_radius(position: np.ndarray, mass: np.ndarray | None, radius: np.ndarray | float) -> float:
    """Characteristic radius √(5/3) r_g [m], extent of the grains included.

    It is the radius of the homogeneous sphere with this radius of gyration. Parameters as for `gyration_radius`.
    """
    return math.sqrt(5.0 / 3.0) * gyration_radius(position, mass, radius)


@checked
def filling_factor(position: np.ndarray, radius: np.ndarray | float, mass: np.ndarray | None = None) -> float:
    """Volume of the grains over that of the sphere of `characteristic_radius`: 1 for one grain.

    Parameters as for `gyration_radius`; masses are proportional to volumes by default.
    """
    each = _of_each(radius, len(position))
    weight = each**3 if mass is None else mass
    return float((each**3).sum() / characteristic_radius(position, weight, each) ** 3)


@checked
def coordination(count: int, pairs: np.ndarray) -> np.ndarray:
    """Number of contacts of each grain (N,).

    Parameters
    ----------
    count : int
        Number of grains N.
    pairs : ndarray
        Contacts (C, 2).
    """
    whole_number(count, "count", 0, MOST_GRAINS)
    return np.bincount(checked_pairs(count, pairs).reshape(-1), minlength=count)


@checked
def directions_of_view(count: int) -> np.ndarray:
    """Unit vectors (count, 3), evenly distributed over a hemisphere (Fibonacci lattice)."""
    k = np.arange(whole_number(count, "count", 1, MOST_VIEWS)) + 0.5
    z, turn = 1.0 - k / count, math.pi * (1.0 + math.sqrt(5.0)) * k
    across = np.sqrt(1.0 - z * z)
    return np.column_stack([across * np.cos(turn), across * np.sin(turn), z])


@checked
def projected_area(
    position: np.ndarray, radius: np.ndarray | float, directions: np.ndarray | int = DIRECTIONS
) -> tuple[float, float]:
    """Projected area [m²], averaged over directions, and its standard error.

    The area of the union of the projected discs is exact (from its boundary arcs).

    Parameters
    ----------
    position : ndarray
        (N, 3) [m].
    radius : ndarray or float
        (N,) [m].
    directions : ndarray or int, optional
        Unit vectors (K, 3), or their number, evenly distributed.

    Returns
    -------
    area, error : float
        Mean and standard error [m²].
    """
    centred, _ = _centred(position, None)
    size = _of_each(radius, len(centred)).copy()
    views = directions_of_view(directions) if isinstance(directions, int) else np.asarray(directions, float)
    if views.ndim != 2 or views.shape[1] != 3 or not len(views) or not np.isfinite(views).all():
        raise BadInput(f"directions = {shown(directions)} must be unit vectors (K, 3), or their number")
    areas, work = [], np.empty((2, 2 * len(size) + 2))
    for axis in views:
        flat = centred @ _across(axis)
        order = np.argsort(flat[:, 0], kind="stable")  # sorted by x, so that only neighbours are compared
        x, y = np.ascontiguousarray(flat[order].T)
        areas.append(area_of_union(x, y, size[order], size.max(), *work))
    return float(np.mean(areas)), float(np.std(areas) / math.sqrt(max(len(areas) - 1, 1)))


def _across(axis: np.ndarray) -> np.ndarray:
    """Two unit vectors perpendicular to an axis, (3, 2)."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    first = np.cross(axis, helper)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first)])
