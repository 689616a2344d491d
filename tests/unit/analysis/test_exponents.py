"""Errors of growth exponents, and results that must not depend on rounding."""

import copy
import math
import pickle

import numpy as np
import pytest

import sand
from sand import theory
from sand.analysis.fits import power_law, separation
from sand.analysis.fractal import correlation_dimension
from sand.analysis.growth_law import rate_law
from sand.experiments import kernel_table
from sand.theory import kinetics
from sand.theory.exponents import Outputs, exponent_fit
from sand.theory.smoluchowski import all_sizes, coagulate, log_sizes

DENSITY, RATE, MASS = 1e18, 1e-14, 1e-20
TAU = 2.0 / (RATE * DENSITY)
RNG = np.random.default_rng(23)
SIZE = np.geomspace(10.0, 100.0, 12)


def fitted(rate, *others, sizes=100, size=SIZE):
    found = Outputs(size, rate)
    return exponent_fit(found, tuple(Outputs(size, other) for other in others) or (found,), sizes)


def test_the_error_of_scattered_outputs_is_that_of_least_squares():
    """λ, its standard error and Student's interval (6 degrees of freedom: 2.4469) against NumPy's fit; ends z(λ).

    The scatter is symmetric in each half of the outputs, so that it causes no curvature.
    """
    size = np.geomspace(10.0, 100.0, 8)
    rate = 3.0 * size**0.4 * np.exp(0.05 * np.tile([1, -1, -1, 1], 2))
    (slope, _), covariance = np.polyfit(np.log(size), np.log(rate), 1, cov=True)
    fit = fitted(rate, size=size)
    assert fit.degree == pytest.approx(slope, rel=1e-10, abs=0.0)
    assert fit.degree_error == pytest.approx(math.sqrt(covariance[0, 0]), rel=1e-10, abs=0.0)
    assert fit.half_width == pytest.approx(2.4469 * fit.degree_error, rel=1e-4, abs=0.0)
    for z, degree in [(fit.exponent, slope), (fit.low, slope - fit.half_width), (fit.high, slope + fit.half_width)]:
        assert z == pytest.approx(1.0 / (1.0 - degree), rel=1e-9, abs=0.0)


def test_coverage_of_the_95_percent_interval():
    """400 noisy lines: at least 380 − 4 standard deviations, √(400 · 0.95 · 0.05) = 4.4, contain λ = 0.4."""
    held = 0
    for _ in range(400):
        fit = fitted(SIZE**0.4 * np.exp(0.05 * RNG.normal(size=12)))
        held += fit.low < 1.0 / 0.6 < fit.high
    assert held > 380 - 4 * 4.4


def test_the_error_includes_the_curvature():
    """λ = 0.3 in the first half of the outputs and 0.5 in the last: λ = 0.4 ± 0.2."""
    u = np.log(SIZE) - np.log(SIZE).mean()
    fit = fitted(np.exp(0.4 * u + 0.1 * np.abs(u)))
    assert fit.degree == pytest.approx(0.4, rel=1e-10, abs=0.0)
    assert fit.degree_error == pytest.approx(0.2, rel=1e-10, abs=0.0)


def test_the_error_includes_the_numerical_error():
    """Exact lines: the error of λ = 0.4 is at least the change to 0.41 (tighter solver) or 0.37 (other counting)."""
    fit = fitted(SIZE**0.4, SIZE**0.41)
    assert fit.degree_error == pytest.approx(0.01, rel=1e-9, abs=0.0)
    assert fitted(SIZE**0.4, SIZE**0.41, SIZE**0.37).degree_error == pytest.approx(0.03, rel=1e-9, abs=0.0)


def test_exponential_growth_with_rounding_errors():
    """dS/dt = S with errors up to K 2⁻⁵², as in sums over K sizes: λ = 1 is always in the interval."""
    for sizes in (2, 30, 3000):
        for _ in range(100):
            noise = 1.0 + sizes * 2.0**-52 * RNG.uniform(-1, 1, size=(2, 12))
            fit = fitted(SIZE * noise[0], SIZE * noise[0], size=SIZE * noise[1], sizes=sizes)
            assert math.isinf(fit.high) and fit.half_width < 1e-9


@pytest.mark.slow
def test_interval_of_exact_growth():
    """Constant kernel, S = 1 + 2t/τ: λ = 0, z = 1, to rounding if all sizes are kept (300: e^−60 is lost).

    λ = 0.3 on a logarithmic grid, which has no scale: z = 1/0.7; from S = 10³ to 10⁴ λ still changes by 2e-5.
    """
    constant = coagulate(
        kinetics.constant(RATE), all_sizes(300), DENSITY, np.linspace(0, 5, 12) * TAU, mass=MASS, method="DOP853"
    )
    fit = constant.exponent_fit()
    assert fit.low <= 1.0 <= fit.high and fit.high - fit.low < 1e-10
    assert constant.exponent() == fit.exponent
    kernel = kinetics.power(RATE, MASS, 0.8, -0.5)
    times = np.geomspace(0.1, 1e20, 500) * TAU
    grown = coagulate(kernel, log_sizes(1e7, 6), DENSITY, times, mass=MASS, until_size=1e4, accuracy=1e-5)
    fit = grown.exponent_fit()
    assert fit.low <= 1.0 / 0.7 <= fit.high and 1e-12 < fit.high - fit.low < 5e-4


def test_loss_rate_at_the_largest_size():
    """d lost/dt against differences: 1e-3 for steps of 1 % of its growth time."""
    times = np.linspace(0.5, 0.5001, 3) * TAU
    grown = coagulate(
        kinetics.constant(RATE), all_sizes(5), DENSITY, times, mass=MASS, method="DOP853", may_lose=0.9, accuracy=1e-12
    )
    slope = (grown.lost[2] - grown.lost[0]) / (times[2] - times[0])
    assert grown.loss_rate[1] == pytest.approx(slope, rel=1e-3, abs=0.0)


def test_copies_of_growth():
    """A copy for another process has no kernel; it has the exponent if that was computed before."""
    grown = coagulate(
        kinetics.constant(RATE), all_sizes(30), DENSITY, np.linspace(0, 1, 9) * TAU, mass=MASS, may_lose=0.1
    )
    with pytest.raises(sand.BadInput, match="no kernel"):
        copy.deepcopy(grown).exponent()
    assert pickle.loads(pickle.dumps(grown)).mean_size.tolist() == grown.mean_size.tolist()
    assert grown.exponent() == copy.deepcopy(grown).exponent()


def test_sizes_that_do_not_grow_have_no_exponent():
    """Three outputs at one time: S differs in the last digits."""
    with pytest.raises(sand.BadInput, match="hardly changes"):
        fitted(np.ones(12), size=1.0 + 1e-15 * np.arange(12))


def test_outputs_at_the_edge_of_a_decade_count():
    """S = 4, 8, 40 is one decade of three outputs, though the first S may be slightly below 4."""
    for factor in (1.0 / 3.0, 0.7, 1.1):
        size = np.array([4.0, 8.0, 40.0]) * factor
        times = 0.5 * (size - 1.0) * TAU
        grown = coagulate(kinetics.constant(RATE), log_sizes(2e3, 5), DENSITY, times, mass=MASS, accuracy=1e-4)
        grown.__dict__["mean_size"] = size * np.array([1.0 - 1e-13, 1.0, 1.0])
        assert grown.exponent_fit().points == 3


def test_sums_of_sizes_at_the_top_of_the_grid_stay():
    """Two of half the largest size, up to rounding, become the largest size: no loss."""
    times = np.array([0.3, 0.6]) * TAU
    for top in (2.0, 2.0 * (1.0 - 2.0**-52), 2.0 * (1.0 + 2.0**-52)):
        grown = coagulate(kinetics.constant(RATE), [1.0, top], DENSITY, times[:1], mass=MASS, may_lose=0.9)
        exact = coagulate(kinetics.constant(RATE), [1.0, 2.0], DENSITY, times[:1], mass=MASS, may_lose=0.9)
        assert grown.lost == pytest.approx(exact.lost, rel=1e-6, abs=0.0)
        assert (grown.mass + grown.lost) / (MASS * DENSITY) == pytest.approx(1.0, rel=1e-13, abs=0.0)


def test_exponents_that_add_up_to_one():
    """0.7 + 0.2 + 0.1 = 1 − 1e-16 in floating point gives no z of 1e16; 0.999 gives 1000."""
    assert 0.7 + 0.2 + 0.1 < 1.0
    with pytest.raises(sand.BadInput, match="not a power of time"):
        theory.dynamic_exponent(0.7 + 0.2, 0.1)
    assert theory.dynamic_exponent(0.799, 0.2) == pytest.approx(1000.0, rel=1e-9, abs=0.0)


def test_values_equal_to_rounding_are_equal():
    """0.1 + 0.2 and 0.3: ensembles do not differ by infinitely many errors; a power law has no slope."""
    assert separation(np.full(3, 0.1 + 0.2), np.full(3, 0.3)) == 0.0
    assert separation(np.array([0.1 + 0.2, 0.3]), np.array([0.3, 0.3])) == 0.0
    assert separation(np.full(3, 0.4), np.full(3, 0.3)) == math.inf
    with pytest.raises(sand.BadInput, match="two different x"):
        power_law(np.array([0.1 + 0.2, 0.3]), np.array([1.0, 2.0]))
    with pytest.raises(sand.BadInput, match="beyond 1"):
        rate_law(np.arange(1.0, 4.0), np.full((2, 3), 1.0 + 2.0**-52))


def test_dimensions_do_not_depend_on_rounding():
    """A rotated shell with all grains at r_g from the centre; a rod in any unit."""
    half = RNG.normal(size=(40, 3))
    shell = np.concatenate([half, -half]) / np.linalg.norm(np.concatenate([half, half]), axis=1)[:, None]
    turned = [correlation_dimension(shell @ np.linalg.qr(RNG.normal(size=(3, 3)))[0]).value for _ in range(8)]
    assert turned == pytest.approx([correlation_dimension(shell).value] * 8, rel=1e-9, abs=0.0)
    rods = [
        correlation_dimension(np.column_stack([unit * np.arange(300.0), np.zeros((300, 2))]), (least, 40 * unit))
        for unit, least in ((1.0, 3.0), (0.1, 0.3), (0.7, 2.1), (1e-8, 3e-8))
    ]
    assert [rod.value for rod in rods] == pytest.approx([rods[0].value] * 4, rel=1e-9, abs=0.0)


def test_a_measured_kernel_is_symmetric_bit_for_bit():
    """Masses on edges of triangles, with any other masses: K(m1, m2) has the bits of K(m2, m1)."""
    masses = MASS * 4.0 ** np.arange(4)
    brownian = kinetics.brownian(1e-8, MASS, 100.0)
    rows = [(a, b, brownian(a, b), 1.0) for a in masses for b in masses if a <= b]
    kernel = kernel_table.measured(rows)
    table = kernel_table.on_grid(kernel, MASS * np.geomspace(1.0, 64.0, 31))
    assert (table == table.T).all()
