"""Driver of flights of two free bodies: Dormand–Prince steps (order 8) from the start to contact or escape.

The state of a pair is one small array (`two_spheres`, `two_aggregates`). Each flight is a function of its identifier
(seed, stratum, number) alone, so that any flight can be repeated.
"""

import functools
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import DOP853 as SCHEME

from ...compiler.jit import formula, kernel, loop, rare
from ...numerics.vec import dot, norm
from .initial_conditions import R, U, draw_path, vector_at
from .two_spheres import Model

STAGES = SCHEME.n_stages
"""12 stages; the rates at the new state, number 13, are the first stage of the next step."""
ORDER = 8.0
"""Order of the error estimate of a step."""
SAFETY, SHRINK, GROW = 0.9, 0.2, 5.0
"""Step-size control: safety factor, smallest and largest ratio of successive steps."""
HIT, MISS, BOUND, FLIGHT_FAILED = range(4)
"""Ends of a flight: contact, escape, still together after the largest number of steps, state not finite."""
FLIGHT_RESULTS = ("end", "impact_parameter", "speed", "time", "steps", "closest", "impact_speed", "drift")
"""Results of a flight: impact parameter and smallest gap [m], relative speed at the start and at the end [m/s], time
[s], energy error over the largest kinetic energy ½m̄u² during the flight."""
EXACT = 1e-7
"""Tolerance of the gap at contact, in units of `Limits.touch`."""
FIRST = 1e-2
"""First trial step, in units of |r|/|u|."""
SMALLEST = 1e-18
"""Smallest step, in units of the initial |r|/|u|; smaller ones indicate values that are not finite."""


class Workspace(NamedTuple):
    """Work arrays of one flight."""

    y: np.ndarray  # (size,) the state
    new: np.ndarray  # (size,) the state after a trial step
    rate: np.ndarray  # (13, size) rates of change at each stage
    error: np.ndarray  # (size,)
    zeros: np.ndarray  # (size,) zeros
    history: np.ndarray  # (rows, 1 + size) time and state after each of the first `rows` steps of the last flight


@formula
def step_size_factor(error):
    """Ratio of the next step to this one: 0.9 err^(−1/8), limited to 0.2 … 5; 5 for err = 0."""
    if error == 0.0:
        return GROW
    return min(GROW, max(SHRINK, SAFETY * error ** (-1.0 / ORDER)))


def allocate_workspace(size: int, rows: int = 0) -> Workspace:
    """Allocate work arrays for states of length `size` and a history of `rows` steps."""
    one = [np.zeros(size) for _ in range(4)]
    return Workspace(one[0], one[1], np.zeros((STAGES + 1, size)), one[2], one[3], np.zeros((rows, 1 + size)))


class Flights(NamedTuple):
    """Which flights are computed, and their results."""

    strata: np.ndarray  # (K,) uint64: stratum and number of each flight
    numbers: np.ndarray
    low: np.ndarray  # (K,) lower and upper limit of b² [m²]
    high: np.ndarray
    results: np.ndarray  # (K, 8) RESULTS
    ends: np.ndarray  # (K, size) states at the end


class Limits(NamedTuple):
    """End conditions and accuracy of flights."""

    tolerance: float  # largest error of a step over the scales
    escape: float  # distance [m] beyond which a receding body has escaped; 0: that of its start
    most_steps: int
    touch: float  # length scale r1 + r2 [m]
    reduced: float  # m̄ [kg]


def linear_combination(weights: np.ndarray, size: int) -> Callable:
    """Compile the loop out = y + dt Σ w_s k_s with constant weights."""
    stages = tuple(int(s) for s in np.flatnonzero(weights))
    used = tuple(float(weights[s]) for s in stages)
    count = len(used)

    @loop
    def blend(y, rate, dt, out):
        for row in range(size):
            total = 0.0
            for n in range(count):
                total += used[n] * rate[stages[n], row]
            out[row] = y[row] + dt * total

    return blend


@functools.cache
def runge_kutta_stages(rates: Callable, size: int, stage: int) -> Callable:
    """Compile the loop over the stages up to `stage`; the last one is the new state."""
    blend = linear_combination(SCHEME.B if stage == STAGES else SCHEME.A[stage, :stage], size)
    if stage == 1:

        @loop
        def first(work, parameters, dt):
            blend(work.y, work.rate, dt, work.new)
            rates(work.new, work.rate[1], parameters)

        return first
    before = runge_kutta_stages(rates, size, stage - 1)

    @loop
    def further(work, parameters, dt):
        before(work, parameters, dt)
        blend(work.y, work.rate, dt, work.new)
        rates(work.new, work.rate[stage], parameters)

    return further


@loop
def record_step(history, step, time, y):
    """Write time and state to the history, as long as it has rows."""
    if step < history.shape[0]:
        history[step, 0] = time
        for row in range(y.size):
            history[step, 1 + row] = y[row]


@functools.cache
def flight_of(model: Model) -> Callable:
    """Compile the loop that integrates one flight to its end: (end, time, steps, smallest gap, drift)."""
    rates, error_of, gap_of, energy_of, normalise = model.rates, model.error, model.gap, model.energy, model.normalise

    size = model.size
    all_stages = runge_kutta_stages(rates, size, STAGES)
    blend5, blend3 = linear_combination(SCHEME.E5, size), linear_combination(SCHEME.E3, size)

    @rare
    def trial_step(work, parameters, dt):
        """One step to `new`; returns its error over the scales, infinite if a value is not finite."""
        all_stages(work, parameters, dt)
        total = 0.0
        for row in range(size):
            total += abs(work.new[row])
        if not total < math.inf:  # maxima of error and scale would hide a NaN
            return math.inf
        blend5(work.zeros, work.rate, dt, work.error)
        fifth = error_of(work.y, work.error, parameters)
        blend3(work.zeros, work.rate, dt, work.error)
        third = error_of(work.y, work.error, parameters)
        if not (fifth + third < math.inf):
            return math.inf
        return fifth * fifth / math.sqrt(fifth * fifth + 0.01 * third * third) if fifth > 0.0 else 0.0

    @loop
    def fly(work, parameters, limits):
        y, new, rate = work.y, work.new, work.rate
        r, u = vector_at(y, R), vector_at(y, U)
        escape = limits.escape if limits.escape > 0.0 else norm(r)
        first = norm(r) / norm(u)
        rates(y, rate[0], parameters)
        initial_energy = energy_of(y, parameters)
        gap, longest_step = gap_of(y, parameters)
        time, dt, closest, steps = 0.0, FIRST * first, gap, 0
        fastest, end = dot(u, u), BOUND
        record_step(work.history, 0, time, y)
        while steps < limits.most_steps:
            dt = min(dt, longest_step)
            error_ratio = trial_step(work, parameters, dt) / limits.tolerance
            if not error_ratio <= 1.0:
                dt *= step_size_factor(error_ratio)
                if not dt > SMALLEST * first:
                    return FLIGHT_FAILED, time, steps, closest, 0.0
                continue
            new_gap, longest_step = gap_of(new, parameters)
            if new_gap < -EXACT * limits.touch and gap > 0.0:  # overlap: shorten the step by the secant method
                dt *= max(0.1, gap / (gap - new_gap))
                continue
            normalise(new)
            for row in range(size):
                y[row] = new[row]
                rate[0, row] = rate[STAGES, row]
            gap, time, steps = new_gap, time + dt, steps + 1
            dt *= step_size_factor(error_ratio)
            closest = min(closest, gap)
            record_step(work.history, steps, time, y)
            r, u = vector_at(y, R), vector_at(y, U)
            fastest = max(fastest, dot(u, u))
            if gap <= EXACT * limits.touch:
                end = HIT
                break
            if dot(r, r) >= escape * escape and dot(r, u) > 0.0:
                end = MISS
                break
        return (
            end,
            time,
            steps,
            closest,
            abs(energy_of(y, parameters) - initial_energy) / (0.5 * limits.reduced * fastest),
        )

    return fly


@functools.cache
def flights_of(model: Model) -> Callable:
    """Compile the loop over many flights.

    Its arguments are the seed, the `Flights`, a `Workspace`, the `InitialConditions`, the parameters of the pair and
    the `Limits`.
    """
    fly, draw_pose = flight_of(model), model.draw_pose

    def fly_all(seed, flights, work, start, parameters, limits):
        y = work.y
        for flight in range(flights.numbers.size):
            flight_id = (seed, flights.strata[flight], flights.numbers[flight])
            b = draw_path(y, flight_id, flights.low[flight], flights.high[flight], start)
            draw_pose(y, flight_id, start, parameters)
            speed = norm(vector_at(y, U))
            end, time, steps, closest, drift = fly(work, parameters, limits)
            values = (float(end), b, speed, time, float(steps), closest, norm(vector_at(y, U)), drift)
            for column in range(len(values)):
                flights.results[flight, column] = values[column]
            for row in range(y.size):
                flights.ends[flight, row] = y[row]

    return kernel(fly_all)
