"""Walls: the limit of a huge sphere, energy, momentum, pull-off, approach, restarts, bits."""

import math

import numpy as np
import pytest

import sand
from sand.basics.constants import BOLTZMANN
from sand.simulation.outcome import Outcome

from .setups import rest_distance
from .test_reproducibility import state

R = 5e-7
FLOOR = sand.Wall([0, 0, 0], [0, 0, 1], "silica")
SPINNING = {"velocity": [0.0004, 0.0007, -0.04], "spin": [7e4, -2e5, 3e5]}
"""Motion that stretches, slides, rolls and twists the contact, and rolls it beyond its limit."""


def grain(gap=2.5e-10, **motion):
    """One grain above the plane z = 0."""
    return sand.Grains([[0, 0, R + gap]], R, "silica", **{name: [v] for name, v in (SPINNING | motion).items()})


def beside_sphere(ratio, **motion):
    """The same grain above a sphere of `ratio` times its radius and `ratio`³ times its mass."""
    one, motion = grain(), SPINNING | motion
    return sand.Grains(
        [[0, 0, R + 2.5e-10], [0, 0, -ratio * R]],
        [R, ratio * R],
        "silica",
        mass=[one.mass[0], one.mass[0] * ratio**3],
        velocity=[motion["velocity"], [0, 0, 0]],
        spin=[motion["spin"], [0, 0, 0]],
    )


@pytest.mark.compiled("contacts")
@pytest.mark.filterwarnings("ignore:grain 1 has a radius")
@pytest.mark.parametrize("damping", ["none", "critical"])
def test_limit_of_a_huge_sphere(damping):
    """A grain that hits, rolls, slides and twists on a wall moves as on a sphere of r2 = 1e4 r1 and 1e5 r1.

    The difference is of first order in r1/r2, so that it falls by a factor of ten (to 5 %), and is below 2e-3 for
    1e5: the phase of 30 vibrations multiplies r1/r2 by about a hundred.  Energies dissipated agree to 1e-4.
    """
    contact, stepping = sand.Contact(damping=damping), sand.Verlet(step=2e-11)
    wall = sand.Simulation(grain(), [contact], walls=[FLOOR], stepping=stepping)
    wall.run(until="0.2 us")
    assert wall.walls[0].contacts == 1 and wall.ledger["lost_rolling"][-1] > 0.0
    differences = []
    for ratio in (1e4, 1e5):
        sphere = sand.Simulation(beside_sphere(ratio), [contact], stepping=stepping)
        sphere.run(until="0.2 us")
        found = [(getattr(one.grains, key)[0]) for key in ("velocity", "spin", "torque") for one in (wall, sphere)]
        differences.append(
            [np.abs(a - b).max() / np.abs(a).max() for a, b in zip(found[::2], found[1::2], strict=True)]
        )
        for name in ("lost_forming", "lost_rolling", *(["lost_damping_rolling"] if damping == "critical" else [])):
            assert sphere.ledger[name][-1] == pytest.approx(wall.ledger[name][-1], rel=10.0 / ratio, abs=0.0)
    assert np.max(differences[1]) < 2e-3
    np.testing.assert_allclose(differences[0], 10.0 * np.array(differences[1]), rtol=0.05)


@pytest.mark.compiled("contacts")
@pytest.mark.filterwarnings("ignore:grain 1 has a radius")
@pytest.mark.parametrize("damping", ["none", "critical"])
def test_a_bounce_as_from_a_huge_sphere(damping):
    """A fast grain forms and breaks a contact with a wall as with a sphere of 1e5 times its radius, step by step.

    Velocity and spin after the bounce agree to 1e-4, ten times r1/r2.  The impulses of forming and breaking for parts
    of a step change the velocity by F dt/m, a hundred times more.
    """
    fast = {"velocity": [0.01, 0.02, -0.6], "spin": [2e5, 1e5, 3e5]}
    contact = sand.Contact(damping=damping, **({"damping_ratio": 0.02} if damping == "critical" else {}))
    ends = []
    for grains, walls in ((grain(**fast), [FLOOR]), (beside_sphere(1e5, **fast), [])):
        sim = sand.Simulation(grains, [contact], walls=walls, stepping=sand.Verlet(step=1.5e-10))
        sim.run(until="60 ns")
        assert min(sim.ledger["lost_forming"][-1], sim.ledger["lost_breaking"][-1]) > 0.0
        lost = [sim.ledger[f"lost_{name}"][-1] for name in ("forming", "breaking", "damping_normal")]
        ends.append([sim.grains.velocity[0], sim.grains.spin[0], lost])
    for at_wall, at_sphere in zip(*ends, strict=True):
        assert np.abs(np.subtract(at_wall, at_sphere)).max() <= 1e-4 * np.abs(at_wall).max()


@pytest.mark.validates("self-consistency", "The energy balance of impacts on walls, fixed and moving, closes")
@pytest.mark.compiled("contacts")
@pytest.mark.parametrize(
    ("law", "damping"),
    [
        ("jkr", "none"),
        ("jkr", "critical"),
        ("dmt", "critical"),
        pytest.param("dmt", "none", marks=pytest.mark.validate),
    ],
)
@pytest.mark.parametrize(
    "wall",
    [FLOOR, sand.Wall([0, 0, 0], [0, 0, 1], "silica", velocity=[0.003, 0.002, 0.02])],
    ids=["fixed", "moving"],
)
def test_ledger_closes_and_momentum_balances(record_bound, law, damping, wall):
    """Total energy constant to second order, momentum of the grain plus impulse of the wall constant to rounding.

    Velocity Verlet: the error is at most a few (ω dt)²/24 of the energies of the impact, 1e-3 of all dissipation with
    100 steps per period.  Work of a wall of constant velocity V: the impulse on the grain times V.
    """
    sim = sand.Simulation(grain(), [sand.Contact(law=law, damping=damping)], walls=wall,
                          stepping=sand.Verlet(steps_per_period=100))  # fmt: skip
    before = sim.grains.mass[:, None] * sim.grains.velocity
    sim.run(until="1 us")
    (found,) = sim.walls
    # without damping a DMT contact dissipates no energy of the normal motion, and the grain bounces
    bounces = (law, damping) == ("dmt", "none")
    assert found.contacts == (0 if bounces else 1) and (sim.ledger["lost_rolling"][-1] > 0.0) != bounces
    record_bound("drift of the ledger", sim.ledger.drift, most=1e-3)
    change = (sim.grains.mass[:, None] * sim.grains.velocity - before).sum(axis=0)
    np.testing.assert_allclose(change, -found.impulse, rtol=1e-9, atol=1e-11 * np.abs(found.impulse).max())
    assert sim.ledger["lost_walls"][-1] == pytest.approx(found.impulse @ wall.velocity, rel=1e-9, abs=1e-40)
    np.testing.assert_allclose(found.position, np.multiply(wall.velocity, sim.time), rtol=1e-9, atol=0.0)
    assert sim.ledger["wall1_force_z"][-1] == found.force[2] == -sim.grains.force[0, 2]


@pytest.mark.compiled("contacts")
def test_changing_stiffnesses():
    """Stiffness "dt97" at a wall: the energy that it creates or destroys is in `lost_stiffness`; drift below 1e-3."""
    sim = sand.Simulation(grain(), [sand.Contact(stiffness="dt97")], walls=[FLOOR],
                          stepping=sand.Verlet(steps_per_period=100))  # fmt: skip
    sim.run(until="1 us")
    assert sim.ledger["lost_stiffness"][-1] != 0.0 and sim.ledger.drift < 1e-3


@pytest.mark.compiled("contacts")
def test_a_moving_frame():
    """Wall and grain with a common additional velocity: the same relative motion, to the rounding of x + V t, 1e-5."""
    V = np.array([0.02, -0.01, 0.03])
    rest = sand.Simulation(grain(), [sand.Contact()], walls=[FLOOR], stepping=sand.Verlet(step=2e-10))
    boosted = sand.Wall(FLOOR.point, FLOOR.normal, "silica", velocity=V)
    moving = sand.Simulation(
        grain(velocity=V + SPINNING["velocity"]), [sand.Contact()], walls=[boosted], stepping=sand.Verlet(step=2e-10)
    )
    for sim in (rest, moving):
        sim.run(until="0.3 us")
    np.testing.assert_allclose(moving.grains.velocity - V, rest.grains.velocity, atol=1e-5 * 0.04, rtol=0.0)
    np.testing.assert_allclose(moving.grains.spin, rest.grains.spin, atol=1e-5 * 3e5, rtol=0.0)


@pytest.mark.validates("closed form", "A grain comes off a wall at 3πγR")
@pytest.mark.compiled("contacts")
def test_pull_off_force_of_a_wall(record_bound):
    """A grain between two walls breaks from that of the smaller γ, at F = 3π √(γ1 γ2) r1 (JKR, R = r1).

    The wall moves slowly (v √(k m) is 0.1 % of F) and the row nearest the maximum is within 0.1 % of it.
    """
    weak = sand.SILICA.but(name="weak", surface_energy=0.0125)
    rest = [R + 1e6 * R - rest_distance(sand.SILICA, R, 1e6 * R, m) for m in (sand.SILICA, weak)]
    z = R - rest[0]
    walls = [
        sand.Wall([0, 0, 0], [0, 0, 1], "silica", name="held"),
        sand.Wall([0, 0, z + R - rest[1]], [0, 0, -1], weak, velocity=[0, 0, 5e-4], name="pulled"),
    ]
    one = sand.Grains([[0, 0, z]], R, "silica")
    sim = sand.Simulation(one, [sand.Contact(damping="critical")], walls=walls, row_every="5 ns")
    sim.run(until="10 us", stop="wall_contacts == 1")
    force = 3.0 * math.pi * math.sqrt(0.025 * 0.0125) * R
    assert [wall.contacts for wall in sim.walls] == [1, 0]
    record_bound("pull-off force over 3πγR", sim.ledger["held_force_z"].max() / force, least=0.997, most=1.003)
    assert -sim.ledger["pulled_force_z"].min() == pytest.approx(force, rel=3e-3, abs=0.0)


@pytest.mark.compiled("contacts")
def test_wall_with_a_mass():
    """A damped wall pressed on a grain on a fixed wall comes to rest: both contacts carry the force; energy is kept.

    The work of the force, less the kinetic energy of the wall, is −lost_walls; momentum of grain and wall changes by
    the impulse of the force and of the floor.
    """
    press = sand.Wall([0, 0, 2 * R + 3e-10], [0, 0, -1], "silica", mass="5e-15 kg", force="20 nN", name="press")
    one = sand.Grains([[0, 0, R]], R, "silica")
    sim = sand.Simulation(one, [sand.Contact(damping="critical", damping_ratio=1.0)], walls=[FLOOR, press])
    sim.run(until="3 us")
    floor, lid = sim.walls
    assert [floor.contacts, lid.contacts] == [1, 1]
    assert floor.force[2] == pytest.approx(-2e-8, rel=1e-3, abs=0.0) and lid.force[2] == pytest.approx(
        2e-8, rel=1e-3, abs=0.0
    )
    changes = np.abs(sim.ledger["total"] - sim.ledger["total"][0])  # also while the wall moves
    assert changes.max() < 3e-3 * sim.ledger.dissipated
    kinetic = 0.5 * 5e-15 * lid.velocity[2] ** 2
    work = -2e-8 * (lid.position[2] - press.point[2])
    rounding = 2e-8 * sim.steps * np.spacing(lid.position[2]) / 2  # of the position of the wall, once per step
    assert -sim.ledger["lost_walls"][-1] == pytest.approx(work - kinetic, rel=1e-9, abs=rounding)
    momentum = sim.grains.mass[0] * sim.grains.velocity[0, 2] + 5e-15 * lid.velocity[2]
    given = -2e-8 * sim.time - floor.impulse[2]
    assert momentum == pytest.approx(given, abs=1e-9 * 2e-8 * sim.time)


@pytest.mark.compiled("contacts")
def test_a_force_that_changes(tmp_path):
    """Under F = F₁ t/T a free wall of mass M moves by F₁ T²/6M and has v = F₁ T/2M; all work is its kinetic energy.

    The force has the mean of each of 1000 intervals, set at the first end of a step, dt = T/3200, within it: v is off
    by less than F₁ dt/M.  A run that is stopped and resumed has the same bits.
    """
    ramp, end = {"values": ["0 N", "10 nN"], "times": ["0 s", "1 us"]}, 1e-6

    def start(**options):
        lid = sand.Wall([0, 0, 1e-4], [0, 0, -1], "silica", mass="5e-15 kg", force=ramp, name="lid")
        return sand.Simulation(
            grain(velocity=[0, 0, 0], spin=[0, 0, 0]),
            [sand.Contact()],
            walls=[lid],
            stepping=sand.Verlet(step=end / 3200),
            **options,
        )

    one, first = start(), start(out=tmp_path / "run")
    one.run(until=end)
    lid, given = one.walls[0], sand.Ramp(**ramp)
    assert one.state.to_arrays()["walls/push"] == pytest.approx([1e-8], rel=1e-3, abs=0.0)
    assert lid.velocity[2] == pytest.approx(-1e-8 * end / 2 / 5e-15, rel=1e-3, abs=0.0)
    assert lid.position[2] - 1e-4 == pytest.approx(-1e-8 * end**2 / 6 / 5e-15, rel=2e-3, abs=0.0)
    assert abs(one.ledger["lost_walls"][-1]) < 1e-11 * 0.5 * 5e-15 * lid.velocity[2] ** 2
    first.run(until=0.41 * end)
    del first
    second = sand.resume(tmp_path / "run")
    second.run(until=end)
    assert state(one) == state(second)
    with pytest.raises(sand.BadInput, match="wall: velocity cannot be a ramp; parameters with ramps: force"):
        sand.Wall([0, 0, 0], [0, 0, 1], "silica", velocity=given)
    with pytest.raises(sand.BadInput, match="force is given without a mass"):
        sand.Wall([0, 0, 0], [0, 0, 1], "silica", force=given)


@pytest.mark.filterwarnings("ignore:grains overlap too deeply", "ignore:impacts are too fast for elastic grains")
@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("speed", [0.01, 3.0, 300.0])
def test_a_flying_grain_is_found_when_it_touches(speed):
    """A grain from 50 radii away touches the wall with less than δ_c/10 of overlap per step: its contact is resolved.

    At 0.01 m/s it sticks; faster ones bounce and fly away with most of their energy (what is lost is lost in forming
    and breaking), none passes the plane.  The time of formation is that of free flight.
    """
    one = grain(gap=50 * R, velocity=[0, 0, -speed], spin=[0, 0, 0])
    sim = sand.Simulation(one, [sand.Contact()], walls=[FLOOR])
    result = sim.run(until=51 * R / speed)
    made = sim.ledger["lost_forming"][-1] != 0.0
    assert result.outcome is Outcome.FINISHED and made and sim.grains.position[0, 2] > 0.9 * R
    assert sim.ledger.drift < 1e-3
    if speed > 1.0:
        lost = sim.ledger["lost_forming"][-1] + sim.ledger["lost_breaking"][-1]
        kinetic = 0.5 * sim.grains.mass[0] * (speed**2 - sim.grains.velocity[0, 2] ** 2)
        assert sim.grains.velocity[0, 2] > 0.0
        before = 0.5 * sim.grains.mass[0] * speed**2
        assert kinetic == pytest.approx(lost, rel=0.05, abs=1e-5 * before)


def at_walls(sim):
    """Grain and wall of each contact with a wall, (2, K)."""
    return sim.state.to_arrays()["wall_contacts/pair"]


def bouncing(order="as given", **options):
    """Grains that fly between two walls in a box that is periodic along x and y, with a damped contact model."""
    rng, box = np.random.default_rng(5), sand.Box.periodic("8 um", "8 um", None)
    layers = np.meshgrid(np.arange(-2.0, 3.0), np.arange(-2.0, 3.0), [-2.0, 2.0], indexing="ij")
    position = 1.3e-6 * np.concatenate([np.stack(layers, -1).reshape(-1, 3), [[x, 0.0, 0.0] for x in range(-2, 3)]])
    given = {"velocity": 0.3 * rng.normal(size=position.shape), "spin": 1e5 * rng.normal(size=position.shape)}
    grains = sand.Grains(position, R, "silica", **given)
    walls = [
        sand.Wall([0, 0, -3.2e-6], [0, 0, 1], "silica"),
        sand.Wall([0, 0, 3.2e-6], [0, 0, -1], "silica", velocity=[0.1, 0, -0.05]),
    ]
    contact = sand.Contact(damping="critical", bath_temperature="300 K")
    neighbours = sand.Neighbours(order=order)
    return sand.Simulation(grains, [contact], box=box, walls=walls, seed=3, neighbours=neighbours, **options)


@pytest.mark.filterwarnings("ignore:contacts of iron")
@pytest.mark.compiled("contacts")
def test_a_bath_gives_every_mode_of_grains_on_a_wall_its_share():
    """⟨U⟩ = ½ kT per degree of freedom: normal 1, sliding 2, rolling 2, twisting 1; no heat flows in the mean.

    60 samples of 400 grains, 0.2 ns apart, count as 24,000 independent ones; the variance of f/2 kT is f/2 (kT)².
    Four standard errors √(2/(24,000 f)), and (ω dt)²/4 = 1.6 % at 25 steps per period, the change of ⟨U⟩ by velocity
    Verlet.  The heat is a difference of energies with 6 degrees of freedom of U and as many of K: variance 12/400.
    That of sliding or rolling alone is a random walk: on a wall both dashpots act on the same coordinates and
    exchange heat.
    """
    radius, temperature, freedom = 1e-8, 100.0, np.array([1, 2, 2, 1])
    side = 5e-8 * np.arange(20)
    position = np.array([(x, y, 0.0) for x in side for y in side])
    position[:, 2] = radius - sand.theory.contact("iron", 2.0 * radius).rest_overlap  # R = r for a wall, r/2 for a pair
    contact = sand.Contact(damping="critical", damping_ratio=0.2, bath_temperature=temperature)
    wall = sand.Wall([0, 0, 0], [0, 0, 1], "iron")
    sim = sand.Simulation(sand.Grains(position, radius, "iron"), [contact], walls=[wall], seed=5, frame_every="1 s")
    sim.run(until="1 ns")
    rest, rows = sim.ledger.rows[0], [sim.ledger.rows[-1]]
    for _ in range(60):
        sim.run(until=sim.time + 2e-10)
        rows.append(sim.ledger.rows[-1])
    modes, share = ("normal", "sliding", "rolling", "twisting"), 400 * BOLTZMANN * temperature
    stored = np.array([[row[name] - rest[name] for name in modes] for row in rows[1:]]).mean(axis=0) / share
    step_error = (2.0 * math.pi / 25) ** 2 / 4
    assert (np.abs(stored / (freedom / 2) - 1.0) < 4.0 * np.sqrt(2.0 / (24_000 * freedom)) + step_error).all()
    heat = sum(rows[-1][f"lost_damping_{name}"] - rows[0][f"lost_damping_{name}"] for name in modes) / share
    assert abs(heat) < 4.0 * math.sqrt(12.0 / 400)
    assert sim.ledger["wall_contacts"][-1] == 400 and rows[-1]["moved"] == 0
    # the work of the bath is in the balance: what is left is ¼ (ω dt)² U of velocity Verlet, not ζ ω dt of K
    assert sim.ledger.drift < step_error


@pytest.mark.filterwarnings("ignore:.* broke while aggregates grew")
@pytest.mark.compiled("contacts")
def test_output_split_and_resume_change_no_bit(tmp_path):
    """One run, a run with many frames, and one that is stopped, read from its checkpoint and continued."""
    one, often = bouncing(), bouncing(frame_every="3 ns", row_every="1 ns")
    first = bouncing(out=tmp_path / "run", frame_every="0.1 us")
    one.run(until="0.9 us")
    often.run(until="0.9 us")
    first.run(until="0.31 us")
    del first
    second = sand.resume(tmp_path / "run")
    second.run(until="0.9 us")
    assert at_walls(one).shape[1] > 16  # more than were allocated at first
    assert state(one) == state(often) == state(second)
    assert one.ledger.rows[-1] == second.ledger.rows[-1]
    stored = sand.open(tmp_path / "run").ledger
    assert stored["wall2_force_z"][-1] == one.walls[1].force[2] != 0.0


@pytest.mark.compiled("contacts")
def test_order_in_memory_and_threads(monkeypatch):
    """Sorted arrays change results by rounding only; threads change no bit."""
    from sand.engine import compiled_state
    from sand.integrate import task_queue

    plain, ordered = bouncing(), bouncing(order="curve")
    for sim in (plain, ordered):
        sim.run(steps=1000)
        sim.run(steps=500)  # the user's order is restored between the runs
    first, second = (sorted(at_walls(sim).T.tolist()) for sim in (plain, ordered))
    assert first == second != []
    np.testing.assert_allclose(ordered.grains.position, plain.grains.position, rtol=0.0, atol=1e-6 * R)
    for module in (task_queue, compiled_state):
        monkeypatch.setattr(module, "uses_task_queue", lambda grains: True)
    ends = []
    for number in (1, 2):
        sand.set_threads(number)
        sim = bouncing()
        sim.run(steps=1500)
        ends.append(state(sim))
    sand.set_threads(None)
    assert ends[0] == ends[1]


@pytest.mark.compiled("contacts")
def test_change_keeps_walls():
    """A change between runs keeps walls and their contacts, and an unchanged one changes no energy."""
    sim = sand.Simulation(grain(), [sand.Contact()], walls=[FLOOR])
    sim.run(until="0.2 us")
    with sim.change() as change:
        change.velocity[0, 0] += 1e-4
    assert sim.walls[0].contacts == 1 and sim.ledger["wall_contacts"][-1] == 1
    sim.run(until="0.3 us")
    assert sim.walls[0].contacts == 1 and sim.ledger.drift < 0.01


@pytest.mark.compiled("contacts")
def test_a_driven_grain_pulls_another_from_a_wall():
    """The chain wall, grain, driven grain breaks between the grains, F = 3πγR; the work of the drive is booked."""
    height = R - sand.theory.contact("silica", R, other_radius=1.0).rest_overlap
    chain = sand.Grains([[0, 0, height], [0, 0, height + rest_distance(sand.SILICA, R, R)]], R, "silica")
    driven = sand.Driven([1], velocity=[0, 0, "1 mm/s"])
    sim = sand.Simulation(
        chain, [sand.Contact(damping="critical")], walls=[FLOOR], driven=driven, row_every="10 ns"
    )  # fmt: skip
    sim.run(until="60 us", stop="broken == 1")
    assert sim.walls[0].contacts == 1
    force = 3.0 * math.pi * sand.SILICA.surface_energy * R / 2.0
    assert sim.ledger["wall1_force_z"].max() == pytest.approx(force, rel=0.01, abs=0.0)
    assert sim.ledger["lost_outside"][-1] < 0.0 and sim.ledger.drift < 1e-3


@pytest.mark.compiled("contacts")
def test_changes_that_walls_refuse():
    """With walls no grain is removed, and the box stays."""
    sim = sand.Simulation(grain(), [sand.Contact()], walls=[FLOOR])
    with pytest.raises(sand.BadInput, match="with walls a change cannot add or remove"), sim.change() as change:
        change.box = sand.Box.periodic("8 um", "8 um", None)
    with pytest.raises(sand.BadInput, match="with walls a change cannot add or remove"), sim.change() as change:
        change.add(sand.Grains([[0, 0, 10 * R]], R, "silica"))
    assert len(sim.grains) == 1
