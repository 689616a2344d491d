"""Substeps of quick bodies and awake clusters within a step of all bodies, in gases so thin that they pay."""

import json

import numpy as np
import pytest

import sand
from sand.basics.state import (
    IMPACT_SPEED,
    LARGEST_IMPACT,
    LARGEST_OVERLAP,
    LATE,
    MADE,
    PAIRS,
    RESTED,
    SOME_AWAKE,
    STEP,
    STEPS,
    SUBSTEPS,
    WOKEN,
)
from sand.engine.part import Part
from sand.engine.rigid.quick_bodies import QuickBodies
from sand.integrate.parts import Stop

from .setups import different, momenta, rest_distance

pytestmark = pytest.mark.filterwarnings("ignore:dipoles. cut-off now")

SIDE = "12 um"
COMPILED = pytest.mark.compiled("dipoles")


def thin_gas(*forces, box=SIDE, dipoles=None, seed=1, substeps=True, fraction=0.1, **options):
    """A thousand magnetic iron grains in (12 µm)³: a pair touches every 0.1 µs."""
    iron = {"radius": "10 nm", "material": "iron", "moment": "200 A m^2/kg"}
    extent = SIDE if box is None else None
    grains = sand.setup.gas(1000, box, extent=extent, temperature="100 K", seed=seed, **iron)
    contact = sand.Contact(damping="critical", damping_ratio=0.2, settling_time="5 ns")
    stepping = sand.RigidClusters(step_fraction=fraction)
    forces = [contact, dipoles or sand.Dipoles(), *forces]
    sim = sand.Simulation(grains, forces, box=box, stepping=stepping, **{"frame_every": 1.0} | options)
    if not substeps:
        limits = sim._engine.parameters.flight_limits._replace(substeps=False)
        sim._engine.table.set("flight_limits", limits)
    return sim


def counts(sim, *numbers):
    return [int(sim.regular_state.count[k]) for k in numbers]


@COMPILED
@pytest.mark.parametrize(
    "dipoles",
    [sand.Dipoles(), pytest.param(sand.Dipoles(periodic="ewald", accuracy=1e-4), marks=pytest.mark.validate)],
    ids=str,
)
def test_substeps_are_of_order_two_and_as_accurate_as_steps_of_all(dipoles):
    """Positions after 0.2 µs, in which two contacts form, against steps of all bodies with an eighth of η.

    Both ways err by η², so by a factor of 4 for half of η, if touches do not spoil it: 2.5 … 7.  With a fifth of the
    steps of all bodies, substeps err by no more than twice as much.  The cut-off of dipoles in the other way lies half
    an interval of steps later, hence the bound of 2.
    """
    exact = thin_gas(dipoles=dipoles, substeps=False, fraction=0.0125)
    plain = thin_gas(dipoles=dipoles, substeps=False)
    runs = [thin_gas(dipoles=dipoles, fraction=fraction) for fraction in (0.1, 0.05)]
    for sim in (exact, plain, *runs):
        sim.run(until="0.2 us")
        assert counts(sim, MADE, LATE) == [2, 0] and sim.ledger.drift < 1e-3
    errors = [
        np.linalg.norm(sim.box.nearest(sim.grains.position - exact.grains.position), axis=1).max()
        for sim in (plain, *runs)
    ]
    assert 2.5 < errors[1] / errors[2] < 7.0
    assert errors[1] < 2.0 * errors[0] < 1e-9
    assert counts(plain, SUBSTEPS) == [0] and runs[0].steps < 0.2 * plain.steps
    assert counts(runs[0], SUBSTEPS)[0] > 5 * runs[0].steps


@COMPILED
def test_contacts_form_between_the_same_grains_at_the_same_times():
    """0.6 µs with and without substeps: the same pairs, within 0.2 ns; what touches wakes and comes to rest.

    Times err by η²: the largest difference is 0.7 ns with η = 0.1 (of a pair that falls slowly into each other), and a
    sixteenth of this with the η = 0.025 used here.
    """
    runs = [thin_gas(substeps=substeps, fraction=0.025) for substeps in (True, False)]
    found = []
    for sim in runs:
        sim.run(until="0.6 us")
        table = sim.contacts
        order = np.lexsort(np.sort(table["pair"], axis=1).T)
        found.append((np.sort(table["pair"], axis=1)[order], table["formed"][order]))
    (pairs, times), (expected, at) = found
    assert len(pairs) > 4 and np.array_equal(pairs, expected)
    assert np.abs(times - at).max() < 2e-10
    assert counts(runs[0], WOKEN, RESTED, LATE) == counts(runs[1], WOKEN, RESTED, LATE)
    share = [sim.regular_state.clock[SOME_AWAKE] / sim.time for sim in runs]
    assert share[0] == pytest.approx(share[1], rel=0.1, abs=0.0) and share[1] > 0.01


def with_more(sim, position, velocity, radius=1e-8, moment=0.0):
    """The gas of a simulation and more grains, in another simulation; `moment` [A m²] is along z."""
    g, more = sim.grains, len(position)
    far = np.linalg.norm(sim.box.nearest(g.position - np.mean(position, axis=0)), axis=1) > 4e-7
    grains = sand.Grains(
        np.vstack([g.position[far], position]), np.append(g.radius[far], [radius] * more), "iron",
        velocity=np.vstack([g.velocity[far], velocity]), spin=np.vstack([g.spin[far], np.zeros((more, 3))]),
        moment=np.vstack([g.moment[far], [[0.0, 0.0, moment]] * more]),
    )  # fmt: skip
    contact = sand.Contact(damping="critical", damping_ratio=0.2, settling_time="5 ns")
    forces = [contact, sand.Dipoles(cutoff="4 um")]
    return sand.Simulation(grains, forces, box=SIDE, stepping=sand.RigidClusters(), frame_every=1.0)


@COMPILED
def test_awake_clusters_move_in_substeps():
    """A pair in contact is awake at the start, flies at 1 m/s, far from all others, and comes to rest.

    All steps but the first have substeps.  The pair has no moments: it flies on a straight line to rounding, with the
    energy of its contact, which has its rest distance to 1e-3 of the radius, and its spin of 0.
    """
    pitch = rest_distance(sand.IRON, 1e-8, 1e-8)
    start = np.array([[0.0, 0.0, 0.0], [pitch, 0.0, 0.0]])
    sim = with_more(thin_gas(), start, [[0.0, 1.0, 0.0]] * 2)
    for time in (3e-9, 3e-8):
        sim.run(until=time)
        moved = sim.box.nearest(sim.grains.position[-2:] - start)
        assert moved == pytest.approx(np.array([[0.0, time, 0.0]] * 2), rel=0.0, abs=1e-14)
    assert sim.regular_state.bodies.asleep[-2:].all() and counts(sim, RESTED)[0] > 0
    assert sim.regular_state.clock[SOME_AWAKE] > 1e-9 and counts(sim, SUBSTEPS)[0] > 10


@COMPILED
def test_slow_grains_that_touch_within_a_step_are_seen():
    """Two grains without moments, 0.5 … 1.5 nm apart, approach at 0.2 m/s: alone they would need no step below 10 ns.

    Steps of all bodies are 3 to 6 ns long, in which they touch; this takes substeps.
    """
    apart = np.array([[2.0e-8 + 5e-10 * k, 0.0, 0.0] for k in (1, 2, 3)])
    for gap in apart:
        sim = with_more(thin_gas(), [np.zeros(3), gap], [[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0]])
        sim.run(until="10 ns")
        count = len(sim.grains)
        own = sim.contacts["formed"][(sim.contacts["pair"] >= count - 2).all(axis=1)]
        assert len(own) == 1 and own[0] == pytest.approx((gap[0] - 2e-8) / 0.2, rel=1e-3, abs=0.0)
        assert counts(sim, LATE) == [0] and counts(sim, SUBSTEPS)[0] > 2


@COMPILED
def test_loads_besides_those_in_substeps_allow_the_step(monkeypatch):
    """The loads on quick bodies that only act at the ends of a step H change their motion slower than η/H.

    Rate² is Σ|μ B|/I, with the flux density of all grains less that of the quick ones on each other, here by a sum over
    pairs of dipoles in NumPy.  A magnetic grain of 50 nm in the gas acts on others far beyond the pairs in the list,
    but is heavy, and needs no short steps itself.
    """
    checked, exclude = [], QuickBodies._exclude_loads

    def check(self, engine):
        state, own, index = engine.regular_state, self.part.state, self.part.index
        total = state.grains.force[index].copy(), state.grains.field[index].copy()
        exclude(self, engine)
        g, at = own.grains, own.grains.position
        r = state.box.nearest(at[:, None] - at[None])
        d = np.sqrt((r**2).sum(axis=-1)) + np.eye(len(at))
        n, mu = r / d[..., None], g.moment
        along = (n * mu[None]).sum(axis=-1)
        field = 1e-7 * ((3.0 * along[..., None] * n - mu[None]) / d[..., None] ** 3).sum(axis=1) + 1e-7 * mu
        slow = total[1] - field
        first = own.bodies.first.astype(int)
        energy = np.bincount(first, np.linalg.norm(mu, axis=1) * np.linalg.norm(slow, axis=1), len(first))
        used = np.unique(first)
        rate = np.sqrt((energy[used] / own.bodies.inertia[:, used].min(axis=0)).max())
        checked.append(float(state.clock[STEP]) * rate)

    monkeypatch.setattr(QuickBodies, "_exclude_loads", check)
    with_more(thin_gas(seed=2), [np.zeros(3)], [np.zeros(3)], radius=5e-8, moment=1e-15).run(until="0.1 us")
    assert len(checked) > 10 and 0.099 < max(checked) < 0.1001


def denser_gas(box, seed):
    """300 magnetic iron grains in (4 µm)³, each acting on others up to 0.8 µm away: 27 touches per µs."""
    iron = {"radius": "10 nm", "material": "iron", "moment": "200 A m^2/kg"}
    grains = sand.setup.gas(300, box, extent=None if box else "4 um", temperature="100 K", seed=seed, **iron)
    forces = [sand.Contact(damping="critical", damping_ratio=0.2, settling_time="5 ns"), sand.Dipoles(cutoff="0.8 um")]
    return sand.Simulation(grains, forces, box=box, stepping=sand.RigidClusters(), frame_every=1.0)


def changes_of_momenta(sim, until):
    """|ΔΣ m v| in units of Σ|m v|, and |ΔΣ (m x×v + I ω)| likewise, and how many contacts formed."""
    sim.run(steps=1)
    start = momenta(sim)
    sim.run(until=until)
    changes = [
        np.linalg.norm((after - before).sum(axis=0)) / np.linalg.norm(before, axis=1).sum()
        for before, after in zip(start, momenta(sim), strict=True)
    ]
    assert counts(sim, SUBSTEPS)[0] > sim.steps and counts(sim, LATE) == [0]
    return *changes, counts(sim, MADE)[0]


@COMPILED
def test_momenta_are_conserved_to_rounding():
    """An open gas in which 42 contacts form: Σ m v and Σ (m x×v + I ω) stay what they were.

    Every load acts on both of a pair at one time.  Each of some 4500 steps and substeps rounds every momentum once, by
    1e-16 of it, and 600 momenta of either sign are added: 1e-16 √4500 of Σ|m v|, 7e-15.  Angular momenta are rounded
    as the positions, which are larger by a factor of two than their distances from the centre: 1.4e-14.
    """
    linear, angular, made = changes_of_momenta(denser_gas(None, 4), "2 us")
    assert made > 30 and linear < 7e-15 and angular < 1.4e-14


@COMPILED
@pytest.mark.parametrize(
    "seed", [4, pytest.param(5, marks=pytest.mark.validate), pytest.param(6, marks=pytest.mark.validate)]
)
def test_momentum_in_a_periodic_box_is_conserved_to_rounding(seed):
    """As `test_momenta_are_conserved_to_rounding`, with 55 touches; some bodies wake before their first substep.

    The grains of a touch, damped at 0.2 of critical, lose the 10 m/s at which they meet in some 40 contact steps (25 in
    a period): 1e-16 · 10 m/s √(55 · 2 · 40) is 5e-16 of Σ|v| = 150 m/s, little beside the steps of all grains.
    """
    linear, _, made = changes_of_momenta(denser_gas("4 um", seed), "2 us")
    assert made > 40 and linear < 7e-15


@pytest.mark.validate
@COMPILED
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_momenta_of_a_thin_gas_are_conserved_to_rounding(seed):
    """As `test_momenta_are_conserved_to_rounding`, of a thousand grains and all pairs of dipoles."""
    linear, angular, made = changes_of_momenta(thin_gas(box=None, dipoles=sand.Dipoles(cutoff=None), seed=seed), "2 us")
    assert made > 15 and linear < 7e-15 and angular < 1.4e-14


@COMPILED
def test_restart_output_and_threads_change_no_bit(tmp_path):
    """A run with many frames and three restarts, on two threads, has the bits of a whole one on one thread."""
    whole, parts = thin_gas(), thin_gas(out=tmp_path / "run", frame_every="7 ns")
    sand.set_threads(1)
    whole.run(until="0.5 us")
    sand.set_threads(2)
    for time in ("0.11 us", "0.2345 us", "0.4 us", "0.5 us"):
        parts.run(until=time)
        parts = sand.resume(tmp_path / "run")
    assert different(whole, parts) == [] and counts(whole, MADE)[0] > 3 and counts(whole, SUBSTEPS)[0] > 100
    summary = json.loads((tmp_path / "run" / "summary.json").read_text("utf-8"))["rigid_clusters"]
    assert summary["substeps_of_bodies"] == counts(parts, SUBSTEPS)[0]


@COMPILED
def test_a_list_of_pairs_that_overflows_within_a_step_changes_no_bit():
    """Memory for just the pairs that there are: more of them stop the driver after the substeps, and it goes on."""
    whole, tight = thin_gas(), thin_gas()
    for _ in range(150):
        whole.run(steps=1)
        tight.run(steps=1)
        state = tight.regular_state
        used, columns = int(state.count[PAIRS]), state.pair_list.pair.shape[1]
        state.pair_list = state.pair_list._replace(
            **{name: np.ascontiguousarray(array[..., :used]) for name, array in state.pair_list._asdict().items()
               if array.shape[-1] == columns}
        )  # fmt: skip
    assert different(whole, tight) == []
    assert whole.regular_state.clock[SOME_AWAKE] > 0.0 and counts(whole, SUBSTEPS)[0] > 300


@COMPILED
def test_the_largest_overlap_and_impact_are_those_of_awake_grains(monkeypatch):
    """Extremes of the engines of awake grains and of substeps reach the clock of all grains: the largest of each.

    Grains of 100 K touch with the speed that their dipoles give them, and ring about δ₀, 0.05 of their radius.
    """
    seen, give_back = [], Part.give_back

    def record(self, engine):
        seen.append([self.state.clock[k] for k in (LARGEST_OVERLAP, LARGEST_IMPACT, IMPACT_SPEED)])
        return give_back(self, engine)

    monkeypatch.setattr(Part, "give_back", record)
    sim = thin_gas()
    sim.run(until="0.2 us")
    assert counts(sim, MADE) == [2] and counts(sim, SUBSTEPS)[0] > 100
    found = sim.regular_state.clock[[LARGEST_OVERLAP, LARGEST_IMPACT, IMPACT_SPEED]]
    assert found.tolist() == np.max(seen, axis=0).tolist()
    assert 0.05 < found[0] < 0.1 and 0.1 < found[2] < 20.0


@COMPILED
def test_numbers_of_the_noise_of_a_gas_are_used_once(monkeypatch):
    """Noise depends on the number of the step: those of the substeps follow each other, and energy is booked.

    After 4 stopping times of 0.1 µs the kinetic energy of bodies is 3/2 k_B T, to four standard errors √(3/2N) k_B T.
    """
    used = []
    store = QuickBodies._store

    def record(self, engine):
        own = self.part.state.count
        used.append((int(own[SUBSTEPS]), int(own[SUBSTEPS] + own[STEPS])))
        store(self, engine)

    monkeypatch.setattr(QuickBodies, "_store", record)
    sim = thin_gas(sand.Gas("100 K", pressure="2.1 bar"))
    assert 8e-8 < 1.0 / sim._engine.parameters.flight_limits.friction_rate < 1.2e-7
    sim.run(until="0.4 us")
    first, end = np.array(used).T
    assert len(used) > 20 and (end > first).all() and (first[1:] > end[:-1]).all()
    assert sim.ledger.drift < 1e-3
    bodies = sim.regular_state.bodies
    own = np.unique(bodies.first)
    energy = 0.5 * (bodies.momentum[:, own] ** 2).sum(axis=0) / bodies.mass[own]
    kt = 1.380649e-23 * 100.0
    assert energy.mean() == pytest.approx(1.5 * kt, rel=0.0, abs=4.0 * np.sqrt(1.5 / len(own)) * kt)


@COMPILED
@pytest.mark.parametrize(
    "force",
    [
        sand.Field([0, 0, 0], shape="oscillating", amplitude="20 uT", frequency="0.5 MHz"),
        sand.Gravity([0, 0, "1e6 m/s^2"]),
    ],
    ids=["field of time", "gravity through the box"],
)
def test_work_of_external_forces_is_booked_once(force):
    """A field that changes with time, and gravity with grains that leave the box on one side: the energy is conserved.

    Both ways of taking steps book the same work, to the accuracy of the steps: 0.15 % with this field, whose work on
    grains that take substeps is 1.2 % of it.
    """
    runs = [thin_gas(force, substeps=substeps) for substeps in (True, False)]
    for sim in runs:
        sim.run(until="0.4 us")
        assert sim.ledger.drift < 1e-3
    assert counts(runs[0], SUBSTEPS)[0] > 100
    work = [sim.ledger.rows[-1]["lost_outside"] for sim in runs]
    assert work[0] == pytest.approx(work[1], rel=4e-3, abs=0.0)


@COMPILED
def test_substeps_that_fail_leave_the_state_before_the_step(monkeypatch):
    """Substeps that stop because of some of their grains: the run stops and names them, and nothing has changed."""
    sim = thin_gas()
    sim.run(until="50 ns")
    before = {name: array.copy() for name, array in sim.regular_state.to_arrays().items()}
    copy, chosen = QuickBodies._copy, []

    def failing(self, state):
        steps = copy(self, state)
        chosen.append(self.part.index)

        def stop(*arguments, **options):
            self.part.state.count[8:10] = 0, 1
            self.part.state.grains.arrays.position[:] += 1.0
            return Stop.OVERCOMPRESSED

        monkeypatch.setattr(self.part.engine, "drive", stop)
        return steps

    monkeypatch.setattr(QuickBodies, "_copy", failing)
    result = sim.run(until="1 us")
    assert result.outcome.is_physics and result.grains == tuple(chosen[-1][:2])
    after = sim.regular_state.to_arrays()
    assert {n for n in before if before[n].tobytes() != after[n].tobytes()} <= {"count", "clock"}
