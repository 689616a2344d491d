"""Degrees of growth laws: fits against exact solutions, independent solutions and stochastic coagulation."""

import math

import numpy as np
import pytest

import sand
from sand.analysis.growth_law import local_degrees, rate_law
from sand.theory import kinetics
from sand.theory.kernel_growth import EXPONENTS, kernel_curves, power_curves
from sand.theory.smoluchowski import all_sizes, coagulate, log_sizes
from tests.reference.fit_coverage import coagulated
from tests.tiers import combinations


def grown(kernel, largest, times):
    """S(t) of single grains with K = 1 of two grains and density 1, up to `largest`; dS/dt = 1 at S = 1."""
    sizes = log_sizes(100.0 * largest, 30)
    return coagulate(kernel, sizes, 1.0, times, mass=1.0, until_size=largest, accuracy=1e-5)


def test_local_degree_of_powers():
    """S = (1 + t/zτ)^z has λ = 1 − 1/z at any S and from any first time; e^t has λ = 1.

    ln S is interpolated between 200 points: errors of (Δ ln S)²/8, 2e-5, in ln S, and some ten times that in λ.
    """
    time = np.linspace(2.0, 40.0, 300)
    for z in (0.8, 1.0, 2.0, 3.2):
        found = local_degrees(time, (1.0 + time / (0.7 * z))[None] ** z)
        assert [one.degree for one in found] == pytest.approx([1.0 - 1.0 / z] * len(found), abs=2e-3)
        assert all(np.isnan(one.error) for one in found)
    found = local_degrees(time / 10.0, np.exp(time / 10.0)[None])
    assert len(found) == 4 and [one.degree for one in found] == pytest.approx([1.0] * 4, abs=2e-3)
    assert [one.high_size / one.low_size for one in found] == pytest.approx([4.0] * 4, rel=1e-9, abs=0.0)


def test_windows_of_the_local_degree():
    """S that grows by less than 4 has one window; by less than 1.5, none; a window needs four times."""
    time = np.linspace(0.1, 1.0, 20)
    (found,) = local_degrees(time, 2.0 + 2.0 * time[None])
    assert (found.low_size, found.high_size, found.points) == (pytest.approx(2.2, abs=1e-9), 4.0, 20)
    with pytest.raises(sand.BadInput, match=r"factor of 1\.5, not from 2\.01 to 2\.1"):
        local_degrees(time, 2.0 + 0.1 * time[None])
    with pytest.raises(sand.BadInput, match="at least four times"):
        local_degrees(time[:3], 1.0 + time[None, :3] * 30.0)
    with pytest.raises(sand.BadInput, match="S reaches 11 of the 5 grains of a box"):
        local_degrees(time, 1.0 + 10.0 * time[None], 5)


def test_error_of_the_local_degree():
    """The mean of boxes S = (1 + t)^z_k that differ little has λ = 1 − 1/z̄ within its error; t of 7 is 2.3646."""
    time = np.linspace(1.0, 9.0, 100)
    z = 2.0 + 0.04 * np.random.default_rng(5).normal(size=8)
    (found, *_) = local_degrees(time, (1.0 + time) ** z[:, None])
    assert abs(found.degree - (1.0 - 1.0 / z.mean())) < 4.0 * found.error
    assert found.high - found.degree == pytest.approx(2.3646 * found.error, rel=1e-3, abs=0.0)


@pytest.mark.slow
@pytest.mark.parametrize("grains", [pytest.param(50, marks=pytest.mark.validate), 1000, np.inf])
def test_constant_kernel(grains):
    """dS/dt = (1 − S/N)/τ, S = N − (N − 1)e^(−t/Nτ) is exact in the mean of any number of boxes: λ = 0, z = 1.

    The curves come from a grid of 20 sizes per decade, on which λ(S) is up to 5e-3 too large from S = 3 to 5.
    """
    time = np.linspace(0.5, 20.0, 200)
    size = 1.0 + time if np.isinf(grains) else grains - (grains - 1.0) * np.exp(-time / grains)
    found = rate_law(time, size[None], grains)
    assert found.degrees["constant speed"] == found.degree == pytest.approx(0.0, abs=5e-3)
    assert found.exponent == pytest.approx(1.0, abs=5e-3) and found.time == pytest.approx(1.0, rel=5e-3, abs=0.0)
    assert max(found.degrees.values()) - min(found.degrees.values()) < 0.05
    assert found.at(time) == pytest.approx(size, rel=5e-3, abs=0.0)
    found = local_degrees(time, size[None], grains)
    assert [one.degree for one in found] == pytest.approx([0.0] * len(found), abs=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("z", "largest"), combinations((0.8, 2.0, 3.33), (12.0, 60.0), default=((0.8, 60.0), (3.33, 12.0)))
)
def test_each_kernel_recovers_its_own_degree(z, largest):
    """S of a separate solution with a finer grid, S from 2 to 12 or from 2 to 60: the degree within 0.01.

    Between the tabulated degrees ln R is linear in λ, with errors of (Δλ)²/8 of its second derivative, about 0.3.
    The kernels ½(i^λ + j^λ) and (ij)^(λ/2) are not among those that are fitted; their degree lies within the range.
    """
    degree = 1.0 - 1.0 / z
    kernels = {name: kinetics.power(1.0, 1.0, *of(degree)) for name, of in EXPONENTS.items()}
    kernels["sum"] = lambda one, other: 0.5 * (one**degree + other**degree)
    kernels["product"] = lambda one, other: (one * other) ** (0.5 * degree)
    for name, kernel in kernels.items():
        solution = grown(kernel, largest, np.geomspace(0.1, 1e4, 300))
        time = np.linspace(0.0, solution.times[-1], 200)[1:]
        size = np.interp(time, solution.times, solution.mean_size)
        found = rate_law(time[size > 2.0], size[None, size > 2.0])
        if name in EXPONENTS:
            assert found.degrees[name] == pytest.approx(degree, abs=0.01)
        assert min(found.degrees.values()) - 0.01 < degree < max(found.degrees.values()) + 0.01


@pytest.mark.slow
def test_faster_growth_has_no_exponent():
    """S = 1/(1 − t), λ = 2, is refused; with boxes whose interval of λ contains 1, z has no upper end."""
    time = np.linspace(0.1, 0.95, 100)
    with pytest.raises(sand.BadInput, match="faster than any power of time"):
        rate_law(time, 1.0 / (1.0 - time)[None])
    late = np.linspace(0.2, 10.0, 100)
    boxes = (1.0 + late / 6.0) ** (6.0 + 1.2 * np.random.default_rng(5).normal(size=8))[:, None]
    found = rate_law(late, boxes)
    assert math.isinf(found.high) and found.degree_high > 1.0 and 1.0 < found.low < 6.0
    assert found.low == pytest.approx(1.0 / (1.0 - found.degree_low), rel=1e-9, abs=0.0)
    with pytest.raises(sand.BadInput, match="grow beyond 1"):
        rate_law(late, np.ones((2, 100)))


@pytest.mark.slow
def test_the_interval_contains_those_of_all_kernels():
    """Lowest and highest of λ ± 2.3646 errors of each kernel, the jackknife done by hand; 1e-3: the optimiser."""
    time = np.linspace(0.1, 10.0, 60)
    boxes = np.array([(1.0 + time * math.exp(0.1 * x)) ** 2 for x in np.random.default_rng(5).normal(size=8)])
    found = rate_law(time, boxes)
    without = [rate_law(time, np.delete(boxes, k, axis=0).mean(axis=0)[None]).degrees for k in range(8)]
    ends = []
    for name, degree in found.degrees.items():
        each = np.array([one[name] for one in without])
        half = 2.3646 * math.sqrt(7.0 / 8.0 * ((each - each.mean()) ** 2).sum())
        ends += [degree - half, degree + half]
    assert (found.degree_low, found.degree_high) == pytest.approx((min(ends), max(ends)), abs=1e-3)
    assert found.low < 2.0 < found.high and found.groups == 8


@pytest.mark.parametrize("degree", [0.0, 0.5, 0.7])
def test_pairs_of_a_cluster_with_itself(degree):
    """dt/dS is larger by 1 + c S/N, c = ⟨s^(1+λ)⟩/(⟨s⟩⟨s^λ⟩) over the mass of n_s ∝ e^(−s/a), summed up to s = 40 a.

    N = 10⁸ and a = 300: errors of second order in S/N, 1e-6, and of sums over integers, 1/a². The trapezoidal rule in
    ln S errs by (Δ ln S)²/12.
    """
    s = np.arange(1.0, 12001.0)
    mass = s * np.exp(-s / 300.0)
    mass /= mass.sum()
    expected = (mass @ s ** (1.0 + degree)) / ((mass @ s) * (mass @ s**degree))
    curves, grains = power_curves(np.linspace(0.0, 4.0, 4001)), 1e8
    more = grains * (curves.times(degree, grains) - curves.times(degree))[-1]
    largest, power = math.exp(4.0), 2.0 - degree
    assert more * power / (largest**power - 1.0) == pytest.approx(expected, rel=1e-4, abs=0.0)


@pytest.mark.validate
def test_depletion_in_a_box():
    """Mean of 400 stochastic boxes of 125 grains, K = (ij)^¼: S with (1 − S/N)^(1 + λ/2) within 4 standard errors.

    At S = 0.1 N an infinite system is ahead by 8 %, about five standard errors.
    """
    rng, grains, degree = np.random.default_rng(5), 125, 0.5
    n = np.arange(1.0, grains + 1.0)
    table = np.zeros((grains + 1, grains + 1))
    table[1:, 1:] = np.sqrt(n[:, None] * n[None, :]) ** degree
    times = np.array([1.0, 2.0, 4.0, 6.0])
    sizes = np.array([coagulated(rng, table, times, grains) for _ in range(400)])
    infinite = grown(
        lambda one, other: (one * other) ** (0.5 * degree), 40.0, np.append(np.geomspace(0.05, 0.99, 40), times)
    )
    rate = np.append(0.0, np.log(infinite.rate))
    curves = power_curves(np.append(0.0, np.log(infinite.mean_size)))._replace(log_rate=np.tile(rate, (6, 1)))
    expected = np.exp(np.interp(times, curves.times(degree, grains), curves.log_size))
    mean, error = sizes.mean(axis=0), sizes.std(axis=0) / math.sqrt(400)
    assert (np.abs(mean - expected) < 4.0 * error).all()
    assert infinite.mean_size[-1] > mean[-1] + 4.0 * error[-1]


def test_local_degree_of_a_solution():
    """Constant kernel on all sizes: dS/dt does not change, λ = 0 to the tolerance of the solver."""
    times = np.linspace(0.0, 4.0, 30)
    solution = coagulate(kinetics.constant(1.0), all_sizes(150), 1.0, times, mass=1.0, method="DOP853")
    assert solution.local_degree == pytest.approx(np.zeros(30), abs=1e-4)
    with pytest.raises(sand.BadInput, match="at least three outputs"):
        grown(kinetics.constant(1.0), 20.0, np.array([1.0, 2.0])).local_degree  # noqa: B018


@pytest.mark.slow
def test_the_first_local_degree():
    """λ(1) of a kernel from K11 = 1 and K12, by hand.

    At t = 0 dn1/dt = −1 and dn2/dt = ½, so that of dS/dt = Σ ij K_ij n_i n_j the derivative is 2(−1) + 4 K12/2, and
    dS/dt = 1: λ(1) = 2 (K12 − 1). The outputs are at t of 1e-3: λ changes by less than 0.01 between them. For large S
    λ(S) tends to the degree, 0.5: within 0.02 at S = 90.
    """
    for name, of in EXPONENTS.items():
        kernel = kinetics.power(1.0, 1.0, *of(0.5))
        solution = grown(kernel, 100.0, np.geomspace(1e-3, 30.0, 300))
        assert solution.local_degree[0] == pytest.approx(2.0 * (kernel(1.0, 2.0) - 1.0), abs=0.01)
        assert np.interp(90.0, solution.mean_size, solution.local_degree) == pytest.approx(0.5, abs=0.02), name
        curve = kernel_curves(name, 64.0)
        rate = np.interp(curve.log_size, np.log(solution.mean_size), np.log(solution.rate))
        assert curve.log_rate[4] == pytest.approx(rate, abs=0.02)
