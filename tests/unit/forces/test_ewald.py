"""Ewald sum of dipoles: brute-force lattice sums, another Ewald sum, closed forms, gradients, accuracy, input."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from scipy.special import erfc

import sand
from sand.basics.constants import MAGNETIC
from sand.forces.pair.dipole_formulas import pair_load
from sand.forces.pair.ewald import DEGREES, half_of_vectors
from sand.forces.pair.ewald_fit import fitted, screened, smeared

SIDES = np.array([1.0e-6, 1.3e-6, 1.1e-6])
CUBE = np.full(3, 1.2e-6)
MOMENT = 4e-18


def gas(count, sides, seed=1, gap=0.0):
    """Positions and moments at random, no two closer than `gap` [m]."""
    rng = np.random.default_rng(seed)
    found = np.zeros((0, 3))
    while len(found) < count:
        x = (rng.random(3) - 0.5) * sides
        apart = found - x
        apart -= sides * np.rint(apart / sides)
        if not (np.linalg.norm(apart, axis=1) < gap).any():
            found = np.vstack([found, x])
    return found, MOMENT * rng.normal(size=(count, 3))


def loads(position, moment, sides, radius=1e-9, **options):
    """Forces, flux densities, torques (N, 3) and energy of the Ewald sum of a simulation."""
    grains = sand.Grains(position, radius, sand.IRON, moment=moment)
    sim = sand.Simulation(grains, [sand.Dipoles(periodic="ewald", **options)], box=tuple(sides))
    found = sim.loads()
    return found["force"], found["field"], found["torque"], found["energy"]["magnetic"]


def relative(found, expected):
    """Rms error of vectors relative to their rms."""
    return np.sqrt(((found - expected) ** 2).sum() / (expected**2).sum())


def brute_force(position, moment, sides, radius):
    """Forces and flux densities by all images in a sphere of this radius [m], which is in vacuum.

    U = k [μ1·μ2/r³ − 3 (μ1·r)(μ2·r)/r⁵] of each pair; B at i due to j, F = ∇(μ_i·B).
    """
    most = np.ceil(radius / sides).astype(int)
    images = np.stack(np.meshgrid(*(np.arange(-m, m + 1) for m in most), indexing="ij"), -1).reshape(-1, 3) * sides
    images = images[(images**2).sum(axis=1) <= radius**2]
    force, field = np.zeros_like(position), np.zeros_like(position)
    for i, j in itertools.product(range(len(position)), repeat=2):
        r = position[i] - position[j] - images
        r = r[(r**2).sum(axis=1) > 0.0] if i == j else r
        r2 = (r**2).sum(axis=1)
        r3 = r2**-1.5
        a, b = r @ moment[i], r @ moment[j]
        field[i] += MAGNETIC * ((3 * b * r3 / r2) @ r - moment[j] * r3.sum())
        if i != j:
            r5 = 3 * r3 / r2
            force[i] += MAGNETIC * ((moment[i] @ moment[j] - 5 * a * b / r2) * r5) @ r
            force[i] += MAGNETIC * ((a * r5).sum() * moment[j] + (b * r5).sum() * moment[i])
    return force, field


def ewald_in_numpy(position, moment, sides, alpha, tolerance=25.0):
    """Forces, flux densities and energy, tin foil, by an Ewald sum with erfc, all images and complex exponentials.

    Terms below exp(−tolerance) are left out; α is arbitrary.
    """
    reach = math.sqrt(tolerance) / alpha
    most = np.ceil(reach / sides + 0.5).astype(int)
    images = np.stack(np.meshgrid(*(np.arange(-m, m + 1) for m in most), indexing="ij"), -1).reshape(-1, 3) * sides
    force, field = np.zeros_like(position), 4 * alpha**3 / (3 * math.sqrt(math.pi)) * MAGNETIC * moment
    for i, j in itertools.product(range(len(position)), repeat=2):
        r = position[i] - position[j] - images
        size = np.linalg.norm(r, axis=1)
        r, size = r[(size > 0) & (size < reach)], size[(size > 0) & (size < reach)]
        e = 2 * alpha / math.sqrt(math.pi) * np.exp(-((alpha * size) ** 2))
        b = (erfc(alpha * size) / size + e) / size**2
        c = (3 * b + 2 * alpha**2 * e) / size**2
        d = (5 * c + 4 * alpha**4 * e) / size**2
        along, other = r @ moment[i], r @ moment[j]
        field[i] += MAGNETIC * ((c * other) @ r - b.sum() * moment[j])
        radial = c * (moment[i] @ moment[j]) - d * along * other
        force[i] += MAGNETIC * (radial @ r + (c * along).sum() * moment[j] + (c * other).sum() * moment[i])
    q = 2 * math.pi * half_of_vectors(tuple(sides), 2 * alpha * math.sqrt(tolerance)) / sides
    square = (q**2).sum(axis=1)
    weight = 8 * math.pi * MAGNETIC / sides.prod() * np.exp(-square / (4 * alpha**2)) / square
    wave, along = np.exp(1j * position @ q.T), moment @ q.T
    factor = weight * (along * wave).sum(axis=0).conj() * wave
    field -= factor.real @ q
    force += (along * factor.imag) @ q
    return force, field, -0.5 * (moment * field).sum()


def test_the_real_part_is_ewalds():
    """p(u), −4p′, 16p″ (r_c = 1) are B_s, C_s, D_s of smeared dipoles, and those of bare dipoles at r = 1.

    B_s = 1/r³ − B, with the closed form of B.  At degree 32 and α r_c = 5 the fit errs by 1e-9 of the values at r = 0;
    the condition at r_c is met to rounding.  ⟨δF²⟩ of bare dipoles is 10/r⁸, ⟨δB²⟩ = 2/r⁶: means over directions.
    """
    found = fitted(5.0, 32)
    p = np.poly1d(found.coefficients)
    r = np.linspace(0.05, 0.9, 40)
    u = 2 * r**2 - 1
    ours = p(u), -4 * p.deriv()(u), 16 * p.deriv(2)(u)
    for own, closed, smooth, bare in zip(ours, screened(5.0, r), smeared(5.0, r), (1, 3, 15), strict=True):
        power = {1: 3, 3: 5, 15: 7}[bare]
        far = r > 0.4
        assert (bare / r**power - closed)[far] == pytest.approx(smooth[far], rel=1e-10, abs=0.0)
        assert own == pytest.approx(smooth, abs=1e-8 * smooth.max())
    assert (p(1.0), -4 * p.deriv()(1.0), 16 * p.deriv(2)(1.0)) == pytest.approx((1, 3, 15), rel=1e-11, abs=0.0)
    directions = np.random.default_rng(1).normal(size=(2, 20000, 3))
    a, b = directions / np.linalg.norm(directions, axis=2)[..., None]
    both, z = (a * b).sum(axis=1), np.array([0.0, 0.0, 1.0])
    force = (3 * both - 15 * a[:, 2] * b[:, 2])[:, None] * z + 3 * (a[:, 2:] * b + b[:, 2:] * a)
    assert (force**2).sum(axis=1).mean() == pytest.approx(10.0, rel=0.03, abs=0.0)


def test_half_of_the_wave_vectors():
    """Of each pair q, −q within the sphere exactly one, and not 0; sides differ."""
    sides, largest = (1.0, 2.0, 0.7), 30.0
    half = half_of_vectors(sides, largest)
    every = np.array(list(itertools.product(range(-12, 13), repeat=3)))
    inside = ((2 * math.pi * every / sides) ** 2).sum(axis=1) <= largest**2
    expected = {tuple(v) for v in every[inside]} - {(0, 0, 0)}
    found = {tuple(v) for v in half}
    assert found | {tuple(-v for v in w) for w in found} == expected and len(found) == len(half) == len(expected) // 2


@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize("boundary", ["vacuum", "tin-foil"])
def test_ewald_sum_against_images_in_a_sphere(boundary):
    """Four dipoles in a box of unequal sides: F, B and U are those of all images in a sphere of 25 sides.

    The sphere in vacuum has the demagnetising field −4πk Σμ/3V, which tin foil removes.  The sum over a sphere of
    radius R errs by (L/R)² to (L/R)³ ~ 1e-4 of the loads by its ragged surface; the Ewald sum is to be exact to 1e-8.
    The energy errs by at most ½ |μ| |δB|, with the norms of all moments and of all errors of B.
    """
    position, moment = gas(4, SIDES)
    force, field = brute_force(position, moment, SIDES, 25e-6)
    if boundary == "tin-foil":
        field += 4 * math.pi / 3 * MAGNETIC / SIDES.prod() * moment.sum(axis=0)
    found = loads(position, moment, SIDES, accuracy=1e-8, boundary=boundary)
    assert relative(found[0], force) < 1.5e-4
    assert relative(found[1], field) < 3e-4
    assert found[3] == pytest.approx(
        -0.5 * (moment * field).sum(), abs=3e-4 * 0.5 * np.linalg.norm(moment) * np.linalg.norm(field)
    )
    other = ewald_in_numpy(position, moment, SIDES, 5e6)
    if boundary == "tin-foil":  # the reference of the tests below
        assert relative(other[0], force) < 1e-4 and relative(other[1], field) < 2e-4


@pytest.mark.compiled("dipoles")
def test_flux_density_of_a_cubic_lattice():
    """B of a lattice of equal moments at its points: (4π/3) kμ/L³ in tin foil, 0 for a sphere in vacuum (Lorentz)."""
    moment = np.array([[1e-18, -2e-18, 3e-18]])
    lorentz = 4 * math.pi / 3 * MAGNETIC * moment / CUBE[0] ** 3
    typical = math.sqrt(2) * MAGNETIC * np.linalg.norm(moment) * 4 * math.pi / 3 / CUBE[0] ** 3
    for boundary, expected in (("tin-foil", lorentz), ("vacuum", 0.0)):
        force, field, _, energy = loads([[1e-7, 2e-7, -3e-7]], moment, CUBE, boundary=boundary)
        assert np.abs(field - expected).max() < 1e-3 * typical
        assert np.abs(force).max() < 1e-12 * typical * np.abs(moment).max() / CUBE[0]
        assert energy == pytest.approx(-0.5 * (moment * field).sum(), abs=1e-12 * typical * np.abs(moment).max())


SIMPLE = [[0.0, 0.0, 0.0]]
BODY_CENTRED = [*SIMPLE, [0.5, 0.5, 0.5]]
FACE_CENTRED = [*SIMPLE, [0.5, 0.5, 0.0], [0.5, 0.0, 0.5], [0.0, 0.5, 0.5]]
COLUMNS = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0], [0.5, 0.5, 0.0]]


@pytest.mark.validates(
    "closed form",
    "Energies of dipole lattices: cubic sums, and columns of Luttinger & Tisza (1946)",
)
@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize(
    ("sites", "sides", "signs", "expected"),
    [
        (BODY_CENTRED, [1, 1, 1], [1, 1], -4 * math.pi / 3),
        (FACE_CENTRED, [1, 1, 1], [1, 1, 1, 1], -8 * math.pi / 3),
        (BODY_CENTRED, [1, 1, 1], [1, -1], 0.0),
        (COLUMNS, [2, 2, 1], [1, -1, -1, 1], -2.676),
    ],
    ids=["bcc", "fcc", "bcc in opposite directions", "columns of Luttinger and Tisza"],
)
def test_lattice_energies(record_bound, sites, sides, signs, expected):
    """U per dipole over kμ²/a³, tin foil: −(2π/3) n of n dipoles per cubic cell; ground state of the sc lattice.

    By cubic symmetry every sublattice gives the Lorentz field (4π/3) kμ/a³ at its own points and at points of cubic
    symmetry between them, so that two opposite ones cancel.  Columns along z whose directions alternate along x and y
    are the lowest state of the simple cubic lattice, −2.676 (Luttinger & Tisza 1946, Phys. Rev. 70, 954).
    """
    sides = np.array(sides) * 1e-6
    moment = MOMENT * np.array([[0.0, 0.0, s] for s in signs])
    energy = loads((np.array(sites) - 0.4) * sides, moment, sides, accuracy=1e-8)[3]
    found = energy / len(sites) / (MAGNETIC * MOMENT**2 / 1e-18)
    record_bound("error of the energy of a dipole over kμ²/a³", abs(found - expected), most=1e-3)


@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize("boundary", ["vacuum", "tin-foil"])
def test_loads_are_gradients_of_the_energy(boundary):
    """F = −∂U/∂x and M = −∂U/∂θ of an inaccurate sum (1e-2), some pairs near r_c: exact whatever the accuracy.

    Central differences with h = 1e-4 L and one Richardson step err by rounding, 1e-16 U/h ~ 1e-11 of U/L.
    """
    position, moment = gas(6, SIDES, seed=3)
    options = {"accuracy": 1e-2, "boundary": boundary}
    force, _, torque, energy = loads(position, moment, SIDES, **options)
    assert np.abs(force.sum(axis=0)).max() < 1e-13 * np.abs(force).max()
    h, size = 1e-4 * SIDES[0], abs(energy) / SIDES[0]

    def slope(change):
        steps = {t: loads(*change(t), SIDES, **options)[3] for t in (-1.0, -0.5, 0.5, 1.0)}
        return (8 * (steps[0.5] - steps[-0.5]) - (steps[1.0] - steps[-1.0])) / 6

    for i, axis in ((0, 0), (3, 1), (5, 2)):
        unit = np.eye(3)[axis]

        def moved(t, i=i, unit=unit):
            return position + t * h * unit * (np.arange(6) == i)[:, None], moment

        def turned(t, i=i, unit=unit):
            other, angle = moment.copy(), 1e-4 * t
            v = moment[i]
            other[i] = v * math.cos(angle) + np.cross(unit, v) * math.sin(angle)
            other[i] += unit * (unit @ v) * (1 - math.cos(angle))
            return position, other

        assert -slope(moved) / h == pytest.approx(force[i, axis], abs=1e-7 * size)
        assert -slope(turned) / 1e-4 == pytest.approx(torque[i, axis], abs=1e-7 * size * SIDES[0])


def clusters(seed=5):
    """Chains of 6 touching grains with moments along the chain, in a box of unequal sides."""
    centres, _ = gas(5, SIDES, seed, gap=4e-7)
    rng = np.random.default_rng(seed)
    axes = rng.normal(size=(5, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    along = 2e-8 * (np.arange(6) - 2.5)
    position = (centres[:, None] + along[None, :, None] * axes[:, None]).reshape(-1, 3)
    position -= SIDES * np.rint(position / SIDES)
    return position, np.repeat(MOMENT * axes, 6, axis=0) + 0.2 * MOMENT * rng.normal(size=(30, 3))


@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize(
    "accuracy", [1e-3, 1e-8, *(pytest.param(10.0**-n, marks=pytest.mark.validate) for n in (1, 2, 4, 5, 6, 7))]
)
@pytest.mark.parametrize("kind", ["gas", "clusters"])
def test_the_accuracy_asked_for_is_reached(kind, accuracy):
    """Rms error of forces and torques, relative to the median (gas) or rms (clusters) load, ≤ accuracy.

    Against an Ewald sum with other parameters that is converged to exp(−25); its α does not matter.  The predicted
    error is that of a typical load of a gas, so that the error relative to the rms load is smaller.
    """
    sides = SIDES
    position, moment = gas(40, sides, gap=2e-8) if kind == "gas" else clusters()
    expected = ewald_in_numpy(position, moment, sides, 6e6)
    if accuracy == 1e-3:
        other = ewald_in_numpy(position, moment, sides, 9e6)
        assert relative(other[0], expected[0]) < 1e-9 and relative(other[1], expected[1]) < 1e-9
    force, field, torque, _ = loads(position, moment, sides, accuracy=accuracy)
    assert torque == pytest.approx(np.cross(moment, field), rel=1e-12, abs=0.0)
    for found, right in ((force, expected[0]), (torque, np.cross(moment, expected[1]))):
        error = np.sqrt(((found - right) ** 2).sum(axis=1).mean())
        sizes = np.linalg.norm(right, axis=1)
        assert error < accuracy * (np.median(sizes) if kind == "gas" else np.sqrt((sizes**2).mean()))
    if kind == "gas":
        box, grains = sand.Box.periodic(*sides), sand.Grains(position, 1e-9, sand.IRON, moment=moment)
        chosen = sand.Dipoles(periodic="ewald", accuracy=accuracy).ewald(grains, box)
        error = np.sqrt(((force - expected[0]) ** 2).sum(axis=1).mean())
        mean_square = (moment**2).sum(axis=1).mean()
        typical = math.sqrt(6) * MAGNETIC * mean_square * (4 * math.pi * 40 / 3 / sides.prod()) ** (4 / 3)
        assert 0.2 < error / (chosen.force_error * typical) < 1.5  # the prediction


def test_loads_of_grains_in_contact():
    """The loads that act in every step of a cycle: F, M1, M2 of two bare dipoles at their nearest images."""
    grains = sand.Grains([[0.49e-6, 0, 0], [-0.495e-6, 2e-9, 0]], 1e-9, sand.IRON, moment=[[1, 2, 3], [-2, 1, 0.5]])
    box, force = sand.Box.periodic("1 um"), sand.Dipoles(periodic="ewald")
    for listed in (False, True):
        found = force.sums(box, listed).pair(grains.arrays, box.span, force.numbers(grains, box), 0, 1)
        own, field1, field2, _ = pair_load((-15e-9, -2e-9, 0.0), *grains.moment, MAGNETIC)
        torques = np.cross(grains.moment[0], field1), np.cross(grains.moment[1], field2)
        for ours, expected in zip(found, (own, *torques), strict=True):
            assert ours == pytest.approx(np.array(expected), rel=1e-7, abs=1e-9 * np.linalg.norm(expected))


@pytest.mark.compiled("dipoles")
def test_two_cells_are_one_long_cell():
    """Twice the content in a box of twice the length: the same loads, to the sum of both errors, 2e-3 of the median."""
    position, moment = gas(20, SIDES, seed=2)
    once = loads(position, moment, SIDES)
    shift = np.array([0.5 * SIDES[0], 0.0, 0.0])
    twice = loads(np.concatenate([position - shift, position + shift]), np.tile(moment, (2, 1)), SIDES * [2, 1, 1])
    for found, expected in zip(twice[:3], once[:3], strict=True):
        error = np.sqrt(((found - np.tile(expected, (2, 1))) ** 2).sum(axis=1).mean())
        assert error < 2e-3 * np.median(np.linalg.norm(expected, axis=1))
    assert twice[3] == pytest.approx(2 * once[3], rel=2e-3, abs=0.0)


@pytest.mark.compiled("listed")
def test_verlet_list_and_threads_make_the_same_sum():
    """1000 grains with r_c below half the box: list and all pairs agree to rounding; 1e-12 of the largest load."""
    position, moment = gas(1000, 2 * CUBE, gap=2.1e-8)
    grains = sand.Grains(position, 1e-8, sand.IRON, moment=moment)
    found = []
    for search in ("cells", "all pairs"):
        force = sand.Dipoles(periodic="ewald")
        sim = sand.Simulation(grains, [force], box=tuple(2 * CUBE), neighbours=sand.Neighbours(search))
        assert ("a list of pairs" in sim.choices["neighbours"]) == (search == "cells")
        found.append(sim.loads())
    for name in ("force", "field", "torque"):
        assert np.abs(found[0][name] - found[1][name]).max() < 1e-12 * np.abs(found[1][name]).max()


def test_the_cheapest_parameters_are_chosen():
    """Predicted errors are below the accuracy, more accurate sums cost more, and large boxes use a radius below L/2."""
    before = 0
    for accuracy in DEGREES:
        position, moment = gas(100, CUBE)
        grains = sand.Grains(position, 1e-9, sand.IRON, moment=moment)
        chosen = sand.Dipoles(periodic="ewald", accuracy=accuracy).ewald(grains, sand.Box.periodic(*CUBE))
        assert 0.3 * accuracy < max(chosen.force_error, chosen.field_error) <= accuracy
        assert chosen.waves >= before and chosen.radius <= 0.5 * CUBE[0]
        before = chosen.waves
    grains = sand.Grains(*[gas(3000, 4 * CUBE)[0]], 1e-9, sand.IRON, moment=[0, 0, MOMENT])
    assert sand.Dipoles(periodic="ewald").ewald(grains, sand.Box.periodic(*(4 * CUBE))).radius < 0.4 * 4 * CUBE[0]


def test_the_choice_is_stated():
    """The line of the choice names radius, boundary, wave vectors and predicted errors; parameters are kept."""
    position, moment = gas(10, CUBE)
    grains = sand.Grains(position, 1e-9, sand.IRON, moment=moment)
    force = sand.Dipoles(periodic="ewald", accuracy=1e-4, boundary="vacuum")
    sim = sand.Simulation(grains, [force], box=tuple(CUBE))
    line = sim.choices["dipoles cut-off"]
    assert line.startswith("600 nm (real part of an Ewald sum over all images: errors ")
    assert " of torque, as accuracy = 0.0001 asks for; vacuum, alpha = " in line
    assert line.endswith("wave vectors and their opposites)")
    kept = {"cutoff": "auto", "cut": "smooth", "periodic": "ewald", "accuracy": 1e-4, "boundary": "vacuum"}
    kept |= {"reciprocal": "auto", "open": "auto"}
    assert force.parameters() == force.resolved(grains, sim.box) == kept
    assert dataclasses.asdict(force) == kept
