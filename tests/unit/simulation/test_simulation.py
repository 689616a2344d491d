"""The simulation object: refused input, warnings, choices, outcomes."""

import json
import math
import signal
import threading
import warnings

import numpy as np
import pytest

import sand
from sand.basics.state import INNER_COUNT, PAIRS
from sand.simulation.cadence import Cadence, Schedule

from ...physics.setups import rest_distance, struck_chain

pytestmark = pytest.mark.filterwarnings("ignore:grains overlap too deeply")


def pair(distance=3e-8, **options):
    return sand.Grains([[0, 0, 0], [distance, 0, 0]], 1e-8, options.pop("material", sand.IRON), **options)


def test_overlaps_name_ten_pairs_and_count_the_rest():
    """Twenty coincident grains: 190 pairs, ten lines and the number of others."""
    grains = sand.Grains(1e-9 * np.arange(60).reshape(20, 3) * 0.01, 1e-8, sand.IRON)
    with pytest.raises(sand.BadInput) as caught:
        sand.Simulation(grains, [sand.Contact()])
    assert len(caught.value.problems) == 11
    assert "180 more" in caught.value.problems[-1]


@pytest.mark.compiled("small")
def test_given_contacts_may_overlap_more():
    """A row of 31 overlapping pairs: those given as contacts, in any order, are not reported.

    Pairs alternate between two sizes; only the larger may overlap by so much: 2 δ0, which scales as r^(1/3).
    """
    limit = 2.0 * (2e-8 - rest_distance(sand.SILICA, 1e-8, 1e-8))
    size = np.repeat(np.where(np.arange(31) % 2, 1e-8, 4e-8), 2)
    x_positions = 1e-6 * np.repeat(np.arange(31), 2)
    x_positions[1::2] += 2.0 * size[1::2] - 1.3 * limit
    grains = sand.Grains(np.stack([x_positions, 0 * x_positions, 0 * x_positions], axis=1), size, sand.SILICA)
    wrong = [2 * k for k in range(31) if k % 2]
    first = [2, 10, 58]
    pairs = np.array([[2, 3], [11, 10], [59, 58]])
    kept = sand.setup.StrainedContacts(pairs, np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3))
    with pytest.raises(sand.BadInput) as caught:
        sand.Simulation(grains, [sand.Contact()], contacts=kept)
    named = [f"grains {i} and {i + 1} overlap by {1.3 * limit:.3g} m at the start" for i in wrong if i not in first]
    *lines_of_pairs, rest = caught.value.problems
    assert [line.split(";")[0] for line in lines_of_pairs] == named[:10]
    assert all(f"at most {limit:.3g} m is allowed: move them apart" in line for line in lines_of_pairs)
    assert rest == f"… and {len(named) - 10} more overlapping pairs"


def test_warnings():
    """a0/R > 0.3, missing moments, periodic images without a cut-off."""
    with pytest.warns(UserWarning, match=r"a0/R = 0\.53"):
        sand.Simulation(pair(), [sand.Contact()])
    with pytest.warns(UserWarning, match="no grain has a magnetic moment"):
        sand.Simulation(pair(), [sand.Dipoles()])
    with pytest.warns(UserWarning, match="energy jumps"):
        sand.Simulation(pair(moment="1 A m^2/kg"), [sand.Dipoles(cutoff=None)], box="1 um")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sand.Simulation(sand.Grains([[0, 0, 0]], 1e-6, sand.SILICA), [sand.Contact()])


def test_the_cutoff_is_stated_with_its_reason():
    """Open box: none. Periodic: the smaller of 1.5 b_max and half the box / 1.35, and which."""
    hot = pair(moment="200 A m^2/kg", velocity=[[1.0, 0, 0], [-1.0, 0, 0]])
    assert "open box" in sand.Simulation(hot, [sand.Dipoles()]).choices["dipoles cut-off"]
    small = sand.Simulation(hot, [sand.Dipoles()], box="0.2 um").choices["dipoles cut-off"]
    assert small.startswith("74.07 nm (smooth, half the box / 1.35")  # 0.5 × 200 nm / 1.35
    for part in ("limited by the box: less than 1.5 b_max = ", "a larger box, or periodic = 'ewald'"):
        assert part in small
    large = sand.Simulation(hot, [sand.Dipoles()], box="1 mm").choices["dipoles cut-off"]
    assert "1.5 b_max" in large and "limited" not in large


def test_the_automatic_cutoff_reaches_beyond_the_grains():
    """Weak moments: 1.5 b_max is less than a grain; two diameters of the largest, 60 nm, are used."""
    grains = sand.Grains(
        [[0, 0, 0], [1e-7, 0, 0]],
        [1e-8, 1.5e-8],
        sand.IRON,
        moment="0.01 A m^2/kg",
        velocity=[[1.0, 0, 0], [-1.0, 0, 0]],
    )
    chosen = sand.Simulation(grains, [sand.Dipoles()], box="1 um").choices["dipoles cut-off"]
    assert chosen.startswith("60 nm (smooth, two grain diameters, more than 1.5 b_max")


@pytest.mark.parametrize(
    ("moment", "reason"), [(1e-21, "less than two grain diameters"), (0.0, "no grain has a magnetic")]
)
def test_the_automatic_cutoff_in_a_small_box_reaches_beyond_contact(moment, reason):
    """L < 10.8 r: two diameters do not fit, and (L/2)/1.35 is used, never a capture radius inside a grain."""
    grains = pair(moment=[0, 0, moment], velocity=[[900.0, 0, 0], [0, 0, 0]])
    choice = sand.Dipoles().choose(grains, sand.Box.periodic("0.1 um"))
    assert choice.radius == pytest.approx(0.5 * 1e-7 / 1.35, rel=1e-12, abs=0.0) and reason in choice.reason
    assert choice.radius > 2e-8  # the distance of two grains in contact


@pytest.mark.compiled("contacts")
def test_a_step_that_is_too_long_ends_the_run_and_names_the_grain(tmp_path):
    """A fixed step in which a grain moves more than half its radius: an Outcome and a checkpoint."""
    grains = pair(velocity=[[0, 0, 0], [0, 100.0, 0]])
    sim = sand.Simulation(grains, [sand.Contact()], stepping=sand.Verlet(step="1 ns"), out=tmp_path / "run")
    result = sim.run(until="1 us")
    assert result.outcome is sand.Outcome.TOO_FAST
    assert result.grains == (1,)
    assert list((tmp_path / "run").glob("checkpoint-*.npz"))
    assert "grains 1" in str(result)


@pytest.mark.filterwarnings("ignore:impacts are too fast for elastic grains")
@pytest.mark.compiled("contacts")
def test_overcompressed_grains_end_the_run():
    """An impact so fast that a centre enters the other grain, outside the range of JKR."""
    grains = pair(velocity=[[0, 0, 0], [-2e5, 0, 0]], material=sand.SILICA)
    result = sand.Simulation(grains, [sand.Contact()]).run(until="1 ns")
    assert result.outcome is sand.Outcome.OVERCOMPRESSED
    assert result.grains == (0, 1)


@pytest.mark.compiled("contacts")
def test_numbers_that_are_not_finite_end_the_run():
    """A spin set to NaN is detected within 16 steps, and its grain is named."""
    sim = sand.Simulation(sand.Grains(1e-6 * np.arange(15).reshape(5, 3), 1e-8, sand.IRON), [sand.Contact()])
    sim.run(steps=100)
    sim.state.grains.arrays.spin[0, 3] = math.nan
    result = sim.run(steps=200)
    assert result.outcome is sand.Outcome.NOT_FINITE
    assert result.grains == (3,)


def too_long_steps(out):
    """Half a contact period per step, where Verlet is unstable."""
    d = 2e-8 - 2e-11
    fast = sand.theory.contact(sand.IRON, 1e-8).twist_period
    periods = [getattr(sand.theory.contact(sand.IRON, 1e-8), f"{k}_period") for k in ("normal", "slide", "roll")]
    grains = sand.Grains(
        [[d * k, 0, 0] for k in range(6)],
        1e-8,
        sand.IRON,
        velocity=0.01 * np.random.default_rng(1).normal(size=(6, 3)),
        spin=1e6 * np.random.default_rng(2).normal(size=(6, 3)),
    )
    stepping = sand.Verlet(step=0.5 * min(fast, *periods))
    return sand.Simulation(grains, [sand.Contact()], stepping=stepping, out=out, frame_every="1 s")


@pytest.mark.compiled("contacts")
def test_a_runaway_energy_ends_the_run(tmp_path):
    """Detected within 1e4 steps; the earlier state is kept, and resuming ends at the same step."""
    sim = too_long_steps(tmp_path / "run")
    result = sim.run(steps=60_000)
    assert result.outcome is sand.Outcome.RUNAWAY
    assert result.steps <= 20_000
    assert len(result.grains) == 2
    arrays, meta = sand.io.checkpoint.newest_checkpoint(tmp_path / "run")
    assert meta["steps"] < result.steps
    assert np.abs(arrays["grains/velocity"]).max() < 1.0  # a state from before the error
    go_on = sand.resume(tmp_path / "run")
    assert go_on.run().outcome is sand.Outcome.RUNAWAY
    assert go_on.state.steps == result.steps


@pytest.mark.compiled("contacts")
def test_the_energy_error_is_checked_at_the_end(tmp_path):
    """The final state is checked, too, and does not overwrite a good checkpoint."""
    result = too_long_steps(tmp_path / "run").run(steps=9_000)
    assert result.outcome is sand.Outcome.RUNAWAY
    assert result.steps == 9_000
    assert sand.io.checkpoint.newest_checkpoint(tmp_path / "run")[1]["steps"] == 0
    assert len(list((tmp_path / "run").glob("checkpoint-*.npz"))) == 1


@pytest.mark.compiled("dipoles")
def test_no_false_alarm_in_a_cold_start_without_frames():
    """Two distant cold magnetic grains collide: 1e4 times the initial energy, recorded once at the end."""
    moment = [[6.6e-18, 0, 0]] * 2
    grains = sand.Grains([[0, 0, 0], [1.2e-7, 1e-9, 0]], 1e-8, sand.IRON, moment=moment)
    sim = sand.Simulation(grains, [sand.Contact(), sand.Dipoles(cutoff="1 mm")], frame_every="1 s")
    result = sim.run(steps=60_000)
    first, last = sim.ledger.rows[0], sim.ledger.rows[-1]
    assert result.outcome is sand.Outcome.FINISHED
    assert len(sim.ledger) == 2
    assert last["made"] == 1
    assert sim.ledger.dissipated > 1e3 * abs(first["total"])


@pytest.mark.validate
def test_no_false_alarm_where_there_was_no_energy():
    """A grain falls from rest at the origin, 3e4 steps: the initial energy is 0, the total stays 0 to rounding."""
    sim = sand.Simulation(sand.Grains([[0, 0, 0]], 1e-8, sand.IRON), [sand.Gravity("9.81 m/s^2")])
    assert sim.run(steps=30_000).outcome is sand.Outcome.FINISHED
    assert sim.ledger.rows[-1]["translation"] > 0.0


@pytest.mark.compiled("contacts")
def test_rounding_is_not_reported_as_drift():
    """A lattice at rest: its energy changes in the last digit, while the kinetic energy is almost zero.

    Ten units of the last digit are more than rounding and count, so slow motion of large bodies cannot hide a drift.
    """
    sim = sand.Simulation(sand.setup.lattice(6, radius="10 nm", material=sand.SILICA), [sand.Contact()])
    sim.run(until="0.5 ns")
    first, last = sim.ledger.rows[0], sim.ledger.rows[-1]
    assert 0.0 < last["translation"] < 1e-20 * abs(last["total"])
    assert sim.ledger.drift == 0.0
    last["total"] = first["total"] + 10.0 * np.spacing(first["total"])
    kinetic = max(row["translation"] + row["rotation"] for row in sim.ledger.rows)
    assert sim.ledger.drift == pytest.approx(10.0 * abs(np.spacing(first["total"])) / kinetic, rel=1e-12, abs=0.0)


@pytest.mark.compiled("contacts")
def test_a_spin_too_fast_for_a_fixed_step_ends_the_run():
    """6 radians per step would invalidate the quaternions; the run stops and names the grain."""
    sim = sand.Simulation(pair(spin=[[0, 0, 0], [0, 0, 6e9]]), [sand.Contact()], stepping=sand.Verlet(step="1 ns"))
    result = sim.run(steps=200)
    assert result.outcome is sand.Outcome.SPINS_TOO_FAST
    assert result.grains == (1,)
    assert np.linalg.norm(sim.grains.orientation[1]) == pytest.approx(1.0, rel=1e-6, abs=0.0)


@pytest.mark.compiled("contacts")
def test_steps_are_counted_through_growing_arrays():
    """run(steps=N) takes N steps, also when the pair list outgrows its arrays."""
    sim = struck_chain(length=30)
    near = sim.state.pair_list
    own = ("anchor", "inner", "skin")  # without one column per pair
    columns = {name: array[..., :1].copy() for name, array in near._asdict().items() if name not in own}
    sim.state.pair_list = near._replace(**columns)
    sim.run(steps=32)
    assert sim.state.steps == 32


@pytest.mark.parametrize(
    ("far", "there", "not_there"),
    [
        ("impulse", ("constant_force", "past_position", "path"), ("force_rate", "past_moment", "anchor", "cell_of")),
        ("taylor", ("torque_rate", "past_position", "past_moment"), ("constant_force", "path", "order", "cell_start")),
        ("every step", ("force", "torque"), ("constant_torque", "force_rate", "past_position", "order")),
    ],
)
def test_arrays_are_allocated_as_needed(far, there, not_there):
    """Long-range arrays have columns the kernel needs; contacts 10 % extra, in multiples of eight."""
    x_positions = (2e-8 - 1e-12) * np.indices((4, 4, 4)).reshape(3, -1).T
    grains = sand.Grains(x_positions, 1e-8, sand.SILICA, moment="1 A m^2/kg")
    forces, search = [sand.Contact(), sand.Dipoles(cutoff="none")], sand.Neighbours(search="all pairs")
    sim = sand.Simulation(grains, forces, stepping=sand.Verlet(far=far), neighbours=search)
    arrays = sim.state.long_range._asdict()
    assert all(arrays[name].shape[-1] == 64 for name in there)
    assert not any(arrays[name].size for name in not_there)
    assert sim.state.contacts.pair.shape[1] == -8 * (-int(1.1 * 3 * 4 * 4 * 3) // 8) == 160


@pytest.mark.compiled("contacts")
def test_contacts_alone_have_no_room_for_other_forces():
    """No long-range loads and no list, one buffer for the cells; a damping column only with damping."""
    x_positions = (2e-8 - 1e-12) * np.indices((4, 4, 4)).reshape(3, -1).T
    grains = sand.Grains(x_positions, 1e-8, sand.SILICA)
    for damping in ("none", "critical"):
        forces, search = [sand.Contact(damping=damping)], sand.Neighbours(search="cells")
        sim = sand.Simulation(grains, forces, neighbours=search)
        sim.run(steps=2)
        far, contacts = sim.state.long_range, sim.state.contacts
        assert far.force.size == far.torque.size == far.anchor.size == far.start.size == 0
        assert far.packed_position.size == far.packed_moment.size == far.packed_grain.size == 0
        assert far.near.size == far.order.size == 64
        assert contacts.damping.shape == (12, contacts.twist.size if damping == "critical" else 0)
        assert len(contacts.lost) == (6 if damping == "critical" else 4)
        near = sim.state.pair_list
        assert near.pair.shape[1] >= sim.state.count[PAIRS] >= 144 and near.inner.size == near.pair.shape[1] // 8
        assert near.skin[INNER_COUNT] == 0  # pairs in contact are skipped, and all others are farther apart


@pytest.mark.compiled("contacts")
def test_a_row_is_written_once(tmp_path):
    """Running again to a time already reached adds no row and no frame."""
    seen = []

    class Count(sand.Observer):
        def see(self, simulation, row):
            seen.append(row["step"])

    sim = sand.Simulation(pair(), [sand.Contact()], out=tmp_path / "run", observers=[Count()])
    sim.run(steps=10)
    for _ in range(2):
        sim.run(until=sim.time)
    lines = (tmp_path / "run" / "ledger.csv").read_text().splitlines()
    assert [line.split(",")[0] for line in lines[1:]] == ["0", "10"]
    assert seen == [0, 10]


@pytest.mark.compiled("contacts")
def test_a_torn_ledger_does_not_stop_a_resume(tmp_path):
    """A kill during a row: the incomplete row is dropped, and the run resumes."""
    sim = sand.Simulation(pair(), [sand.Contact()], out=tmp_path / "run")
    sim.run(steps=1234)
    path = tmp_path / "run" / "ledger.csv"
    path.write_text(path.read_text() + "12,0.1")
    again = sand.resume(tmp_path / "run")
    again.run(steps=10)
    lines = path.read_text().splitlines()
    assert [line.split(",")[0] for line in lines[1:]] == ["0", "1234", "1244"]


@pytest.mark.compiled("contacts")
def test_automatic_cutoff_without_moments(tmp_path):
    """Thermal grains without moments in a periodic box: half the box, and a resume works.

    The warning is shown once, not again by the resumed run, and stays in both summaries.
    """
    grains = pair(velocity=[[1, 0, 0], [-1, 0, 0]])
    with pytest.warns(UserWarning, match="no grain has a magnetic moment"):
        sim = sand.Simulation(grains, [sand.Dipoles()], box="1 um", out=tmp_path / "run")
    sim.run(steps=10)
    assert ["no grain has a magnetic moment" in text for text in sim.warnings] == [True]
    first = json.loads((tmp_path / "run" / "summary.json").read_text())
    with warnings.catch_warnings(record=True) as shown:
        warnings.simplefilter("always")
        sand.resume(tmp_path / "run").run(steps=10)
    assert not shown and first["warnings"] == sim.warnings
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["warnings"] == first["warnings"]


@pytest.mark.validate
def test_magnetite_flies_without_a_surface_energy(tmp_path):
    """Without contacts no surface energy is needed, and a resume works too."""
    grains = pair(distance=1e-7, material=sand.MAGNETITE, moment="material")
    sand.Simulation(grains, [sand.Dipoles(cutoff="1 um")], out=tmp_path / "run").run(steps=10)
    assert sand.resume(tmp_path / "run").run(steps=10).steps == 20


def test_grains_copy_their_arguments():
    """Later changes of the user's arrays, or of a running simulation, do not affect grains."""
    radius, position = np.full(2, 1e-8), np.asfortranarray([[0, 0, 0], [3e-8, 0, 0]])
    grains = sand.Grains(position, radius, sand.IRON)
    radius[0] = position[1, 0] = 5.0
    assert grains.radius[0] == 1e-8
    assert grains.position[1, 0] == 3e-8
    assert not np.shares_memory(sand.Grains(grains.position, 1e-8, sand.IRON).position, grains.position)


@pytest.mark.compiled("contacts")
def test_one_grain_at_rest():
    """The run ends at its time, in steps of at most 1e5 sound-crossing times r √(ρ/E)."""
    sim = sand.Simulation(sand.Grains([[0, 0, 0]], 1e-8, sand.IRON), [sand.Contact()])
    result = sim.run(until="1 ms")
    assert result.outcome is sand.Outcome.FINISHED
    assert 1e-3 <= result.time < 1e-3 + 1e5 * 1e-8 * math.sqrt(7874 / 210e9)
    assert result.drift == 0.0


@pytest.mark.compiled("contacts")
def test_without_contact_grains_pass_through_each_other():
    """Without sand.Contact no contact forms."""
    sim = sand.Simulation(pair(velocity=[[0, 0, 0], [-1.0, 0, 0]]), [])
    sim.run(until="60 ns")
    assert len(sim.contacts["pair"]) == 0
    assert sim.grains.position[1, 0] == pytest.approx(3e-8 - sim.time, rel=1e-12, abs=0.0)


@pytest.mark.compiled("contacts")
def test_contact_across_periodic_faces():
    """A pair through the boundary sticks as in the middle of the box, to rounding."""
    ends = []
    for shift in (0.0, 1e-7):
        x = sand.Box.periodic(2e-7).wrap(np.array([[shift - 1.2e-8, 0, 0], [shift + 1.2e-8, 0, 0]]))
        grains = sand.Grains(x, 1e-8, sand.SILICA, velocity=[[2.0, 0, 0], [-2.0, 0.5, 0]])
        sim = sand.Simulation(grains, [sand.Contact()], box=2e-7)
        sim.run(steps=3000)
        ends.append((sim.grains.velocity.copy(), len(sim.contacts["pair"])))
    assert ends[0][1] == ends[1][1] == 1
    assert ends[0][0] == pytest.approx(ends[1][0], abs=1e-6 * np.abs(ends[0][0]).max())


@pytest.mark.compiled("contacts")
def test_the_starting_objects_are_untouched():
    """The simulation copies its grains and exposes read-only views."""
    grains = pair(velocity=[[0, 0, 0], [-1.0, 0, 0]])
    sim = sand.Simulation(grains, [sand.Contact()])
    sim.run(steps=10)
    assert grains.position[1, 0] == 3e-8
    with pytest.raises(ValueError):
        sim.grains.position[0] = 0.0


@pytest.mark.compiled("contacts")
def test_an_interrupt_stops_between_two_steps(tmp_path):
    """SIGINT: the run raises Interrupted, a checkpoint exists, and a resumed run reaches the end."""
    d = rest_distance(sand.SILICA, 1e-7, 1e-7)
    grains = sand.Grains([[0, 0, 0], [d, 0, 0]], 1e-7, sand.SILICA, velocity=[[0.01, 0, 0], [0, 0, 0]])
    sim = sand.Simulation(grains, [sand.Contact()], out=tmp_path / "run")
    sim.run(steps=10)  # compiled
    timer = threading.Timer(0.3, lambda: signal.raise_signal(signal.SIGINT))
    timer.start()
    with pytest.raises(sand.Interrupted) as caught:
        sim.run(until="1 s")
    assert caught.value.result.outcome is sand.Outcome.INTERRUPTED
    again = sand.resume(tmp_path / "run")
    assert again.time == caught.value.result.time
    assert again.run(steps=100).outcome is sand.Outcome.FINISHED


def test_when_frames_are_due():
    """Multiples of the interval, the first after the present time; none without an interval."""
    schedule = Schedule(Cadence("time", 0.1), 0.0)
    assert schedule.due == pytest.approx(0.1, rel=1e-6, abs=0.0)
    schedule.advance(0.35)
    assert schedule.due == pytest.approx(0.4, rel=1e-6, abs=0.0)
    assert Schedule(Cadence("time", 0.1), 7.05).due == pytest.approx(7.1, rel=1e-6, abs=0.0)
    assert Schedule(None, 0.0).due == math.inf


@pytest.mark.compiled("contacts")
def test_step_of_a_vibrating_pair():
    """Its fastest period / 25, not rounded down to a power of two; shorter only in a fast impact.

    The step has 24 binary digits, 6e-8.
    """
    d = rest_distance(sand.SILICA, 1e-7, 1e-7)
    period = sand.theory.contact("silica", 1e-7).slide_period
    for speed, whole in ((0.01, True), (50.0, False)):
        grains = sand.Grains([[0, 0, 0], [d, 0, 0]], 1e-7, sand.SILICA, velocity=[[speed, 0, 0], [0, 0, 0]])
        sim = sand.Simulation(grains, [sand.Contact()])
        sim.run(steps=5)
        step = sim.state.clock[1]
        assert step == pytest.approx(period / 25, rel=1e-7, abs=0.0) if whole else step < 0.5 * period / 25
