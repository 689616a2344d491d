"""Options of the contact law: damping, variable stiffness, multipliers, mixing rules, no adhesion."""

import math
from operator import attrgetter

import numpy as np
import pytest

import sand
from sand.basics.state import DAMPING, LOST, RECORDED
from sand.contact.constants_table import constant_names
from sand.contact.law import LAWS, contact_constants
from sand.contact.mixing import MIXING

from .setups import random_aggregate, rest_distance

R = 1e-7


def pair(distance, material=sand.SILICA, speed=0.0, r=R, **options):
    velocity = [[0.5 * speed, 0, 0], [-0.5 * speed, 0, 0]]
    return sand.Grains([[0, 0, 0], [distance, 0, 0]], r, material, **({"velocity": velocity} | options))


def pair_constants(contact, material=sand.SILICA, r=R):
    mass = material.density * 4 / 3 * math.pi * r**3
    return contact_constants(LAWS[contact.law])(contact.pairing(material, material), r, r, mass, mass), mass


@pytest.mark.validates("closed form", "The energy of a damped contact falls as exp(−c t/m̄)")
@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("kind", ["constant", "viscoelastic"])
def test_damped_ringing_decays_exponentially(record_bound, kind):
    """m̄ x¨ = −k_n x − c ẋ: energy falls as exp(−c t/m̄), c constant or (2 T_vis E*/ν²) a0; small amplitude, 2 %."""
    key = {"constant": {"damping_constant": "2e-9 kg/s"}, "viscoelastic": {"viscous_time": "2e-14 s"}}[kind]
    contact = sand.Contact(damping=kind, **key)
    constants, mass = pair_constants(contact)
    c = constants.damping + constants.damping_per_radius * constants.rest_radius
    grains = pair(rest_distance(sand.SILICA, R, R), speed=0.005)
    sim = sand.Simulation(grains, [contact], stepping=sand.Verlet(steps_per_period=100))
    sim.run(until=0.7 * mass / 2 / c)
    lost = sim.ledger["lost_damping_normal"][-1]
    start = sim.ledger.rows[0]["translation"]
    assert 0.3 < lost / start < 0.7
    expected = 1 - math.exp(-c * sim.time / (mass / 2))
    record_bound("loss of a damped contact over the closed form", lost / start / expected, least=0.98, most=1.02)
    assert sim.ledger.drift < 1e-4


@pytest.mark.compiled("contacts")
@pytest.mark.parametrize(
    ("kind", "halvings"),
    [("constant", 1), *(pytest.param(k, 2, marks=pytest.mark.validate) for k in ("constant", "viscoelastic"))],
)
def test_energy_error_of_damped_impacts_falls_with_the_step(kind, halvings):
    """Aggregates of unequal grains collide with damping: rms error of twelve impacts falls ≥ 3× per halving."""

    def error(steps_per_period):
        errors = []
        for seed in range(12):
            left, right = (random_aggregate(6, 10 * seed + k, radii=(5e-8, 1e-7), velocity=None) for k in (1, 2))
            shift = np.array([np.ptp(left.position[:, 0]) + np.ptp(right.position[:, 0]) + 2.1e-7, 0, 0])
            grains = sand.Grains(
                np.concatenate([left.position, right.position + shift]),
                np.concatenate([left.radius, right.radius]),
                sand.SILICA,
                velocity=np.repeat([[4.0, 0, 0], [-4.0, 0, 0]], 6, axis=0),
            )
            key = {"constant": {"damping_constant": "1e-8 kg/s"}, "viscoelastic": {"viscous_time": "1e-13 s"}}[kind]
            contact = sand.Contact(damping=kind, **key)
            sim = sand.Simulation(grains, [contact], stepping=sand.Verlet(steps_per_period=steps_per_period))
            sim.run(until=1.1 * shift[0] / 8.0)
            first, last = sim.ledger.rows[0], sim.ledger.rows[-1]
            assert last["made"] > 0
            assert last["lost_damping_normal"] > 0.01 * first["translation"]
            errors.append((last["total"] - first["total"]) / first["translation"])
        return np.sqrt(np.mean(np.square(errors)))

    errors = [error(25 * 2**k) for k in range(halvings + 1)]
    assert errors[0] < 5e-4
    assert errors[-1] < errors[0] / 3**halvings


@pytest.mark.compiled("contacts")
def test_energy_of_variable_stiffness_is_recorded():
    """Stiffnesses "dt97" do not conserve energy: with their work `lost_stiffness` the energy balance closes."""
    rng = np.random.default_rng(3)
    grains = random_aggregate(12, 4, radii=(5e-8, 1e-7), velocity=1.5 * rng.normal(size=(12, 3)))
    totals = []
    for steps in (50, 100):
        sim = sand.Simulation(grains, [sand.Contact(stiffness="dt97")], stepping=sand.Verlet(steps_per_period=steps))
        sim.run(until="20 ns")
        assert abs(sim.ledger["lost_stiffness"][-1]) > 10 * sim.ledger.drift * sim.ledger["translation"][0]
        assert sim.ledger["moved"][-1] > 0
        totals.append(sim.ledger.drift)
    assert totals[0] < 1e-3
    assert totals[1] < totals[0] / 2.5


@pytest.mark.compiled("contacts")
def test_losses_per_contact_add_up_to_the_ledger():
    """The sum over contacts that never broke equals the ledger's columns, to rounding."""
    rng = np.random.default_rng(8)
    grains = random_aggregate(10, 4, radii=(5e-8, 1e-7), velocity=0.1 * rng.normal(size=(10, 3)))
    sim = sand.Simulation(grains, [sand.Contact(damping="critical", damping_ratio=0.01)])
    sim.run(until="60 ns")
    assert sim.ledger["broken"][-1] == 0
    lost = dict(zip(LOST, sim.state.lost, strict=True))
    assert lost["forming"] > 0.0 or lost["rolling"] > 0.0
    lost["damping"] = sum(lost.pop(name) for name in DAMPING)
    for name in RECORDED:
        assert sim.contacts[f"lost_{name}"].sum() == pytest.approx(lost.pop(name), rel=1e-9, abs=1e-30)
    assert not any(lost.values())


@pytest.mark.parametrize(("factor", "power"), [("slide_factor", 1.0), ("roll_factor", 1.0), ("twist_factor", 1.0)])
def test_a_multiplier_scales_one_stiffness(factor, power):
    """A multiplier scales k_s, k_r or k_t alone; the limits do not change."""
    plain, _ = pair_constants(sand.Contact())
    scaled, _ = pair_constants(sand.Contact(**{factor: 2.5}))
    name = factor.replace("factor", "stiffness")
    changed = {name, f"derived.{name.replace('roll_', 'roll_torque_')}"}
    for field in set(constant_names(LAWS["jkr"])) - {"max_squared_frequency"}:
        expected, of = 2.5 if field in changed else 1.0, attrgetter(field)
        assert of(scaled) == pytest.approx(expected * of(plain), rel=1e-6, abs=0.0)


@pytest.mark.parametrize("rule", list(MIXING))
def test_mixing_rules(rule):
    """Equal grains give γ, a partner with γ = 0 gives 0, the rule is symmetric, and γ_eff lies between the two."""
    mix = MIXING[rule]
    assert mix(0.1, 0.1) == pytest.approx(0.1, rel=1e-6, abs=0.0)
    assert mix(0.1, 0.0) == 0.0
    assert mix(0.0, 0.0) == 0.0
    assert mix(0.1, 0.4) == mix(0.4, 0.1)
    assert 0.1 <= mix(0.1, 0.4) <= 0.4


@pytest.mark.compiled("contacts")
def test_contact_time_without_adhesion_is_that_of_hertz():
    """γ = 0: no sticking, no loss; contact time 2.868 (m̄²/(R E*² v))^(1/5), resolved to two steps."""
    bare = sand.SILICA.but(name="bare", surface_energy=0.0)
    speed = 3.0
    grains = sand.Grains(
        [[0, 0, 0], [2.001 * R, 0, 0]], R, [bare, sand.SILICA], velocity=[[speed / 2, 0, 0], [-speed / 2, 0, 0]]
    )
    contact_frames, steps = [], []

    class ContactRecorder(sand.Observer):
        def see(self, simulation, row):
            if row["contacts"]:
                contact_frames.append(row["time"])
                steps.append(simulation.state.clock[1])

    sim = sand.Simulation(
        grains,
        [sand.Contact()],
        stepping=sand.Verlet(steps_per_period=100),
        observers=[ContactRecorder()],
        frame_every="1 ps",
    )
    sim.run(until="3 ns")
    last = sim.ledger.rows[-1]
    assert (last["made"], last["broken"], last["contacts"]) == (1, 1, 0)
    assert sim.grains.velocity[1, 0] - sim.grains.velocity[0, 0] == pytest.approx(speed, rel=1e-4, abs=0.0)
    assert sim.ledger.dissipated == pytest.approx(0.0, abs=1e-6 * last["translation"])
    modulus = sand.SILICA.young_modulus / (2 * (1 - sand.SILICA.poisson_ratio**2))
    expected = 2.868 * ((grains.mass[0] / 2) ** 2 / (R / 2 * modulus**2 * speed)) ** 0.2
    assert contact_frames[-1] - contact_frames[0] == pytest.approx(expected, abs=2.5 * max(steps[1:]))
