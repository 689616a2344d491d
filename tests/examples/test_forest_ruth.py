"""The example of an integrator of the user: energy error, work of fields, first contact, same bits, case files."""

import math
import sys
import tomllib

import numpy as np
import pytest
import tomli_w
from numpy.polynomial import Polynomial
from scipy.integrate import solve_ivp

import sand
from sand.basics.constants import COULOMB
from sand.basics.errors import BadInput
from sand.basics.state import CONTACTS, FLIGHT, LONG_RANGE_SUMS, MADE, REJECTED, STEPS
from sand.cli.main import main
from sand.config.build import simulation_of
from sand.config.case import check_case
from sand.integrate.registry import INTEGRATORS
from sand.simulation.serialise import case_of

from ..generic.test_integrators import SIZE, SPEED, R, scattering_pair
from ..plugins import ForestRuth, forest_ruth


@pytest.fixture
def registered(monkeypatch):
    """The integrator is known to case files, as after `--import examples/plugins/forest_ruth.py`."""
    monkeypatch.setitem(INTEGRATORS, ForestRuth.name, ForestRuth)


def magnetic_run(grains, stepping=None, **options):
    return sand.Simulation(grains, [sand.Contact(), sand.Dipoles()], stepping=stepping or ForestRuth(), **options)


def approaching(offset, *, radii=(1e-8, 1.7e-8), way=1.3e-6, speed=SPEED):
    """A grain flies along x past another at rest; moments are so small that their forces are negligible."""
    return sand.Grains(
        [[0, 0, 0], [way, offset, 0]], radii, sand.IRON, velocity=[[speed, 0, 0], [0, 0, 0]],
        moment=1e-28 * np.eye(3)[:2],
    )  # fmt: skip


BOX = "0.6 um"


def run_in_rotating_field(grains, stepping, margin="auto"):
    """In a periodic box, with Verlet lists and a rotating field."""
    field = sand.Field([0, 0, "1 mT"], shape="rotating", amplitude=["20 mT", 0, 0], axis=[0, 0, 1], frequency="20 MHz")
    return sand.Simulation(
        grains, [sand.Contact(), sand.Dipoles(cutoff="0.1 um"), field], box=BOX, stepping=stepping,
        neighbours=sand.Neighbours(search="cells", margin=margin),
    )  # fmt: skip


def hot_gas():
    return sand.setup.gas(64, BOX, radius=R, material=sand.IRON, moment="200 A m^2/kg", temperature="3e5 K", seed=3)


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


@pytest.mark.validates(
    "self-consistency",
    "An integrator of your own: the energy error of a fly-by of two dipoles is at most the accuracy asked for",
)
@pytest.mark.compiled("flights")
@pytest.mark.parametrize("accuracy", [1e-4, 1e-6, 1e-8])
def test_the_accuracy_bounds_the_energy_error(record_bound, accuracy):
    """Fly-by of two spinning dipoles: error of the energy below `accuracy` times their largest interaction energy."""
    sim = magnetic_run(scattering_pair(), ForestRuth(accuracy=accuracy), frame_every="0.1 ns")
    sim.run(until="20 ns")
    total = sim.ledger["total"]
    allowed = accuracy * np.abs(sim.ledger["magnetic"]).max() + 1e-14 * total[0]
    record_bound("energy error over that allowed", np.abs(total - total[0]).max() / allowed, most=1.0)
    momentum = sim.grains.mass @ (sim.grains.velocity - sim.start.velocity)
    assert np.abs(momentum).max() < 1e-13 * sim.grains.mass[0] * SPEED
    angular = np.array([sim.ledger[f"angular_momentum_{axis}"] for axis in "xyz"])
    assert np.abs(angular - angular[:, :1]).max() < 1e-13 * sim.grains.mass[0] * SPEED * 2e-7


def bound_pair():
    """Two oppositely charged, spinning magnetic grains in an elliptical orbit; also its energy [J] and period [s]."""
    coulomb, apart = 1e-7 * SIZE**2 / (2 * R) ** 3 * 2 * R, 8 * R
    charge = math.sqrt(coulomb / COULOMB)
    mass = sand.Grains([[0, 0, 0]], R, sand.IRON).mass[0]
    speed = 0.85 * math.sqrt(coulomb / apart / (2 * mass))
    grains = sand.Grains(
        [[-apart / 2, 0, 0], [apart / 2, 0, 0]], R, sand.IRON, velocity=[[0, speed, 0], [0, -speed, 0]],
        charge=[charge, -charge], moment=0.15 * SIZE * np.eye(3)[1:],
        spin=3e7 * np.random.default_rng(2).normal(size=(2, 3)),
    )  # fmt: skip
    # major axis 2a from E/m = v²/2 − GM/r, with the relative velocity: a = r/(2 − rv²/GM)
    major = apart / (2 - 0.85**2)
    return grains, coulomb / apart, 2 * math.pi * math.sqrt(major**3 * mass / (2 * coulomb))


@pytest.mark.validates(
    "self-consistency",
    "A symplectic integrator of your own: the energy error of a bound orbit does not grow",
)
@pytest.mark.compiled("flights")
def test_the_energy_error_of_a_bound_orbit_does_not_grow(record_bound):
    """40 periods with equal steps: error of the last ten periods at most 1.5 times that of the first ten."""
    grains, energy, period = bound_pair()
    stepping = ForestRuth(step=period / 50)
    sim = sand.Simulation(grains, [sand.Charges(), sand.Dipoles()], stepping=stepping, frame_every=period / 7.3)
    sim.run(until=40 * period)
    change = np.abs(sim.ledger["total"] - sim.ledger["total"][0])[1:] / energy
    first, *_, last = (part.max() for part in np.array_split(change, 4))
    assert first < 1e-3
    record_bound("energy error of the last ten periods over that of the first ten", last / first, most=1.5)


@pytest.mark.compiled("flights")
def test_work_of_an_oscillating_and_of_a_ramped_field():
    """One grain, I ω̇ = μ×B, μ̇ = ω×μ, Ẇ = −μ·Ḃ by DOP853: W = −lost_outside and μ to 1e-8; total to rounding.

    The kicks change the kinetic energy by exactly the recorded work of the field, so the total is constant to 1e-13 of
    μB for any step, also where a ramp ends.
    """
    scale = 0.02 * SIZE
    grains = sand.Grains([[0, 0, 0]], R, sand.IRON, moment=[[SIZE, 0, SIZE]], spin=[[1e7, 2e7, 0]])
    omega, unit, inertia = 2 * math.pi * 2e7, 1e-8, grains.inertia[0]
    oscillating = sand.Field([0, 0, "1 mT"], shape="oscillating", amplitude=["20 mT", 0, 0], frequency="20 MHz")
    ramped = sand.Field(["5 mT", 0, 0], shape="ramp", final=["25 mT", 0, 0], start="5 ns", end="42 ns")
    for field, rates_of in (
        (oscillating, lambda t: ([0.02 * math.cos(omega * t), 0, 1e-3], [-0.02 * omega * math.sin(omega * t), 0, 0])),
        (ramped, None),
    ):
        sim = sand.Simulation(grains, [field], stepping=ForestRuth())
        sim.run(until="60 ns")
        row, total = sim.ledger.rows[-1], sim.ledger["total"]
        assert np.abs(total - total[0]).max() < 1e-13 * scale
        assert abs(row["lost_outside"]) > 0.1 * scale
        if rates_of is None:
            continue

        def rates(t, y, rates_of=rates_of):
            b, b_rate = rates_of(t * unit)
            torque, work = SIZE * np.cross(y[:3], b), -SIZE * unit * y[:3] @ b_rate
            return [*np.cross(y[3:6], y[:3]), *(torque / inertia * unit**2), work / scale]

        start = [1, 0, 1, *(unit * grains.spin[0]), 0.0]
        done = solve_ivp(rates, (0, sim.time / unit), start, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
        assert np.abs(sim.grains.moment[0] / SIZE - done[:3]).max() < 1e-8
        assert row["lost_outside"] == pytest.approx(-scale * done[6], abs=1e-8 * scale)


@pytest.mark.compiled("flights")
@pytest.mark.parametrize("part", [0.0, 0.9, 1 - 1e-4])
def test_first_contact_of_a_straight_flight(part):
    """Impact parameter b = part (r1 + r2): contact at t = (L − √((r1 + r2)² − b²))/v, to 1e-9; steps of 20 radii."""
    reach = 2.7e-8
    grains = approaching(part * reach)
    sim = sand.Simulation(grains, [sand.Contact()], stepping=ForestRuth(step=3e-8))
    sim.run(until="140 ns")
    assert sim.state.count[MADE] == 1
    assert sim.state.contacts.formed[0] == pytest.approx(
        (1.3e-6 - reach * math.sqrt(1 - part**2)) / SPEED, rel=1e-9, abs=0.0
    )


@pytest.mark.compiled("flights")
def test_grazing_contact_within_a_long_step():
    """b = (1 ∓ 1e-6)(r1 + r2), a passage of 4e-5 of one step: contact for −, none for +."""
    for side, made in ((-1, 1), (1, 0)):
        grains = approaching(2.7e-8 * (1 + side * 1e-6))
        sim = sand.Simulation(grains, [sand.Contact()], stepping=ForestRuth(step=1.7e-7))
        sim.run(until="200 ns")
        assert sim.state.count[MADE] == made


@pytest.mark.compiled("flights")
@pytest.mark.parametrize(("part", "made"), [(1 - 1e-3, 1), (1 + 1e-3, 0)])
def test_grazing_contact_on_a_curved_path(part, made):
    """Kepler ellipse with the pericentre r_p = part (r1 + r2) in the middle of a step: contact only for part < 1.

    From the apocentre r with r v²/(k/m_reduced) = 2 r_p/(r + r_p), e = 0.6. The grains overlap for half a step, at no
    end of a step; the errors of r_p and of the interpolated path are below 1e-4, those of h⁴ for 101 steps per period.
    """
    far, near, k = 8 * R, part * 2 * R, 1e-26
    mass, charge = sand.Grains([[0, 0, 0]], R, sand.IRON).mass[0], math.sqrt(k / COULOMB)
    speed = math.sqrt(2 * near / (far + near) * k / (far * mass / 2))
    grains = sand.Grains(
        [[0, 0, 0], [far, 0, 0]],
        R,
        sand.IRON,
        charge=[charge, -charge],
        velocity=[[0, speed / 2, 0], [0, -speed / 2, 0]],
    )
    period = 2 * math.pi * math.sqrt(((far + near) / 2) ** 3 * (mass / 2) / k)
    sim = sand.Simulation(grains, [sand.Contact(), sand.Charges()], stepping=ForestRuth(step=period / 101))
    sim.run(until=0.55 * period)
    assert sim.state.count[MADE] == made
    if made:
        assert sim.state.contacts.formed[0] == pytest.approx(period / 2, rel=0.01, abs=0.0)


@pytest.mark.compiled("flights")
def test_first_contact_is_that_of_a_tighter_accuracy():
    """Attracting dipoles: the time of contact converges to 1e-6; few steps are repeated; the ledger closes after it."""
    formed = []
    for accuracy in (1e-12, 1e-8):
        sim = magnetic_run(four_grains(), ForestRuth(accuracy=accuracy))
        while sim.state.count[MADE] == 0:
            sim.run(steps=1)
        formed.append(sim.state.contacts.formed[0])
        assert sim.state.count[LONG_RANGE_SUMS] < 4 * sim.state.count[STEPS] + 4 * forest_ruth.MAX_ATTEMPTS
    assert formed[1] == pytest.approx(formed[0], rel=1e-6, abs=0.0)
    sim.run(steps=2000)
    assert sim.ledger.drift < 1e-3


@pytest.mark.compiled("flights")
def test_long_steps_return_after_a_contact_breaks():
    """Silica at 20 m/s forms a contact, rebounds, and flies on in steps of several radii; made = broken = 1."""
    grains = sand.Grains([[0, 0, 0], [5e-8, 0, 0]], R, sand.SILICA, velocity=[[20.0, 0, 0], [0, 0, 0]])
    sim = sand.Simulation(grains, [sand.Contact()], stepping=ForestRuth())
    sim.run(until="100 ns")
    row = sim.ledger.rows[-1]
    assert (row["made"], row["broken"], row["contacts"]) == (1, 1, 0)
    assert sim.regular_state.clock[FLIGHT] * 20.0 > 3 * R
    assert sim.ledger.drift < 1e-3


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
    sim = sand.Simulation(grains, [sand.Contact()], box=box, stepping=ForestRuth(step="1 us"), neighbours=how)
    sim.run(until=first + 1e-10)
    assert sim.state.count[MADE] == 1
    assert sim.state.contacts.formed[0] == pytest.approx(first, abs=2e-11)


STEP = 0.3


def cubic_motion(rng, box):
    """Two grains on polynomials of degree 3 in time: grains at both ends of a step, and the separation as function."""
    ways = [[Polynomial(rng.normal(size=4)) for _ in range(3)] for _ in range(2)]
    grains = sand.Grains(np.zeros((2, 3)), 1.0, sand.SILICA).arrays
    start = ForestRuth().flight_limits(sand.Grains(np.zeros((2, 3)), 1.0, sand.SILICA), 1.0).start
    for g, way in enumerate(ways):
        for axis, x in enumerate(way):
            for arrays, time in ((start, 0.0), (grains, STEP)):
                arrays.position[axis, g], arrays.velocity[axis, g] = x(time), x.deriv(1)(time)
    apart = np.array([a(0.0) - b(0.0) for a, b in zip(*ways, strict=True)])
    image = box.nearest(apart) - apart
    return grains, start, lambda time: np.array([a(time) - b(time) for a, b in zip(*ways, strict=True)]) + image


@pytest.mark.parametrize("box", [sand.Box.open(), sand.Box.periodic(1.5)])
@pytest.mark.parametrize("seed", range(5))
def test_interpolation_of_cubic_motion_is_exact(box, seed):
    """One polynomial of degree 3 has these positions and velocities at both ends.

    Position and slope at eleven times, to the rounding of terms of about 10: 1e-13.  In a periodic box the image
    nearest at the start is followed.  In plain Python.
    """
    grains, start, apart = cubic_motion(np.random.default_rng(seed), box)
    points = forest_ruth.separation_curve(grains, start, box.span, 0, 1, STEP)
    for part in np.linspace(0.0, 1.0, 11):
        separation, slope = forest_ruth.curve_at(points, part)
        assert separation == pytest.approx(apart(part * STEP), abs=1e-13)
        h = 1e-2  # central differences of a cubic have an error of h²/6 of the third derivative; this one is exact
        rates = [(apart((part + k * h) * STEP) - apart((part - k * h) * STEP)) / (2 * k * h) for k in (1, 2)]
        assert slope == pytest.approx((4 * rates[0] - rates[1]) / 3, abs=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_first_time_within_a_distance(seed):
    """The first of 2001 sampled times at which the distance is below the limit, to one sampling interval."""
    grains, start, apart = cubic_motion(np.random.default_rng(seed), sand.Box.open())
    parts = np.linspace(0.0, 1.0, 2001)
    distance = np.linalg.norm([apart(part * STEP) for part in parts], axis=1)
    limit = distance.min() + 0.3 * (distance[0] - distance.min())
    points = forest_ruth.separation_curve(grains, start, sand.Box.open().span, 0, 1, STEP)
    if distance.argmin() == 0:  # the grains separate: no entry below the initial distance
        assert forest_ruth.first_crossing(points, 0.999 * distance[0]) > 1.0
    else:
        assert forest_ruth.first_crossing(points, limit) == pytest.approx(parts[np.argmax(distance <= limit)], abs=1e-3)


@pytest.mark.compiled("flights")
def test_split_runs_and_frame_interval_change_no_bit():
    """One run, a split run and a run with many frames give the same state, through flight, contact and Verlet."""
    ends = []
    for pieces, every in (((900,), "1 s"), ((1, 2, 3, 894), "1 s"), ((900,), "0.01 ns")):
        sim = magnetic_run(four_grains(), ForestRuth(accuracy=1e-6), frame_every=every)
        for steps in pieces:
            sim.run(steps=steps)
        assert sim.state.count[CONTACTS] > 0
        ends.append(bits(sim))
    assert ends[0] == ends[1] == ends[2]


@pytest.mark.compiled("flights")
@pytest.mark.parametrize("stop", [20, 700])
def test_resume_is_bit_for_bit(registered, tmp_path, stop):
    """Stopped in free flight or with a contact: the resumed run ends in the same bits."""
    stepping = ForestRuth(accuracy=1e-6)
    whole = magnetic_run(four_grains(), stepping, frame_every="1 ns")
    whole.run(steps=900)
    magnetic_run(four_grains(), stepping, out=tmp_path / "run", frame_every="1 ns").run(steps=stop)
    rest = sand.resume(tmp_path / "run")
    assert (rest.state.count[CONTACTS] > 0) == (stop > 100)
    assert rest.stepping == whole.stepping
    rest.run(steps=int(900 - rest.state.steps))  # the first run stopped at the end of an r-RESPA cycle
    assert bits(rest) == bits(whole)


@pytest.mark.compiled("flights")
def test_loads_are_those_of_the_present_positions():
    """Forces after a run, also with a frame in between, are those of a new simulation of the same grains, to 1e-12."""
    sim = magnetic_run(scattering_pair(), ForestRuth())
    sim.run(steps=30)
    g = sim.grains
    again = magnetic_run(sand.Grains(g.position, R, sand.IRON, moment=g.moment, velocity=g.velocity)).loads()
    np.testing.assert_allclose(g.force, again["force"], rtol=0, atol=1e-12 * np.abs(again["force"]).max())
    np.testing.assert_allclose(g.torque, again["torque"], rtol=0, atol=1e-12 * np.abs(again["torque"]).max())


@pytest.mark.compiled("flights")
def test_work_of_gravity_at_periodic_boundaries():
    """A falling grain in a periodic box: −mgL is recorded per crossing; ½mv² + lost_outside + mgz constant, 1e-12."""
    grains = sand.Grains([[0, 0, 0]], R, sand.IRON, velocity=[[0, 0, -1.0]])
    sim = sand.Simulation(
        grains, [sand.Gravity("1e9 m/s^2")], box="0.2 um", stepping=ForestRuth(step="3 ns"), frame_every="10 ns"
    )
    sim.run(until="150 ns")
    crossings = sim.ledger.rows[-1]["lost_outside"] / (grains.mass[0] * 1e9 * 2e-7)
    total = sim.ledger["total"]
    assert abs(crossings) > 10
    assert crossings == pytest.approx(round(crossings), abs=1e-9)
    assert np.abs(total - total[0]).max() < 1e-12 * sim.ledger["translation"][-1]


@pytest.mark.compiled("flights")
def test_a_step_that_moves_a_grain_too_far_is_divided():
    """A fixed step in which a grain would leave the validity of the lists: repeated with 2^-k of it, and counted."""
    sim = run_in_rotating_field(scattering_pair(), ForestRuth(step="20 ns"), margin="20 nm")
    sim.run(steps=1)
    assert sim.state.count[REJECTED] > 1
    assert sim.time * 2 ** int(sim.state.count[REJECTED]) == pytest.approx(2e-8, rel=1e-6, abs=0.0)
    assert np.linalg.norm(sim.grains.velocity, axis=1).max() * sim.time < 5e-9
    assert sim.state.clock[FLIGHT] == 2e-8


@pytest.mark.validate
def test_pair_lists_miss_no_pair():
    """64 fast grains with list margins of 20 and 60 nm: the same first contact, positions equal to 1e-6 r."""
    ends = []
    for margin in ("20 nm", "60 nm"):
        sim = run_in_rotating_field(hot_gas(), ForestRuth(), margin=margin)
        while sim.state.count[MADE] == 0:
            sim.run(steps=1)
        ends.append(sim)
    a, b = ends
    assert a.state.contacts.pair[:, 0].tolist() == b.state.contacts.pair[:, 0].tolist()
    assert a.time == pytest.approx(b.time, rel=1e-8, abs=0.0)
    apart = np.array([sand.Box.periodic("0.6 um").nearest(x) for x in a.grains.position - b.grains.position])
    assert np.abs(apart).max() < 1e-6 * R


def test_wrong_settings_have_a_line_each():
    """Each wrong setting is reported in one line."""
    with pytest.raises(BadInput) as caught:
        ForestRuth(accuracy=1, step="0 s", contact_stepping=3)
    assert len(caught.value.problems) == 3
    for key, line in zip(("accuracy", "step", "contact_stepping"), caught.value.problems, strict=True):
        assert f"stepping: {key}" in line


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
method = "forest-ruth"
"""


def test_case_file_round_trip(registered):
    """[stepping] method = "forest-ruth" is read and written; unknown keys are reported per method."""
    content = tomllib.loads(CASE + 'step = "2 ns"\n[stepping.contact_stepping]\nsteps_per_period = 50\n')
    sim = simulation_of(check_case(content, "some.toml"), None)
    assert sim.stepping == ForestRuth(step=2e-9, contact_stepping=sand.Verlet(steps_per_period=50))
    again = check_case(tomllib.loads(tomli_w.dumps(case_of(sim, 1e-9, math.inf))), "case.toml")
    assert again.stepping == sim.stepping
    for text, expected in (
        ("acuracy = 1e-9", ["stepping.acuracy", "did you mean 'accuracy'?"]),
        ("far = 1", ["stepping.far", "no such key"]),
        ("accuracy = -1", ["stepping: accuracy = -1 must be above 0"]),
        (
            "[stepping.contact_stepping]\nfar_stepps = 3",
            ["stepping.contact_stepping.far_stepps", "did you mean 'far_steps'?"],
        ),
    ):
        with pytest.raises(BadInput) as caught:
            check_case(tomllib.loads(CASE + text), "some.toml")
        assert len(caught.value.problems) == 1
        assert all(part in caught.value.problems[0] for part in expected), caught.value.problems
    with pytest.raises(BadInput, match="did you mean 'forest-ruth'"):
        check_case(tomllib.loads(CASE.replace('"forest-ruth"', '"forestruth"')), "some.toml")


def test_the_command_imports_the_module(registered, tmp_path, monkeypatch, capsys):
    """`sand info CASE --import FILE` knows the method; without the import one line says what to do."""
    monkeypatch.delitem(INTEGRATORS, ForestRuth.name)
    monkeypatch.delitem(sys.modules, "forest_ruth")
    case = tmp_path / "case.toml"
    case.write_text(CASE, "utf-8")
    assert main(["info", str(case)]) == 2
    advice = "allowed: verlet, rigid-clusters; one of your own needs --import MODULE"
    assert f"stepping: method = 'forest-ruth'; {advice}" in capsys.readouterr().err
    assert main(["info", str(case), "--import", forest_ruth.__file__]) == 0
    assert "a valid case" in capsys.readouterr().out
