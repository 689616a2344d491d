"""A box that is deformed: Newton's law in the laboratory, the work of its boundaries, and runs that are interrupted."""

import copy
import itertools
import math

import numpy as np
import pytest

import sand
from sand import components
from sand.basics.state import BROKEN, MADE, SLIPPED, STEP
from sand.io.checkpoint import newest_checkpoint

RADIUS = 1e-7
ICE = sand.Material(
    "soft ice", density="1000 kg/m^3", surface_energy="0.1 J/m^2", young_modulus="7 GPa", poisson_ratio=0.25,
    rolling_limit="8 angstrom",
)  # fmt: skip
DAMPED = sand.Contact(damping="critical", damping_ratio=0.05)
pytestmark = pytest.mark.compiled("deformation", "contacts")


def arrays_of(sim):
    """All arrays of the regular state, as bits."""
    return {name: (array.shape, array.tobytes()) for name, array in sim.regular_state.to_arrays().items()}


def colliding_bodies():
    """Two aggregates of grains of two sizes that meet off-centre at 16 m/s."""
    first = sand.setup.bpca(12, radius="0.1 um", material=ICE, seed=1)
    second = sand.setup.bpca(10, radius="0.08 um", material=ICE, seed=2)
    return sand.setup.encounter(first, second, speed="16 m/s", impact_parameter="0.3 b").grains


def in_flow(grains, box, rates, shift):
    """The grains shifted by a vector [m] into a box, with velocities relative to its flow; and their images."""
    position = grains.position + shift
    velocity = grains.velocity - np.asarray(rates) * grains.position
    quantities = {"velocity": velocity, "spin": grains.spin}
    return sand.Grains(box.wrap(position), grains.radius, ICE, **quantities), box.image(position)


@pytest.mark.validates("self-consistency", "Bodies that collide in a box that is deformed move as in an open box")
@pytest.mark.parametrize("shift", [0.0, 0.49])
def test_free_bodies_move_as_in_an_open_box(shift, record_bound):
    """Two bodies collide while their box changes linearly by (−30, +20, −10) %: the motion is that of an open box.

    The velocities u + A x of the laboratory obey Newton's law, and a box that changes linearly moves its images at a
    constant velocity.  The kicks and drifts of velocity Verlet are then those of the open box, with A x of the shift
    added: positions differ by errors of rounding, 1e-16 r, which grow in 3000 steps.  Contacts form, roll, and are
    damped in all modes.  Also across a face of the box, by which positions jump.  25 and 50 steps per period.
    """
    grains, box = colliding_bodies(), sand.Box.periodic("3 um", "2.6 um", "2.8 um")
    lengths, changes, until = np.array(box.lengths), np.array([-0.3, 0.2, -0.1]), 4e-8
    rates, moved = changes / until, shift * np.array(box.lengths)
    probe = sand.Simulation(grains, [DAMPED])
    probe.run(steps=1)
    for divisor in (1, 2):
        stepping = sand.Verlet(step=probe.state.clock[STEP] / divisor)
        free = sand.Simulation(grains, [DAMPED], stepping=stepping)
        placed, images = in_flow(grains, box, rates, moved)
        law = sand.Deformation(rates, law="linear")
        sim = sand.Simulation(placed, [DAMPED], box=box, deformation=law, stepping=stepping)
        for each in (free, sim):
            each.run(until=until)
        now = np.array(sim.box.lengths)
        assert now == pytest.approx(lengths * (1.0 + changes), rel=1e-12, abs=0.0)
        whole = sim.grains.position + (sim.grains.image + images) * now - moved * (1.0 + changes)
        error = np.abs(whole - free.grains.position).max() / RADIUS
        record_bound(f"error in radii, shift {shift}, step over {divisor}", error, most=1e-10)
        counts = [[each.state.count[k] for k in (MADE, BROKEN, SLIPPED)] for each in (sim, free)]
        assert counts[0] == counts[1] and counts[0][0] > 3
        one, two = (each.ledger.rows[-1] for each in (sim, free))
        for name in ("lost_forming", "lost_rolling", "lost_damping_normal", "lost_damping_rolling"):
            assert one[name] == pytest.approx(two[name], rel=1e-9, abs=0.0) and one[name] > 0.0, name
        change = [abs(each.ledger["total"][-1] - each.ledger["total"][0]) for each in (sim, free)]
        assert change[0] == pytest.approx(change[1], rel=1.0, abs=1e-3 * abs(one["lost_box"]))


def packing(rate, number=60, side=None, **options):
    """An aggregate of ice grains in a cube that just holds it, deformed at a rate."""
    body = sand.setup.bcca(number, radius=RADIUS, material=ICE, seed=1)
    x = body.position - 0.5 * (body.position.min(0) + body.position.max(0))
    box = sand.Box.periodic(side or float(np.ptp(x, axis=0).max() + 2.1 * RADIUS))
    given = None if rate is None else rate if isinstance(rate, sand.Deformation) else sand.Deformation(rate)
    return sand.Simulation(sand.Grains(x, RADIUS, ICE), [DAMPED], box=box, deformation=given, **options)


@pytest.mark.validates("self-consistency", "The work of a box that is compressed closes the energy balance")
def test_the_work_of_the_boundaries_closes_the_ledger(record_bound):
    """A compression to φ = 0.5: the total of the ledger changes by less than 1e-4 of the work, |lost_box|.

    Contacts form, break, roll, twist and slide: with 25 steps per period the energy of a touch is known to 0.3 %.  The
    work along each axis adds up to that of the box, and the mean pressures of all rows to the work: Σ_rows −P̄ ΔV = W
    for three equal rates, to rounding of the ledger.
    """
    sim = packing("-1e6 1/s", row_every="20 ns")
    sim.run(stop="filling > 0.5", until="2 us")
    rows = sim.ledger.rows
    work = -rows[-1]["lost_box"]
    modes = ("forming", "breaking", "sliding", "rolling", "twisting", "damping_normal")
    assert rows[-1]["filling"] >= 0.5 and min(rows[-1][f"lost_{mode}"] for mode in modes) > 0.0
    record_bound("error of the ledger over the work", abs(rows[-1]["total"] - rows[0]["total"]) / work, most=1e-4)
    assert sum(rows[-1][f"work_{axis}"] for axis in "xyz") == pytest.approx(work, rel=1e-12, abs=0.0)
    mean = sum(
        -before["box_x"] ** 3 * (math.expm1(3.0 * math.log(after["box_x"] / before["box_x"]))) / 3.0
        * sum(after[f"mean_pressure_{axis}"] for axis in "xyz")
        for before, after in itertools.pairwise(rows)
    )  # fmt: skip
    assert mean == pytest.approx(work, rel=1e-6, abs=0.0)


def ideal_gas(law, **options):
    """Thirty grains without forces, at 1 m/s, in a cube that is deformed, with a row every 20 ns."""
    rng = np.random.default_rng(5)
    grains = sand.Grains(rng.uniform(-1e-6, 1e-6, (30, 3)), RADIUS, ICE, velocity=rng.normal(size=(30, 3)))
    return sand.Simulation(grains, [], box="4 um", deformation=law, row_every="20 ns", frame_every="1 us", **options)


def pressures_of(rows):
    """Mean pressures, averaged over the axes, and 2K/3V of the row before and of each row: (3, rows − 1) [Pa]."""
    mean = [sum(row[f"mean_pressure_{axis}"] for axis in "xyz") / 3.0 for row in rows]
    ideal = [2.0 / 3.0 * row["translation"] / math.prod(row[f"box_{axis}"] for axis in "xyz") for row in rows]
    return np.array([mean[1:], ideal[:-1], ideal[1:]])


class LargerBox(sand.Updater):
    """Sets a box below 3.89 µm to 4.4 µm."""

    every = "7 ns"

    def act(self, simulation):
        if simulation.box.lengths[0] < 3.89e-6:
            with simulation.change() as change:
                change.box = "4.4 um"


@pytest.mark.filterwarnings("ignore:grains .* overlap by")
def test_no_mean_pressure_is_taken_over_a_change_or_a_reversal():
    """The mean of a row of a gas lies between 2K/3V at its ends; without a mean it is that of the moment.

    A box that is set to a larger one between two rows does no work by that.  In the row in which the strain turns, the
    strains cancel and the work does not in general.  After a change of the rates at a row, the next row is a mean.
    """
    sim = ideal_gas(sand.Deformation("-1e6 1/s"), updaters=[LargerBox()])
    sim.run(until="80 ns")
    mean, before, now = pressures_of(sim.ledger.rows)
    changed = np.diff([row["box_x"] for row in sim.ledger.rows]) > 0.0
    assert changed.sum() == 1 and mean[changed] == pytest.approx(now[changed], rel=1e-9, abs=0.0)
    assert (before < mean)[~changed].all() and (mean < now)[~changed].all()

    ramp = sand.Ramp(["-1e6 1/s", "1e6 1/s"], [0, "100 ns"], steps=100)
    sim = ideal_gas(sand.Deformation(ramp))
    sim.run(until="100 ns")
    mean, before, now = pressures_of(sim.ledger.rows)
    assert mean[2] == pytest.approx(now[2], rel=1e-9, abs=0.0)
    assert (np.minimum(before, now) < mean)[[0, 1, 3, 4]].all() and (mean < np.maximum(before, now))[[0, 1, 3, 4]].all()
    with sim.change() as change:
        change.deformation = sand.Deformation("-1e6 1/s")
    sim.run(until="120 ns")
    mean, before, now = pressures_of(sim.ledger.rows)
    assert before[-1] < mean[-1] < now[-1]


def test_a_gas_without_contacts_is_compressed_adiabatically():
    """K ∝ L⁻² and P = 2K/3V at each moment, lost_box the change of K; to rounding, as the drift is exact."""
    rng = np.random.default_rng(5)
    grains = sand.Grains(rng.uniform(-1e-6, 1e-6, (30, 3)), RADIUS, ICE, velocity=rng.normal(size=(30, 3)))
    sim = sand.Simulation(grains, [], box="4 um", deformation=sand.Deformation("-1e6 1/s"))
    sim.run(until="0.3 us")
    first, last = sim.ledger.rows[0], sim.ledger.rows[-1]
    assert last["box_x"] == pytest.approx(4e-6 * math.exp(-0.3), rel=1e-3, abs=0.0)
    ratio = (first["box_x"] / last["box_x"]) ** 2
    assert last["translation"] == pytest.approx(first["translation"] * ratio, rel=1e-11, abs=0.0)
    assert last["total"] == pytest.approx(first["total"], rel=1e-11, abs=0.0)
    pressures = [first[f"mean_pressure_{axis}"] for axis in "xyz"]
    assert sum(pressures) / 3.0 == pytest.approx(
        2.0 / 3.0 * first["translation"] / first["box_x"] ** 3, rel=1e-12, abs=0
    )
    velocity = sim.grains.velocity + sim.grains.position @ sim.strain_rate
    assert not np.allclose(velocity, sim.grains.velocity, rtol=1e-3)


def test_rates_of_0_give_the_bits_of_a_run_without_a_deformation():
    """All arrays but those of the box; and steps of the moving box at a rate that is still 0 agree to rounding.

    Errors of rounding, 1e-16 r, grow in the motion of damped contacts by less than a factor of 1e5 in 400 steps.
    """
    later = sand.Deformation(sand.Ramp(["0 1/s", "-1e6 1/s"], ["1 s", "2 s"]))
    one, two, three = packing(None), packing(0.0), packing(later)
    for sim in (one, two, three):
        with sim.change() as change:
            change.velocity[:20, 0] += 0.5
        sim.run(steps=400)
    bits = arrays_of(two)
    assert arrays_of(one) == {name: bits[name] for name in arrays_of(one)}
    assert {name for name in bits if name not in arrays_of(one)} == {f"cell/{name}" for name in sim.state.cell._fields}
    assert three.box == one.box and three.ledger["lost_box"][-1] == 0.0
    assert three.grains.position == pytest.approx(one.grains.position, rel=0.0, abs=1e-11 * RADIUS)


def test_interruptions_and_output_change_no_bit(tmp_path):
    """A run with frames between its steps, one without, a copy, and one that continues from a checkpoint.

    With rates that a ramp changes; the box of a frame is that of its time.
    """
    rate = sand.Deformation(sand.Ramp([["-2e6 1/s", "1e6 1/s", 0], 3 * ["-1e6 1/s"]], [0, "0.1 us"], steps=7))
    one, often, first = packing(rate), packing(rate, frame_every="0.37 ns"), packing(rate, out=tmp_path / "run")
    one.run(steps=5000)
    often.run(steps=5000)
    first.run(until="31.234567 ns")
    other = first.copy()
    again = packing(rate, restart=newest_checkpoint(tmp_path / "run", components.groups()))
    assert again.box == first.box and again.box.lengths[0] < one.start.position.max() * 10
    for sim in (other, again):
        sim.run(steps=5000 - sim.steps)
    assert arrays_of(one) == arrays_of(often) == arrays_of(other) == arrays_of(again)
    resumed = sand.resume(tmp_path / "run")
    resumed.run(steps=5000 - resumed.steps)
    assert arrays_of(resumed) == arrays_of(one) and resumed.deformation == rate
    frames = sand.open(tmp_path / "run").frames
    assert frames[0].box == sand.Box.periodic(one.ledger.rows[0]["box_x"]) and frames[-1].box == resumed.box


@pytest.mark.parametrize("rate", [["2e7 1/s", "2e7 1/s", "2e7 1/s"], ["2e7 1/s", "-2e7 1/s", 0]])
def test_lists_are_rebuilt_at_the_same_steps_with_frequent_output(rate):
    """Also where the box grows, and with it displacements: skins are bounds, and are set anew at each output."""
    one, often = packing(rate, number=20), packing(rate, number=20, frame_every="0.1 ns")
    built = []
    for _ in range(12):
        for sim in (one, often):
            sim.run(steps=100)
        built.append(one.state.pair_list.built.tolist())
        assert arrays_of(one) == arrays_of(often)
    assert len({tuple(lengths) for lengths in built}) > 2


@pytest.mark.filterwarnings("ignore:.*contacts broke while aggregates grew", "ignore:grains overlap too deeply")
@pytest.mark.parametrize("search", ["cells", "all pairs"])
def test_lists_are_complete_while_the_box_shrinks(search):
    """After each of some calls, all pairs that overlap are contacts, found by brute force; the box shrinks by half.

    The rate is so high that the flow alone brings grains together: |A| L is 40 m/s.
    """
    rng = np.random.default_rng(8)
    grid = np.stack(np.meshgrid(*[np.arange(4) - 1.5] * 3, indexing="ij"), -1).reshape(-1, 3)
    grains = sand.Grains(grid[:60] * 4e-7 + rng.uniform(-5e-8, 5e-8, (60, 3)), RADIUS, ICE)
    search = sand.Neighbours(search)
    sim = sand.Simulation(grains, [DAMPED], box="1.6 um", deformation=sand.Deformation("-2.5e7 1/s"), neighbours=search)
    touching = set()
    while sim.box.lengths[0] > 0.75e-6:
        sim.run(steps=20)
        i, j = np.triu_indices(60, 1)
        apart = np.linalg.norm(sim.box.nearest(sim.grains.position[i] - sim.grains.position[j]), axis=1)
        touching = {tuple(pair) for pair in np.stack([i, j], 1)[apart < 2.0 * RADIUS].tolist()}
        assert touching <= {tuple(sorted(pair)) for pair in sim.contacts["pair"].tolist()}
    assert len(touching) > 60


def test_the_run_ends_before_a_grain_has_two_images_in_reach():
    """A box may not become smaller than 2 (2 r + r): with one more contact of a pair its forces would be unknown."""
    sim = packing("-3e7 1/s", number=4, side=9e-7)
    result = sim.run(until="1 us")
    assert result.outcome is sand.Outcome.BOX_TOO_SMALL
    # the next step would strain the box by at most 1e-3
    assert 6.0 * RADIUS <= sim.box.lengths[0] <= 6.0 * RADIUS / (1.0 - 1e-3)


def test_a_pressure_is_reached_and_kept():
    """Two axes follow a pressure each: a lattice, with a space along z, comes to 1 MPa along both, and stays there.

    At rest the pressure is Σ l_a f_a/V of the contacts alone, from `sim.contacts`.  Rates never exceed the largest one,
    and the axis with the rate 0 keeps its length.
    """
    grid = np.stack(np.meshgrid(np.arange(4.0), np.arange(4.0), np.arange(3.0), indexing="ij"), -1).reshape(-1, 3)
    grains = sand.Grains((grid - grid.mean(0)) * 1.998 * RADIUS, RADIUS, ICE)
    law = sand.Deformation(["1e6 1/s", "1e6 1/s", 0], law="pressure", pressure="1 MPa", time="1 ns")
    box = sand.Box.periodic(8.0 * RADIUS, 8.0 * RADIUS, 9.0 * RADIUS)
    sim = sand.Simulation(grains, [DAMPED], box=box, deformation=law, row_every="5 ns")
    sim.run(until="0.2 us")
    pair, x = sim.contacts["pair"], sim.grains.position
    branch = sim.box.nearest(x[pair[:, 0]] - x[pair[:, 1]])
    pressure = (branch * sim.contacts["force"]).sum(axis=0) / sim.box.volume
    assert pressure[:2] == pytest.approx([1e6, 1e6], rel=0.02, abs=0.0) and abs(pressure[2]) < 1e4
    rows = sim.ledger.rows
    lengths = np.array([row["box_x"] for row in rows])
    assert np.abs(np.diff(np.log(lengths))).max() <= 1.001e6 * 5e-9 and sim.box.lengths[2] == 9.0 * RADIUS
    assert rows[-1]["mean_pressure_x"] == pytest.approx(1e6, rel=0.05, abs=0.0)
    work = sum(abs(b["lost_box"] - a["lost_box"]) for a, b in itertools.pairwise(rows))
    error = (
        1e-2 * rows[-1]["lost_forming"] + 1e-4 * work
    )  # of 24 touches at once in steps of 1/25 period, and of the work
    assert rows[-1]["total"] == pytest.approx(rows[0]["total"], abs=error)


def test_a_change_sets_the_rate_and_the_box():
    """New rates begin at the change; a box that is changed goes on from its new lengths, with the same contacts."""
    sim = packing(0.0, number=12, side=2.4e-6)
    sim.run(steps=50)
    assert not sim.strain_rate.any()
    with sim.change() as change:
        change.deformation = sand.Deformation(["1e5 1/s", 0, "-1e5 1/s"])
    sim.run(steps=50)
    assert np.diag(sim.strain_rate) == pytest.approx([1e5, 0.0, -1e5], rel=1e-12, abs=0.0)
    assert sim.box.lengths[0] > sim.box.lengths[1] == 2.4e-6 > sim.box.lengths[2]
    contacts = len(sim.contacts["pair"])
    with sim.change() as change:
        change.box = "2.6 um"
    assert sim.box == sand.Box.periodic("2.6 um") and len(sim.contacts["pair"]) == contacts
    sim.run(steps=50)
    assert sim.box.lengths[0] > 2.6e-6 and len(sim.contacts["pair"]) == contacts
    sim.run(steps=1)  # not a multiple of the steps between two sums of the virial
    work = sim.present_ledger["work_x"][-1]
    with sim.change() as change:
        change.deformation, change.velocity[:6, 0] = sand.Deformation(0), 0.5
    assert sim.present_ledger["work_x"][-1] == pytest.approx(work, rel=1e-12, abs=0.0)
    sim.run(steps=25)
    assert sim.present_ledger["work_x"][-1] == pytest.approx(work, rel=1e-12, abs=0.0)
    with pytest.raises(sand.BadInput, match=r"give sand\.Deformation\(0\)"), sim.change() as change:
        change.deformation = None


@pytest.mark.validate
def test_a_gas_moves_with_the_box():
    """Drag acts on velocities relative to the flow: their energy is that in a box at rest, times (L₀/L)².

    Kicks and drifts commute, as both are factors of velocities.  The ledger closes with `lost_gas`.
    """
    gas, ends = sand.Gas("300 K", pressure="1 kPa", brownian=False), []
    rng = np.random.default_rng(5)
    grains = sand.Grains(rng.uniform(-1e-6, 1e-6, (30, 3)), RADIUS, ICE, velocity=0.01 * rng.normal(size=(30, 3)))
    step = gas.shortest_time(grains) / 200
    for rate in (0.0, -3e3):
        law = sand.Deformation(rate)
        sim = sand.Simulation(grains, [gas], box="4 um", deformation=law, stepping=sand.Verlet(step=step))
        sim.run(steps=200)
        ends.append(sim.ledger.rows[-1])
        assert sim.ledger["total"][-1] == pytest.approx(sim.ledger["total"][0], rel=1e-9, abs=0.0)
    still, moved = ends
    assert still["lost_gas"] > 0.5 * still["translation"] and moved["box_x"] < 0.9 * still["box_x"]
    expected = still["translation"] * (still["box_x"] / moved["box_x"]) ** 2
    assert moved["translation"] == pytest.approx(expected, rel=1e-9, abs=0.0)


@pytest.mark.validate
def test_threads_change_no_bit():
    """5000 grains, in several blocks: the same bits with 1, 2 and 3 threads, those of the box included.

    Contacts form at all faces, slide and roll.  With grains along a curve, contacts that form in one step take their
    impulses in another order: errors of second order of the step, so that the work agrees to 1e-4.
    """
    grid = np.stack(np.meshgrid(*[np.arange(17.0) - 8.0] * 3, indexing="ij"), -1).reshape(-1, 3) * 2.001 * RADIUS
    velocity = np.random.default_rng(4).normal(size=grid.shape)
    ends = []
    for threads, order in ((1, "as given"), (2, "as given"), (3, "as given"), (2, "curve")):
        sand.set_threads(threads)
        sim = sand.Simulation(
            sand.Grains(grid, RADIUS, ICE, velocity=velocity), [DAMPED], box=17 * 2.001 * RADIUS,
            deformation=sand.Deformation("-1e6 1/s"), neighbours=sand.Neighbours(order=order),
        )  # fmt: skip
        sim.run(steps=150)
        ends.append(sim)
    sand.set_threads(None)
    assert ends[0].state.count[MADE] > 1000 and ends[0].ledger["lost_rolling"][-1] > 0.0
    assert arrays_of(ends[0]) == arrays_of(ends[1]) == arrays_of(ends[2])
    assert ends[3].ledger["lost_box"][-1] == pytest.approx(ends[0].ledger["lost_box"][-1], rel=1e-4, abs=0.0)


@pytest.mark.validates("self-consistency", "The energy balance of a compression from φ = 0.01 to 0.5 closes")
@pytest.mark.validate
def test_a_long_compression_closes_the_ledger(record_bound):
    """256 grains from φ = 0.01 to 0.5, with sliding and breaking: the error of the ledger is below 1e-4 of the work."""
    sim = packing("-2e6 1/s", number=256, row_every="20 ns")
    sim.run(stop="filling > 0.5", until="2 us")
    first, last = sim.ledger.rows[0], sim.ledger.rows[-1]
    assert last["filling"] >= 0.5 and min(last["broken"], last["lost_sliding"], last["lost_twisting"]) > 0.0
    error = abs(last["total"] - first["total"]) / abs(last["lost_box"])
    record_bound("error of the ledger over the work, φ 0.01 to 0.5", error, most=1e-4)


def test_a_fixed_step_that_strains_the_box_too_much_is_refused():
    """Grains that the flow brings together would pass each other: 2e-11 s times 1e8 1/s is 2e-3, above 1e-3."""
    with pytest.raises(
        sand.BadInput, match=r"a step of 2e-11 s strains the box by more than 0\.001; use step = 'auto'"
    ):
        packing("-1e8 1/s", number=12, stepping=sand.Verlet(step=2e-11))
    packing("-1e7 1/s", number=12, stepping=sand.Verlet(step=2e-11))


def test_a_fixed_step_ends_where_the_strain_of_a_step_becomes_too_large():
    """Linear law: a step of h strains a side L by r h L₀/L, 8e-4 at first, and 1e-3 where L = 0.8 L₀, t = 0.2/r.

    The step at L = 0.8 L₀ (1 + x), |x| ≤ 8e-4, is the last.
    """
    rate, h = 4e7, 2e-11
    sim = packing(sand.Deformation(f"-{rate} 1/s", law="linear"), number=12, stepping=sand.Verlet(step=h))
    side = sim.box.lengths[0]
    result = sim.run(until=0.5 / rate)
    assert result.outcome is sand.Outcome.STRAINED_TOO_FAST
    assert sim.box.lengths[0] / side == pytest.approx(0.8, abs=8e-4)


def test_copies_have_boxes_of_their_own():
    """A deep copy and the original, each run further, are independent and equal to the last bit."""
    sim = packing("-1e6 1/s", number=12, side=2.4e-6)
    sim.run(until="3.21 ns")
    other = copy.deepcopy(sim)
    at_copy, box = arrays_of(other), other.box
    sim.run(steps=100)
    assert arrays_of(other) == at_copy != arrays_of(sim) and other.box == box != sim.box
    other.run(steps=100)
    assert arrays_of(other) == arrays_of(sim)
