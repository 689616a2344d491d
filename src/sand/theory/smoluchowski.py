"""Growth of clusters that stick in every collision: the coagulation equation of Smoluchowski (1916).

    dn_k/dt = ½ Σ_{i+j=k} K_ij n_i n_j − n_k Σ_j K_kj n_j

Clusters have sizes x_k, in grains.  If every sum of two sizes is a size of the grid, the equation is solved as it
stands; on other grids a sum between two sizes is distributed over both so that number and mass are conserved (Kovetz &
Olund 1969, as applied by Brauer et al. 2008).
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ..basics.arguments import checked
from ..basics.errors import BadInput, SandError, did_you_mean, shown
from ..basics.units import si, si_array
from .kinetics import KernelFunction
from .size_distribution import COMPLETED, MASS_LOST, SIZE_REACHED, SizeDistribution

MAX_SIZES = 3000
"""Largest number of sizes: all pairs, 4.5 million, are kept in memory, about 300 MB."""
METHODS = ("BDF", "DOP853")


@checked
def all_sizes(largest: int) -> np.ndarray:
    """Grid of all sizes x = 1, 2, … `largest`, on which the equation is solved without approximation.

    Parameters
    ----------
    largest : int
        2 … 3000.

    Returns
    -------
    ndarray
        x (K,).

    Raises
    ------
    BadInput
        If `largest` is out of range.
    """
    return np.arange(1.0, _checked_count(int(si(largest, "1", "largest", least=2.0))) + 1.0)


@checked
def log_sizes(largest: Any, per_decade: Any = 20) -> np.ndarray:
    """Logarithmic grid of sizes from 1 to at least `largest`; integers at first, then a constant ratio.

    The grid has integer sizes as long as their ratio exceeds 10^(1/per_decade).

    Parameters
    ----------
    largest : float
        > 1, e.g. 1e9.
    per_decade : float, optional
        Sizes per factor of ten, ≥ 4, so that the ratio is below 2, and ≤ 3000.

    Returns
    -------
    ndarray
        x (K,).

    Raises
    ------
    BadInput
        If a parameter is out of range, or there are more than 3000 sizes.
    """
    top = si(largest, "1", "largest", above=1.0)
    each = si(per_decade, "1", "per_decade", least=4.0, most=float(MAX_SIZES))
    ratio = 10.0 ** (1.0 / each)
    first = np.arange(1.0, min(np.ceil(1.0 / (ratio - 1.0)), np.ceil(top)) + 1.0)
    more = max(int(np.ceil(each * np.log10(top / first[-1]) - 1e-9)), 0)
    count = _checked_count(len(first) + more)
    return np.concatenate([first, first[-1] * ratio ** np.arange(1.0, count - len(first) + 1.0)])


@checked
def coagulate(
    kernel: KernelFunction,
    sizes: np.ndarray,
    numbers: np.ndarray | float,
    times: np.ndarray,
    *,
    mass: Any,
    until_size: Any = None,
    may_lose: Any = 1e-6,
    accuracy: Any = 1e-8,
    method: str = "BDF",
) -> SizeDistribution:
    """Solve the coagulation equation from t = 0 with an integrator of SciPy.

    Parameters
    ----------
    kernel : KernelFunction
        K(m1, m2) [m³/s] of two arrays of masses [kg], see `kinetics`.
    sizes : ndarray
        x (K,) ≥ 1, increasing, grains per cluster, see `all_sizes` and `log_sizes`.
    numbers : float or ndarray
        Initial densities n (K,) [1/m³] ≥ 0; one number: density of clusters of the first size.
    times : ndarray
        Times of the outputs (T,) [s] ≥ 0, increasing.
    mass : float or str
        Mass of a grain [kg] > 0.
    until_size : float, optional
        Mean size S > 0 at which the solution ends; None: no limit.
    may_lose : float, optional
        Fraction of the mass that may leave the grid at the largest size before the solution ends; above 0, below 1.
    accuracy : float, optional
        Relative error of n_k per step, 1e-12 … 1e-2. The absolute error of the mass fraction x_k n_k/Σ x n is 1e-4 of
        that, divided by x_k, so that small n_k of large sizes neither affect S nor reduce the step.
    method : str, optional
        "BDF": implicit, for any kernel; collisions of small with large clusters make the equation stiff. "DOP853":
        explicit, much faster for hundreds of sizes and growth by a few decades.

    Returns
    -------
    SizeDistribution
        The solution at the outputs that were reached.

    Raises
    ------
    BadInput
        If a parameter is out of range, or the kernel is not symmetric, finite and positive.
    SandError
        If the equation cannot be integrated.
    """
    if method not in METHODS:
        raise BadInput(f"method = {method!r}; {did_you_mean(str(method), METHODS)}")
    grain = si(mass, "kg", "mass", above=0.0)
    x, t = np.asarray(sizes, float), np.atleast_1d(np.asarray(times, float))
    if not _rises(x) or _checked_count(len(x)) < 2 or not x[0] >= 1.0:
        raise BadInput("sizes must be at least two finite numbers that rise and start at 1 or above")
    n = np.asarray(numbers, float)
    if n.ndim == 0:
        n = np.append(n, np.zeros(len(x) - 1))
    if n.shape != x.shape or not ((n >= 0.0) & np.isfinite(n)).all() or not n.sum() > 0.0:
        raise BadInput("numbers must be one finite density in 1/m^3, or one for each size, at least 0 and not all 0")
    if not _rises(t) or not t[0] >= 0.0:
        raise BadInput("times must be finite, at least 0 s, and rise")
    largest_mean = math.inf if until_size is None else si(until_size, "1", "until_size", above=0.0)
    loss = si(may_lose, "1", "may_lose", above=0.0, below=1.0)
    tolerance = si(accuracy, "1", "accuracy", least=1e-12)
    if tolerance > 1e-2:
        raise BadInput(f"accuracy = {shown(accuracy)} must be at most 0.01")
    return _solve(_Problem(kernel, x, n, grain, largest_mean, loss, tolerance, method), t)


class _Problem(NamedTuple):
    """Validated arguments of `coagulate`; the solution ends at the limits `mean_size` and `loss`."""

    kernel: KernelFunction
    sizes: np.ndarray
    numbers: np.ndarray
    grain: float
    mean_size: float  # infinite: no limit
    loss: float  # infinite: no limit
    tolerance: float
    method: str


def _solve(problem: _Problem, t: np.ndarray) -> SizeDistribution:
    """The solution at the times t [s], up to the first limit reached."""
    from scipy.integrate import BDF, solve_ivp

    class Implicit(BDF):  # SciPy leaves its higher differences uninitialised, and NumPy warns where it subtracts them
        def __init__(self, *args: Any, **kwargs: Any):
            super().__init__(*args, **kwargs)
            self.D[2:] = 0.0

    x, tolerance = problem.sizes, problem.tolerance
    grains = float((x * problem.numbers).sum())
    table, unit = _rates(problem.kernel, x * problem.grain)
    time_unit = 1.0 / (grains * unit)
    system = _System(x, table)

    def lost(_: float, y: np.ndarray) -> float:
        return y[-1] - problem.loss

    def large(_: float, y: np.ndarray) -> float:
        return float(x @ y[:-1]) / problem.mean_size - 1.0

    lost.terminal = large.terminal = True  # type: ignore[attr-defined]
    start = np.append(x * problem.numbers / grains, 0.0)
    end = max(t[-1] / time_unit, 1e-300)
    # LSODA is no alternative: it fails when its Adams formulas encounter a stiff system
    implicit = problem.method == "BDF"
    method, options = (Implicit, {"jac": system.jacobian}) if implicit else (problem.method, {})
    done = solve_ivp(
        system.change, (0.0, end), start, method, np.minimum(t / time_unit, end), events=[lost, large],
        rtol=tolerance, atol=1e-4 * tolerance / np.append(x, 1.0), **options,
    )  # fmt: skip
    if done.status < 0:
        raise SandError(
            f"the coagulation equation cannot be integrated beyond {done.t[-1] * time_unit:.3g} s: {done.message}"
        )
    outcome = COMPLETED if done.status == 0 else MASS_LOST if len(done.t_events[0]) else SIZE_REACHED
    reached = np.reshape(done.y, (len(start), -1))  # SciPy returns an empty list if no output was reached
    # the tighter solution has the same outputs, without limits of S and the loss
    solve_tighter = partial(_solve, problem._replace(mean_size=math.inf, loss=math.inf, tolerance=0.1 * tolerance))
    fractions = reached[:-1].T
    all_changes = np.reshape([system.change(0.0, column) for column in reached.T], (len(fractions), len(x) + 1))
    changes, loss = all_changes[:, :-1], all_changes[:, -1]
    on_grid = fractions.sum(axis=1)
    mean = fractions @ x / on_grid
    density = problem.grain * grains
    return SizeDistribution(
        times=t[: len(fractions)],
        sizes=x,
        numbers=grains * fractions / x,
        mean_size=mean,
        rate=(changes @ x - mean * changes.sum(axis=1)) / on_grid / time_unit,
        mass=density * on_grid,
        lost=density * reached[-1],
        loss_rate=density * loss / time_unit,
        outcome=outcome,
        solve_tighter=solve_tighter,
    )


class _System:
    """The system dy/dt = A (y_i y_j), y (K + 1,) the mass fractions of all sizes and of the mass that left the grid.

    A column of A belongs to a pair i ≥ j: the changes by one collision times K_ij/(x_i x_j); they add up to 0.
    """

    def __init__(self, sizes: np.ndarray, table: np.ndarray):
        from scipy.sparse import csr_array

        self.sizes, count = sizes, len(sizes)
        i, j = np.tril_indices(count)
        self.i, self.j = i, j
        total = sizes[i] + sizes[j]
        # a sum that equals the largest size to rounding remains on the grid
        total = np.where(np.isclose(total, sizes[-1], rtol=8.0 * np.finfo(float).eps, atol=0.0), sizes[-1], total)
        below = np.searchsorted(sizes, total, side="right") - 1
        gone = below == count - 1
        gone &= total > sizes[-1]
        inside, above = np.where(gone, 0, below), np.minimum(below + 1, count - 1)
        gap = np.where(above > inside, sizes[above] - sizes[inside], 1.0)
        # If the sum is distributed over the larger size and the next, the change of the larger size is computed
        # directly: the difference of two large numbers would cancel (Brauer et al. 2008).
        stays = (below == i) & ~gone
        upper = np.where(stays, sizes[j], total - sizes[inside]) / gap
        upper[gone] = 0.0
        weight = table[i, j] / (sizes[i] * sizes[j]) * np.where(i == j, 0.5, 1.0)
        loss_i = np.where(stays, -upper * sizes[i], -sizes[i])
        gain_below = np.where(gone | stays, 0.0, (1.0 - upper) * sizes[inside])
        values = np.concatenate([loss_i, -sizes[j], gain_below, upper * sizes[above], np.where(gone, total, 0.0)])
        rows = np.concatenate([i, j, inside, above, np.full(len(i), count)])
        pairs = np.tile(np.arange(len(i)), 5)
        values *= np.tile(weight, 5)
        nonzero = values != 0.0
        self.matrix = csr_array((values[nonzero], (rows[nonzero], pairs[nonzero])), shape=(count + 1, len(i)))
        self.pairs = np.arange(len(i))

    def change(self, _: float, y: np.ndarray) -> np.ndarray:
        """dy/dt per time unit."""
        return self.matrix @ (y[self.i] * y[self.j])

    def jacobian(self, _: float, y: np.ndarray) -> np.ndarray:
        """Jacobian ∂(dy/dt)/∂y (K + 1, K + 1)."""
        from scipy.sparse import csr_array

        values = np.concatenate([y[self.j], y[self.i]])
        indices = (np.concatenate([self.pairs, self.pairs]), np.concatenate([self.i, self.j]))
        return (self.matrix @ csr_array((values, indices), shape=(len(self.i), len(y)))).toarray()


def _rates(kernel: KernelFunction, masses: np.ndarray) -> tuple[np.ndarray, float]:
    """K of all pairs relative to K of two clusters of the first size, and the latter."""
    found = si_array(kernel(masses[:, None], masses[None, :]), "m^3/s", "kernel(m1, m2)")
    if found.shape != (len(masses), len(masses)):
        raise BadInput("the kernel must give one number for each pair of masses")
    if not (np.isfinite(found) & (found >= 0.0)).all() or not found[0, 0] > 0.0:
        raise BadInput("the kernel must be finite and at least 0, and above 0 for two clusters of the smallest size")
    if not np.allclose(found, found.T, rtol=1e-9, atol=0.0):
        raise BadInput("the kernel must be symmetric: K(m1, m2) = K(m2, m1)")
    return found / found[0, 0], float(found[0, 0])


def _checked_count(count: int) -> int:
    if count > MAX_SIZES:
        raise BadInput(
            f"{count} sizes exceed the limit of {MAX_SIZES}, since all pairs are kept in memory; use log_sizes"
        )
    return count


def _rises(values: np.ndarray) -> bool:
    """Whether an array is one-dimensional, not empty, finite and increasing."""
    return values.ndim == 1 and values.size > 0 and bool(np.isfinite(values).all() and (np.diff(values) > 0.0).all())
