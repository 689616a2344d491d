"""SizeDistribution of many clusters that stick whenever they meet: Smoluchowski's (1916) coagulation equation.

    dn_k/dt = ½ Σ_{i+j=k} K_ij n_i n_j − n_k Σ_j K_kj n_j

Clusters have sizes x_k, in grains.  Where all sums of sizes are sizes the equation is solved as it stands; on any
other grid a sum between two sizes is shared so that number and mass are kept (Kovetz & Olund 1969, as Brauer et al.
2008 use it).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ..arguments import checked
from ..errors import BadInput, SandError, did_you_mean
from ..units import si
from .kinetics import Rate
from .size_distribution import FULL, LARGE, LEFT, SizeDistribution

MOST_SIZES = 3000
"""All pairs are held in memory: 4.5 million, some 300 MB."""
METHODS = ("BDF", "DOP853")


@checked
def all_sizes(largest: int) -> np.ndarray:
    """x = 1, 2, … largest: no size is left out, nothing is shared.  2 … 3000; raises BadInput."""
    count = int(si(largest, "1", "largest", least=2.0))
    _few_enough(count)
    return np.arange(1.0, count + 1.0)


@checked
def log_sizes(largest: Any, per_decade: Any = 20) -> np.ndarray:
    """x (K,) from 1 to at least `largest`: whole numbers while they are closer than the ratio, then that ratio.

    Parameters
    ----------
    largest
        > 1, e.g. 1e9.
    per_decade : optional
        sizes in a factor of ten, ≥ 4, so that twice a size is never the next one.

    Raises
    ------
    BadInput
        out of range, or more than 3000 sizes.
    """
    top, each = si(largest, "1", "largest", above=1.0), si(per_decade, "1", "per_decade", least=4.0)
    ratio = 10.0 ** (1.0 / each)
    first = np.arange(1.0, min(np.ceil(1.0 / (ratio - 1.0)), np.ceil(top)) + 1.0)
    more = max(int(np.ceil(each * np.log10(top / first[-1]) - 1e-9)), 0)
    _few_enough(len(first) + more)
    return np.concatenate([first, first[-1] * ratio ** np.arange(1.0, more + 1.0)])


@checked
def coagulate(
    kernel: Rate,
    sizes: Sequence[float] | np.ndarray,
    numbers: Any,
    times: Any,
    *,
    mass: Any,
    until_size: Any = None,
    may_lose: Any = 1e-6,
    accuracy: Any = 1e-8,
    method: str = "BDF",
) -> SizeDistribution:
    """Solve Smoluchowski's equation from t = 0 with one of SciPy's integrators.

    Parameters
    ----------
    kernel : Rate
        K(m1, m2) [m³/s] of two arrays of masses [kg], see `kinetics`.
    sizes : Sequence[float] or ndarray
        x (K,) ≥ 1, rising, grains per cluster, see `all_sizes` and `log_sizes`.
    numbers
        n(t=0) (K,) [1/m³] ≥ 0; one number: so many clusters of the first size.
    times
        (T,) [s] ≥ 0, rising.
    mass
        of a grain [kg] > 0.
    until_size : optional
        the mean size S > 0 at which to stop; None: never.
    may_lose : optional
        part of the mass that may leave through the top of the grid, above 0, below 1; beyond it all ends.
    accuracy : optional
        error of a step over n_k, 1e-12 … 1e-2; but no better than 1e-4 of it of all grains, divided by x_k,
        so that the far tail can neither spoil S nor hold up the rest.
    method : str, optional
        "BDF", implicit, for any kernel: small clusters that meet large ones make the equation stiff; "DOP853",
        explicit, many times faster for hundreds of sizes and growth by a few decades.

    Raises
    ------
    BadInput
        out of range, or a kernel that is not symmetric, finite and positive.
    SandError
        the equation cannot be integrated.
    """
    if method not in METHODS:
        raise BadInput(f"method = {method!r}; {did_you_mean(str(method), METHODS)}")
    grain = si(mass, "kg", "mass", above=0.0)
    x, n, t = _sizes(sizes), _densities(numbers, np.size(sizes)), _times(times)
    goal = math.inf if until_size is None else si(until_size, "1", "until_size", above=0.0)
    loss, tolerance = si(may_lose, "1", "may_lose", above=0.0), si(accuracy, "1", "accuracy")
    if not loss < 1.0 or not 1e-12 <= tolerance <= 1e-2:
        raise BadInput(f"may_lose = {may_lose!r} must be below 1, and accuracy = {accuracy!r} in 1e-12 … 1e-2")
    return _solved(_Question(kernel, x, n, grain, goal, loss, tolerance, method), t)


class _Question(NamedTuple):
    """The arguments of `coagulate`, checked; `goal` and `loss` are where to stop, infinite for never."""

    kernel: Rate
    sizes: np.ndarray
    numbers: np.ndarray
    grain: float
    goal: float
    loss: float
    tolerance: float
    method: str


def _solved(asked: _Question, t: np.ndarray) -> SizeDistribution:
    """The answer at times t [s], as far as it goes."""
    from scipy.integrate import solve_ivp

    x, tolerance = asked.sizes, asked.tolerance
    grains = float((x * asked.numbers).sum())
    table, unit = _rates(asked.kernel, x * asked.grain)
    clock = 1.0 / (grains * unit)
    system = _System(x, table)

    def lost(_: float, y: np.ndarray) -> float:
        return y[-1] - asked.loss

    def large(_: float, y: np.ndarray) -> float:
        return float(x @ y[:-1]) / asked.goal - 1.0

    lost.terminal = large.terminal = True  # type: ignore[attr-defined]
    begin = np.append(x * asked.numbers / grains, 0.0)
    end = max(t[-1] / clock, 1e-300)
    # LSODA, SciPy's third one for this, gives up in the middle where its Adams formulas meet a stiff system.
    options = {"jac": system.jacobian} if asked.method == "BDF" else {}
    done = solve_ivp(
        system.change, (0.0, end), begin, asked.method, np.minimum(t / clock, end), events=[lost, large],
        rtol=tolerance, atol=1e-4 * tolerance / np.append(x, 1.0), **options,
    )  # fmt: skip
    if done.status < 0:
        raise SandError(
            f"the growth of clusters cannot be integrated beyond {done.t[-1] * clock:.3g} s: {done.message}"
        )
    outcome = FULL if done.status == 0 else LEFT if len(done.t_events[0]) else LARGE
    reached = np.reshape(done.y, (len(begin), -1))  # SciPy gives an empty list where no output was reached
    # once more it goes to the same outputs, whatever S and the loss are there
    again = partial(_solved, asked._replace(goal=math.inf, loss=math.inf, tolerance=0.1 * tolerance))
    return _told(system, reached, t[: reached.shape[1]], (grains, clock, asked.grain), outcome, again)


def _told(
    system: _System, y: np.ndarray, times: np.ndarray, units: tuple[float, float, float], outcome: str, again: Any
) -> SizeDistribution:
    grains, clock, grain = units
    x, parts = system.sizes, y[:-1].T
    all_changes = np.reshape([system.change(0.0, column) for column in y.T], (len(parts), len(x) + 1))
    changes, loss = all_changes[:, :-1], all_changes[:, -1]
    held = parts.sum(axis=1)
    mean = parts @ x / held
    rate = (changes @ x - mean * changes.sum(axis=1)) / held / clock
    density = grain * grains
    return SizeDistribution(
        times,
        x,
        grains * parts / x,
        mean,
        rate,
        density * held,
        density * y[-1],
        density * loss / clock,
        outcome,
        again,
    )


class _System:
    """dy/dt = A (y_i y_j), y the part of the mass in each size, and at the end the part that has left the grid.

    A column of A is a pair i ≥ j: what one meeting takes and gives, times K_ij/(x_i x_j).  Its entries add up to 0.
    """

    def __init__(self, sizes: np.ndarray, table: np.ndarray):
        from scipy.sparse import csr_array

        self.sizes, count = sizes, len(sizes)
        i, j = np.tril_indices(count)
        self.i, self.j = i, j
        total = sizes[i] + sizes[j]
        # a sum that is the largest size but for rounding stays on the grid
        total = np.where(np.isclose(total, sizes[-1], rtol=8.0 * np.finfo(float).eps, atol=0.0), sizes[-1], total)
        below = np.searchsorted(sizes, total, side="right") - 1
        gone = below == count - 1
        gone &= total > sizes[-1]
        inside, above = np.where(gone, 0, below), np.minimum(below + 1, count - 1)
        gap = np.where(above > inside, sizes[above] - sizes[inside], 1.0)
        # The larger one may stay where it is and only pass on a little: its change is written down as such, since
        # the difference of two large numbers would not be (Brauer et al. 2008).
        stays = (below == i) & ~gone
        upper = np.where(stays, sizes[j], total - sizes[inside]) / gap
        upper[gone] = 0.0
        weight = table[i, j] / (sizes[i] * sizes[j]) * np.where(i == j, 0.5, 1.0)
        taken_i = np.where(stays, -upper * sizes[i], -sizes[i])
        given = np.where(gone | stays, 0.0, (1.0 - upper) * sizes[inside])
        values = np.concatenate([taken_i, -sizes[j], given, upper * sizes[above], np.where(gone, total, 0.0)])
        rows = np.concatenate([i, j, inside, above, np.full(len(i), count)])
        pairs = np.tile(np.arange(len(i)), 5)
        values *= np.tile(weight, 5)
        some = values != 0.0
        self.matrix = csr_array((values[some], (rows[some], pairs[some])), shape=(count + 1, len(i)))
        self.pairs = np.arange(len(i))

    def change(self, _: float, y: np.ndarray) -> np.ndarray:
        """dy/dt, in units of the clock."""
        return self.matrix @ (y[self.i] * y[self.j])

    def jacobian(self, _: float, y: np.ndarray) -> np.ndarray:
        """∂(dy/dt)/∂y (K+1, K+1)."""
        from scipy.sparse import csr_array

        values = np.concatenate([y[self.j], y[self.i]])
        where = (np.concatenate([self.pairs, self.pairs]), np.concatenate([self.i, self.j]))
        return (self.matrix @ csr_array((values, where), shape=(len(self.i), len(y)))).toarray()


def _rates(kernel: Rate, masses: np.ndarray) -> tuple[np.ndarray, float]:
    """K of all pairs over that of two of the first, and this one."""
    found = np.asarray(kernel(masses[:, None], masses[None, :]), float)
    if found.shape != (len(masses), len(masses)):
        raise BadInput("the kernel must give one number for each pair of masses")
    if not (np.isfinite(found) & (found >= 0.0)).all() or not found[0, 0] > 0.0:
        raise BadInput("the kernel must be finite and at least 0, and above 0 for two of the smallest")
    if not np.allclose(found, found.T, rtol=1e-9, atol=0.0):
        raise BadInput("the kernel must be symmetric: K(m1, m2) = K(m2, m1)")
    return found / found[0, 0], float(found[0, 0])


def _few_enough(count: int) -> None:
    if count > MOST_SIZES:
        raise BadInput(f"{count} sizes are more than {MOST_SIZES}, for all pairs are held in memory; use log_sizes")


def _sizes(sizes: Any) -> np.ndarray:
    x = _numbers(sizes, "sizes")
    if x.ndim != 1 or len(x) < 2 or not (np.diff(x) > 0.0).all() or not x[0] >= 1.0:
        raise BadInput("sizes must be at least two, rise, and begin at 1 or above")
    _few_enough(len(x))
    return x


def _densities(numbers: Any, count: int) -> np.ndarray:
    n = _numbers(numbers, "numbers")
    if n.ndim == 0:
        n = np.append(n, np.zeros(count - 1))
    if n.shape != (count,) or not (n >= 0.0).all() or not n.sum() > 0.0:
        raise BadInput("numbers must be one density in 1/m^3, or one for each size, at least 0 and not all 0")
    return n


def _times(times: Any) -> np.ndarray:
    t = np.atleast_1d(_numbers(times, "times"))
    if t.ndim != 1 or not len(t) or not t[0] >= 0.0 or not (np.diff(t) > 0.0).all():
        raise BadInput("times must be at least 0 s, and rise")
    return t


def _numbers(values: Any, name: str) -> np.ndarray:
    try:
        found = np.asarray(values, float)
    except (TypeError, ValueError):
        raise BadInput(f"{name} must be numbers") from None
    if not np.isfinite(found).all():
        raise BadInput(f"{name} must be finite numbers")
    return found
