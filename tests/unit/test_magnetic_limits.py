"""Where moments are fixed in the grains: closed forms against numbers worked out by hand and by other routes."""

import math

import numpy as np
import pytest
from scipy.constants import k as BOLTZMANN
from scipy.constants import mu_0

import sand
from sand.theory import dipole_energy, magnetic_limits

R = 1e-8


def test_iron_by_hand():
    """20 nm iron, K = 4.8e4 J/m³, A = 2e-11 J/m, M_s = 200 A m²/kg × 7874 kg/m³.

    36 √(AK)/(μ₀M_s²) = 36 × 9.798e-4/3.1165e6 = 11.32 nm; 2K/M_s = 0.06096 T; KV = 2.0106e-19 J = 25.33 k_B T at
    574.9 K; four digits are given.
    """
    limits = magnetic_limits("iron", R, "300 K")
    assert limits.magnetisation == pytest.approx(1.5748e6, rel=1e-12, abs=0.0)
    assert limits.single_domain_radius == pytest.approx(1.132e-8, rel=5e-4, abs=0.0)
    assert limits.anisotropy_field == pytest.approx(0.06096, rel=1e-4, abs=0.0)
    assert limits.blocking_temperature == pytest.approx(574.9, rel=2e-4, abs=0.0)


def test_the_time_that_a_moment_stays():
    """τ = τ₀ exp(KV/k_BT): at the blocking temperature or radius of a time t it is t; ln t is then exact to 1e-12."""
    for seconds in (1e-6, 100.0, 1e9):
        given = magnetic_limits("magnetite", R, "300 K", seconds)
        blocked = magnetic_limits("magnetite", R, given.blocking_temperature)
        large = magnetic_limits("magnetite", given.blocking_radius, "300 K")
        volume = 4.0 / 3.0 * math.pi * R**3
        barrier = sand.MAGNETITE.anisotropy * volume / (BOLTZMANN * given.blocking_temperature)
        for found in (blocked.relaxation_time, large.relaxation_time, 1e-9 * math.exp(barrier)):
            assert math.log(found) == pytest.approx(math.log(seconds), abs=1e-6)
    assert magnetic_limits("iron", "1 um").relaxation_time == math.inf


def test_the_field_of_a_touching_grain():
    """B = −U/μ of two aligned moments M_s V at a distance 2r (Eq. 6), μ₀M_s/12 for every radius: 0.165 T for iron.

    That is 2.7 times the anisotropy field: the moments of the paper's grains would turn inside them.
    """
    limits = magnetic_limits("iron", R)
    moment = limits.magnetisation * 4.0 / 3.0 * math.pi * R**3
    energy = dipole_energy([moment, 0, 0], [moment, 0, 0], [2 * R, 0, 0])
    assert limits.contact_field == pytest.approx(-energy / moment, rel=1e-9, abs=0.0)
    assert limits.contact_field == pytest.approx(0.165, rel=1e-3, abs=0.0)
    assert limits.contact_field / limits.anisotropy_field == pytest.approx(2.7, rel=5e-3, abs=0.0)


def test_one_domain_where_its_field_costs_less_than_a_wall():
    """A wall through the sphere, 4 √(AK) πr², costs what a flux closed by halves saves, half of μ₀M_s²V/6.

    4 √(AK) πr² = (1/2)(μ₀M_s²/6)(4πr³/3) at r = 36 √(AK)/(μ₀M_s²).
    """
    for name in ("iron", "magnetite"):
        material = sand.IRON if name == "iron" else sand.MAGNETITE
        limits = magnetic_limits(name, R)
        r = limits.single_domain_radius
        wall = 4.0 * math.sqrt(material.exchange_stiffness * material.anisotropy) * math.pi * r**2
        saved = 0.5 * mu_0 * limits.magnetisation**2 / 6.0 * 4.0 / 3.0 * math.pi * r**3
        assert wall == pytest.approx(saved, rel=1e-9, abs=0.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("silica", R), "material 'silica' lacks specific_moment, anisotropy or exchange_stiffness"),
        ((sand.IRON.but(anisotropy=None), R), r"iron.but\(anisotropy='48 kJ/m"),
        (("iron", "-1 nm"), "radius = '-1 nm' must be above 0 m"),
        (("iron", R, "0 K"), "temperature = '0 K' must be above 0 K"),
        (("iron", R, "1 K", "1 ps"), "time = '1 ps' must be above 1e-09 s"),
    ],
)
def test_bad_input(arguments, message):
    """One line each."""
    with pytest.raises(sand.BadInput, match=message):
        magnetic_limits(*arguments)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("anisotropy", "-1 kJ/m^3", "iron: anisotropy = '-1 kJ/m^3' must be above 0 J/m^3"),
        ("anisotropy", "1 J", "is not a quantity in J/m^3; give a number in SI or text such as '48 kJ/m^3'"),
        ("exchange_stiffness", np.nan, "iron: exchange_stiffness = nan is not finite"),
    ],
)
def test_bad_constants_of_a_material(key, value, message):
    """One line that names material, key and unit."""
    with pytest.raises(sand.BadInput) as caught:
        sand.IRON.but(**{key: value})
    assert message in str(caught.value) and len(caught.value.problems) == 1
