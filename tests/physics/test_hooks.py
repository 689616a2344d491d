"""Places of a step at which components act: all stages of a place are called, in the order of the components."""

import numpy as np
import pytest

import sand
from sand.basics.state import STEPS
from sand.compiler.stage import stage
from sand.components.walls import Walls, read_walls
from sand.engine.assemble import build_engine
from sand.engine.component import Component
from sand.integrate.hooks import Hook
from sand.integrate.parts import LIMIT, Stop

RADIUS, STEP = 1e-7, 2.0**-45


@stage("a record of calls", cached=False)
def record(count, wall_contacts, parameters, block):
    """Append (component, hook, step, contacts with walls) to the array `parameters[0]`, whose first number counts."""
    calls, number = parameters
    calls[0, 0] += 1
    row = calls[0, 0]
    calls[row, 0], calls[row, 1], calls[row, 2], calls[row, 3] = number, block, count[STEPS], wall_contacts.used[0]
    return 0


@stage("a limit of the step", cached=False)
def limit(count, scratch, parameters):
    """Allow steps of parameters[0] seconds, and none from step parameters[1] on."""
    scratch[LIMIT] = min(scratch[LIMIT], parameters[0])
    return Stop.TOO_FAST.value if count[STEPS] >= parameters[1] else Stop.NONE.value


class Toy(Component):
    """Records calls at three places, and limits the step."""

    name = noun = "toy"

    def __init__(self, calls, number, step, last=2**60):
        super().__init__([number])
        self.recorded, self.limited = (calls, number), (step, last)

    def stages(self, setup, law, settings):
        places = Hook.CONTACTS, Hook.END_STEP, Hook.BETWEEN_CYCLES
        return {hook: [(record, self.recorded)] for hook in places} | {Hook.LIMIT_STEP: [(limit, self.limited)]}


def engine_with(*components):
    """Two touching grains on a wall, with components."""
    grains = sand.Grains([[0, 0, 0.999 * RADIUS], [1.999 * RADIUS, 0, 0.999 * RADIUS]], RADIUS, "silica")
    walls = Walls(read_walls(sand.Wall([0, 0, 0], [0, 0, 1], "silica")))
    forces, neighbours = [sand.Contact(damping="critical")], sand.Neighbours()
    engine = build_engine(grains, forces, sand.Box(), sand.Verlet(), neighbours, extra=[walls, *components])
    engine.begin()
    return engine


@pytest.mark.compiled("contacts")
def test_components_share_the_places_of_a_step():
    """Two components beside walls: in each step CONTACTS, END_STEP, BETWEEN_CYCLES, each of the first, then the second.

    Both are called after the walls, which are given first: at the first call of CONTACTS there are two contacts with
    the wall. The step is the smallest of all limits, that of the second one.
    """
    calls = np.zeros((100, 4), np.int64)
    engine = engine_with(Toy(calls, 1, 2 * STEP), Toy(calls, 2, STEP))
    calls[:] = 0
    assert engine.advance(np.inf, 3) is Stop.NONE
    number, hook, steps, contacts = calls[1 : calls[0, 0] + 1].T
    places = [Hook.CONTACTS, Hook.END_STEP, Hook.BETWEEN_CYCLES]
    assert (number == [1, 2] * 9).all() and (hook == np.repeat(places, 2).tolist() * 3).all()
    assert (steps == np.concatenate([[k, k, k + 1, k + 1, k + 1, k + 1] for k in range(3)])).all()
    assert (contacts == 2).all()
    assert engine.regular_state.time == 3 * STEP


@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("stops", [0, 1])
def test_any_component_may_stop_the_run(stops):
    """The value of `Stop` that one of two components returns before step 2 ends the run there, whichever it is."""
    calls, last = np.zeros((100, 4), np.int64), [2**60, 2**60]
    last[stops] = 2
    engine = engine_with(*(Toy(calls, number, STEP, last[number]) for number in range(2)))
    assert engine.advance(np.inf, 9) is Stop.TOO_FAST and engine.steps == 2
