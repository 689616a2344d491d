"""The Taylor schemes of the paper: long-range loads extrapolated within a cycle by their first-order series.

Stages and loops of `sand.Verlet(far="taylor")` and `"taylor-literal"`; the driver calls `sum_rates` at the start of a
cycle and the stage `extrapolate` in its steps.  The rates of each pair are those of its force (`LongRangeSums.rates`).
"""

from ..basics.state import CYCLE
from ..compiler.jit import loop, rare
from ..compiler.program import call_stage
from ..compiler.stage import stage
from ..numerics.vec import accrue, axpy, cross, load, nearest_image, put, scale, sub
from .force_stages import PAIR_STAGES, RATES
from .parts import CYCLE_LENGTH, SINCE
from .stages import StageNumber


@loop
def set_mean_velocities(grains, long_range, start, span, cycle, instantaneous):
    """Replace `past_position` and `past_moment` by the rates ṙ and μ̇ of the Taylor series.

    Grains in contact oscillate within the extrapolated time: their rates are means since the previous summation,
    `cycle` [s] ago.  Free grains, and all grains if `instantaneous`, take v and ω×μ.
    """
    for i in range(grains.mass.size):
        if instantaneous or start[i + 1] == start[i]:
            put(long_range.past_position, i, load(grains.velocity, i))
            put(long_range.past_moment, i, cross(load(grains.spin, i), load(grains.moment, i)))
        else:
            rate = 1.0 / cycle if cycle > 0.0 else 0.0
            moved = nearest_image(sub(load(grains.position, i), load(long_range.past_position, i)), span)
            turned = sub(load(grains.moment, i), load(long_range.past_moment, i))
            put(long_range.past_position, i, scale(rate, moved))
            put(long_range.past_moment, i, scale(rate, turned))


@loop
def clear_rates(long_range):
    """Set the rates of all long-range forces and torques to 0."""
    for i in range(long_range.force.shape[1]):
        put(long_range.force_rate, i, (0.0, 0.0, 0.0))
        put(long_range.torque_rate, i, (0.0, 0.0, 0.0))


@stage("the rates of Taylor series")
def prepare_rates(grains, contacts, long_range, clock, span, respa, scratch):
    """Before the rates of pair forces are summed: mean velocities, and rates of 0."""
    # a mean over much less than the extrapolated time is dominated by oscillations
    past = clock[CYCLE] if clock[CYCLE] >= 0.5 * scratch[CYCLE_LENGTH] else 0.0
    set_mean_velocities(grains, long_range, contacts.start, span, past, respa.instantaneous_rates)
    clear_rates(long_range)
    return 0


@stage("the rates of Taylor series")
def store_summation_positions(grains, long_range):
    """Store positions and moments of this summation, for the mean rates at the next."""
    for i in range(grains.mass.size):
        put(long_range.past_position, i, load(grains.position, i))
        put(long_range.past_moment, i, load(grains.moment, i))
    return 0


@stage("the extrapolation of long-range loads")
def extrapolate(grains, long_range, scratch):
    """Add F + Ḟ t and M + Ṁ t (Eq. 51), t the time [s] since the last summation."""
    since = scratch[SINCE]
    for i in range(grains.mass.size):
        accrue(grains.force, i, axpy(since, load(long_range.force_rate, i), load(long_range.force, i)))
        accrue(grains.torque, i, axpy(since, load(long_range.torque_rate, i), load(long_range.torque, i)))
    return 0


@rare
def sum_rates(s, cycle):
    """The rates of the Taylor series at the start of a cycle of `cycle` [s]; none for 0."""
    if cycle > 0.0:
        s.scratch[CYCLE_LENGTH] = cycle
        call_stage(s, StageNumber.PREPARE_RATES)
        for k in range(s.forces.pair):
            call_stage(s, StageNumber.FIRST_FORCE + PAIR_STAGES * k + RATES)
    call_stage(s, StageNumber.STORE_POSITIONS)
