"""JKR: force curve, its inverse, its energy."""

import math

import numpy as np
import pytest

from sand.contact import jkr

from ...reference.jkr import E_BREAK, E_CYCLE, TABLE, fitted_polynomial, root_by_bisection


@pytest.mark.parametrize(("x", "force", "overlap", "energy"), TABLE)
def test_the_curve_agrees_with_the_table(x, force, overlap, energy):
    """Force, overlap and energy at x = a/a0; the table has 6 to 8 decimals, exact points are exact to 1e-9."""
    y = math.sqrt(x)
    digits = 1e-9 if x <= 1.0 and overlap in (-1.0, 0.0) else 6e-7 if x <= 1 else 3e-7
    assert jkr.force_at(y, 1.0) == pytest.approx(force, abs=1e-9 if x <= 1.0 else 3e-6)
    assert jkr.overlap_at(y, 1.0) == pytest.approx(overlap, abs=digits)
    if energy is not None:
        assert jkr.energy_at(y, 1.0, 1.0) == pytest.approx(energy, abs=6e-7)


def test_special_points_are_exact():
    """By hand: F = −5/9 and U = 4/45 at breaking, F = −8/9 at first contact, F = 0 at equilibrium, min F = −1.

    The minimum is at y³ = 1/2.
    """
    assert jkr.force_at(jkr.ROOT_AT_BREAK, 1.0) == pytest.approx(-5 / 9, abs=1e-15)
    assert jkr.energy_at(jkr.ROOT_AT_BREAK, 1.0, 1.0) == pytest.approx(4 / 45, abs=1e-15)
    assert jkr.overlap_at(jkr.ROOT_AT_BREAK, 1.0) == pytest.approx(-1.0, abs=1e-15)
    assert jkr.force_at(jkr.ROOT_AT_TOUCH, 1.0) == pytest.approx(-8 / 9, abs=1e-15)
    assert jkr.overlap_at(jkr.ROOT_AT_TOUCH, 1.0) == pytest.approx(0.0, abs=1e-15)
    assert jkr.force_at(0.5 ** (1 / 3), 1.0) == pytest.approx(-1.0, abs=1e-15)
    assert jkr.force_at(1.0, 1.0) == 0.0
    assert jkr.overlap_at(1.0, 1.0) == pytest.approx(1.2114137, abs=5e-8)


def test_energies_of_breaking_and_of_a_cycle():
    """E_break = U(−δc) − U(equilibrium) = 1.542585, E_cycle = −U(0) + U(−δc) = 0.935503 (Fcδc); six decimals."""
    rest = jkr.energy_at(1.0, 1.0, 1.0)
    formation = jkr.energy_at(jkr.ROOT_AT_TOUCH, 1.0, 1.0)
    broken = jkr.energy_at(jkr.ROOT_AT_BREAK, 1.0, 1.0)
    assert broken - rest == pytest.approx(E_BREAK, abs=6e-7)
    assert broken - formation == pytest.approx(E_CYCLE, abs=6e-7)


@pytest.mark.validates(
    "closed form",
    "The contact radius of JKR at a given overlap, against bisection in extended precision",
)
@pytest.mark.parametrize("function", [jkr.root, jkr.polynomial_root])
def test_the_inverse_is_accurate_to_1e_12(record_bound, function):
    """a(δ) against bisection in extended precision, −0.99 … 100 δc (polynomial_root: up to 11.25 δc)."""
    top = 100.0 if function is jkr.root else 11.24
    overlaps = np.concatenate([-1 + np.geomspace(0.01, 1, 200), np.linspace(0, top, 2000)])
    found = np.array([function(jkr.stretch(d, 1.0)) for d in overlaps])
    exact = root_by_bisection(overlaps).astype(float)
    record_bound("relative error of a(δ)", np.abs((found / exact) ** 2 - 1).max(), most=1e-12)  # a/a0 = y²


def test_the_stored_polynomial_is_the_fit():
    """Stored and refitted polynomial agree to 1e-8 and satisfy y = y_m + s p(s) to 1e-7.

    One Newton step (quadratic) then gives better than 1e-12.
    """
    s = np.linspace(0.01, 3.5, 500)
    ours = np.polynomial.polynomial.polyval(s, jkr.POLYNOMIAL)
    assert np.abs(ours - np.polynomial.polynomial.polyval(s, fitted_polynomial())).max() < 1e-8
    exact = (root_by_bisection(s.astype(np.longdouble) ** 2 - 1).astype(float) - jkr.ROOT_AT_BREAK) / s
    assert np.abs(ours - exact).max() < 1e-7


def test_force_is_the_derivative_of_the_energy():
    """dU = F dδ by central differences in y: error h² U‴/6 ~ 1e-8 of the largest terms."""
    for y in np.linspace(0.56, 2.0, 40):
        h = 1e-5
        work = jkr.energy_at(y + h, 1.0, 1.0) - jkr.energy_at(y - h, 1.0, 1.0)
        way = jkr.overlap_at(y + h, 1.0) - jkr.overlap_at(y - h, 1.0)
        assert work / way == pytest.approx(jkr.force_at(y, 1.0), rel=1e-7, abs=1e-7)


def test_stiffness_is_the_derivative_of_the_force():
    """dF/dδ by central differences in y; in equilibrium (6/5) E* a0 = (9/5) 6^(−1/3) F_c/δ_c."""
    for y in np.linspace(0.6, 2.0, 40):
        h = 1e-5
        change = jkr.force_at(y + h, 1.0) - jkr.force_at(y - h, 1.0)
        way = jkr.overlap_at(y + h, 1.0) - jkr.overlap_at(y - h, 1.0)
        assert change / way == pytest.approx(jkr.stiffness_at(y, 1.0, 1.0), rel=1e-6, abs=1e-6)
    rest = 9.0 / 5.0 * 6.0 ** (-1.0 / 3.0)
    assert jkr.stiffness_at(1.0, 1.0, 1.0) == pytest.approx(rest, rel=1e-12, abs=0.0)


def test_scales():
    """a0³ = 9πγR²/E*, Fc = 3πγR, δ0 = a0²/3R, δ0/δc = 1.2114137, Fcδc = 24.0687 γ^5/3 R^4/3 E*^−2/3."""
    gamma, radius, modulus = 0.025, 0.3e-6, 2.8e10
    a0 = jkr.rest_radius(gamma, radius, modulus)
    assert a0**3 == pytest.approx(9 * math.pi * gamma * radius**2 / modulus, rel=1e-6, abs=0.0)
    ratio = jkr.rest_overlap(a0, radius) / jkr.pull_off_overlap(a0, radius)
    assert ratio == pytest.approx(1.2114137, abs=5e-8)
    product = jkr.pull_off_force(gamma, radius) * jkr.pull_off_overlap(a0, radius)
    expected = 24.0687 * gamma ** (5 / 3) * radius ** (4 / 3) * modulus ** (-2 / 3)
    assert product == pytest.approx(expected, rel=3e-6, abs=0.0)


def test_equilibrium_stiffness_is_the_derivative_of_the_force():
    """k_n = dF/dδ at a0 = (6/5) E* a0, by central difference in y."""
    gamma, radius, modulus = 0.07, 1e-7, 1e11
    a0 = jkr.rest_radius(gamma, radius, modulus)
    pull, reach = jkr.pull_off_force(gamma, radius), jkr.pull_off_overlap(a0, radius)
    rise = jkr.force_at(1 + 1e-5, pull) - jkr.force_at(1 - 1e-5, pull)
    way = jkr.overlap_at(1 + 1e-5, reach) - jkr.overlap_at(1 - 1e-5, reach)
    assert rise / way == pytest.approx(jkr.normal_stiffness(a0, modulus), rel=1e-8, abs=0.0)
