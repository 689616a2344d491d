"""What spares looking at every grain in every step, beside looking."""

import numpy as np
import pytest

import sand
from sand.core.world import FAR_LEEWAY, FASTEST, MADE, NEAR_LEEWAY, QUICKEST, REBUILT, SOON_LEEWAY
from sand.kernels.watch import farthest, largest_speeds
from sand.stepping.parts import SOON_PART


def crowd(forces=None, **options):
    """Sixty grains in a periodic box, listed, fast enough to make lists anew every few dozen steps."""
    box = sand.Box.periodic("0.16 um")
    moment = "100 A m^2/kg"
    grains = sand.setup.gas(60, box, radius=1e-8, material=sand.SILICA, temperature="3e4 K", seed=5, moment=moment)
    forces = forces or [sand.Contact()]
    return sand.Simulation(grains, forces, box=box, neighbours=sand.Neighbours(search="cells"), seed=6, **options)


WAYS = {
    "contacts": {},
    "cycles and gas": {"forces": (sand.Contact(), sand.Dipoles(), sand.Gas("3e4 K", pressure="1 bar"))},
    "flights": {"stepping": sand.Adaptive()},
}


@pytest.mark.parametrize("way", WAYS)
def test_lists_are_made_anew_in_the_same_steps_whether_all_are_looked_at_or_not(way):
    """A call of the driver begins with a look at all grains: 600 calls of one step, and one call of 600, same bits.

    Contacts form and break meanwhile, cycles and gas kick, flights move.
    """
    once, often = crowd(**WAYS[way]), crowd(**WAYS[way])
    once.run(steps=600)
    often.run(steps=1)
    while often.world.steps < once.world.steps:
        often._engine.advance(np.inf, 1)
    assert once.world.count[MADE] > 0
    assert once.world.count[REBUILT] > 3
    a, b = once.world.to_arrays(), often.world.to_arrays()
    assert all(np.array_equal(a[name], b[name]) for name in a)


def test_no_grain_is_farther_than_its_leeway_allows():
    """Leeway + the largest displacement ≤ the limit of each list, after any number of steps; both speeds are exact."""
    sim = crowd()
    control, search = sim._engine.rules.control, sim._engine.rules.search
    limits = {
        FAR_LEEWAY: ("far", "anchor", 0.5 * search.margin),
        NEAR_LEEWAY: ("near", "anchor", 0.25 * control.reach),
        SOON_LEEWAY: ("near", "mark", SOON_PART * control.reach),
    }
    sim.run(steps=1)
    spared = 0
    for steps in (1, 2, 3, 5, 8, 13, 21, 34, 55):
        sim._engine.advance(np.inf, steps)
        w, span = sim.world, sim._engine.rules.span
        for place, (group, name, limit) in limits.items():
            strayed = farthest(w.grains.arrays, getattr(getattr(w, group), name), span)
            assert w.near.watch[place] <= limit - strayed + 1e-12 * limit
            spared += w.near.watch[place] > 0.0
        speeds = np.linalg.norm(sim.grains.velocity, axis=1).max(), np.linalg.norm(sim.grains.spin, axis=1).max()
        assert np.sqrt(w.near.watch[[FASTEST, QUICKEST]]) == pytest.approx(speeds, rel=1e-14)
        assert np.sqrt(largest_speeds(w.grains.arrays)) == pytest.approx(speeds, rel=1e-14)
    assert spared > 10
