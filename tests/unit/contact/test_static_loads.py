"""Static loads of the contacts of a cluster against equilibrium, gradients of energies, and awake clusters."""

import numpy as np
import pytest

import sand
from sand.contact.static_loads import ROWS, displacement_changes, responses, responses_stage, shares_of_limits
from tests.physics.setups import rest_distance

PITCH = rest_distance(sand.IRON, 1e-8, 1e-8)
BRANCHED = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0], [1, 0, 1], [1, 0, 2], [1, 1, 2]]) * PITCH
RING = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 0, 1]]) * PITCH


def contact_responses(sim):
    """What `responses_stage` measures of the present contacts, and their grains (C, 2)."""
    engine, state = sim._engine, sim.regular_state
    rows = np.zeros((ROWS, state.contacts.pair.shape[1]))
    responses_stage(engine.law).run(engine.table_of(state), (rows,))
    pair = sim.contacts["pair"]
    return responses(rows[:, : len(pair)]), pair


def spun(position, spin):
    """A cluster of iron grains in rigid rotation, damped and settling.

    Dashpots take velocities half a step old, so that a rotation ω lets them push by c ω² D dt/2, 1 % of the centrifugal
    force at the default step: steps are a quarter of it.
    """
    position = position - position.mean(axis=0)
    velocity = np.cross(spin, position)
    grains = sand.Grains(position, 1e-8, "iron", velocity=velocity, spin=np.tile(spin, (len(position), 1)))
    contact = sand.Contact(damping="critical", damping_ratio=0.3, settling_time="2 ns")
    sim = sand.Simulation(grains, [contact], stepping=sand.Verlet(steps_per_period=100), frame_every=1.0)
    sim.run(steps=1)
    return sim


def balanced(position, seed):
    """Random forces and torques on the grains whose sum and torque vanish."""
    rng = np.random.default_rng(seed)
    force, torque = rng.normal(size=position.shape), 1e-8 * rng.normal(size=position.shape)
    force -= force.mean(axis=0)
    torque -= (torque + np.cross(position, force)).sum(axis=0) / len(position)
    return force * 1e-12, torque * 1e-12


@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("position", [BRANCHED, RING], ids=["branched", "ring"])
def test_contact_loads_balance_the_loads_on_every_grain(position):
    """Σ F_c + f = 0 and Σ M_c + t = 0 on every grain, with F_c and M_c from the changed displacements.

    As in `contact_load`: F1 = k_n Δδ n + k_s (d·n)/D Δζ, M1 = −r1 k_s n1×Δζ − R k_r n1×Δξ − k_t Δφ n and
    M2 = r2 k_s n2×Δζ − R k_r n2×Δξ + k_t Δφ n.  Contacts are strained by less than 1e-3 of a radius, which bounds the
    error of this linear form.
    """
    sim = spun(position, np.array([1e5, 0.0, 0.0]))
    contacts, pair = contact_responses(sim)
    x = sim.regular_state.grains.arrays.position.T
    force, torque = balanced(x, 1)
    overlap, slide, roll, twist = displacement_changes(contacts, pair, force, torque)
    total, moment = force.copy(), torque.copy()
    for c, (i, j) in enumerate(pair):
        n, n1, n2 = contacts.n[c], contacts.n1[c], contacts.n2[c]
        f = contacts.normal_stiffness[c] * overlap[c] * n
        f = f + contacts.slide_stiffness[c] * contacts.along[c] / contacts.distance[c] * slide[c]
        tau = contacts.twist_stiffness[c] * twist[c] * n
        rolled = contacts.reduced_radius[c] * contacts.roll_stiffness[c] * roll[c]
        total[i] += f
        total[j] -= f
        slid = contacts.slide_stiffness[c] * slide[c]
        moment[i] -= contacts.radius1[c] * np.cross(n1, slid) + np.cross(n1, rolled) + tau
        moment[j] += contacts.radius2[c] * np.cross(n2, slid) - np.cross(n2, rolled) + tau
    assert np.abs(total).max() < 1e-3 * np.abs(force).max()
    assert np.abs(moment).max() < 1e-3 * np.abs(torque).max()


@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("position", [BRANCHED, RING], ids=["branched", "ring"])
def test_loads_of_a_tumbling_cluster_are_those_that_it_carries_awake(position):
    """A cluster that tumbles freely, its vibrations damped: displacements of all contacts, to 1 % of the largest.

    Loads are inertia alone, f = −m a and t = −I α of the rigid motion with the same L.  At 1e8 rad/s the largest load
    is 1e-3 of a limit: stiffnesses are constant to this, and the step's error is 0.3 % (`spun`).
    """
    sim = spun(position, np.array([0.7e8, 0.4e8, -0.5e8]))
    begun, _ = contact_responses(spun(position, np.zeros(3)))
    sim.run(until="30 ns")
    contacts, pair = contact_responses(sim)
    g = sim.regular_state.grains.arrays
    m, inertia, x, v, w = g.mass[:, None], g.inertia[:, None], g.position.T, g.velocity.T, g.spin.T
    centre, mean = (m * x).sum(axis=0) / m.sum(), (m * v).sum(axis=0) / m.sum()
    s = x - centre
    angular = (m * np.cross(s, v - mean) + inertia * w).sum(axis=0)
    tensor = ((m * s**2).sum() + inertia.sum()) * np.eye(3) - (m * s).T @ s
    spin = np.linalg.solve(tensor, angular)
    rate = np.linalg.solve(tensor, -np.cross(spin, angular))
    force = -m * (np.cross(rate, s) + np.cross(spin, np.cross(spin, s)))
    torque = -inertia * np.tile(rate, (len(x), 1))
    overlap, slide, roll, twist = displacement_changes(contacts, pair, force, torque)
    normal = contacts.normal_stiffness * overlap
    found = (normal, slide, roll, twist)
    carried = (contacts.normal_force - begun.normal_force, contacts.slide, contacts.roll, contacts.twist)
    for one, other in zip(found, carried, strict=True):
        assert np.abs(one - other).max() < 0.01 * np.abs(other).max()
    shares, _ = shares_of_limits(contacts, pair, 0.0 * force, 0.0 * torque)
    assert 1e-4 < shares.max() < 1e-2


@pytest.mark.compiled("contacts")
def test_shares_are_those_of_the_table_of_contacts():
    """Without further loads: the shares of the limits that `sim.contacts` has, and no changes."""
    sim = spun(RING, np.array([0.7e8, 0.4e8, -0.5e8]))
    sim.run(steps=10_000)
    contacts, pair = contact_responses(sim)
    shares, changes = shares_of_limits(contacts, pair, np.zeros((6, 3)), np.zeros((6, 3)))
    table = sim.contacts
    for k, name in ((1, "slide_share"), (2, "roll_share"), (3, "twist_share")):
        assert np.allclose(shares[:, k], table[name], rtol=1e-12, atol=0.0)
    assert not changes.any()


@pytest.mark.compiled("contacts")
def test_contacts_without_sliding_stiffness_are_not_determined():
    """A mode without stiffness carries nothing: the change is infinite, and the cluster wakes."""
    sim = spun(BRANCHED, np.array([1e5, 0.0, 0.0]))
    contacts, pair = contact_responses(sim)
    force, torque = balanced(sim.regular_state.grains.arrays.position.T, 2)
    contacts = contacts._replace(slide_stiffness=0.0 * contacts.slide_stiffness)
    assert np.isinf(displacement_changes(contacts, pair, force, torque)[0]).all()
