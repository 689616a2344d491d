"""Size and form of an aggregate."""

from __future__ import annotations

import math

import numpy as np

from ..arguments import checked
from ..errors import BadInput
from .projection import area_of_union

DIRECTIONS = 64
"""Of view that a projected area is averaged over; they are spread evenly over half a sphere."""


def _centred(position: np.ndarray, mass: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    place = np.asarray(position, dtype=np.float64)
    if place.ndim != 2 or place.shape[1] != 3 or not len(place):
        raise BadInput(f"positions must be (N, 3) with N ≥ 1, not {place.shape}")
    weight = np.ones(len(place)) if mass is None else np.asarray(mass, dtype=np.float64)
    if weight.shape != (len(place),) or not weight.sum() > 0.0:
        raise BadInput(f"mass must have one entry for each of {len(place)} grains, above 0 together")
    return place - np.average(place, axis=0, weights=weight), weight


@checked
def gyration_radius(
    position: np.ndarray, mass: np.ndarray | None = None, radius: np.ndarray | float | None = None
) -> float:
    """r_g = √(Σ m (|x − x̄|² + ⅗r²)/Σ m) [m].

    Parameters
    ----------
    position : ndarray
        (N, 3) [m], of a whole aggregate (see `clusters.unwrapped`).
    mass : ndarray or None, optional
        (N,) [kg]; equal by default.
    radius : ndarray or float or None, optional
        (N,) [m] of the grains, to count their own extent; left out by default: centres only.
    """
    return math.sqrt(np.trace(gyration_tensor(position, mass, radius)))


@checked
def gyration_tensor(
    position: np.ndarray, mass: np.ndarray | None = None, radius: np.ndarray | float | None = None
) -> np.ndarray:
    """Σ m (x − x̄)(x − x̄)ᵀ/Σ m (3, 3) [m²], and r²/5 of each grain on the diagonal if `radius` is given."""
    place, weight = _centred(position, mass)
    tensor = (place * weight[:, None]).T @ place / weight.sum()
    own = 0.0 if radius is None else float(np.average(np.broadcast_to(np.square(radius), len(place)), weights=weight))
    return tensor + np.eye(3) * own / 5.0


@checked
def inertia_tensor(position: np.ndarray, mass: np.ndarray, radius: np.ndarray | float) -> np.ndarray:
    """Moment of inertia about the centre of mass (3, 3) [kg m²], spheres with their own ⅖mr²."""
    tensor = gyration_tensor(position, mass, radius)
    return float(np.sum(mass)) * (np.trace(tensor) * np.eye(3) - tensor)


@checked
def principal_lengths(
    position: np.ndarray, mass: np.ndarray | None = None, radius: np.ndarray | float | None = None
) -> np.ndarray:
    """Roots of the eigenvalues of the gyration tensor [m], the longest first, (3,)."""
    values = np.linalg.eigvalsh(gyration_tensor(position, mass, radius))
    return np.sqrt(np.clip(values[::-1], 0.0, None))


@checked
def elongation(position: np.ndarray, mass: np.ndarray | None, radius: np.ndarray | float) -> float:
    """Longest over shortest principal length, extent of the grains included: 1 for a sphere, large for a chain."""
    lengths = principal_lengths(position, mass, radius)
    return float(lengths[0] / lengths[2])


@checked
def characteristic_radius(position: np.ndarray, mass: np.ndarray | None, radius: np.ndarray | float) -> float:
    """√(5/3) r_g [m], the radius of the homogeneous sphere with this radius of gyration, extent of grains included."""
    return math.sqrt(5.0 / 3.0) * gyration_radius(position, mass, radius)


@checked
def filling_factor(position: np.ndarray, radius: np.ndarray | float, mass: np.ndarray | None = None) -> float:
    """Volume of the grains over that of the sphere of `characteristic_radius`: 1 for one grain."""
    each = np.broadcast_to(np.asarray(radius, float), len(position))
    weight = each**3 if mass is None else mass
    return float((each**3).sum() / characteristic_radius(position, weight, each) ** 3)


@checked
def coordination(count: int, pairs: np.ndarray) -> np.ndarray:
    """Number of contacts of each grain (N,)."""
    return np.bincount(np.asarray(pairs, dtype=np.int64).reshape(-1), minlength=count)


def directions_of_view(count: int) -> np.ndarray:
    """Unit vectors (count, 3), evenly over a half sphere (a Fibonacci lattice); the other half sees the same."""
    k = np.arange(count) + 0.5
    z, turn = 1.0 - k / count, math.pi * (1.0 + math.sqrt(5.0)) * k
    across = np.sqrt(1.0 - z * z)
    return np.column_stack([across * np.cos(turn), across * np.sin(turn), z])


@checked
def projected_area(
    position: np.ndarray, radius: np.ndarray | float, directions: np.ndarray | int = DIRECTIONS
) -> tuple[float, float]:
    """Area of the shadow [m²], mean over directions of view and its standard error.

    Each shadow is a union of discs, whose area is exact (by its boundary arcs).

    Parameters
    ----------
    position : ndarray
        (N, 3) [m]; radius: (N,) [m].
    directions : ndarray or int, optional
        (K, 3) unit vectors, or how many of them, evenly over the sphere.
    """
    place, _ = _centred(position, None)
    size = np.broadcast_to(np.asarray(radius, float), len(place)).copy()
    views = directions_of_view(directions) if isinstance(directions, int) else np.asarray(directions, float)
    areas = []
    for axis in views:
        flat = place @ _across(axis)
        order = np.argsort(flat[:, 0], kind="stable")  # neighbours lie together, so that few are looked at
        x, y = np.ascontiguousarray(flat[order].T)
        areas.append(area_of_union(x, y, size[order], float(size.max())))
    return float(np.mean(areas)), float(np.std(areas) / math.sqrt(max(len(areas) - 1, 1)))


def _across(axis: np.ndarray) -> np.ndarray:
    """Two unit vectors perpendicular to an axis, (3, 2)."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    first = np.cross(axis, helper)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first)])
