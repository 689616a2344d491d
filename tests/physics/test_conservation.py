"""Conservation laws: momentum, angular momentum, and the total energy including recorded losses."""

import itertools
import math

import numpy as np
import pytest

import sand
from sand.basics.constants import MAGNETIC
from sand.basics.state import CONTACT_LIMIT
from sand.contact import jkr

from .setups import PrescribedMotion, random_aggregate, rest_distance, struck_chain


@pytest.mark.validates(
    "self-consistency",
    "Momentum and angular momentum of an aggregate with dipoles are conserved to rounding, 10⁵ steps",
)
@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize(
    ("far", "bound"), [pytest.param("every step", 1e-12, marks=pytest.mark.validate), ("impulse", 1e-11)]
)
@pytest.mark.parametrize(("seed", "radii"), [(1, (1e-8, 1e-8)), (2, (4e-9, 1.2e-8)), (3, (2e-9, 2e-8))])
def test_momentum_and_angular_momentum_are_conserved(record_bound, seed, radii, far, bound):
    """P and L = Σ x×mv + Iω of a random aggregate with dipoles in open space, 1e5 steps, change by rounding only.

    Verlet conserves both exactly, with long-range forces summed in every step or in r-RESPA cycles.  Rounding gives
    ε √steps ~ 1e-13 of Σ|mv| and Σ|x×mv| + |Iω|.  The same long-range impulse is added several times in a cycle, so its
    rounding errors add up: ε steps ~ 2e-11 at most.  Without `correct_angular_momentum` L changes by 1e-6.
    """
    fast = 8.0 * np.random.default_rng(seed + 100).normal(size=(16, 3))
    grains = random_aggregate(16, seed, radii=radii, moment="300 A m^2/kg", velocity=fast)
    sim = sand.Simulation(grains, [sand.Contact(), sand.Dipoles(cutoff="1 um")], stepping=sand.Verlet(far=far))
    sim.run(steps=100_000)
    momenta = np.array(
        [
            [row[f"{k}_{a}"] for a in "xyz"]
            for k in ("momentum", "angular_momentum")
            for row in (sim.ledger.rows[0], sim.ledger.rows[-1])
        ]
    )
    g = sim.grains
    linear = (g.mass[:, None] * np.abs(g.velocity)).sum()
    arms = np.linalg.norm(np.cross(g.position, g.mass[:, None] * g.velocity), axis=1).sum()
    angular = arms + np.linalg.norm(g.inertia[:, None] * g.spin, axis=1).sum()
    record_bound("change of the momentum over Σ|mv|", np.abs(momenta[1] - momenta[0]).max() / linear, most=bound)
    turned = np.abs(momenta[3] - momenta[2]).max() / angular
    record_bound("change of the angular momentum over Σ|x×mv| + |Iω|", turned, most=bound)
    assert sim.ledger.rows[-1]["moved"] > 100  # contacts did slide and roll


@pytest.mark.validates("self-consistency", "A magnetic gas without contacts conserves its energy")
@pytest.mark.compiled("dipoles")
def test_energy_of_a_magnetic_gas_before_its_first_contact(record_bound):
    """Total energy of a periodic gas until the first contact: error ≤ 1e-6 of |U_min| = 2kμ²/d³.

    Without contacts only errors of the magnetic forces remain; many pairs cross the cut-off.
    """
    box = sand.Box.periodic("0.5 um")
    grains = sand.setup.gas(
        60, box, radius="10 nm", material=sand.IRON, moment="200 A m^2/kg", temperature="100 K", seed=4
    )
    sim = sand.Simulation(grains, [sand.Contact(), sand.Dipoles()], box=box, frame_every="0.2 ns")
    while sim.ledger.rows[-1]["contacts"] == 0 if len(sim.ledger) else True:
        sim.run(steps=200)
    before = [row for row in sim.ledger.rows if row["contacts"] == 0]
    moment = np.linalg.norm(grains.moment[0])
    u_min = 2 * MAGNETIC * moment**2 / (2e-8) ** 3
    totals = np.array([row["total"] for row in before])
    magnetic = np.array([row["magnetic"] for row in before])
    assert len(before) > 20
    assert np.ptp(magnetic) > 0.1 * u_min  # energy was exchanged
    record_bound(
        "energy error over |U_min| before the first contact", np.abs(totals - totals[0]).max() / u_min, most=1e-6
    )


def chain_error(steps_per_period, hits):
    """Rms change of the total energy over the impact energy, for some points of impact."""
    errors = []
    for offset in np.linspace(-0.5, 0.5, hits):
        sim = struck_chain(offset=offset, steps_per_period=steps_per_period)
        sim.run(until=2e-9)
        first, last = sim.ledger.rows[0], sim.ledger.rows[-1]
        assert last["made"] >= 1
        assert last["moved"] >= 10
        errors.append((last["total"] - first["total"]) / first["translation"])
    return np.sqrt(np.mean(np.square(errors)))


@pytest.mark.validates(
    "self-consistency",
    "The energy balance of a struck chain closes with contacts that form, break, slide and roll",
)
@pytest.mark.filterwarnings("ignore:grains overlap too deeply")
@pytest.mark.compiled("contacts")
@pytest.mark.parametrize(("hits", "halvings"), [(5, 3), pytest.param(9, 4, marks=pytest.mark.validate)])
def test_energy_balance_of_a_struck_chain(record_bound, hits, halvings):
    """Chain of 7 iron grains (20 nm) hit at 100 m/s: rms error of the hits ≤ 3e-3 of the impact energy at T/20.

    Contacts form, break, slide and roll.  Verlet is of order two and transitions are exact, so the error falls by about
    4, at least 3, per halving of the step, down to 1e-5; four halvings reach 1.5e-5, three 4 times as much.
    """
    errors = [chain_error(20.0 * 2**k, hits) for k in range(halvings + 1)]
    record_bound("rms energy error over the impact energy at 20 steps per period", errors[0], most=3e-3)
    for coarse, fine in itertools.pairwise(errors):
        assert fine < coarse / 3 or fine < 1e-5
    assert errors[-1] < 1.5e-5 * 4.0 ** (4 - halvings)


@pytest.mark.validates("self-consistency", "The energy balance closes for two materials and unequal radii")
@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("slip", ["clamp", "reset"])
def test_energy_balance_of_two_materials_and_unequal_radii(record_bound, slip):
    """Two aggregates of unequal silica and ice grains collide at 20 m/s; energy error ≤ 1e-3 of the impact energy."""
    left = random_aggregate(12, 5, radii=(2e-8, 8e-8))
    right = random_aggregate(12, 6, radii=(2e-8, 8e-8))
    shift = np.array([np.ptp(left.position[:, 0]) + np.ptp(right.position[:, 0]) + 2e-7, 0, 0])
    speed = np.repeat([[10.0, 0, 0], [-10.0, 0, 0]], 12, axis=0)
    position = np.concatenate([left.position, right.position + shift])
    radius = np.concatenate([left.radius, right.radius])
    material = [sand.SILICA] * 12 + [sand.SILICA.but(name="soft", young_modulus="7 GPa")] * 12
    # the second aggregate's distances were made for silica: let it relax its overlaps in the impact
    grains = sand.Grains(position, radius, material, velocity=speed)
    sim = sand.Simulation(grains, [sand.Contact(slip=slip)], stepping=sand.Verlet(steps_per_period=50))
    sim.run(until=1.2 * shift[0] / 20.0)
    last = sim.ledger.rows[-1]
    assert last["made"] > 0
    assert last["moved"] > 0
    record_bound("drift of the ledger", sim.ledger.drift, most=1e-3)


@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("offset", [0.0, 0.3, 0.7])
def test_the_step_resolves_a_contact_of_small_grains_beside_large_ones(offset):
    """Two 10 nm iron grains meet at 10 m/s while two 1 µm grains rest in contact elsewhere.

    The step must be that of the small pair when its contact forms.  At the step of the large pair (19 times longer) the
    energy error is up to half of the formation energy.  1e-2 is twice the error of the small pair alone (ringing,
    (ω dt)²/8).
    """
    big, d = 1e-6, rest_distance(sand.IRON, 1e-6, 1e-6)
    small = 1e-8
    position = [[1e-5, 0, 0], [1e-5 + d, 0, 0], [0, 0, 0], [(2.5 + offset) * small, 0, 0]]
    velocity = [[0, 0, 0], [0, 0, 0], [10.0, 0, 0], [0, 0, 0]]
    grains = sand.Grains(position, [big, big, small, small], sand.IRON, velocity=velocity)
    sim = sand.Simulation(grains, [sand.Contact()])
    sim.run(until="1.5 ns")
    first, last = sim.ledger.rows[0], sim.ledger.rows[-1]
    assert last["made"] == 1
    assert abs(last["total"] - first["total"]) < 1e-2 * last["lost_forming"]


@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("r2", [1e-8, 5e-9])
def test_energy_balance_of_rolling_over_a_large_angle(r2):
    """ξ_c = 1 nm on grains of 5 nm: the rolling displacement includes the normal part of n1 + n2.

    A grain is spun up and rolls.  The loss is of first order in the step for finite turns: the error falls by at least
    2.5 for a step 4 times shorter.
    """
    d = rest_distance(sand.IRON, 1e-8, r2)
    errors = []
    for steps in (50, 200):
        grains = sand.Grains(
            [[0, 0, 0], [d, 0, 0]], [1e-8, r2], sand.IRON, spin=[[0, 0, 0], [0, 0, 3e10 * (1e-8 / r2)]]
        )
        sim = sand.Simulation(grains, [sand.Contact()], stepping=sand.Verlet(steps_per_period=steps))
        sim.run(until="1 ns")
        last = sim.ledger.rows[-1]
        assert last["lost_rolling"] + last["lost_sliding"] > 0.1 * sim.ledger["rotation"][0]
        errors.append(abs(np.ptp(sim.ledger["total"][[0, -1]])) / sim.ledger["rotation"][0])
    assert errors[1] < max(errors[0] / 2.5, 1e-5)
    assert errors[1] < 3e-4


@pytest.mark.compiled("contacts")
def test_initial_contacts_at_rest_dissipate_nothing():
    """A relaxed pair: no losses, motion by rounding only, and the ledger contains the energy of its contact."""
    d = rest_distance(sand.SILICA, 1e-7, 1e-7)
    grains = sand.Grains([[0, 0, 0], [d, 0, 0]], 1e-7, sand.SILICA)
    sim = sand.Simulation(grains, [sand.Contact()])
    sim.run(steps=2000)
    last = sim.ledger.rows[-1]
    assert last["contacts"] == 1
    assert last["made"] == 0
    assert sim.ledger.dissipated == 0.0
    assert np.abs(sim.grains.velocity).max() < 1e-6  # rounding excites vibrations of 1e-16 of the elastic speeds
    assert last["normal"] < 0.0


@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("speed", [0.5, 20.0])
@pytest.mark.parametrize("side", [0.0, 0.7])
def test_contact_formation_conserves_the_modified_energy_of_verlet(speed, side):
    """E + dt² (k w²/12 − F²/(24 m̄)) after the step in which a contact forms equals the energy before, to rounding.

    Two 10 nm iron grains, head-on and oblique, at eleven phases of the step.  Rounding of −U(0) and of ½ m̄ w² is about
    1e-16 of either; the tolerance is 1e-12.  An impulse of F (τ − dt/2) alone gives an error of 1e-3.
    """
    r, dt = 1e-8, 5e-13
    for phase in np.linspace(0.0, 1.0, 11):
        apart = [math.sqrt(4 - side**2) * r + (20.3 + phase) * speed * dt, side * r, 0.0]
        grains = sand.Grains([[0, 0, 0], apart], r, sand.IRON, velocity=[[speed, 0, 0], [0, 0, 0]])
        sim = sand.Simulation(grains, [sand.Contact()], stepping=sand.Verlet(step=dt))
        while sim.ledger.rows[-1]["contacts"] == 0 if len(sim.ledger) else True:
            sim.run(steps=1)
        first, last = sim.ledger.rows[0], sim.ledger.rows[-1]
        kept = last["total"] - first["total"] + dt * dt * modified_energy_term(sim)
        assert last["lost_forming"] > 0
        assert abs(kept) < 1e-12 * last["lost_forming"]


def modified_energy_term(sim):
    """k w²/12 − F²/(24 m̄) [J/s²] of a single pair, k from differences of F."""
    constants = sand.contact.law.contact_constants(jkr.LAW)(
        sand.Contact().pairing(sand.IRON, sand.IRON), *sim.grains.radius, *sim.grains.mass
    )
    apart = sim.grains.position[1] - sim.grains.position[0]
    distance = np.linalg.norm(apart)
    w = (sim.grains.velocity[1] - sim.grains.velocity[0]) @ apart / distance

    def force(overlap):
        return jkr.LAW.force(overlap, jkr.LAW.radius_root(overlap, constants), constants)

    overlap, h = sim.grains.radius.sum() - distance, 1e-4 * constants.break_overlap
    stiffness = (force(overlap + h) - force(overlap - h)) / (2.0 * h)
    return stiffness * w * w / 12.0 - force(overlap) ** 2 / (12.0 * sim.grains.mass[0])


@pytest.mark.validates("closed form", "The energy offset of a ringing contact is that of velocity Verlet")
@pytest.mark.compiled("contacts")
def test_mean_energy_of_the_ringing_after_a_contact_forms(record_bound):
    """The mean total energy over twelve periods is below the energy before contact by at most (ω_n dt)²/12 E.

    A harmonic oscillator in Verlet conserves H + dt² (k w²/12 − F²/(24 m̄)), whose mean exceeds that of H by
    (ω dt)²/24 E.  The wide anharmonic ringing of JKR doubles that: 9.7e-4 at 25 steps per fastest period.  Conserving E
    instead gives 1.2e-3; a first-order formation gives (ω dt)²/3 of the other sign.
    """
    r, speed = 1e-8, 0.5
    period, shares = sand.theory.contact(sand.IRON, r).normal_period, []
    for phase in (0.0, 0.5):
        grains = sand.Grains(
            [[0, 0, 0], [2 * r + (30 + phase) * speed * 1.7e-12, 0, 0]],
            r,
            sand.IRON,
            velocity=[[speed, 0, 0], [0, 0, 0]],
        )
        sim = sand.Simulation(grains, [sand.Contact()], frame_every="1 s")
        while sim.time < 30 * 1.7e-12 + 12 * period:
            sim.run(steps=1)  # a row of the ledger for each step
        ledger = sim.ledger
        ringing = ledger["contacts"] > 0
        offset = (ledger["total"][ringing] - ledger["total"][0]).mean() / ledger["translation"][ringing].max()
        largest = (2 * math.pi / period * sim.state.clock[CONTACT_LIMIT]) ** 2 / 12.0
        shares.append(abs(offset) / largest)
    record_bound("energy offset of the ringing over (ω_n dt)²/12", max(shares), most=1.0)


@pytest.mark.validates("closed form", "Two grains rebound with √(v² − v_s²), and lose the energy of a JKR cycle")
@pytest.mark.compiled("contacts")
def test_rebound_of_two_grains(record_bound):
    """Head-on above the sticking speed: rebound √(v² − v_s²), and the recorded loss is E_cycle = 0.935503 F_c δ_c.

    v_s = 1.6394 (γ/R)^(5/6) E*^(−1/3) ρ^(−1/2).  Tolerance 1 % for the speed (step), 1e-6 for the two recorded losses.
    """
    r, m = 1e-7, sand.SILICA
    modulus = m.young_modulus / (2 * (1 - m.poisson_ratio**2))
    sticking = 1.6394 * (m.surface_energy / (r / 2)) ** (5 / 6) * modulus ** (-1 / 3) * m.density**-0.5
    unit = 24.0687 * m.surface_energy ** (5 / 3) * (r / 2) ** (4 / 3) * modulus ** (-2 / 3)
    for factor in (1.05, 2.0, 10.0):
        v = factor * sticking
        grains = sand.Grains([[0, 0, 0], [2.05 * r, 0, 0]], r, m, velocity=[[v / 2, 0, 0], [-v / 2, 0, 0]])
        sim = sand.Simulation(grains, [sand.Contact()], stepping=sand.Verlet(steps_per_period=50))
        sim.run(until=4e-8)
        last = sim.ledger.rows[-1]
        assert (last["made"], last["broken"], last["contacts"]) == (1, 1, 0)
        rebound = sim.grains.velocity[1, 0] - sim.grains.velocity[0, 0]
        record_bound("speed of rebound over √(v² − v_s²)", rebound / np.sqrt(v**2 - sticking**2), least=0.99, most=1.01)
        record_bound(
            "loss of a cycle over 0.935503 F_c δ_c",
            sim.ledger.dissipated / unit / 0.935503,
            least=1 - 1e-5,
            most=1 + 1e-5,
        )
    slow = 0.98 * sticking
    grains = sand.Grains([[0, 0, 0], [2.05 * r, 0, 0]], r, m, velocity=[[slow / 2, 0, 0], [-slow / 2, 0, 0]])
    sim = sand.Simulation(grains, [sand.Contact()], stepping=sand.Verlet(steps_per_period=50))
    sim.run(until=5e-8)
    assert sim.ledger.rows[-1]["contacts"] == 1


@pytest.mark.compiled("contacts")
def test_twist_is_integrated_to_second_order():
    """dφ/dt = (ω1 − ω2)·n with n rotating: φ = Δω sin(Ωt)/Ω; halving the step quarters the error.

    The motion is prescribed; n must be evaluated in the middle of the step, otherwise the order is one.
    """
    d = rest_distance(sand.SILICA, 1e-7, 1e-7)
    whole, turning = 1.0, 0.015
    errors = []
    for steps in (50, 100):
        moving_pair = PrescribedMotion(sand.Grains([[0, 0, 0], [-d, 0, 0]], 1e-7, sand.SILICA))
        angle = whole / steps
        for k in range(steps):
            here, there = (d * np.array([-math.cos(a), -math.sin(a), 0]) for a in (k * angle, (k + 1) * angle))
            moving_pair.step([np.zeros(3), there - here], [[turning / steps, 0, 0], [0, 0, 0]])
        errors.append(abs(moving_pair.sim.state.contacts.twist[0] - turning * math.sin(whole) / whole))
    assert errors[0] < 1e-5
    assert 3.5 < errors[0] / errors[1] < 4.5


@pytest.mark.validates("self-consistency", "The energy balance of collisions of aggregates closes")
@pytest.mark.compiled("contacts", "small")
@pytest.mark.parametrize(
    ("kind", "speed"),
    [
        ("lattice", 20.0),
        ("bpca", 20.0),
        *(pytest.param(k, v, marks=pytest.mark.validate) for k in ("lattice", "bpca") for v in (1.0, 5.0)),
    ],
)
def test_energy_balance_of_aggregate_collisions(record_bound, kind, speed):
    """Two 5×5×5 lattices and two 64-grain PCA clusters, silica 0.6 µm: error ≤ 1e-3 of the impact energy.

    At the default step Verlet's error is (ω dt)²/8 of the ringing energy; impacts are resolved to δ_c per step.
    """
    from sand.experiments.collision import collide
    from sand.setup import bpca, lattice

    def body(seed):
        if kind == "lattice":
            return lattice(5, radius=3e-7, material=sand.SILICA)
        return bpca(64, radius=3e-7, material=sand.SILICA, seed=seed)

    result, sim = collide(body(1), body(2), speed=speed, seed=3)
    assert result.made > 0
    total = sim.ledger["total"]
    assert abs(total[-1] - total[0]) < 1e-3 * result.impact_energy
    record_bound("drift of the ledger", result.drift, most=1e-3)
