"""Every registered integrator: order of convergence, conservation, and the way through case files."""

import math

import numpy as np
import pytest

import sand
from sand.config.case import Case
from sand.config.key_errors import validate
from sand.config.sections import with_integrator
from sand.integrate.integrator import MEMBERS, register
from sand.integrate.registry import INTEGRATORS
from sand.integrate.verlet import Verlet


def case_of(stepping):
    """Content of a case file with this [stepping] table."""
    return {
        "run": {"until": "1 ns"},
        "grains": {"number": 8, "radius": "10 nm"},
        "box": {"periodic": "0.3 um"},
        "stepping": stepping,
    }


@pytest.mark.parametrize("name", INTEGRATORS)
def test_the_settings_go_through_a_case_file(name):
    """`parameters()` of the default settings, as a [stepping] table, gives equal settings."""
    settings = INTEGRATORS[name]()
    assert settings.parameters()["method"] == name
    content = case_of(settings.parameters())
    assert validate(with_integrator(Case, content), content, "case.toml").stepping == settings


@pytest.mark.parametrize("name", INTEGRATORS)
def test_the_settings_are_those_of_the_protocol(name):
    """Every member of the protocol exists; velocity Verlet acts during contacts."""
    settings = INTEGRATORS[name]()
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


@pytest.mark.compiled("dipoles", "adaptive")
@pytest.mark.parametrize("name", INTEGRATORS)
def test_the_default_settings_conserve_energy_and_momentum(name):
    """Fly-by of two magnetic grains: energy to 1e-6 of the kinetic energy, momentum to rounding (1e-13).

    The default errors are 1e-8 |U_min| per step (Verlet, oscillating), 1e-9 of the natural scales (adaptive) and 1e-8
    of the interaction energy (Forest–Ruth).  The longer steps of rigid clusters are for errors of 1e-4 of |U_min|; they
    are made 20 times shorter here.
    """
    sim = flyby(INTEGRATORS[name](**({"step_fraction": 0.005} if name == "rigid-clusters" else {})))
    first, last = sim.ledger["total"][0], sim.ledger["total"][-1]
    assert last == pytest.approx(first, abs=1e-6 * sim.ledger["translation"][0])
    momentum = sim.grains.mass @ sim.grains.velocity
    assert np.abs(momentum).max() < 1e-13 * sim.grains.mass[0] * 0.5
    assert len(sim.contacts["pair"]) == 0 and sim.time >= 8e-7


FIXED_STEPS = {"verlet": (2, 8e-9), "forest-ruth": (4, 3.2e-8)}
"""Order, and a step [s], of the integrators with a fixed step; the order of others is tested by their tolerance."""


@pytest.mark.compiled("dipoles", "adaptive")
@pytest.mark.parametrize("name", FIXED_STEPS)
def test_order_of_convergence(name):
    """Halving a fixed step reduces the error of the separation after a fly-by by 2^p ± 20 %; reference: step/16."""
    order, step = FIXED_STEPS[name]

    def separation(parts):
        sim = flyby(INTEGRATORS[name](step=step / parts), steps=round(8e-7 / step) * parts)
        return sim.grains.position[0] - sim.grains.position[1]

    best = separation(16)
    coarse, fine = (np.linalg.norm(separation(parts) - best) for parts in (1, 2))
    # the reference has an error of 1/16^p of the coarse one: expected ratio (1 - 1/16^p)/(1/2^p - 1/16^p)
    expected = math.log2((1 - 16.0**-order) / (2.0**-order - 16.0**-order))
    assert math.log2(coarse / fine) == pytest.approx(expected, abs=0.3)


def test_every_integrator_with_a_fixed_step_has_an_order():
    """The table above names them all."""
    assert set(FIXED_STEPS) == {name for name, each in INTEGRATORS.items() if "step" in each().parameters()}
