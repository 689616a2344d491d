"""Ewald sum of charges: lattice energies, brute-force lattice sums, another Ewald sum, gradients, accuracy, input."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from scipy.special import erfc

import sand
from sand.basics.constants import COULOMB
from sand.basics.errors import BadInput
from sand.forces.pair.ewald import DEGREES, half_of_vectors
from sand.forces.pair.ewald_fit import CHARGES, fitted, screened, smeared

from .test_ewald import CUBE, SIDES, gas, relative

pytestmark = pytest.mark.filterwarnings("ignore:the electric field at the surface of grains is too strong")

Q = 1.6e-18


def ions(count, net=0, gap=0.0, seed=1):
    """Positions at random and charges ±Q with this sum, in units of Q."""
    return gas(count, SIDES, seed, gap)[0], Q * np.where(np.arange(count) < (count + net) // 2, 1.0, -1.0)


def simulation(position, charge, sides, radius=1e-9, neighbours=None, **options):
    """A simulation with the Ewald sum of these charges."""
    grains = sand.Grains(position, radius, sand.SILICA, charge=charge)
    options = {"periodic": "ewald", **options}
    return sand.Simulation(grains, [sand.Charges(**options)], box=tuple(sides), neighbours=neighbours)


def loads(position, charge, sides, **options):
    """Forces (N, 3) and energy of the Ewald sum of a simulation."""
    found = simulation(position, charge, sides, **options).loads()
    return found["force"], found["energy"]["coulomb"]


def images_within(sides, radius):
    """Lattice vectors (M, 3) up to this length."""
    most = np.ceil(radius / sides).astype(int)
    found = np.stack(np.meshgrid(*(np.arange(-m, m + 1) for m in most), indexing="ij"), -1).reshape(-1, 3) * sides
    return found[(found**2).sum(axis=1) <= radius**2]


def brute_force(position, charge, sides, radius):
    """Forces and energy by all images of the box within this radius [m]: F = k q1 q2 r/r³, U = ½ Σ k q1 q2/r."""
    images = images_within(sides, radius)
    force, energy = np.zeros_like(position), 0.0
    for i, j in itertools.product(range(len(position)), repeat=2):
        r = position[i] - position[j] - images
        r = r[(r**2).sum(axis=1) > 0.0] if i == j else r
        distance = np.linalg.norm(r, axis=1)
        force[i] += COULOMB * charge[i] * charge[j] * (distance**-3 @ r)
        energy += 0.5 * COULOMB * charge[i] * charge[j] * (1.0 / distance).sum()
    return force, energy


def ewald_in_numpy(position, charge, sides, alpha, tolerance=25.0):
    """Forces and potentials, tin foil, uniform background, by erfc, all images and complex exponentials.

    Terms below exp(−tolerance) are left out; α is arbitrary.
    """
    reach = math.sqrt(tolerance) / alpha
    images = images_within(sides, reach + np.linalg.norm(sides))
    volume, size = sides.prod(), np.sqrt(tolerance) * 2 * alpha
    potential = -2 * alpha / math.sqrt(math.pi) * charge - math.pi / (volume * alpha**2) * charge.sum()
    force = np.zeros_like(position)
    for i, j in itertools.product(range(len(position)), repeat=2):
        r = position[i] - position[j] - images
        d = np.linalg.norm(r, axis=1)
        r, d = r[(d > 0) & (d < reach)], d[(d > 0) & (d < reach)]
        one = erfc(alpha * d) / d
        potential[i] += charge[j] * one.sum()
        slope = (one + 2 * alpha / math.sqrt(math.pi) * np.exp(-((alpha * d) ** 2))) / d**2
        force[i] += charge[i] * charge[j] * (slope @ r)
    q = 2 * math.pi * half_of_vectors(tuple(sides), size) / sides
    square = (q**2).sum(axis=1)
    wave = np.exp(1j * position @ q.T)
    factor = 8 * math.pi / volume * np.exp(-square / (4 * alpha**2)) / square * (charge @ wave).conj() * wave
    potential += factor.real.sum(axis=1)
    force += charge[:, None] * (factor.imag @ q)
    return COULOMB * force, COULOMB * potential


def test_the_real_part_of_charges():
    """p(u), −4p′, 16p″ (r_c = 1) are A_s, B_s, C_s of smeared charges, and those of bare charges at r = 1.

    A_s = erf(yr)/r = 1/r − A, B_s = −A_s′/r.  At degree 32 and α r_c = 4.5 the fit errs by 3e-9 of the values at 0.
    """
    found = fitted(4.5, 32, CHARGES.order)
    p = np.poly1d(found.coefficients)
    r = np.linspace(0.05, 0.9, 40)
    u = 2 * r**2 - 1
    ours = p(u), -4 * p.deriv()(u), 16 * p.deriv(2)(u)
    for own, closed, smooth, bare in zip(ours, screened(4.5, r, 0), smeared(4.5, r, 0), (1, 1, 3), strict=True):
        power = 1 if own is ours[0] else 3 if bare == 1 else 5
        far = r > 0.4
        assert (bare / r**power - closed)[far] == pytest.approx(smooth[far], rel=1e-10, abs=0.0)
        assert own == pytest.approx(smooth, abs=1e-8 * smooth.max())
    assert (p(1.0), -4 * p.deriv()(1.0), 16 * p.deriv(2)(1.0)) == pytest.approx((1, 1, 3), rel=1e-11, abs=0.0)


CORNERS = np.array(list(itertools.product((0.0, 0.5), repeat=3)))


@pytest.mark.validates("closed form", "Madelung constants of NaCl and CsCl, and one charge in a background")
@pytest.mark.compiled("small")
@pytest.mark.filterwarnings("ignore:charges. the net charge")
@pytest.mark.parametrize(
    ("sites", "signs", "expected"),
    [
        (CORNERS, (-1.0) ** (2 * CORNERS).sum(axis=1), -2 * 4 * 1.747564594633),
        ([[0.0, 0.0, 0.0], [0.5, 0.5, 0.5]], [1, -1], -2 / math.sqrt(3) * 1.762674773),
        ([[0.0, 0.0, 0.0]], [1], -2.837297479 / 2),
    ],
    ids=["NaCl", "CsCl", "one charge in a background"],
)
def test_lattice_energies(record_bound, sites, signs, expected):
    """U of a cubic cell over kq²/L: −M/d per pair of ions, d = L/2 (NaCl) and √3 L/2 (CsCl); −ξ/2, ξ = 2.837297.

    Madelung constants to ten digits; ξ is that of one charge in a uniform background (Placzek, Nijboer & van Hove
    1951).  The accuracy of 1e-8 of a gas is 2e-8 of these energies.  Forces are 0 by symmetry.
    """
    force, energy = loads((np.array(sites) - 0.4) * CUBE, Q * np.array(signs), CUBE, accuracy=1e-8)
    found = energy / (COULOMB * Q**2 / CUBE[0])
    record_bound("relative error of the energy", abs(found / expected - 1.0), most=4e-8)
    assert np.abs(force).max() < 1e-12 * COULOMB * Q**2 / CUBE[0] ** 2


@pytest.mark.compiled("small")
def test_ewald_sum_against_images_in_a_sphere():
    """Six charges, box of unequal sides: U and F of images in growing spheres in vacuum, less those of the surface.

    A sphere of boxes in vacuum has the surface energy 2πk|M|²/3V, M = Σ q x, and the forces −4πk q M/3V, which tin foil
    removes.  The ragged surface of a sphere of radius R leaves errors that fall with R, (L/R)² to (L/R)³ ~ 1e-4 of the
    loads at 25 sides; the Ewald sum is to be exact to 1e-8.
    """
    position, charge = ions(6)
    moment, volume = charge @ position, SIDES.prod()
    force, energy = loads(position, charge, SIDES, accuracy=1e-8)
    surface = 2 * math.pi * COULOMB * (moment @ moment) / (3 * volume)
    assert surface > 0.01 * abs(energy)
    errors = []
    for radius in (6e-6, 25e-6):
        found, total = brute_force(position, charge, SIDES, radius)
        found += 4 * math.pi * COULOMB / (3 * volume) * charge[:, None] * moment
        errors.append((relative(force, found), abs(energy - total + surface) / abs(energy)))
    assert errors[1][0] < 2e-4 and errors[1][1] < 5e-4
    assert errors[1][0] < 0.3 * errors[0][0]


@pytest.mark.compiled("small")
@pytest.mark.filterwarnings("ignore:charges. the net charge")
@pytest.mark.parametrize(
    "accuracy", [1e-3, 1e-8, *(pytest.param(10.0**-n, marks=pytest.mark.validate) for n in (1, 2, 4, 5, 6, 7))]
)
@pytest.mark.parametrize("net", [0, 20])
def test_the_accuracy_asked_for_is_reached(net, accuracy):
    """Rms error of the forces relative to their rms, of the energy of a charge relative to kq²/a: ≤ accuracy.

    Against an Ewald sum with other α, converged to exp(−25), also with a net charge and its background, whose energy
    −πkQ²/2Vα² makes U independent of α.  The error is the predicted one, relative to the typical force √3 kq²/a², up to
    the scatter of 40 random positions.
    """
    position, charge = ions(40, net, gap=2e-8)
    expected, potential = ewald_in_numpy(position, charge, SIDES, 6e6)
    if accuracy == 1e-3:
        other = ewald_in_numpy(position, charge, SIDES, 9e6)
        assert relative(other[0], expected) < 1e-9
        assert other[1] == pytest.approx(potential, abs=1e-9 * np.abs(potential).max())
    sim = simulation(position, charge, SIDES, accuracy=accuracy)
    found = sim.loads()
    error = np.sqrt(((found["force"] - expected) ** 2).sum(axis=1).mean())
    assert error < accuracy * np.sqrt((expected**2).sum(axis=1).mean())
    spacing = (3 * SIDES.prod() / (4 * math.pi * 40)) ** (1 / 3)
    chosen = sim.forces[0].ewald(sim.grains, sim.box)
    assert 0.6 < error / (chosen.force_error * math.sqrt(3) * COULOMB * Q**2 / spacing**2) < 1.5
    energies, unit = 0.5 * charge * potential, COULOMB * Q**2 / spacing
    assert abs(found["energy"]["coulomb"] - energies.sum()) < accuracy * 40 * unit
    assert np.sqrt(((sim.at_grains()["coulomb"] - energies) ** 2).mean()) < accuracy * unit


@pytest.mark.compiled("small")
@pytest.mark.filterwarnings("ignore:charges. the net charge")
@pytest.mark.parametrize("net", [0, 4])
def test_forces_are_gradients_of_the_energy(net):
    """F = −∂U/∂x of an inaccurate sum (1e-2), some pairs near r_c: exact whatever the accuracy; the forces cancel.

    Central differences with h = 1e-4 L and one Richardson step err by rounding, 1e-16 U/h ~ 1e-11 of U/L.
    """
    position, charge = ions(6, net, seed=3)
    force, energy = loads(position, charge, SIDES, accuracy=1e-2)
    assert np.abs(force.sum(axis=0)).max() < 1e-13 * np.abs(force).max()
    h, size = 1e-4 * SIDES[0], COULOMB * (charge**2).sum() / SIDES[0]
    for i, axis in ((0, 0), (3, 1), (5, 2)):
        step = np.zeros((6, 3))
        step[i, axis] = h
        u = {t: loads(position + t * step, charge, SIDES, accuracy=1e-2)[1] for t in (-1.0, -0.5, 0.5, 1.0)}
        slope = (8 * (u[0.5] - u[-0.5]) - (u[1.0] - u[-1.0])) / (6 * h)
        assert -slope == pytest.approx(force[i, axis], abs=1e-8 * size / SIDES[0])
    assert energy != 0.0


@pytest.mark.compiled("small")
def test_verlet_list_and_all_pairs_are_the_same_sum():
    """1000 grains, r_c below half the box: list and all pairs, in 8 blocks, agree to 1e-12 of the largest load."""
    position, _ = gas(1000, 2 * CUBE, gap=2.1e-8)
    charge = Q * np.tile([1.0, -1.0], 500)
    found = []
    for search in ("cells", "all pairs"):
        sim = simulation(position, charge, 2 * CUBE, radius=1e-8, neighbours=sand.Neighbours(search))
        assert ("a list of pairs" in sim.choices["neighbours"]) == (search == "cells")
        found.append((sim.loads()["force"], sim.at_grains()["coulomb"]))
    for ours, theirs in zip(*found, strict=True):
        assert np.abs(ours - theirs).max() < 1e-12 * np.abs(theirs).max()


@pytest.mark.compiled("small")
def test_all_images_act_by_default_in_a_periodic_box():
    """40 charges ±5 e at random: `Charges()` against an Ewald sum in NumPy of which no term above exp(−25) is left out.

    rms error of the force at most the accuracy, 1e-3, of F = √3 k q²/a², a = (3V/4πN)^(1/3); largest-case factor 2 for
    the spread of one sample of 40.  Nearest images with the automatic cut-off err by more than half of the forces.
    """
    e, rng = 1.602176634e-19, np.random.default_rng(1)
    position, charge = CUBE * (rng.random((40, 3)) - 0.5), 5 * e * np.where(np.arange(40) % 2, 1.0, -1.0)
    exact, potential = ewald_in_numpy(position, charge, CUBE, 5.0 / CUBE[0])
    size = math.sqrt((exact**2).sum(axis=1).mean())
    energy = 0.5 * charge @ potential
    force, own = loads(position, charge, CUBE, periodic="auto")
    a = (3 * CUBE.prod() / (4 * math.pi * 40)) ** (1 / 3)
    error = math.sqrt(((force - exact) ** 2).sum(axis=1).mean())
    assert error < 2e-3 * math.sqrt(3) * COULOMB * (5 * e) ** 2 / a**2 < 0.01 * size
    assert own == pytest.approx(energy, abs=2e-3 * 40 * COULOMB * (5 * e) ** 2 / a)
    with pytest.warns(UserWarning, match="charges: the cut-off, .* ends an interaction that is not small there"):
        cut, _ = loads(position, charge, CUBE, periodic="nearest image")
    assert math.sqrt(((cut - exact) ** 2).sum(axis=1).mean()) > 0.5 * size


@pytest.mark.parametrize(
    ("box", "options", "radius", "parts"),
    [
        (
            1e-6,
            {},
            None,
            ["all images, as the box is periodic along x, y and z and no cut-off is given: real part of an Ewald sum"],
        ),
        (1e-6, {"accuracy": 1e-5}, None, ["all images", "accuracy = 1e-05"]),
        (1e-6, {"periodic": "ewald"}, None, ["real part of an Ewald sum"]),
        (1e-6, {"periodic": "nearest image"}, 0.5e-6 / 1.35, ["smooth, half the box / 1.35"]),
        (1e-6, {"cutoff": "0.2 um"}, 0.2e-6, ["smooth, given by the user"]),
        (1e-6, {"cut": "sharp"}, 0.5e-6 / 1.35, ["sharp, half the box / 1.35"]),
        (1e-6, {"cutoff": None}, "none", ["no cut-off, given by the user: nearest images"]),
        (None, {}, "none", ["open box: all pairs"]),
        (
            (1e-6, 1e-6, None),
            {},
            0.5e-6 / 1.35,
            ["half the box / 1.35; no Ewald sum: the box is periodic 1 um x 1 um x o"],
        ),
        ((1e-4, 1e-4, 1e-7), {}, 0.5e-7 / 1.35, ["; no Ewald sum: ", "needs more than 1000000 wave vectors"]),
    ],
)
def test_what_acts_in_a_box_is_chosen_and_stated(box, options, radius, parts):
    """`Charges()`: all images where that is possible and no cut-off is given; a resumed run chooses the same."""
    grains = sand.Grains([[0, 0, 0], [5e-8, 0, 0]], 1e-9, sand.SILICA, charge=[Q, -Q])
    force, sides = sand.Charges(**options), sand.Box.open()
    if box is not None:
        sides = sand.Box.periodic(*(box if isinstance(box, tuple) else (box,)))
    choice = force.choose(grains, sides)
    assert all(part in choice.reason for part in parts)
    ewald = radius is None
    assert force.uses_ewald(grains, sides) == ewald
    assert choice.radius == (None if radius == "none" else pytest.approx(radius or 0.5e-6, rel=1e-12, abs=0.0))
    again = sand.Charges(**force.resolved(grains, sides))
    assert again.choose(grains, sides).radius == choice.radius and again.uses_ewald(grains, sides) == ewald


def test_a_scheme_without_rates_takes_nearest_images():
    """far = "taylor" needs rates, which an Ewald sum lacks: "auto" takes nearest images, and "ewald" is refused."""
    position, charge = ions(10)
    grains, contact = sand.Grains(position, 1e-9, sand.SILICA, charge=charge), sand.Contact()
    taylor = {"box": tuple(SIDES), "stepping": sand.Verlet(far="taylor")}
    with pytest.warns(UserWarning) as warned:
        sim = sand.Simulation(grains, [contact, sand.Charges()], **taylor)
    assert any("charges: the cut-off" in str(each.message) for each in warned)
    assert sim.choices["charges cut-off"].endswith("(smooth, half the box / 1.35)")
    with pytest.raises(BadInput, match=r"^stepping: far = 'taylor' needs the rate of change of every pair"):
        sand.Simulation(grains, [contact, sand.Charges(periodic="ewald")], **taylor)


def test_forces_of_grains_in_contact():
    """The force that acts in every step of a cycle: that of two bare charges at their nearest images."""
    grains = sand.Grains([[0.49e-6, 0, 0], [-0.495e-6, 2e-9, 0]], 1e-9, sand.SILICA, charge=[Q, -2 * Q])
    box, force = sand.Box.periodic("1 um"), sand.Charges(periodic="ewald")
    apart = np.array([-15e-9, -2e-9, 0.0])
    expected = COULOMB * -2 * Q**2 * apart / np.linalg.norm(apart) ** 3
    for listed in (False, True):
        found, *torques = force.sums(box, listed).pair(grains.arrays, box.span, force.numbers(grains, box), 0, 1)
        assert found == pytest.approx(expected, rel=1e-9, abs=0.0) and not np.any(torques)


def test_the_cheapest_parameters_of_charges_are_chosen():
    """Predicted errors are below the accuracy, and more accurate sums cost more."""
    grains, before = sand.Grains(gas(100, CUBE)[0], 1e-9, sand.SILICA, charge=np.tile([Q, -Q], 50)), 0
    for accuracy in DEGREES:
        chosen = sand.Charges(periodic="ewald", accuracy=accuracy).ewald(grains, sand.Box.periodic(*CUBE))
        assert 0.3 * accuracy < max(chosen.force_error, chosen.field_error) <= accuracy
        assert chosen.waves >= before and chosen.radius <= 0.5 * CUBE[0]
        before = chosen.waves


def test_the_choice_and_a_net_charge_are_stated():
    """The choice names the predicted errors; the warning names Q and −πkQ²/(2Vα²); parameters are kept."""
    position, charge = ions(10, net=2)
    force = sand.Charges(periodic="ewald", accuracy=1e-4)
    grains, box = sand.Grains(position, 1e-9, sand.SILICA, charge=charge), sand.Box.periodic(*SIDES)
    line = force.choose(grains, box).reason
    assert line.startswith("real part of an Ewald sum over all images: errors ")
    assert " of potential, as accuracy = 0.0001 asks for; tin-foil, alpha = " in line
    (warning,) = force.check(grains, box)
    energy = -math.pi * COULOMB * (2 * Q) ** 2 / (2 * SIDES.prod() * force.ewald(grains, box).alpha ** 2)
    assert warning.startswith(
        "charges: the net charge of the box is 3.2 aC; periodic = 'ewald' balances it by a uniform"
    )
    assert f"-pi k Q^2/(2 V alpha^2) = {1e18 * energy:.4g} aJ" in warning
    neutral = sand.Grains(position, 1e-9, sand.SILICA, charge=charge - charge.mean())
    assert force.check(neutral, box) == []
    kept = {"cutoff": "auto", "cut": "smooth", "periodic": "ewald", "accuracy": 1e-4, "boundary": "tin-foil"}
    kept |= {"reciprocal": "auto"}
    assert force.parameters() == force.resolved(grains, box) == dataclasses.asdict(force) == kept
