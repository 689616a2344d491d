"""The kernel of populations of dilute dust: the fit of Eq. 14, exponents of aggregates, and degrees of growth."""

import math

import numpy as np
import pytest

from sand.basics.errors import BadInput
from sand.experiments.dilute_kernel import CLASSES, capture_sums, kernel_of
from sand.experiments.dilute_law import capture_law
from sand.experiments.dilute_results import degree, exponents, scaled_time

RADIUS, MASS, MOMENT, T = 1e-8, 3.298e-20, 6.596e-18, 100.0
BOLTZMANN, MU0 = 1.380649e-23, 4e-7 * math.pi * 1.00000000055
C, GAMMA = 0.36, 0.8


def capture_rate(first, second, gamma):
    """⟨π b_max² v⟩ of Eq. 14, π 3 (α/m̄)^(2/3) ⟨v^(−1/3)⟩ with α = μ₀μμ'/2π, by quadrature of Maxwell's distribution."""
    reduced = MASS * first * second / (first + second)
    alpha = MU0 / (2.0 * math.pi) * MOMENT**2 * (first * second) ** gamma
    x = np.linspace(0.0, 12.0, 200_001)[1:]
    weight = x**2 * np.exp(-0.5 * x**2)
    mean = (weight * x ** (-1.0 / 3.0)).sum() / weight.sum() * (BOLTZMANN * T / reduced) ** (-1.0 / 6.0)
    return 3.0 * math.pi * (alpha / reduced) ** (2.0 / 3.0) * mean


def drawn(seed, count=4000):
    """Draws of pairs of 1 to 30 grains, each of which hits with the probability K/K̂ = c K_14(γ)/K̂, K̂ = 1.5 K_14(1)."""
    rng = np.random.default_rng(seed)
    first, second = (np.floor(30.0 ** rng.random(count)) for _ in range(2))
    bound = 1.5 * capture_rate(first, second, 1.0)
    hits = rng.random(count) < C * capture_rate(first, second, GAMMA) / bound
    bodies = np.arange(count, dtype=float)
    columns = {"grains1": first, "grains2": second, "body1": bodies, "body2": bodies + count, "kernel": bound}
    for n, size in ((1, first), (2, second)):
        columns |= {f"mass{n}": MASS * size, f"moment{n}": MOMENT * size**GAMMA}
    return {**columns, "end": np.where(hits, 0.0, 1.0)}


def test_the_law_of_capture_is_found():
    """c, γ, and c of the net moments, within 4 standard errors of those from which the hits are drawn.

    Intervals of 8 populations are 2.36 standard errors wide on each side; errors are below 0.03.
    """
    law = capture_law([drawn(seed) for seed in range(8)], RADIUS, MASS, MOMENT, T)
    for found, true in zip(law, (C, GAMMA, C), strict=True):
        error = (found.high - found.low) / (2.0 * 2.365)
        assert 0.0 < error < 0.03 and abs(found.value - true) < 4.0 * error
    kernel = law.kernel(RADIUS, MASS, MOMENT, T)
    expected = law.factor.value * capture_rate(3.0, 7.0, law.exponent.value)
    assert kernel(3.0 * MASS, 7.0 * MASS) == pytest.approx(expected, rel=1e-4, abs=0.0)


def test_the_law_of_capture_needs_moments_and_sizes():
    """One line each; a single population has no interval."""
    with pytest.raises(BadInput, match="needs grains with a moment"):
        capture_law([drawn(1)], RADIUS, MASS, 0.0, T)
    equal = drawn(1) | dict.fromkeys(("grains1", "grains2"), np.ones(4000))
    with pytest.raises(BadInput, match="hits of bodies of different sizes"):
        capture_law([equal], RADIUS, MASS, MOMENT, T)
    assert math.isnan(capture_law([drawn(1)], RADIUS, MASS, MOMENT, T).factor.low)


def test_sums_of_classes_have_the_masses_of_bodies():
    """Hits and Σ K_14/K̂ of the class of the larger body, from single draws with the masses of both.

    Pairs whose moments cancel to rounding, and pairs of a body and its copy, do not count.
    """
    columns = {name: column[:4] for name, column in drawn(1).items()}
    columns |= {"grains1": np.array([1.0, 4.0, 1.0, 1.0]), "grains2": np.array([1.0, 1.0, 1.0, 1.0])}
    columns |= {"mass1": MASS * np.array([1.0, 4.0, 1.0, 1.0]), "mass2": np.full(4, MASS)}
    columns |= {"moment1": np.array([1.0, 3.0, 1e-15, 1.0]) * MOMENT, "moment2": np.full(4, MOMENT)}
    columns |= {"end": np.zeros(4), "body2": np.where(np.arange(4) == 3, columns["body1"], columns["body2"])}
    sums = capture_sums(columns, T)
    assert sums.hits.sum() == 2.0 and sums.hits[CLASSES.index(1)] == sums.hits[CLASSES.index(3)] == 1.0
    own = capture_rate(1.0, 1.0, 0.0) / columns["kernel"][0]
    assert sums.expected[0] == pytest.approx(own, rel=1e-4, abs=0.0) and sums.sizes[CLASSES.index(3)] == 4.0
    unequal = capture_rate(4.0, 1.0, 0.0) * 3.0 ** (2.0 / 3.0) / columns["kernel"][1]
    assert sums.expected[CLASSES.index(3)] == pytest.approx(unequal, rel=1e-4, abs=0.0)
    # α stays and m̄ becomes 8 times as large: K_14 ∝ m̄^(−2/3) m̄^(1/6) = m̄^(−1/2)
    heavy = capture_sums(columns | {f"mass{n}": 8.0 * columns[f"mass{n}"] for n in (1, 2)}, T)
    assert heavy.expected == pytest.approx(8.0**-0.5 * sums.expected, rel=1e-12, abs=0.0)


def test_the_kernel_of_classes_has_the_masses_of_their_bodies():
    """K = Σ hits/Σ(1/K̂) and mean masses of a class by hand; a pair of a body and its copy does not count."""
    columns = {name: column[:3] for name, column in drawn(1).items()}
    columns |= {"grains1": np.ones(3), "grains2": np.ones(3), "kernel": np.array([1.0, 2.0, 4.0]) * 1e-14}
    columns |= {"mass1": MASS * np.array([1.0, 2.0, 50.0]), "mass2": MASS * np.array([3.0, 4.0, 50.0])}
    columns |= {
        "end": np.array([0.0, 1.0, 0.0]),
        "body1": np.array([0.0, 1.0, 7.0]),
        "body2": np.array([2.0, 3.0, 7.0]),
    }
    (row,) = kernel_of([columns]).rows()
    assert row == pytest.approx((2.5 * MASS, 2.5 * MASS, 1e-14 / 1.5, 1.0), rel=1e-12, abs=0.0)


@pytest.mark.parametrize("value", [-0.5, 0.0, 0.6])
def test_the_degree_of_growth(value):
    """dS/dt = S^λ, integrated by the midpoint rule from S = 1 in 10⁵ steps of ln S: λ to 1e-4."""
    ends = np.linspace(0.0, math.log(20.0), 100_001)
    steps = np.exp((1.0 - value) * 0.5 * (ends[1:] + ends[:-1])) * ends[1]
    sizes = np.geomspace(2.0, 20.0, 40)
    times = 3e5 * np.interp(np.log(sizes), ends[1:], np.cumsum(steps))
    assert degree(sizes, times) == pytest.approx(value, rel=0.0, abs=1e-4)


def test_exponents_count_copies_once():
    """μ = N^0.8 and r_g = N^(1/1.5) exactly, but for a copied body that is off; its copies would change the fit."""
    grains = np.array([3.0, *np.arange(3.0, 14.0), 200.0])
    one = {"grains": grains, "moment": grains**0.8, "gyration_radius": grains ** (1.0 / 1.5)}
    one["body"] = np.arange(len(grains), dtype=float)
    assert exponents(one) == pytest.approx((0.8, 1.5), rel=1e-9, abs=0.0)
    one["moment"][0] = 30.0
    again = {name: np.concatenate([column, column[:1]]) for name, column in one.items()}
    assert exponents(again) == exponents(one) != pytest.approx((0.8, 1.5), rel=1e-3, abs=0.0)
    few = {name: column[:9] for name, column in one.items()}
    assert all(math.isnan(value) for value in exponents(few))


def test_scaled_times():
    """n₀t with n₀ of the first row; NaN if it was not reached."""
    ledger = {"clusters": np.array([100, 99]), "volume": np.array([2.0, 2.0]), "time": np.array([0.0, 3.0])}
    assert scaled_time(ledger, np.array([False, True])) == 150.0
    assert math.isnan(scaled_time(ledger, np.array([False, False])))
