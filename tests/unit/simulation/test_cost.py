"""Expected cost of a run: steps, wall time, memory and compilation, and the table that runs write."""

import csv
import errno
import json
import math
from pathlib import Path

import numpy as np
import pytest

import sand
from sand.basics.constants import BOLTZMANN, COULOMB, MAGNETIC
from sand.basics.state import CONTACTS
from sand.cli.main import main
from sand.compiler.cache import write_record
from sand.engine.assemble import build_engine
from sand.experiments.templates import TEMPLATES
from sand.simulation.cadence import number_in, read_cadence
from sand.simulation.cost import coagulation, cost
from sand.simulation.cost import expected_steps as steps
from sand.theory.contact import contact
from sand.theory.kinetics import brownian, capture

EXAMPLES = Path(__file__).parents[3] / "examples"

CASE = """
[run]
until = "1 us"
[box]
periodic = "1 um"
[grains]
number = 20
radius = "20 nm"
material = "silica"
temperature = "300 K"
[forces.contact]
damping = "critical"
"""
GASES = {
    count: sand.Grains(3e-8 * np.argwhere(np.ones((7, 7, 7)))[:count] * 1.5 - 1e-7, "20 nm", "silica")
    for count in (20, 40, 220)
}


@pytest.fixture(autouse=True)
def table(tmp_path, monkeypatch):
    """An empty table of speeds for each test."""
    monkeypatch.setattr(cost, "cache_folder", lambda: tmp_path / "cache" / "code")
    (tmp_path / "cache").mkdir()
    return tmp_path / "cache" / "step-speeds.json"


def simulation(count=20, **changes):
    case = {"box": "1 um", "seed": 1} | changes
    return sand.Simulation(GASES[count], [sand.Contact()], **case)


def engine_like(sim):
    """An engine of its own for the same grains, forces and settings."""
    return build_engine(sim.start, sim.forces, sim.box, sim.stepping, sim.neighbours, fresh=False)


def rows(capsys, *words):
    assert main(["info", *map(str, words)]) == 0
    return dict(line.strip().split("  ", 1) for line in capsys.readouterr().out.splitlines()[1:])


def test_the_step_with_contacts_is_a_fraction_of_the_fastest_period():
    """Δt = 2π/(ω n) with ω² the largest of the four modes of two grains."""
    c = contact("silica", "20 nm")
    fastest = min(c.normal_period, c.slide_period, c.roll_period, c.twist_period)
    assert steps.contact_step(simulation()) == pytest.approx(fastest / 25.0, rel=1e-9, abs=0.0)
    half = simulation(stepping=sand.Verlet(steps_per_period=50.0))
    assert steps.contact_step(half) == pytest.approx(fastest / 50.0, rel=1e-9, abs=0.0)


def test_free_grains_have_the_step_of_their_flight():
    """Without contacts: at most a sixteenth of the smallest radius, and 0.05 rad, in one step."""
    grains = sand.Grains([[0, 0, 0], [1e-6, 0, 0]], 1e-8, "iron", velocity=[[3, 0, 4], [0, 0, 0]], spin=[0, 1e9, 0])
    step = min(1e-8 / 16 / 5, 0.05 / 1e9)
    assert steps.flight_step(sand.Simulation(grains)) == pytest.approx(step, rel=1e-12, abs=0.0)
    found = steps.expected_steps(sand.Simulation(grains), 1e-9, math.inf)
    assert (found.free, found.contact) == (pytest.approx(1e-9 / step, rel=1e-12, abs=0.0), 0.0)


def thermal(count, side, kelvin, **options):
    """A gas of iron grains of 10 nm radius with the same speed √(3kT/m) in different directions, on a lattice."""
    sites = np.argwhere(np.ones((6, 6, 6)))[:count] * side / 6.0
    direction = np.random.default_rng(1).normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    mass = sand.Grains([[0, 0, 0]], 1e-8, "iron").mass[0]
    speed = math.sqrt(3.0 * BOLTZMANN * kelvin / mass)
    return sand.Grains(sites - side / 2.0, 1e-8, "iron", velocity=speed * direction, **options)


def test_the_time_of_coagulation_is_that_of_the_kernels():
    """τ = 2/(K n): K of the ballistic kernel of two grains, and ⟨σv⟩ of magnetic capture with c = 0.5, at kT."""
    side, kelvin = 1.5e-6, 100.0
    gas = thermal(100, side, kelvin)
    mass, density = float(gas.mass[0]), 100 / side**3
    plain = sand.Simulation(gas, [sand.Contact()], box=side)
    found = coagulation.coagulation_time(plain, coagulation.bodies_of(plain))
    assert found == pytest.approx(2.0 / (brownian(1e-8, mass, kelvin)(mass, mass) * density), rel=1e-6, abs=0.0)
    moment = 200.0 * mass
    magnets = sand.Simulation(
        thermal(100, side, kelvin, moment=[moment, 0, 0]), [sand.Contact(), sand.Dipoles()], box=side
    )
    found = coagulation.coagulation_time(magnets, coagulation.bodies_of(magnets))
    # σ of Eq. 14, averaged over the relative speeds of 10⁵ draws: σv ∝ v^(−1/3) has a relative error of 0.1 %
    alpha, reduced = 2.0 * MAGNETIC * moment**2, 0.5 * mass
    drawn = np.random.default_rng(2).normal(size=(100_000, 3)) * math.sqrt(BOLTZMANN * kelvin / reduced)
    speed = np.linalg.norm(drawn, axis=1)
    rate = 0.5 * 3.0 * math.pi * (alpha / (reduced * speed**2)) ** (2.0 / 3.0) * speed
    assert found == pytest.approx(2.0 / (float(rate.mean()) * density), rel=0.005, abs=0.0)
    theory = capture(1e-8, mass, moment, kelvin, speed="thermal", c=0.5)
    assert found == pytest.approx(2.0 / (theory(mass, mass) * density), rel=1e-6, abs=0.0)


@pytest.mark.filterwarnings("ignore:charges. the cut-off, .* ends an interaction")
def test_charges_focus_bodies():
    """σ/σ₀ is the mean of 1 − U/kT over pairs, not below 0: U/kT = ±5 in a neutral mixture gives (6 + 0)/2 = 3."""
    side, kelvin = 1.5e-6, 100.0
    gas = thermal(100, side, kelvin)
    charge = math.sqrt(5.0 * BOLTZMANN * kelvin * 2e-8 / COULOMB)
    charged = sand.Grains(
        gas.position, 1e-8, "iron", velocity=gas.velocity, charge=charge * np.where(np.arange(100) % 2, 1.0, -1.0)
    )
    plain, other = (
        sand.Simulation(one, forces, box=side)
        for one, forces in ((gas, [sand.Contact()]), (charged, [sand.Contact(), sand.Charges(cutoff="0.5 um")]))
    )
    times = [coagulation.coagulation_time(one, coagulation.bodies_of(one)) for one in (plain, other)]
    assert times[0] / times[1] == pytest.approx(3.0, rel=1e-9, abs=0.0)


def test_steps_before_and_after_the_first_touch():
    """Free steps up to τ/N, contact steps from there; a limit of steps takes the free ones first."""
    side = 1.5e-6
    sim = sand.Simulation(thermal(100, side, 100.0), [sand.Contact()], box=side)
    first = coagulation.coagulation_time(sim, coagulation.bodies_of(sim)) / 100
    long, short = steps.flight_step(sim), steps.contact_step(sim)
    found = steps.expected_steps(sim, 3.0 * first, math.inf)
    assert found.free == pytest.approx(first / long, rel=1e-9, abs=0.0)
    assert found.contact == pytest.approx(2.0 * first / short, rel=1e-9, abs=0.0)
    assert (found.bound, found.span) == ("", pytest.approx(3.0 * first, rel=1e-9, abs=0.0))
    few = steps.expected_steps(sim, math.inf, 0.5 * first / long)
    assert few.contact == 0.0 and few.span == pytest.approx(0.5 * first, rel=1e-9, abs=0.0)
    # of n bodies N₀ (1 − ln(1 + x)/x) have merged on average up to x τ
    x = 3.0 / 100
    assert found.contacts == pytest.approx(100 * (1.0 - math.log(1.0 + x) / x), rel=1e-9, abs=0.0)


def test_what_cannot_be_known_is_a_bound():
    """In open space the first touch is unknown, and a condition may end a run: at most so many steps."""
    open_gas = sand.Simulation(thermal(20, 1e-6, 100.0), [sand.Contact()])
    assert steps.expected_steps(open_gas, 1e-9, math.inf).bound == "at most"
    assert steps.expected_steps(simulation(), 1e-9, math.inf, may_end_earlier=True).bound == "at most"
    stuck = sand.Simulation(sand.setup.chain(3, radius="10 nm", material="iron"), [sand.Contact()])
    assert steps.expected_steps(stuck, 1e-9, math.inf).bound == ""


def test_contact_steps_of_rigid_clusters_follow_the_touches():
    """N x/(1 + x) touches with awake time 3 t_awake each, but never more than the run is long."""
    side = 1.5e-6
    forces = [sand.Contact(damping="critical", settling_time="5 ns")]
    sim = sand.Simulation(thermal(100, side, 100.0), forces, box=side, stepping=sand.RigidClusters())
    tau, awake = (
        coagulation.coagulation_time(sim, coagulation.bodies_of(sim)),
        engine_like(sim).parameters.flight_limits.longest_awake,
    )
    found = steps.expected_steps(sim, tau, math.inf)
    assert found.awake == pytest.approx(50.0 * 3.0 * awake / steps.contact_step(sim), rel=1e-9, abs=0.0)
    assert found.free == found.contact == 0.0 and found.bodies > 0.0
    brief = steps.expected_steps(sim, 1e-15, math.inf)
    assert brief.awake <= 1e-15 / steps.contact_step(sim) * (1.0 + 1e-12)


def test_the_fastest_of_many_thermal_grains():
    """Of 200 spheres with three Maxwell components √(kT/I) the fastest has the spin stated, in the median of draws.

    The median of the largest x = I ω²/2kT has the tail ln 2/200, the formula 1/201: x, about 6.5 with a tail
    ∝ √x e^(−x), differs by 0.37/0.92, the spin by 3.1 %; the median of 4000 draws has an error of 0.2 %.
    """
    gas = thermal(200, 1e-5, 100.0)
    sim = sand.Simulation(gas, [sand.Contact()], box=1e-5)
    inertia, energy = float(gas.inertia[0]), BOLTZMANN * 100.0
    spins = math.sqrt(energy / inertia) * np.random.default_rng(5).normal(size=(4000, 200, 3))
    largest = float(np.median(np.linalg.norm(spins, axis=2).max(axis=1)))
    found = steps.thermal_spin(energy, coagulation.bodies_of(sim))
    assert found == pytest.approx(largest, rel=0.04, abs=0.0) and found < largest


def test_heavy_bodies_do_not_turn_as_fast():
    """A hundred times the inertia: of one light and many heavy bodies the light one is the fastest, its tail 1/2."""
    grains = sand.Grains(
        1e-6 * np.arange(9)[:, None] * [1.0, 0.0, 0.0] - 4e-6, np.r_[1e-8, np.full(8, 1e-8 * 100**0.2 * 2)], "iron"
    )
    sim = sand.Simulation(grains, [sand.Contact()], box="10 um")
    found = steps.thermal_spin(BOLTZMANN * 100.0, coagulation.bodies_of(sim))
    # P(x > 1.183) = 1/2 for Γ(3/2), half of the median 2.366 of χ² with three degrees of freedom
    light = math.sqrt(2.0 * BOLTZMANN * 100.0 * 1.183 / float(grains.inertia[0]))
    assert found == pytest.approx(light, rel=1e-3, abs=0.0)


def test_the_spin_of_touches_is_that_of_the_approach():
    """⟨L²⟩/2I of captured dipoles: kinetic energies x kT with x from Γ(4/3), b² uniform up to σ/π, L = m̄ v b.

    The rate of captures at energy E is σ v f ∝ E^(−2/3) E e^(−E/kT).  With 10⁵ draws the mean has an error of 0.2 %,
    and (2x)^(1/3) has the mean 1.274 beside 2^(1/3) = 1.260 in the formula; the spin is the root of it.
    """
    side, kelvin = 1.5e-6, 100.0
    mass = float(thermal(1, side, kelvin).mass[0])
    gas = thermal(100, side, kelvin, moment=[200.0 * mass, 0, 0])
    sim = sand.Simulation(gas, [sand.Contact(), sand.Dipoles()], box=side)
    bodies, rng = coagulation.bodies_of(sim), np.random.default_rng(3)
    energy, reduced = 2.0 * rng.gamma(4.0 / 3.0, size=100_000) * BOLTZMANN * kelvin, 0.5 * mass
    alpha = 2.0 * MAGNETIC * (200.0 * mass) ** 2
    farthest = 3.0 * 0.5 * (alpha / energy) ** (2.0 / 3.0)
    square = reduced * energy * farthest * rng.random(100_000)
    inertia = 2.0 * (float(gas.inertia[0]) + mass * 1e-16)
    mean = math.sqrt(float(square.mean())) / inertia
    assert steps.touch_spin(sim, bodies, math.e - 1.0) == pytest.approx(mean, rel=0.01, abs=0.0)
    assert steps.touch_spin(sim, bodies, 0.0) == 0.0
    assert steps.touch_spin(sim, bodies, math.e**4 - 1.0) == pytest.approx(2.0 * mean, rel=0.01, abs=0.0)


def test_the_step_of_bodies_follows_the_fastest_rotor():
    """One radian in a step, at steps of a half, a quarter, … of the longest, whose mean 1/h is 1/ln 2 of the rate."""
    forces, side = [sand.Contact(damping="critical", settling_time="5 ns")], 1e-4
    sim = sand.Simulation(thermal(20, side, 100.0, spin=[0, 0, 1e8]), forces, box=side, stepping=sand.RigidClusters())
    found = steps.body_step(sim, coagulation.bodies_of(sim), 1e-6)
    logarithm = np.linspace(0.0, 1.0, 10_001)[:-1]  # of the rate to base 2, between two steps
    mean = float((2.0 ** (1.0 - logarithm)).mean())  # 1/h over the rate
    assert found == pytest.approx(1.0 / (mean * 1e8), rel=1e-4, abs=0.0)
    # without any rate the longest step of all
    still = sand.Simulation(sand.Grains([[0, 0, 0]], 1e-8, "iron"), forces, stepping=sand.RigidClusters())
    longest = engine_like(still).parameters.criteria.longest
    assert steps.body_step(still, coagulation.bodies_of(still), 1e-6) == pytest.approx(longest, rel=1e-12, abs=0.0)


def test_a_gas_replaces_the_spins_and_slows_those_of_touches():
    """After a stopping time spins are thermal, and only clusters younger than it keep the spin of their touch."""
    side, kelvin = 2e-6, 100.0
    mass = float(thermal(1, side, kelvin).mass[0])
    gas = thermal(100, side, kelvin, moment=[200.0 * mass, 0, 0], spin=[0, 0, 1e9])
    forces = [sand.Contact(damping="critical", settling_time="5 ns"), sand.Dipoles()]

    def spin(*more, span):
        sim = sand.Simulation(gas, [*forces, *more], box=side, stepping=sand.RigidClusters())
        return steps.fastest_spin(sim, coagulation.bodies_of(sim), span), sim

    thin = sand.Gas(temperature="100 K", density="5.94e-3 kg/m^3")
    dense = sand.Gas(temperature="100 K", density="0.594 kg/m^3")
    assert spin(span=1e-3)[0] == spin(thin, span=1e-6)[0] == pytest.approx(1e9, rel=1e-12, abs=0.0)
    fastest, sim = spin(dense, span=1e-3)
    bodies = coagulation.bodies_of(sim)
    assert fastest == steps.thermal_spin(BOLTZMANN * kelvin, bodies) > steps.touch_spin(sim, bodies, 0.1)
    slowed = spin(sand.Gas(temperature="100 K", density="0.594 kg/m^3", brownian=False), span=1e-3)[0]
    assert 0.0 < slowed < fastest, "without noise nothing turns but clusters after their touch"


RUNS = sorted(path.stem for path in EXAMPLES.glob("*.toml") if "[sweep]" not in path.read_text("utf-8"))


def test_the_table_of_estimates_has_every_case():
    """Each example and template but sweeps has a row; one beyond a factor of 3 says so, or is an upper bound."""
    with (EXAMPLES.parent / "benchmarks" / "estimates.csv").open(encoding="utf-8") as file:
        table = {row["case"]: row for row in csv.DictReader(file)}
    assert table.keys() == set(RUNS) | {f"template-{name}" for name in TEMPLATES if name != "sweep"}
    for row in table.values():
        ratios = [float(row[name]) for name in ("ratio first", "ratio after") if row[name]]
        low, high = min(ratios) < 1.0 / 3.0, max(ratios) > 3.0 and row["miss"] != "at most"
        assert (row["miss"] == "MISSED") == (low or high), row["case"]


@pytest.mark.compiled("small")  # two examples build aggregates
@pytest.mark.parametrize("name", RUNS)
def test_every_example_has_an_estimate(name, capsys):
    """A wall time of each example of `sand run`, `sand grow`, `sand collide` and `sand scatter`, with no run before."""
    found = rows(capsys, EXAMPLES / f"{name}.toml")["wall time"]
    assert found.strip().startswith(("about ", "at most ")) and "rough estimate" in found


def test_a_measured_speed_scales_the_estimate(table):
    """Time of the steps = Σ steps × rough time of a step × measured ratio; other runs tell the speed of the machine."""
    sim, end = simulation(), 1e-6
    rough = cost.expected_cost(sim, end, math.inf)
    kind = cost.kind_of(sim)
    assert kind == "contact jkr; all pairs; verlet; 1 thread" and rough.measured == ""
    write(table, {kind: {"contact": {"ratio": 3.0, "seconds": 9.0}}})
    known = cost.expected_cost(sim, end, math.inf)
    assert known.measured == "as in a run of this kind on this machine" and known.steps == rough.steps
    assert known.parts["stepping"] == pytest.approx(3.0 * rough.parts["stepping"], rel=1e-9, abs=0.0)
    others = {"bodies": {"ratio": 2.0, "seconds": 9.0}, "awake": {"ratio": 2.0, "seconds": 9.0}}
    write(table, {"others": others, "odd": {"free": {"ratio": 6514.0, "seconds": 59.0}}})
    other = cost.expected_cost(sim, end, math.inf)
    assert other.measured == "as in other runs on this machine"
    # the median of 1, 2, 2 and 6514: one run that was disturbed says nothing about the machine
    assert other.parts["stepping"] == pytest.approx(2.0 * rough.parts["stepping"], rel=1e-9, abs=0.0)
    assert {**other.parts, "stepping": 0.0} == {**rough.parts, "stepping": 0.0}
    for damaged in (
        {"a": 3},
        {"a": {"contact": {"ratio": 0.0, "seconds": 1.0}}},
        {"a": {"b": {"ratio": 1, "seconds": 1}}},
        [],
    ):
        write(table, damaged)
        assert cost.expected_cost(sim, end, math.inf) == rough  # a damaged table is empty
    write(table, {kind: {"contact": {"ratio": 3.0, "seconds": 9.0}}}, units=[1e-6])
    assert cost.expected_cost(sim, end, math.inf) == rough, "ratios to the rough costs of another version"


def write(table, kinds, units=cost.UNITS):
    """Write a table of measured costs."""
    table.write_text(json.dumps({"units": units, "kinds": kinds}))


def timed(sim, pieces, outputs=(), writer=True):
    """The table after a run whose calls of the driver took steps, seconds and contacts at their ends, as given.

    Then outputs take so many seconds.
    """
    state, engine, now = type("State", (), {"count": np.zeros(40, np.int64)})(), sim._engine, [0.0]

    class Engine:
        steps, awake_work, stored_state = 0, (0, 0, 0.0), state
        parameters, long_range = engine.parameters, engine.long_range

    class Counted:
        _engine, _clock, start = Engine(), sim._clock, sim.start
        forces, stepping, box = sim.forces, sim.stepping, sim.box

    one = Counted()
    one.writer = writer
    timer = cost.StepTimer(one, lambda: now[0])
    for number, seconds, contacts in pieces:
        with timer.steps():
            one._engine.steps += number
            now[0] += seconds
            state.count[CONTACTS] = contacts
    for seconds in outputs:
        with timer.output():
            now[0] += seconds
    timer.record()
    return cost.read_speeds().get(cost.kind_of(sim), {})


def test_only_enough_steps_of_one_kind_are_recorded(table):
    """Not the first call, which loads code; nothing of a tiny run; steps with and without contacts apart."""
    sim = simulation()
    assert timed(sim, [(17, 12.0, 0)]) == {}
    assert timed(sim, [(10_000, 30.0, 0)]) == {} == timed(sim, [(64, 1.0, 0), (400, 9.0, 0)])
    found = timed(sim, [(64, 5.0, 0), (1000, 0.2, 0), (1000, 7.0, 3), (5000, 0.5, 3)])
    assert found.keys() == {"free", "contact"}, "the call in which contacts formed counts for neither"
    free, with_three = (cost.step_seconds(sim, mode, n, 0.0) for mode, n in (("free", 0), ("contact", 3)))
    assert found["free"]["ratio"] == pytest.approx(0.2e-3 / free, rel=1e-9, abs=0.0)
    assert found["contact"]["ratio"] == pytest.approx(1e-4 / with_three, rel=1e-9, abs=0.0)
    assert timed(sim, [(64, 5.0, 3), (600, 0.11, 3)])["contact"]["seconds"] == pytest.approx(0.11, rel=1e-9, abs=0.0)
    long = timed(sim, [(64, 5.0, 3), (10**6, 100.0, 3)])
    assert timed(sim, [(64, 5.0, 3), (600, 0.2, 3)]) == long, "a short run does not replace a much longer one"


def test_outputs_are_recorded_and_used(table):
    """From 20 outputs to files and 0.1 s on; their time enters the output of an estimate, of steps it says nothing."""
    sim, rough = simulation(), cost.output_seconds(simulation())
    assert timed(sim, [], [1.0] * 19) == {} == timed(sim, [], [0.004] * 20) == timed(sim, [], [1.0] * 30, writer=False)
    before = cost.expected_cost(sim, 1e-6, math.inf)
    found = timed(sim, [], [0.05] * 30)
    known = {"ratio": 0.05 / rough, "seconds": 1.5}
    assert found == {"output": pytest.approx(known, rel=1e-9, abs=0.0)}
    after = cost.expected_cost(sim, 1e-6, math.inf)
    assert after.parts["output"] == pytest.approx(0.05 / rough * before.parts["output"], rel=1e-9, abs=0.0)
    assert {**after.parts, "output": 0.0} == {**before.parts, "output": 0.0} and after.measured == ""


def test_substeps_are_no_contact_steps(monkeypatch):
    """Of 0.5 s for 10⁵ contact steps and 2000 substeps, 0.3 s and 0.1 s are expected: the ratio is 1.25."""
    sim = simulation()
    timer = cost.StepTimer(sim)
    timer._moves_bodies, timer._calls, work = True, 1, iter([(0, 0, 0.0), (100_000, 2000, 0.5)])
    monkeypatch.setattr(type(sim._engine), "awake_work", property(lambda _: next(work)))
    with timer.steps():
        pass
    timer.record()
    (known,) = cost.read_speeds().values()
    assert known == {"awake": pytest.approx({"ratio": 1.25, "seconds": 0.5}, rel=1e-9, abs=0.0)}


def test_calls_that_compile_do_not_count(monkeypatch):
    """Code that was compiled or loaded within a call is no time of steps or outputs."""
    sim, compiled = simulation(), iter(range(1000))
    monkeypatch.setattr(cost, "compilation_seconds", lambda: next(compiled))
    assert timed(sim, [(64, 5.0, 0), (1000, 0.2, 0), (1000, 7.0, 0)], [1.0] * 30) == {}


@pytest.mark.compiled("contacts")
def test_many_short_runs_are_recorded_together(monkeypatch, table):
    """As in a collision, which runs from check to check: steps of several runs add up to enough."""
    table.unlink(missing_ok=True)
    sim = simulation(stepping=sand.Verlet(step="1 ps"))
    timer = sim._timer
    sim._timer._clock = lambda: 1e-4 * sim._engine.steps
    for _ in range(5):
        sim.run(steps=300)
    assert sim._timer is timer, "the same measurement goes on"
    (known,) = cost.read_speeds().values()
    assert known["free"]["ratio"] == pytest.approx(1e-4 / cost.step_seconds(sim, "free", 0, 0.0), rel=1e-9, abs=0.0)
    monkeypatch.setattr(cost, "kind_of", lambda _: "after a change of forces")
    assert sim._timer is not timer


def test_output_is_counted():
    """Frames and rows by time, steps and logarithm, as `Schedule` has them."""
    for setting, span, number in (
        ("10 ns", 105e-9, 10),
        ("100 steps", 1e-9, 7),
        ("log(5 per decade, from 1 ns)", 1e-7, 11),
    ):
        cadence = read_cadence(setting, "frame_every")
        assert number_in(cadence, span, 799) == number
    sim = simulation(row_every="10 ns")
    assert cost.outputs(sim, 1e-6, 1.0) == pytest.approx(2.0 + 200.0 + 100.0, rel=0.0, abs=2.0)
    assert cost.outputs(sim, 1e-20, 1.0) == 2.0 + 200.0, "of a run whose frames no user may ask for: 1e-20 s / 200"


def test_a_record_on_a_read_only_file_system(monkeypatch, tmp_path):
    """The table that cannot be written is no error, also where nothing can be deleted."""

    def fails(*_, **__):
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr(Path, "write_text", fails)
    monkeypatch.setattr(Path, "unlink", fails)
    write_record(tmp_path / "speeds.json", {})


def test_memory_grows_with_the_grains():
    """Three copies of at least position, velocity, spin, moment, orientation and loads, about half a kilobyte each."""
    few, many = (cost.expected_cost(simulation(count), 1e-6, math.inf).memory for count in (20, 220))
    assert cost.PROCESS_BYTES < few < many and 200 * 3 * 300 < many - few < 200 * 3 * 10_000


def test_info_of_a_case(tmp_path, capsys, table):
    """Steps, wall time, memory and compilation, for people and for machines; nothing is compiled."""
    (tmp_path / "a.toml").write_text(CASE)
    found = rows(capsys, tmp_path / "a.toml")
    assert found["steps"].strip().startswith("about ") and found["steps"].endswith(" each")
    assert "rough estimate: no run was measured" in found["wall time"] and "MB" in found["memory"]
    assert "compilation" in found
    assert main(["info", str(tmp_path / "a.toml"), "--json"]) == 0
    machine = json.loads(capsys.readouterr().out)["cost"]
    assert {"step", "steps", "contact_steps", "seconds", "parts", "memory", "measured", "bound"} < machine.keys()
    assert {"compiled", "compilation_seconds"} < machine.keys() and machine["bound"] == ""
    assert machine["seconds"] == pytest.approx(sum(machine["parts"].values()), rel=1e-12, abs=0.0)
    assert machine["steps"] * machine["step"] == pytest.approx(1e-6, rel=1e-6, abs=0.0) and machine["measured"] is False
    (tmp_path / "b.toml").write_text(CASE.replace('until = "1 us"', 'stop = "clusters == 1"'))
    assert "depends on the condition" in rows(capsys, tmp_path / "b.toml")["wall time"]


@pytest.mark.compiled("contacts")
def test_what_would_be_compiled(tmp_path, monkeypatch):
    """Stages whose code is neither in this process nor on the disk; after a run those that it called are not named."""
    sim = simulation(stepping=sand.Verlet(step="1 ps"))
    sim.run(steps=20)
    after = sim._engine.uncompiled()
    assert not {"the time steps", "the drift of grains", "the list of contact candidates"} & set(after)
    monkeypatch.setattr("sand.compiler.stage.in_cache", lambda compiled, signature: False)
    fresh = sand.Simulation(sim.grains, [sand.Contact(damping="critical", bath_temperature="300 K")], box="1 um")
    missing = fresh._engine.uncompiled()
    assert "the time steps" not in missing and len(missing) == len(set(missing))
