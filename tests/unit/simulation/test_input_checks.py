"""Impossible input is refused, unusual input gives a warning. Nothing is compiled."""

import time
import warnings

import numpy as np
import pytest

import sand
from sand.config.case import check_case
from sand.simulation.pace import RunTimeEstimate

LIGHT = 299792458.0
TWO = [[0, 0, 0], [3e-8, 0, 0]]
IRON = {"radius": "10 nm", "material": "iron"}


def grains(gap=1e-8, **options):
    return sand.Grains([[0, 0, 0], [2e-8 + gap, 0, 0]], 1e-8, "iron", **options)


def case(**tables):
    content = {"run": {"until": "1 ns"}, "box": {"periodic": "1 um"}, "grains": {"number": 2, "radius": "10 nm"}}
    return check_case(content | tables, "case")


IMPOSSIBLE = [
    (lambda: grains(velocity=[0, 0, LIGHT]), "velocity of grain 0 is 2.99792e+08 m/s; it must be below that of light"),
    (lambda: grains(velocity=[[0, 0, 0], [0, 2.9e8, 1e8]]), "velocity of grain 1"),
    (lambda: grains(spin=[0, 0, 1.1e8 * LIGHT]), "spin of grain 0 moves its surface at"),
    (lambda: sand.Grains(TWO, [1e-8, 0.9e-10], "iron"), "radius of grain 1 is 9e-11 m, less than that of an atom"),
    (lambda: sand.Grains(TWO, "1e-59 m", "iron"), "less than that of an atom"),
    (lambda: sand.setup.gas(2, "1 um", temperature="1e30 K", **IRON), "temperature = '1e30 K' is above 1e+12 K"),
    (lambda: sand.setup.gas(2, "1 um", radius="1 angstrom", material="ice", temperature="9e11 K"), "grains would move"),
    (lambda: sand.Gas("1e30 K", density=1e-6), "temperature = '1e30 K' is above 1e+12 K"),
    (
        lambda: sand.Gas("1e11 K", density=1e-6, molecule_mass="1e-30 kg"),
        "mean speed of its molecules would exceed that of light",
    ),
    (lambda: sand.Gas("100 K", density=1e-6, wind=[0, 0, 3e8]), "not below the speed of light"),
    (lambda: sand.setup.encounter(grains(), grains(), speed=1e9), "not below the speed of light"),
    (lambda: grains(moment=1e30), "moment = 1e+30 is above 1e+24 A m^2, more than the moment of the Earth"),
    (lambda: grains(moment=[0, 0, 1e30]), "more than the moment of the Earth"),
    (lambda: grains(charge="1e30 C"), "more than the charge of the Earth"),
    (lambda: sand.IRON.but(young_modulus=1e50), "more than the stiffness of neutron stars"),
    (lambda: sand.IRON.but(surface_energy=1e50), "more than the surface tension of nuclei"),
    (
        lambda: sand.Simulation(grains(moment="material"), [sand.Dipoles(cutoff="15 nm")]),
        "dipoles: cutoff = 15 nm ends within a grain, whose diameter is 20 nm",
    ),
    (lambda: sand.Simulation(grains(gap=1e-6), [sand.Contact()], box="1 um"), "grain 1 lies outside the box"),
    (lambda: case(materials={"iron": {"like": "ice"}}), "'iron' is the name of a preset, but like = 'ice'"),
    (
        lambda: case(stepping={"method": "rigid-clusters", "step_fraction": 2}),
        "step_fraction = 2 must be above 0 and at most 0.2",
    ),
]


@pytest.mark.parametrize(("build", "line"), IMPOSSIBLE)
def test_impossible_input_is_refused(build, line):
    """BadInput with the expected line."""
    with pytest.raises(sand.BadInput) as caught:
        build()
    assert line in str(caught.value)
    assert "\n" not in str(caught.value)


UNUSUAL = [
    (lambda: sand.Simulation(sand.Grains([[0, 0, 0]], 10.0, "silica"), [sand.Contact()]), "a radius of 10 m"),
    (lambda: sand.setup.gas(2, "1 um", temperature="6000 K", **IRON), "no material is solid above 5000 K"),
    (lambda: sand.Simulation(grains(), [sand.Gas("6000 K", density=1e-6)]), "no material is solid above 5000 K"),
    (
        lambda: sand.Simulation(grains(gap=-1e-9)),
        "grains 0 and 1 overlap by 1 nm, and there is no",
    ),
]


@pytest.mark.parametrize(("build", "line"), UNUSUAL)
def test_unusual_input_gives_a_warning(build, line):
    """One warning with the expected line."""
    with pytest.warns(UserWarning) as caught:
        build()
    assert any(line in str(w.message) for w in caught)
    assert all(w.filename == __file__ for w in caught), "a warning names the line of the user"


def test_usual_input_gives_no_warning():
    """A grain on the face of the box, 5 mm large, at 4000 K; a changed material under its own name."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sand.Simulation(sand.Grains([[0.5, 0, 0]], 5e-3, "silica"), [sand.Contact()], box="1 m")
        sand.setup.gas(2, "1 um", temperature="4000 K", **IRON)
        case(materials={"iron": {"like": "iron", "surface_energy": "1 J/m^2"}})
        sand.Simulation(grains(gap=0.0))


def test_a_single_vector_applies_to_all_grains():
    """Shape (3,) in Grains and builders; three sizes for three grains are a vector, too."""
    vector = [0.0, 1e-18, 2e-18]
    three = sand.Grains([[0, 0, 0], [3e-8, 0, 0], [6e-8, 0, 0]], 1e-8, "iron", moment=vector, velocity=[1, 2, 3])
    assert (three.moment == vector).all() and (three.velocity == [1, 2, 3]).all()
    for made in (
        sand.setup.gas(3, "1 um", moment=vector, **IRON),
        sand.setup.chain(3, moment=vector, **IRON),
        sand.setup.lattice(2, moment=vector, **IRON),
    ):
        assert made.moment == pytest.approx(np.tile(vector, (len(made), 1)), rel=1e-15, abs=0.0)


@pytest.mark.parametrize("number", [10**30, 10**8, 100_000])
def test_a_full_box_is_refused_at_once(number):
    """The fraction filled is too large to place the grains."""
    begun = time.process_time()
    with pytest.raises(sand.BadInput, match=r"the box is too full|whole number from 1 to 1e\+08"):
        sand.setup.gas(number, "1 um", **IRON)
    assert time.process_time() - begun < 1.0


def test_positions_of_a_gas_are_those_of_version_0_1_0():
    """Sum of the coordinates of 300 grains that fill a fifth of a box."""
    side = (300 * 4.0 / 3.0 * np.pi * 1e-24 / 0.2) ** (1.0 / 3.0)
    assert sand.setup.gas(300, side, seed=3, **IRON).position.sum() == 4.4981630892576375e-07


def test_a_very_long_run_warns_once():
    """After one second: 1e-3 s in steps of 1e-20 s are 1e17 steps; 1e7 more at 1 s each are 0.3 years."""

    def issue(text, beginning):
        assert text.startswith(beginning)
        warnings.warn(text, stacklevel=2)

    pace = RunTimeEstimate(1e-3, np.inf, issue)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pace.update(1e-18, 100, 20.0)  # compiles
        pace.update(2e-18, 200, 0.6)
    with pytest.warns(UserWarning, match=r"needs about 1e\+17 more steps, about .* years") as caught:
        pace.update(3e-18, 300, 0.6)
    assert len(caught) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pace.update(4e-18, 400, 0.6)
        other = RunTimeEstimate(np.inf, 10**7 + 2, issue)
        other.update(1e-9, 1, 1.0)
        other.update(2e-9, 2, 1.0)
    with pytest.warns(UserWarning, match=r"1e\+30 more steps"):
        long = RunTimeEstimate(np.inf, 1e30, issue)
        long.update(1e-9, 64, 1.0)
        long.update(2e-9, 128, 1.0)
