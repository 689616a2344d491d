"""Smoluchowski's equation against exact solutions and power laws; kernels, their tables, the DustPy export."""

import math

import numpy as np
import pytest

import sand
from sand import theory
from sand.experiments import kernel_table
from sand.theory import growth, kinetics, smoluchowski
from sand.theory.smoluchowski import all_sizes, coagulate, log_sizes

R = 1e-8
MASS = sand.IRON.density * 4.0 / 3.0 * math.pi * R**3
MOMENT = 200.0 * MASS
DENSITY = 1e18
RATE = 1e-14
TAU = 2.0 / (RATE * DENSITY)


def solved(kernel, sizes, times, **options):
    return coagulate(kernel, sizes, DENSITY, times, mass=MASS, **options)


def measured_z(kernel, per_decade=6, largest=1e11):
    """z over the last two decades of S below a thousandth of the largest size."""
    times = np.geomspace(0.1, 1e40, 2000) * 2.0 / (kernel(MASS, MASS) * DENSITY)
    sizes = log_sizes(largest, per_decade)
    grown = solved(kernel, sizes, times, until_size=1e-3 * largest, accuracy=1e-5)
    assert grown.outcome == smoluchowski.SIZE_REACHED
    return grown.exponent(2.0)


@pytest.mark.validates("closed form", "Smoluchowski's equation with a constant kernel has the exact size distribution")
def test_constant_kernel_against_the_exact_solution(record_bound):
    """n_k = n0 T^(k−1)/(1+T)^(k+1), T = t/τ, τ = 2/(K n0); dM2/dt = K M1² gives S = 1 + 2T, dS/dt = 2/τ.

    Tolerance 1e-4 of n0.  Sums of sizes are on the grid, so errors are those of the integrator (1e-8 per step) and of
    mass beyond the grid: e^(−300/5) of n0 at T = 5.
    """
    sizes, scaled = all_sizes(300), np.array([0.1, 0.5, 1.0, 2.0, 5.0])
    grown = solved(kinetics.constant(RATE), sizes, scaled * TAU, method="DOP853")
    exact = np.exp((sizes - 1) * np.log(scaled)[:, None] - (sizes + 1) * np.log1p(scaled)[:, None])
    record_bound("largest error of n_k/n_0", np.abs(grown.numbers / DENSITY - exact).max(), most=1e-9)
    assert grown.mean_size == pytest.approx(1 + 2 * scaled, rel=1e-9, abs=0.0)
    assert grown.rate == pytest.approx(np.full(5, 2 / TAU), rel=1e-9, abs=0.0)
    assert grown.slope == pytest.approx(2 * scaled / (1 + 2 * scaled), rel=1e-9, abs=0.0)
    assert grown.outcome == smoluchowski.COMPLETED
    implicit = solved(kinetics.constant(RATE), all_sizes(100), scaled[:3] * TAU, method="BDF")
    assert np.abs(implicit.numbers / DENSITY - exact[:3, :100]).max() < 1e-7


@pytest.mark.validates(
    "closed form",
    "Smoluchowski's equation with the additive kernel has the solution of Golovin (1963)",
)
def test_additive_kernel_against_golovin(record_bound):
    """n_k = n0 (1−φ) (kφ)^(k−1) e^(−kφ)/k!, φ = 1 − e^(−T), T = b n0 t, and S = e^(2T), for K = b(N1 + N2).

    Tolerance: 1e-8 per step; at T = 0.5 the 300 sizes hold all but 1e-10.
    """
    sizes, scaled = all_sizes(300), np.array([0.1, 0.3, 0.5])
    grown = solved(kinetics.additive(RATE, MASS), sizes, scaled * TAU / 2, method="DOP853")
    phi = -np.expm1(-scaled)[:, None]
    factorial = np.array([math.lgamma(k + 1) for k in sizes])
    exact = (1 - phi) * np.exp((sizes - 1) * np.log(sizes * phi) - sizes * phi - factorial)
    record_bound("largest error of n_k/n_0", np.abs(grown.numbers / DENSITY - exact).max(), most=1e-9)
    assert grown.mean_size == pytest.approx(np.exp(2 * scaled), rel=1e-6, abs=0.0)


def test_product_kernel_stops_at_gelation():
    """S = 1/(1 − T), T = c n0 t, infinite at T = 1 for K = c N1N2: mass leaves the grid before, which is reported."""
    grown = solved(kinetics.product(RATE, MASS), all_sizes(300), np.linspace(0.0, 2.0, 21) * TAU / 2, method="DOP853")
    assert grown.outcome == smoluchowski.MASS_LOST
    scaled = 2 * grown.times / TAU
    assert 0.5 < scaled[-1] < 1.0
    assert grown.mean_size == pytest.approx(1 / (1 - scaled), rel=1e-3, abs=0.0)


@pytest.mark.slow
@pytest.mark.parametrize("sizes", [all_sizes(60), log_sizes(1e4, 7), np.array([1.0, 3.5, 4.0, 9.0, 40.0, 1e3])])
def test_mass_is_conserved(sizes):
    """Σ x_k n_k + lost mass = n0 on any grid (1e-13: rounding of 1e3 steps)."""
    for kernel in (kinetics.constant(RATE), kinetics.brownian(R, MASS, 100.0)):
        unit = 2.0 / (kernel(MASS, MASS) * DENSITY)
        grown = solved(kernel, sizes, np.array([1.0, 30.0, 1e3]) * unit, may_lose=0.999)
        assert (grown.mass + grown.lost) / (MASS * DENSITY) == pytest.approx(
            np.ones(len(grown.times)), rel=1e-13, abs=0
        )
        assert (grown.numbers @ sizes) * MASS == pytest.approx(grown.mass, rel=1e-13, abs=0.0)


def test_number_is_conserved_on_any_grid():
    """N = n0/(1 + T) for a constant kernel: a sum shared by two sizes is one cluster (1e-6: time steps)."""
    scaled = np.array([1.0, 10.0, 100.0])
    grown = solved(kinetics.constant(RATE), log_sizes(1e5, 6), scaled * TAU)
    assert grown.numbers.sum(axis=1) / DENSITY == pytest.approx(1 / (1 + scaled), rel=1e-6, abs=0.0)


@pytest.mark.slow
def test_grid_error_is_of_order_two():
    """S on a logarithmic grid is too large, by a quarter on one twice as fine (2.6 % at 10 per decade)."""
    off = []
    for per_decade in (10, 20, 40):
        grown = solved(kinetics.constant(RATE), log_sizes(2e4, per_decade), [100 * TAU], accuracy=1e-7)
        off.append(grown.mean_size[0] / 201.0 - 1.0)
    assert off[0] == pytest.approx(0.026, rel=0.1, abs=0.0)
    assert 3.0 < off[0] / off[1] < 5.0 and 3.0 < off[1] / off[2] < 5.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("eta", "nu"),
    [
        *((0.0, -0.5), (1.0, -0.5)),
        *(pytest.param(*e, marks=pytest.mark.validate) for e in ((0.5, -0.5), (0.8, -0.5), (0.5, 0.0))),
    ],
)
def test_z_from_the_exponents(eta, nu):
    """z = 1/(1 − η − ν) (Eq. 20) to 1 % at λ = −0.5, 0, 0.3, 0.5, 0.5.

    A logarithmic grid is scale-invariant, so z has no grid error.
    """
    kernel = kinetics.power(RATE, MASS, eta, nu)
    assert kernel.degree == eta + nu
    assert measured_z(kernel) == pytest.approx(theory.dynamic_exponent(eta, nu), rel=1e-3, abs=0.0)


@pytest.mark.slow
@pytest.mark.parametrize(("reading", "speed"), [("paper", "impact"), ("mass", "impact"), ("aligned", "thermal")])
def test_z_of_magnetic_growth(reading, speed):
    """3.31, 2.17 and, with a thermal speed, 1.52, to 1 %; with the exponents of `growth_exponents`."""
    kernel = kinetics.capture(R, MASS, MOMENT, 100.0, reading=reading, speed=speed)
    exponents = growth.growth_exponents(reading=reading)
    degree = exponents.eta + (exponents.nu if speed == "impact" else -0.5)
    assert kernel.degree == pytest.approx(degree, rel=1e-12, abs=0.0)
    assert measured_z(kernel) == pytest.approx(1 / (1 - degree), rel=2e-3, abs=0.0)


@pytest.mark.slow
def test_z_of_33_is_out_of_reach():
    """λ = 0.97: at S = 1e8 z is still about 20 % low, as the mass of small clusters falls as S^(λ−1)."""
    aligned = measured_z(kinetics.capture(R, MASS, MOMENT, 100.0, reading="aligned"))
    assert 22.0 < aligned < 30.0


def test_kernels_are_those_of_the_closed_forms():
    """K of two grains is σ v: π(2r)²⟨v⟩; Eq. 14 at m̄v² = k_BT times √(2α/(m̄d³)), or ⟨σv⟩; to rounding."""
    reduced, heat = theory.reduced_mass(MASS), sand.basics.constants.BOLTZMANN * 100.0
    brownian = theory.geometric_cross_section(R) * kinetics.mean_speed(reduced, 100.0)
    assert kinetics.brownian(R, MASS, 100.0)(MASS, MASS) == pytest.approx(brownian, rel=1e-12, abs=0.0)
    thermal = math.sqrt(heat / reduced)
    sigma = theory.capture_cross_section(MOMENT, reduced, thermal)
    impact = math.sqrt(-2.0 * theory.lowest_energy(MOMENT, 2 * R) / reduced)
    made = kinetics.capture(R, MASS, MOMENT, 100.0, c=0.85)
    assert made(MASS, MASS) == pytest.approx(0.85 * sigma * impact, rel=1e-12, abs=0.0)
    # Maxwell's distribution by quadrature: an independent check of the Γ functions
    v = (np.arange(200000) + 0.5) * (12.0 * thermal / 200000)
    weight = v**2 * np.exp(-0.5 * (v / thermal) ** 2)
    sigmas = sigma * (v / thermal) ** (-4.0 / 3.0)
    mean = float((weight * sigmas * v).sum() / weight.sum())
    slow = kinetics.capture(R, MASS, MOMENT, 100.0, reading="aligned", speed="thermal")
    assert slow(MASS, MASS) == pytest.approx(mean, rel=1e-6, abs=0.0)
    # moments of unequal clusters as in Eq. 16
    moments = [theory.aggregate_moment(MOMENT, n) for n in (8, 50)]
    both = theory.reduced_mass(8 * MASS, 50 * MASS)
    unequal = theory.capture_cross_section(moments[0], both, math.sqrt(heat / both), moments[1])
    unequal *= math.sqrt(-2.0 * theory.lowest_energy(moments[0], 2 * R, moments[1]) / both)
    aligned = kinetics.capture(R, MASS, MOMENT, 100.0, reading="aligned")
    assert aligned(8 * MASS, 50 * MASS) == pytest.approx(unequal, rel=1e-12, abs=0.0)


def test_kernels_are_symmetric_and_homogeneous():
    """K(m1, m2) = K(m2, m1), K(am1, am2) = a^λ K(m1, m2), to rounding."""
    m1, m2 = MASS * np.array([1.0, 2.0, 7.5]), MASS * np.array([3.0, 2.0, 1e5])
    for kernel in (
        kinetics.constant(RATE),
        kinetics.additive(RATE, MASS),
        kinetics.product(RATE, MASS),
        kinetics.power(RATE, MASS, 0.7, -0.2),
        kinetics.brownian(R, MASS, 100.0, 1.4),
        *(
            kinetics.capture(R, MASS, MOMENT, 100.0, reading=r, speed=s)
            for r in growth.READINGS
            for s in kinetics.SPEEDS
        ),
    ):
        assert kernel(m1, m2) == pytest.approx(kernel(m2, m1), rel=1e-14, abs=0.0)
        assert kernel(9 * m1, 9 * m2) == pytest.approx(9**kernel.degree * kernel(m1, m2), rel=1e-13, abs=0.0)


def rows_of(kernel, masses):
    return [(a, b, kernel(a, b) / 0.3, 0.3) for a in masses for b in masses if a <= b]


def test_interpolation_of_measured_kernels():
    """ln K is linear between measured masses: exact for products of powers, else within the curvature."""
    product = kinetics.product(RATE, MASS)
    known = kernel_table.measured(rows_of(product, MASS * np.array([1.0, 8.0, 64.0])))
    m = MASS * np.geomspace(1.0, 64.0, 7)
    assert kernel_table.on_grid(known, m) == pytest.approx(kernel_table.on_grid(product, m), rel=1e-9, abs=0.0)
    brownian = kinetics.brownian(R, MASS, 100.0)
    known = kernel_table.measured(rows_of(brownian, MASS * 2.0 ** np.arange(7)))
    table = kernel_table.on_grid(known, m)
    assert table == pytest.approx(kernel_table.on_grid(brownian, m), rel=0.03, abs=0.0)
    # where the triangulation differs on the two sides of the diagonal (here by 6 %), K must be symmetric
    coarse = kernel_table.measured(rows_of(brownian, MASS * 10 ** np.linspace(0.0, 2.0, 6)))
    table = kernel_table.on_grid(coarse, MASS * np.geomspace(1.0, 100.0, 13))
    assert (table == table.T).all()


def test_extrapolation_of_measured_kernels():
    """Refused by default; on request by the power law, exact for powers and continuous at the edge."""
    product = kinetics.product(RATE, MASS)
    rows = rows_of(product, MASS * np.array([1.0, 8.0, 64.0]))
    with pytest.raises(sand.BadInput, match="extrapolate=True"):
        kernel_table.measured(rows)(MASS, 65 * MASS)
    longer = kernel_table.measured(rows, extrapolate=True)
    assert longer(0.1 * MASS, 1e3 * MASS) == pytest.approx(product(0.1 * MASS, 1e3 * MASS), rel=1e-9, abs=0.0)
    curved = kernel_table.measured(
        rows_of(kinetics.brownian(R, MASS, 100.0), MASS * 4.0 ** np.arange(4)), extrapolate=True
    )
    assert curved(MASS, 64.01 * MASS) == pytest.approx(curved(MASS, 63.99 * MASS), rel=1e-3, abs=0.0)
    grown = solved(curved, log_sizes(1e4, 8), [1e-3], until_size=10.0)
    assert grown.mean_size[-1] >= 1.0


def test_tables_are_written_and_read(tmp_path):
    """Values to the last bit; g and cm³/s in the plain text."""
    kernel, m = kinetics.brownian(R, MASS, 100.0), MASS * 2.0 ** np.arange(4)
    kernel_table.write_csv(tmp_path / "k.csv", kernel, m)
    read = np.genfromtxt(tmp_path / "k.csv", delimiter=",", names=True)
    assert read.dtype.names == ("mass1", "mass2", "kernel") and len(read) == 10
    rows, columns = np.triu_indices(4)
    assert (read["mass1"] == m[rows]).all() and (read["mass2"] == m[columns]).all()
    assert (read["kernel"] == kernel_table.on_grid(kernel, m)[rows, columns]).all()
    kernel_table.write_cgs(tmp_path / "k.txt", kernel, m)
    masses, *table = np.loadtxt(tmp_path / "k.txt")
    assert masses == pytest.approx(1e3 * m, rel=1e-15, abs=0.0)
    assert np.array(table) == pytest.approx(1e6 * kernel_table.on_grid(kernel, m), rel=1e-15, abs=0.0)


def test_kernel_for_dustpy():
    """DustPy's own kernel, (1 − δ/2) π(a_i + a_j)² v/√(2π(H_i² + H_j²)); 0 at the ends of the radial grid.

    Also by quadrature: ∫ of two Gaussian layers' densities times K over the height.
    """
    size, speed, height = np.array([1.0, 2.0, 4.0]), 3.0, np.array([[9.0, 9.0, 9.0], [5.0, 4.0, 2.0], [9.0, 9.0, 9.0]])
    table = np.pi * (size[:, None] + size) ** 2 * speed
    found = kernel_table.for_dustpy(table, height)
    assert found.shape == (3, 3, 3) and not found[[0, 2]].any()
    z = np.linspace(-60.0, 60.0, 200001)
    for i in range(3):
        for j in range(3):
            a, b = height[1, i], height[1, j]
            layers = np.exp(-0.5 * (z / a) ** 2 - 0.5 * (z / b) ** 2) / (2 * np.pi * a * b)
            share = 0.5 if i == j else 1.0
            assert found[1, i, j] == pytest.approx(
                share * table[i, j] * layers.sum() * (z[1] - z[0]), rel=1e-6, abs=0.0
            )


@pytest.mark.parametrize("largest", [40, 100])
@pytest.mark.parametrize("accuracy", [1e-4, 1e-6, 1e-8, 1e-10])
def test_exponential_growth_is_reported(largest, accuracy):
    """The additive kernel grows exponentially, dS/dt ∝ S: there is no z.

    For any rounding of the solver, and although the mean size on the grid grows slightly slower than S: with 40 sizes λ
    is 7e-5 too low, because 6e-7 of the mass has left.
    """
    times = np.linspace(0.0, 0.6, 30) * TAU / 2
    grown = solved(kinetics.additive(RATE, MASS), all_sizes(largest), times, method="DOP853", accuracy=accuracy)
    fit = grown.exponent_fit()
    assert abs(fit.degree - 1.0) < fit.half_width < 1e-3
    assert math.isinf(fit.high) and fit.low > 1e3
    with pytest.raises(sand.BadInput, match=r"faster than any power"):
        grown.exponent()
