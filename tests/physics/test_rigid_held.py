"""Rigid clusters at walls and with driven grains: motion as grain by grain, work, ledger, restart, and rest."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import sand
from sand.basics.constants import MAGNETIC
from sand.basics.state import CONTACT_STEPS, LATE, RESTED, WOKEN
from sand.integrate import task_queue

from .setups import different, rest_distance
from .test_rigid_clusters import contact, free_flights

RADIUS = 1e-8
PITCH = rest_distance(sand.IRON, RADIUS, RADIUS)
CORNER = np.array([[0.0, 0.0, 0.0], [PITCH, 0.0, 0.0], [PITCH, PITCH, 0.0]])
PLAIN = sand.Contact(damping="critical", damping_ratio=0.2)
NO_SETTLING = "ignore:without settling_time"


def tumbling(seed, count, height, speed):
    """Crooked trimers `height` [m] above z = 0 that fly down at about `speed` [m/s] and tumble, 0.5 µm apart."""
    rng, parts = np.random.default_rng(seed), []
    for k in range(count):
        shape = (CORNER - CORNER.mean(axis=0)) @ Rotation.random(random_state=rng).as_matrix()
        spin, velocity = 5e7 * rng.normal(size=3), [0.0, 0.0, -speed] + 0.3 * rng.normal(size=3)
        at = [5e-7 * (k % 16), 5e-7 * (k // 16), height]
        parts.append((at + shape, velocity + np.cross(spin, shape), np.tile(spin, (3, 1))))
    position, velocity, spin = (np.concatenate(each) for each in zip(*parts, strict=True))
    return sand.Grains(position, RADIUS, "iron", velocity=velocity, spin=spin)


def formed_at_walls(sim):
    """Times [s] at which the contacts with walls formed."""
    contacts = sim.state.of_components["wall_contacts"]
    return contacts.formed[: contacts.used[0]]


WALLS = {
    "at rest": {},
    "moving": {"velocity": [0.5, 0.0, 0.4]},
    "pressed": {"mass": "1e-18 kg", "force": "1e-11 N"},
}


@pytest.mark.filterwarnings(NO_SETTLING)
@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("wall", WALLS)
def test_a_tumbling_cluster_lands_on_a_wall_as_grain_by_grain(wall):
    """Motion of grains and wall, time and energy of the touch, and impulses, against `sand.Verlet`.

    The rotor errs by 8e-4 rad of 2e-8 m, 0.02 nm (`compare_first_touches`); the strain of the centrifugal force is
    less, m ω² s R²/k_r = 3.3e-20 kg (5e7/s)² 2e-8 m over 8 N/m, 2e-13 m.  The touch is this much earlier or later,
    2e-11 s at 1 m/s.  After it the trimer moves by at most 1 m/s, so that positions differ by twice this.  In 2e-11 s
    the forces of the touch, a few m v in a period of 1e-10 s, change the impulse by a fifth of m v; they have decayed
    long before the end, and what is left of them is compared to 1 % of m v.
    """
    ends = []
    for stepping in (sand.RigidClusters(), sand.Verlet()):
        walls = [sand.Wall([0, 0, 0], [0, 0, 1], "iron", name="floor", **WALLS[wall])]
        sim = sand.Simulation(tumbling(2, 1, 8e-8, 1.0), [PLAIN], walls=walls, stepping=stepping, frame_every=1.0)
        sim.run(until="20 ns")
        rested, pushed = sim.state.at_rest, 1e7 * (wall == "pressed")
        assert sim.ledger["wall_contacts"][-1] == 0 and (rested is None or rested.all())
        fallen = 0.5 * pushed * 2e-8**2 + WALLS[wall].get("velocity", [0.0])[-1] * 2e-8
        assert sim.walls[0].position[2] == pytest.approx(fallen, rel=1e-12, abs=0.0)
        sim.run(until="80 ns")
        ends.append((sim, sim._log_row(), sim.walls[0], formed_at_walls(sim)[0]))
    (one, row, mine, formed), (other, exact, theirs, touched) = ends
    assert row["wall_contacts"] == exact["wall_contacts"] > 0
    assert formed == pytest.approx(touched, abs=2e-11)
    np.testing.assert_allclose(one.grains.position, other.grains.position, rtol=0.0, atol=4e-11)
    np.testing.assert_allclose(mine.position, theirs.position, rtol=0.0, atol=4e-11)
    np.testing.assert_allclose(one.grains.velocity, other.grains.velocity, rtol=0.0, atol=1e-2)
    np.testing.assert_allclose(mine.impulse, theirs.impulse, rtol=0.0, atol=1e-2 * 3.0 * one.grains.mass[0])
    for name in ("lost_forming", "lost_walls"):
        assert row[name] == pytest.approx(exact[name], rel=1e-2, abs=0.0)
    for sim in (one, other):  # of velocity Verlet in 25 steps per period: (2π/25)²/8 of the energy of the touch
        assert sim.ledger.drift < (2.0 * math.pi / 25) ** 2 / 8


def compare_first_touches(seed, count):
    """Number of trimers that touch a wall: all those whose gap closes, when it closes, to 0.02 nm.

    The wall moves by 0.4 m/s towards them.  Bounds as in `test_rigid_clusters.compare_first_touches`.
    """
    step, error, closed = 5e-11, 2e-11, 3e-10
    grains, wall = tumbling(seed, count, 6e-8, 1.0), sand.Wall([0, 0, 0], [0, 0, 1], "iron", velocity=[0, 0, 0.4])
    lowest = np.array([x[..., 2].min(axis=1) for x in free_flights(grains, step, 1000)])
    gap = lowest - RADIUS - 0.4 * step * np.arange(1000.0)[:, None]
    sim = sand.Simulation(grains, [contact()], walls=[wall], stepping=sand.RigidClusters(), frame_every=1.0)
    sim.run(until=5e-8)
    assert sim.regular_state.count[LATE] == 0 and sim.regular_state.count[WOKEN] > 0
    found = np.full(count, np.inf)
    np.minimum.at(found, sim.state.held_grains() // 3, formed_at_walls(sim))
    for k in range(count):
        before = gap[: math.ceil(found[k] / step) if found[k] < math.inf else len(gap), k]
        assert before.min() > -error
        assert found[k] == math.inf or before[-1] < closed
    return np.isfinite(found).sum()


@pytest.mark.compiled("contacts")
def test_tumbling_clusters_touch_a_wall_first_where_brute_force_has_it():
    """16 tumbling trimers, 50 ns: no touch is missed or seen late, and all are where free tops have them."""
    assert compare_first_touches(1, 16) > 8


@pytest.mark.validate
@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("seed", range(2, 12))
def test_a_thousand_tumbling_clusters_touch_a_wall(seed):
    """As above, 100 of them."""
    assert compare_first_touches(seed, 100) > 50


@pytest.mark.filterwarnings(NO_SETTLING, "ignore:clusters were awake")  # of about 100,000 contact steps, the limit
@pytest.mark.compiled("dipoles")
def test_a_wall_holds_a_magnetic_chain_against_a_grain_that_pulls_it():
    """The force of the floor on a chain of two, as of a body at rest: that of the dipole above, Σ 6kμ²/r⁴.

    The grain above, of 1e-12 kg, flies as a body at rest: its pull acts on the awake chain for whole steps of bodies.
    After 40 ns vibrations have decayed.  The pull is that at the start of a step of at most 1 ns, in which the grain,
    3e-12 N/1e-12 kg · 100 ns = 3e-7 m/s fast, does not move.  Kicks between these steps would make the force of the
    floor vibrate by as much as it is.
    """
    mu, height = 6.6e-18, sand.theory.contact("iron", 2.0 * RADIUS).rest_overlap
    z = np.array([RADIUS - height, RADIUS - height + PITCH, 9.0 * RADIUS])
    grains = sand.Grains(
        np.stack([0 * z, 0 * z, z], 1), RADIUS, "iron", moment=[[0, 0, mu]] * 3, mass=[3.3e-20, 3.3e-20, 1e-12]
    )
    floor = sand.Wall([0, 0, 0], [0, 0, 1], "iron", name="floor")
    forces = [PLAIN, sand.Dipoles(cutoff=None)]
    sim = sand.Simulation(grains, forces, walls=[floor], stepping=sand.RigidClusters(), frame_every=1.0)
    sim.run(until="40 ns")
    for _ in range(5):
        sim.run(until=sim.time + 7.3e-9)
        z = sim.grains.position[:, 2]
        pull = sum(6.0 * MAGNETIC * mu**2 / (z[2] - z[k]) ** 4 for k in range(2))
        assert sim.ledger["floor_force_z"][-1] == pytest.approx(pull, rel=1e-3, abs=0.0)
        assert sim.state.at_rest.tolist() == [False, False, True]
        np.testing.assert_allclose(sim.loads()["force"][:, 2], [0.0, 0.0, -pull], rtol=0.0, atol=1e-3 * pull)


@pytest.mark.filterwarnings(NO_SETTLING)
@pytest.mark.compiled("contacts")
def test_a_tumbling_cluster_hits_a_driven_grain_as_grain_by_grain():
    """Motion, and the work of the drive, against `sand.Verlet`; the driven grain moves as prescribed.

    Bounds as for a wall.  The work is a product of the drive's velocity and the impulse.
    """
    ends = []
    for stepping in (sand.RigidClusters(), sand.Verlet()):
        free, driven = tumbling(2, 1, 8e-8, 1.0), sand.Grains([[0, 0, 0]], RADIUS, "iron")
        more = {name: np.concatenate([getattr(each, name) for each in (free, driven)]) for name in ("velocity", "spin")}
        grains = sand.Grains(np.concatenate([free.position, driven.position]), RADIUS, "iron", **more)
        driven = sand.Driven([3], velocity=[0, 0, 0.5], spin=[0, 1e7, 0])
        sim = sand.Simulation(grains, [PLAIN], driven=driven, stepping=stepping, frame_every=1.0)
        sim.run(until="20 ns")
        assert sim.state.at_rest is None or sim.state.at_rest.tolist() == [True, True, True, False]
        sim.run(until="80 ns")
        assert sim.grains.velocity[3].tolist() == [0, 0, 0.5] and sim.grains.spin[3].tolist() == [0, 1e7, 0]
        assert sim.grains.position[3, 2] == pytest.approx(0.5 * 8e-8, rel=1e-9, abs=0.0)
        ends.append((sim, sim._log_row()))
    (one, row), (other, exact) = ends
    assert row["made"] == exact["made"] > 0
    np.testing.assert_allclose(one.grains.position, other.grains.position, rtol=0.0, atol=4e-11)
    np.testing.assert_allclose(one.grains.velocity, other.grains.velocity, rtol=0.0, atol=1e-2)
    assert row["lost_outside"] == pytest.approx(exact["lost_outside"], rel=1e-2, abs=0.0) != 0.0
    assert one.ledger.drift < (2.0 * math.pi / 25) ** 2 / 8


@pytest.mark.filterwarnings(NO_SETTLING)
@pytest.mark.compiled("dipoles")
def test_work_of_a_drive_against_the_dipole_of_a_body_at_rest():
    """A grain driven towards a heavy one, head to tail: `lost_outside` is U(start) − U(end), U = −2kμ²/r³.

    The force is held for steps h, and half its change follows: the trapezoidal rule, whose error is (h v/r)² of the
    work, 1 ns · 1 m/s over 60 nm.
    """
    mu = 6.6e-18
    grains = sand.Grains([[0, 0, 0], [0, 0, 1e-7]], RADIUS, "iron", moment=[[0, 0, mu]] * 2, mass=[3.3e-20, 1e-12])
    driven = sand.Driven([0], velocity=[0, 0, 1.0])
    sim = sand.Simulation(
        grains, [PLAIN, sand.Dipoles(cutoff=None)], driven=driven, stepping=sand.RigidClusters(), frame_every=1.0
    )
    sim.run(until="40 ns")
    energies = [-2.0 * MAGNETIC * mu**2 / r**3 for r in (1e-7, 6e-8)]
    work = energies[0] - energies[1]
    assert sim.ledger["lost_outside"][-1] == pytest.approx(work, rel=3e-4, abs=0.0)
    assert sim.ledger["total"][-1] == pytest.approx(sim.ledger["total"][0], abs=3e-4 * work)


def magnetic_gas(held, **options):
    """A gas in which clusters form, and touch walls or driven grains."""
    box, gas = sand.Box.periodic("0.3 um", "0.3 um", "open"), sand.Gas("300 K", pressure="1 bar")
    grains = sand.setup.gas(
        24, box, extent="0.4 um", radius="10 nm", material="iron", moment="200 A m^2/kg", temperature="300 K", seed=3
    )
    if held == "walls":
        floor = sand.Wall([0, 0, "-0.2 um"], [0, 0, 1], "iron", velocity=[1, 0, 0])
        held = {"walls": [floor, sand.Wall([0, 0, "0.2 um"], [0, 0, -1], "iron", mass="1e-17 kg", force="1e-11 N")]}
    else:
        held = {"driven": [sand.Driven([3, 5]), sand.Driven([11], velocity=["1 m/s", 0, 0], spin=[0, 1e8, 0])]}
    forces = [contact() if "walls" in held else PLAIN, sand.Dipoles(cutoff="0.1 um"), gas]
    options = {"frame_every": 1.0} | held | options
    return sand.Simulation(grains, forces, box=box, stepping=sand.RigidClusters(), seed=4, **options)


@pytest.mark.filterwarnings(NO_SETTLING, "ignore:.* broke while aggregates grew", "ignore:dipoles. the cut-off")
@pytest.mark.filterwarnings("ignore:grains in contact vibrate")  # rows of 1 ns see the vibration after an impact
@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize("held", ["walls", "driven grains"])
def test_the_ledger_closes_and_output_and_restarts_change_no_bit(tmp_path, held):
    """Clusters wake, come to rest, and are held; a run, one with frames, and one stopped and resumed: the same bits."""
    whole, often = magnetic_gas(held), magnetic_gas(held, frame_every="3 ns", row_every="1 ns")
    stopped = magnetic_gas(held, out=tmp_path / "run")
    end = "0.1 us" if held == "walls" else "40 ns"
    whole.run(until=end)
    often.run(until=end)
    stopped.run(until="23.7 ns")
    del stopped
    again = sand.resume(tmp_path / "run")
    again.loads()  # of awake clusters: computed in the part that takes their steps
    again.run(until=end)
    count = whole.regular_state.count
    assert min(count[WOKEN], count[RESTED]) > 2 and count[LATE] == 0
    assert different(whole, often) == different(whole, again) == []
    assert whole.ledger.rows[-1] == again.ledger.rows[-1]
    assert whole.ledger.drift < 5e-3
    if held == "walls":
        assert (whole.regular_state.bodies.asleep[whole.regular_state.held_grains()] == 0).all()
        assert sum(wall.contacts for wall in whole.walls) > 0
    else:
        assert whole.grains.velocity[[3, 5, 11]].tolist() == [[0, 0, 0], [0, 0, 0], [1, 0, 0]]
        assert whole.grains.spin[[3, 5, 11]].tolist() == [[0, 0, 0], [0, 0, 0], [0, 1e8, 0]]


@pytest.mark.filterwarnings(NO_SETTLING, "ignore:dipoles. the cut-off")
@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize("held", ["walls", "driven grains"])
def test_threads_of_awake_clusters_change_no_bit(monkeypatch, held):
    """Loops over so few grains are not shared; here they are, also those over the grains of awake clusters."""
    monkeypatch.setattr(task_queue, "PARALLEL_FROM", 1)
    ends = []
    try:
        for number in (1, 2):
            sand.set_threads(number)
            ends.append(magnetic_gas(held))
            ends[-1].run(until="25 ns")
    finally:
        sand.set_threads(None)
    assert ends[-1]._engine.workers is not None
    assert ends[0].regular_state.count[CONTACT_STEPS] > 100
    assert different(*ends) == []


@pytest.mark.filterwarnings(NO_SETTLING)
@pytest.mark.compiled("dipoles")
def test_loads_of_an_awake_magnetic_chain_are_those_of_grain_by_grain():
    """Loads of pairs in contact count once: those of a bent chain of three are as with `sand.Verlet`.

    The pull of two magnets that touch is 6kμ²/d⁴ = 1.6e-10 N.  The shorter steps change sliding displacements by less
    than 1e-14 m, and their forces by k_s of 100 N/m times this, 0.6 % of the pull.
    """
    mu = 6.6e-18
    x, vz = RADIUS * np.array([0.0, 2.0, 4.0]) * 0.999, np.array([0.3, -0.6, 0.3])
    grains = sand.Grains(
        np.stack([x, 0 * x, 0 * x], 1),
        RADIUS,
        "iron",
        moment=[[mu, 0, 0]] * 3,
        velocity=np.stack([0 * vz, 0 * vz, vz], 1),
    )
    pull, found = 6.0 * MAGNETIC * mu**2 / (2.0 * RADIUS) ** 4, []
    for stepping in (sand.Verlet(), sand.RigidClusters()):
        sim = sand.Simulation(grains, [PLAIN, sand.Dipoles(cutoff=None)], stepping=stepping)
        sim.run(until="0.2 ns")
        sim.run(until="0.5 ns")
        found.append(sim.loads())
    assert sim.state.at_rest.tolist() == [False] * 3
    grain_by_grain, awake = found
    np.testing.assert_allclose(awake["force"], grain_by_grain["force"], rtol=0.0, atol=0.01 * pull)
    np.testing.assert_allclose(awake["torque"], grain_by_grain["torque"], rtol=0.0, atol=0.01 * pull * RADIUS)
