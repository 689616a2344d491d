"""Pair forces: central forces, cut-offs, and the rates that extrapolate them."""

import math

import numpy as np
import pytest

import sand
from sand.basics.constants import COULOMB, GRAVITATION, MAGNETIC
from sand.forces.pair.cutoff import UNCUT, cutoff_for
from sand.forces.pair.dipole_formulas import Cutoff, cut_weight, pair_load_cut
from sand.forces.pair.dipole_rates import cut_curvature, pair_rates, uncut_rates
from sand.forces.pair.generic_loops import PairGrain, PairParameters, cut_pair, cut_rate
from sand.forces.pair.inverse_square import InverseSquareConstants, coulomb, coulomb_rate

SMOOTH = cutoff_for(1.0, "smooth")
CUTOFFS = {"none": UNCUT, "inside": cutoff_for(3.0, "smooth"), "in the shell": SMOOTH}


def apart_for(name, rng):
    """A separation that suits the cut: inside it, or in its shell from 0.8 to 1."""
    direction = rng.normal(size=3)
    return direction / np.linalg.norm(direction) * (0.9 if name == "in the shell" else 1.3)


def displaced(vector, rate, time):
    return tuple(np.asarray(vector) + time * np.asarray(rate))


@pytest.mark.parametrize("name", CUTOFFS)
@pytest.mark.parametrize("seed", range(4))
def test_taylor_rates_against_finite_differences(name, seed):
    """Ḟ and Ḃ (Eqs. 51–56 corrected) = central differences of F and B along r + ṙt, μ + μ̇t, to 1e-6.

    Fourth-order differences with h = 1e-3 of the scales have an error of h⁴ × 1e3 ~ 1e-9, rounding ε/h ~ 1e-12.
    """
    rng = np.random.default_rng(seed)
    apart, m1, m2, v, t1, t2 = apart_for(name, rng), *rng.normal(size=(5, 3))
    cutoff, h = CUTOFFS[name], 1e-3

    def loads(time):
        f, b1, b2, _ = pair_load_cut(
            displaced(apart, v, time), displaced(m1, t1, time), displaced(m2, t2, time), 1.0, cutoff
        )
        return np.array([f, b1, b2])

    slope = (8 * (loads(h) - loads(-h)) - (loads(2 * h) - loads(-2 * h))) / (12 * h)
    ours = np.array(pair_rates(tuple(apart), tuple(m1), tuple(m2), tuple(v), tuple(t1), tuple(t2), 1.0, cutoff))
    assert np.abs(ours - slope).max() < 1e-6 * np.abs(slope).max()


@pytest.mark.validate
def test_taylor_rate_of_the_torque():
    """Ṁ = μ̇×B + μ×Ḃ equals the difference quotient of μ×B along a trajectory, first order in its duration.

    Eq. 53 of the paper has the moment of the other grain there.
    """
    rng = np.random.default_rng(2)
    grains = sand.Grains(
        [[0, 0, 0], [5e-8, 1e-8, 0], [0, 6e-8, 3e-8]],
        1e-8,
        sand.IRON,
        velocity=5 * rng.normal(size=(3, 3)),
        spin=1e8 * rng.normal(size=(3, 3)),
        moment=6e-18 * rng.normal(size=(3, 3)),
    )
    from sand.basics.arrays import empty_long_range_arrays
    from sand.compiler.jit import kernel
    from sand.forces.pair.dipole_loops import ALL_PAIRS_CUT
    from sand.integrate.taylor import clear_rates, set_mean_velocities

    sum_rates = ALL_PAIRS_CUT.rates

    def fill(g, far, start, span, rules):
        set_mean_velocities(g, far, start, span, 0.0, True)
        clear_rates(far)
        sum_rates(g, far, span, rules)

    sim = sand.Simulation(grains, [sand.Dipoles()], stepping=sand.Verlet(step="1e-15 s"))
    before = sim.loads()
    w, force = sim.state, sand.Dipoles()
    far = empty_long_range_arrays(len(grains), 0)  # a run without r-RESPA cycles has no arrays for rates
    kernel(fill, cached=False)(w.grains.arrays, far, w.contacts.start, sim.box.span, force.numbers(grains, sim.box))
    force_rate, torque_rate = far.force_rate.T.copy(), far.torque_rate.T.copy()
    sim.run(steps=10)
    after = sim.loads()
    for name, rate in (("force", force_rate), ("torque", torque_rate)):
        slope = (after[name] - before[name]) / sim.time
        assert np.abs(slope - rate).max() < 1e-4 * np.abs(rate).max()


@pytest.mark.parametrize("k", [1.0, -2.0])
@pytest.mark.parametrize("name", CUTOFFS)
def test_central_force_is_minus_the_gradient(name, k):
    """F = −∂(k S/r)/∂r by fourth-order differences, 1e-9, and its rate along r + ṙt, 1e-6."""
    rng = np.random.default_rng(7)
    apart, v, h = apart_for(name, rng), rng.normal(size=3), 1e-3
    cutoff = CUTOFFS[name]

    one = PairGrain((0.0, 0.0, 0.0), 1.0, 1.0, 0.1)
    parameters = PairParameters(InverseSquareConstants(k), cutoff)

    def pair(x):
        return cut_pair(coulomb, False)(x, one, one, parameters)

    def slope(function, direction):
        at = [np.array(function(tuple(apart + n * h * direction))) for n in (1, -1, 2, -2)]
        return (8 * (at[0] - at[1]) - (at[2] - at[3])) / (12 * h)

    gradient = [slope(lambda x: pair(x)[3], axis) for axis in np.eye(3)]
    force = np.array(pair(tuple(apart))[0])
    assert np.abs(force + gradient).max() < 1e-7 * np.abs(force).max()
    rate = np.array(cut_rate(coulomb, coulomb_rate)(tuple(apart), tuple(v), one, one, parameters))
    assert np.abs(rate - slope(lambda x: pair(x)[0], v)).max() < 1e-6 * np.abs(rate).max()


def test_cutoff_weight_and_its_derivatives():
    """S = 1 up to r_s, 0 from r_c; s = −2 dS/d(r²) and ds/d(r²) by differences; both 0 for a sharp cut-off."""
    h = 1e-4
    for square in (0.5, 0.7, 0.82, 0.99, 1.2):
        ahead, behind = cut_weight(square + h, SMOOTH), cut_weight(square - h, SMOOTH)
        assert cut_weight(square, SMOOTH)[1] == pytest.approx(-(ahead[0] - behind[0]) / h, rel=1e-4, abs=1e-6)
        assert cut_curvature(square, SMOOTH) == pytest.approx((ahead[1] - behind[1]) / (2 * h), rel=1e-4, abs=1e-5)
    sharp = cutoff_for(1.0, "sharp")
    assert [cut_weight(q, sharp) for q in (0.5, 1 - 1e-9, 1 + 1e-9, 2.0)] == [(1, 0), (1, 0), (0, 0), (0, 0)]
    assert cut_weight(1e-30, UNCUT) == (1.0, 0.0) and cut_weight(1e30, UNCUT) == (1.0, 0.0)
    assert isinstance(SMOOTH, Cutoff)


def test_loads_of_the_rate_loop():
    """The loads computed together with the rates equal those of `pair_load_cut` without a cut-off, to rounding."""
    rng = np.random.default_rng(1)
    x, m1, m2, v, t1, t2 = (tuple(a) for a in rng.normal(size=(6, 3)))
    f, b1, b2, u, *_ = uncut_rates(x, m1, m2, v, t1, t2, 1.0)
    for mine, theirs in zip((f, b1, b2, u), pair_load_cut(x, m1, m2, 1.0, UNCUT), strict=True):
        assert mine == pytest.approx(theirs, rel=1e-13, abs=0.0)


@pytest.mark.validate
def test_two_charges_and_two_masses():
    """F = q1 q2/(4πε₀ r²) repulsive, G m1 m2/r² attractive; ledger energies; two falling masses conserve energy."""
    q, r = 1.6e-19, 1e-7
    ions = sand.Grains([[0, 0, 0], [r, 0, 0]], 1e-8, sand.SILICA, charge=[q, -3 * q])
    loads = sand.Simulation(ions, [sand.Charges()]).loads()
    assert loads["force"][0] == pytest.approx([3 * COULOMB * q**2 / r**2, 0, 0], rel=1e-12, abs=0.0)
    assert loads["energy"]["coulomb"] == pytest.approx(-3 * COULOMB * q**2 / r, rel=1e-12, abs=0.0)
    masses = sand.Grains([[0, 0, 0], [3.0, 0, 0]], 1.0, sand.SILICA)
    sim = sand.Simulation(masses, [sand.Attraction()])
    m = masses.mass[0]
    loads = sim.loads()
    assert loads["force"][0, 0] == pytest.approx(GRAVITATION * m**2 / 9.0, rel=1e-12, abs=0.0)
    assert loads["energy"]["gravitation"] == pytest.approx(-GRAVITATION * m**2 / 3.0, rel=1e-12, abs=0.0)
    sim.run(until="2000 s")
    total = sim.ledger["total"]
    assert sim.ledger["translation"][-1] > 0.05 * abs(total[0])
    assert abs(total[-1] - total[0]) < 1e-6 * abs(total[0])
    assert math.isclose(COULOMB, 8.9875517923e9, rel_tol=1e-10)


@pytest.mark.validate
def test_coulomb_forces_over_list_and_all_pairs():
    """Coulomb forces, energies and shares over a list and over all pairs agree to 1e-12."""
    rng = np.random.default_rng(5)
    grains = sand.Grains(1e-6 * (rng.random((150, 3)) - 0.5), 1e-9, sand.SILICA, charge=1e-18 * rng.normal(size=150))
    found = []
    for how in ("cells", "all pairs"):
        forces = [sand.Charges(cutoff="0.2 um"), sand.Attraction(cutoff="0.15 um")]
        sim = sand.Simulation(grains, forces, box="1 um", neighbours=sand.Neighbours(how))
        assert ("a list of pairs" in sim.choices["neighbours"]) == (how == "cells")
        found.append((sim.loads()["force"], *(sim.at_grains()[name] for name in ("coulomb", "gravitation"))))
    for listed, whole in zip(*found, strict=True):
        assert np.abs(listed - whole).max() < 1e-12 * np.abs(whole).max()


@pytest.mark.parametrize(
    ("force", "box", "line"),
    [
        (sand.Dipoles(open="pairs"), "1 um", "dipoles: open = 'pairs' is for open boxes, and the box is periodic 1 um"),
        (sand.Dipoles(open="tree"), ("1 um", "1 um", None), "dipoles: open = 'tree' is for open boxes, and the box is"),
        (
            sand.Dipoles(cut="sharp"),
            None,
            "dipoles: cut = 'sharp' has no effect without a cut-off (open box: all pairs)",
        ),
        (
            sand.Dipoles(None, "sharp"),
            "1 um",
            "dipoles: cut = 'sharp' has no effect without a cut-off (no cut-off, given",
        ),
        (sand.Charges(cut="sharp"), None, "charges: cut = 'sharp' has no effect without a cut-off"),
        (sand.Attraction(cut="sharp"), None, "attraction: cut = 'sharp' has no effect without a cut-off"),
        (sand.Charges(periodic="ewald"), None, "charges: periodic = 'ewald' needs a box that is periodic along x, y"),
    ],
)
def test_settings_without_effect_in_a_box_are_refused(force, box, line):
    """One line, before anything is computed; what has an effect in another box is accepted there."""
    grains = sand.Grains([[0, 0, 0], [1e-7, 0, 0]], 1e-8, sand.SILICA, charge=1e-19, moment="1e-18 A m^2")
    with pytest.raises(sand.BadInput) as error:
        sand.Simulation(grains, [force], box=box)
    assert len(error.value.problems) == 1 and error.value.problems[0].startswith(line)
    if force.cutoff == "auto":
        other = sand.Box.periodic("1 um") if box is None else sand.Box.open()
        assert not any("effect" in warning for warning in force.check(grains, other))


def test_charges_force_without_charges_warns():
    """The force is switched on but no grain is charged."""
    grains = sand.Grains([[0, 0, 0]], 1e-8, sand.SILICA)
    with pytest.warns(UserWarning, match="charges are switched on but no grain is charged"):
        sand.Simulation(grains, [sand.Charges()])


@pytest.mark.validate
def test_energies_at_grains_add_up():
    """Shares of pairs and external forces add up to the ledger; −½ μ·B of two dipoles is half of U each."""
    u = MAGNETIC * 2 * (6e-18) ** 2 / (3e-8) ** 3
    grains = sand.Grains([[0, 0, 0], [0, 0, 3e-8]], 1e-8, sand.IRON, moment="6e-18 A m^2", charge=[1e-19, 2e-19])
    sim = sand.Simulation(grains, [sand.Dipoles(), sand.Charges(), sand.Field("1 mT"), sand.Gravity("9.81 m/s^2")])
    at = sim.at_grains()
    assert at["magnetic"] == pytest.approx([-u / 2, -u / 2], rel=1e-12, abs=0.0)
    assert at["field"] == pytest.approx([-6e-21, -6e-21], rel=1e-9, abs=0.0)
    assert at["flux_density"] == pytest.approx(
        np.tile([0, 0, 2 * MAGNETIC * 6e-18 / (3e-8) ** 3 + 1e-3], (2, 1)), rel=1e-6, abs=0.0
    )
    energies = sim.loads()["energy"]
    for name in ("magnetic", "coulomb", "field", "gravity"):
        assert at[name].sum() == pytest.approx(energies[name], rel=1e-12, abs=0.0)
    assert at["kinetic"].sum() == 0.0
    assert sim.choices["boundary"] == "open"
