"""The choice of the step must not feed energy into vibrating contacts."""

import math

import numpy as np
import pytest

import sand
from sand.integrate.step_control import steps_of_free_grains

R = 3e-7


def _pair():
    contact = sand.Contact().pairing(sand.SILICA, sand.SILICA)
    mass = 4.0 / 3.0 * math.pi * R**3 * sand.SILICA.density
    constants = sand.contact.law.contact_constants(sand.contact.jkr.LAW)(contact, R, R, mass, mass)
    rest = constants.rest_radius**2 / (3.0 * constants.reduced_radius)
    step = 2.0 * math.pi / math.sqrt(constants.max_squared_frequency) / sand.Verlet().steps_per_period
    return constants, 2.0 * R - rest, step


def _steps_of(sim, number):
    """The lengths [s] of the next steps."""
    out = []
    for _ in range(number):
        before = sim.time
        sim.run(steps=1)
        out.append(sim.time - before)
    return np.array(out)


@pytest.mark.compiled("contacts")
def test_sliding_vibration_of_a_spinning_pair_does_not_grow():
    """A free pair spins about a transverse axis and vibrates in sliding at 0.8 ζ_c: no loss, so E must not drift.

    Verlet at a constant step conserves p²/2m + ½kx² (1 − (ω dt)²/4): E oscillates by (ω dt)²/4 = 1.6 % of the vibration
    energy ½k_s ζ²; 1.1 times that is allowed.  A step that followed the relative surface speed, v_spin + v_vibration,
    would change with the vibration and add up to 0.8 % per change, always of one sign: 60 % in total.
    The three v_spin are those near δ_c per step, where such a step would change.
    """
    constants, distance, step = _pair()
    amplitude = 0.8 * constants.slide_limit
    rate = (
        0.5 * amplitude * math.sqrt(constants.max_squared_frequency) / R
    )  # spin of both grains that slides them that far
    vibration_energy = 0.5 * constants.slide_stiffness * amplitude**2
    for part in (0.8, 0.9, 1.2):
        turning = part * constants.break_overlap / step / distance
        half = 0.5 * distance
        grains = sand.Grains(
            [[half, 0, 0], [-half, 0, 0]],
            R,
            sand.SILICA,
            velocity=[[0, half * turning, 0], [0, -half * turning, 0]],
            spin=[[0, 0, turning + rate]] * 2,
        )
        sim = sand.Simulation(grains, [sand.Contact()], frame_every="5 ns")
        sim.run(steps=30_000)
        total = sim.ledger["total"]
        assert sim.ledger.rows[-1]["moved"] == 0
        assert np.ptp(total) < 1.1 * 0.25 * (2.0 * math.pi / 25.0) ** 2 * vibration_energy


@pytest.mark.compiled("contacts")
def test_a_slow_approach_does_not_shorten_the_step():
    """A grain about to make contact needs no shorter step than its contact will: the step is that of the contacts."""
    constants, distance, step = _pair()
    slow = 0.1 * constants.break_overlap / step
    gap = 100 * slow * step
    position = [[0, 0, 0], [distance, 0, 0], [0, 5e-6, 0], [2 * R + gap, 5e-6, 0]]
    grains = sand.Grains(position, R, sand.SILICA, velocity=[[0, 0, 0]] * 3 + [[-slow, 0, 0]])
    sim = sand.Simulation(grains, [sand.Contact()])
    sim.run(steps=1)
    lengths = _steps_of(sim, 150)
    assert sim.ledger.rows[-1]["made"] == 1
    assert np.ptp(lengths) < 1e-6 * step


@pytest.mark.compiled("contacts")
def test_a_shorter_step_is_held_for_ten_periods():
    """Two grains bounce beside a vibrating pair: the step shortens at once and grows after HOLD_STEPS steps."""
    from sand.integrate.step_control import HOLD_STEPS

    constants, distance, step = _pair()
    fast = 4.0 * constants.break_overlap / step
    position = [[0, 0, 0], [distance, 0, 0], [0, 5e-6, 0], [2 * R + 20 * fast * step, 5e-6, 0]]
    grains = sand.Grains(position, R, sand.SILICA, velocity=[[0, 0, 0]] * 3 + [[-fast, 0, 0]])
    sim = sand.Simulation(grains, [sand.Contact()])
    lengths = _steps_of(sim, 3 * HOLD_STEPS)
    changes = np.flatnonzero(np.abs(np.diff(lengths)) > 1e-3 * step)
    assert sim.ledger.rows[-1]["broken"] == 1
    growths = [k for k in changes if lengths[k + 1] > lengths[k]]
    assert len(growths) == 1
    assert growths[0] - max(k for k in changes if k < growths[0]) >= HOLD_STEPS
    assert math.isclose(lengths[-1], step, rel_tol=1e-6)


def test_gravity_does_not_shorten_the_step():
    """A uniform force causes no energy error in Verlet, so the step is the same with and without gravity."""
    grains = sand.Grains([[0, 0, 0], [1e-5, 0, 0]], R, sand.SILICA)
    sim = sand.Simulation(grains, [sand.Contact(), sand.Attraction()])
    system, control = sim.state, sim._engine.parameters.criteria
    assert control.energy_scale > 0.0
    steps = []
    for pull in (0.0, 9.81):
        system.grains.arrays.force[2] = -pull * grains.mass
        steps.append(steps_of_free_grains(system.grains.arrays, system.long_range, system.contacts.start, control))
    assert steps[0] == steps[1]
    system.long_range.force[2] = -9.81 * grains.mass  # as a long-range force it limits the step
    assert (
        steps_of_free_grains(system.grains.arrays, system.long_range, system.contacts.start, control)[0]
        < 0.1 * steps[0][0]
    )
