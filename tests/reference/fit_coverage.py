"""Share of 95 % intervals that contain the true value, for synthetic ensembles of eight boxes.

`python -m tests.reference.fit_coverage` writes fit-coverage.csv beside this file.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.stats import t as student

from sand.analysis.fits import mean_interval, power_law, rate_law
from sand.analysis.fractal import ensemble_dimension
from sand.errors import BadInput
from sand.experiments.growth import FIRST_SIZE, LARGEST_PART, _within
from sand.io.table import write_table

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


def _coagulated(rng: np.random.Generator, times: np.ndarray, grains: int) -> np.ndarray:
    """S(t) of one box with a constant kernel, by Gillespie's algorithm; S = 1 + 2t for many grains."""
    clusters, now, squares = [1] * grains, 0.0, float(grains)
    at, sizes = [0.0], [1.0]
    while len(clusters) > 1:
        count = len(clusters)
        now += rng.exponential(grains / (count * (count - 1)))  # every pair at the rate 2/N
        first = clusters.pop(int(rng.integers(count)))
        other = int(rng.integers(count - 1))
        squares += 2.0 * first * clusters[other]
        clusters[other] += first
        at.append(now)
        sizes.append(squares / grains)
    return np.array(sizes)[np.searchsorted(at, times, side="right") - 1]


def exponent(rng: np.random.Generator, grains: int = GRAINS) -> tuple[Interval, float]:
    """Interval of z of a constant kernel, z = 1, in the window of `sand analyse`."""
    times = np.linspace(0.1, 12.0, 120)
    sizes = np.array([_coagulated(rng, times, grains) for _ in range(BOXES)])
    found = rate_law(*_within(times, sizes, (FIRST_SIZE, LARGEST_PART * grains)))
    return (found.low, found.high), 1.0


def exponent_of_larger_boxes(rng: np.random.Generator) -> tuple[Interval, float]:
    """The same with 1000 grains per box, which are hardly depleted."""
    return exponent(rng, 1000)


CASES = {
    "mean S, lognormal": size,
    "mean S, lognormal, symmetric interval": symmetric_size,
    "mean ln S, lognormal": log_size,
    "gamma": moment,
    "fractal dimension": dimension,
    "z, constant kernel, 125 grains": exponent,
    "z, constant kernel, 1000 grains": exponent_of_larger_boxes,
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


ENSEMBLES = {name: 300 if name.startswith("z") else 4000 for name in CASES}
ENSEMBLES["z, constant kernel, 1000 grains"] = 100

if __name__ == "__main__":
    write_table(TABLE, [coverage(name, count) for name, count in ENSEMBLES.items()])
