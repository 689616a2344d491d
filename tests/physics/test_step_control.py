"""The choice of the step must not feed energy into what rings."""

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
def test_a_spinning_pair_does_not_ring_up():
    """A free pair spins about a transverse axis and slides to and fro at 0.8 ζ_c: no loss, so E must stay.

    Verlet at one step keeps p²/2m + ½kx² (1 − (ω dt)²/4): the energy swings by (ω dt)²/4 = 1.6 % of that of the
    ringing, ½k_s ζ², and comes back; 1.1 times that is allowed.  A step that follows the speed of the grains past each
    other, v_spin + v_ring, changes in time with the ringing: up to 0.8 % each time, of one sign, which adds up to 60 %.
    The three v_spin are those at which such a step changes, around δ_c a step.
    """
    constants, distance, step = _pair()
    ringing = 0.8 * constants.slide_limit
    rate = (
        0.5 * ringing * math.sqrt(constants.max_squared_frequency) / R
    )  # spin of both grains that slides them that far
    stake = 0.5 * constants.slide_stiffness * ringing**2
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
        assert np.ptp(total) < 1.1 * 0.25 * (2.0 * math.pi / 25.0) ** 2 * stake


@pytest.mark.compiled("contacts")
def test_a_slow_visitor_does_not_change_the_step_of_what_rings():
    """A grain about to touch needs no shorter a step than its contact will: the contacts' own, to the bit."""
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
    """Two grains bounce beside a ringing pair: the step falls at once, and grows only HOLD_STEPS steps after that."""
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
    """A uniform load costs Verlet no energy, however weak the long-range force beside it: the same step without it."""
    grains = sand.Grains([[0, 0, 0], [1e-5, 0, 0]], R, sand.SILICA)
    sim = sand.Simulation(grains, [sand.Contact(), sand.Attraction()])
    world, control = sim.state, sim._engine.parameters.criteria
    assert control.energy_scale > 0.0
    steps = []
    for pull in (0.0, 9.81):
        world.grains.arrays.force[2] = -pull * grains.mass
        steps.append(
            steps_of_free_grains(world.grains.arrays, world.long_range, world.contacts.start, world.count, control)
        )
    assert steps[0] == steps[1]
    world.long_range.force[2] = -9.81 * grains.mass  # as a long-range force it does count
    assert (
        steps_of_free_grains(world.grains.arrays, world.long_range, world.contacts.start, world.count, control)[0]
        < 0.1 * steps[0][0]
    )
