"""Curves of the compression of porous aggregates, against numbers worked out by hand."""

import math

import numpy as np
import pytest

import sand
from sand.theory import compression

ICE = sand.Material("ice of the papers", 1000.0, 0.1, 7e9, 0.25, "8 angstrom")


def test_scales_of_ice_grains():
    """E_roll = 12π²γRξ_c = 6π²γr₀ξ_c = 4.74e-16 J for grains of 0.1 µm, E_roll/r³ = 4.74e5 Pa, t_c = 0.193 ns.

    δ_c/F_c of t_c = √(½m δ_c/F_c) is that of JKR: δ_c = a0²/(2·6^(1/3) R), F_c = 3πγR.
    """
    one = compression.packing_scales(ICE, "0.1 um")
    assert one.roll_energy == pytest.approx(6 * math.pi**2 * 0.1 * 1e-7 * 8e-10, rel=1e-12, abs=0.0)
    assert one.roll_energy == pytest.approx(4.74e-16, rel=1e-3, abs=0.0)
    assert one.pressure == pytest.approx(4.74e5, rel=1e-3, abs=0.0)
    assert one.time == pytest.approx(0.193e-9, rel=3e-3, abs=0.0)
    radius, modulus = 5e-8, 7e9 / (2 * (1 - 0.25**2))
    rest = (9 * math.pi * 0.1 * radius**2 / modulus) ** (1 / 3)
    mass = 4 / 3 * math.pi * 1e-21 * 1000.0
    square = 0.5 * mass * rest**2 / (2 * 6 ** (1 / 3) * radius) / (3 * math.pi * 0.1 * radius)
    assert one.time == pytest.approx(math.sqrt(square), rel=1e-9, abs=0.0)
    # a contact with the period T of its normal motion, ω = 2π/T = √(k/m̄), is critically damped by 2 m̄ ω
    omega = 2 * math.pi / sand.theory.contact(ICE, "0.1 um").normal_period
    assert one.critical_damping == pytest.approx(2 * 0.5 * mass * omega, rel=1e-9, abs=0.0)
    stiff = compression.packing_scales(ICE, "0.1 um", roll_factor=8)
    assert stiff.roll_energy == pytest.approx(8 * one.roll_energy, rel=1e-12, abs=0.0)
    assert stiff.time == one.time
    long = compression.packing_scales(ICE, "0.1 um", rolling_limit="32 angstrom")
    assert long.roll_energy == pytest.approx(4 * one.roll_energy, rel=1e-12, abs=0.0)


def test_rule_of_the_rate():
    """The speed of the wave is the root of dP/d(ρφ) of P = (E_roll/r³)φ³, here by a difference; 0.3 of it at a face."""
    one = compression.packing_scales(ICE, "0.1 um")
    phi, step = 0.1, 1e-6
    rise = compression.kataoka_pressure([phi - step, phi + step], one.pressure)
    speed = math.sqrt((rise[1] - rise[0]) / (1000.0 * 2 * step))
    assert one.wave_speed * phi == pytest.approx(speed, rel=1e-9, abs=0.0)
    assert one.wave_speed == pytest.approx(37.7, rel=1e-2, abs=0.0)
    assert one.largest_rate(phi, "2 um") == pytest.approx(0.3 * speed / 2e-6, rel=1e-9, abs=0.0)
    # 512 grains: C_v = 1e-5 is slow enough from φ = 0.02 on, and not at 0.01
    side = [(512 * 4 / 3 * math.pi * 1e-21 / phi) ** (1 / 3) for phi in (0.01, 0.025)]
    rates = [one.largest_rate(phi, length) * one.time for phi, length in zip((0.01, 0.025), side, strict=True)]
    assert rates[0] < 1e-5 < rates[1]


def test_curves_of_the_literature():
    """Values at hand: each curve at a point where it is simple, and the limit that it shares with another one."""
    scale = 4.74e5
    assert compression.kataoka_pressure(0.1, "474 kPa") == pytest.approx(474.0, rel=1e-12, abs=0.0)
    # 1/φ − 1/φ_max = 10 − 1/0.74
    assert compression.tatsuuma_pressure(0.1, scale) == pytest.approx(scale / (10 - 1 / 0.74) ** 3, rel=1e-12, abs=0.0)
    thin = compression.tatsuuma_pressure(1e-4, scale) / compression.kataoka_pressure(1e-4, scale)
    assert thin == pytest.approx(1.0, abs=1e-3)
    assert compression.arakawa_coordination(1.0) == pytest.approx(11.38, rel=1e-12, abs=0.0)
    found = compression.arakawa_coordination([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    assert np.round(found, 2).tolist() == [2.23, 2.69, 3.33, 4.13, 5.05, 6.1]
    assert compression.tatsuuma_strength(1.0) == pytest.approx(6e5, rel=1e-12, abs=0.0)
    halved = compression.tatsuuma_strength(0.1, "0.05 J/m^2", "0.2 um")
    assert halved == pytest.approx(0.25 * 6e5 * 0.1**1.8, rel=1e-12, abs=0.0)
    # at p_m the curve is half way between its ends
    assert compression.guettler_filling("5.6 kPa") == pytest.approx(0.24, rel=1e-12, abs=0.0)
    assert compression.guettler_filling("13 kPa", "all sides") == pytest.approx(0.35, rel=1e-12, abs=0.0)
    assert np.round(compression.guettler_filling([1e3, 3e3, 1e4]), 3).tolist() == [0.167, 0.205, 0.273]
    with pytest.raises(sand.BadInput, match="kind = 'piston'"):
        compression.guettler_filling(1e3, "piston")
