"""Skins of pair lists and the inner list, against checks of every grain in every step."""

import numpy as np
import pytest

import sand
from sand.basics.state import (
    BROKEN,
    INNER_SKIN,
    LONG_RANGE_SKIN,
    MADE,
    PAIR_LIST_SKIN,
    REBUILT,
    SQUARED_SPEED,
    SQUARED_SPIN,
)
from sand.engine import compiled_state
from sand.integrate import task_queue
from sand.integrate.stages import INNER_SKIN_FRACTION
from sand.neighbours.skin import largest_displacement, largest_squared_speeds

from ...plugins import ForestRuth


def dense_gas(forces=None, margin="auto", **options):
    """Sixty grains in a periodic box, with cells or a list, so fast that lists are rebuilt every few dozen steps."""
    box = sand.Box.periodic("0.16 um")
    moment = "100 A m^2/kg"
    grains = sand.setup.gas(60, box, radius=1e-8, material=sand.SILICA, temperature="3e4 K", seed=5, moment=moment)
    forces = forces or [sand.Contact()]
    return sand.Simulation(grains, forces, box=box, neighbours=sand.Neighbours("cells", margin), seed=6, **options)


CASES = {
    "contacts": {},
    "contacts, listed": {"margin": "5 nm"},
    "cycles and gas": {"forces": (sand.Contact(), sand.Dipoles(), sand.Gas("3e4 K", pressure="1 bar"))},
    "steps of fourth order": {"stepping": ForestRuth()},
}


@pytest.mark.validate
@pytest.mark.parametrize("way", CASES)
def test_rebuilds_do_not_depend_on_driver_calls(way):
    """Every call of the driver checks all grains: 600 calls of one step and one call of 600 give the same bits.

    Contacts form and break, and r-RESPA cycles, gas kicks or steps of another integrator are active.
    """
    once, often = dense_gas(**CASES[way]), dense_gas(**CASES[way])
    once.run(steps=600)
    often.run(steps=1)
    while often.state.steps < once.state.steps:
        often.run(steps=1)
    assert once.state.count[MADE] > 0
    assert once.state.count[REBUILT] > 3
    a, b = once.state.to_arrays(), often.state.to_arrays()
    assert all(np.array_equal(a[name], b[name]) for name in a)


@pytest.mark.validate
@pytest.mark.parametrize("blocks", [False, True])
def test_displacements_stay_within_the_skin(monkeypatch, blocks):
    """Remaining skin + the largest displacement ≤ the limit of each list after any number of steps; speeds are exact.

    Also with loops in blocks for threads.
    """
    for module in (task_queue, compiled_state):
        monkeypatch.setattr(module, "uses_task_queue", lambda grains: blocks)
    sim = dense_gas(margin="5 nm")
    limits = {
        LONG_RANGE_SKIN: ("long_range", "anchor", 0.5 * 5e-9),
        PAIR_LIST_SKIN: ("pair_list", "anchor", 0.25 * sim.grains.radius.min()),
    }
    sim.run(steps=1)
    spared = 0
    for steps in (1, 2, 3, 5, 8, 13, 21, 34, 55):
        sim.run(steps=steps)
        system, span = sim.state, sim.box.span
        for index, (group, name, limit) in limits.items():
            listed = getattr(system, group)
            displacement = largest_displacement(system.grains.arrays, getattr(listed, name), listed.built, span)
            assert system.pair_list.skin[index] <= limit - displacement + 1e-12 * limit
            spared += system.pair_list.skin[index] > 0.0
        speeds = np.linalg.norm(sim.grains.velocity, axis=1).max(), np.linalg.norm(sim.grains.spin, axis=1).max()
        assert np.sqrt(system.pair_list.skin[[SQUARED_SPEED, SQUARED_SPIN]]) == pytest.approx(
            speeds, rel=1e-14, abs=0.0
        )
        assert np.sqrt(largest_squared_speeds(system.grains.arrays)) == pytest.approx(speeds, rel=1e-14, abs=0.0)
    assert spared > 10


@pytest.mark.validate
def test_inner_list_is_rebuilt_in_time():
    """Remaining skin + the largest displacement since the build ≤ the inner skin, in the first step of a call.

    A contact that forms or breaks consumes the skin: 2000 steps are 2000 calls of one step, which rebuild in each.
    """
    sim, twin = dense_gas(), dense_gas()
    limit, span = INNER_SKIN_FRACTION * sim.grains.radius.min(), sim.box.span
    for each in (sim, twin):
        each.run(steps=1)
    finished_run = 0
    for steps in (2, 3, 4, 5, 6) * 5:
        twin.run(steps=1)
        built = twin.state.grains.arrays.position.copy()
        twin.run(steps=steps - 1)
        events = sim.state.count[[MADE, BROKEN, REBUILT]]
        sim.run(steps=steps)
        if np.array_equal(
            sim.state.count[[MADE, BROKEN, REBUILT]], events
        ):  # otherwise the inner list is rebuilt again
            displacement = largest_displacement(sim.state.grains.arrays, built, np.zeros(3), span)
            assert 0.0 < displacement < limit
            assert 0.0 < sim.state.pair_list.skin[INNER_SKIN] <= limit - displacement
            finished_run += 1
    assert finished_run > 10
    sim.run(steps=2000)
    while twin.state.steps < sim.state.steps:
        twin.run(steps=1)
    assert sim.state.count[MADE] > 10 and sim.state.count[BROKEN] > 3
    a, b = sim.state.to_arrays(), twin.state.to_arrays()
    assert all(np.array_equal(a[name], b[name]) for name in a)


@pytest.mark.validate
def test_a_pair_that_separates_and_meets_again_is_found():
    """Charges pull two grains together again just after their contact broke: one driver call, and one per step.

    The pair was in contact when the inner list was built, and meets again before the list is outdated.
    """
    seen, every_step = 0, sand.Verlet(far="every step")
    for speed in np.linspace(5.25, 8.25, 13):
        ends = []
        for calls in ("one", "many"):
            index = np.array([[-9.9999e-9, 0.0, 0.0], [9.9999e-9, 0.0, 0.0]])
            velocity = 0.5 * speed * np.sign(index)
            grains = sand.Grains(index, 1e-8, sand.SILICA, velocity=velocity, charge=[6e-18, -6e-18])
            sim = sand.Simulation(grains, [sand.Contact(), sand.Charges()], stepping=every_step)
            sim.run(steps=1)
            while sim.state.steps < 400:
                sim.run(steps=399 if calls == "one" else 1)
            ends.append(sim.state.to_arrays())
        seen += bool(sim.state.count[BROKEN] > 0 and sim.state.count[MADE] > 0)
        assert all(np.array_equal(ends[0][name], ends[1][name]) for name in ends[0])
    assert seen > 3


@pytest.mark.filterwarnings("ignore:grains spin too fast for a solid")
@pytest.mark.compiled("contacts")
@pytest.mark.parametrize(
    ("speed", "outcome", "culprit"), [(1e6, sand.Outcome.TOO_FAST, 2), (0.0, sand.Outcome.SPINS_TOO_FAST, 0)]
)
def test_an_outcome_names_the_limiting_grain(speed, outcome, culprit):
    """Grain 0 spins too fast for the user's step; grain 2 flies too fast or rests."""
    position, at_rest = np.diag([0.0, 1e-7, 2e-7]), np.zeros((3, 3))
    velocity, spin = at_rest.copy(), at_rest.copy()
    velocity[2, 0], spin[0, 0] = speed, 1e13
    grains = sand.Grains(position, 1e-8, sand.SILICA, velocity=velocity, spin=spin)
    sim = sand.Simulation(grains, [sand.Contact()], stepping=sand.Verlet(step="0.1 ps"))
    result = sim.run(steps=1)
    assert result.outcome is outcome and result.grains == (culprit,)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_nan_counts_as_the_largest_value(sign):
    """A NaN position makes lists outdated, and a NaN speed counts as too fast, whatever its sign bit."""
    arrays = dense_gas().grains.copy().arrays
    anchor, span = arrays.position.copy(), sand.Box.open().span
    arrays.velocity[0, 7] = arrays.position[1, 9] = np.copysign(np.nan, sign)
    assert np.isnan(largest_squared_speeds(arrays)[0]) and np.isfinite(largest_squared_speeds(arrays)[1])
    assert np.isnan(largest_displacement(arrays, anchor, np.zeros(3), span))


@pytest.mark.compiled("contacts")
@pytest.mark.parametrize(
    "name", ["contacts/twist", "contacts/side", "contacts/constants", "pair_list/pair", "pair_list/step"]
)
@pytest.mark.parametrize("radius", [[1e-8, 1e-8, 1e-8], [1e-8, 1e-8, 9e-9]], ids=["alike", "unlike"])
def test_a_saved_state_with_too_few_columns_is_refused(name, radius):
    """Two contacts, one column of per-contact arrays missing: BadInput; equal grains share one column."""
    index = np.array([[0.0, 0, 0], [1.998e-8, 0, 0], [1.998e-8 + 0.999 * (radius[1] + radius[2]), 0, 0]])
    sim = sand.Simulation(sand.Grains(index, radius, sand.SILICA), [sand.Contact()])
    sim.run(steps=1)
    system, saved = sim.state.copy(), sim.state.to_arrays()
    assert system.uniform_contacts == (radius[2] == radius[0]) and len(sim.contacts["pair"]) == 2
    system.from_arrays(saved)
    fewer = saved | {name: saved[name][..., :1]}
    if system.uniform_contacts and name in ("contacts/constants", "pair_list/step"):
        system.from_arrays(fewer)
    else:
        with pytest.raises(sand.BadInput, match=name):
            system.from_arrays(fewer)
