"""Simple shear of a periodic box: Newton's law in the laboratory, work, lists, images, interrupted runs."""

import itertools
import math

import numpy as np
import pytest

import sand
from sand import components
from sand.basics.box import Box
from sand.basics.state import BROKEN, MADE, SLIPPED, STEP, TILT
from sand.components.deformation_stage import wrap_tilt
from sand.engine.measures import contact_energies
from sand.io.checkpoint import newest_checkpoint
from sand.numerics.flow import carried, strain_since

from .test_deformation import DAMPED, ICE, RADIUS, arrays_of, colliding_bodies
from .test_stress import lattice, slope

pytestmark = pytest.mark.compiled("shear", "contacts")
RATE = sand.Deformation(shear="5e6 1/s")


@pytest.mark.validates("self-consistency", "Bodies that collide in a box that is sheared move as in an open box")
@pytest.mark.parametrize(("rates", "shear"), [([0, 0, 0], -5e7), ([-7e6, 5e6, -2.5e6], 5e7)])
def test_free_bodies_move_as_in_an_open_box(rates, shear, record_bound):
    """Two bodies collide across edges of a box that is sheared by 2, and stretched: the motion is that of an open box.

    The velocities u + A x of the laboratory obey Newton's law, and with dH/dt constant images move at constant
    velocities.  Grains pass all faces, and the tilt is wrapped twice.  Positions differ by rounding, which grows in
    5000 steps, as contacts form, roll, twist and are damped in all modes.
    """
    bodies, box, until = colliding_bodies(), Box.periodic("3 um", "2.6 um", "2.8 um"), 4e-8
    motion = bodies.velocity + np.array([5.0, -10.0, 20.0])
    grains = sand.Grains(bodies.position, bodies.radius, ICE, velocity=motion, spin=bodies.spin)
    lengths, rate = np.array(box.lengths), np.diag(np.asarray(rates, float))
    rate[0, 2] = shear
    flow, moved = np.eye(3) + until * rate, 0.49 * lengths
    probe = sand.Simulation(grains, [DAMPED])
    probe.run(steps=1)
    stepping = sand.Verlet(step=0.6 * probe.state.clock[STEP])  # no step strains the box by more than 1e-3
    free = sand.Simulation(grains, [DAMPED], stepping=stepping)
    position = grains.position + moved
    images, velocity = box.image(position), grains.velocity - grains.position @ rate.T
    placed = sand.Grains(box.wrap(position), grains.radius, ICE, velocity=velocity, spin=grains.spin)
    law = sand.Deformation(rates, law="linear", shear=shear)
    sim = sand.Simulation(placed, [DAMPED], box=box, deformation=law, stepping=stepping)
    for each in (free, sim):
        each.run(until=until)
    sides = np.diag(lengths)
    expected = flow @ sides  # the lattice, with a tilt of several sides
    assert sim.box.lengths == pytest.approx(np.diag(expected), rel=1e-12, abs=0.0)
    turns = (sim.box.tilt - expected[0, 2]) / sim.box.lengths[0]
    assert abs(turns) > 1.5 and turns == pytest.approx(round(turns), rel=0.0, abs=1e-10)
    whole = sim.grains.position + sim.box.shift(sim.grains.image) + images @ expected.T - moved @ flow.T
    error = np.abs(whole - free.grains.position).max() / RADIUS
    assert sim.grains.image.any(axis=0).all()
    record_bound(f"error in radii, shear {shear:g}", error, most=1e-8)
    counts = [[each.state.count[k] for k in (MADE, BROKEN, SLIPPED)] for each in (sim, free)]
    assert counts[0] == counts[1] and counts[0][0] > 3
    one, two = (each.ledger.rows[-1] for each in (sim, free))
    for name in ("lost_forming", "lost_rolling", "lost_twisting", "lost_damping_normal", "lost_damping_rolling"):
        assert one[name] == pytest.approx(two[name], rel=1e-8, abs=0.0) and one[name] > 0.0, name


def test_free_grains_at_high_shear():
    """Without forces u_x = u_x0 − γ u_z: the energy that the grains gain is ½ Σ m (u_x² − u_x0²), and the work.

    Momentum relative to the flow goes as F⁻¹: it stays 0.  The first row has −P_zx = −Σ m u_z u_x/V.
    """
    rng = np.random.default_rng(5)
    velocity = rng.normal(size=(30, 3))
    velocity -= velocity.mean(axis=0)
    grains = sand.Grains(rng.uniform(-1e-6, 1e-6, (30, 3)), RADIUS, ICE, velocity=velocity)
    sim = sand.Simulation(grains, [], box="4 um", deformation=sand.Deformation(shear="5e7 1/s"), row_every="10 ns")
    sim.run(until="0.1 us")
    first, last = sim.ledger.rows[0], sim.ledger.rows[-1]
    assert last["shear"] == pytest.approx(5.0, rel=2e-3, abs=0.0)
    moved = velocity - last["shear"] * velocity[:, 2:] * [1.0, 0.0, 0.0]
    assert sim.grains.velocity == pytest.approx(moved, rel=0.0, abs=1e-11)
    gained = 0.5 * float(grains.mass @ (moved**2 - velocity**2).sum(axis=1))
    assert last["translation"] - first["translation"] == pytest.approx(gained, rel=1e-10, abs=0.0)
    assert last["work_shear"] == -last["lost_box"] == pytest.approx(gained, rel=1e-10, abs=0.0)
    flux = float(grains.mass @ (velocity[:, 0] * velocity[:, 2]))
    assert first["mean_shear_stress"] == pytest.approx(-flux / sim.box.volume, rel=1e-10, abs=0.0)
    stresses = [row["mean_shear_stress"] for row in sim.ledger.rows[1:]]
    strains = np.diff([row["shear"] for row in sim.ledger.rows])
    assert sim.box.volume * float(strains @ stresses) == pytest.approx(gained, rel=1e-9, abs=0.0)
    assert np.abs(sim.grains.mass @ sim.grains.velocity).max() < 1e-12 * sim.grains.mass.sum()
    laboratory = sim.grains.velocity + sim.grains.position @ sim.strain_rate.T
    assert laboratory[:, 0] == pytest.approx(moved[:, 0] + 5e7 * sim.grains.position[:, 2], rel=0.0, abs=1e-9)


def sheared_engine(sim, strain):
    """The engine of a copy whose positions and box are sheared by a strain, at fixed orientations and contacts."""
    engine = sim.copy()._engine
    state = engine.regular_state
    state.grains.arrays.position[0] += strain * state.grains.arrays.position[2]
    state.cell.span[TILT] += strain * state.cell.span[2]
    return engine


@pytest.mark.filterwarnings("ignore:.*contacts broke")
def test_the_virial_is_the_derivative_of_the_energy():
    """W_zx = −dU/dγ at fixed orientations, in a tilted box, of contacts across its faces; to 1e-8 of Σ |l f|.

    Differences of fourth order with steps of 1e-7, see `test_stress`.
    """
    gas = sand.setup.gas(40, 1.1e-6, radius=[1e-7, 1.4e-7] * 20, material=ICE, seed=4)
    velocity = 2.0 * np.random.default_rng(4).normal(size=(40, 3))
    grains = sand.Grains(gas.position, gas.radius, ICE, velocity=velocity)
    sim = sand.Simulation(grains, [sand.Contact()], box=1.1e-6, deformation=sand.Deformation(shear="2e7 1/s"))
    sim.run(steps=2500)
    stress, table = sim.stress(), sim.contacts
    pair, x = table["pair"].astype(int), sim.grains.position
    across = np.abs(x[pair[:, 0], 2] - x[pair[:, 1], 2]) > 5.5e-7
    assert abs(sim.box.tilt) > 1e-8 and across.sum() > 1
    size = np.abs(sim.box.nearest(x[pair[:, 0]] - x[pair[:, 1]]) * table["force"]).sum()
    values = [math.fsum(contact_energies(sheared_engine(sim, k * 1e-7))) for k in (-2, -1, 1, 2)]
    found = stress.parts["contacts"][2, 0] * stress.volume
    assert abs(found) > 1e-3 * size
    assert found == pytest.approx(-slope(values, 1e-7), rel=0.0, abs=1e-8 * size)


def test_a_crystal_sheared_there_and_back():
    """A simple cubic crystal within its limits: the work is its energy at each row, and 0 at the end.

    Grains do not rotate with the box at once, so that spins vibrate: their energy is a share (γ̇/ω)² of that of shear.
    """
    one = sand.theory.contact(ICE, RADIUS)
    d = 2.0 * RADIUS - one.rest_overlap
    start = lattice([[0, 0, 0]], (4, 4, 4), 3 * [d]).grains
    rates, times = ["0 1/s", "2e4 1/s", "0 1/s", "-2e4 1/s", "0 1/s"], ["0 s", "10 ns", "20 ns", "30 ns", "40 ns"]
    law = sand.Deformation(shear=sand.Ramp(rates, times, steps=200))
    box = 3 * [4 * d]
    sim = sand.Simulation(start, [sand.Contact()], box=box, deformation=law, row_every="2 ns")
    sim.run(until="40 ns")
    rows = sim.ledger.rows
    largest = max(row["work_shear"] for row in rows)
    assert largest > 0.0 and rows[-1]["moved"] == 0
    assert max(row["shear"] for row in rows) == pytest.approx(2e-4, rel=1e-2, abs=0.0)
    assert abs(rows[-1]["work_shear"]) < 1e-2 * largest and abs(rows[-1]["shear"]) < 1e-7
    for row in rows:
        assert row["total"] == pytest.approx(rows[0]["total"], rel=0.0, abs=1e-4 * largest)


def packing(deformation, filling=0.25, number=60, **options):
    """A percolating packing of ice grains: an aggregate in a cube, compressed to a filling factor, then deformed."""
    body = sand.setup.bcca(number, radius=RADIUS, material=ICE, seed=1)
    x = body.position - 0.5 * (body.position.min(0) + body.position.max(0))
    box = Box.periodic(float(np.ptp(x, axis=0).max() + 2.1 * RADIUS))
    first = sand.Simulation(sand.Grains(x, RADIUS, ICE), [DAMPED], box=box, deformation=sand.Deformation("-3e6 1/s"))
    first.run(stop=f"filling > {filling}", until="2 us")
    grains = sand.Grains(first.grains.position, RADIUS, ICE)
    return sand.Simulation(grains, [DAMPED], box=first.box, deformation=deformation, **options)


@pytest.mark.validates("self-consistency", "The work of shear closes the energy balance of a packing")
@pytest.mark.filterwarnings("ignore:.*contacts")
def test_the_work_of_shear_closes_the_ledger(record_bound):
    """A packing that percolates, sheared by 2.2: contacts form, break, slide, roll and twist; three wraps of the tilt.

    The total of the ledger changes by less than 1e-4 of the work, and Σ_rows τ V Δγ is the work.  Momentum stays 0.
    """
    sim = packing(RATE, row_every="20 ns")
    sim.run(until="0.44 us")
    rows = sim.ledger.rows
    work, modes = rows[-1]["work_shear"], ("forming", "breaking", "sliding", "rolling", "twisting", "damping_normal")
    assert rows[-1]["shear"] == pytest.approx(2.2, rel=1e-4, abs=0.0) and work > 0.0
    assert min(rows[-1][f"lost_{mode}"] for mode in modes) > 0.0 and rows[-1]["work_x"] == 0.0
    tilts = np.array([row["tilt"] for row in rows])
    assert (np.diff(tilts) < 0.0).sum() >= 2 and np.abs(tilts).max() <= 0.5 * sim.box.lengths[0]
    assert sand.analysis.clusters.percolation_axes(sim.grains.position, sim.contacts["pair"], sim.box).any()
    record_bound("error of the ledger over the work", abs(rows[-1]["total"] - rows[0]["total"]) / work, most=1e-4)
    mean = sum(b["mean_shear_stress"] * (b["shear"] - a["shear"]) for a, b in itertools.pairwise(rows))
    assert mean * sim.box.volume == pytest.approx(work, rel=1e-9, abs=0.0)
    assert np.abs(sim.grains.mass @ sim.grains.velocity).max() < 1e-9 * float(sim.grains.mass.sum())


def test_no_place_in_the_box_is_special():
    """All positions shifted by a vector at the start: the same contacts and work, to rounding in 1500 steps."""
    ends = []
    for shift in ([0.0, 0.0, 0.0], [2.1e-7, -3.3e-7, 4.7e-7]):
        sim = packing(None)
        grains = sand.Grains(sim.box.wrap(sim.grains.position + np.array(shift)), RADIUS, ICE)
        sim = sand.Simulation(grains, [DAMPED], box=sim.box, deformation=RATE)
        sim.run(steps=1500)
        ends.append((sim, sim.ledger.rows[-1]))
    (one, a), (two, b) = ends
    assert a["contacts"] == b["contacts"] and a["made"] == b["made"] > 0
    for name in ("work_shear", "lost_rolling", "lost_damping_normal", "normal"):
        assert a[name] == pytest.approx(b[name], rel=1e-7, abs=0.0) and a[name] != 0.0, name
    apart = one.grains.position - two.grains.position
    apart = one.box.nearest(apart - apart[0])
    assert np.abs(apart - apart[0]).max() < 1e-7 * RADIUS


def test_wrapping_the_tilt_changes_nothing():
    """The images of all grains stay where they are, and so does where the flow has carried the anchors of lists."""
    sim = packing(RATE, number=12, filling=0.02)
    sim.run(steps=60)
    state = sim.copy().regular_state
    cell, side = state.cell, state.box.lengths[0]
    state.grains.arrays.image[...] = np.random.default_rng(1).integers(-3, 4, (3, 12))
    cell.span[9] += 3.0 * side
    state.pair_list.built[3] += 3.0 * side
    state.grains.arrays.image[0] -= 3 * state.grains.arrays.image[2]
    image, built = state.grains.arrays.image.copy(), state.pair_list.built.copy()

    def places():
        span = sim.box.moving_span(sheared=True)._replace(tilt=cell.span[9])
        x, n = state.grains.arrays.position.T, state.grains.arrays.image.T
        whole = x + n * span[:3] + n[:, 2:] * [cell.span[9], 0.0, 0.0]
        anchors = [carried(tuple(each), state.pair_list.built, span) for each in state.pair_list.anchor.T]
        return whole, np.array(anchors), strain_since(state.pair_list.built, span)

    before = places()
    wrap_tilt(state.grains.arrays, state.pair_list, state.long_range, cell, side)
    assert (state.grains.arrays.image != image).any() and state.pair_list.built[3] != built[3]
    assert cell.span[9] == pytest.approx(sim.box.tilt, rel=0.0, abs=1e-15 * side)
    for one, two in zip(before, places(), strict=True):
        assert one == pytest.approx(two, rel=0.0, abs=1e-14)


def test_frames_and_restarts(tmp_path):
    """A run with frames between its steps, one without, a copy, and one from a checkpoint have the same bits.

    Rates follow ramps, the pressure along each axis is followed in addition.  The box of a frame is that of its time,
    and positions without jumps at faces, nor where the tilt is wrapped, move by less than a radius between two frames.
    """
    shear = sand.Ramp(["2e7 1/s", "4e7 1/s"], [0, "0.05 us"], steps=7)
    law = sand.Deformation("1e6 1/s", law="pressure", pressure="1 kPa", time="5 ns", shear=shear)
    place = tmp_path / "run"
    one, often = packing(law, 0.02, 12), packing(law, 0.02, 12, frame_every="0.37 ns")
    first = packing(law, 0.02, 12, out=place, frame_every="0.5 ns")
    one.run(steps=4000)
    often.run(steps=4000)
    first.run(until="31.234567 ns")
    other, again = first.copy(), packing(law, 0.02, 12, restart=newest_checkpoint(place, components.groups()))
    assert again.box == first.box and again.box.tilt
    for sim in (other, again):
        sim.run(steps=4000 - sim.steps)
    assert arrays_of(one) == arrays_of(often) == arrays_of(other) == arrays_of(again)
    resumed = sand.resume(place)
    assert resumed.deformation == law
    resumed.run(steps=4000 - resumed.steps)
    assert arrays_of(resumed) == arrays_of(one)
    frames = sand.open(place).frames
    tilts = np.array([frame.box.tilt for frame in frames])
    assert frames[-1].box == resumed.box and (np.diff(tilts) < 0.0).sum() >= 1
    unwrapped = np.array([frame.unwrapped for frame in frames])
    flow = (
        np.diff(unwrapped, axis=0)
        - np.diff([frame.time for frame in frames])[:, None, None]
        * np.array([unwrapped[:-1, :, 2], 0 * unwrapped[:-1, :, 2], 0 * unwrapped[:-1, :, 2]]).transpose(1, 2, 0)
        * 4e7
    )
    assert np.abs(flow).max() < RADIUS
    start = sand.setup.from_frame(frames[-1], {ICE.name: ICE})
    assert start.box == resumed.box
    goes_on = sand.Simulation(start.grains, [DAMPED], box=start.box, contacts=start.contacts)
    assert goes_on.box.tilt == resumed.box.tilt and len(goes_on.contacts["pair"]) == len(resumed.contacts["pair"])
    goes_on.run(steps=20)


@pytest.mark.filterwarnings("ignore:.*contacts broke while aggregates grew", "ignore:grains overlap too deeply")
@pytest.mark.parametrize("search", ["cells", "all pairs"])
def test_lists_are_complete_in_a_sheared_box(search):
    """After each of some calls, all pairs that overlap are contacts, found by brute force over 75 images; strain 2.

    The rate is so high that the flow brings grains together: γ̇ L is 33 m/s.
    """
    grains = sand.setup.gas(60, "1.3 um", radius=RADIUS, material=ICE, seed=8)
    given = {"deformation": sand.Deformation(shear="2.5e7 1/s"), "neighbours": sand.Neighbours(search)}
    sim = sand.Simulation(grains, [DAMPED], box="1.3 um", **given)
    i, j = np.triu_indices(60, 1)
    images = np.stack(np.meshgrid(np.arange(-2, 3), [-1, 0, 1], np.arange(-2, 3), indexing="ij"), -1).reshape(-1, 1, 3)
    seen = set()
    while sim.state.cell.shear[0] < 2.0:
        sim.run(steps=40)
        x = sim.grains.position
        apart = np.linalg.norm(x[i] - x[j] + sim.box.shift(images), axis=2).min(axis=0)
        touching = {tuple(pair) for pair in np.stack([i, j], 1)[apart < 2.0 * RADIUS].tolist()}
        assert touching <= {tuple(sorted(pair)) for pair in sim.contacts["pair"].tolist()}
        seen |= touching
    assert len(seen) > 12


def test_lists_are_rebuilt_at_the_same_steps_with_frequent_output():
    """Also where the tilt is wrapped: the tilt of the box when the list was built is wrapped with it."""
    law = sand.Deformation(shear="4e7 1/s")
    one, often = packing(law, 0.02, 12), packing(law, 0.02, 12, frame_every="0.1 ns")
    built = []
    for _ in range(20):
        for sim in (one, often):
            sim.run(steps=100)
        built.append(one.state.pair_list.built.tolist())
        assert arrays_of(one) == arrays_of(often)
    assert len({tuple(lengths) for lengths in built}) > 2 and one.state.cell.shear[0] > 0.6


def test_changes_of_the_shear():
    """Shear begins where it has columns, which a rate of 0 at the start gives."""
    sim = packing(sand.Deformation(shear=0), number=12, filling=0.02)
    sim.run(steps=50)
    assert not sim.strain_rate.any() and sim.box.tilt == 0.0
    with sim.change() as change:
        change.deformation = sand.Deformation(shear="1e7 1/s")
    sim.run(steps=53)
    assert sim.strain_rate[0, 2] == 1e7 and sim.box.tilt > 0.0
    work = sim.present_ledger["work_shear"][-1]
    with sim.change() as change:
        change.deformation = sand.Deformation(0)
    tilt = sim.box.tilt
    sim.run(steps=25)
    assert sim.box.tilt == tilt and sim.present_ledger["work_shear"][-1] == pytest.approx(work, rel=1e-12, abs=0.0)
    other = packing(sand.Deformation(0), number=12, filling=0.02)
    other.run(steps=5)
    with pytest.raises(sand.BadInput, match="no column for tilt, shear, work_shear"), other.change() as change:
        change.deformation = sand.Deformation(shear="1e7 1/s")


def test_images_keep_their_velocity_as_a_rate_changes():
    """With law = "linear" dT/dt is constant, γ L_z at the start, while L_x shrinks; also where a ramp sets A anew.

    The ramp changes the rate along y alone, twice; T = γ L_z t, to rounding in some 1000 steps.
    """
    pair = sand.Grains([[0, 0, 0], [1e-6, 0, 0]], RADIUS, ICE)
    until, shear, side = 3e-7, 1e6, 4e-6
    ramp = sand.Ramp([[-1e6, 0.0, 5e5], [-1e6, 1e5, 5e5]], [0, until], steps=3)
    for rate in (ramp, [-1e6, 0.0, 5e5]):
        law = sand.Deformation(rate, law="linear", shear=shear)
        sim = sand.Simulation(pair, [DAMPED], box=Box.periodic(side), deformation=law)
        sim.run(until=until)
        assert sim.box.lengths[0] == pytest.approx(side * (1.0 - 0.3), rel=1e-9, abs=0.0)
        assert sim.box.tilt == pytest.approx(shear * side * until, rel=1e-9, abs=0.0)


def test_what_cannot_be_used_is_refused():
    """One line each: forces between distant grains, walls, open axes, rigid clusters; also in a tilted box at rest."""
    grains = sand.Grains([[0, 0, 0], [4e-7, 0, 0]], RADIUS, ICE, moment=[[1e-18, 0, 0]] * 2)
    forces = [sand.Contact(), sand.Dipoles(periodic="ewald", reciprocal="direct")]
    for given in ({"box": "3 um", "deformation": RATE}, {"box": Box.periodic("3 um", tilt="1 um")}):
        with pytest.raises(sand.BadInput, match="'dipoles' cannot be used"):
            sand.Simulation(grains, forces, **given)
        with pytest.raises(sand.BadInput, match=r"stepping = 'rigid-clusters' cannot be used"):
            sand.Simulation(grains, [sand.Contact()], stepping=sand.RigidClusters(), **given)
    with pytest.raises(sand.BadInput, match="axis y of the box is open"):
        sand.Simulation(grains, [sand.Contact()], box=["3 um", None, "3 um"], deformation=RATE)
    with pytest.raises(sand.BadInput, match="strains the box by more than"):
        packing(sand.Deformation(shear="1e8 1/s"), number=12, filling=0.02, stepping=sand.Verlet(step=2e-11))


@pytest.mark.validate
@pytest.mark.filterwarnings("ignore:.*broke while aggregates grew")
def test_threads_change_no_bit():
    """5000 grains in several blocks: the same bits with 1, 2 and 3 threads, while the tilt is wrapped."""
    grid = np.stack(np.meshgrid(*[np.arange(17.0) - 8.0] * 3, indexing="ij"), -1).reshape(-1, 3) * 2.001 * RADIUS
    velocity = np.random.default_rng(4).normal(size=grid.shape)
    ends = []
    for threads in (1, 2, 3):
        sand.set_threads(threads)
        sim = sand.Simulation(
            sand.Grains(grid, RADIUS, ICE, velocity=velocity), [DAMPED],
            box=Box.periodic(17 * 2.001 * RADIUS, tilt=16.99 * 1.0005 * RADIUS), deformation=RATE,
        )  # fmt: skip
        sim.run(steps=150)
        ends.append(sim)
    sand.set_threads(None)
    assert ends[0].state.count[MADE] > 1000 and ends[0].box.tilt < 0.0
    assert arrays_of(ends[0]) == arrays_of(ends[1]) == arrays_of(ends[2])
