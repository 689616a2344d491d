"""Updaters: changes and ends of a run at regular moments, which no output and no interruption shifts."""

import numpy as np
import pytest

import sand
from sand.basics.errors import BadInput
from sand.basics.state import CONTACTS

from .test_change import warm_gas

pytestmark = pytest.mark.filterwarnings("ignore:dipoles. the cut-off, .* ends an interaction")


class RemoveLeaving(sand.Updater):
    """Removes grains beyond 0.118 µm along any axis, and pushes the others along x."""

    every = "0.7 ns"

    def __init__(self):
        self.moments = []

    def act(self, simulation):
        self.moments.append((simulation.time, simulation.steps))
        with simulation.change() as state:
            state.remove(np.abs(state.grains.position).max(axis=1) > 0.118e-6)
            state.velocity += [0.5, 0.0, 0.0]


class StopWhenFew(sand.Updater):
    """Ends the run when fewer than 15 grains are left."""

    every = "100 steps"

    def act(self, simulation):
        return len(simulation.grains) < 15


def bits(simulation):
    """Arrays of the regular state."""
    return {name: array.tobytes() for name, array in simulation.regular_state.to_arrays().items()}


def different(first, second):
    """Names of arrays that differ."""
    return [name for name in first if first[name] != second.get(name)]


@pytest.mark.compiled("dipoles")
def test_moments_depend_neither_on_output_nor_on_interruptions(tmp_path):
    """Other cadences of output, a run in pieces and a resumed run have the same moments and the same bits.

    The last update but one follows at 9.1 ns: that at 10.5 ns lies in the step that the end of the run cuts.  An update
    follows the first regular step that ends at or after its time: t_k − Δt < 0.7 ns k ≤ t_k.
    """
    updaters = [[RemoveLeaving()] for _ in range(4)]
    whole = warm_gas(updaters=updaters[0])
    whole.run(until="10.5 ns")
    moments = updaters[0][0].moments
    assert len(moments) == 14 and 2 < len(whole.grains) < 20 and whole.state.count[CONTACTS] > 0
    for k, (time, _) in enumerate(moments, 1):
        assert 0.7e-9 * k <= time < 0.7e-9 * k + 1e-11

    often = warm_gas(updaters=updaters[1])
    often.frame_every, often.row_every, often.checkpoint_every = "0.35 ns", "37 steps", "0.1 ns"
    often.run(until="10.5 ns")
    pieces = warm_gas(updaters=updaters[2], out=tmp_path / "run")
    for until in ("0.7 ns", "2.79 ns", "8.4 ns"):
        pieces.run(until=until)
    again = sand.resume(tmp_path / "run", updaters=updaters[3])
    again.run(until="10.5 ns")
    assert updaters[1][0].moments == moments == updaters[2][0].moments + updaters[3][0].moments
    assert different(bits(whole), bits(often)) == [] == different(bits(whole), bits(again))
    assert (whole.grains.id == again.grains.id).all() and whole._system.next_id == again._system.next_id
    frames = sand.open(tmp_path / "run").frames
    assert len(frames[0]) == 20 and len(frames[-1]) == len(whole.grains)
    assert (frames[-1].id == whole.grains.id).all()
    assert again.ledger.drift < 1e-3 and again.ledger.rows[-1] == whole.ledger.rows[-1]


class Expands(sand.Updater):
    """Scales the box."""

    every = "0.3 ns"

    def act(self, simulation):
        with simulation.change() as change:
            change.scale_box(1.02)


@pytest.mark.compiled("dipoles")
def test_choices_after_an_interruption(tmp_path):
    """A run that goes on after an interruption states the choices of one without: those of its last change."""
    whole, pieces = warm_gas(updaters=[Expands()]), warm_gas(updaters=[Expands()], out=tmp_path / "run")
    before = whole.choices
    whole.run(until="1 ns")
    pieces.run(until="0.5 ns")
    again = sand.resume(tmp_path / "run", updaters=[Expands()])
    assert again.choices == pieces.choices
    again.run(until="1 ns")
    assert again.choices == whole.choices != before
    assert sand.open(tmp_path / "run").summary["choices"] == whole.choices


@pytest.mark.compiled("dipoles")
def test_an_updater_ends_a_run_as_a_condition(tmp_path):
    """The outcome is CONDITION_MET with the name of the updater, at a multiple of 100 steps; the run can go on."""
    sim = warm_gas(updaters=[RemoveLeaving(), StopWhenFew()], out=tmp_path / "run")
    result = sim.run(until="20 ns")
    assert result.outcome is sand.Outcome.CONDITION_MET and result.condition == "StopWhenFew"
    assert len(sim.grains) < 15 and sand.open(tmp_path / "run").summary["condition"] == "StopWhenFew"
    assert sim.run(steps=50).outcome is sand.Outcome.FINISHED


class Stops(sand.Updater):
    every = "10 steps"

    def act(self, simulation):
        simulation.stop()


@pytest.mark.compiled("dipoles")
def test_stop_and_refusals(tmp_path):
    """Changes in an observer or a condition, and wrong updaters, are refused in one line each."""

    class Wrong(sand.Observer):
        def tick(self, simulation):
            with simulation.change():
                pass

    sim = warm_gas(updaters=[Stops()], out=tmp_path / "run")
    assert sim.run(until="1 ns").steps < 100
    with pytest.raises(BadInput, match=r"Stops \(every 10 steps\); resume it in a script with sand.resume"):
        sand.resume(tmp_path / "run")
    with pytest.warns(UserWarning, match="goes on with none"):
        sand.resume(tmp_path / "run", updaters=[])
    sim.updaters, sim.observers = [], [Wrong()]
    with pytest.raises(BadInput, match="by an updater only"):
        sim.run(until="1 ns")
    with pytest.raises(BadInput, match="from the act of an updater only"):
        sim.stop()
    never, wall = Stops(), Stops()
    never.every, wall.every = None, "1 s wall"
    with pytest.raises(BadInput) as caught:
        sim.updaters = [Stops, 3, never, wall]
    assert len(caught.value.problems) == 4
