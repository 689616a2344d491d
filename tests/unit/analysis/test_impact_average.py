"""Averages over impact parameters: weights, convergence, and the coverage of intervals on synthetic collisions."""

import numpy as np
import pytest

import sand
from sand.analysis.impact_average import impact_average, impact_parameters, impact_weights

TRUTH = 1.0 - 0.8
"""∫₀¹ f 2b db of f = 1 − 1.6 b²."""


def growth(b):
    """A growth efficiency that falls with b²."""
    return 1.0 - 1.6 * b**2


def test_even_squares_have_equal_weights():
    """b_k² = (k − ½)/n: the cells between midpoints of b² are all 1/n, so that the plain mean is the midpoint rule."""
    b = impact_parameters(7, 3.0)
    assert impact_weights(b[::-1], 3.0) == pytest.approx(np.full(7, 1 / 7), rel=1e-12, abs=0.0)
    # the midpoint rule is exact for linear functions of b², and has the error h²/24 Δ(df/du) of others
    assert growth(b / 3.0).mean() == pytest.approx(TRUTH, rel=1e-12, abs=0.0)
    found = np.mean(impact_parameters(50) ** 4)
    assert found == pytest.approx(1 / 3 - 2.0 / (24 * 50**2), rel=1e-12, abs=0.0)


def test_weights_of_any_impact_parameters():
    """0, 0.2, … 1: shares of b² nearest to each; exact for b², and ∫ b 2b db = 2/3 in the limit."""
    b = np.array([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
    weights = impact_weights(b, 1.0)
    assert weights.sum() == pytest.approx(1.0, rel=1e-12, abs=0.0)
    assert weights[:2] == pytest.approx([0.02, 0.08], rel=1e-12, abs=0.0)
    errors = []
    for n in (11, 101):
        many = np.linspace(0.0, 1.0, n)
        assert impact_weights(many, 1.0) @ growth(many) == pytest.approx(TRUTH, abs=1e-12)
        errors.append(abs(float(impact_weights(many, 1.0) @ many) - 2 / 3))
    assert errors[1] < 0.02 * errors[0]


@pytest.mark.parametrize("design", ["seeds share b", "own seeds", "sampled", "sampled, two per seed"])
def test_intervals_cover_the_truth(design):
    """95 % intervals of 2,000 synthetic campaigns cover the true average in 95 % of them, within 3 standard errors.

    f = 1 − 1.6 b² + noise, with a part that collisions of a seed share. The midpoint rule has no error for this f. The
    allowance of 0.01 is for Welch and Satterthwaite's approximation.
    """
    rng, covered, campaigns = np.random.default_rng(5), 0, 2000
    for _ in range(campaigns):
        sampled = design.startswith("sampled")
        if design == "seeds share b":
            b, seeds = np.tile(impact_parameters(6), 5), np.repeat(np.arange(5), 6)
        elif design == "own seeds":
            b, seeds = np.repeat(impact_parameters(6), 5), np.arange(30)
        else:
            b = np.sqrt(rng.random(30))
            seeds = np.repeat(np.arange(15), 2) if "two" in design else np.arange(30)
        of_seed = rng.normal(0.0, 0.3, 30)
        noise = of_seed[seeds] if design != "own seeds" else of_seed * (1.0 + b)
        found = impact_average(growth(b) + noise + rng.normal(0.0, 0.2, 30), b, seeds, sampled=sampled)
        covered += found.low <= TRUTH <= found.high
    assert covered / campaigns == pytest.approx(0.95, abs=3 * np.sqrt(0.95 * 0.05 / campaigns) + 0.01)


def test_without_a_second_seed_there_is_no_interval():
    """The average of one seed has no error; of seeds that share some impact parameters neither."""
    b = impact_parameters(4)
    one = impact_average(growth(b), b, np.zeros(4))
    assert one.mean == pytest.approx(TRUTH, rel=1e-12, abs=0.0) and np.isnan([one.error, one.low, one.high]).all()
    some = impact_average(growth(b[[0, 1, 2, 3, 0]]), b[[0, 1, 2, 3, 0]], [1, 1, 1, 1, 2])
    assert np.isnan(some.error) and some.collisions == 5


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: impact_average([1.0, 2.0], [0.1], [1, 2]), "columns of equal length"),
        (lambda: impact_average([1.0, np.nan], [0.1, 0.2], [1, 2]), "values must be finite"),
        (lambda: impact_average([1.0, 2.0], [0.1, 1.2], [1, 2]), "from 0 to most"),
        # lengths [m] as in the table of a sweep, of which the largest would get all the weight
        (lambda: impact_average([1.0, 2.0], [1e-7, 2e-7], [1, 1]), "most is missing: .* up to 2e-07 are no fractions"),
        (lambda: impact_weights(np.array([0.1, 0.1]), 1.0), "different from each other"),
        (lambda: impact_parameters(0), "number = 0"),
        (lambda: impact_parameters(3, -1.0), "most = -1.0 must be above 0"),
    ],
)
def test_wrong_columns(call, message):
    """One line."""
    with pytest.raises(sand.BadInput, match=message):
        call()
