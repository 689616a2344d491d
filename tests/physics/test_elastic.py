"""Elastic moduli of packings at rest and waves in them: crystals, a chain, a random packing by its stiffness matrix."""

import math

import numpy as np
import pytest
from scipy.linalg import lstsq

import sand
from sand.engine.measures import contact_energies
from sand.experiments.elastic import Elastic, begin, contact_springs, measure, strain_both_ways
from sand.experiments.elastic_waves import Wave, knock, repeated, standing_wave
from sand.setup.from_frame import Start
from sand.theory.elastic import affine_moduli, affine_shear_moduli

from .test_stress import ICE, R, lattice, packing, strained  # noqa: F401, the fixture

pytestmark = pytest.mark.compiled("deformation")
ONE = sand.theory.contact(ICE, R)
D = 2 * R - ONE.rest_overlap
NORMAL, SLIDE = ONE.normal_stiffness, ONE.slide_stiffness * (2 * R / D) ** 2
HALF = D / math.sqrt(2)
FCC = [[0, 0, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [0.5, 0.5, 0]]


def moduli_of(sim, **settings):
    """Measured moduli of a crystal without waves."""
    return measure(sim.grains, Elastic(box=list(sim.box.lengths), sound=False, **settings))


def test_crystals():
    """Relaxed and affine C_ab are those of springs, also after a strain there and back: no grain of a crystal turns.

    Simple cubic: C11 = k_n/D, C12 = 0. Face-centred: C11 = √2 (k_n + k_s′)/D, C12 = (k_n − k_s′)/√2D, and affine C44 =
    (k_n + k_s′)/√2D, of which each grain's k_s′ also resists a turn.  Strains of ±ε leave terms of (ε D/δ₀)² = 5e-9;
    5e-9 of the time of the strain is a step that ends elsewhere.
    """
    c11, c12 = math.sqrt(2) * (NORMAL + SLIDE) / D, (NORMAL - SLIDE) / HALF / 2
    for sim, own, other in (
        (lattice([[0, 0, 0]], (4, 4, 4), 3 * [D]), NORMAL / D, 0.0),
        (lattice(FCC, (3, 3, 3), 3 * [2 * HALF]), c11, c12),
    ):
        found = moduli_of(sim, strains=[1e-6])
        expected = own * np.eye(3) + other * (1 - np.eye(3))
        np.testing.assert_allclose(found.affine, expected, rtol=0, atol=1e-9 * c11)
        np.testing.assert_allclose(found.relaxed, expected, rtol=0, atol=3e-8 * c11)
        row, content = found.table[0], found.to_dict()
        assert row["unrecovered"] < 1e-7 and row["made"] == row["broken"] == row["at_limit"] == 0
        assert content["bulk"] == pytest.approx((own + 2 * other) / 3, rel=1e-7, abs=0)
        assert content["shear"] == pytest.approx((own - other) / 2, rel=1e-7, abs=0)
        assert abs(content["residual"]) < 1e-9 * c11 and content["anisotropy"] < 1e-7
    np.testing.assert_allclose(found.affine_shear, c11 * np.eye(3) + (NORMAL + 3 * SLIDE) / HALF / 2 * (1 - np.eye(3)), rtol=0, atol=1e-9 * c11)


@pytest.mark.usefixtures("packing")
def test_affine_moduli_of_a_moving_packing(packing):  # noqa: F811
    """−∂P_aa/∂ε_b of contacts that slid, rolled and twisted: closed form against second differences of the energy.

    C_ab = (∂²U/∂ε_a∂ε_b)/V + (1 − δ_ab) P_aa + … with U(ε_a, ε_b) of the engine at frozen orientations.  For a ≠ b it is
    [U(++) − U(+−) − U(−+) + U(−−)]/4h² + P_aa, because P_aa = −(∂U/∂ε_a)/((1 + ε_b) V…) is a force per area that grows
    with ε_b.  A contact near rupture has dδ/da = 0, so that errors of h² are (h D/δ_c)², h = 1e-6: 1e-5.
    """
    springs, stress = contact_springs(packing, sand.Contact()), packing.stress()
    pressure, volume, h = np.diag(stress.parts["contacts"]), stress.volume, 1e-6

    def energy(*strain):
        return math.fsum(contact_energies(strained(packing, 1.0 + np.array(strain))))

    found, unit = np.zeros((3, 3)), h * np.eye(3)
    for a in range(3):
        for b in range(3):
            if a == b:
                second = energy(*unit[a]) - 2 * energy(0, 0, 0) + energy(*-unit[a])
                found[a, a] = second / (h * h * volume)
            else:
                ends = [energy(*(p * unit[a] + q * unit[b])) * p * q for p in (1, -1) for q in (1, -1)]
                found[a, b] = math.fsum(ends) / (4 * h * h * volume) + pressure[a]
    expected = affine_moduli(springs, pressure, volume)
    np.testing.assert_allclose(expected, found, rtol=0, atol=2e-5 * np.abs(expected).max())
    assert np.abs(pressure).max() > 1e-4 * np.abs(expected).max()
    assert affine_shear_moduli(springs, volume).diagonal() == pytest.approx(expected.diagonal(), rel=1e-12, abs=0)
