"""Forces between two dipoles: textbook values, gradients, angular momentum, cut-off."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sand.basics.constants import BOLTZMANN, MAGNETIC
from sand.forces.pair import dipole_formulas as dipole

component = st.integers(-100, 100).map(lambda n: n / 100)
vector = st.tuples(component, component, component).filter(lambda v: np.linalg.norm(v) > 0.3)
CUT = dipole.Cutoff(square=1.5**2, inverse_shell=1.0 / (1.5**2 - 0.5**2))  # shell from 0.5 to 1.5


def loads(apart, m1, m2, cut):
    """Force on 1, field at 1, field at 2, energy; with or without the cut-off."""
    return dipole.pair_load_cut(apart, m1, m2, 1.0, CUT) if cut else dipole.pair_load(apart, m1, m2, 1.0)


def test_head_to_tail_attraction():
    """On one axis: F = 6 k m1 m2/r⁴ attractive, U = −2 k m1 m2/r³, B at 1 = 2 k m2/r³ (Eqs. 6, 7)."""
    force, b1, b2, energy = dipole.pair_load((2.0, 0, 0), (1.0, 0, 0), (3.0, 0, 0), 1e-7)
    assert force == pytest.approx((-6e-7 * 3 / 16, 0, 0), rel=1e-14, abs=0.0)
    assert energy == pytest.approx(-2e-7 * 3 / 8, rel=1e-14, abs=0.0)
    assert b1 == pytest.approx((2e-7 * 3 / 8, 0, 0), rel=1e-14, abs=0.0)
    assert b2 == pytest.approx((2e-7 / 8, 0, 0), rel=1e-14, abs=0.0)
    assert dipole.contact_energy(1.0, 3.0, 2.0, 1e-7) == pytest.approx(-energy, rel=1e-14, abs=0.0)


def test_force_equals_the_papers_matrix_form():
    """Eqs. 35–37: F_ij on j = 3/r⁵ [M1 − 5(μi·r)/r² M2] μj with r = r_j − r_i."""
    rng = np.random.default_rng(5)
    for _ in range(20):
        xi, xj, mi, mj = rng.normal(size=(4, 3))
        r = xj - xi
        d = np.linalg.norm(r)
        m1 = np.outer(mi, r) + np.outer(r, mi) + (mi @ r) * np.eye(3)
        paper = 3 / d**5 * (m1 - 5 * (mi @ r) / d**2 * np.outer(r, r)) @ mj
        force, *_ = dipole.pair_load(tuple(xj - xi), tuple(mj), tuple(mi), 1.0)
        assert force == pytest.approx(paper, rel=1e-11, abs=1e-13)


@pytest.mark.parametrize("cut", [False, True])
@given(vector, vector, vector)
def test_force_is_minus_the_gradient_of_the_energy(cut, apart, m1, m2):
    """F = −∂U/∂x1 by central differences with Richardson: truncation ~h⁴, rounding ε U/h."""
    x, h = np.array(apart), 1e-3

    def slope(step):
        return np.array(
            [
                (loads(tuple(x - step * e), m1, m2, cut)[3] - loads(tuple(x + step * e), m1, m2, cut)[3]) / (2 * step)
                for e in np.eye(3)
            ]
        )

    best = (4 * slope(h / 2) - slope(h)) / 3
    r = np.linalg.norm(x)
    size = np.linalg.norm(m1) * np.linalg.norm(m2) / r**4
    # the quintic's third derivative jumps at both ends of the shell: h² there, not h⁴
    tolerance = size * (1e4 * (h / r) ** 4 + 1e-9 + (1e2 * h**2 if cut else 0.0))
    assert loads(apart, m1, m2, cut)[0] == pytest.approx(best, abs=tolerance)


@pytest.mark.parametrize("cut", [False, True])
@given(vector, vector, vector)
def test_angular_momentum_of_a_pair_is_conserved(cut, apart, m1, m2):
    """M1 + M2 + r×F = 0 to rounding, with the cut-off too, because its gradient is along r."""
    force, b1, b2, energy = loads(apart, m1, m2, cut)
    total = np.cross(m1, b1) + np.cross(m2, b2) + np.cross(apart, force)
    size = np.linalg.norm(m1) * np.linalg.norm(m2) / np.linalg.norm(apart) ** 3
    assert np.abs(total).max() < 1e-13 * size
    assert energy == pytest.approx(-np.dot(m1, b1), abs=1e-13 * size)
    assert energy == pytest.approx(-np.dot(m2, b2), abs=1e-13 * size)


def test_the_cutoff_is_smooth():
    """Weight 1 inside the shell, 0 outside, S and S′ continuous at both ends."""
    inside, outside = (0.5 - 1e-9) ** 2, (1.5 + 1e-9) ** 2
    assert dipole.cut_weight(inside, CUT) == (1.0, 0.0)
    assert dipole.cut_weight(outside, CUT) == (0.0, 0.0)
    middle = dipole.cut_weight(0.5 * (1.5**2 + 0.5**2), CUT)
    assert middle[0] == pytest.approx(0.5, rel=1e-6, abs=0.0)
    h = 1e-6
    for square in (0.7, 1.2, 2.0):
        slope = (dipole.cut_weight(square + h, CUT)[0] - dipole.cut_weight(square - h, CUT)[0]) / (2 * h)
        assert dipole.cut_weight(square, CUT)[1] == pytest.approx(-2 * slope, rel=1e-8, abs=0.0)
    assert dipole.cut_weight(0.5**2 + 1e-8, CUT)[1] == pytest.approx(0.0, abs=1e-7)


def test_scales_of_20_nm_iron():
    """Fig. 2: b_max(v_th/16) = 256 R for 20 nm diameter, 100 K, 200 A m²/kg; R_m = 2dλ^(1/3); b_max = 1.375 R_m."""
    r = 1e-8
    mass = 7874 * 4 / 3 * math.pi * r**3
    moment = 200 * mass
    thermal = math.sqrt(BOLTZMANN * 100 / mass)
    b = dipole.capture_radius(moment, moment, mass / 2, thermal / 16, MAGNETIC)
    assert b / r == pytest.approx(256, rel=0.01, abs=0.0)
    reach = dipole.interaction_radius(moment, 2 * r, 100.0, MAGNETIC, BOLTZMANN)
    mu0 = 4 * math.pi * MAGNETIC
    assert reach == pytest.approx((2 * mu0 / (math.pi * BOLTZMANN * 100) * moment**2) ** (1 / 3), rel=1e-12, abs=0.0)
    b_thermal = dipole.capture_radius(moment, moment, mass / 2, thermal, MAGNETIC)
    assert b_thermal / reach == pytest.approx(1.375, rel=1e-6, abs=0.001)


def test_capture_radius_is_where_the_barrier_equals_the_energy():
    """Eqs. 10–12 numerically: the maximum of U_eff = m̄b²v²/2r² − α/r³ is m̄v²/2 at b = b_max."""
    alpha, reduced, speed = 2.0, 0.7, 1.3
    b = dipole.capture_radius(1.0, 1.0, reduced, speed, 1.0)
    r = np.linspace(0.2, 10, 2_000_000)
    top = (0.5 * reduced * b**2 * speed**2 / r**2 - alpha / r**3).max()
    assert top == pytest.approx(0.5 * reduced * speed**2, rel=1e-9, abs=0.0)
