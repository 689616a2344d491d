"""Dilute dust whose bodies keep their motion: conservation, equilibrium, restarts, and what is refused."""

import dataclasses
import math

import numpy as np
import pytest

import sand
from sand.basics.constants import MAGNETIC
from sand.basics.errors import BadInput
from sand.experiments import dilute_files, dilute_growth
from sand.experiments.dilute_body import body_of, in_space, momenta_of
from sand.experiments.dilute_encounters import Encounters
from sand.experiments.dilute_flight import RigidFlights
from sand.experiments.dilute_hits import Hit, Resolve, Stick
from sand.experiments.dilute_majorant import Majorant
from sand.experiments.dilute_own import OWN_START, OwnMajorant, thermal_body
from sand.experiments.dilute_population import Population
from sand.simulation.contact_phase import ContactPhase
from tests.physics.test_dilute import CONTACT, HEAT, IRON, T
from tests.physics.test_dilute_runs import FORCES, NUMBERS, Stopped, Stopper, files_of, grains
from tests.unit.experiments.test_dilute import GRAIN, MOMENT, RADIUS, aggregate

pytestmark = pytest.mark.compiled("scattering", "dipoles")
WEAK = 0.2
"""Moments of the bodies of `BENT`, in units of those of iron: misses come near enough to exchange energy with spins."""
BENT_PLACES = [[0, 0, 0], [1, 0, 0], [1, 1, 0]]
BENT = aggregate(BENT_PLACES, WEAK * np.array([[0, 0, 1], [1, 0, 0], [0.6, 0.8, 0]]))
"""Three grains at a right angle: three different moments of inertia, and a net moment along no principal axis."""


def population(number, body=GRAIN, seed=1, widening=1.0, cold=False, density=3e8):
    """Thermal bodies that keep their motion, without rotation if `cold`; they are never doubled."""
    bodies = [thermal_body(body_of(body.grains, body.contacts, k)[0], HEAT, seed, k) for k in range(number)]
    if cold:
        none = np.zeros(3)
        bodies = [dataclasses.replace(each, motion=each.motion._replace(angular=none, own=none)) for each in bodies]
    return Population(bodies, number / density, OwnMajorant(T, widening), start=1)


def momentum(bodies):
    """ΣmV [kg m/s]."""
    return np.sum([body.mass * body.motion.velocity for body in bodies.bodies], axis=0)


def energy(bodies):
    """Σ ½mV² + ½ΣL²/I [J]."""
    return len(bodies.bodies) * sum(bodies.temperatures) * HEAT


class Watched:
    """A hit rule that keeps the momenta of the two bodies at their last touch, and what became of them."""

    def __init__(self, rule):
        self.rule, self.touch, self.hit = rule, None, None

    def __call__(self, a, b, state):
        """Apply the rule."""
        self.touch, self.hit = momenta_of(in_space(a, b, state)[0]), self.rule(a, b, state)
        return self.hit


@pytest.mark.parametrize("hits", ["stick", "resolve"])
def test_an_encounter_keeps_momentum_energy_and_angular_momentum(hits):
    """ΣmV stays in each encounter, to rounding; what a miss changes in the energy is its interaction and the error.

    At the start and end of a flight, in the distance r ≥ 4b̂, the interaction U is at most 2k Σ|μ|Σ|μ′|/(r − e)³.  In a
    hit energy_start − U of motion becomes that at the touch and what the contact phase adds to it.  L of the
    new body is that of both about their centre at the touch: exactly of bodies that stick, to 1e-6 by contact steps.
    Angular momentum of the orbits between encounters is not kept, as bodies have no positions.
    """
    rule = Stick(CONTACT, IRON.materials)
    if hits == "resolve":
        rule = Resolve(ContactPhase(IRON, [CONTACT, sand.Dipoles(cutoff=None)]), RigidFlights(HEAT), Majorant(T))
    bodies, watched = population(40), Watched(rule)
    now, seen = Encounters(bodies, RigidFlights(HEAT), watched, 2), {"hit": 0, "miss": 0}
    size = np.sqrt(40.0 * GRAIN.mass * 3.0 * HEAT)
    while seen["hit"] < 12:
        before, old = energy(bodies), momentum(bodies)
        row = now.step()
        seen[row.end] += 1
        assert momentum(bodies) == pytest.approx(old, abs=1e-10 * size)
        change = energy(bodies) - before
        far = OWN_START * row.bound - (row.grains1 + row.grains2 + 2) * RADIUS
        most = 2.0 * MAGNETIC * row.grains1 * row.grains2 * MOMENT**2 / far**3
        if row.end == "miss":
            assert abs(change - row.flight_error) < 2.0 * most + 1e-9 * before
            continue
        touched, angular = row.touch_kinetic + row.touch_rotation, watched.touch[2]
        error = row.energy_start + row.flight_error - touched - row.touch_potential
        assert abs(error) < 1e-9 * touched
        limit = 1e-12 if hits == "stick" else 1e-6
        assert bodies.bodies[-1].motion.angular == pytest.approx(angular, abs=limit * np.linalg.norm(angular))
        if hits == "resolve":
            gained = touched + row.energies["kinetic"] - row.energy_start
            assert abs(change - gained) < most + 1e-6 * touched
    assert seen["miss"] > 10


def left_out(a, b, state):
    """A hit rule: touching flights are left out, and both bodies keep the motion that they had before."""
    return Hit([], 0, 0, 0, 0.0, 0, {}, [])


def temperatures(number, widening, cold, encounters, seed=1):
    """Energies of motion and rotation [k_BT] after each encounter (K, 2), and the misses whose b′ exceeds b̂(v′)."""
    bodies = population(number, BENT, seed, widening, cold)
    # all pairs of grains: energy that flights lose or gain adds up
    now = Encounters(bodies, RigidFlights(HEAT, step_fraction=0.05, group_size=0.0), left_out, seed)
    found = []
    for _ in range(encounters):
        now.step()
        found.append(bodies.temperatures)
    return np.array(found)


def test_equilibrium_is_kept():
    """With touching flights left out the energy of 50 bodies, 3 k_BT each at the start, stays to 1e-3.

    Each of 600 encounters changes it by its energy error and the interaction where flights start and end, below
    1e-3 k_BT rms: 0.03 of 150 k_BT in all.
    """
    found = temperatures(50, 1.0, False, 600).sum(axis=1)
    assert np.abs(found / found[0] - 1.0).max() < 1e-3 and np.ptp(found) > 0.0


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A finished population whose bodies keep their motion, with at least one doubling."""
    folder = tmp_path_factory.mktemp("own") / "one"
    return dilute_growth.grow(grains(), FORCES, **NUMBERS, **OWN, out=folder)


OWN = {"between": "own", "hits": "stick", "stop": "mean_cluster_size >= 5", "seed": 3}


@pytest.mark.parametrize("hits", [3, 70])
def test_a_population_of_bodies_that_keep_their_motion_is_resumed_with_the_same_bits(kept, tmp_path, monkeypatch, hits):
    """Killed after some hits, before and after bodies were copied, it continues from a checkpoint to equal files."""
    monkeypatch.setattr(dilute_files, "CHECKPOINT_EVERY", 0.0)
    place = tmp_path / "killed"
    with pytest.raises(Stopped):
        dilute_growth.grow(grains(), FORCES, **NUMBERS, **OWN, out=place, observers=[Stopper(hits)])
    dilute_growth.grow(grains(), FORCES, **NUMBERS, **OWN, out=place)
    assert files_of(place) == files_of(kept.folder)


def test_the_ledger_has_the_energies_of_the_bodies(kept):
    """They begin near 3/2 k_BT each, rotation grows by hits; no column of a gas.  The population was copied."""
    ledger = kept.ledger
    assert ledger["volume"][-1] > ledger["volume"][0] and ledger["mean_cluster_size"][-1] >= 5.0
    for name in ("translation", "rotation"):
        assert abs(ledger[name][0] - 1.5) < 4.0 * math.sqrt(1.5 / 100)
    assert ledger["rotation"][-1] > 3.0 * ledger["rotation"][0]
    assert "to_gas" not in ledger and "translation" in sand.open(kept.folder).ledger
    rows = kept.encounters
    assert (rows["impact_parameter"] <= rows["bound"]).all() and rows["speed"].min() > 0.0


def test_a_field_or_a_gas_between_encounters_is_refused(tmp_path):
    """In a field free bodies precess; a gas that acts between two encounters: both times are named; a wrong word."""
    how = {**NUMBERS, **OWN, "out": tmp_path / "none"}
    gas = sand.Gas(temperature="100 K", density="1e-8 kg/m^3", molecule_mass="2.3 u")
    with pytest.raises(BadInput, match="precess"):
        dilute_growth.grow(grains(), [*FORCES, sand.Field([0.0, 0.0, 5e-5])], **how)
    with pytest.raises(
        BadInput, match=r"bodies meet after .* thermalises them in .*between = 'own' needs at most 0.33"
    ):
        dilute_growth.grow(grains(), [*FORCES, gas], **how)
    with pytest.raises(BadInput, match=r"'thermal'.*'own'"):
        dilute_growth.grow(grains(), FORCES, **how | {"between": "cold"})
    assert not (tmp_path / "none").exists()
