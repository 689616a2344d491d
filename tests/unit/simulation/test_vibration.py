"""Kinetic energy of clusters beyond their rigid motion, and the notes of a run on vibrating contacts."""

import warnings
from pathlib import Path

import numpy as np
import pytest

import sand
from sand.analysis.body_motion import internal_kinetic_energy
from sand.basics.box import Box
from sand.basics.constants import BOLTZMANN
from sand.contact.model import DEFAULT_DAMPING_RATIO
from sand.simulation.vibration import vibration_notes

SIZES = (1, 2, 3, 9)
BOX = Box.periodic(1e-6)


def moving_chains(seed=1):
    """Chains of SIZES grains with unequal radii across the boundary, random velocities and spins; their contacts."""
    rng = np.random.default_rng(seed)
    position, pairs = [], []
    for k, size in enumerate(SIZES):
        first = len(position)
        corner = np.array([0.9e-6, 0.2e-6 * k, 0.1e-6])
        position += [corner + 2e-8 * i * np.array([1.0, 0.3, -0.2]) for i in range(size)]
        pairs += [(first + i, first + i + 1) for i in range(size - 1)]
    count = len(position)
    velocity, spin = rng.normal(size=(count, 3)), 1e8 * rng.normal(size=(count, 3))
    radius = rng.uniform(0.8e-8, 1.2e-8, count)
    grains = sand.Grains(BOX.wrap(np.array(position)), radius, sand.IRON, velocity=velocity, spin=spin)
    return grains, np.array(pairs), np.array(position)


def with_motion(grains, velocity, spin):
    return sand.Grains(grains.position, grains.radius, sand.IRON, velocity=velocity, spin=spin)


def test_internal_energy_is_the_least_over_all_rigid_motions():
    """min over V, Ω of ½ Σ m |v − V − Ω×x|² + I |ω − Ω|², by linear least squares: the same to 1e-9; 6n − 6 degrees."""
    grains, pairs, whole = moving_chains()
    energy, degrees = internal_kinetic_energy(grains, pairs, BOX)
    first = 0
    for k, size in enumerate(SIZES):
        rows, values = [], []
        for i in range(first, first + size):
            x, m, inertia = whole[i], grains.mass[i], grains.inertia[i]
            across = np.array([[0, x[2], -x[1]], [-x[2], 0, x[0]], [x[1], -x[0], 0]])  # Ω×x = across @ Ω
            rows += [*(np.sqrt(m) * np.hstack((np.eye(3), across * 1e8)))]
            rows += [*(np.sqrt(inertia) * np.hstack((np.zeros((3, 3)), 1e8 * np.eye(3))))]
            values += [*(np.sqrt(m) * grains.velocity[i]), *(np.sqrt(inertia) * grains.spin[i])]
        scale = np.sqrt(grains.mass[0])
        rows, values = np.array(rows) / scale, np.array(values) / scale
        rest = values - rows @ np.linalg.lstsq(rows, values, rcond=None)[0]
        expected = 0.5 * scale**2 * rest @ rest if size > 1 else 0.0
        assert energy[k] == pytest.approx(expected, rel=1e-9, abs=1e-40)
        assert degrees[k] == (6 * size - 6 if size > 1 else 0)
        first += size


def test_rigid_motion_has_no_internal_energy():
    """v = V + Ω×x, ω = Ω for each cluster: 0 to rounding of the kinetic energy."""
    grains, pairs, whole = moving_chains()
    turning = 1e7 * np.array([1.0, -2.0, 0.5])
    velocity = np.array([3.0, -1.0, 2.0]) + np.cross(turning, whole)
    rigid = with_motion(grains, velocity, np.tile(turning, (len(grains), 1)))
    kinetic = 0.5 * (grains.mass * (velocity**2).sum(axis=1)).sum()
    assert internal_kinetic_energy(rigid, pairs, BOX)[0].max() < 1e-25 * kinetic


def test_grains_without_contacts_have_none():
    """Single grains: no internal degree of freedom."""
    grains, _, _ = moving_chains()
    energy, degrees = internal_kinetic_energy(grains, np.zeros((0, 2), int), BOX)
    assert not energy.any() and not degrees.any()


def row(internal=0.0, broken=0, clusters=10, time=0.0, largest=3):
    counts = {"broken": broken, "clusters": clusters, "largest_cluster": largest}
    return {"internal": internal, "time": time, **counts}


def notes(rows, temperature=100.0, damped=False):
    return vibration_notes(rows, temperature, 10, damped=damped)


def test_notes_on_vibration_and_breaking():
    """Above 100 k_B T₀ per grain; contacts that broke in a run that began with free grains; nothing otherwise."""
    share = 10 * BOLTZMANN * 100.0
    assert notes([]) == {}
    assert notes([row(), row(99.0 * share, time=1e-9)]) == {}
    assert notes([row(), row(1e9 * share)], 0.0) == {}  # no temperature to compare with
    text = notes([row(), row(101.0 * share, time=2e-9), row(500.0 * share, time=3e-9)])["vibration"]
    assert "up to 500 k_B T₀ per grain, above 100 first at t = 2 ns" in text and "damping = 'critical'" in text
    assert "damped already" in notes([row(), row(101.0 * share)], damped=True)["vibration"]
    cold = notes([row(), row(broken=2, clusters=4)])
    assert cold == {"breaking": "2 contacts broke while aggregates grew"}
    assert "damped already" in notes([row(), row(broken=2)], damped=True)["breaking"]
    hot = notes([row(), row(101.0 * share, broken=1)])
    assert hot["breaking"].startswith("1 contact broke while aggregates grew; damping = 'critical'")
    collision = [row(clusters=3), row(500.0 * share, broken=2, clusters=4)]
    assert notes(collision) == {}


def test_damping_is_advised_with_its_cost_and_only_where_aggregates_have_grown():
    """From three grains in one cluster on, all at once with the vibration; the speed is that of the page on options."""
    share = 10 * BOLTZMANN * 100.0
    assert notes([row(largest=1), row(1e6 * share, broken=1, largest=2)]) == {}  # a rebound, or a pair
    assert notes([row(largest=1), row(1e6 * share, largest=2), row(share, largest=9)]) == {}
    text = notes([row(largest=1), row(1e6 * share, largest=3)])["vibration"]
    page = (Path(sand.__file__).parents[2] / "docs/physics/contact-options.md").read_text("utf-8")
    header, speeds = (
        next(line for line in page.splitlines() if line.startswith(f"| {words}")).strip("| ").split(" | ")[1:]
        for words in ("$\\zeta$ | 0 | 0.05", "largest sticking speed")
    )
    factor = float(speeds[header.index(f"{DEFAULT_DAMPING_RATIO:g}")])
    assert f"grains then stick up to {factor:.2g} times the speed (damping_ratio = 0.2)" in text


@pytest.mark.compiled("contacts")
def test_a_pair_has_no_note_and_three_grains_have_one(tmp_path):
    """Cold grains ring far above 100 k_B T₀: a pair, or its rebound, is a collision; three grains have grown."""
    for number, speed in ((2, 0.1), (2, 100.0), (3, 0.1)):
        away = 2.05e-8 * np.arange(number)[:, None] * np.array([1.0, 0.0, 0.0])
        velocity = -speed * (np.arange(number) - (number - 1) / 2)[:, None] * np.array([1.0, 0.0, 0.0])
        grains = sand.Grains(away, 1e-8, "iron", velocity=velocity)
        folder = tmp_path / f"{number} at {speed}"
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            sim = sand.Simulation(grains, [sand.Contact()], out=folder, frame_every="0.1 ns")
            sim.writer.draws = False
            sim.run(until="8 ns")
        assert sim.ledger["made"][-1] == number - 1
        assert sim.ledger["broken"][-1] == (speed > 1.0)
        assert sum("grains in contact vibrate" in str(one.message) for one in caught) == (number > 2)
        assert sand.open(folder).summary["notes"] == sim.notes() and len(sim.notes()) == (number > 2)
