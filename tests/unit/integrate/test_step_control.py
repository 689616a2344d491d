"""Minima in the choice of the step, and the inner list, against plain searches."""

import math

import numpy as np
import pytest

import sand
from sand.basics.state import INNER_COUNT, INNER_SKIN, PAIRS
from sand.compiler.jit import kernel
from sand.contact.events import inner_list_overflowed
from sand.engine.assemble import build_engine
from sand.integrate.stages import INNER_SKIN_FRACTION
from sand.integrate.step_control import closing_step, grain_step, pair_step, steps_of_free_grains
from sand.neighbours.pair_list import build_inner_list
from sand.numerics.simd import float_bits, float_from_bits


def dense_gas():
    """150 grains of 10 to 20 nm in a periodic box, some of them close, fast in all directions."""
    rng = np.random.default_rng(7)
    box = sand.Box.periodic("0.23 um")
    radius = 1e-8 * rng.uniform(1.0, 2.0, 150)
    grains = sand.setup.gas(150, box, radius=radius, material=sand.SILICA, temperature="300 K", seed=2)
    sim = sand.Simulation(grains, [sand.Contact()], box=box)
    sim.run(steps=300)
    return sim


def test_float_bits_are_ordered_as_numbers():
    """x < y ⇔ float_bits(x) < float_bits(y) for x, y ≥ 0, subnormal and infinite; NaN is above all of them."""
    numbers = [0.0, 5e-324, 1e-310, 1e-30, 1.0, 1.0 + 2e-16, 1e300, math.inf]
    keys = [float_bits(x) for x in numbers]
    assert keys == sorted(keys) and len(set(keys)) == len(keys)
    assert [float_from_bits(bits) for bits in keys] == numbers
    assert float_bits(math.nan) > float_bits(math.inf)


@pytest.mark.compiled("contacts")
def test_vectorised_minima_equal_plain_minima():
    """The vectorised loops give the minimum over grains and pairs evaluated one by one in Python, to rounding."""
    sim = dense_gas()
    w, span = sim.state, sim.box.span
    engine = build_engine(sim.grains, sim.forces, sim.box, sim.stepping, sim.neighbours, fresh=False)
    arrays, control = w.grains.arrays, engine.parameters.criteria

    def minima(grains, far, start, near, count, span, control):
        step, cycle = steps_of_free_grains(grains, far, start, control)
        return step, cycle, closing_step(grains, near, count, span, control, math.inf)

    step, cycle, closing = kernel(minima, cached=False)(
        arrays, w.long_range, w.contacts.start, w.pair_list, w.count, span, control
    )
    each = [grain_step(arrays, w.long_range, w.contacts.start, control, i) for i in range(150)]
    pairs = [pair_step(arrays, w.pair_list, span, control, p) for p in range(w.count[PAIRS])]
    assert len(pairs) > 50
    assert math.isfinite(min(pairs))
    assert step == pytest.approx(min(control.longest, min(one for one, _ in each)), rel=1e-13, abs=0.0)
    assert cycle == pytest.approx(min(control.longest, min(one for _, one in each)), rel=1e-13, abs=0.0)
    assert closing == pytest.approx(min(pairs), rel=1e-13, abs=0.0)


@pytest.mark.compiled("contacts")
def test_inner_list_holds_the_close_pairs():
    """All pairs with a gap below twice the displacement that makes the list outdated, and no others.

    Without room for all of them (an array has one entry more than pairs), all near pairs are searched.
    """
    sim = dense_gas()
    w, reach = sim.state, sim.grains.radius.min()
    gap = 2.0 * INNER_SKIN_FRACTION * reach

    def inner_list(room):
        near = w.pair_list._replace(inner=np.zeros(room, np.uint32), skin=w.pair_list.skin.copy())
        build_inner_list(w.grains.arrays, near, w.count, sim.box.span, gap)
        assert 0.49 * gap < near.skin[INNER_SKIN] < 0.5 * gap
        if inner_list_overflowed(near, w.count):
            return {tuple(sorted(pair)) for pair in near.pair[:, : w.count[PAIRS]].T.tolist()}
        inner = near.inner[: int(near.skin[INNER_COUNT])].tolist()
        assert len(set(inner)) == len(inner)
        return {tuple(sorted(near.pair[:, p].tolist())) for p in inner}

    position, radius = sim.grains.position, sim.grains.radius
    bound = {tuple(sorted(pair)) for pair in sim.contacts["pair"].tolist()}
    close = set()
    for i in range(150):
        for j in range(i):
            apart = np.linalg.norm(sim.box.nearest(position[i] - position[j]))
            if apart < radius[i] + radius[j] + gap and (j, i) not in bound:
                close.add((j, i))
    assert len(close) > 3
    assert inner_list(w.pair_list.inner.size) == inner_list(len(close) + 1) == close
    every = {tuple(sorted(pair)) for pair in w.pair_list.pair[:, : w.count[PAIRS]].T.tolist()}
    assert inner_list(len(close)) == inner_list(1) == every > close
