"""How well an exponent is known, and numbers that last digits must not decide."""

import copy
import math
import pickle

import numpy as np
import pytest

import sand
from sand import theory
from sand.analysis.fits import power_law, rate_law, separation
from sand.analysis.fractal import correlation_dimension
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
    """λ, its standard error and Student's interval (6 degrees of freedom: 2.4469), beside NumPy's fit; ends z(λ).

    The scatter is even about the middle of each half of the outputs, so that it bends nothing.
    """
    size = np.geomspace(10.0, 100.0, 8)
    rate = 3.0 * size**0.4 * np.exp(0.05 * np.tile([1, -1, -1, 1], 2))
    (slope, _), covariance = np.polyfit(np.log(size), np.log(rate), 1, cov=True)
    fit = fitted(rate, size=size)
    assert fit.degree == pytest.approx(slope, rel=1e-10)
    assert fit.degree_error == pytest.approx(math.sqrt(covariance[0, 0]), rel=1e-10)
    assert fit.half_width == pytest.approx(2.4469 * fit.degree_error, rel=1e-4)
    for z, degree in [(fit.exponent, slope), (fit.low, slope - fit.half_width), (fit.high, slope + fit.half_width)]:
        assert z == pytest.approx(1.0 / (1.0 - degree), rel=1e-9)


def test_the_interval_holds_the_truth_nineteen_times_in_twenty():
    """400 lines with scatter: at least 380 − 4 standard deviations, √(400 · 0.95 · 0.05) = 4.4, hold λ = 0.4."""
    held = 0
    for _ in range(400):
        fit = fitted(SIZE**0.4 * np.exp(0.05 * RNG.normal(size=12)))
        held += fit.low < 1.0 / 0.6 < fit.high
    assert held > 380 - 4 * 4.4


def test_the_error_is_at_least_the_bend():
    """λ = 0.3 in the first half of the outputs and 0.5 in the last: 0.4 is known to 0.2."""
    u = np.log(SIZE) - np.log(SIZE).mean()
    fit = fitted(np.exp(0.4 * u + 0.1 * np.abs(u)))
    assert fit.degree == pytest.approx(0.4, rel=1e-10)
    assert fit.degree_error == pytest.approx(0.2, rel=1e-10)


def test_the_error_is_at_least_the_change_with_a_tighter_solver():
    """A straight line has no scatter; if a tighter solution is one of slope 0.41, or another way of counting gives
    0.37, λ = 0.4 is no better known than that.
    """
    fit = fitted(SIZE**0.4, SIZE**0.41)
    assert fit.degree_error == pytest.approx(0.01, rel=1e-9)
    assert fitted(SIZE**0.4, SIZE**0.41, SIZE**0.37).degree_error == pytest.approx(0.03, rel=1e-9)


def test_rounding_does_not_tell_an_exponential_from_a_power():
    """dS/dt = S with errors of up to K 2⁻⁵² in both, as sums over K sizes have: 1 is always within the interval."""
    for sizes in (2, 30, 3000):
        for _ in range(100):
            noise = 1.0 + sizes * 2.0**-52 * RNG.uniform(-1, 1, size=(2, 12))
            fit = fitted(SIZE * noise[0], SIZE * noise[0], size=SIZE * noise[1], sizes=sizes)
            assert math.isinf(fit.high) and fit.half_width < 1e-9


@pytest.mark.slow
def test_the_interval_of_exact_growth_holds_z():
    """Constant kernel, S = 1 + 2t/τ: λ = 0, z = 1, to rounding where all sizes are kept (300: e^−60 is lost).

    λ = 0.3 on a logarithmic grid, which has no scale: z = 1/0.7; from S = 10³ to 10⁴ λ still bends by 2e-5.
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


def test_loss_through_the_top_is_the_derivative_of_what_is_lost():
    """d lost/dt beside differences: 1e-3 for steps of 1 % of the time in which it grows."""
    times = np.linspace(0.5, 0.5001, 3) * TAU
    grown = coagulate(
        kinetics.constant(RATE), all_sizes(5), DENSITY, times, mass=MASS, method="DOP853", may_lose=0.9, accuracy=1e-12
    )
    slope = (grown.lost[2] - grown.lost[0]) / (times[2] - times[0])
    assert grown.loss_rate[1] == pytest.approx(slope, rel=1e-3, abs=0.0)


def test_copies_of_growth():
    """A copy for another process has no kernel; it gives the exponent if that was asked for before."""
    grown = coagulate(
        kinetics.constant(RATE), all_sizes(30), DENSITY, np.linspace(0, 1, 9) * TAU, mass=MASS, may_lose=0.1
    )
    with pytest.raises(sand.BadInput, match="no kernel"):
        copy.deepcopy(grown).exponent()
    assert pickle.loads(pickle.dumps(grown)).mean_size.tolist() == grown.mean_size.tolist()
    assert grown.exponent() == copy.deepcopy(grown).exponent()


def test_sizes_that_do_not_grow_have_no_exponent():
    """Three outputs at once: S differs in the last digits."""
    with pytest.raises(sand.BadInput, match="hardly changes"):
        fitted(np.ones(12), size=1.0 + 1e-15 * np.arange(12))


def test_outputs_at_the_edge_of_a_decade_count():
    """S = 4, 8, 40 is one decade, of three outputs, though the first S may come out a little below 4."""
    for factor in (1.0 / 3.0, 0.7, 1.1):
        size = np.array([4.0, 8.0, 40.0]) * factor
        times = 0.5 * (size - 1.0) * TAU
        grown = coagulate(kinetics.constant(RATE), log_sizes(2e3, 5), DENSITY, times, mass=MASS, accuracy=1e-4)
        grown.__dict__["mean_size"] = size * np.array([1.0 - 1e-13, 1.0, 1.0])
        assert grown.exponent_fit().points == 3


def test_sums_of_sizes_at_the_top_of_the_grid_stay():
    """Two of half the largest size, but for rounding, are one of the largest: nothing is lost."""
    times = np.array([0.3, 0.6]) * TAU
    for top in (2.0, 2.0 * (1.0 - 2.0**-52), 2.0 * (1.0 + 2.0**-52)):
        grown = coagulate(kinetics.constant(RATE), [1.0, top], DENSITY, times[:1], mass=MASS, may_lose=0.9)
        exact = coagulate(kinetics.constant(RATE), [1.0, 2.0], DENSITY, times[:1], mass=MASS, may_lose=0.9)
        assert grown.lost == pytest.approx(exact.lost, rel=1e-6)
        assert (grown.mass + grown.lost) / (MASS * DENSITY) == pytest.approx(1.0, rel=1e-13, abs=0.0)


def test_exponents_that_add_up_to_one():
    """0.7 + 0.2 + 0.1 is 1 to people, 1 − 1e-16 to a computer, which is no z of 1e16; 0.999 is 1000."""
    assert 0.7 + 0.2 + 0.1 < 1.0
    with pytest.raises(sand.BadInput, match="not a power of time"):
        theory.dynamic_exponent(0.7 + 0.2, 0.1)
    assert theory.dynamic_exponent(0.799, 0.2) == pytest.approx(1000.0, rel=1e-9)


def test_laws_near_an_exponential_are_fitted_to_all_digits():
    """S = (1 + t/zτ)^z at z = 1e9 (λ = 1 − 1e-9): (1 + 1e-9 t)^1e9 has lost seven digits, e^(z ln(1 + t/zτ)) none."""
    time = np.linspace(0.1, 5.0, 40)
    law = rate_law(time, (1 + time / 1.4)[None] ** 2)._replace(degree=1.0 - 1e-9, time=1.0)
    assert law.at(time) == pytest.approx(np.exp(np.log1p(1e-9 * time) / 1e-9), rel=1e-12, abs=0.0)
    assert law._replace(degree=1.0).at(time) == pytest.approx(np.exp(time), rel=1e-12, abs=0.0)


def test_what_is_the_same_but_for_rounding_is_the_same():
    """0.1 + 0.2 and 0.3: ensembles are not infinitely many errors apart, and a power law has no slope between them."""
    assert separation(np.full(3, 0.1 + 0.2), np.full(3, 0.3)) == 0.0
    assert separation(np.array([0.1 + 0.2, 0.3]), np.array([0.3, 0.3])) == 0.0
    assert separation(np.full(3, 0.4), np.full(3, 0.3)) == math.inf
    with pytest.raises(sand.BadInput, match="two different x"):
        power_law(np.array([0.1 + 0.2, 0.3]), np.array([1.0, 2.0]))
    with pytest.raises(sand.BadInput, match="beyond 1"):
        rate_law(np.arange(1.0, 4.0), np.full((2, 3), 1.0 + 2.0**-52))


def test_dimensions_do_not_depend_on_last_digits():
    """A shell, all of whose grains lie at r_g from its middle, however it is turned; a rod, whatever the unit."""
    half = RNG.normal(size=(40, 3))
    shell = np.concatenate([half, -half]) / np.linalg.norm(np.concatenate([half, half]), axis=1)[:, None]
    turned = [correlation_dimension(shell @ np.linalg.qr(RNG.normal(size=(3, 3)))[0]).value for _ in range(8)]
    assert turned == pytest.approx([correlation_dimension(shell).value] * 8, rel=1e-9)
    rods = [
        correlation_dimension(np.column_stack([unit * np.arange(300.0), np.zeros((300, 2))]), (least, 40 * unit))
        for unit, least in ((1.0, 3.0), (0.1, 0.3), (0.7, 2.1), (1e-8, 3e-8))
    ]
    assert [rod.value for rod in rods] == pytest.approx([rods[0].value] * 4, rel=1e-9)


def test_a_measured_kernel_does_not_depend_on_what_else_is_asked():
    """Masses on the edges of triangles, in any company: K(m1, m2) has the same bits as K(m2, m1)."""
    masses = MASS * 4.0 ** np.arange(4)
    brownian = kinetics.brownian(1e-8, MASS, 100.0)
    rows = [(a, b, brownian(a, b), 1.0) for a in masses for b in masses if a <= b]
    kernel = kernel_table.measured(rows)
    table = kernel_table.on_grid(kernel, MASS * np.geomspace(1.0, 64.0, 31))
    assert (table == table.T).all()
