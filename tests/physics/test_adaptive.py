"""Adaptive Runge–Kutta steps: errors, reversibility, comparison with Verlet and DOP853, events, energy, settings."""

import math
import tomllib

import numpy as np
import pytest
import tomli_w
from scipy.integrate import solve_ivp

import sand
from sand.basics.constants import MAGNETIC
from sand.basics.state import CONTACTS, FLIGHT, MADE, REJECTED
from sand.config.build import simulation_of
from sand.config.case import check_case
from sand.errors import BadInput
from sand.simulation.serialise import case_of

R = 1e-8
SIZE = 200 * sand.IRON.density * 4 / 3 * math.pi * R**3
"""μ of a grain [A m²]."""
SPEED = 10.0
"""[m/s], about √(U/m) of two grains in contact."""


def scattering_pair(**options):
    """Two spinning grains that pass each other with a gap of 2.5 r between surfaces within about 20 ns."""
    spin = 1e8 * np.random.default_rng(2).normal(size=(2, 3))
    return sand.Grains(
        [[0, 0, 0], [6e-8, 4e-8, 0]], R, sand.IRON, moment=SIZE * np.eye(3)[:2], spin=spin,
        velocity=[[SPEED, 0, 0], [0, 0, 0]], **options,
    )  # fmt: skip


def adaptive_run(grains, stepping=None, **options):
    return sand.Simulation(grains, [sand.Contact(), sand.Dipoles()], stepping=stepping or sand.Adaptive(), **options)


def run_to(sim, end):
    """Continue to exactly `end` [s]: the next trial step is limited from outside (`run` alone ends at a whole step)."""
    sim.loads()
    clock = sim.state.clock
    while sim.time < end * (1 - 1e-15):
        clock[FLIGHT] = min(clock[FLIGHT] or 1e-12, end - sim.time)
        sim.run(steps=1)
    assert sim.time == pytest.approx(end, rel=1e-14, abs=0.0)
    return sim


def state_of(grains):
    """Positions, velocities, moments, spins in units of r, SPEED, μ and 1e9 rad/s: about 1 each."""
    return np.array([grains.position / R, grains.velocity / SPEED, grains.moment / SIZE, grains.spin / 1e9])


def reference_solution(grains, end):
    """Two dipoles by DOP853 (order 8, rtol 1e-13) with moments as vectors, μ̇ = ω×μ; formulas in NumPy."""
    unit = R / SPEED
    mass, inertia = grains.mass[0], grains.inertia[0]

    def rates(_, y):
        x, v, (a, b), w = y.reshape(4, 2, 3)
        apart = R * (x[0] - x[1])
        d = np.linalg.norm(apart)
        n, k = apart / d, MAGNETIC * SIZE**2
        force = 3 * k / d**4 * ((a @ n) * b + (b @ n) * a + (a @ b - 5 * (a @ n) * (b @ n)) * n)
        torque = k / d**3 * np.array([np.cross(a, 3 * n * (b @ n) - b), np.cross(b, 3 * n * (a @ n) - a)])
        pull = np.array([force, -force]) / mass * unit / SPEED
        return np.array([v, pull, np.cross(1e9 * unit * w, [a, b]), torque / inertia * unit / 1e9]).ravel()

    done = solve_ivp(rates, (0, end / unit), state_of(grains).ravel(), method="DOP853", rtol=1e-13, atol=1e-14)
    return done.y[:, -1].reshape(4, 2, 3)


@pytest.mark.compiled("adaptive")
def test_the_error_is_proportional_to_the_tolerance():
    """Steps h ∝ tol^(1/5), local error h⁶, global error h⁵ ∝ tol: error < 4 tol, falling by 10 (5 … 20) per decade.

    The reference is SciPy's DOP853, accurate to about 1e-13.
    """
    tolerances = 10.0 ** -np.arange(4, 12)
    errors = []
    for tolerance in tolerances:
        sim = adaptive_run(scattering_pair(), sand.Adaptive(tolerance=tolerance))
        sim.run(until="20 ns")
        assert sim.state.count[MADE] == 0
        errors.append(np.abs(state_of(sim.grains) - reference_solution(sim.start, sim.time)).max())
    ratios = np.divide(errors[:-1], errors[1:])
    assert (np.array(errors) < 4 * tolerances).all()
    assert (ratios[1:] > 5).all()
    assert (ratios[1:] < 20).all()


@pytest.mark.compiled("adaptive")
def test_each_error_bound_limits_the_step():
    """Three loose error bounds and one tight: steps are those of the tight bound, and shorter for a tighter bound."""
    loose = {"position_error": 1.0, "velocity_error": 1e9, "turn_error": 1e9, "spin_error": 1e30}
    auto = adaptive_run(scattering_pair()).stepping
    most = adaptive_run(scattering_pair(), sand.Adaptive(**loose)).run(until="20 ns").steps
    for key in loose:
        steps = [
            adaptive_run(scattering_pair(), sand.Adaptive(**(loose | {key: part * getattr(auto, key)})))
            .run(until="20 ns")
            .steps
            for part in (1.0, 1e-3)
        ]
        assert most < steps[0] < steps[1]
        # order 5: (1e-3)^(-1/5) = 4; the first and the last step are not set by the error
        assert 2.5 < steps[1] / steps[0] < 5


@pytest.mark.compiled("adaptive")
def test_time_reversed_scattering_returns_to_the_start():
    """Velocities and spins are reversed at the end: after the same time the start is reached to 1e-6 of r, v, μ, ω.

    The error of both runs is the tolerance, 1e-9, times the growth of errors in a scattering event, less than 100 here.
    """
    there = run_to(adaptive_run(scattering_pair()), 2e-8)
    g = there.grains
    back = sand.Grains(
        g.position, R, sand.IRON, moment=g.moment, velocity=-g.velocity, spin=-g.spin,
    )  # fmt: skip
    returned = run_to(adaptive_run(back), 2e-8).grains
    found, start = state_of(returned), state_of(there.start)
    assert np.abs(found - start * np.array([1, -1, 1, -1])[:, None, None]).max() < 1e-6
    assert np.abs(state_of(g)[0] - start[0]).max() > 10


@pytest.mark.validate
def test_verlet_converges_to_the_adaptive_solution():
    """The error of Verlet with steps of 1/8, 1/16, 1/32 of 0.2 ns falls by 4 per halving (order 1.9 … 2.1).

    The error of the adaptive run, 1e-9, is a thousandth of the smallest of these.
    """
    end = 100 * 2e-10
    exactly = state_of(run_to(adaptive_run(scattering_pair()), end).grains)
    errors = []
    for parts in (8, 16, 32):
        sim = adaptive_run(scattering_pair(), sand.Verlet(step=2e-10 / parts))
        sim.run(steps=100 * parts)
        errors.append(np.abs(state_of(sim.grains) - exactly).max())
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert ((orders > 1.9) & (orders < 2.1)).all()


def approaching(offset, *, radii=(1e-8, 1.7e-8), way=1.3e-6, speed=SPEED):
    """A grain flies along x past another at rest; moments are so small that their forces are negligible."""
    return sand.Grains(
        [[0, 0, 0], [way, offset, 0]], radii, sand.IRON, velocity=[[speed, 0, 0], [0, 0, 0]],
        moment=1e-28 * np.eye(3)[:2],
    )  # fmt: skip


@pytest.mark.compiled("adaptive")
@pytest.mark.parametrize("part", [0.0, 0.3, 0.9, 1 - 1e-4])
def test_time_of_first_contact(part):
    """Impact parameter b = part (r1 + r2): contact at t = (L − √((r1 + r2)² − b²))/v, to 1e-9.

    The contact forms at an overlap of up to 1e-12 (r1 + r2), a path of that over √(1 − part²), here 1e-10 (r1 + r2).
    """
    reach = 2.7e-8
    sim = adaptive_run(approaching(part * reach))
    sim.run(until="140 ns")
    assert sim.state.count[MADE] == 1
    assert sim.state.contacts.formed[0] == pytest.approx(
        (1.3e-6 - reach * math.sqrt(1 - part**2)) / SPEED, rel=1e-9, abs=0.0
    )


@pytest.mark.compiled("adaptive")
def test_grazing_contact_and_near_miss():
    """b = (1 ∓ 1e-6)(r1 + r2) within one long step: contact for −, none for +.  Dipole forces deflect by less."""
    for side, made in ((-1, 1), (1, 0)):
        sim = adaptive_run(approaching(2.7e-8 * (1 + side * 1e-6)))
        sim.run(until="200 ns")
        assert sim.state.count[MADE] == made
        if not made:
            longest = sim._engine.parameters.criteria.longest
            assert sim.state.clock[FLIGHT] == longest > 10 * 2.7e-8 / SPEED


@pytest.mark.validate
def test_energy_balance_after_contact_is_that_of_verlet():
    """Two iron grains stick at 10 m/s: energy error at most 1.5 times that of a Verlet run, plus 1e-8.

    Before contact the error is 1e-8 (Verlet) and 1e-9 (adaptive); afterwards both runs use Verlet.
    """
    drifts = []
    for stepping in (sand.Adaptive(), sand.Verlet()):
        grains = sand.Grains(
            [[0, 0, 0], [5e-8, 5e-9, 0]], R, sand.IRON, moment=SIZE * np.eye(3)[:2], velocity=[[SPEED, 0, 0], [0, 0, 0]]
        )
        sim = adaptive_run(grains, stepping, frame_every="0.1 ns")
        sim.run(until="6 ns")
        assert sim.state.count[CONTACTS] == 1
        drifts.append(np.abs(sim.ledger["total"] - sim.ledger["total"][0]).max() / sim.ledger.dissipated)
    assert drifts[0] < 1.5 * drifts[1] + 1e-8


@pytest.mark.compiled("adaptive")
def test_long_steps_return_after_a_contact_breaks():
    """Silica at 20 m/s forms a contact, rebounds, and flies on in steps of the largest size; made = broken = 1."""
    moment = 1e-28 * np.eye(3)[:2]
    grains = sand.Grains([[0, 0, 0], [5e-8, 0, 0]], R, sand.SILICA, moment=moment, velocity=[[20.0, 0, 0], [0, 0, 0]])
    sim = adaptive_run(grains)
    sim.run(until="100 ns")
    row = sim.ledger.rows[-1]
    assert (row["made"], row["broken"], row["contacts"]) == (1, 1, 0)
    assert sim.state.clock[FLIGHT] == sim._engine.parameters.criteria.longest
    assert sim.ledger.drift < 1e-3


@pytest.mark.compiled("adaptive")
def test_momentum_angular_momentum_and_energy():
    """P is constant to rounding; errors of L and E are bounded by the tolerance.

    L is a quadratic invariant: a step changes it by at most Σ (m |v| Δx + m |x| Δv + I Δω).
    """
    rng = np.random.default_rng(5)
    corners = np.array([[x, y, z] for x in range(2) for y in range(2) for z in range(2)])
    moment = rng.normal(size=(8, 3))
    moment *= SIZE / np.linalg.norm(moment, axis=1)[:, None]
    positions = 7e-8 * corners + 5e-9 * rng.normal(size=(8, 3))
    grains = sand.Grains(positions, R, sand.IRON, moment=moment, velocity=rng.normal(size=(8, 3)))
    changes = []
    for tolerance in (1e-9, 1e-12):
        sim = adaptive_run(grains, sand.Adaptive(tolerance=tolerance))
        steps = sim.run(until="4 ns").steps
        assert sim.state.count[MADE] == 0
        ledger, s, g = sim.ledger, sim.stepping, sim.grains
        p, angular = (np.array([ledger[f"{k}_{a}"] for a in "xyz"]) for k in ("momentum", "angular_momentum"))
        speed, reach = np.linalg.norm(g.velocity, axis=1), np.linalg.norm(g.position, axis=1)
        assert np.abs(p - p[:, :1]).max() < 1e-14 * (g.mass * speed).sum()
        allowed = (g.mass * (speed * s.position_error + reach * s.velocity_error) + g.inertia * s.spin_error).sum()
        changes.append([np.abs(angular - angular[:, :1]).max(), np.abs(ledger["total"] - ledger["total"][0]).max()])
        assert changes[-1][0] < steps * allowed
    assert (np.array(changes[1]) < 0.01 * np.array(changes[0])).all()


BOX = "0.6 um"


def run_in_rotating_field(grains, stepping=None, margin="auto", **options):
    """In a periodic box, with Verlet lists and a rotating field."""
    field = sand.Field([0, 0, "1 mT"], shape="rotating", amplitude=["20 mT", 0, 0], axis=[0, 0, 1], frequency="20 MHz")
    return sand.Simulation(
        grains, [sand.Contact(), sand.Dipoles(cutoff="0.1 um"), field], box=BOX, stepping=stepping or sand.Adaptive(),
        neighbours=sand.Neighbours(search="cells", margin=margin), **options,
    )  # fmt: skip


@pytest.mark.validate
def test_work_of_a_rotating_field():
    """One grain, I ω̇ = μ×B, μ̇ = ω×μ, Ẇ = −μ·Ḃ by DOP853: W = −lost_outside; total constant to 1e-7 of μB.

    The tolerance is about a hundred steps with an error of 1e-9 each.
    """
    grains = sand.Grains([[0, 0, 0]], R, sand.IRON, moment=[[SIZE, 0, SIZE]], spin=[[1e7, 2e7, 0]])
    sim = run_in_rotating_field(grains)
    sim.run(until="100 ns")
    unit, omega, inertia = 1e-8, 2 * math.pi * 2e7, grains.inertia[0]

    def rates(t, y):
        c, s = 0.02 * math.cos(omega * t * unit), 0.02 * math.sin(omega * t * unit)
        torque = SIZE * np.cross(y[:3], [c, s, 1e-3])
        work = -SIZE * y[:3] @ [-omega * s, omega * c, 0.0]
        return [*np.cross(y[3:6], y[:3]), *(torque / inertia * unit**2), work * unit / (0.02 * SIZE)]

    start = [1, 0, 1, *(unit * grains.spin[0]), 0.0]
    done = solve_ivp(rates, (0, sim.time / unit), start, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    row, scale = sim.ledger.rows[-1], 0.02 * SIZE
    assert np.abs(sim.grains.moment[0] / SIZE - done[:3]).max() < 1e-7
    assert abs(done[6]) > 0.1
    assert row["lost_outside"] == pytest.approx(-scale * done[6], abs=1e-7 * scale)
    assert np.abs(sim.ledger["total"] - sim.ledger["total"][0]).max() < 1e-7 * scale


def hot_gas():
    return sand.setup.gas(64, BOX, radius=R, material=sand.IRON, moment="200 A m^2/kg", temperature="3e5 K", seed=3)


@pytest.mark.validate
def test_pair_lists_miss_no_pair():
    """64 fast grains with list margins of 20 and 60 nm: the same first contact, positions equal to 1e-6 r.

    An outdated list misses pairs, whose forces are at least 1e-3 of the force at contact.
    """
    ends = []
    for margin in ("20 nm", "60 nm"):
        sim = run_in_rotating_field(hot_gas(), margin=margin)
        while sim.state.count[MADE] == 0:
            sim.run(steps=1)
        ends.append(sim)
    a, b = ends
    assert a.state.count[10] > b.state.count[10] > 1  # number of list builds
    assert a.state.contacts.pair[:, 0].tolist() == b.state.contacts.pair[:, 0].tolist()
    assert a.time == pytest.approx(b.time, rel=1e-8, abs=0.0)
    apart = np.array([sand.Box.periodic(BOX).nearest(x) for x in a.grains.position - b.grains.position])
    assert np.abs(apart).max() < 1e-6 * R
    # no grains overlap but the pair in contact
    from scipy.spatial import cKDTree

    tree = cKDTree(np.mod(a.grains.position + 3e-7, 6e-7), boxsize=6e-7)
    assert len(tree.query_pairs(2 * R * (1 - 1e-9))) == 0


def four_grains():
    """Four grains; the first two make contact after about 6 ns."""
    rng = np.random.default_rng(8)
    return sand.Grains(
        [[0, 0, 0], [8e-8, 4e-9, 0], [0, 9e-8, 0], [0, 0, 1.1e-7]], R, sand.IRON,
        moment=SIZE * np.array([[1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
        velocity=[[SPEED, 0, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0]], spin=1e8 * rng.normal(size=(4, 3)),
    )  # fmt: skip


def bits(sim):
    """All arrays of the state, as bytes."""
    return {name: array.tobytes() for name, array in sim.state.to_arrays().items()}


@pytest.mark.validate
@pytest.mark.parametrize("lengths", [(3e-7, 3e-7, 3e-7), (3e-7, None, None)])
@pytest.mark.parametrize("margin", ["auto", "1 um"])
def test_contacts_with_periodic_images_are_found(lengths, margin):
    """Two grains make contact when the nearest image is at 2r, however wide the list: steps are below half a box.

    They fly freely; the expected time is that of the first overlap, sampled every 10 ps (1e-11 m of path).
    """
    y = -3e-8 if lengths[1] else -1.4e-8
    grains = sand.Grains([[0, 0, 0], [1e-7, y, 0]], R, sand.SILICA, velocity=[[-1.0, -0.011, 0.0], [0, 0, 0]])
    box = sand.Box(lengths)
    time = np.arange(0.0, 2e-6, 1e-11)[:, None]
    apart = box.nearest(grains.position[0] + time * grains.velocity[0] - grains.position[1])
    first = time[np.argmax((apart**2).sum(axis=1) <= (2 * R) ** 2), 0]
    assert first > 1e-7
    how = sand.Neighbours("cells", margin)
    sim = sand.Simulation(grains, [sand.Contact()], box=box, stepping=sand.Adaptive(), neighbours=how)
    sim.run(until=first + 1e-10)
    assert sim.state.count[MADE] == 1
    assert sim.state.contacts.formed[0] == pytest.approx(first, abs=2e-11)


@pytest.mark.compiled("adaptive")
def test_split_runs_and_frame_interval_change_no_bit():
    """One run, a split run and a run with many frames give the same state, through flight, contact and Verlet."""
    ends = []
    for pieces, every in (((600,), "1 s"), ((1, 2, 3, 594), "1 s"), ((600,), "0.01 ns")):
        sim = adaptive_run(four_grains(), frame_every=every)
        for steps in pieces:
            sim.run(steps=steps)
        assert sim.state.count[CONTACTS] > 0
        ends.append(bits(sim))
    assert ends[0] == ends[1] == ends[2]


@pytest.mark.compiled("adaptive")
@pytest.mark.parametrize("stop", [20, 400])
def test_resume_is_bit_for_bit(tmp_path, stop):
    """Stopped in free flight or with a contact: the resumed run ends in the same bits, with the same error bounds."""
    whole = adaptive_run(four_grains(), frame_every="1 ns")
    whole.run(steps=600)
    adaptive_run(four_grains(), out=tmp_path / "run", frame_every="1 ns").run(steps=stop)
    rest = sand.resume(tmp_path / "run")
    assert (rest.state.count[CONTACTS] > 0) == (stop > 100)
    assert rest.stepping == whole.stepping
    rest.run(steps=int(600 - rest.state.steps))  # the first run stopped at the end of an r-RESPA cycle
    assert bits(rest) == bits(whole)


@pytest.mark.compiled("adaptive")
def test_rejected_steps():
    """A first step that is too long is rejected and counted; the final error stays within the tolerance."""
    sim = adaptive_run(scattering_pair())
    sim.loads()
    sim.state.clock[FLIGHT] = 1e-8
    sim.run(steps=1)
    assert sim.state.count[REJECTED] > 1
    assert sim.state.clock[FLIGHT] < 1e-9
    run_to(sim, 2e-8)
    assert np.abs(state_of(sim.grains) - reference_solution(sim.start, 2e-8)).max() < 4e-9


@pytest.mark.compiled("adaptive")
def test_step_underflow_ends_the_run():
    """Attracting dipoles without contacts collapse, F ∝ 1/r⁴: outcome NO_STEP, with finite positions."""
    along = SIZE * np.array([[1.0, 0, 0], [1.0, 0, 0]])
    grains = sand.Grains([[0, 0, 0], [4e-8, 0, 0]], R, sand.IRON, moment=along)
    sim = adaptive_run(grains)
    settings = sim._engine.parameters.settings._replace(on=False)
    sim._engine.parameters = sim._engine.parameters._replace(settings=settings)
    sim._engine._table.set("settings", settings)
    result = sim.run(until="1 us")
    assert result.outcome is sand.Outcome.NO_STEP
    assert result.grains != ()
    assert np.isfinite(sim.grains.position).all()


def test_wrong_settings_have_a_line_each():
    """Each wrong setting is reported in one line; defaults and given error bounds are as documented."""
    with pytest.raises(BadInput) as caught:
        sand.Adaptive(
            tolerance=0, position_error="1 s", velocity_error=-1, turn_error="tight", contact_stepping="verlet"
        )
    lines = caught.value.problems
    assert len(lines) == 5
    for key, line in zip(
        ("tolerance", "position_error", "velocity_error", "turn_error", "contact_stepping"), lines, strict=True
    ):
        assert f"stepping: {key}" in line
    settled = adaptive_run(sand.Grains([[0, 0, 0], [1e-7, 0, 0]], R, sand.IRON, moment=1e-28 * np.eye(3)[:2])).stepping
    assert settled.position_error == 1e-9 * R
    assert settled.velocity_error > 0
    assert settled.spin_error > 0
    given = adaptive_run(scattering_pair(), sand.Adaptive(position_error="1 pm", spin_error="1e3 rad/s")).stepping
    assert (given.position_error, given.spin_error) == (pytest.approx(1e-12, rel=1e-6, abs=0.0), 1e3)


CASE = """
[run]
until = "1 ns"
[box]
periodic = "400 nm"
[grains]
number = 3
moment = "200 A m^2/kg"
radius = "10 nm"
[forces.dipoles]
[stepping]
method = "adaptive"
"""


def test_case_file_round_trip():
    """[stepping] method = "adaptive" is read and written; unknown keys are reported per method."""
    content = tomllib.loads(CASE + 'spin_error = "1e3 rad/s"\n[stepping.contact_stepping]\nsteps_per_period = 50\n')
    sim = simulation_of(check_case(content, "some.toml"), None)
    assert sim.stepping.spin_error == 1e3
    assert sim.stepping.contact_stepping == sand.Verlet(steps_per_period=50)
    again = check_case(tomllib.loads(tomli_w.dumps(case_of(sim, 1e-9, math.inf))), "case.toml")
    assert again.stepping == sim.stepping
    for text, expected in (
        ("tolerence = 1e-9", ["stepping.tolerence", "did you mean 'tolerance'?"]),
        ("step = 1e-9", ["stepping.step", "no such key"]),
        ("tolerance = -1", ["stepping: tolerance = -1 must be above 0"]),
        (
            "[stepping.contact_stepping]\nfar_stepps = 3",
            ["stepping.contact_stepping.far_stepps", "did you mean 'far_steps'?"],
        ),
    ):
        with pytest.raises(BadInput) as caught:
            check_case(tomllib.loads(CASE + text), "some.toml")
        assert len(caught.value.problems) == 1
        assert all(part in caught.value.problems[0] for part in expected), caught.value.problems
    with pytest.raises(BadInput, match="did you mean 'adaptive'"):
        check_case(tomllib.loads(CASE.replace('"adaptive"', '"adaptiv"')), "some.toml")
