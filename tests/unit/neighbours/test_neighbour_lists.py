"""Neighbour lists against all pairs: complete, rebuilt in time, and with the same forces."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import sand
from sand.basics.arrays import empty_long_range_arrays
from sand.basics.box import Box, as_box
from sand.basics.state import LISTED, MADE, PAIRS, REBUILT
from sand.contact.constants_table import column_loops
from sand.contact.jkr import LAW as JKR
from sand.forces.pair.dipole_loops import ALL_PAIRS_CUT
from sand.integrate.force_stages import SUM, WHOLE, pair_force_stages
from sand.integrate.respa import clear_long_range_loads
from sand.neighbours import cell_list as cells
from sand.neighbours.search import Neighbours, share_within

from ...tables import table_of


def listed(position, box, reach):
    """Arrays with the list for positions (N, 3)."""
    far = empty_long_range_arrays(len(position), 8)
    far.anchor[...] = position.T
    while cells.rebuild_verlet_list(far, box.span, reach) == cells.FULL:
        far = far._replace(neighbour=np.zeros(2 * far.neighbour.size, np.uint32))
    return far


def rows(position, box, reach):
    """The list for positions (N, 3) as a matrix: how often each pair occurs in each grain's row."""
    count, far = len(position), listed(position, box, reach)
    found = np.zeros((count, count), int)
    for k in range(count):
        neighbours = far.order[far.neighbour[far.start[k] : far.start[k + 1]]]
        np.add.at(found, (far.order[k], neighbours), 1)
    return found


@pytest.mark.compiled("small")
@settings(deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 250),
    periodic=st.tuples(st.booleans(), st.booleans(), st.booleans()),
    shape=st.tuples(*[st.sampled_from([1e-6, 1e-2, 1.0, 40.0])] * 3),
    reach=st.floats(0.01, 0.9),
)
def test_each_pair_within_reach_is_listed_once(seed, count, periodic, shape, reach):
    """Rows equal all pairs closer than the reach, each once per grain; any box, flat and long clouds."""
    box = Box(tuple(1.0 if p else None for p in periodic))
    scale = [1.0 if p else s for p, s in zip(periodic, shape, strict=True)]
    position = (np.random.default_rng(seed).random((count, 3)) - 0.5) * scale
    apart = box.nearest(position[:, None] - position[None])
    close = (apart**2).sum(axis=-1) < reach**2
    np.fill_diagonal(close, False)
    assert (rows(position, box, reach) == close).all()


@pytest.mark.compiled("small")
@pytest.mark.parametrize("lengths", [(None,) * 3, (1e4,) * 3, (None, 1e4, 1e4)])
@pytest.mark.parametrize("distance", [30.0, 1e3, 1e5])
def test_clumps_far_apart_share_places_of_cells(lengths, distance):
    """All pairs, each once, of 12 clumps of 150 grains, at most 33 of which share a place with a grain, and others.

    A clump has 4 grains per reach³, and a cell of two reaches holds 32 of them.  Others are in its place by chance: N
    grains in at least 0.8·4N places, below one on average; twice that allows for 12 clumps, no even spread.  In cells
    that were made larger until there are 4N, a clump would be in one or two: 75 to 150.
    """
    rng, side = np.random.default_rng(5), (150 / 4.0) ** (1 / 3)
    centres = (rng.random((12, 1, 3)) - 0.5) * [min(distance, length or distance) for length in lengths]
    position = (centres + side * (rng.random((12, 150, 3)) - 0.5)).reshape(-1, 3)
    box = Box(lengths)
    close = (box.nearest(position[:, None] - position[None]) ** 2).sum(axis=-1) < 1.0
    np.fill_diagonal(close, False)
    assert (rows(position, box, 1.0) == close).all()
    together = np.bincount(listed(position, box, 1.0).cell_of)
    assert (together**2).sum() / len(position) < 32.0 + 2.0


@pytest.mark.compiled("small")
def test_grains_on_walls_and_coincident_grains():
    """Coordinates of exactly ±L/2, cell borders, and all grains in one cell of an open box."""
    box = Box.periodic(1.0)
    edge = np.array([-0.5, -1 / 6, 0.0, 1 / 6, 0.5 - 1e-16])
    position = np.stack(np.meshgrid(edge, edge, edge), -1).reshape(-1, 3)
    apart = box.nearest(position[:, None] - position[None])
    close = (apart**2).sum(axis=-1) < 0.3333**2
    np.fill_diagonal(close, False)
    assert (rows(position, box, 0.3333) == close).all()
    assert rows(np.zeros((5, 3)), Box.open(), 1.0).sum() == 20


BOXES = [(None, None, None), (1.0, 1.0, 1.0), (1.0, None, 1.3), (None, 0.7, None), (0.5, 0.5, 4.0), (4.0, 0.5, 0.5)]


@pytest.mark.compiled("small")
@pytest.mark.parametrize("lengths", BOXES)
@pytest.mark.parametrize("reach", [0.02, 0.1, 0.166])
def test_many_grains_in_thin_cells(lengths, reach):
    """Thousands of grains, half of them in clumps, so that cells along x are thin: equal to a KD-tree search."""
    rng = np.random.default_rng(7)
    sides = np.array([length or 1.0 for length in lengths])
    spread, clumps = (rng.random((1500, 3)) - 0.5) * sides, (rng.random((20, 3)) - 0.5) * sides
    box = Box(lengths)
    position = box.wrap(np.concatenate([spread, clumps[rng.integers(20, size=1500)] + rng.normal(0, 0.02, (1500, 3))]))
    theirs = np.zeros((3000, 3000), int)
    i, j = box.close_pairs(position, reach).T
    theirs[i, j] = theirs[j, i] = 1
    assert (rows(position, box, reach) == theirs).all()


@pytest.mark.compiled("small")
@pytest.mark.parametrize("lengths", [(1.0, 1.0, 1.0), (0.5, 0.5, 4.0), (4.0, 0.5, 0.5), (0.3, 1.0, 1.3)])
@pytest.mark.parametrize("share", [0.5, -0.31, 0.04])
def test_lists_in_tilted_boxes(lengths, share):
    """All pairs by nearest images, also where one or two axes are a single cell; coordinates on faces, and clumps."""
    rng = np.random.default_rng(7)
    box, sides = Box(lengths, share * lengths[0]), np.array(lengths)
    spread, clumps = (rng.random((400, 3)) - 0.5) * sides, (rng.random((10, 3)) - 0.5) * sides
    edges = np.stack(np.meshgrid(*[[-0.5, 0.0, 0.5 - 1e-16]] * 3), -1).reshape(-1, 3) * sides * (1.0 - 1e-9)
    position = np.concatenate([spread, clumps[rng.integers(10, size=400)] + rng.normal(0, 0.02, (400, 3)), edges])
    position = box.wrap(position)
    apart = box.nearest(position[:, None] - position[None])
    for reach in (0.05, 0.14):
        close = (apart**2).sum(axis=-1) < reach**2
        np.fill_diagonal(close, False)
        assert (rows(position, box, reach) == close).all() and close.any()


@pytest.mark.compiled("small")
@pytest.mark.parametrize("lengths", [(None, None, None), (1.0, 1.0, 1.0), (1.0, None, 1.0), (0.7, 0.7, 0.7)])
@pytest.mark.parametrize("cells_across", [3, 4, 11])
def test_lists_are_symmetric(lengths, cells_across):
    """Distances that differ from the reach by rounding: the matrix is symmetric, with no pair twice.

    A lattice with the reach as spacing, shifted by irregular offsets: neighbours in x, y and z are ε from the reach on
    either side, also across the walls, where coordinates are shifted by L, and close to borders of cells.
    """
    side = lengths[0] or 1.0
    box, reach = Box(lengths), side / cells_across
    edge = (np.arange(cells_across) + 0.5) / cells_across - 0.5
    doubtful = 0
    for seed in range(10):
        rng = np.random.default_rng(seed)
        lattice = np.stack(np.meshgrid(edge, edge, edge), -1).reshape(-1, 3) + rng.uniform(-0.3, 0.3, 3) / cells_across
        perturbed = side * (lattice + rng.choice([-1e-15, 0.0, 1e-15], lattice.shape))
        found = rows(rng.permutation(perturbed), box, reach)
        assert (found == found.T).all()
        assert found.max() <= 1
        doubtful += found.sum() not in (0, found.size)
    assert doubtful > 5


@pytest.mark.compiled("small")
def test_lists_of_grains_on_faces_of_cells_are_symmetric():
    """Coordinates that rounding to the spacings of a box moves across the face of a cell: both rows have the pair.

    Grains on a lattice with the reach as spacing, in boxes of 3 to 9 reaches whose sides are no short binary numbers.
    """
    for seed in range(200):
        rng = np.random.default_rng(seed)
        reach = rng.uniform(0.1, 0.3)
        cells_across = rng.integers(3, 10, 3)
        lattice = np.stack(np.meshgrid(*map(np.arange, cells_across)), -1).reshape(-1, 3) - cells_across // 2
        found = rows(rng.permutation(lattice * reach), Box(tuple((cells_across * reach).tolist())), reach)
        assert (found == found.T).all() and found.max() <= 1


@pytest.mark.compiled("small")
def test_grains_outside_a_periodic_box():
    """Grains shifted by whole box lengths: the same rows, as no pair is at the reach to rounding."""
    rng = np.random.default_rng(3)
    box, position = Box((1.0, None, 1.0)), rng.random((200, 3)) - 0.5
    shifted = position + rng.integers(-3, 4, (200, 3)) * [1.0, 0.0, 1.0]
    assert (rows(shifted, box, 0.21) == rows(position, box, 0.21)).all()


@pytest.mark.compiled("small")
@pytest.mark.parametrize("lengths", [(None, None, None), (1.0, 1.0, 1.0)])
@pytest.mark.parametrize("odd", [np.nan, np.inf, -np.inf, 1e300])
def test_a_grain_with_invalid_coordinates_has_no_neighbours(lengths, odd):
    """NaN, infinite or huge coordinates cause no error and no entries."""
    position = np.random.default_rng(2).random((90, 3)) - 0.5
    for axis in range(3):
        spoilt = position.copy()
        spoilt[40, axis] = odd
        found = rows(spoilt, Box(lengths), 0.3)
        assert found.max() <= 1
        assert found[40].sum() == found[:, 40].sum() == 0 or np.isfinite(odd)


@pytest.mark.compiled("small")
@pytest.mark.parametrize("lengths", [(1.0, 1.0, 1.0), (1.0, 3.0, 0.6), (0.7, None, 1.0), (None, 1.0, 2.1)])
@pytest.mark.parametrize("reach", [0.34, 0.49, 0.7])
def test_boxes_that_are_not_three_cells_wide(lengths, reach):
    """One or two cells on a periodic side wrap onto themselves: each pair is still listed once."""
    box = Box(lengths)
    position = (np.random.default_rng(8).random((130, 3)) - 0.5) * [1.0 if x is None else x for x in lengths]
    apart = box.nearest(position[:, None] - position[None])
    close = (apart**2).sum(axis=-1) < reach**2
    np.fill_diagonal(close, False)
    assert (rows(position, box, reach) == close).all()


def fast_gas(box, seed, contacts=False, **neighbours):
    """Dipoles in a box of 1 µm, so fast that lists last for a few steps only."""
    rng = np.random.default_rng(seed)
    grains = sand.setup.gas(
        120, "1 um", radius="10 nm", material=sand.SILICA, moment="20 A m^2/kg", temperature="100 K", seed=seed
    )
    grains.arrays.position[...] = as_box(box).wrap(grains.position).T
    grains.arrays.velocity[...] = 30.0 * rng.normal(size=(3, 120))
    grains.arrays.charge[...] = 1e-18 * rng.normal(size=120)
    forces = [sand.Dipoles(cutoff="0.2 um"), *([sand.Contact()] if contacts else [])]
    stepping = sand.Verlet(far="every step")
    return sand.Simulation(grains, forces, box=box, stepping=stepping, neighbours=Neighbours(**neighbours))


def all_pairs_loads(sim):
    """Long-range forces, torques and fields of the same state over all pairs."""
    state = sim.state.copy()
    far, numbers = empty_long_range_arrays(len(state.grains), 0), sim.forces[0].numbers(sim.grains, sim.box)
    clear_long_range_loads(far)
    parts = table_of(grains=state.grains.arrays, long_range=far, span=sim.box.span)
    pair_force_stages(ALL_PAIRS_CUT, False)[SUM].run(parts, numbers, WHOLE)
    return far.force, far.torque, state.grains.arrays.field


@pytest.mark.validate
@pytest.mark.parametrize(
    ("lengths", "margin", "contacts"),
    [
        ((1e-6, 1e-6, 1e-6), "auto", False),
        ((1e-6, None, 1e-6), "5 nm", False),
        ((None, None, None), "20 nm", False),
        ((1e-6, 1e-6, 1e-6), "15 nm", True),
        ((0.5e-6, 0.7e-6, 1e-6), "15 nm", True),
    ],
)
def test_listed_forces_are_those_of_all_pairs(lengths, margin, contacts):
    """F, M and B of the list equal those of all pairs with the same cut-off, to 1e-12 of the largest, in 1000 steps.

    Grains move nanometres per step and cross the walls, so the list is rebuilt many times; a missed pair at 0.9 r_c
    would give an error of 1e-3.  Rounding: sums in another order, ε × neighbours.
    """
    sim = fast_gas(Box(lengths), 3, contacts, search="cells", margin=margin)
    assert "a list of pairs" in sim.choices["neighbours"]
    sim.run(steps=1)
    for step in range(1000):
        sim.run(steps=1)
        ours = (sim.state.long_range.force, sim.state.long_range.torque, sim.grains.arrays.field)
        for found, theirs in zip(ours, all_pairs_loads(sim), strict=True):
            assert np.abs(found - theirs).max() < 1e-12 * np.abs(theirs).max()
        if contacts and step % 20 == 0:
            assert all_overlapping_pairs_have_contacts(sim)
    assert sim.state.count[LISTED] > (15 if margin != "auto" else 5)
    if contacts:
        assert sim.state.count[MADE] > 0
        assert sim.state.count[REBUILT] > 50


def all_overlapping_pairs_have_contacts(sim):
    """True if every two grains closer than the sum of their radii share a contact."""
    position, pairs = sim.grains.position, sim.contacts["pair"]
    apart = sim.box.nearest(position[:, None] - position[None])
    in_contact = np.sqrt((apart**2).sum(-1)) < 2e-8
    np.fill_diagonal(in_contact, False)
    bound = np.zeros_like(in_contact)
    bound[pairs[:, 0], pairs[:, 1]] = bound[pairs[:, 1], pairs[:, 0]] = True
    return (bound | ~in_contact).all()


@pytest.mark.validate
def test_a_listed_run_equals_a_run_over_all_pairs():
    """The same gas with a list, a wide list and all pairs: positions after 300 steps to 1e-9 of a radius."""
    ends = []
    for how in ({"search": "all pairs"}, {"search": "cells"}, {"search": "cells", "margin": "20 nm"}):
        sim = fast_gas("1 um", 5, **how)
        sim.run(steps=300)
        ends.append(sim.grains.position.copy())
    assert np.abs(ends[1] - ends[0]).max() < 1e-9 * 1e-8
    assert np.abs(ends[2] - ends[0]).max() < 1e-9 * 1e-8


SEARCHES = {"cells": Neighbours("cells"), "list": Neighbours("cells", "2 nm"), "all pairs": Neighbours("all pairs")}


@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("search", SEARCHES)
@pytest.mark.parametrize(
    "lengths", [(None, None, None), (0.3e-6, 0.3e-6, 0.3e-6), (0.3e-6, None, 0.09e-6), (0.07e-6, 0.3e-6, 0.3e-6)]
)
def test_near_pairs_are_those_with_a_small_gap(search, lengths):
    """Pairs with a gap below the smallest radius, each once, against brute force: three radii, anywhere in the box."""
    rng, box = np.random.default_rng(6), Box(lengths)
    position = (rng.random((400, 3)) - 0.5) * [0.3e-6 if length is None else length for length in lengths]
    radius = rng.choice([5e-9, 3.5e-9, 1e-8], 400)
    chosen = [0]
    for k in range(1, 400):  # no overlap with an earlier grain
        gap = np.linalg.norm(box.nearest(position[chosen] - position[k]), axis=1) - radius[chosen] - radius[k]
        chosen += [k] if gap.min() > 0.0 else []
    grains = sand.Grains(position[chosen], radius[chosen], sand.SILICA)
    sim = sand.Simulation(grains, [sand.Contact()], box=box, neighbours=SEARCHES[search])
    sim.run(steps=1)
    near, found = sim.state.pair_list, int(sim.state.count[PAIRS])
    apart = np.linalg.norm(box.nearest(grains.position[:, None] - grains.position[None]), axis=2)
    close = apart < grains.radius[:, None] + grains.radius[None] + 3.5e-9
    expected = {(i, j) for i, j in zip(*np.nonzero(close), strict=True) if j < i}
    assert found == len(expected) > 10
    assert {(i, j) for i, j in near.pair[:, :found].T.tolist()} == expected
    assert (sim.state.long_range.neighbour.size > 1000) == (search == "list")


@pytest.mark.compiled("contacts")
def test_neighbour_arrays_grow():
    """With room for 16 neighbours of one grain the overflow is detected and the array grows: the same pairs."""
    grains = sand.setup.lattice(6, radius="10 nm", material=sand.SILICA)
    once, short = (sand.Simulation(grains, [sand.Contact()], neighbours=Neighbours("cells")) for _ in range(2))
    short.state.long_range = short.state.long_range._replace(neighbour=np.zeros(16, np.uint32))
    for sim in (once, short):
        sim.state.pair_list.anchor[:] = np.inf
        sim.run(steps=2)
    assert short.state.long_range.neighbour.size > 16 and once.state.count[PAIRS] > 216
    assert (
        short.state.pair_list.pair[:, : short.state.count[PAIRS]]
        == once.state.pair_list.pair[:, : once.state.count[PAIRS]]
    ).all()


@pytest.mark.filterwarnings("ignore:.* broke while aggregates grew")
@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("search", SEARCHES)
def test_neighbour_search_of_a_resumed_run(tmp_path, search):
    """A collapsing lattice, resumed before its contacts form: the same search, all arrays bit for bit.

    Dozens of contacts form in a step, in the order of the near pairs.
    """
    block = sand.setup.lattice(6, radius="10 nm", material=sand.SILICA)
    k = 1.1 * block.position + 1e-11 * np.random.default_rng(0).normal(size=block.position.shape)
    grains = sand.Grains(k, 1e-8, sand.SILICA, velocity=-2e7 * k)
    whole, begun = (
        sand.Simulation(grains.copy(), [sand.Contact()], neighbours=SEARCHES[search], out=tmp_path / name)
        for name in ("whole", "begun")
    )
    begun.run(steps=20)
    assert begun.state.count[MADE] == 0
    rest = sand.resume(tmp_path / "begun")
    assert rest.choices["neighbours"] == whole.choices["neighbours"]
    whole.run(steps=600)
    rest.run(steps=580)
    assert whole.state.count[MADE] > 200 and whole.state.count[REBUILT] > 2
    one, other = whole.state.to_arrays(), rest.state.to_arrays()
    assert all(np.array_equal(one[name], other[name]) for name in one)


@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("search", SEARCHES)
def test_near_pairs_that_overflow_are_counted(search):
    """A lattice without contacts has room for 16 pairs; its 540 are counted, and the array gets a tenth to spare."""
    block = sand.setup.lattice(6, radius="10 nm", material=sand.SILICA)
    grains = sand.Grains(1.2 * block.position, 1e-8, sand.SILICA)
    sim = sand.Simulation(grains, [sand.Contact()], neighbours=SEARCHES[search])
    assert sim.state.pair_list.pair.shape[1] == 16
    sim.run(steps=1)
    assert sim.state.count[PAIRS] == 3 * 6 * 6 * 5  # a gap of 4 nm along the edges of the cubes, 14 nm across
    assert 540 * 1.1 <= sim.state.pair_list.pair.shape[1] < 540 * 1.12


@pytest.mark.compiled("contacts")
def test_long_rows_are_rebuilt_with_more_room():
    """Thirty grains in a row, in cell order, beside one that makes cells 0.5 µm wide: 29 pairs are near.

    Neither room for 9 neighbours nor for 16 pairs suffices.  Until a list is built, its anchors are scratch space.
    """
    position = np.zeros((31, 3))
    position[:, 0] = 2.5e-8 * np.arange(31)
    position[30, 0] += 4e-7
    radius = np.full(31, 1e-8)
    radius[30] = 2e-7
    sim = sand.Simulation(sand.Grains(position, radius, sand.SILICA), [sand.Contact()], neighbours=Neighbours("cells"))
    state = sim.state
    state.long_range = state.long_range._replace(neighbour=np.zeros(9, np.uint32))
    assert state.pair_list.pair.shape[1] == 16
    sim.run(steps=1)
    state = sim.state
    assert state.long_range.neighbour.size > 29
    assert state.count[REBUILT] == 1 and state.count[PAIRS] == 29
    assert {tuple(sorted(pair)) for pair in state.pair_list.pair[:, :29].T.tolist()} == {(k, k + 1) for k in range(29)}
    assert np.array_equal(state.pair_list.anchor.T, position)


@pytest.mark.compiled("contacts")
def test_near_pairs_have_the_step_of_their_own_contact():
    """Two materials, three radii: step 2π/(ω n) and length δ_c of each pair follow from its constants, to 1e-14."""
    rng = np.random.default_rng(4)
    block = sand.setup.lattice(5, radius="10 nm", material=sand.IRON)
    radius = rng.choice([1e-8, 9e-9, 5e-9], 125)
    mixed = sand.Grains(1.03 * block.position, radius, [sand.IRON if k % 3 else sand.SILICA for k in range(125)])
    sim = sand.Simulation(mixed, [sand.Contact()])
    sim.run(steps=1)
    near, a = sim.state.pair_list, sim.grains.arrays
    pairings = sand.Contact().pairings(mixed.materials)
    pairs = sim.state.count[PAIRS]
    assert pairs > 30
    for p, (i, j) in enumerate(near.pair[:, :pairs].T):
        constants = column_loops(JKR).of_pair(a, pairings, i, j)
        period = 2 * np.pi / np.sqrt(constants.max_squared_frequency)
        assert near.step[p] == pytest.approx(period / sand.Verlet().steps_per_period, rel=1e-14, abs=0.0)
        assert near.break_overlap[p] == pytest.approx(constants.break_overlap, rel=1e-14, abs=0.0)


@pytest.mark.validate
def test_vibration_does_not_rebuild_lists():
    """Rebuilds depend on displacement: 30,000 steps of a vibrating cluster need the first lists only.

    With a margin of 4 nm the path length (Eq. 50) would require a rebuild every 2 nm: the paths are ten times that.
    """
    block = sand.setup.lattice(3, radius="10 nm", material=sand.IRON)
    breathing = 6e7 * (block.position - block.position.mean(axis=0))
    grains = sand.Grains(block.position, 1e-8, sand.IRON, velocity=breathing, moment="20 A m^2/kg")
    sim = sand.Simulation(
        grains, [sand.Contact(), sand.Dipoles(cutoff="100 nm")], neighbours=Neighbours("cells", "4 nm")
    )
    way = 0.0
    for _ in range(300):
        before = sim.time
        sim.run(steps=100)
        way += (sim.time - before) * np.linalg.norm(sim.grains.velocity, axis=1).mean()
    assert way > 10 * 2e-9
    assert sim.state.count[LISTED] <= 3


@pytest.mark.filterwarnings("ignore:dipoles. the cut-off, .* ends an interaction")
@pytest.mark.parametrize(
    ("count", "box", "how", "expected"),
    [
        (120, "1 um", {}, "cells and a list of pairs closer than 220 nm (cut-off 200 nm, margin 20 nm)"),
        (120, "0.45 um", {}, "all pairs, faster than a list here: 49% of the grains are within 220 nm of a grain"),
        (120, "0.45 um", {"search": "cells"}, "cells and a list of pairs closer than 220 nm"),
        (20, "1 um", {}, "all pairs: fewer than 64 grains"),
        (120, "1 um", {"search": "all pairs"}, "all pairs, as requested"),
    ],
)
def test_the_log_states_the_search(count, box, how, expected):
    """The log gives the choice and its reason."""
    grains = sand.setup.gas(count, box, radius="10 nm", material=sand.IRON, moment="1e-18 A m^2", seed=1)
    sim = sand.Simulation(grains, [sand.Dipoles(cutoff="0.2 um")], box=box, neighbours=Neighbours(**how))
    assert expected in sim.choices["neighbours"]


@pytest.mark.parametrize("box", ["3 um", (1e-6, None, None), None])
def test_an_aggregate_within_reach_of_itself_has_no_list(box):
    """However large the box: each pair would be in two rows of a list that omits none."""
    block = sand.setup.lattice(5, radius="10 nm", material=sand.IRON)
    grains = sand.Grains(block.position, 1e-8, sand.IRON, moment="20 A m^2/kg")
    box = None if box is None else sand.Box(box) if isinstance(box, tuple) else box
    sim = sand.Simulation(grains, [sand.Dipoles(cutoff="0.3 um")], box=box)
    assert (
        sim.choices["neighbours"]
        == "all pairs, faster than a list here: 100% of the grains are within 330 nm of a grain"
    )


def test_margin_without_long_range_forces():
    """Without a cut-off pairs are near up to r1 + r2 + r_min; a given margin makes a list of that reach."""
    for margin, expected in (
        ("auto", "cells, for pairs closer than 30 nm"),
        ("3 nm", "closer than 33 nm (contacts 30 nm,"),
    ):
        grains = sand.setup.gas(120, "1 um", radius="10 nm", material=sand.IRON, seed=1)
        sim = sand.Simulation(grains, [sand.Contact()], box="1 um", neighbours=Neighbours(margin=margin))
        assert expected in sim.choices["neighbours"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("count", "lengths"),
    [
        *((n, sides) for n in (2, 64) for sides in ((1.0, 1.0, 1.0), (1.0, None, None), (None, None, None))),
        (5000, (1.0, None, None)),
        *(pytest.param(5000, sides, marks=pytest.mark.validate) for sides in ((1.0, 1.0, 1.0), (None, None, None))),
    ],
)
def test_fraction_of_pairs_within_reach(lengths, count):
    """Pairs within reach over N(N − 1)/2: exact up to 64 grains; for 5000, 64 grains are sampled with 4096 others.

    The fraction s of one grain varies by less than s, the mean of 64 by s/8: tolerance five of these.
    """
    box = Box(lengths)
    position = np.random.default_rng(9).random((count, 3)) - 0.5
    share = 2.0 * len(box.close_pairs(position, 0.4)) / (count * (count - 1))
    within = 0.0 if count <= 64 else 5.0 / 8.0 * share
    assert share_within(position, box, 0.4) == pytest.approx(share, abs=within + 1e-14)


@pytest.mark.validate
@pytest.mark.parametrize("earlier", [Neighbours("all pairs"), Neighbours("cells", "150 nm")])
@pytest.mark.parametrize("far", ["impulse", "taylor"])
def test_states_of_earlier_versions_continue(earlier, far):
    """Saved without a list or with a wide one: loads, energies and the continuation equal those of all pairs.

    Sums in another order: 1e-12 of the largest.
    """
    box = "0.6 um"
    grains = sand.setup.gas(
        120, box, radius="10 nm", material=sand.IRON, moment="20 A m^2/kg", temperature="1e6 K", seed=2
    )
    grains.arrays.charge[...] = 1e-18 * np.random.default_rng(3).normal(size=120)
    forces = [sand.Contact(), sand.Dipoles(cutoff="0.18 um"), sand.Charges(cutoff="0.18 um")]
    options = {"box": box, "stepping": sand.Verlet(far=far)}
    begun = sand.Simulation(grains, forces, neighbours=earlier, **options)
    while begun.time < 0.3e-9:
        begun.run(steps=10)  # ends with a regular step, the state of checkpoints
    shifted = begun.box.nearest(begun.grains.position - grains.position)
    assert np.sqrt((shifted**2).sum(axis=1)).max() > 1e-8
    saved = begun.state.to_arrays(), {"temperature": 1e6, "wall_seconds": 0.0}
    goes_on = sand.Simulation(grains, forces, neighbours=Neighbours("cells", "2 nm"), restart=saved, **options)
    there, here = begun.loads(), goes_on.loads()
    for name, energy in there["energy"].items():
        assert here["energy"][name] == pytest.approx(energy, rel=1e-12, abs=0.0)
    begun.run(steps=40)
    goes_on.run(steps=40)
    for name in ("velocity", "spin", "force"):
        ours, theirs = (getattr(sim.grains.arrays, name) for sim in (goes_on, begun))
        assert np.abs(ours - theirs).max() < 1e-12 * np.abs(theirs).max(), name
