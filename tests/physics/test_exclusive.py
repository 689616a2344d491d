"""One thread at a time works with a simulation; runs and changes within changes; updaters that fail; copies."""

import threading

import numpy as np
import pytest

import sand
from sand.simulation import exclusive

from .setups import different

COMPILED = pytest.mark.compiled("contacts")


def gas(number=200, **options):
    """Iron grains that touch now and then."""
    grains = sand.setup.gas(number, 8e-7, radius=1e-8, material=sand.IRON, temperature="3000 K", seed=1)
    return sand.Simulation(grains, [sand.Contact()], box=8e-7, seed=1, frame_every=1.0, **options)


class Calls(sand.Observer):
    """Calls something from another thread in the middle of a run, once; keeps the errors."""

    def __init__(self, calls):
        self.calls, self.errors = calls, []

    def tick(self, sim):
        def work():
            for call in self.calls:
                try:
                    call(sim)
                except sand.BadInput as error:
                    self.errors.append(str(error))

        if sim.steps > 100 and self.calls:
            thread = threading.Thread(target=work)
            thread.start()
            thread.join()
            self.calls = []


@COMPILED
def test_other_threads_are_refused_during_a_run_and_change_no_bit():
    """What uses the engine is refused in one line each; reading time and steps is not.

    Grains and choices use it, too: grains that are sorted in memory are brought back into the user's order.
    """
    calls = [
        lambda sim: sim.status(),
        lambda sim: sim.run(steps=5),
        lambda sim: sim.loads(),
        lambda sim: sim.contacts,
        lambda sim: sim.copy(),
        lambda sim: sim.grains,
        lambda sim: sim.regular_state,
        lambda sim: sim.choices,
        lambda sim: sim.change().__enter__(),
    ]
    watcher = Calls([*calls, lambda sim: (sim.time, sim.steps)])
    alone, watched = gas(), gas(observers=[watcher])
    for sim in (alone, watched):
        sim.run(steps=3000)
    refused = ["another thread works with this simulation"] * 8 + ["can be changed by an updater only"]
    assert len(watcher.errors) == len(refused)
    for text, error in zip(refused, watcher.errors, strict=True):
        assert text in error and "\n" not in error
    assert different(alone, watched) == []


@COMPILED
def test_a_short_call_of_another_thread_is_waited_for(monkeypatch):
    """A run begins when a status, or whatever another thread asks for, has been found; one that lasts is refused."""
    sim, begun, ended = gas(20), threading.Event(), threading.Event()

    def work():
        with sim._exclusive.held("status"):
            begun.set()
            ended.wait(10.0)

    thread = threading.Thread(target=work)
    thread.start()
    begun.wait(10.0)
    monkeypatch.setattr(exclusive, "PATIENCE", 0.01)
    with pytest.raises(sand.BadInput, match="another thread works with this simulation, so that run is not possible"):
        sim.run(steps=5)
    monkeypatch.setattr(exclusive, "PATIENCE", 60.0)
    timer = threading.Timer(0.05, ended.set)
    timer.start()
    assert sim.run(steps=5).steps == 5
    thread.join()


@COMPILED
def test_calls_from_another_thread_after_a_run_are_possible():
    """The right ends with the call, also after an error."""
    sim, found = gas(20), []
    sim.run(steps=10)
    with pytest.raises(sand.BadInput):
        sim.run(steps=-1)
    thread = threading.Thread(target=lambda: found.append(sim.run(steps=10).steps))
    thread.start()
    thread.join()
    assert found == [20]


@COMPILED
def test_runs_and_changes_within_a_change_are_refused():
    """Nothing is changed then, and the simulation goes on."""
    sim = gas(20)
    sim.run(steps=10)
    before = sim.grains.velocity.copy()
    for inner, message in (
        (lambda: sim.run(steps=5), "end the block first"),
        (lambda: sim.change().__enter__(), "one block"),
    ):
        with pytest.raises(sand.BadInput, match=message), sim.change() as change:
            change.velocity[0] = 0.0
            inner()
        assert sim.steps == 10 and np.array_equal(sim.grains.velocity, before)
    with sim.change() as change:
        change.velocity[0] = 0.0
    assert sim.run(steps=5).steps == 15


class Fails(sand.Updater):
    """Acts every 100 steps, notes them, and fails once at one of them."""

    every = "100 steps"

    def __init__(self, at=-1):
        self.fails_at, self.steps = at, []

    def act(self, sim):
        if sim.steps == self.fails_at:
            self.fails_at = -1
            raise RuntimeError("once")
        self.steps.append(sim.steps)


@COMPILED
def test_an_updater_that_failed_acts_again_at_that_step():
    """It and those after it act at that step when the simulation goes on, those before it do not act twice."""
    updaters = [Fails(), Fails(200), Fails()]
    sim = gas(20, updaters=updaters)
    with pytest.raises(RuntimeError):
        sim.run(steps=400)
    assert [each.steps for each in updaters] == [[100, 200], [100], [100]]
    sim.run(steps=200)
    assert [each.steps for each in updaters] == [[100, 200, 300, 400]] * 3


@COMPILED
def test_a_copy_made_by_an_observer_runs():
    """It has the bits of the simulation that it is a copy of, at the same step."""

    class Copies(sand.Observer):
        made = None

        def see(self, sim, row):
            if sim.steps > 0 and self.made is None:
                self.made = sim.copy()

    watcher = Copies()
    sim = gas(20, observers=[watcher], row_every="100 steps")
    sim.run(steps=300)
    assert watcher.made.run(steps=300 - watcher.made.steps).steps == 300
    assert different(sim, watcher.made) == []
