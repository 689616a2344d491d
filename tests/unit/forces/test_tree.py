"""Tree sum of dipoles: each operator against direct sums, loads against all pairs, momenta, blocks, input."""

import dataclasses

import numpy as np
import pytest

import sand
from sand.basics.constants import MAGNETIC
from sand.basics.errors import BadInput
from sand.forces.pair import tree, tree_cells, tree_loops
from sand.forces.pair.dipole_formulas import pair_load
from sand.forces.pair.multipoles import (
    LANES,
    add_derivatives,
    add_expansions,
    add_moments,
    add_shifted_expansion,
    add_shifted_moments,
    complete,
    fold,
    indices,
    set_derivatives,
    set_harmonics,
    tables,
)

MOMENT = 6.6e-18
RADIUS = 1e-8
SPACING = 1.2e-6 / 100 ** (1 / 3)


def lanes(vectors):
    """Vectors (N ≤ LANES, 3) as x, y, z (LANES,), filled up with the last."""
    filled = np.concatenate([vectors, np.repeat(vectors[-1:], LANES - len(vectors), axis=0)])
    return np.ascontiguousarray(filled.T)


def harmonics(found, vectors):
    """h_n (p², LANES) at vectors."""
    out = np.zeros((found.inside.size, LANES))
    set_harmonics(found, out, np.zeros(LANES), len(out), *lanes(vectors))
    return out


def size(found):
    """Number of derivatives, of moments and local expansions with those of k = 2."""
    return found.lower.shape[1] + found.twice.shape[1]


def moments_of(found, offset, moment):
    """Multipole moments (E,) of up to LANES dipoles at `offset` from the centre."""
    total, values = np.zeros((size(found), LANES)), np.zeros((3, LANES))
    values[:, : len(moment)] = moment.T
    add_moments(found, harmonics(found, -offset), values, total)
    out = total.sum(axis=1)
    fold(found, out)
    return out


def expansion_of(found, moment, apart):
    """Local expansion (E,) of moments whose centre is at −`apart`."""
    derivative, local = np.zeros((2, size(found), LANES))
    set_derivatives(found, derivative, np.zeros(LANES), *lanes(apart[None]))
    add_expansions(found, derivative, np.repeat(moment[:, None], LANES, axis=1), local)
    out = local[:, 0].copy()
    complete(found, out)
    return out


def loads_of(found, local, offset, moment):
    """Forces and flux densities over k of dipoles at `offset` from the centre of a local expansion."""
    derivative = np.zeros((9, LANES))
    add_derivatives(found, harmonics(found, offset), local, derivative)
    _, x, y, z, xx, xy, yy, xz, yz = derivative[:, : len(offset)]
    second = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, -xx - yy]])
    return -np.einsum("abi,ib->ia", second, moment), -np.stack([x, y, z], axis=1)


def direct(position, moment, sources, source_moment):
    """Forces and flux densities over k at dipoles by sources, from the formula of a pair."""
    force, field = np.zeros((2, *position.shape))
    for i, j in np.ndindex(len(position), len(sources)):
        f, b, _, _ = pair_load(position[i] - sources[j], moment[i], source_moment[j], 1.0)
        force[i] += f
        field[i] += b
    return force, field


def relative(found, expected):
    """Rms error of vectors relative to their rms."""
    return np.sqrt(((found - expected) ** 2).sum() / (expected**2).sum())


def test_derivatives_are_those_of_the_inverse_distance():
    """D_n for p = 5: central differences of D_{n−e} at R ± h e give D_n to h² D'' ~ 1e-9; D_0 = 1/R; ∇²(1/R) = 0."""
    found, at, h = tables(5), np.array([0.7, -1.1, 0.9]), 1e-5
    every = indices(5) + [(n - 2 - j, j, 2) for n in range(2, 6) for j in range(n - 1)]

    def derivatives(vector):
        out = np.zeros((size(found), LANES))
        set_derivatives(found, out, np.zeros(LANES), *lanes(vector[None]))
        return dict(zip(every, out[:, 0], strict=True))

    here = derivatives(at)
    assert here[0, 0, 0] == pytest.approx(1 / np.linalg.norm(at), rel=1e-14, abs=0.0)
    for n, value in here.items():
        for axis in range(3):
            lower = tuple(q - (a == axis) for a, q in enumerate(n))
            if min(lower) >= 0 and lower in here:
                step = h * np.eye(3)[axis]
                slope = (derivatives(at + step)[lower] - derivatives(at - step)[lower]) / (2 * h)
                assert value == pytest.approx(slope, abs=1e-7 * max(abs(v) for v in here.values()))


def test_harmonic_polynomials_expand_the_inverse_distance():
    """1/|R + a| = Σ_n h_n(a) D_n(R) for |a|/R = 0.1: terms up to degree 8 leave 0.1⁹/0.9."""
    found, at = tables(9), np.array([0.7, -1.1, 0.9])
    a = 0.1 * np.linalg.norm(at) * np.array([[0.6, -0.48, 0.64]])
    derivative = np.zeros((size(found), LANES))
    set_derivatives(found, derivative, np.zeros(LANES), *lanes(at[None]))
    series = (harmonics(found, a)[:, 0] * derivative[: found.inside.size, 0]).sum()
    exact = 1 / np.linalg.norm(at + a)
    assert series == pytest.approx(exact, rel=2e-9, abs=0.0)
    assert series != pytest.approx(exact, rel=1e-14, abs=0.0)


@pytest.mark.parametrize("degree", [6, 10, 14])
def test_each_operator_against_a_direct_sum(degree):
    """Loads of 5 dipoles on 4 at distance R, |a|, |b| ≤ 0.1 R, by moments, their shift, expansion and its shift.

    All terms up to the total degree p of s/R, s ≤ 0.2 R (0.3 R with shifted centres), are exact: the force errs by
    about p³ 0.2^(p−2)/√90.  Shifted moments and expansions are as exact as those about the new centre: they are the
    same truncated series.
    """
    rng = np.random.default_rng(2)
    found, apart = tables(degree), np.array([0.6, -0.48, 0.64])
    offset, at = (
        0.1 * v / np.linalg.norm(v, axis=1)[:, None] for v in (rng.normal(size=(5, 3)), rng.normal(size=(4, 3)))
    )
    sources, moment = rng.normal(size=(5, 3)), rng.normal(size=(4, 3))
    exact = direct(apart + at, moment, offset, sources)
    few = found.inside.size
    given = moments_of(found, offset, sources)
    local = expansion_of(found, given, apart)
    bound = degree**3 * 0.2 ** (degree - 2)
    for ours, theirs in zip(loads_of(found, local, at, moment), exact, strict=True):
        assert relative(ours, theirs) < bound
    # moments about a centre at `shift`
    shift = np.array([0.03, -0.02, 0.04])
    moved = np.zeros(size(found))
    add_shifted_moments(found, harmonics(found, shift[None]), given[:few], moved)
    fold(found, moved)
    assert moved[:few] == pytest.approx(moments_of(found, offset - shift, sources)[:few], abs=1e-14)
    # the local expansion about a centre at `shift`: the same polynomial
    other = np.zeros(size(found))
    add_shifted_expansion(found, harmonics(found, shift[None]), local, other)
    complete(found, other)
    for ours, theirs in zip(
        loads_of(found, other, at - shift, moment), loads_of(found, local, at, moment), strict=True
    ):
        assert ours == pytest.approx(theirs, abs=1e-10 * np.abs(theirs).max())
    # loads on the sources by the others are opposite and equal to those of the sources on them
    back = expansion_of(found, moments_of(found, at, moment), -apart)
    total = loads_of(found, local, at, moment)[0].sum(axis=0) + loads_of(found, back, offset, sources)[0].sum(axis=0)
    assert np.abs(total).max() < 1e-13 * np.abs(exact[0]).sum()


def gas(count, rng):
    """Grains on jittered sites of the density of the first run, moments in random directions."""
    sites = int(np.ceil(count ** (1 / 3) - 1e-9))
    grid = np.stack(np.meshgrid(*[np.arange(sites)] * 3, indexing="ij"), -1).reshape(-1, 3)
    position = SPACING * (rng.permutation(grid)[:count] + 0.9 * rng.random((count, 3)))
    return position, MOMENT * rng.normal(size=(count, 3))


def fractal(count, rng):
    """Grains of a random aggregate of fractal dimension 2 (a random walk of touching grains that avoids itself)."""
    steps = rng.normal(size=(20 * count, 3))
    walk = 2.0 * RADIUS * np.cumsum(steps / np.linalg.norm(steps, axis=1)[:, None], axis=0)
    _, first = np.unique(np.floor(walk / (2.2 * RADIUS)), axis=0, return_index=True)
    position = (np.floor(walk[np.sort(first)[:count]] / (2.2 * RADIUS)) + 0.5) * 2.2 * RADIUS
    return position, MOMENT * rng.normal(size=(len(position), 3))


def two_clusters(count, rng):
    """Two gases a hundred diameters apart, of unequal size; moments along z, of very different size."""
    position, moment = gas(count, rng)
    position[: count // 4, 0] += 100.0 * SPACING * count ** (1 / 3)
    size = 10.0 ** rng.uniform(-1, 1, size=(count, 1))
    return position, MOMENT * size * (np.array([[0.0, 0.0, 1.0]]) + 0.1 * moment / MOMENT)


def loads(position, moment, **options):
    """Force, flux density, torque (N, 3) and energy of an open box."""
    sim = sand.Simulation(sand.Grains(position, RADIUS, sand.IRON, moment=moment), [sand.Dipoles(**options)])
    found = sim.loads()
    return found["force"], found["field"], found["torque"], found["energy"]["magnetic"]


@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize("system", [gas, fractal, two_clusters])
def test_loads_against_all_pairs(system):
    """Rms errors of F and M are below the accuracy, relative to the rms loads; P and L are conserved to rounding.

    The accuracy is that of the loads of grains farther than their mean distance; loads of all grains are larger.  The
    energy −½ Σ μ·B errs by at most ½ |μ| |δB|, with the norms of all moments and of all errors of B.
    """
    position, moment = system(3000, np.random.default_rng(4))
    exact = loads(position, moment, open="pairs")
    errors = []
    for accuracy in (1e-2, 1e-3, 1e-4, 1e-5):
        force, field, torque, energy = loads(position, moment, open="tree", accuracy=accuracy)
        errors.append(relative(force, exact[0]))
        assert relative(force, exact[0]) < accuracy and relative(torque, exact[2]) < accuracy
        assert relative(field, exact[1]) < accuracy
        most = 0.5 * np.linalg.norm(moment) * np.linalg.norm(exact[1])
        assert energy == pytest.approx(exact[3], abs=accuracy * most)
        assert np.abs(force.sum(axis=0)).max() < 1e-13 * np.abs(force).sum()
        twist = np.cross(position, force) + torque
        scale = np.abs(np.cross(position - position.mean(axis=0), force)).sum() + np.abs(torque).sum()
        assert np.abs(twist.sum(axis=0)).max() < 1e-11 * scale
    assert errors[0] > 1e-7  # expansions are used
    assert errors[3] < 0.1 * errors[0]


@pytest.mark.compiled("dipoles")
def test_predicted_errors_of_a_gas():
    """Rms errors of 8000 dipoles at random, relative to √6 kμ²/a⁴ and √2 kμ/a³: below the prediction, by less than 4.

    The prediction contains the factor SAFETY = 2.
    """
    position, moment = gas(8000, np.random.default_rng(5))
    exact = loads(position, moment, open="pairs")
    mean, a = (moment**2).sum(axis=1).mean(), SPACING * (3 / (4 * np.pi)) ** (1 / 3)
    for accuracy in (1e-2, 1e-4):
        chosen = tree.choose_tree(8000, accuracy)
        force, field, _, _ = loads(position, moment, open="tree", accuracy=accuracy)
        of_force = np.sqrt(((force - exact[0]) ** 2).sum(axis=1).mean()) / (np.sqrt(6) * MAGNETIC * mean / a**4)
        of_field = np.sqrt(((field - exact[1]) ** 2).sum(axis=1).mean()) / (np.sqrt(2) * MAGNETIC * mean**0.5 / a**3)
        assert chosen.force_error / 4 < of_force < chosen.force_error
        assert chosen.torque_error / 4 < of_field < chosen.torque_error


@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize("count", [1, 2, 50])
def test_few_grains(count):
    """One leaf, or two: all pairs, to rounding; and two grains at the distance of 1e-6 radii."""
    rng = np.random.default_rng(6)
    position, moment = rng.normal(size=(count, 3)), MOMENT * rng.normal(size=(count, 3))
    position[-1] = position[0] + 1e-6 * (count > 1)
    moment[0] = MOMENT * np.array([1.0, 0.0, 0.0])
    for ours, theirs in zip(loads(position, moment, open="tree"), loads(position, moment, open="pairs"), strict=True):
        assert ours == pytest.approx(theirs, rel=1e-6, abs=1e-9 * np.abs(theirs).max())


@pytest.mark.compiled("dipoles")
def test_clumps_lines_and_grains_without_moments():
    """Clumps of grains much closer than all others, all on a line, half of them without a moment: as all pairs."""
    rng = np.random.default_rng(7)
    position = np.zeros((2000, 3))
    position[:, 0] = np.repeat(rng.normal(size=20), 100) + 1e-6 * np.tile(np.arange(100), 20)
    moment = MOMENT * rng.normal(size=(2000, 3)) * (np.arange(2000) % 2)[:, None]
    exact = loads(position, moment, open="pairs")
    force, field, torque, _ = loads(position, moment, open="tree", accuracy=1e-4)
    assert relative(force, exact[0]) < 1e-4 and relative(torque, exact[2]) < 1e-4 and relative(field, exact[1]) < 1e-4


def test_cells_divide_all_grains_and_interactions_are_symmetric():
    """Every grain is in one leaf of at most LEAF grains, and inside the sphere of each of its cells.

    Acceptance of (A, B) is that of (B, A).  In plain Python.
    """
    grains = sand.Grains(*_unequal(1200))
    parameters = tree.tree_parameters(1200, 3, 0.9)
    cells, arrays = parameters.cells, grains.arrays
    position = np.zeros((3, 1200))
    tree_cells.build_cells(arrays, cells, position)
    levels = tree.levels_for(1200)
    assert levels == 5 == tree_cells.levels_below(arrays)
    assert sorted(cells.order) == list(range(1200))
    assert (position == arrays.position[:, cells.order]).all()
    for level in range(levels + 1):
        edges = [tree_cells.first_grain(1200, c, level) for c in range(2**level - 1, 2 ** (level + 1))]
        assert edges[0] == 0 and edges[-1] == 1200 and max(np.diff(edges)) <= tree_cells.LEAF * 2 ** (levels - level)
        for cell, first, last in zip(range(2**level - 1, 2 ** (level + 1)), edges[:-1], edges[1:], strict=False):
            apart = np.linalg.norm(position[:, first:last].T - cells.centre[:, cell], axis=1)
            assert (apart <= cells.size[0, cell] * (1 + 1e-14)).all()
            reach = cells.size[0, cell] + 1.01 * grains.radius[cells.order[first:last]].max()
            assert cells.size[1, cell] == pytest.approx(reach, rel=1e-14, abs=0.0)
    every = range(2 ** (levels + 1) - 1)
    accepted = np.array([[tree_loops.far_enough(cells, 0.9, a, b) for b in every] for a in every])
    assert (accepted == accepted.T).all() and 0 < accepted.sum() < accepted.size


def _unequal(count):
    """Positions, radii and material of grains of unequal radii."""
    rng = np.random.default_rng(8)
    return 1e-5 * rng.random((count, 3)), 1e-8 * rng.uniform(0.5, 2, count), sand.IRON


@pytest.mark.compiled("dipoles")
def test_pairs_in_contact_are_summed_directly():
    """The sum less the bare pairs in contact, the slow force of r-RESPA, errs by the accuracy of the slow force.

    A long chain of touching grains: half of the force on each is that of its two neighbours.
    """
    count = 3000
    position = np.zeros((count, 3))
    position[:, 0] = 2.0 * RADIUS * np.arange(count)
    moment = MOMENT * np.random.default_rng(9).normal(size=(count, 3))
    exact, found = (
        loads(position, moment, **how)[0] for how in ({"open": "pairs"}, {"open": "tree", "accuracy": 1e-3})
    )
    bare = np.zeros((count, 3))
    for i in range(count - 1):
        f = np.array(pair_load(position[i] - position[i + 1], moment[i], moment[i + 1], MAGNETIC)[0])
        bare[i] += f
        bare[i + 1] -= f
    assert relative(found - bare, exact - bare) < 1e-3


@pytest.mark.compiled("dipoles")
def test_same_bits_with_two_threads_and_after_resuming():
    """A run of 3000 grains with one thread, with two, and in two pieces: the same bits."""
    position, moment = gas(3000, np.random.default_rng(10))

    def run(threads, *steps):
        grains = sand.Grains(position, RADIUS, sand.IRON, moment=moment)
        sim = sand.Simulation(grains, [sand.Dipoles(open="tree")], stepping=sand.Verlet(step="1 ps"))
        sand.set_threads(threads)
        try:
            for number in steps:
                sim.run(steps=number)
        finally:
            sand.set_threads(None)
        return sim.grains.position, sim.grains.spin

    expected = run(1, 6)
    for other in (run(2, 6), run(1, 2, 4)):
        assert all((a == b).all() for a, b in zip(expected, other, strict=True))


@pytest.mark.compiled("dipoles")
def test_a_run_resumed_from_a_checkpoint_has_the_same_bits(tmp_path):
    """12 grains in contact and 700 free ones, with cycles: a run in two parts, from a checkpoint, has the same bits."""
    position, moment = gas(712, np.random.default_rng(11))
    position[:12] = np.arange(12)[:, None] * [0.0, 0.0, 1.99 * RADIUS] - [1e-6, 0.0, 0.0]

    def new(**options):
        grains = sand.Grains(position, RADIUS, sand.IRON, moment=moment)
        return sand.Simulation(grains, [sand.Contact(), sand.Dipoles(open="tree")], **options)

    whole, parts = new(), new(out=tmp_path / "run")
    whole.run(steps=48)
    parts.run(steps=24)
    resumed = sand.resume(tmp_path / "run")
    assert resumed.forces[1].open == "tree"
    resumed.run(steps=24)
    expected, found = (each.state.to_arrays() for each in (whole, resumed))
    assert all(expected[name].tobytes() == found[name].tobytes() for name in expected)


@pytest.mark.compiled("dipoles")
def test_the_energy_of_free_grains_changes_by_the_error_of_the_loads():
    """600 grains at 100 K for 1 ns: |ΔE| falls with the accuracy ε, and is below ε times the change of U.

    The errors of the loads do work like the loads themselves, but with random signs, so that the change of E is below ε
    times that of U = −½ Σ μ·B.  With all pairs the steps of 10 ps change E by 5e-8 of it.
    """
    position, moment = gas(600, np.random.default_rng(12))
    speed = np.sqrt(1.380649e-23 * 100 / sand.Grains(position[:1], RADIUS, sand.IRON).mass[0])
    velocity = speed * np.random.default_rng(13).normal(size=position.shape)
    drifts = []
    for accuracy in (1e-2, 1e-3):
        grains = sand.Grains(position, RADIUS, sand.IRON, velocity=velocity, moment=moment)
        dipoles = sand.Dipoles(open="tree", accuracy=accuracy)
        sim = sand.Simulation(grains, [dipoles], stepping=sand.Verlet(step="10 ps"), frame_every="0.1 ns")
        sim.run(until="1 ns")
        total, magnetic = sim.ledger["total"], sim.ledger["magnetic"]
        drifts.append(np.abs(total - total[0]).max() / np.abs(magnetic - magnetic[0]).max())
        assert drifts[-1] < accuracy
    assert 1e-6 < drifts[1] < 0.5 * drifts[0]  # expansions are used


def test_choice_and_wrong_input():
    """ "auto" uses a tree from 5000 grains on; contradictions are refused in one line."""
    few, many = (sand.Grains(*_unequal(n)) for n in (4999, 5000))
    box = sand.Box.open()
    force = sand.Dipoles()
    assert not force.uses_tree(few, box) and force.uses_tree(many, box)
    assert not sand.Dipoles(open="pairs").uses_tree(many, box) and not sand.Dipoles("1 um").uses_tree(many, box)
    assert (
        "tree of multipoles" in force.choose(many, box).reason
        and force.choose(few, box).reason == "open box: all pairs"
    )
    assert force.sums(box, False, many) is tree_loops.TREE
    assert dataclasses.replace(force, cutoff=None).uses_tree(many, box)  # as resolved for a resumed run
    grains = sand.Grains([[0, 0, 0], [1, 0, 0]], RADIUS, sand.IRON, moment=[0, 0, MOMENT])
    with pytest.raises(
        BadInput, match="far = 'taylor' needs the rate of change of every pair force, which dipoles lacks"
    ):
        sand.Simulation(grains, [sand.Contact(), sand.Dipoles(open="tree")], stepping=sand.Verlet(far="taylor"))
