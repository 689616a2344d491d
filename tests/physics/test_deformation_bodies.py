"""Rigid clusters in a box that is deformed: motion as in an open box, adiabatic compression, too small boxes."""

import numpy as np
import pytest

import sand
from sand.basics.state import MADE
from sand.components.deformation import present_work

ICE = sand.Material(
    "soft ice", density="1000 kg/m^3", surface_energy="0.1 J/m^2", young_modulus="7 GPa", poisson_ratio=0.25,
    rolling_limit="8 angstrom",
)  # fmt: skip
DAMPED = sand.Contact(damping="critical", damping_ratio=0.2, settling_time="5 ns")
pytestmark = [
    pytest.mark.compiled("deformation", "contacts"),
    pytest.mark.filterwarnings("ignore:contact. settling_time = 5 ns is below"),
]


def colliding_bodies():
    """Two aggregates of grains of two sizes that meet off-centre at 1 m/s."""
    first = sand.setup.bpca(12, radius="0.1 um", material=ICE, seed=1)
    second = sand.setup.bpca(10, radius="0.08 um", material=ICE, seed=2)
    return sand.setup.encounter(first, second, speed="1 m/s", impact_parameter="0.3 b").grains


@pytest.mark.validates(
    "self-consistency",
    "Rigid clusters that collide in a box that is deformed move as in an open box",
)
@pytest.mark.parametrize("shift", [0.0, 0.49])
def test_rigid_clusters_collide_as_in_an_open_box(shift, record_bound):
    """Two clusters come to rest as bodies, touch off-centre and stick, while sides change by −30, +20 and −10 %.

    As for grains, centres of mass have the laboratory velocity U + A X, which a box that changes linearly does not
    change; rotation is that of the laboratory, and contact steps see A l.  With steps of the same length positions
    differ by errors of rounding, which grow in the collision.  Also across a face of the box.
    """
    grains, box = colliding_bodies(), sand.Box.periodic("4 um", "3.6 um", "3.8 um")
    lengths, changes, until = np.array(box.lengths), np.array([-0.3, 0.2, -0.1]), 1.2e-6
    rates, moved = changes / until, shift * np.array(box.lengths)
    velocity = grains.velocity - rates * grains.position
    placed = sand.Grains(box.wrap(grains.position + moved), grains.radius, ICE, velocity=velocity, spin=grains.spin)
    images, stepping = box.image(grains.position + moved), sand.RigidClusters(longest_step="2 ns")
    free = sand.Simulation(grains, [DAMPED], stepping=stepping)
    law = sand.Deformation(rates, law="linear")
    sim = sand.Simulation(placed, [DAMPED], box=box, deformation=law, stepping=stepping)
    for each in (free, sim):
        each.run(until=until)
    now = np.array(sim.box.lengths)
    assert now == pytest.approx(lengths * (1.0 + changes), rel=1e-9, abs=0.0)
    whole = sim.grains.position + (sim.grains.image + images) * now - moved * (1.0 + changes)
    record_bound("error in radii", np.abs(whole - free.grains.position).max() / 1e-7, most=1e-6)
    assert sim.state.count[MADE] == free.state.count[MADE] > 0
    assert {0, 22} <= set(sim.ledger["awake"].astype(int))


def gas_of_bodies(**options):
    """27 clusters of six grains that fly and turn in a cube, and do not meet."""
    rng, body = np.random.default_rng(5), sand.setup.bpca(6, radius="0.1 um", material=ICE, seed=3)
    s, position, velocity, spins = body.position - body.position.mean(0), [], [], []
    for centre in np.stack(np.meshgrid(*[[-2e-6, 0.0, 2e-6]] * 3, indexing="ij"), -1).reshape(-1, 3):
        spin = rng.normal(size=3) * 1e4
        position.append(centre + s)
        velocity.append(rng.normal(size=3) * 0.01 + np.cross(spin, s))
        spins.append(np.tile(spin, (6, 1)))
    grains = sand.Grains(
        np.concatenate(position), "0.1 um", ICE, velocity=np.concatenate(velocity), spin=np.concatenate(spins)
    )
    return sand.Simulation(grains, [DAMPED], box="6 um", stepping=sand.RigidClusters(longest_step="20 ns"), **options)


def sums_of(state):
    """Σ P_a²/M (3,) [J] of all bodies."""
    bodies = state.bodies
    firsts = np.unique(bodies.first)
    return (bodies.momentum[:, firsts] ** 2 / bodies.mass[firsts]).sum(axis=1)


def test_rigid_bodies_are_compressed_adiabatically():
    """ΣP_a²/M ∝ L_a⁻² along each axis, exactly, while all are at rest; lost_box is the change of all kinetic energy.

    ½ Σ m u_i² of the grains also has the difference D to that of the bodies, whose change is part of the work.
    """
    law = sand.Deformation(["-1e5 1/s", "-5e4 1/s", "5e4 1/s"])
    sim = gas_of_bodies(deformation=law)
    sim.run(until="1 us")
    assert sim.state.at_rest.all() and sim.ledger["made"][-1] == 0
    before, lengths = sums_of(sim.regular_state), np.array(sim.regular_state.cell.span[:3])
    row = sim.ledger.rows[-1]
    sim.run(until="3 us")
    after = sums_of(sim.regular_state) * (sim.regular_state.cell.span[:3] / lengths) ** 2
    assert after == pytest.approx(before, rel=1e-11, abs=0.0)
    last = sim.ledger.rows[-1]
    changed = sum(last[name] - row[name] for name in ("translation", "rotation"))
    assert changed == pytest.approx(row["lost_box"] - last["lost_box"], rel=1e-9, abs=1e-12 * last["translation"])
    assert abs(changed) > 0.05 * row["translation"]
    assert present_work(sim.state).sum() == pytest.approx(-last["lost_box"], rel=1e-12, abs=0.0)


def test_rigid_clusters_wake_when_the_box_is_too_small_for_them():
    """A straight chain of eight grains, 1.6 µm long, is at rest in a box of 3.6 µm; below 2.8 µm it takes steps.

    Along the other axes the box keeps its sides.  Contacts are never strained by the box, as the chain is free and at
    rest in the laboratory: the kinetic energy ½ Σ m (A s)² relative to the flow is what the box adds.
    """
    chain = sand.setup.chain(8, radius="0.1 um", material=ICE)
    law = sand.Deformation(["-2e5 1/s", 0, 0], law="linear")
    velocity = chain.position * np.array([2e5, 0.0, 0.0])
    sim = sand.Simulation(
        sand.Grains(chain.position, "0.1 um", ICE, velocity=velocity), [DAMPED], box=["3.6 um", "2 um", "2 um"],
        deformation=law, stepping=sand.RigidClusters(longest_step="10 ns"),
    )  # fmt: skip
    extent = float(np.ptp(sim.grains.position, axis=0).max())
    sim.run(until="0.5 us")
    assert 0.5 * sim.box.lengths[0] > extent and sim.state.at_rest.all()
    with pytest.warns(UserWarning, match="a cluster spans half of the box or more"):
        sim.run(until="1.4 us")
    assert 0.5 * sim.box.lengths[0] < extent and not sim.state.at_rest.any()
    first, last = sim.ledger.rows[0], sim.ledger.rows[-1]
    assert np.ptp(sim.grains.position, axis=0).max() == pytest.approx(extent, rel=1e-4, abs=0.0)
    assert last["total"] == pytest.approx(first["total"], abs=1e-5 * last["translation"])
    assert last["translation"] > 1.5 * first["translation"]


def test_clusters_that_are_joined_to_their_own_image_stay_awake():
    """A row of eight grains across two faces: it never rests, is strained with the box, and resists it.

    Its force along x is that of a contact at the distance L/8, the same in all contacts, and P_xx = F L/V.
    """
    position = np.zeros((8, 3))
    position[:, 0] = (np.arange(8) - 3.5) * 1.99e-7
    law = sand.Deformation(["-1e5 1/s", 0, 0])
    sim = sand.Simulation(
        sand.Grains(position, "0.1 um", ICE), [DAMPED], box=[8 * 1.99e-7, 1.5e-6, 1.5e-6], deformation=law,
        stepping=sand.RigidClusters(longest_step="10 ns"), row_every="5 ns",
    )  # fmt: skip
    sim.run(until="20 ns")
    assert not sim.state.at_rest.any() and sim.ledger["awake"].min() == 8
    force = sim.contacts["force"][:, 0]
    assert np.abs(force) == pytest.approx(np.full(8, abs(force[0])), rel=1e-6, abs=0.0)
    side, pressure = sim.box.lengths[0], sim.ledger["mean_pressure_x"][-1]
    assert side < 8 * 1.99e-7 * 0.9981
    first, last = sim.ledger.rows[0], sim.ledger.rows[-1]
    work = abs(last["lost_box"])
    assert last["total"] == pytest.approx(first["total"], abs=1e-3 * work)
    assert pressure == pytest.approx(abs(force[0]) / (1.5e-6) ** 2, rel=0.1, abs=0.0)


@pytest.mark.validates(
    "self-consistency",
    "The energy balance of magnetic rigid clusters in a box that is deformed closes",
)
@pytest.mark.validate
@pytest.mark.compiled("deformation", "dipoles")
def test_magnetic_clusters_close_the_ledger(record_bound):
    """60 magnetic grains collide and grow while sides change by −45, +49 and −18 %; the ledger closes as without it.

    The error of a run in a box at rest is that of touches (docs/physics/rigid-clusters.md), some 1e-3 of what is
    dissipated; the work of the boundaries adds less than that.
    """
    grains = sand.setup.gas(
        60, "0.9 um", radius="10 nm", material="iron", moment="200 A m^2/kg", temperature="100 K", seed=4
    )
    contact = sand.Contact(damping="critical", damping_ratio=0.2, settling_time="5 ns")
    forces = [contact, sand.Dipoles(periodic="ewald", accuracy=1e-4)]
    law = sand.Deformation(["-3e5 1/s", "2e5 1/s", "-1e5 1/s"])
    sim = sand.Simulation(grains, forces, box="0.9 um", stepping=sand.RigidClusters(), deformation=law)
    sim.run(until="2 us")
    first, last = sim.ledger.rows[0], sim.ledger.rows[-1]
    dissipated = sum(last[f"lost_{name}"] for name in ("forming", "damping_normal", "damping_rolling", "settling"))
    assert last["made"] > 10
    record_bound("error over what is dissipated", abs(last["total"] - first["total"]) / dissipated, most=3e-3)
