"""Collision kernels from measured cross-sections, and tables of kernels for other programs, such as DustPy.

Measurements (m1, m2, σ, v) are interpolated linearly in ln K over (ln m1, ln m2), on triangles; K = σ v is a power law
in each triangle. For Brownian motion this has an error of 3 % for masses a factor of 2 apart, and 8 % for a factor of
2.5.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..basics.arguments import checked
from ..basics.errors import BadInput
from ..basics.units import in_unit, si_array
from ..io.run_folder import replace_file
from ..io.table import write_table
from ..theory.kinetics import CollisionKernel, KernelFunction

UNITS = ("kg", "kg", "m^2", "m/s")
"""Units of the numbers in a row of measurements."""
GRAM, CUBIC_CM = 1e3, 1e6
"""Grams per kg, cm³ per m³."""


@checked
def measured(rows: Iterable[Sequence[Any]], *, extrapolate: bool = False) -> CollisionKernel:
    """Kernel K = σ v for any two masses, interpolated from measurements.

    Parameters
    ----------
    rows : iterable of sequence
        (m1, m2, σ, v) in kg, kg, m², m/s, all above 0, in either order of the masses: at least two masses and all three
        pairs of them. For a result `found` of `scattering.cross_section`: `(m1, m2, found.sigma, found.speed)`, with a
        target at rest or with random velocity (then σ v is the mean of σ(u) u).
    extrapolate : bool, optional
        Extrapolate beyond the measured masses by the power law fitted to all rows, instead of raising BadInput.

    Returns
    -------
    Kernel
        Callable kernel K(m1, m2) [m³/s].

    Raises
    ------
    BadInput
        If rows are invalid, contradict each other, or do not span a range of masses; when the kernel is called, for
        masses outside the range.
    """
    from scipy.interpolate import LinearNDInterpolator
    from scipy.spatial import QhullError

    table = _rows(rows)
    masses, value = np.log(table[:, :2]), np.log(table[:, 2] * table[:, 3])
    # both orders of each pair, without duplicates
    both = np.unique(np.column_stack([np.concatenate([masses, masses[:, ::-1]]), np.tile(value, 2)]), axis=0)
    points, values = both[:, :2], both[:, 2]
    if len(np.unique(points, axis=0)) < len(points):
        raise BadInput("two rows have equal masses and different sigma v; give each pair of masses once")
    try:
        inside = LinearNDInterpolator(points, values)
    except (QhullError, ValueError):
        raise BadInput("rows must span a range of masses: at least two masses and all three pairs of them") from None
    centre, slopes = points.mean(axis=0), _slopes(points, values)

    def function(m1: np.ndarray, m2: np.ndarray) -> np.ndarray:
        # Points on an edge of two triangles are assigned to either one, depending on earlier calls. Sorted pairs
        # without duplicates make K(m1, m2) equal to K(m2, m1) in all bits.
        pairs = np.stack([np.minimum(m1, m2), np.maximum(m1, m2)], axis=-1).reshape(-1, 2)
        once, where = np.unique(pairs, axis=0, return_inverse=True)
        query = np.log(once)
        edge = _to_boundary(query, centre, inside)
        beyond = np.abs(edge - query).max(axis=-1) > 1e-6
        if beyond.any() and not extrapolate:
            first, second = np.exp(query[np.argmax(beyond)])
            raise BadInput(
                f"masses {first:.4g} and {second:.4g} kg are outside the measured range ({np.exp(points.min()):.4g} to "
                f"{np.exp(points.max()):.4g} kg); add measurements, or set extrapolate=True"
            )
        return np.exp(inside(edge) + (query - edge) @ slopes)[where.reshape(-1)].reshape(np.shape(m1))

    return CollisionKernel(f"measured, {len(table)} rows", function)


@checked
def on_grid(kernel: KernelFunction, masses: np.ndarray) -> np.ndarray:
    """Tabulate K(m_i, m_j) (K, K) [m³/s] on increasing masses.

    Parameters
    ----------
    kernel : KernelFunction
        K(m1, m2) [m³/s].
    masses : array_like
        (K,) [kg] > 0, increasing.

    Raises
    ------
    BadInput
        If masses are invalid or not increasing, or the kernel returns no numbers in m³/s.
    """
    m = si_array(masses, "kg", "masses")
    if m.ndim != 1 or not len(m) or not (np.isfinite(m) & (m > 0.0)).all() or not (np.diff(m) > 0.0).all():
        raise BadInput("masses must be finite, above 0 kg, and increasing")
    return si_array(kernel(*np.broadcast_arrays(m[:, None], m[None, :])), "m^3/s", "kernel(m1, m2)")


@checked
def write_csv(path: str | Path, kernel: KernelFunction, masses: np.ndarray) -> None:
    """Write a table with one line for each pair m1 ≤ m2: `mass1` [kg], `mass2` [kg], `kernel` [m³/s].

    Parameters
    ----------
    path : str or Path
        File.
    kernel : KernelFunction
        K(m1, m2) [m³/s].
    masses : array_like
        (K,) [kg] > 0, increasing.

    Raises
    ------
    BadInput
        If masses are invalid or not increasing.
    FilesFailed
        If the file cannot be written.
    """
    table, m = on_grid(kernel, masses), si_array(masses, "kg", "masses")
    i, j = np.triu_indices(len(m))
    rows = np.stack([m[i], m[j], table[i, j]], axis=1).tolist()
    write_table(Path(path), [dict(zip(("mass1", "mass2", "kernel"), row, strict=True)) for row in rows])


@checked
def write_cgs(path: str | Path, kernel: KernelFunction, masses: np.ndarray) -> None:
    """Write text for `numpy.loadtxt`: masses (K,) [g] in the first row, then K (K, K) [cm³/s].

    Parameters
    ----------
    path : str or Path
        File.
    kernel : KernelFunction
        K(m1, m2) [m³/s].
    masses : array_like
        (K,) [kg] > 0, increasing.

    Raises
    ------
    BadInput
        If masses are invalid or not increasing.
    FilesFailed
        If the file cannot be written.
    """
    table = np.vstack([np.multiply(masses, GRAM), on_grid(kernel, masses) * CUBIC_CM]).tolist()
    lines = ["# collision kernel; first row: masses m_j [g]; row 1 + i: K(m_i, m_j) [cm^3/s]"]
    lines += [" ".join(map(repr, row)) for row in table]
    replace_file(Path(path), ("\n".join(lines) + "\n").encode())


@checked
def for_dustpy(table: Any, scale_heights: Any) -> np.ndarray:
    """Kernel in the form of DustPy's `dust.kernel`: K/√(2π(H1² + H2²)) [cm²/s], halved for equal masses.

    DustPy integrates ∫ n1 n2 K dz/(N1 N2) over a disk with Gaussian layers, sums over pairs j ≤ i, and includes the
    factor ½ of equal masses in the kernel.

    Parameters
    ----------
    table : array_like
        K (Nm, Nm) [cm³/s] on the masses of `grid.m`.
    scale_heights : array_like
        H (Nr, Nm) [cm] > 0, `dust.H`.

    Returns
    -------
    ndarray
        (Nr, Nm, Nm) [cm²/s]; 0 at the first and last radius, the boundaries.

    Raises
    ------
    BadInput
        If the shapes do not match.
    """
    k, height = si_array(table, "cm^3/s", "table"), si_array(scale_heights, "cm", "scale_heights")
    if height.ndim != 2 or k.shape != (height.shape[1], height.shape[1]) or not (height > 0.0).all():
        raise BadInput(f"table {k.shape} and scale heights {height.shape} must be (Nm, Nm) and (Nr, Nm), these above 0")
    squares = height**2
    found = k * (1.0 - 0.5 * np.eye(len(k))) / np.sqrt(2.0 * np.pi * (squares[:, :, None] + squares[:, None, :]))
    found[[0, -1]] = 0.0
    return found


def _rows(rows: Iterable[Sequence[Any]]) -> np.ndarray:
    try:
        table = np.array([[in_unit(v, unit) for v, unit in zip(row, UNITS, strict=True)] for row in rows], float)
    except (TypeError, ValueError):
        table = np.zeros(0)
    if table.ndim != 2 or table.shape[1] != 4 or not (np.isfinite(table) & (table > 0.0)).all():
        raise BadInput("rows must be four finite numbers above 0 each: m1 [kg], m2 [kg], sigma [m^2], v [m/s]")
    return table


def _slopes(points: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Slopes (2,) of the best-fitting plane, for the smaller and the larger mass."""
    ordered = np.sort(points, axis=1)
    found, *_ = np.linalg.lstsq(np.column_stack([ordered, np.ones(len(ordered))]), values, rcond=None)
    return found[:2]


def _to_boundary(query: np.ndarray, centre: np.ndarray, inside: Any) -> np.ndarray:
    """Each point, or the point at which the line from the centre to it leaves the measured region, by bisection."""
    low, high = np.zeros(len(query)), np.ones(len(query))
    known = np.isfinite(inside(query)).ravel()
    low[known] = 1.0
    # a point on the boundary may be classified as outside because of rounding; bisection moves it inside by 1e-12
    for _ in range(40):
        middle = 0.5 * (low + high)
        within = np.isfinite(inside(centre + middle[:, None] * (query - centre))).ravel()
        low, high = np.where(within, middle, low), np.where(within, high, middle)
    return np.where(known[:, None], query, centre + low[:, None] * (query - centre))
