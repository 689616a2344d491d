"""When an engine calls the methods of a component for Python, between regular steps."""

import math

import numpy as np
import pytest

import sand
from sand.basics.state import COMPARED, MADE
from sand.engine.assemble import build_engine
from sand.engine.component import Component
from sand.integrate.parts import Stop

END = 2e-10


class Recorder(Component):
    """Wants an update at given times, its items, and records when it is called."""

    watches_contacts = True

    def __init__(self, items):
        super().__init__(items)
        self.updates, self.changes = [], []

    def next_time(self, engine):
        return min((time for time in self.items if time > engine.stored_state.time), default=math.inf)

    def update(self, engine):
        self.updates.append(engine.stored_state.time)

    def contacts_changed(self, engine):
        self.changes.append((engine.steps, int(engine.stored_state.count[MADE])))


def meeting(*components):
    """Two grains that touch after about 0.1 ns; the engine has begun."""
    grains = sand.Grains([[0, 0, 0], ["20.1 nm", 0, 0]], "10 nm", "silica", velocity=[[1.0, 0, 0], [0, 0, 0]])
    parts = grains, [sand.Contact()], sand.Box(), sand.Verlet(), sand.Neighbours()
    engine = build_engine(*parts, extra=components)
    engine.begin()
    return engine


@pytest.mark.compiled("contacts")
def test_updates_follow_the_first_step_at_or_after_each_time():
    """t_k is the end of step k: an update at 0, at min{t_k: t_k ≥ t} for each wanted t, and at the end of the call.

    Calls change no bit, and a copy that takes a shorter step to a time of output makes none.
    """
    plain, ends = meeting(), [0.0]
    while plain.advance(END, 1) is not Stop.TIME_REACHED:
        ends.append(plain.stored_state.time)
    wanted = (0.3 * END, 0.300001 * END, 0.8 * END)
    recorder = Recorder(wanted)
    engine = meeting(recorder)
    engine.advance(END, math.inf)
    first = sorted({min(end for end in ends if end >= time) for time in wanted})
    assert recorder.updates == [0.0, *first, ends[-1]]
    arrays, same = engine.state.to_arrays(), plain.state.to_arrays()
    others = np.arange(len(same["count"])) != COMPARED
    assert np.array_equal(arrays["count"][others], same["count"][others])
    assert all(np.array_equal(arrays[name], same[name]) for name in arrays if name != "count")
    calls = len(recorder.updates), len(recorder.changes)
    engine.go_to(END)
    assert (len(recorder.updates), len(recorder.changes)) == calls and engine.time == END


@pytest.mark.compiled("contacts")
def test_a_new_contact_is_seen_after_its_step():
    """Once, after the step k with n_k > n_(k−1), where n_k contacts have formed up to step k."""
    plain, made = meeting(), [0]
    while not made[-1]:
        plain.advance(math.inf, 1)
        made.append(int(plain.state.count[MADE]))
    recorder = Recorder(())
    engine = meeting(recorder)
    engine.advance(END, math.inf)
    assert recorder.changes == [(len(made) - 1, 1)]
