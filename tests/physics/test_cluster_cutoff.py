"""The automatic cut-off of dipoles follows the two clusters with the largest moments."""

import copy
import json
import math

import numpy as np
import pytest

import sand
from sand.basics import threads
from sand.basics.constants import BOLTZMANN, MAGNETIC
from sand.basics.state import COMPARED, CONTACTS, CUT_RADIUS, CUT_TIME
from sand.engine import compiled_state, engine
from sand.integrate import task_queue
from sand.integrate.parts import Stop

from ..plugins import ForestRuth

pytestmark = [
    pytest.mark.filterwarnings("ignore:contacts of iron"),
    pytest.mark.filterwarnings("ignore:moments of iron"),
    pytest.mark.filterwarnings("ignore:dipoles. cut-off now"),
    pytest.mark.filterwarnings("ignore:dipoles. from"),
    pytest.mark.filterwarnings("ignore:dipoles. cutoff = none"),
]
KELVIN = 1e5
MOMENT = "200 A m^2/kg"


def capture(first, second, kelvin=KELVIN):
    """b_max = √3 (2k μ μ'/(m̄ v²))^(1/3) (Eq. 13) with v² = kT/2m̄: √3 (4k μ μ'/kT)^(1/3)."""
    return math.sqrt(3.0) * (4.0 * MAGNETIC * first * second / (BOLTZMANN * kelvin)) ** (1.0 / 3.0)


def two_chains(cutoff, gap=0.0, radius="20 nm", kelvin=KELVIN):
    """Two aligned chains of four 20 nm iron grains that pass each other at b = 0.8 b_max and the chains' thermal speed.

    Box and time are those of two chains at 100 K in 16 µm, scaled with b_max, ∝ T^(−1/3) for a higher temperature, so
    that the flight takes 10⁵ steps. `gap` separates the grains of a chain at the start. Four grains without a moment
    fly far away from the chains, so that the grains have the temperature of the chains' thermal speed.
    """
    one = sand.setup.aggregates.chain(4, radius=radius, material=sand.IRON, moment=MOMENT)
    total, mass = 4.0 * np.linalg.norm(one.moment[0]), one.mass.sum()
    b, speed = capture(total, total, kelvin), math.sqrt(BOLTZMANN * kelvin / mass)
    side = 16e-6 / 4.063143799668605e-6 * b  # 16 µm for 20 nm grains at 100 K
    place = one.position + np.arange(4)[:, None] * [gap, 0.0, 0.0]
    position = [*place, *(place + np.array([-1.2 * b, 0.8 * b, 0.0]))]
    position += [[x * side, y * side, 0.0] for x in (-0.45, 0.45) for y in (-0.45, 0.45)]
    velocity = np.repeat([[-0.5 * speed, 0, 0], [0.5 * speed, 0, 0]], 4, axis=0)
    free = 6 - 1 if gap == 0.0 else 12 - 1  # bodies less one
    energy = 1.5 * free * BOLTZMANN * kelvin - 0.5 * mass * 0.5 * speed**2
    fast = math.sqrt(2.0 * energy / mass)  # four grains with the mass of a chain
    velocity = [*velocity, *([0.0, 0.0, sign * fast] for sign in (1, -1, -1, 1))]
    moment = [*one.moment, *one.moment, *np.zeros((4, 3))]
    grains = sand.Grains(position, radius, sand.IRON, moment=moment, velocity=velocity)
    forces = [sand.Contact(damping="critical"), sand.Dipoles(cutoff)]
    return sand.Simulation(grains, forces, box=side, frame_every=0.01 * b / speed), b, speed


def closest_approach(cutoff, gap=0.0, **options):
    """Smallest distance of the chains over 0.8 b_max; number of clusters at the end; the simulation."""
    sim, b, speed = two_chains(cutoff, gap, **options)
    distances = []

    class Reader(sand.Observer):
        def see(self, simulation, row):
            x = simulation.grains.position
            distances.append(np.linalg.norm(simulation.box.nearest(x[:4].mean(axis=0) - x[4:8].mean(axis=0))))

    sim.observers = [Reader()]
    sim.run(until=2.4 * b / speed)
    return min(distances) / (0.8 * b), sim.ledger["clusters"][-1] - 4, sim


@pytest.mark.compiled("dipoles")
def test_the_cutoff_of_single_grains_prevents_the_capture_of_two_chains():
    """With 1.5 b_max of single grains the closest approach is b: the chains do not interact."""
    one = np.linalg.norm(two_chains("auto")[0].grains.moment[0])
    assert closest_approach(1.5 * capture(one, one))[:2] == (pytest.approx(1.0, abs=2e-4), 2)


@pytest.mark.compiled("dipoles")
def test_two_chains_capture_each_other_without_a_cutoff():
    """b = 0.8 b_max is less than b_max."""
    closest, clusters, _ = closest_approach(None)
    assert closest < 0.6 and clusters == 1


@pytest.mark.compiled("dipoles")
def test_the_automatic_cutoff_sees_the_chains_at_the_start():
    """1.5 b_max of the chains, here limited by the box: captured as without a cut-off, and no change during the run."""
    closest, clusters, sim = closest_approach("auto")
    assert closest < 0.6 and clusters == 1
    assert sim.state.cutoff[CUT_RADIUS] == pytest.approx(0.5 * sim.box.shortest / 1.35, rel=1e-12, abs=0.0)
    assert "1.5 b_max = 609.5 nm" in sim.choices["dipoles cut-off"]
    assert sim.state.cutoff[CUT_TIME] == 0.0 and not sim.ledger["lost_cutoff_changed"].any()


@pytest.mark.validate
@pytest.mark.compiled("dipoles")
def test_capture_at_a_hundred_kelvin():
    """Chains of 4 nm grains at 100 K, not scaled: 3.7e6 steps, ten seconds of CPU time for each cut-off.

    1.5 b_max of single grains: no interaction, as the chains pass at 130 nm; 1.5 b_max of the chains: captured.  Chains
    of 20 nm grains need hundred times as many: times grow as R^3.5 (b/v), contact steps as R^1.2.
    """
    small = {"radius": "4 nm", "kelvin": 100.0}
    one = np.linalg.norm(two_chains("auto", **small)[0].grains.moment[0])
    cutoff = 1.5 * capture(one, one, 100.0)
    assert closest_approach(cutoff, **small)[:2] == (pytest.approx(1.0, abs=2e-4), 2)
    closest, clusters, _ = closest_approach("auto", **small)
    assert closest < 0.6 and clusters == 1


@pytest.mark.compiled("dipoles")
def test_chains_that_form_during_the_run_capture_each_other():
    """Eight grains in two rows, 4 nm from contact: first 1.5 b_max of single grains, then of the chains they form."""
    closest, clusters, sim = closest_approach("auto", gap=4e-9)
    one = np.linalg.norm(sim.grains.moment[0])
    start = float(sim.choices["dipoles cut-off"].split(" nm")[0]) * 1e-9
    assert start == pytest.approx(1.5 * capture(one, one), rel=1e-3, abs=0.0)
    assert closest < 0.6 and clusters == 1
    assert sim.state.cutoff[CUT_RADIUS] > 2.4 * start and 0.0 < sim.state.cutoff[CUT_TIME] < 0.1 * sim.time
    assert "clusters of 4 and 4 grains" in sim.choices["dipoles cut-off now"]


def pairs_of_grains(count=4, side="0.45 um", **options):
    """Four pairs of 10 nm iron grains that touch one after the other within 1 ns, among 23 single grains.

    The grains are so fast that 1.5 b_max, 83 nm of single grains and 132 nm of two pairs, fits into the box; many
    distances are in between.
    """
    rng = np.random.default_rng(3)
    points = 1e-7 * np.stack(np.meshgrid(*[np.arange(-1, 2)] * 3), -1).reshape(-1, 3)
    points = points[rng.permutation(len(points))]
    apart = np.array([20e-9 + 0.4e-9 * (k + 1) for k in range(count)])
    direction = rng.normal(size=(len(points), 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    partner = points[:count] + apart[:, None] * direction[:count]
    velocity = 4.0 * rng.normal(size=(len(points), 3))
    moment = 6.6e-18 * np.concatenate([direction, direction[:count]])
    grains = sand.Grains(
        np.concatenate([points, partner]), "10 nm", sand.IRON, moment=moment,
        velocity=np.concatenate([velocity, velocity[:count]]),
    )  # fmt: skip
    return sand.Simulation(grains, [sand.Contact(damping="critical"), sand.Dipoles()], box=side, **options)


def brute_force(grains, box, radius):
    """Energy Σ S(r) U(r) of all nearest images, S of docs/physics/dipoles.md, in NumPy."""
    i, j = np.triu_indices(len(grains), 1)
    r = box.nearest(grains.position[i] - grains.position[j])
    mu, nu = grains.moment[i], grains.moment[j]
    square = (r**2).sum(axis=1)
    dots = [(a * b).sum(axis=1) for a, b in ((mu, nu), (mu, r), (nu, r))]
    t = np.clip((radius**2 - square) / (radius**2 * (1.0 - 0.8**2)), 0.0, 1.0)
    return math.fsum(
        MAGNETIC * (dots[0] / square**1.5 - 3.0 * dots[1] * dots[2] / square**2.5) * t**3 * (10 - 15 * t + 6 * t * t)
    )


def to_next_change(sim):
    """Run step by step until the cut-off changes; the simulation before the last step, and both cut-offs."""
    for _ in range(20_000):
        before, radius = copy.deepcopy(sim), sim.state.cutoff[CUT_RADIUS]
        sim.run(steps=1)
        if sim.state.cutoff[CUT_RADIUS] != radius:
            return before, radius, sim.state.cutoff[CUT_RADIUS]
    raise AssertionError("the cut-off has not changed")


@pytest.mark.compiled("dipoles", "listed")
@pytest.mark.parametrize("search", ["all pairs", "cells"])
def test_energy_and_loads_at_a_change(search):
    """lost_cutoff_changed = U(r_old) − U(r_new) by brute force, and loads change by the difference of two fresh sums.

    Beside it a copy of the run whose cut-off does not change: same positions, same total energy, other loads.
    """
    sim = pairs_of_grains(neighbours=sand.Neighbours(search))
    other = copy.deepcopy(sim)
    other.run(until="0.35 ns")
    sim.run(until=0.99 * other.state.cutoff[CUT_TIME])
    before, old, new = to_next_change(sim)
    before._engine.components, before.state.count[COMPARED] = (), -1  # this copy keeps its cut-off
    before.run(steps=1)
    assert new == pytest.approx(old * 2.0 ** (1.0 / 3.0), rel=1e-9, abs=0.0)  # 2 and 1 grains, head to tail
    assert (before.grains.position == sim.grains.position).all() and before.time == sim.time
    jump = brute_force(sim.grains, sim.box, old) - brute_force(sim.grains, sim.box, new)
    row, unchanged = sim._log_row(), before._log_row()
    assert jump != 0.0 and row["lost_cutoff_changed"] == pytest.approx(jump, rel=1e-9, abs=0.0)
    assert row["total"] == pytest.approx(unchanged["total"], abs=1e-9 * abs(jump) + 4e-16 * abs(row["magnetic"]))
    fresh = [
        sand.Simulation(
            sim.grains, [sand.Dipoles(cutoff)], box=sim.box, neighbours=sand.Neighbours("all pairs")
        ).loads()
        for cutoff in (old, new)
    ]
    for name, present in (("force", sim.grains.force), ("torque", sim.grains.torque)):
        change, size = fresh[1][name] - fresh[0][name], np.abs(present).max()
        assert np.abs(change).max() > 1e-8 * size
        assert present - getattr(before.grains, name) == pytest.approx(change, abs=1e-13 * size)
    assert sim.grains.field == pytest.approx(fresh[1]["field"], abs=1e-12 * np.abs(fresh[1]["field"]).max())


STEPPINGS = {
    "verlet": sand.Verlet(steps_per_period=160),
    "forest-ruth": ForestRuth(contact_stepping=sand.Verlet(steps_per_period=160)),
}


@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize("stepping", STEPPINGS.values(), ids=STEPPINGS)
def test_the_energy_balance_closes_over_changes(stepping):
    """The total stays constant over two changes, to a fifth of what the changes book, with any integrator.

    The rest is the error of vibrating contacts, which falls as Δt²; hence short steps.
    """
    sim = pairs_of_grains(frame_every="0.1 ns", stepping=stepping)
    sim.run(until="0.6 ns")
    assert sim.state.cutoff[CUT_RADIUS] > 1.5 * sim._engine.components[0].first.radius
    booked = sim.ledger["lost_cutoff_changed"]
    assert len(set(booked)) == 3 and np.ptp(sim.ledger["total"]) < 0.2 * np.abs(booked).max()


def state(sim):
    """All arrays of the state, as bytes."""
    return {name: array.tobytes() for name, array in sim.state.to_arrays().items()}


@pytest.mark.compiled("dipoles", "listed")
@pytest.mark.parametrize(
    "neighbours",
    [sand.Neighbours("all pairs"), sand.Neighbours("cells"), sand.Neighbours("cells", order="curve")],
    ids=["all pairs", "cells", "sorted"],
)
def test_changes_are_the_same_for_any_output_and_interruption(tmp_path, neighbours):
    """One run, runs of a few steps with many frames, and a run resumed after each of three changes: the same bits."""
    whole = pairs_of_grains(neighbours=neighbours)
    split = pairs_of_grains(neighbours=neighbours, frame_every="0.01 ns")
    folder = tmp_path / "run"
    resumed = pairs_of_grains(neighbours=neighbours, out=folder, frame_every="0.1 ns")
    resumed.writer.draws = False
    radii = [resumed.state.cutoff[CUT_RADIUS]]
    for until in ("0.2 ns", "0.3 ns", "0.4 ns", "0.6 ns", "1 ns"):
        resumed.run(until=until)
        radii.append(resumed.state.cutoff[CUT_RADIUS])
        resumed = sand.resume(folder)
        resumed.writer.draws = False
        for _ in range(3):
            split.run(steps=7)
        split.run(until=until)
    whole.run(until="1 ns")
    assert len(set(radii)) > 2
    assert whole.state.count[CONTACTS] > 1
    assert state(whole) == state(split) == state(resumed)


@pytest.mark.compiled("dipoles", "listed")
@pytest.mark.parametrize("stepping", ["verlet", "forest-ruth"])
@pytest.mark.parametrize("order", ["as given", "curve"])
def test_a_regular_step_that_is_not_kept_changes_nothing(monkeypatch, order, stepping):
    """The one shorter step to each output fails, as by a contact: the regular step is tried and taken back.

    Then shorter steps from the state before lead to the output.  The run has the bits of one without output, over
    changes of the cut-off, and the rows those of a run in which the one shorter step reaches the output.  Output 40 is
    within the step that ends with a change, so that a contact forms in the step that is taken back.
    """
    options = {"stepping": STEPPINGS[stepping], "neighbours": sand.Neighbours("cells", order=order)}
    whole = pairs_of_grains(**options)
    whole.run(until="0.5 ns")
    rows = {**options, "frame_every": whole.state.cutoff[CUT_TIME] * (1.0 - 1e-6) / 40}
    plain, other = pairs_of_grains(**rows), pairs_of_grains(**rows)
    plain.run(until="0.5 ns")
    shorten, several = engine.Engine._shorten_copy, []

    def shorten_unless_one(self, time, regular, most_steps):
        if most_steps == 1:
            return Stop.NONE
        several.append(shorten(self, time, regular, most_steps))
        return several[-1]

    monkeypatch.setattr(engine.Engine, "_shorten_copy", shorten_unless_one)
    other.run(until="0.5 ns")
    assert several == [Stop.TIME_REACHED] * len(several) and len(several) >= 40
    assert whole.state.cutoff[CUT_TIME] > 0.0
    assert state(whole) == state(plain) == state(other)
    for name in plain.ledger.columns:
        assert (plain.ledger[name] == other.ledger[name]).all()


@pytest.mark.compiled("threads", "listed", "dipoles")
@pytest.mark.parametrize("search", ["all pairs", "cells"])
def test_changes_are_the_same_for_any_number_of_threads(monkeypatch, search):
    """One and two threads, with loops shared among them."""
    for module in (task_queue, compiled_state):
        monkeypatch.setattr(module, "uses_task_queue", lambda grains: True)
    ends = []
    for number in (1, 2):
        threads.set_threads(number)
        try:
            sim = pairs_of_grains(neighbours=sand.Neighbours(search))
            sim.run(until="1 ns")
        finally:
            threads.set_threads(None)
        assert sim.state.cutoff[CUT_TIME] > 0.0
        ends.append(state(sim))
    assert ends[0] == ends[1]


@pytest.mark.compiled("dipoles")
def test_changes_are_reported_once_and_so_is_a_box_that_is_too_small(tmp_path):
    """Each change is reported when it happens; where half the box is less than 1.5 b_max, also in notes and summary."""
    sim = pairs_of_grains(side="0.33 um", out=tmp_path / "run", frame_every="0.1 ns")
    sim.writer.draws = False
    with pytest.warns(UserWarning, match="^dipoles") as found:
        sim.run(until="2 ns")
    texts = [str(w.message) for w in found if str(w.message).startswith("dipoles")]
    assert len(texts) == len(set(texts))
    limited = [text for text in texts if "half the box / 1.35 limits the cut-off" in text]
    assert len(limited) == 1 and "use a larger box, or periodic = 'ewald'" in limited[0]
    assert all("cut-off now" in text for text in texts if text not in limited)
    assert sim.notes() == limited
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["notes"] == limited
    assert "clusters of 2 and 2 grains" in summary["choices"]["dipoles cut-off now"]
    assert sim.state.cutoff[CUT_RADIUS] == pytest.approx(0.5 * 0.33e-6 / 1.35, rel=1e-12, abs=0.0)


@pytest.mark.compiled("dipoles")
def test_a_given_cutoff_stays():
    """A length, None and an open box: the radius of the loops is the same after contacts formed."""
    for cutoff in ("0.1 um", None):
        sim = pairs_of_grains()
        sim = sand.Simulation(sim.grains, [sand.Contact(), sand.Dipoles(cutoff)], box=sim.box)
        numbers = sim._engine.long_range[0][2]
        sim.run(until="1 ns")
        assert sim.state.count[CONTACTS] > 0 and sim._engine.long_range[0][2] == numbers
        assert not sim.state.cutoff.any() and not sim.state.lost[-1]
