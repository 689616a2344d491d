"""Warnings of pair forces that a cut-off ends where they still matter, and charges that would count twice."""

import math

import numpy as np
import pytest
from scipy.constants import G, epsilon_0, mu_0
from scipy.constants import e as ELEMENTARY_CHARGE
from scipy.constants import k as BOLTZMANN

import sand
from sand.basics.errors import BadInput
from sand.config.build import simulation_of
from sand.config.case import read_case
from sand.engine.input_checks import check_system
from sand.limits.truncation import motion_temperature, truncation_warnings

BOX = sand.Box.periodic("2 um")
OPEN = sand.Box.open()
T = 100.0
CHARGE = 3 * ELEMENTARY_CHARGE
COULOMB_LENGTH = CHARGE * 2 * CHARGE / (4 * math.pi * epsilon_0 * BOLTZMANN * T)
"""Distance [m] at which |U| of the two largest charges is kT."""


def grains_with(**options):
    """Eight grains of 10 nm in motion of 100 K; the two largest charges are 6 e and −3 e, moments 2e-17 and 1e-17."""
    charge = CHARGE * np.array([0.1, 2.0, 0.2, -1.0, 0.1, 0.1, 0.1, 0.1])
    moment = np.zeros((8, 3))
    moment[1, 0], moment[3, 1], moment[5, 2] = 2e-17, 1e-17, 1e-18
    options = {"charge": charge, "moment": moment} | options
    gas = sand.setup.gas(8, BOX, radius="10 nm", material="silica", temperature=T, seed=1)
    return sand.Grains(gas.position, 1e-8, "silica", velocity=gas.velocity, **options)


@pytest.mark.parametrize(("box", "share"), [(BOX, 0.15), (OPEN, 1.0)], ids=["periodic", "open"])
def test_charges_are_compared_at_the_cutoff_with_kt(box, share):
    """|U(r_c)| = k q₁q₂/r_c of the two largest charges is 0.1 kT at ten Coulomb lengths: warned of just below that."""
    given = grains_with()
    grains = sand.Grains(given.position, 1e-8, "silica", velocity=given.velocity, charge=share * given.charge)
    limit = 10.0 * share**2 * COULOMB_LENGTH
    for factor, warned in ((0.99, True), (1.01, False)):
        found = truncation_warnings(grains, [sand.Charges(cutoff=factor * limit)], box)
        assert len(found) == warned
        if warned:
            energy = 0.1 * BOLTZMANN * T / factor
            assert f"is up to {energy:.3g} J, {0.1 / factor:.3g} kT at 100 K (limit 0.1)" in found[0]
            assert found[0].startswith("charges: the cut-off, ")
            remedy = (
                "leave cutoff out, which sums all pairs" if box is OPEN else "use periodic = 'ewald' without cutoff"
            )
            assert remedy in found[0]


def test_the_temperature_is_that_of_a_gas_or_of_the_motion():
    """Brownian gas or bath, the higher one; else the motion of the grains; at rest |U| in contact takes the place."""
    grains, force = grains_with(), sand.Charges(cutoff="1 um")
    bath = sand.Contact(damping="critical", bath_temperature="900 K")
    assert motion_temperature(grains, [force]) == pytest.approx(T, rel=1e-9, abs=0.0)
    assert motion_temperature(grains, [force, sand.Gas("40 K", density=1e-6)]) == 40.0
    assert motion_temperature(grains, [force, sand.Gas("40 K", density=1e-6), bath]) == 900.0
    assert motion_temperature(grains, [sand.Gas("40 K", density=1e-6, brownian=False)]) == pytest.approx(
        T, rel=1e-9, abs=0.0
    )
    for kelvin, warned in ((300.0, True), (10.1 * T * COULOMB_LENGTH / 1e-6, False)):
        found = truncation_warnings(grains, [force, sand.Gas(kelvin, density=1e-6)], BOX)
        assert len(found) == warned and all(f"kT at {kelvin:.3g} K" in text for text in found)


def test_grains_at_rest_are_compared_with_their_neighbours():
    """At T = 0, d/r_c of Coulomb energies, d the median distance of nearest neighbours: 50 nm/0.1 = 500 nm."""
    rest = sand.Grains([[0, 0, 0], [5e-8, 0, 0], [1e-7, 0, 0], [4e-7, 0, 0]], 1e-8, "silica", charge=CHARGE)
    (text,) = truncation_warnings(rest, [sand.Charges(cutoff="495 nm")], OPEN)
    assert "0.101 of that of nearest neighbours, all at rest, (limit 0.1)" in text
    assert not truncation_warnings(rest, [sand.Charges(cutoff="505 nm")], OPEN)
    alone = sand.Grains([[0, 0, 0]], 1e-8, "silica", charge=CHARGE)
    assert not truncation_warnings(alone, [sand.Charges(cutoff="40 nm")], OPEN)


def test_every_pair_force_is_compared():
    """Screened charges k q₁q₂ exp(−r/λ)/r, moments 2kμ₁μ₂/r³, masses G m₁m₂/r, and a force of the user; SI by SciPy."""
    grains = grains_with()
    r = 3e-7

    @sand.pair_force(strength="J")
    def soft(apart, a, b, p):
        return (0.0, 0.0, 0.0), p.strength

    cases = {
        sand.ScreenedCharges("0.5 um", cutoff=r): COULOMB_LENGTH / r * math.exp(-r / 5e-7),
        sand.Dipoles(cutoff=r): 2 * mu_0 / (4 * math.pi) * 2e-34 / r**3 / (BOLTZMANN * T),
        soft(strength=0.2 * BOLTZMANN * T, cutoff=r): 0.2,
    }
    for force, expected in cases.items():
        (text,) = truncation_warnings(grains, [force], BOX)
        assert text.startswith(f"{force.name}: the cut-off, 300 nm, ends") and f", {expected:.3g} kT at 100 K" in text
    assert not truncation_warnings(grains, [soft(strength=0.09 * BOLTZMANN * T, cutoff=r)], BOX)
    heavy = sand.Grains(grains.position, 1e-8, "silica", mass=1e-3, velocity=1e-9 * grains.position / 1e-6)
    kelvin = motion_temperature(heavy, [])
    (text,) = truncation_warnings(heavy, [sand.Attraction()], BOX)
    assert f", {G * 1e-6 / (1e-6 / 1.35) / (BOLTZMANN * kelvin):.3g} kT" in text


def test_what_leaves_nothing_out_gives_no_warning():
    """Ewald sums, all pairs of an open box, a cut-off that follows the clusters, and forces without any source."""
    grains = grains_with()
    for force in (sand.Charges(), sand.Charges(periodic="ewald"), sand.Dipoles(), sand.Dipoles(periodic="ewald")):
        assert truncation_warnings(grains, [force], BOX) == []
    for force in (sand.Charges(), sand.Dipoles(), sand.ScreenedCharges("1 nm"), sand.Attraction()):
        assert truncation_warnings(grains, [force], OPEN) == []
    bare = sand.Grains(grains.position, 1e-8, "silica")
    assert truncation_warnings(bare, [sand.Charges(cutoff="0.1 um"), sand.Dipoles(cutoff="0.1 um")], BOX) == []
    (text,) = truncation_warnings(grains, [sand.Charges(cutoff=None)], BOX)
    assert text.startswith("charges: half the box, 1 um, ends")
    (text,) = truncation_warnings(grains, [sand.Charges()], sand.Box.periodic("2 um", "2 um", None))
    assert "use a box that is periodic along x, y and z" in text


def test_a_start_warns_once(recwarn):
    """One line at the start; none where a run goes on."""
    grains = grains_with(moment=None)
    sand.Simulation(grains, [sand.Charges(cutoff="0.3 um")], box=BOX)
    found = [str(each.message) for each in recwarn if "ends an interaction" in str(each.message)]
    assert len(found) == 1 and "\n" not in found[0]
    assert check_system(grains, [sand.Charges(cutoff="0.3 um")], BOX, fresh=False) == []


def test_charges_do_not_count_twice(tmp_path):
    """`Charges` with `ScreenedCharges`: one line, from Python and from a case file."""
    grains = grains_with(moment=None)
    line = "forces: charges (sand.Charges) and screened_charges (sand.ScreenedCharges) both act between the charges"
    both = [sand.Charges(), sand.ScreenedCharges("50 nm")]
    with pytest.raises(BadInput) as error:
        sand.Simulation(grains, both, box=BOX)
    assert len(error.value.problems) == 1 and error.value.problems[0].startswith(line)
    case = tmp_path / "case.toml"
    case.write_text(
        "run.until = '1 ns'\nbox.periodic = '2 um'\n[grains]\nnumber = 4\nradius = '10 nm'\ncharge = '3 e'\n"
        "[forces.charges]\n[forces.screened_charges]\nscreening_length = '50 nm'\n",
        encoding="utf-8",
    )
    with pytest.raises(BadInput) as error:
        simulation_of(read_case(case), None)
    assert len(error.value.problems) == 1 and line in error.value.problems[0]
