"""A gas of grains: thermal velocities, no overlaps, reproducible."""

import math

import numpy as np
import pytest
from scipy import stats

import sand
from sand.basics.constants import BOLTZMANN
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


@pytest.mark.parametrize("number", [2, 3, 100])
@pytest.mark.parametrize("kelvin", [100.0, 300.0])
def test_the_temperature_is_exact(number, kelvin):
    """Σ m v²/2 = (3/2)(N − 1) kT with Σ m v = 0, Σ I ω²/2 = N kT/2 or (3/2) N kT, for unequal masses.

    Two sums of N terms and a square root leave errors of a few units in the last place, 1e-14 with a wide margin. The
    kinetic temperature of a simulation counts the same 3 (N − 1) degrees of freedom.
    """
    radius = np.linspace(5e-9, 12e-9, number)
    for spins, share in (("kT/2", 0.5), ("equipartition", 1.5)):
        grains = gas(number, "2 um", seed=number, **ARGS | {"radius": radius, "temperature": kelvin, "spins": spins})
        translation = 0.5 * (grains.mass * (grains.velocity**2).sum(axis=1)).sum()
        rotation = 0.5 * (grains.inertia * (grains.spin**2).sum(axis=1)).sum()
        assert translation == pytest.approx(1.5 * (number - 1) * BOLTZMANN * kelvin, rel=1e-14, abs=0.0)
        assert rotation == pytest.approx(share * number * BOLTZMANN * kelvin, rel=1e-14, abs=0.0)
        momentum = (grains.mass[:, None] * grains.velocity).sum(axis=0)
        assert np.abs(momentum).max() < 1e-12 * (grains.mass[:, None] * np.abs(grains.velocity)).sum()
        assert sand.Simulation(grains, box="2 um").temperature == pytest.approx(kelvin, rel=1e-13, abs=0.0)


def test_random_draws_scatter_about_the_temperature():
    """Canonical draws: 2K/kT is χ² with 3(N − 1) degrees of freedom, 2E_rot/(kT/3) with 3N; mean and variance.

    Over 400 seeds the mean of χ²/n has the standard error √(2/400n), its variance 2/n the relative error √(2/400), for
    n ≥ 27 to 10 %; limits of four standard errors. Directions are those of the scaled gas.
    """
    number, seeds = 10, 400
    given = ARGS | {"exact_temperature": False}
    drawn = [gas(number, "1 um", seed=s, **given) for s in range(seeds)]
    for name, weight, scale, freedom in (("velocity", "mass", 1.0, 27), ("spin", "inertia", 1.0 / 3.0, 30)):
        energies = [(getattr(g, weight)[:, None] * getattr(g, name) ** 2).sum() for g in drawn]
        ratio = np.array(energies) / (scale * BOLTZMANN * 100.0 * freedom)
        assert ratio.mean() == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / (freedom * seeds)))
        assert ratio.var() == pytest.approx(2.0 / freedom, rel=4.0 * np.sqrt(2.0 / seeds) * 1.1, abs=0.0)
    exact = gas(number, "1 um", seed=0, **ARGS)
    for name in ("velocity", "spin"):
        factors = getattr(exact, name) / getattr(drawn[0], name)
        assert factors == pytest.approx(factors[0, 0], rel=1e-14, abs=0.0)
        assert abs(factors[0, 0] - 1.0) > 1e-3


def test_a_single_grain_is_at_rest_and_its_spin_is_drawn():
    """One grain without momentum has no velocity to scale; its spin is the random draw, with either option.

    v − (m v)/m is 0 to rounding, 1e-16 of the thermal speed of 0.2 m/s.
    """
    exact, drawn = (gas(1, "1 um", seed=4, exact_temperature=e, **ARGS) for e in (True, False))
    assert np.abs(exact.velocity).max() < 1e-15
    assert (exact.spin == drawn.spin).all() and exact.spin.any()


def test_the_seed_determines_the_grains():
    """Bit for bit; another seed gives other grains; another temperature the same positions (separate streams)."""
    box = sand.Box.periodic("1 um")
    one, two, other = (gas(30, box, seed=s, **ARGS) for s in (7, 7, 8))
    assert (one.position == two.position).all()
    assert (one.spin == two.spin).all()
    assert (one.position != other.position).any()
    hot = gas(30, box, seed=7, **(ARGS | {"temperature": "300 K"}))
    assert (hot.position == one.position).all()


@pytest.mark.parametrize("extent", ["0.3 um", ["periodic", "0.3 um", "periodic"]])
def test_a_gas_between_walls(extent):
    """Along an open axis, all grains are inside the extent and fill it: ⟨y²⟩ = h²/3 for centres in −h … h."""
    box = sand.Box.periodic("0.4 um", None, "0.4 um")
    grains = sand.setup.gas(150, box, extent=extent, seed=1, **ARGS)
    reach = np.abs(grains.position[:, 1]) + grains.radius
    assert reach.max() < 0.15e-6 and reach.max() > 0.9 * 0.15e-6
    middle = 0.15e-6 - 1.1 * grains.radius[0]
    spread = (grains.position[:, 1] ** 2).mean() / (middle**2 / 3.0)
    assert abs(spread - 1.0) < 5.0 * math.sqrt(0.8 / 150)  # variance of y²/⟨y²⟩ is 9/5 − 1
    pairs = box.close_pairs(grains.position, 2.0 * grains.radius[0])
    assert len(pairs) == 0
