"""A gas of grains: thermal velocities, no overlaps, reproducible."""

import numpy as np
import pytest
from scipy import stats

import sand
from sand.constants import BOLTZMANN
from sand.setup import gas

ARGS = {"radius": "10 nm", "material": sand.IRON, "moment": "200 A m^2/kg", "temperature": "100 K"}


def test_no_two_grains_are_closer_than_the_clearance():
    """Brute force over all pairs and images: gaps of at least a tenth of a radius.

    Three hundred grains fill a seventh of the box: some pairs are neighbours across each of its faces.
    """
    box = sand.Box.periodic("0.18 um", "0.25 um", "0.2 um")
    grains = gas(300, box, seed=3, **ARGS)
    straight = grains.position[:, None] - grains.position[None, :]
    nearest = box.nearest(straight)
    distance = np.linalg.norm(nearest, axis=-1) + np.eye(300)
    assert distance.min() >= 2.1e-8 - 1e-20
    assert (np.abs(grains.position) <= 0.5 * np.array(box.lengths)).all()
    for axis in range(3):
        across = np.abs(nearest[..., axis] - straight[..., axis]) > 1e-8
        assert ((distance < 3e-8) & across).sum() >= 20


def test_momentum_is_zero_and_velocities_are_thermal():
    """Maxwell: velocities N(0, kT/m), spins N(0, kT/3I) per component; Kolmogorov–Smirnov p > 1e-3 (seed fixed)."""
    grains = gas(2000, sand.Box.periodic("5 um"), seed=5, **ARGS)
    momentum = (grains.mass[:, None] * grains.velocity).sum(axis=0)
    assert np.abs(momentum).max() < 1e-12 * (grains.mass[:, None] * np.abs(grains.velocity)).sum()
    thermal = np.sqrt(BOLTZMANN * 100 / grains.mass[0])
    assert stats.kstest(grains.velocity.ravel() / thermal, "norm").pvalue > 1e-3
    turning = np.sqrt(BOLTZMANN * 100 / (3 * grains.inertia[0]))
    assert stats.kstest(grains.spin.ravel() / turning, "norm").pvalue > 1e-3
    assert np.linalg.norm(grains.moment, axis=1) == pytest.approx(200 * grains.mass, rel=1e-6, abs=0.0)
    cosine = grains.moment[:, 2] / np.linalg.norm(grains.moment, axis=1)
    assert stats.kstest(cosine, "uniform", args=(-1, 2)).pvalue > 1e-3


def test_spin_options():
    """Mean rotational energy kT/2, (3/2)kT or none; the ratio of equipartition to kT/2 is exactly 3."""
    box = sand.Box.periodic("2 um")
    half, full, none = (gas(50, box, seed=1, spins=s, **ARGS) for s in ("kT/2", "equipartition", "none"))
    assert (full.spin**2).sum() == pytest.approx(3 * (half.spin**2).sum(), rel=1e-6, abs=0.0)
    assert not none.spin.any()


def test_the_seed_determines_the_grains():
    """Bit for bit; another seed gives other grains; another temperature the same positions (separate streams)."""
    box = sand.Box.periodic("1 um")
    one, two, other = (gas(30, box, seed=s, **ARGS) for s in (7, 7, 8))
    assert (one.position == two.position).all()
    assert (one.spin == two.spin).all()
    assert (one.position != other.position).any()
    hot = gas(30, box, seed=7, **(ARGS | {"temperature": "300 K"}))
    assert (hot.position == one.position).all()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"number": 0}, "number = 0"),
        ({"number": 60, "box": "80 nm"}, "the box is too full"),
        ({"box": "40 nm"}, "too small"),
        ({"box": None}, "periodic on all three axes"),
        ({"spins": "kt"}, "spins = 'kt'"),
        ({"temperature": "-3 K"}, "at least 0 K"),
        ({"seed": -1}, "seed = -1"),
    ],
)
def test_bad_input(changes, message):
    """One line each."""
    given = {"number": 10, "box": "0.4 um", "seed": 1} | ARGS | changes
    number, box = given.pop("number"), given.pop("box")
    with pytest.raises(sand.BadInput, match=message):
        gas(number, box, **given)
