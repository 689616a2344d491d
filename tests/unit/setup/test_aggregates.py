"""Aggregates and encounters: contacts in equilibrium, no overlaps, the requested offset."""

import math

import numpy as np
import pytest

import sand
from sand.analysis.shape import gyration_radius
from sand.setup import bpca, chain, encounter, lattice, turned_at_random
from sand.setup.aggregates import rest_distance

R, M = 3e-7, sand.SILICA


def distances(grains):
    d = np.linalg.norm(grains.position[:, None] - grains.position[None], axis=-1)
    return d[np.triu_indices(len(grains), 1)]


def test_a_chain():
    """N − 1 contacts at 2r − δ0, straight along x, centred, moments along it."""
    body = chain(7, radius=R, material=M, moment="1 A m^2/kg")
    assert np.diff(body.position[:, 0]) == pytest.approx(rest_distance(M, R), rel=1e-6, abs=0.0)
    assert not body.position[:, 1:].any()
    assert body.position.mean() == pytest.approx(0.0, abs=1e-20)
    assert body.moment[:, 0] == pytest.approx(body.mass, rel=1e-6, abs=0.0)
    assert not body.moment[:, 1:].any()


def test_a_lattice():
    """3·5·5·4 = 300 contacts of a 5³ cube, no smaller distance."""
    d = distances(lattice(5, radius=R, material=M))
    assert np.isclose(d, rest_distance(M, R), rtol=1e-9, atol=0.0).sum() == 300
    assert d.min() == pytest.approx(rest_distance(M, R), rel=1e-6, abs=0.0)


@pytest.mark.compiled("small")
def test_ballistic_particle_cluster_aggregates():
    """N − 1 contacts in equilibrium (each new grain has one), no overlap, one cluster, seeded, moderately compact."""
    body = bpca(200, radius=R, material=M, seed=4)
    d = distances(body)
    rest = rest_distance(M, R)
    assert d.min() >= rest * (1 - 1e-12)
    assert np.isclose(d, rest, rtol=1e-9, atol=0.0).sum() == 199
    assert (bpca(200, radius=R, material=M, seed=4).position == body.position).all()
    assert (bpca(200, radius=R, material=M, seed=5).position != body.position).any()
    gyration = np.sqrt((body.position**2).sum(axis=1).mean())
    assert 4 * R < gyration < 14 * R


@pytest.mark.compiled("contacts", "small")
def test_built_aggregates_are_at_rest():
    """A lattice and an aggregate in a simulation: the expected contacts, forces by rounding only."""
    for body, contacts in ((lattice(3, radius=R, material=M), 54), (bpca(50, radius=R, material=M, seed=1), 49)):
        sim = sand.Simulation(body, [sand.Contact()])
        assert len(sim.contacts["pair"]) == contacts
        assert np.abs(sim.loads()["force"]).max() < 1e-9 * 3 * np.pi * M.surface_energy * R / 2


@pytest.mark.compiled("small")
@pytest.mark.parametrize("b", ["0 b", "0.5 b", "0.9 b", "0.9 c"])
def test_an_encounter(b):
    """Centre of mass at rest, requested speed and offset, no contact at the start; then they collide."""
    target, projectile = bpca(20, radius=R, material=M, seed=1), bpca(10, radius=R, material=M, seed=2)
    collided = encounter(target, projectile, speed="5 m/s", impact_parameter=b)
    g, n = collided.grains, collided.target
    assert n == 20
    momentum = (g.mass[:, None] * g.velocity).sum(axis=0)
    assert np.abs(momentum).max() < 1e-12 * g.mass.sum() * 5
    assert g.velocity[n:].mean(axis=0) - g.velocity[:n].mean(axis=0) == pytest.approx([5.0, 0, 0], rel=1e-6, abs=0.0)
    gap = np.linalg.norm(g.position[:n, None] - g.position[None, n:], axis=-1) - 2 * R
    assert gap.min() >= 0.5 * R * (1 - 1e-9)
    bodies = (target, projectile)
    if b.endswith("b"):
        reach = sum(np.linalg.norm(x.position - x.position.mean(axis=0), axis=1).max() + R for x in bodies)
    else:  # √(5/3) r_g, which is the radius of a homogeneous sphere
        reach = sum(math.sqrt(5.0 / 3.0) * gyration_radius(x.position, x.mass, R) for x in bodies)
    offset = g.position[n:].mean(axis=0) - g.position[:n].mean(axis=0)
    assert offset[1] == pytest.approx(float(b[:-2]) * reach, abs=1e-15)
    assert offset[2] == pytest.approx(0.0, abs=1e-15)


def test_rotation_preserves_the_body():
    """Distances, magnitudes of moments and the centre are preserved; the seed determines the rotation."""
    body = chain(4, radius=R, material=M, moment="1 A m^2/kg")
    one, two = (turned_at_random(body, np.random.default_rng(3)) for _ in range(2))
    assert distances(one) == pytest.approx(distances(body), rel=1e-6, abs=0.0)
    assert np.linalg.norm(one.moment, axis=1) == pytest.approx(body.mass, rel=1e-6, abs=0.0)
    axis = (one.position[1] - one.position[0]) / np.linalg.norm(one.position[1] - one.position[0])
    assert one.moment[0] / body.mass[0] == pytest.approx(axis, rel=1e-6, abs=0.0)
    assert (one.position == two.position).all()
