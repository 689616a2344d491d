"""Measured cross-sections as a collision kernel, and kernels as tables for other programs, DustPy among them.

Measured rows (m1, m2, σ, v) are few; σ v is a power law between them: linear in logarithms, on triangles.  That finds
Brownian motion to 3 % from masses a factor of 2 apart, to 8 % with a factor of 2.5.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import checked
from ..errors import BadInput
from ..io.run_folder import replace_file
from ..io.table import write_table
from ..theory.kinetics import CollisionKernel, KernelFunction

GRAM, CUBIC_CM = 1e3, 1e6
"""g in a kg, cm³ in a m³."""


@checked
def measured(rows: Iterable[Sequence[Any]], *, extrapolate: bool = False) -> CollisionKernel:
    """K = σ v of any two masses, from some.

    Parameters
    ----------
    rows : Iterable[Sequence[Any]]
        (m1, m2, σ, v) each, in kg, kg, m², m/s, all above 0, in either order of the masses: at least two masses
        and all three pairs of them.  `(m1, m2, found.sigma, found.speed)` of what `scattering.cross_section` found
        where the target is at rest, or moves by chance (then σ v is the mean of σ(u) u).
    extrapolate : bool, optional
        beyond the measured masses go on as the power law that fits all rows best; else refuse.

    Raises
    ------
    BadInput
        rows that are no such rows, contradict each other, or do not span a range of masses; when called, for
        masses beyond it.
    """
    from scipy.interpolate import LinearNDInterpolator
    from scipy.spatial import QhullError

    table = _rows(rows)
    here, value = np.log(table[:, :2]), np.log(table[:, 2] * table[:, 3])
    # both orders of each pair, each once
    both = np.unique(np.column_stack([np.concatenate([here, here[:, ::-1]]), np.tile(value, 2)]), axis=0)
    points, values = both[:, :2], both[:, 2]
    if len(np.unique(points, axis=0)) < len(points):
        raise BadInput("two rows have the same masses and another sigma v; give each pair of masses once")
    try:
        inside = LinearNDInterpolator(points, values)
    except (QhullError, ValueError):
        raise BadInput("rows must span a range of masses: at least two masses and all three pairs of them") from None
    centre, tilt = points.mean(axis=0), _tilt(points, values)

    def function(m1: np.ndarray, m2: np.ndarray) -> np.ndarray:
        # Sorted, and each pair once, so that which triangle an edge belongs to, which depends on what was asked before,
        # cannot make K(m1, m2) another number than K(m2, m1).
        pairs = np.stack([np.minimum(m1, m2), np.maximum(m1, m2)], axis=-1).reshape(-1, 2)
        once, where = np.unique(pairs, axis=0, return_inverse=True)
        asked = np.log(once)
        edge = _pulled_in(asked, centre, inside)
        beyond = np.abs(edge - asked).max(axis=-1) > 1e-6
        if beyond.any() and not extrapolate:
            first, second = np.exp(asked[np.argmax(beyond)])
            raise BadInput(
                f"masses {first:.4g} and {second:.4g} kg lie beyond those measured ({np.exp(points.min()):.4g} to "
                f"{np.exp(points.max()):.4g} kg); measure there, or say extrapolate=True"
            )
        return np.exp(inside(edge) + (asked - edge) @ tilt)[where.reshape(-1)].reshape(np.shape(m1))

    return CollisionKernel(f"measured, {len(table)} rows", function)


@checked
def on_grid(kernel: KernelFunction, masses: Any) -> np.ndarray:
    """K(m_i, m_j) (K, K) [m³/s] of masses (K,) [kg] > 0 that rise.  Raises BadInput."""
    m = _masses(masses)
    return np.asarray(kernel(*np.broadcast_arrays(m[:, None], m[None, :])), float)


@checked
def write_csv(path: str | Path, kernel: KernelFunction, masses: Any) -> None:
    """A line for each pair m1 ≤ m2: `mass1` [kg], `mass2` [kg], `kernel` [m³/s].

    Parameters
    ----------
    kernel : KernelFunction
        K(m1, m2) [m³/s].
    masses
        (K,) [kg] > 0, rising.

    Raises
    ------
    BadInput
        masses out of range or order.
    FilesFailed
        it cannot be written.
    """
    m, table = _masses(masses), on_grid(kernel, masses)
    pairs = [(i, j) for i in range(len(m)) for j in range(i, len(m))]
    write_table(
        Path(path), [{"mass1": float(m[i]), "mass2": float(m[j]), "kernel": float(table[i, j])} for i, j in pairs]
    )


@checked
def write_cgs(path: str | Path, kernel: KernelFunction, masses: Any) -> None:
    """Plain text for `numpy.loadtxt`: masses (K,) [g] in the first row, then K (K, K) [cm³/s].

    Arguments and errors as for `write_csv`.
    """
    m, table = _masses(masses), on_grid(kernel, masses)
    lines = ["# collision kernel; first row: masses m_j [g]; row 1 + i: K(m_i, m_j) [cm^3/s]"]
    lines += [" ".join(repr(float(v)) for v in row) for row in [m * GRAM, *(table * CUBIC_CM)]]
    replace_file(Path(path), ("\n".join(lines) + "\n").encode())


@checked
def for_dustpy(table: Any, scale_heights: Any) -> np.ndarray:
    """What DustPy's `dust.kernel` holds: ∫ n1 n2 K dz/(N1 N2) = K/√(2π(H1² + H2²)) [cm²/s], half of it for equals.

    DustPy integrates over the height of a disk of Gaussian layers, sums over pairs j ≤ i, and takes the ½ of two equal
    masses into the kernel.

    Parameters
    ----------
    table
        K (Nm, Nm) [cm³/s] on the masses of `grid.m`.
    scale_heights
        H (Nr, Nm) [cm] > 0, `dust.H`.

    Returns
    -------
    ndarray
        (Nr, Nm, Nm) [cm²/s]; the first and last radius, its boundaries, hold 0.

    Raises
    ------
    BadInput
        shapes that do not fit.
    """
    k, height = np.asarray(table, float), np.asarray(scale_heights, float)
    if height.ndim != 2 or k.shape != (height.shape[1], height.shape[1]) or not (height > 0.0).all():
        raise BadInput(f"table {k.shape} and scale heights {height.shape} must be (Nm, Nm) and (Nr, Nm), these above 0")
    squares = height**2
    found = k * (1.0 - 0.5 * np.eye(len(k))) / np.sqrt(2.0 * np.pi * (squares[:, :, None] + squares[:, None, :]))
    found[[0, -1]] = 0.0
    return found


def _rows(rows: Iterable[Sequence[Any]]) -> np.ndarray:
    try:
        table = np.array([[float(value) for value in row] for row in rows])
    except (TypeError, ValueError):
        raise BadInput("rows must be four numbers each: m1 [kg], m2 [kg], sigma [m^2], v [m/s]") from None
    if table.ndim != 2 or table.shape[1] != 4 or not (np.isfinite(table) & (table > 0.0)).all():
        raise BadInput("rows must be four finite numbers above 0 each: m1 [kg], m2 [kg], sigma [m^2], v [m/s]")
    return table


def _masses(masses: Any) -> np.ndarray:
    try:
        m = np.asarray(masses, float)
    except (TypeError, ValueError):
        raise BadInput("masses must be numbers, in kg") from None
    if m.ndim != 1 or not len(m) or not (np.isfinite(m) & (m > 0.0)).all() or not (np.diff(m) > 0.0).all():
        raise BadInput("masses must be finite, above 0 kg, and rise")
    return m


def _tilt(points: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Slopes (2,) of the plane that fits best, for the smaller and the larger mass."""
    ordered = np.sort(points, axis=1)
    found, *_ = np.linalg.lstsq(np.column_stack([ordered, np.ones(len(ordered))]), values, rcond=None)
    return found[:2]


def _pulled_in(asked: np.ndarray, centre: np.ndarray, inside: Any) -> np.ndarray:
    """Each point, or where the line from it to the centre enters the measured region: found by halving."""
    low, high = np.zeros(len(asked)), np.ones(len(asked))
    known = np.isfinite(inside(asked)).ravel()
    low[known] = 1.0
    # a point on the very edge may be found outside by the last bit; the halving brings it back by 1e-12
    for _ in range(40):
        middle = 0.5 * (low + high)
        within = np.isfinite(inside(centre + middle[:, None] * (asked - centre))).ravel()
        low, high = np.where(within, middle, low), np.where(within, high, middle)
    return np.where(known[:, None], asked, centre + low[:, None] * (asked - centre))
