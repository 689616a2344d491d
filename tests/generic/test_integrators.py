"""The built-in integrators and that of the example: order of convergence, conservation, the way through case files."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import sand
from sand.basics.constants import MAGNETIC
from sand.basics.state import LONG_RANGE_SUMS
from sand.config.case import Case
from sand.config.key_errors import validate
from sand.config.sections import with_integrator
from sand.integrate.integrator import MEMBERS, register
from sand.integrate.registry import INTEGRATORS
from sand.integrate.verlet import Verlet

from ..plugins import STEPPINGS


def case_of(stepping):
    """Content of a case file with this [stepping] table."""
    return {
        "run": {"until": "1 ns"},
        "grains": {"number": 8, "radius": "10 nm"},
        "box": {"periodic": "0.3 um"},
        "stepping": stepping,
    }


@pytest.mark.parametrize("name", STEPPINGS)
def test_the_settings_go_through_a_case_file(monkeypatch, name):
    """`parameters()` of the default settings, as a [stepping] table, gives equal settings."""
    monkeypatch.setitem(INTEGRATORS, name, STEPPINGS[name])
    settings = STEPPINGS[name]()
    assert settings.parameters()["method"] == name
    content = case_of(settings.parameters())
    assert validate(with_integrator(Case, content), content, "case.toml").stepping == settings


@pytest.mark.parametrize("name", STEPPINGS)
def test_the_settings_are_those_of_the_protocol(name):
    """Every member of the protocol exists; velocity Verlet acts during contacts."""
    settings = STEPPINGS[name]()
    assert all(hasattr(settings, member) for member in MEMBERS)
    assert isinstance(settings.contact_stepping, Verlet)


def test_an_integrator_with_a_taken_name_or_without_a_member_is_refused():
    """One line that names the class or the integrator and what is wrong."""

    class Mine:
        name = "verlet"
        flight = None

    with pytest.raises(sand.BadInput, match="integrator Mine lacks parameters, contact_stepping, resolved, flight_lim"):
        register(Mine)
    for member in MEMBERS[2:]:
        setattr(Mine, member, None)
    with pytest.raises(sand.BadInput, match="integrator 'verlet' exists already"):
        register(Mine)
    assert INTEGRATORS["verlet"] is Verlet


def flyby(stepping, **end):
    """Two magnetic grains pass each other without contact; the simulation after 0.8 µs, or another `end`."""
    position = np.array([[-2e-7, 0, 1.2e-7], [2e-7, 0, -1.2e-7]])
    velocity = np.array([[0.5, 0, 0], [-0.5, 0, 0]])
    grains = sand.Grains(position, 1e-8, sand.IRON, velocity=velocity, moment=[[0, 0, 2e-18], [0, 2e-18, 0]])
    cutoff = "1 um" if stepping.flight is None else None
    damping = "critical" if isinstance(stepping, sand.RigidClusters) else "none"
    forces = [sand.Contact(damping=damping), sand.Dipoles(cutoff=cutoff)]
    sim = sand.Simulation(grains, forces, stepping=stepping, frame_every="1 s")
    sim.run(**(end or {"until": 8e-7}))
    return sim


@pytest.mark.validates("self-consistency", "Each integrator conserves the energy of a fly-by of two magnetic grains")
@pytest.mark.filterwarnings("ignore:without settling_time in")
@pytest.mark.compiled("dipoles", "flights")
@pytest.mark.parametrize("name", STEPPINGS)
def test_the_default_settings_conserve_energy_and_momentum(record_bound, name):
    """Fly-by of two magnetic grains: energy to 1e-6 of the kinetic energy, momentum to rounding (1e-13).

    The default errors are 1e-8 |U_min| per step (Verlet, oscillating) and 1e-8 of the interaction energy (Forest–Ruth).
    The longer steps of rigid clusters are for errors of 1e-4 of |U_min|; they are made 20 times shorter here.
    """
    sim = flyby(STEPPINGS[name](**({"step_fraction": 0.005} if name == "rigid-clusters" else {})))
    first, last = sim.ledger["total"][0], sim.ledger["total"][-1]
    record_bound("energy error over the kinetic energy", abs(last - first) / sim.ledger["translation"][0], most=1e-6)
    momentum = sim.grains.mass @ sim.grains.velocity
    assert np.abs(momentum).max() < 1e-13 * sim.grains.mass[0] * 0.5
    assert len(sim.contacts["pair"]) == 0 and sim.time >= 8e-7


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


FIXED_STEPS = {"verlet": (2, 800, 1, 1e-3), "forest-ruth": (4, 400, 4, 1e-5)}
"""Order, fewest steps, force sums per step and largest error with these steps, of the integrators with a fixed step."""


@pytest.mark.validates("other program", "Integrators converge to the trajectory of SciPy's DOP853 with their order")
@pytest.mark.compiled("dipoles", "flights")
@pytest.mark.parametrize("name", FIXED_STEPS)
def test_order_of_convergence(record_bound, name):
    """Halving the step divides the error in x, v, μ and ω of two spinning dipoles by 2^p: ± 15 %.

    The reference is SciPy's DOP853 (order 8, accurate to 1e-13), with moments as vectors; the smallest error is 2e-11.
    """
    order, fewest, sums, largest = FIXED_STEPS[name]
    end, errors = 2e-8, []
    for steps in (fewest, 2 * fewest, 4 * fewest):
        stepping = STEPPINGS[name](step=end / steps)
        sim = sand.Simulation(scattering_pair(), [sand.Contact(), sand.Dipoles()], stepping=stepping)
        sim.run(steps=steps)
        assert sim.time == pytest.approx(end, rel=1e-12, abs=0.0)
        assert sim.state.count[LONG_RANGE_SUMS] == sums * steps
        errors.append(np.abs(state_of(sim.grains) - reference_solution(sim.start, sim.time)).max())
    record_bound("largest error of the longest step", errors[0], most=largest)
    for ratio in np.divide(errors[:-1], errors[1:]):
        record_bound(f"error over that of half the step, over 2^{order}", ratio / 2.0**order, least=0.85, most=1.15)


def test_every_integrator_with_a_fixed_step_has_an_order():
    """The table above names them all."""
    assert set(FIXED_STEPS) == {name for name, each in STEPPINGS.items() if "step" in each().parameters()}
