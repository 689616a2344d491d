"""The minima of the step's choice, and the pairs that may touch soon, beside plain searches."""

import math

import numpy as np
import pytest

import sand
from sand.compiler.jit import kernel
from sand.contact.events import inner_list_overflowed
from sand.integrate.step_control import closing_step, grain_step, pair_step, steps_of_free_grains
from sand.integrate.step_parts import INNER_SKIN_FRACTION
from sand.neighbours.pair_list import build_inner_list
from sand.numerics.simd import float_bits, float_from_bits
from sand.state.state import INNER_COUNT, INNER_SKIN, PAIRS


def crowd():
    """150 grains of 10 to 20 nm in a periodic box, some of them close, fast in all directions."""
    rng = np.random.default_rng(7)
    box = sand.Box.periodic("0.23 um")
    radius = 1e-8 * rng.uniform(1.0, 2.0, 150)
    grains = sand.setup.gas(150, box, radius=radius, material=sand.SILICA, temperature="300 K", seed=2)
    sim = sand.Simulation(grains, [sand.Contact()], box=box)
    sim.run(steps=300)
    return sim


def test_ranks_are_ordered_as_numbers():
    """x < y ⇔ float_bits(x) < float_bits(y) for x, y ≥ 0, subnormal numbers and infinity; NaN is above all of them."""
    numbers = [0.0, 5e-324, 1e-310, 1e-30, 1.0, 1.0 + 2e-16, 1e300, math.inf]
    ranks = [float_bits(x) for x in numbers]
    assert ranks == sorted(ranks) and len(set(ranks)) == len(ranks)
    assert [float_from_bits(bits) for bits in ranks] == numbers
    assert float_bits(math.nan) > float_bits(math.inf)


@pytest.mark.compiled("contacts")
def test_choices_are_the_least_of_all():
    """The loops that vectorise give the least of what grains and pairs allow one by one in Python, to rounding."""
    sim = crowd()
    w, rules = sim.state, sim._engine.parameters
    arrays, span, control = w.grains.arrays, rules.span, rules.criteria

    def look(grains, far, start, near, count, span, control):
        step, cycle = steps_of_free_grains(grains, far, start, count, control)
        return step, cycle, closing_step(grains, near, count, span, control, math.inf)

    step, cycle, closing = kernel(look, cached=False)(
        arrays, w.long_range, w.contacts.start, w.pair_list, w.count, span, control
    )
    each = [grain_step(arrays, w.long_range, w.contacts.start, control, i) for i in range(150)]
    pairs = [pair_step(arrays, w.pair_list, span, control, p) for p in range(w.count[PAIRS])]
    assert len(pairs) > 50
    assert math.isfinite(min(pairs))
    assert step == pytest.approx(min(control.longest, min(one for one, _ in each)), rel=1e-13)
    assert cycle == pytest.approx(min(control.longest, min(one for _, one in each)), rel=1e-13)
    assert closing == pytest.approx(min(pairs), rel=1e-13)


@pytest.mark.compiled("contacts")
def test_what_may_touch_soon_is_what_is_close():
    """All pairs of grains apart by less than twice the way that makes the pick stale, and no others.

    Where they have no room (an array has one place more than that), all near pairs are looked at.
    """
    sim = crowd()
    w, reach = sim.state, sim._engine.parameters.criteria.pair_gap
    gap = 2.0 * INNER_SKIN_FRACTION * reach

    def picked(room):
        near = w.pair_list._replace(inner=np.zeros(room, np.uint32), skin=w.pair_list.skin.copy())
        build_inner_list(w.grains.arrays, near, w.count, sim._engine.parameters.span, gap)
        assert 0.49 * gap < near.skin[INNER_SKIN] < 0.5 * gap
        if inner_list_overflowed(near, w.count):
            return {tuple(sorted(pair)) for pair in near.pair[:, : w.count[PAIRS]].T.tolist()}
        soon = near.inner[: int(near.skin[INNER_COUNT])].tolist()
        assert len(set(soon)) == len(soon)
        return {tuple(sorted(near.pair[:, p].tolist())) for p in soon}

    position, radius = sim.grains.position, sim.grains.radius
    bound = {tuple(sorted(pair)) for pair in sim.contacts["pair"].tolist()}
    close = set()
    for i in range(150):
        for j in range(i):
            apart = np.linalg.norm(sim.box.nearest(position[i] - position[j]))
            if apart < radius[i] + radius[j] + gap and (j, i) not in bound:
                close.add((j, i))
    assert len(close) > 3
    assert picked(w.pair_list.inner.size) == picked(len(close) + 1) == close
    every = {tuple(sorted(pair)) for pair in w.pair_list.pair[:, : w.count[PAIRS]].T.tolist()}
    assert picked(len(close)) == picked(1) == every > close
