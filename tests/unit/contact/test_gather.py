"""Gathering the loads of contacts at their grains, for any order of the grains."""

import copy
import shutil

import numpy as np
import pytest

import sand
from sand.basics.arrays import GATHER_CLASSES, GATHER_ORDER_FROM, empty_contact_arrays
from sand.basics.state import CONTACTS, COUNT, SQUARED_SPEED, SQUARED_SPIN
from sand.compiler.jit import kernel
from sand.contact.gather import DENSE_FROM, GRAINS_AT_ONCE, LARGEST_CLASS, resort_contacts_by_grain
from sand.integrate.motion import kick
from sand.integrate.parts import DT, SCRATCH, ExternalWork
from sand.integrate.stages import drift_stage, gather_and_kick_stage, gather_stage
from sand.integrate.task_queue import GRAINS_PER_BLOCK, new_task_queue

from ...tables import table_of

GRAINS = GATHER_ORDER_FROM + 37
"""Enough for the block-wise order, with an incomplete last block."""


def over_all_grains(stage, grains, dt=0.0, **parts):
    """Call a stage for each block of grains; returns its largest squares of speed and spin."""
    queue, scratch = new_task_queue(grains.mass.size, 0), np.zeros(SCRATCH)
    scratch[DT] = dt
    table = table_of(grains=grains, queue=queue, scratch=scratch, **parts)
    for block in range(len(queue.speeds)):
        stage.run(table, (), block)
    return queue.speeds.max(axis=0)


def gather_all(grains, contacts):
    """Sums of the loads of all contacts at their grains."""
    over_all_grains(gather_stage(True), grains, contacts=contacts)


def random_contacts(per_grain, count=GRAINS):
    """Moving grains and this many contacts per grain between neighbours in memory, with random loads, sorted."""
    rng = np.random.default_rng(5)
    grains = sand.Grains(
        rng.normal(size=(count, 3)),
        1e-7,
        sand.SILICA,
        velocity=rng.normal(size=(count, 3)),
        spin=1e6 * rng.normal(size=(count, 3)),
    ).arrays
    near = rng.integers(0, count, 3 * int(per_grain * count)), rng.integers(1, 40, 3 * int(per_grain * count))
    first, second = near[0], (near[0] + near[1]) % count
    pair = np.unique(np.array([first, second]), axis=1)
    pair = rng.permutation(pair, axis=1)[:, : int(per_grain * count)]
    contacts, counters = empty_contact_arrays(count, pair.shape[1], 15), np.zeros(len(COUNT), np.int64)
    contacts.pair[:, : pair.shape[1]], counters[CONTACTS] = pair, pair.shape[1]
    for loads in (contacts.force, contacts.torque1, contacts.torque2):
        loads[...] = 1e-9 * rng.normal(size=loads.shape)
    resort_contacts_by_grain(grains, contacts, counters)
    return grains, contacts, pair


@pytest.mark.compiled("small")
@pytest.mark.parametrize(("per_grain", "count"), [(1.0, GRAINS), (4.0, GRAINS), (1.0, 500), (0.2, GRAINS), (0.2, 500)])
def test_sums_are_those_of_brute_force(per_grain, count):
    """F = Σ ±f, M = Σ torque of each end; at most about 30 terms of 1e-9, rounded to 1e-16 each: 1e-23."""
    grains, contacts, pair = random_contacts(per_grain, count)
    assert contacts.gather_order.size == (count + GATHER_CLASSES if count >= GATHER_ORDER_FROM else 0)
    used = pair.shape[1]
    force, torque = np.zeros((3, count)), np.zeros((3, count))
    for end, sign, own in ((0, 1.0, contacts.torque1), (1, -1.0, contacts.torque2)):
        np.add.at(force, (slice(None), pair[end]), sign * contacts.force[:, :used])
        np.add.at(torque, (slice(None), pair[end]), own[:, :used])
    grains.force[...] = grains.torque[...] = np.nan
    gather_all(grains, contacts)
    assert np.abs(grains.force - force).max() < 1e-23 and np.abs(grains.torque - torque).max() < 1e-23


@pytest.mark.compiled("small")
def test_each_row_has_its_contacts_in_a_fixed_order():
    """First the contacts whose first grain it is, then the others, each in the order of the contacts."""
    _, contacts, pair = random_contacts(2.0)
    for g in range(0, GRAINS, 97):
        row = contacts.side[contacts.start[g] : contacts.start[g + 1]].tolist()
        expected = [2 * c for c in np.flatnonzero(pair[0] == g)] + [2 * c + 1 for c in np.flatnonzero(pair[1] == g)]
        assert row == expected


@pytest.mark.compiled("small")
def test_grains_of_a_block_are_sorted_by_number_of_contacts():
    """Each block holds its own grains once; equal numbers of contacts are adjacent, by index.

    With many contacts per grain all grains are in index order.
    """
    _, contacts, pair = random_contacts(1.0)
    many = np.minimum([np.bincount(ends, minlength=GRAINS) for ends in pair], LARGEST_CLASS)
    kind = many[0] * (LARGEST_CLASS + 1) + many[1]
    turn = contacts.gather_order[:GRAINS]
    assert len(set(kind.tolist())) > 10
    for first in range(0, GRAINS, GRAINS_AT_ONCE):
        block = np.arange(first, min(first + GRAINS_AT_ONCE, GRAINS))
        assert turn[block].tolist() == sorted(block.tolist(), key=lambda g: (kind[g], g))
    _, crowded, _ = random_contacts(DENSE_FROM + 0.5)
    assert crowded.gather_order[:GRAINS].tolist() == list(range(GRAINS))


@pytest.mark.compiled("small")
def test_combined_gather_and_kick():
    """Equal loads, v + F dt/m, ω + M dt/I and largest squares as in two loops, to rounding: 1e-14."""
    grains, contacts, _ = random_contacts(1.0)
    other = copy.deepcopy(grains)
    gather_all(grains, contacts)
    fastest, quickest = kernel(kick, cached=False)(grains, 1e-9)
    found = over_all_grains(gather_and_kick_stage(True), other, 1e-9, contacts=contacts)
    for name in ("force", "torque", "velocity", "spin"):
        assert np.allclose(getattr(other, name), getattr(grains, name), rtol=1e-14, atol=0.0), name
    assert np.allclose(found, (fastest, quickest), rtol=1e-14)
    assert fastest == pytest.approx((grains.velocity**2).sum(axis=0).max(), rel=1e-14, abs=0.0)
    assert quickest == pytest.approx((grains.spin**2).sum(axis=0).max(), rel=1e-14, abs=0.0)


@pytest.mark.compiled("small")
def test_drift_with_and_without_moments():
    """Positions and orientations do not depend on moments; existing moments rotate with their grains."""
    grains, _, _ = random_contacts(1.0, 300)
    grains.body_moment[...] = np.random.default_rng(1).normal(size=(3, 300))
    with_moments, without = copy.deepcopy(grains), copy.deepcopy(grains)
    span = sand.Box.open().span
    parts = {"span": span, "external_work": ExternalWork(False, False)}
    squares = [
        over_all_grains(drift_stage(magnetic, True), one, 1e-9, **parts)[0]
        for magnetic, one in ((True, with_moments), (False, without))
    ]
    speeds = np.sqrt(squares)
    assert speeds == pytest.approx(np.sqrt((without.velocity**2).sum(axis=0).max()), rel=1e-15, abs=0.0)
    for name in ("position", "velocity", "orientation", "spin"):
        assert np.allclose(getattr(with_moments, name), getattr(without, name), rtol=1e-15, atol=0.0), name
    assert (without.moment == grains.moment).all() and (with_moments.moment != grains.moment).all()


def lattice_with_one_moving_grain(moved=5):
    """A lattice of more grains than one block, in which only one grain and its neighbours move."""
    side = round(GRAINS ** (1 / 3)) + 1
    positions = 1.9995e-7 * np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), -1).reshape(-1, 3)[:GRAINS]
    speed = np.zeros((GRAINS, 3))
    speed[moved] = 0.1
    return sand.Grains(positions * (1.0, 1.0, 1.2), 1e-7, sand.SILICA, velocity=speed)


@pytest.mark.validate
@pytest.mark.parametrize("moved", [5, GRAINS - 5])
def test_largest_speeds_over_all_blocks(moved):
    """The step is limited by the largest squares of speed and spin among all grains."""
    sim = sand.Simulation(lattice_with_one_moving_grain(moved), [sand.Contact()])
    sim.run(steps=3)
    monitor, v, w = sim.state.pair_list.skin, sim.grains.velocity, sim.grains.spin
    assert GRAINS > GRAINS_PER_BLOCK and (v**2).sum(axis=1).argmax() == moved
    assert monitor[SQUARED_SPEED] == pytest.approx((v**2).sum(axis=1).max(), rel=1e-14, abs=0.0)
    assert (
        monitor[SQUARED_SPIN] == pytest.approx((w**2).sum(axis=1).max(), rel=1e-14, abs=0.0)
        and monitor[SQUARED_SPIN] > 0.0
    )


@pytest.mark.validate
def test_a_resumed_run_restores_the_gather_order(tmp_path):
    """Checkpoints omit the order; it is rebuilt, and the run continues with the same bits."""
    sim = sand.Simulation(lattice_with_one_moving_grain(), [sand.Contact()], out=tmp_path / "run")
    sim.run(steps=3)
    rest = sand.resume(shutil.copytree(tmp_path / "run", tmp_path / "copy"))
    assert sorted(rest.state.contacts.gather_order[:GRAINS].tolist()) == list(range(GRAINS))
    assert (rest.state.contacts.gather_order[:GRAINS] == sim.state.contacts.gather_order[:GRAINS]).all()
    sim.run(steps=3)
    rest.run(steps=3)
    assert (rest.grains.position == sim.grains.position).all() and (rest.grains.spin == sim.grains.spin).all()
