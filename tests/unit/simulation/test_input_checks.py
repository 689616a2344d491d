"""Impossible input is refused, unusual input gives a warning. Nothing is compiled."""

import time
import warnings

import numpy as np
import pytest

import sand
from sand.config.case import check_case
from sand.simulation.pace import RunTimeEstimate

IRON = {"radius": "10 nm", "material": "iron"}


def grains(gap=1e-8, **options):
    return sand.Grains([[0, 0, 0], [2e-8 + gap, 0, 0]], 1e-8, "iron", **options)


def case(**tables):
    content = {"run": {"until": "1 ns"}, "box": {"periodic": "1 um"}, "grains": {"number": 2, "radius": "10 nm"}}
    return check_case(content | tables, "case")


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
