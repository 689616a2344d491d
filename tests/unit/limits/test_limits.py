"""Limits of the model that `sand info` states and that a start warns of. Nothing is compiled."""

import json
import math

import numpy as np
import pytest
from scipy.constants import k as BOLTZMANN

import sand
from sand.cli.main import main
from sand.engine.input_checks import check_system
from sand.limits.model_limits import bath_temperature, limit_rows, limit_warnings

FORCES = [sand.Contact(), sand.Dipoles()]
BOX = sand.Box.periodic("3 um")


def thermal(radius, material, temperature, number=8, **options):
    return sand.setup.gas(number, BOX, radius=radius, material=material, temperature=temperature, **options)


def test_contacts_of_small_warm_silica_grains_creep():
    """½kq_c² of 10 nm silica (radius) at 300 K, equal grains, by the formulas of the contacts page.

    Sliding: k_s = 4Ga₀/(2−ν), ζ_c = (2−ν)a₀/16π. Twisting: k_t = (8/3)Ga₀³, φ_c = 1/16π; 5.1 and 1.9 kT. Rolling,
    6πγξ_c² = 114 kT, is not named.
    """
    m, r = sand.SILICA, 1e-8
    big_r, modulus = r / 2, m.young_modulus / (2 * (1 - m.poisson_ratio**2))
    a0 = (9 * math.pi * m.surface_energy * big_r**2 / modulus) ** (1 / 3)
    stored = {
        "sliding": 0.5 * 4 * m.shear_modulus * a0 / (2 - 0.17) * ((2 - 0.17) * a0 / (16 * math.pi)) ** 2,
        "twisting": 0.5 * 8 / 3 * m.shear_modulus * a0**3 / (16 * math.pi) ** 2,
    }
    (text,) = limit_warnings(thermal(r, "silica", 300.0), FORCES, BOX)
    for mode, energy in stored.items():
        assert f"{mode} {energy / (BOLTZMANN * 300):.2g} kT" in text
    assert "rolling" not in text and "contacts of silica grains of radius 10 nm creep at 300 K" in text
    assert "slide_factor, twist_factor" in text
    stiff = sand.Contact(slide_factor=2, twist_factor=0)  # 10.2 kT; no twisting at all
    assert not limit_warnings(thermal(r, "silica", 300.0), [stiff], BOX)
    bare = m.but(name="bare", surface_energy=0)
    assert not limit_warnings(thermal(r, bare, 300.0), FORCES, BOX)


def test_contacts_of_cold_iron_do_not_creep():
    """Twisting of 20 nm iron stores 592 kT at 100 K, below 10 kT only above 5900 K; the kT is that of a gas, if any.

    a₀ = 2.655 nm, G′ = 41.34 GPa: ½ (16/3) G′a₀³/(16π)² = 8.17e-19 J.
    """
    grains = thermal("10 nm", "iron", "100 K")
    assert limit_warnings(grains, FORCES, BOX) == []
    c = sand.theory.contact("iron", "10 nm")
    energy = 0.5 * c.twist_stiffness * c.twist_limit**2 / (BOLTZMANN * 100)
    assert energy == pytest.approx(592, rel=1e-3, abs=0.0)
    soft = sand.Contact(twist_factor=9.9 / energy)
    (text,) = limit_warnings(grains, [soft], BOX)
    assert "only twisting 9.9 kT (below 10)" in text
    assert limit_warnings(grains, [soft, sand.Gas("90 K", density=1e-6)], BOX) == []
    (text,) = limit_warnings(grains, [sand.Contact(twist_factor=9.9999 / energy)], BOX)
    assert "only twisting 9.9999 kT (below 10)" in text


def test_velocities_are_thermal_in_a_periodic_box_only():
    """The temperature is that of a gas with Brownian motion, else the kinetic one; 0 for bodies in open space."""
    grains = thermal("10 nm", "iron", "100 K")
    assert bath_temperature(grains, FORCES, BOX) == pytest.approx(100.0, rel=1e-12, abs=0.0)
    assert bath_temperature(grains, FORCES, sand.Box.open()) == 0.0
    assert bath_temperature(grains, [sand.Gas("20 K", density=1e-6)], sand.Box.open()) == 20.0
    assert bath_temperature(grains, [sand.Gas("20 K", density=1e-6, brownian=False)], BOX) == pytest.approx(
        100.0, rel=1e-6, abs=0.0
    )
    assert bath_temperature(thermal("10 nm", "iron", "6000 K"), FORCES, BOX) == 0.0  # no temperature of a solid


@pytest.mark.parametrize(
    ("radius", "temperature", "moment", "parts"),
    [
        # 12.78 nm at 300 K; τ = 1e-9 s × exp(K₁V/4kT): 1e-9 s × exp(6.2832e-21/4.1419e-21) = 4.558 ns for 5 nm, and
        # 1e-9 s × exp(12.136) = 186.4 us for 10 nm
        ("5 nm", "300 K", "material", ["iron grains of radius 5 nm", "within 4.558 ns at 300 K", "below 12.78 nm"]),
        ("10 nm", "300 K", "material", ["within 186.4 us at 300 K", "with the energy barrier K1 V/4 (cubic)"]),
        ("5 nm", "15 K", "material", None),
        ("10 nm", "100 K", "material", None),
        # above 11.32 nm there are several domains
        (
            "12 nm",
            "100 K",
            "material",
            ["iron grains of radius 12 nm are 100% of saturation", "above 11.32 nm", "40 to"],
        ),
        ("12 nm", "100 K", "19 A m^2/kg", None),  # a tenth of saturation is 20 A m²/kg
        ("12 nm", "100 K", "40 A m^2/kg", ["are 20% of saturation"]),
        ("12 nm", "100 K", None, None),
    ],
)
def test_moments_that_are_not_fixed_give_a_warning(radius, temperature, moment, parts):
    """Superparamagnetic grains, and grains with several domains and a large moment; dipoles only."""
    grains = thermal(radius, "iron", temperature, moment=moment)
    found = limit_warnings(grains, FORCES, BOX)
    assert len(found) == (parts is not None)
    assert all(part in found[0] for part in parts or ())
    assert not limit_warnings(grains, [sand.Contact()], BOX)
    assert not limit_warnings(sand.Grains(grains.position, radius, sand.IRON.but(anisotropy=None)), FORCES, BOX)


def test_a_start_warns_once_and_a_resumed_run_does_not():
    """One warning among the checks of a start; a resumed run is checked without it."""
    grains = thermal("5 nm", "silica", "300 K")
    with pytest.warns(UserWarning, match="creep at 300 K") as caught:
        sand.Simulation(grains, [sand.Contact()], box=BOX)
    assert len(caught) == 1
    assert check_system(grains, [sand.Contact()], BOX, fresh=False) == []


def test_a_fresh_contact_rings():
    """U(0) − U(δ0) = (1.453696 − 0.846614) F_cδ_c: 3.3e-17 J, 24,000 kT at 100 K for 20 nm iron; 0 without adhesion."""
    c = sand.theory.contact("iron", "10 nm")
    energy = (1.453696 - 0.846614) * c.pull_off_force * c.pull_off_overlap
    assert c.ringing_energy == pytest.approx(energy, rel=1e-5, abs=0.0)
    assert energy / (BOLTZMANN * 100) == pytest.approx(24100, rel=2e-3, abs=0.0)
    row = limit_rows(thermal("10 nm", "iron", "100 K"), FORCES, BOX)["fresh contact"]
    assert (
        "3.33e-17 J (2.4e+06 K, 2.41e+04 kT at 100 K) in vibration; nothing removes it: for growth choose a damping, "
        "'critical' lets grains stick up to 3.4 times the speed" in row
    )
    damped = sand.Contact(damping="viscoelastic", viscous_time="1 ps")
    row = limit_rows(thermal("10 nm", "iron", "0 K"), [damped], BOX)["fresh contact"]
    assert row.endswith("3.33e-17 J (2.4e+06 K) in vibration; damping: viscoelastic")
    bare = sand.IRON.but(name="bare", surface_energy=0)
    assert limit_rows(thermal("10 nm", bare, "100 K"), FORCES, BOX) == {}


def test_limits_of_the_moments_are_stated():
    """Numbers of the grains of the paper; magnetite of 20 nm keeps its moments in contact below their field."""
    row = limit_rows(thermal("10 nm", "iron", "100 K", moment="material"), FORCES, BOX)["moments"]
    quoted = "(an estimate for spheres, to a factor of about two; Dominik & Nübold 2002 quote 40 to 60 nm in diameter"
    fixed = "below 144 K (above a radius of 8.861 nm), with the energy barrier K1 V/4 (cubic)"
    for part in ("iron: one domain up to a radius of 11.32 nm", quoted, fixed):
        assert part in row
    assert row.endswith("164.9 mT, is above the anisotropy field, 60.96 mT: moments would turn inside the grains")
    weak = limit_rows(thermal("10 nm", "iron", "100 K", moment="20 A m^2/kg"), FORCES, BOX)["moments"]
    assert "16.49 mT, is below the anisotropy field, 60.96 mT" in weak
    large = sand.Grains(np.zeros((1, 3)), "1 um", "iron", moment="material")
    assert "fixed for 100 s at any temperature, with" in limit_rows(large, FORCES, sand.Box.open())["moments"]


def test_info_states_the_limits(tmp_path, capsys):
    """Two rows for people, and the same for machines; only those of forces that the case has."""
    path = tmp_path / "case.toml"
    case = """run.until = "1 ns"
box.periodic = "1 um"
grains = { number = 8, radius = "10 nm", material = "iron", moment = "material", temperature = "100 K" }
forces.contact = {}
"""
    path.write_text(case + "forces.dipoles = {}\n", encoding="utf-8")
    assert main(["info", str(path)]) == 0
    assert "choose a damping" in (shown := capsys.readouterr().out) and "moments would turn inside the grains" in shown
    path.write_text(case, encoding="utf-8")
    assert main(["info", str(path), "--json"]) == 0
    assert list(json.loads(capsys.readouterr().out)["limits"]) == ["fresh contact"]


def test_a_field_that_is_probably_in_another_unit():
    """A warning above 5 T, of the largest |B0| + |B1|, the end of a ramp, or a point of a `Ramp`; none at 5 T."""
    grains = thermal("10 nm", "silica", 0.0)
    fine = [sand.Field(5.0), sand.Field([3, 0, 4]), sand.Field(2, shape="oscillating", amplitude=3, frequency=1e6)]
    assert limit_warnings(grains, fine, BOX) == []
    for field, size in (
        (sand.Field(10), "10 T"),
        (sand.Field(5.00001), "5.00001 T"),
        (sand.Field(3, shape="oscillating", amplitude=3, frequency=1e6), "6 T"),
        (sand.Field(0, shape="ramp", final=[0, 8, 6], end="1 us"), "10 T"),
        (sand.Field(sand.Ramp([[0, 0, 0], [0, 0, 7]], ["1 ns", "2 ns"])), "7 T"),
    ):
        (text,) = limit_warnings(grains, [field], BOX)
        assert f"of up to {size} is above 5 T" in text and "a number without one is in T" in text
