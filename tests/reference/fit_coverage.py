"""Share of 95 % intervals that contain the true value, for synthetic ensembles of eight boxes.

`python -m tests.reference.fit_coverage` writes fit-coverage.csv beside this file.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
from scipy.stats import t as student

from sand.analysis.fits import mean_interval, power_law
from sand.analysis.fractal import ensemble_dimension
from sand.analysis.growth_law import rate_law
from sand.basics.errors import BadInput
from sand.experiments.growth import FIRST_SIZE, LARGEST_PART, _within
from sand.io.table import write_table
from sand.theory import kinetics
from sand.theory.smoluchowski import coagulate, log_sizes

TABLE = Path(__file__).with_name("fit-coverage.csv")
BOXES = 8
GRAINS = 125
SPREAD = 0.58
"""Standard deviation of ln S of a box: that of the boxes of docs/physics/growth.md, 17.5/27.6 of the mean."""
Interval = tuple[float, float]


def _by_student(values: np.ndarray) -> Interval:
    """Mean ± t(7 degrees of freedom) standard errors."""
    half = student.ppf(0.975, len(values) - 1) * values.std(ddof=1) / np.sqrt(len(values))
    return values.mean() - half, values.mean() + half


def size(rng: np.random.Generator) -> tuple[Interval, float]:
    """Interval of the mean of S, which is lognormal, from ln S."""
    return mean_interval(np.exp(SPREAD * rng.normal(size=BOXES))), float(np.exp(SPREAD**2 / 2.0))


def symmetric_size(rng: np.random.Generator) -> tuple[Interval, float]:
    """The same as mean ± t standard errors."""
    return _by_student(np.exp(SPREAD * rng.normal(size=BOXES))), float(np.exp(SPREAD**2 / 2.0))


def log_size(rng: np.random.Generator) -> tuple[Interval, float]:
    """Interval of the mean of ln S of the same boxes."""
    return _by_student(SPREAD * rng.normal(size=BOXES)), 0.0


def _aggregates(rng: np.random.Generator, exponent: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sizes N, y = N^exponent with scatter per cluster (0.25 in ln y) and per box, and the box of each cluster.

    A box has 40 clusters; its exponent scatters by 0.1, its factor by 0.1, as boxes with few large clusters do.
    """
    box = np.repeat(np.arange(BOXES), 40)
    n = np.minimum(np.round(3.0 * rng.pareto(1.5, len(box)) + 3.0), GRAINS)
    own = exponent + 0.1 * rng.normal(size=BOXES)[box]
    noise = 0.1 * rng.normal(size=BOXES)[box] + 0.25 * rng.normal(size=len(box))
    return n, np.exp(own * np.log(n) + noise), box


def moment(rng: np.random.Generator) -> tuple[Interval, float]:
    """Interval of γ of μ ∝ N^γ."""
    found = power_law(*_aggregates(rng, 0.6))
    return (found.low, found.high), 0.6


def dimension(rng: np.random.Generator) -> tuple[Interval, float]:
    """Interval D ± t(7) standard errors of the fractal dimension."""
    n, radius, box = _aggregates(rng, 1.0 / 1.5)
    found = ensemble_dimension(n, radius, 1.0, box)
    half = float(student.ppf(0.975, BOXES - 1)) * found.error
    return (found.value - half, found.value + half), 1.5


def coagulated(rng: np.random.Generator, table: np.ndarray, times: np.ndarray, largest: float) -> np.ndarray:
    """S(t) of one box by Gillespie's algorithm until S exceeds `largest`, then constant.

    `table` (N + 1, N + 1) is K of all pairs of sizes relative to K of two grains; two clusters collide at the rate K/N,
    so that dS/dt = 1 at S = 1 for many grains.
    """
    grains = len(table) - 1
    size, count, now, squares = np.ones(grains, int), grains, 0.0, float(grains)
    rates = np.full(grains, grains - 1.0)  # of each cluster with all others
    at, sizes = [0.0], [1.0]
    while count > 1 and sizes[-1] <= largest:
        sums = np.cumsum(rates[:count])
        now += rng.exponential(2.0 * grains / sums[-1])
        first = int(np.searchsorted(sums, rng.uniform(0.0, sums[-1])))
        own = table[size[first], size[:count]]
        own[first] = 0.0
        sums = np.cumsum(own)
        other = int(np.searchsorted(sums, rng.uniform(0.0, sums[-1])))
        squares += 2.0 * size[first] * size[other]
        new = table[size[first] + size[other], size[:count]]
        rates[:count] += new - own - table[size[other], size[:count]]
        size[first] += size[other]
        new[[first, other]] = 0.0
        rates[first] = new.sum()
        count -= 1
        size[other], rates[other] = size[count], rates[count]
        at.append(now)
        sizes.append(squares / grains)
    return np.array(sizes)[np.searchsorted(at, times, side="right") - 1]


KERNELS: dict[str, Callable[[float], Callable[[np.ndarray, np.ndarray], np.ndarray]]] = {
    "constant": lambda _: kinetics.constant(1.0),
    "Brownian": lambda degree: kinetics.power(1.0, 1.0, degree + 0.5, -0.5),
    "product": lambda degree: lambda one, other: (one * other) ** (0.5 * degree),
    "sum": lambda degree: lambda one, other: 0.5 * (one**degree + other**degree),
    "reduced mass": lambda degree: kinetics.power(1.0, 1.0, 0.0, degree),
}
"""Kernels of a degree; "product" and "sum" are not among those that are fitted."""


@lru_cache
def _kernel_table(kernel: str, degree: float, grains: int) -> tuple[np.ndarray, np.ndarray]:
    """K of all pairs of sizes, and 120 times at which an infinite system grows to S = 0.15 N, evenly."""
    function = KERNELS[kernel](degree)
    n = np.arange(1.0, grains + 1.0)
    table = np.zeros((grains + 1, grains + 1))
    table[1:, 1:] = function(n[:, None], n[None, :])
    times, largest = np.geomspace(0.1, 1e4, 400), 0.15 * grains
    grown = coagulate(function, log_sizes(100.0 * largest, 20), 1.0, times, mass=1.0, until_size=largest, accuracy=1e-5)
    return table, np.linspace(0.0, grown.times[-1], 121)[1:]


def boxes(rng: np.random.Generator, kernel: str, z: float, grains: int) -> tuple[np.ndarray, np.ndarray]:
    """Times, and S (boxes, times) of one ensemble, in the window of `sand analyse`."""
    table, times = _kernel_table(kernel, 1.0 - 1.0 / z, grains)
    largest = BOXES * LARGEST_PART * grains  # of one box, if the others had none
    sizes = np.array([coagulated(rng, table, times, largest) for _ in range(BOXES)])
    return _within(times, sizes, (FIRST_SIZE, LARGEST_PART * grains))


def exponent(rng: np.random.Generator, kernel: str, z: float, grains: int) -> tuple[Interval, float]:
    """Interval of z of stochastic coagulation."""
    found = rate_law(*boxes(rng, kernel, z, grains), grains)
    return (found.low, found.high), z


CASES = {
    "mean S, lognormal": size,
    "mean S, lognormal, symmetric interval": symmetric_size,
    "mean ln S, lognormal": log_size,
    "gamma": moment,
    "fractal dimension": dimension,
    **{
        f"z = {z:g}, {kernel}, {grains} grains": partial(exponent, kernel=kernel, z=z, grains=grains)
        for grains, kernels in (
            (GRAINS, ("Brownian", "product", "sum", "reduced mass")),
            (1000, ("Brownian", "product")),
        )
        for z, names in ((1.0, ("constant",)), (2.0, kernels), (3.33, kernels))
        for kernel in names
    },
}


def coverage(name: str, ensembles: int, seed: int = 1) -> dict[str, float | str]:
    """Share of ensembles whose interval contains the true value, and of those that lie below or above it."""
    rng = np.random.default_rng(seed)
    low, high, true = np.full(ensembles, np.nan), np.full(ensembles, np.nan), np.nan
    for k in range(ensembles):
        try:
            (low[k], high[k]), true = CASES[name](rng)
        except BadInput:  # no fit
            continue
    fitted = np.isfinite(low)
    inside = (low <= true) & (true <= high)
    return {
        "quantity": name,
        "ensembles": int(fitted.sum()),
        "coverage": f"{inside[fitted].mean():.3f}",
        "too_low": f"{(high < true)[fitted].mean():.3f}",
        "too_high": f"{(low > true)[fitted].mean():.3f}",
    }


ENSEMBLES = {name: 4000 if not name.startswith("z") else 40 if name.endswith("1000 grains") else 200 for name in CASES}

if __name__ == "__main__":
    write_table(TABLE, [coverage(name, count) for name, count in ENSEMBLES.items()])
