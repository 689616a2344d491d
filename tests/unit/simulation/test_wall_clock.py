"""Wall time of runs in parts: stepping, output, compilation, start and other."""

import pytest

from sand.simulation import wall_clock
from sand.simulation.wall_clock import WallClock


@pytest.fixture
def now(monkeypatch):
    """The present time and the time spent on compilation, which only the test advances."""
    times = {"wall": 100.0, "compilation": 0.0}
    monkeypatch.setattr(wall_clock.time, "monotonic", lambda: times["wall"])
    monkeypatch.setattr(wall_clock, "compilation_seconds", lambda: times["compilation"])
    return times


def test_parts_sum_to_the_total(now):
    """Each second belongs to one part: compilation not to that it happens in, an inner part not to its outer."""
    clock = WallClock()
    with clock.run():
        with clock.measure("start"):
            now["wall"] += 1.0
            with clock.measure("output"):
                now["wall"] += 2.0
                now["wall"], now["compilation"] = now["wall"] + 4.0, now["compilation"] + 4.0
            now["wall"], now["compilation"] = now["wall"] + 8.0, now["compilation"] + 8.0
        with clock.measure("stepping"):
            now["wall"] += 16.0
        now["wall"] += 32.0
        assert clock.runs and clock.total == 63.0
    now["wall"] += 1000.0
    assert clock.parts == {"start": 1.0, "stepping": 16.0, "output": 2.0, "compilation": 12.0, "other": 32.0}
    assert clock.total == 63.0 == sum(clock.parts.values()) and not clock.runs


def test_a_resumed_run_continues_the_parts(now):
    """Totals and parts of earlier processes are kept, older files without parts count as other."""
    parts = {"start": 1.0, "stepping": 3.0, "output": 2.0, "compilation": 0.0, "other": 4.0}
    clock, old = WallClock(10.0, parts), WallClock(10.0)
    for each in (clock, old):
        with each.run(), each.measure("stepping"):
            now["wall"] += 5.0
    assert clock.total == 15.0 and clock.parts == parts | {"stepping": 8.0}
    assert old.parts == {"start": 0.0, "stepping": 5.0, "output": 0.0, "compilation": 0.0, "other": 10.0}


def test_nothing_is_measured_between_runs_or_after_an_error(now):
    """A part outside of a run counts nothing; an exception ends the parts it passes through."""
    clock = WallClock()
    with clock.measure("output"):
        now["wall"] += 1.0
    assert clock.total == 0.0 == sum(clock.parts.values())
    with pytest.raises(KeyError), clock.run(), clock.measure("stepping"), clock.measure("output"):
        now["wall"] += 1.0
        raise KeyError
    with clock.run(), clock.measure("stepping"):
        now["wall"] += 1.0
    assert clock.parts == {"start": 0.0, "stepping": 1.0, "output": 1.0, "compilation": 0.0, "other": 0.0}
