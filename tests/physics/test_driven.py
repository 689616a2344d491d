"""Fixed and driven grains: the limit of infinite mass, the work of the drive, and the force on driven grains."""

import math

import numpy as np
import pytest

import sand
from sand.basics.errors import BadInput

from .test_ramps import BOTH, RADIUS, REST, normal_energy


def row_of_grains(count, gap=-REST, **options):
    """Silica grains of 0.1 μm in a row along x, with a gap [m] between neighbours."""
    x = (2.0 * RADIUS + gap) * np.arange(count)
    return sand.Grains(np.stack([x, 0.0 * x, 0.0 * x], axis=1), RADIUS, sand.SILICA, **options)


@pytest.mark.validates("closed form", "A grain on a fixed grain oscillates with √(k/m)")
@pytest.mark.compiled("contacts")
def test_a_grain_on_a_fixed_grain_oscillates_with_its_own_mass(record_bound):
    """ω² = k/m, k = d²U/dδ² at rest, for m₂ → ∞; two free grains have ω² = 2k/m.

    25 steps per period: velocity Verlet has ω too high by (ω Δt)²/24 = 0.26 %; amplitude 1e-3 δ_c adds less.
    """
    speed, h = 1e-4, 1e-3 * REST
    stiffness = sum(f * normal_energy(REST + s * h, 1.0)[0] for f, s in ((1, 1), (-2, 0), (1, -1))) / h**2
    grains = row_of_grains(2, velocity=[[0, 0, 0], [speed, 0, 0]])
    sim = sand.Simulation(grains, [sand.Contact()], driven=sand.Driven([0]))
    crossings = []
    while len(crossings) < 21:
        before = sim.time, sim.grains.velocity[1, 0]
        sim.run(steps=1)
        after = sim.time, sim.grains.velocity[1, 0]
        if before[1] > 0.0 >= after[1]:
            crossings.append(before[0] + (after[0] - before[0]) * before[1] / (before[1] - after[1]))
    omega = 2.0 * math.pi * 20.0 / (crossings[-1] - crossings[0])
    expected = math.sqrt(stiffness / grains.mass[0])
    record_bound("frequency over √(k/m)", omega / expected, least=0.996, most=1.004)
    assert (sim.grains.position[0] == grains.position[0]).all() and not sim.grains.velocity[0].any()
    assert sim.ledger["lost_outside"][-1] == 0.0 and sim.ledger.drift < (2.0 * math.pi / 25) ** 2 / 8


@pytest.mark.compiled("contacts")
def test_a_chain_is_pulled_apart_with_the_pull_off_force():
    """Fixed, free and slowly driven grain: the largest force on the driven one is F_c = 3πγR, and the ledger closes.

    At 1 mm/s the contacts vibrate by v √(m k), 1 % of F_c.  The work of the drive stays in vibrations and in the energy
    of breaking; the error of the total is (2π/25)²/8 of it.
    """
    pull_off = 3.0 * math.pi * BOTH.surface_energy * 0.5 * RADIUS
    driven = [sand.Driven([0]), sand.Driven([2], velocity=[1e-3, 0, 0])]
    sim = sand.Simulation(row_of_grains(3), [sand.Contact()], driven=driven)
    largest = 0.0
    while not sim.state.count[5] and sim.time < 1e-5:
        sim.run(steps=20)
        largest = max(largest, -sim.loads()["force"][2, 0])
    assert len(sim.contacts["pair"]) == 1 and largest == pytest.approx(pull_off, rel=2e-2, abs=0.0)
    row, first = sim._log_row(), sim.ledger.rows[0]
    work = -row["lost_outside"]
    assert work == pytest.approx(normal_energy(REST, 1.0)[1] * 2.0, rel=0.5, abs=0.0) and work > 0.0
    assert row["total"] == pytest.approx(first["total"], abs=(2.0 * math.pi / 25) ** 2 / 8 * work)
    travelled = 1e-3 * sim.time
    assert sim.grains.position[2, 0] - 2.0 * (2.0 * RADIUS - REST) == pytest.approx(travelled, rel=1e-8, abs=0.0)


@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize("moving", [0.0, -0.3])
@pytest.mark.parametrize("damping", ["none", "critical"])
def test_a_driven_grain_is_one_of_infinite_mass(moving, damping):
    """An oblique impact on a driven grain, at rest or moving, and on one of 1e8 times the mass: equal motion.

    To 1e-6, with magnetic moments, and forming and breaking of the contact.  The ledger closes as for a heavy grain at
    rest: to 0.3 % of the energy of touch, in 20 steps per period; that of a moving heavy grain rounds.
    """
    moment = [[0, 0, 0], [0, 1e-17, 0], [0, 1e-17, 0]]
    velocity = [[0, 0, 0], [moving, 0, 0], [0.6 + moving, 0.05, 0]]
    position = [[5e-6, 0, 0], [0, 0, 0], [-2.02 * RADIUS, 0.4 * RADIUS, 0]]
    mass = sand.Grains([[0, 0, 0]], RADIUS, sand.SILICA).mass[0]
    forces = [sand.Contact(damping=damping), sand.Dipoles(cutoff=None)]
    ends = []
    for heavy in (False, True):
        masses = mass * np.array([1.0, 1e8 if heavy else 1.0, 1.0])
        grains = sand.Grains(position, RADIUS, sand.SILICA, velocity=velocity, moment=moment, mass=masses)
        drive = () if heavy else sand.Driven([1], velocity=velocity[1])
        stepping = sand.Verlet(step="20 ps", far="every step")
        sim = sand.Simulation(grains, forces, driven=drive, stepping=stepping)
        sim.run(until="25 ns")
        ends.append((sim.grains.position[2], sim.grains.velocity[2], sim.grains.spin[2], sim._log_row(), sim.ledger))
    for k, scale in ((0, 1e-8), (1, 1.0), (2, 1.0 / RADIUS)):
        assert np.allclose(ends[0][k], ends[1][k], atol=1e-6 * scale), (k, ends)
    one, two = ends[0][3], ends[1][3]
    assert one["made"] == two["made"] == 1
    assert one["lost_forming"] == pytest.approx(two["lost_forming"], rel=1e-6, abs=0.0)
    change = [abs(end[4]["total"][-1] - end[4]["total"][0]) for end in ends]
    assert change[0] < 4e-3 * one["lost_forming"]
    assert moving or change[0] == pytest.approx(change[1], rel=1e-3, abs=0.0)


def magnetic_gas(**options):
    grains = sand.setup.gas(
        20, "0.25 um", radius="10 nm", material="iron", moment="200 A m^2/kg", temperature="100 K", seed=11
    )
    forces = [sand.Contact(damping="critical"), sand.Dipoles(cutoff="90 nm"), sand.Gas(300.0, pressure="1 kPa")]
    driven = [sand.Driven([3, 5]), sand.Driven([7], velocity=["1 m/s", 0, 0], spin=[0, 1e8, 0])]
    return sand.Simulation(grains, forces, box="0.25 um", seed=4, driven=driven, frame_every="2 ns", **options)


@pytest.mark.filterwarnings("ignore:dipoles. the cut-off, .* ends an interaction")
@pytest.mark.compiled("dipoles")
def test_a_gas_with_driven_grains_closes_its_ledger_and_is_resumed_bit_for_bit(tmp_path):
    """Positions of fixed grains stay the same bits, driven ones move as prescribed; the case file holds the drive."""
    whole, stopped = magnetic_gas(), magnetic_gas(out=tmp_path / "run")
    start = whole.grains.position.copy()
    whole.run(until="15 ns")
    stopped.run(until="8.3 ns")
    again = sand.resume(tmp_path / "run")
    again.run(until="15 ns")
    assert again.driven == whole.driven
    assert (whole.grains.position[[3, 5]] == start[[3, 5]]).all() and not whole.grains.velocity[3].any()
    moved = whole.box.nearest(whole.grains.position[7] - start[7])
    assert np.allclose(moved, [1.5e-8, 0, 0], atol=1e-15) and whole.grains.spin[7].tolist() == [0.0, 1e8, 0.0]
    assert len(whole.contacts["pair"]) > 0 and whole.ledger.drift < 1e-2
    arrays = [sim.regular_state.to_arrays() for sim in (whole, again)]
    assert [name for name in arrays[0] if arrays[0][name].tobytes() != arrays[1][name].tobytes()] == []


@pytest.mark.validates("closed form", "A grain that settles on a driven grain loses its energy as exp(−t/τ)")
@pytest.mark.compiled("contacts")
def test_settling_leads_to_the_motion_of_a_driven_grain(record_bound):
    """A grain on a driven one: x¨ + x˙/τ + ω²x = 0 relative to it, whatever its velocity; the ledger closes.

    The energy of the oscillation is E₀ e^(−t/τ) (1 + b), |b| ≤ 1/(2ωτ), with E₀ = ½ m v₀²; ω = √(k/m), above 4e10/s for
    0.1 μm grains, and τ = 20 ns: b ≤ 7e-4.  What settling takes is the same in the frame of the driven grain, at rest
    or moving with 3 v₀.  It acts every h = τ/20, several periods apart, and so finds the oscillation at 30 phases, of
    which the mean of 2 cos² is 1 but for 1/(30 sin ωh), here 1 % of the exponent 1.5, 0.3 % of the energy.  The
    velocity u of a mass 2³⁰ m has a rounding error of 2⁻⁵³ u, so that each of the 30 applications books up to
    2⁻²³ m u² wrongly, in all 30 × 18 × 2⁻²³ = 6e-5 of E₀.
    """
    v, tau, taken = 1e-3, 2e-8, []
    for u in (0.0, 3.0 * v):
        grains = row_of_grains(2, velocity=[[u, 0, 0], [u + v, 0, 0]])
        contact = sand.Contact(settling_time=tau)
        sim = sand.Simulation(grains, [contact], driven=sand.Driven([0], velocity=[u, 0, 0]))
        sim.run(until=1.5 * tau)
        energy = 0.5 * grains.mass[0] * v**2
        taken.append(sim.ledger["lost_settling"][-1] / energy)
        assert sim.grains.velocity[0].tolist() == [u, 0.0, 0.0]
        row, first = sim.ledger.rows[-1], sim.ledger.rows[0]
        # velocity Verlet with 25 steps per period: (2π/25)²/8 of the energy
        error = abs(row["total"] - first["total"]) / energy
        record_bound(f"drift over E₀ at {u:g} m/s", error, most=(2.0 * math.pi / 25) ** 2 / 8)
    record_bound("settled over E₀ (1 − e^(−1.5))", taken[0] / (1.0 - math.exp(-1.5)), least=0.995, most=1.005)
    assert taken[1] == pytest.approx(taken[0], abs=6e-5)


@pytest.mark.compiled("contacts")
def test_a_chain_turns_with_its_driven_grain():
    """Settling of a chain at rest, whose first grain is driven to turn: v → w×s and ω → w, at e^(−t/2τ).

    The energy of the motion relative to the rigid rotation, ½ Σ m (w s)² + I w² at first, falls as e^(−t/τ), so that
    after 12 τ no grain is slower or faster than w×s by more than e^(−6) w s √3 = 0.5 % of that of the last grain; to
    this the contacts' modes add less than 1/(2ωτ) of it.  The drive gives the kinetic energy, and what settling takes,
    each of 240 times with a rounding error of 18 × 2⁻²⁵ of it (2⁻⁵³ of the velocity of 2³⁰ masses): in all 1e-4.
    """
    radius, tau, w = 1e-8, 2e-8, 1e5
    chain = sand.setup.chain(3, radius=radius, material="silica")
    driven = sand.Driven([0], spin=[0, 0, w])
    sim = sand.Simulation(chain, [sand.Contact(settling_time=tau)], driven=driven)
    sim.run(until=12 * tau)
    s = sim.grains.position - sim.grains.position[0]
    rigid, fastest = np.cross([0, 0, w], s), w * np.linalg.norm(s[2])
    assert np.abs(sim.grains.velocity - rigid).max() < 0.01 * fastest
    assert np.abs(sim.grains.spin - [0, 0, w]).max() < 0.02 * w
    row, first = sim.ledger.rows[-1], sim.ledger.rows[0]
    assert row["moved"] == 0 and row["lost_settling"] > 0.0 > row["lost_outside"]
    assert abs(row["total"] - first["total"]) < 1e-4 * row["lost_settling"]


@pytest.mark.compiled("contacts")
def test_changes_keep_the_prescribed_motion():
    """`change` of free grains goes on with the drive; of driven ones it is refused, one line for each quantity."""
    sim = sand.Simulation(row_of_grains(3), [sand.Contact()], driven=sand.Driven([2], velocity=[0.01, 0, 0]))
    sim.run(until="1.03 ns")
    with sim.change() as change:
        change.velocity[0] = [0.0, 0.02, 0.0]
    sim.run(until="2 ns")
    assert sim.grains.velocity[2].tolist() == [0.01, 0.0, 0.0] and sim.ledger.drift < 1e-2
    with (
        pytest.raises(BadInput, match=r"^velocity of grain 2 is prescribed.*\nspin of grain 2"),
        sim.change() as change,
    ):
        change.velocity[:], change.spin[2] = 0.0, 1.0


@pytest.mark.compiled("contacts")
def test_driven_grains_keep_their_motion_when_others_are_removed():
    """After grains before it are removed, the held grain is at rest, and its index is the new one."""
    position = [(0.0, 0.0, 0.0), (1e-6, 0.0, 0.0), (1.02e-6, 0.0, 0.0)]
    grains = sand.Grains(
        position, radius="10 nm", material=sand.SILICA, velocity=[(1.0, 0.0, 0.0), (0.0,) * 3, (-0.1, 0.0, 0.0)]
    )
    sim = sand.Simulation(grains, sand.Contact(), driven=sand.Driven([1]))
    sim.run(steps=200)
    with sim.change() as change:
        change.remove([0])
    assert sim.driven == (sand.Driven([0]),)
    sim.run(steps=200)
    assert tuple(sim.grains.position[0]) == position[1]
    assert sim.ledger.drift < 1e-3
    with pytest.raises(sand.BadInput, match="velocity of grain 0 is prescribed"), sim.change() as change:
        change.velocity[0] = 1.0
    with sim.change() as change:
        change.remove([0])
    assert sim.driven == ()


@pytest.mark.parametrize(
    "driven",
    [[sand.Driven([0]), sand.Driven([2], velocity=[0.1, 0, 0])], [sand.Driven([0, 1], spin=[0, 0, 1e5])]],
)
def test_driven_grains_with_several_motions_do_not_settle(driven):
    """In one cluster, there would be no rigid motion to which it settles; one motion of several grains is allowed."""
    contact = [sand.Contact(settling_time="20 ns")]
    with pytest.raises(sand.BadInput, match="driven: contact settling_time needs one motion to which clusters settle"):
        sand.Simulation(row_of_grains(4), contact, driven=driven)
    sand.Simulation(row_of_grains(4), contact, driven=sand.Driven([0, 2], velocity=[0.1, 0, 0]))
