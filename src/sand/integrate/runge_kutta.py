"""Dormand and Prince's Runge–Kutta pair 5(4), and the loops that take one trial step with it.

Dormand, J. R. & Prince, P. J. 1980, J. Comput. Appl. Math. 6, 19.  The state of a grain is (x, v, ϱ, ω), 13 numbers:

    ẋ = v,  v̇ = F/m,  ϱ̇ = ½ ω∘ϱ,  ω̇ = M/I

The right-hand side depends on ϱ/|ϱ| only, so normalising ϱ between steps does not affect the order.  The last of the
seven stages is the new state, and its rates are the first of the next step (FSAL).

The trajectories of `experiments.scattering` have a Runge–Kutta driver of their own, of order 8 and for two bodies.
"""

import math

import numpy as np

from ..compiler.jit import caller, formula, loop, rare
from ..numerics.quaternion import normalised, turned, turning_rate
from ..numerics.vec import load, load4, put, put4
from .force_calls import add_external_loads, sum_external, sum_pair_forces
from .force_stages import POWER
from .respa import add_long_range_loads

STAGES = 7
TIMES = np.array([0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0])
"""Times c_s of the stages, in units of the step."""
WEIGHTS = np.zeros((STAGES, STAGES))
"""Coefficients a_sr of the stages; the last row is the solution of order 5."""
WEIGHTS[1, :1] = [1 / 5]
WEIGHTS[2, :2] = [3 / 40, 9 / 40]
WEIGHTS[3, :3] = [44 / 45, -56 / 15, 32 / 9]
WEIGHTS[4, :4] = [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729]
WEIGHTS[5, :5] = [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656]
WEIGHTS[6, :6] = [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84]
ERROR = np.array([71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])
"""Weights of order 5 minus those of order 4: the error estimate of the step."""
SAFETY, SHRINK, GROW = 0.9, 0.2, 5.0
"""Step-size control: safety factor, smallest and largest ratio of successive steps."""
X, V, Q, W = 0, 3, 6, 10
"""First rows of position, velocity, orientation and spin in the arrays of a stage."""


@formula
def step_size_factor(error, order):
    """Ratio of the next step to this one: 0.9 err^(−1/order), limited to 0.2 … 5; 5 for err = 0."""
    if error == 0.0:
        return GROW
    return min(GROW, max(SHRINK, SAFETY * error ** (-1.0 / order)))


@formula
def rows3(array, first, i):
    """Three rows of column i."""
    return array[first, i], array[first + 1, i], array[first + 2, i]


@loop
def weighted_rate(rate, weights, stages, row, i):
    """Σ w_s k_s of one row over the first `stages` stages."""
    total = 0.0
    for s in range(stages):
        total += weights[s] * rate[s, row, i]
    return total


@loop
def store_start(grains, runge_kutta):
    """Store the state of all grains at the start of the step."""
    for i in range(grains.mass.size):
        for row in range(3):
            runge_kutta.start[X + row, i] = grains.position[row, i]
            runge_kutta.start[V + row, i] = grains.velocity[row, i]
            runge_kutta.start[W + row, i] = grains.spin[row, i]
        for row in range(4):
            runge_kutta.start[Q + row, i] = grains.orientation[row, i]


@rare
def set_stage(grains, runge_kutta, s, dt):
    """Set all grains to stage s of a step of dt seconds; returns the square of the largest displacement [m²].

    Stage 0 is the start of the step.
    """
    largest = 0.0
    start, rate, weights = runge_kutta.start, runge_kutta.rate, WEIGHTS[s]
    for i in range(grains.mass.size):
        squared = 0.0
        for row in range(3):
            moved = dt * weighted_rate(rate, weights, s, X + row, i)
            squared += moved * moved
            grains.position[row, i] = start[X + row, i] + moved
            grains.velocity[row, i] = start[V + row, i] + dt * weighted_rate(rate, weights, s, V + row, i)
            grains.spin[row, i] = start[W + row, i] + dt * weighted_rate(rate, weights, s, W + row, i)
        for row in range(4):
            grains.orientation[row, i] = start[Q + row, i] + dt * weighted_rate(rate, weights, s, Q + row, i)
        put(grains.moment, i, turned(normalised(load4(grains.orientation, i)), load(grains.body_moment, i)))
        # written so that a displacement that is not a number counts as infinite
        largest = largest if squared <= largest else squared
        largest = largest if squared < math.inf else math.inf
    return largest


@rare
def store_rates(grains, runge_kutta, s):
    """Store the rates of change at stage s, from its loads."""
    rate = runge_kutta.rate
    for i in range(grains.mass.size):
        for row in range(3):
            rate[s, X + row, i] = grains.velocity[row, i]
            rate[s, V + row, i] = grains.force[row, i] / grains.mass[i]
            rate[s, W + row, i] = grains.torque[row, i] / grains.inertia[i]
        turning = turning_rate(load4(grains.orientation, i), load(grains.spin, i))
        for row in range(4):
            rate[s, Q + row, i] = turning[row]


@loop
def normalise_all(grains):
    """Normalise the orientations, |ϱ| = 1; the moments are already those of ϱ/|ϱ|."""
    for i in range(grains.mass.size):
        put4(grains.orientation, i, normalised(load4(grains.orientation, i)))


@loop
def error_ratio(runge_kutta, dt, error_limits):
    """Largest ratio of estimated to allowed error of the step, and its grain; infinite if not a number.

    The error of an angle is twice that of the rotation parameters.
    """
    rate = runge_kutta.rate
    largest, limiting_grain = 0.0, 0
    for i in range(runge_kutta.start.shape[1]):
        x = v = w = q = 0.0
        for row in range(3):
            x += weighted_rate(rate, ERROR, STAGES, X + row, i) ** 2
            v += weighted_rate(rate, ERROR, STAGES, V + row, i) ** 2
            w += weighted_rate(rate, ERROR, STAGES, W + row, i) ** 2
        for row in range(4):
            q += weighted_rate(rate, ERROR, STAGES, Q + row, i) ** 2
        ratio = max(math.sqrt(x) / error_limits.position, math.sqrt(v) / error_limits.velocity)
        ratio = max(ratio, 2.0 * math.sqrt(q) / error_limits.turn, math.sqrt(w) / error_limits.spin)
        if not (x + v + w + q < math.inf):
            return math.inf, i
        if dt * ratio > largest:
            largest, limiting_grain = dt * ratio, i
    return largest, limiting_grain


@rare
def sum_loads(s, time):
    """Sum all loads of free grains at their present positions."""
    for i in range(s.grains.mass.size):
        put(s.grains.force, i, (0.0, 0.0, 0.0))
        put(s.grains.torque, i, (0.0, 0.0, 0.0))
    add_external_loads(s, time)
    if s.forces.pair > 0:
        sum_pair_forces(s)
        add_long_range_loads(s.grains, s.long_range)


@caller
def begin_step(s, begin):
    """Store the state at the start of the step, at the time `begin`, and the rates of stage 0."""
    store_start(s.grains, s.runge_kutta)
    store_rates(s.grains, s.runge_kutta, 0)
    if s.external_work.time_dependent:
        s.runge_kutta.power[0] = sum_external(s, begin, POWER)


@caller
def try_step(s, begin, dt, stride):
    """Compute all stages of a step; False if a grain moves farther than `stride`."""
    for k in range(1, STAGES):
        if not set_stage(s.grains, s.runge_kutta, k, dt) <= stride * stride:
            return False
        time = begin + TIMES[k] * dt
        sum_loads(s, time)
        store_rates(s.grains, s.runge_kutta, k)
        if s.external_work.time_dependent:
            s.runge_kutta.power[k] = sum_external(s, time, POWER)
    return True


@loop
def work_of(runge_kutta, dt):
    """Work ∫ P dt [J] of the external forces over the step, of the same order as the step."""
    total = 0.0
    for s in range(STAGES - 1):
        total += WEIGHTS[STAGES - 1, s] * runge_kutta.power[s]
    return dt * total
