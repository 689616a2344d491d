"""Dilute dust whose bodies keep their motion: conservation, equilibrium, restarts, and what is refused."""

import dataclasses
import math

import numpy as np
import pytest

import sand
from sand.basics.constants import COULOMB, MAGNETIC
from sand.basics.errors import BadInput
from sand.experiments import dilute_files, dilute_growth
from sand.experiments.dilute_body import NO_CONTACTS, body_of, in_space, momenta_of
from sand.experiments.dilute_encounters import Encounters
from sand.experiments.dilute_flight import RigidFlights, start_distance
from sand.experiments.dilute_hits import Hit, Resolve, Stick
from sand.experiments.dilute_majorant import Majorant
from sand.experiments.dilute_own import OWN_START, OwnMajorant, thermal_body
from sand.experiments.dilute_population import Population, sizes_of
from sand.experiments.scattering.flight_driver import MISS
from sand.simulation.contact_phase import CHANGES, ContactPhase, Settled
from tests.physics.test_dilute import CONTACT, HEAT, IRON, T
from tests.physics.test_dilute_runs import FORCES, NUMBERS, Stopped, Stopper, files_of, grains
from tests.unit.experiments.test_dilute import DIMER, GRAIN, MOMENT, RADIUS, aggregate
from tests.unit.experiments.test_dilute import charged as with_charges

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


def test_flights_that_miss_keep_the_energy_of_a_population():
    """With touching flights left out the energy of 50 bodies, 3 k_BT each at the start, stays to 1e-3.

    Each of 600 encounters changes it by its energy error and the interaction where flights start and end, below
    1e-3 k_BT rms: 0.03 of 150 k_BT in all.
    """
    bodies, found = population(50, BENT), []
    # all pairs of grains: energy that flights lose or gain adds up
    now = Encounters(bodies, RigidFlights(HEAT, step_fraction=0.05, group_size=0.0), left_out, 1)
    for _ in range(600):
        now.step()
        found.append(energy(bodies))
    assert np.abs(np.array(found) / found[0] - 1.0).max() < 1e-3 and np.ptp(found) > 0.0


@pytest.mark.parametrize("charges", [[20.0], [40.0, -40.0]], ids=["equal", "neutral"])
def test_bodies_that_pass_where_only_net_charges_act_are_deflected(charges):
    """Without a flight momentum and energy stay to rounding, spins exactly, and velocities turn by Rutherford's angle.

    cos θ = (b²v⁴ − k²)/(b²v⁴ + k²), k = qq′/4πε₀m̄; neutral bodies go on as they are.
    """
    shape, bodies = (GRAIN, DIMER)[len(charges) - 1], []
    for k in range(2):
        grains = shape.grains._replace(charge=1.602176634e-19 * np.array(charges), moment=0.0 * shape.grains.moment)
        bodies.append(thermal_body(body_of(grains, shape.contacts, k)[0], HEAT, 1, k))
    # with a wide bound, or all neutral bodies would come near
    now = Encounters(Population(bodies, 1e-9, OwnMajorant(T, 8.0), start=1), RigidFlights(HEAT), left_out, 4)
    seen = 0
    while seen < 5:
        a, b = now.population.bodies
        before, old = energy(now.population), momentum(now.population)
        row = now.step()
        if row.flight_steps > 0:
            continue
        seen += 1
        assert row.end == ("repelled" if len(charges) == 1 else "miss")
        pair = sorted(now.population.bodies, key=lambda body: body.number)
        a, b = sorted((a, b), key=lambda body: body.number)
        assert momentum(now.population) == pytest.approx(old, abs=1e-12 * np.linalg.norm(old))
        assert energy(now.population) == pytest.approx(before, rel=1e-12, abs=0.0)
        assert all((new.motion.angular == body.motion.angular).all() for new, body in zip(pair, (a, b), strict=True))
        u, v = (x.motion.velocity - y.motion.velocity for x, y in ((a, b), pair))
        k = COULOMB * a.charge * b.charge * (a.mass + b.mass) / (a.mass * b.mass)
        square = (row.impact_parameter * row.speed**2) ** 2
        assert u @ v == pytest.approx(row.speed**2 * (square - k**2) / (square + k**2), abs=1e-9 * row.speed**2)


class Rebounds:
    """A contact phase after which two grains recede at a gap of 0.1 radii, with the energies of a list [k_BT].

    They do not rotate, have moments along their line, and velocities at 0.1 rad to it.
    """

    def __init__(self, *energies):
        self.left = list(energies)

    def run(self, grains, contacts):
        """The pieces, with one contact that has formed and broken."""
        apart = grains.position[:, 0] - grains.position[:, 1]
        along, distance = apart / np.linalg.norm(apart), 2.1 * RADIUS
        across = np.cross(along, [0.6, 0.0, 0.8])
        size = np.linalg.norm(grains.moment, axis=0)
        pair = COULOMB * np.prod(grains.charge) / distance - 2.0 * MAGNETIC * np.prod(size) / distance**3
        speed = math.sqrt(2.0 * (self.left.pop(0) * HEAT - pair) / (0.5 * grains.mass[0]))
        heading = math.cos(0.1) * along + math.sin(0.1) * across / np.linalg.norm(across)
        sides = np.array([0.5, -0.5])
        after = grains._replace(
            position=distance * np.outer(along, sides), velocity=speed * np.outer(heading, sides),
            spin=np.zeros((3, 2)), moment=np.outer(along, size),
        )  # fmt: skip
        self.orbit, self.pair = distance * speed * math.sin(0.1), pair
        return Settled(after, NO_CONTACTS, np.arange(2), 1, 0, 1, 0.0, 0, dict.fromkeys(CHANGES, 0.0))


def single(charge):
    """A grain with so many elementary charges, or one with a moment if 0."""
    if charge == 0:
        return GRAIN
    grains = sand.Grains([[0.0, 0.0, 0.0]], RADIUS, "iron", charge=charge * 1.602176634e-19)
    return body_of(grains.arrays, NO_CONTACTS)[0]


@pytest.mark.parametrize("moves", [False, True], ids=["thermal", "own"])
@pytest.mark.parametrize("charges", [(0, 0), (1, -1), (2, 1)], ids=["dipoles", "opposite charges", "equal charges"])
def test_pieces_that_part_fly_to_where_a_flight_of_their_speed_begins(charges, moves):
    """They recede at r ≥ 2b̂(u), or 4b̂(u) if bodies keep their motion, with ½m̄u² + U(r) = E; charges go to U = 0.

    r is at most 1.5 times as large, as a step is a tenth of r/u, and the last distance is that of a speed still a
    little larger.  r × u stays: of charges exactly, of dipoles it goes into spins.  Energies of the hit add up to 0.
    U of two moments μ is between −2kμ²/r³ and half of it, aligned but for angles of their line.  Flights of steps five
    times shorter than usual have errors below 0.2 k_BT.
    """
    a, b = (single(charge) for charge in charges)
    if moves:
        a, b = (thermal_body(each, HEAT, 1, k) for k, each in enumerate((a, b)))
    majorant, phase = Majorant(T), Rebounds(5.0 if charges[1] < 1 else 30.0)
    total = phase.left[0]
    state = np.array([2.001 * RADIUS, 0, 0, -1.0, 0, 0, *[0, 0, 0, 1.0] * 2, *[0.0] * 6])
    hit = Resolve(phase, RigidFlights(HEAT, step_fraction=0.02), majorant)(a, b, state)
    assert (hit.made, len(hit.pieces)) == (1, 2) and not phase.left
    orbit, u = hit.relative
    r = np.linalg.norm(momenta_of(hit.pieces[0][0])[0] - momenta_of(hit.pieces[1][0])[0])
    kinetic = 0.25 * a.mass * float(u @ u) / HEAT
    pair = 0.0 if any(charges) else -2.0 * MAGNETIC * MOMENT**2 / r**3 / HEAT
    assert total - 0.2 <= kinetic <= total - pair + 0.2
    if any(charges):
        assert kinetic == pytest.approx(total, rel=1e-3, abs=0.0)
        assert hit.energies["distant"] == pytest.approx(-phase.pair, rel=1e-3, abs=0.0)
        assert np.linalg.norm(orbit) == pytest.approx(phase.orbit, rel=1e-6, abs=0.0)
    speed = math.sqrt(2.0 * kinetic * HEAT / (0.5 * a.mass))  # of charges that at an infinite distance
    far = start_distance(a, b, speed, majorant.bound(sizes_of(a), sizes_of(b), speed), 4.0 if moves else 2.0)
    assert far <= r <= 1.5 * far
    assert abs(sum(hit.energies.values())) < 0.2 * HEAT


def test_charged_pieces_part_where_a_flight_of_their_energy_far_away_begins():
    """Trimers of ± 3 e with 0.5 k_BT left at an infinite distance part at r, where a flight of this speed starts.

    With the speed on their way, 1.4 k_BT there, it would be 0.6 of it.
    """
    a, b = (with_charges(BENT, [2 * sign, 2 * sign, -sign], 0.0) for sign in (1, -1))
    product, reduced, place = -COULOMB * a.charge * b.charge, 0.5 * a.mass, 6e-7
    speed = math.sqrt(2.0 * (0.5 * HEAT + product / place) / reduced)
    y = np.array([place, 0, 0, speed, 0, 0, *[0, 0, 0, 1.0] * 2, *[0.0] * 6])
    flight = Resolve(None, RigidFlights(HEAT), Majorant(T)).flight_apart(a, b, y, 2.0)
    r, u = (float(np.linalg.norm(flight.state[k : k + 3])) for k in (0, 3))
    assert flight.end == MISS and u == pytest.approx(math.sqrt(HEAT / reduced), rel=0.1, abs=0.0)
    local = math.sqrt(u**2 + 2.0 * product / (r * reduced))
    assert r >= start_distance(a, b, u, math.inf) > 1.5 * start_distance(a, b, local, math.inf)


@pytest.mark.parametrize("charges", [(0, 0), (1, -1)], ids=["dipoles", "opposite charges"])
def test_pieces_that_come_back_touch_again(charges):
    """With E = −0.1 k_BT the distance grows to 40 or 167 radii, where −2kμ²/d³ or −Q/d is E: beyond 2b̂(u) before.

    After the second contact phase, with E > 0, they part.
    """
    phase = Rebounds(-0.1, 5.0)
    a, b = (single(charge) for charge in charges)
    state = np.array([2.001 * RADIUS, 0, 0, -1.0, 0, 0, *[0, 0, 0, 1.0] * 2, *[0.0] * 6])
    hit = Resolve(phase, RigidFlights(HEAT, step_fraction=0.02), Majorant(T))(a, b, state)
    assert phase.left == [] and (hit.made, len(hit.pieces)) == (2, 2)
    assert hit.time > 1e-9


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


@pytest.mark.parametrize("between", ["own", "thermal"])
@pytest.mark.parametrize("draws", [1, 300])
def test_a_population_in_which_nothing_hits_is_resumed_with_the_same_bits(tmp_path, monkeypatch, between, draws):
    """Grains with 30 elementary charges at 100 K, 7500 k_BT at a touch, never hit; killed after a draw, they go on.

    Only `until` ends it.  The checkpoint is that of the draw before.  Files are those of a run that was not killed.
    """
    own = grains(moment=None, charge=np.full(100, 30.0) * 1.602176634e-19)
    how = {**NUMBERS, "between": between, "hits": "stick", "until": "1e7 s", "seed": 3}
    forces = [CONTACT, sand.Charges()]
    one = dilute_growth.grow(own, forces, **how, out=tmp_path / "one")
    assert one.ledger["hits"][-1] == 0 and len(one.encounters["end"]) > 400
    place, left, add = tmp_path / "killed", [draws], dilute_files.PopulationFiles.add

    def killed(self, *arguments):
        add(self, *arguments)
        left[0] -= 1
        if left[0] == 0:
            raise Stopped

    with monkeypatch.context() as patched:
        patched.setattr(dilute_files, "CHECKPOINT_EVERY", 0.0)
        patched.setattr(dilute_files.PopulationFiles, "add", killed)
        with pytest.raises(Stopped):
            dilute_growth.grow(own, forces, **how, out=place)
    assert dilute_files.kept_population(place)[1]["event"] == draws
    dilute_growth.grow(own, forces, **how, out=place)
    assert files_of(place) == files_of(one.folder)
    assert not len(one.aggregates["grains"])


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
