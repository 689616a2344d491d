"""Flights of two free bodies past each other, many in one call: Dormand–Prince steps, from a start to a touch or out.

No array of the world is needed: a pair is a row of numbers (experiments/scattering/two_spheres.py), and each flight is a function of its
address (seed, stratum, number) alone, so that any can be flown again by itself.
"""

import functools
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import DOP853 as SCHEME

from ...compiler.jit import kernel, loop, rare
from ...integrate.runge_kutta import step_size_factor
from ...numerics.vec import dot, norm
from .initial_conditions import R, U, at, draw_path
from .two_spheres import Model

STAGES = SCHEME.n_stages
"""12; the rates at the new state, number 13, serve as the first of the next step."""
ORDER = 8.0
"""The error of a step goes as this power of its length."""
HIT, MISS, BOUND, FAILED = range(4)
"""How a flight ended: at a touch, beyond the escape distance, still together after the most steps, not finite."""
RESULTS = ("end", "impact_parameter", "speed", "time", "steps", "closest", "impact_speed", "drift")
"""What is kept of each flight, in this order: impact parameter and closest distance of surfaces [m], relative speed at
the start and at the end [m/s], time [s], change of the energy over the largest ½m̄u² that was met."""
EXACT = 1e-7
"""A touch is found to this part of `Limits.touch`."""
FIRST = 1e-2
"""First step to try, in |r|/|u|."""
SMALLEST = 1e-18
"""Steps below this part of |r|/|u| at the start mean that something is not finite."""


class Room(NamedTuple):
    """Where a flight is computed."""

    y: np.ndarray  # (size,) the state
    new: np.ndarray  # (size,) the state after a trial step
    rate: np.ndarray  # (13, size) rates of change at each stage
    error: np.ndarray  # (size,)
    nought: np.ndarray  # (size,) zeros
    trail: np.ndarray  # (rows, 1 + size) time and state after each step of the last flight, as far as there are rows


def room_for(size: int, rows: int = 0) -> Room:
    """Room for states of `size` numbers and a trail of so many rows."""
    one = [np.zeros(size) for _ in range(4)]
    return Room(one[0], one[1], np.zeros((STAGES + 1, size)), one[2], one[3], np.zeros((rows, 1 + size)))


class Limits(NamedTuple):
    """When flights end and how well they are computed."""

    tolerance: float  # error of a step over the scales
    escape: float  # distance [m] beyond which a body that flies away has escaped; 0: that of its start
    most_steps: int
    touch: float  # a length [m], r1 + r2
    reduced: float  # m̄ [kg]


def blend_of(weights: np.ndarray, size: int) -> Callable:
    """The loop out = y + dt Σ w_s k_s, with the weights and their number known to the compiler."""
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
def stages_of(rates: Callable, size: int, stage: int) -> Callable:
    """The loop that goes through the stages up to this one, the last of which is the new state."""
    blend = blend_of(SCHEME.B if stage == STAGES else SCHEME.A[stage, :stage], size)
    if stage == 1:

        @loop
        def first(room, rules, dt):
            blend(room.y, room.rate, dt, room.new)
            rates(room.new, room.rate[1], rules)

        return first
    before = stages_of(rates, size, stage - 1)

    @loop
    def further(room, rules, dt):
        before(room, rules, dt)
        blend(room.y, room.rate, dt, room.new)
        rates(room.new, room.rate[stage], rules)

    return further


@loop
def note(trail, step, time, y):
    """Write time and state into the trail, if it is long enough."""
    if step < trail.shape[0]:
        trail[step, 0] = time
        for row in range(y.size):
            trail[step, 1 + row] = y[row]


@functools.cache
def flight_of(model: Model) -> Callable:
    """The loop that flies one pair to its end: (end, time, steps, closest gap, drift)."""
    rates, error_of, gap_of, energy_of, tidy = model.rates, model.error, model.gap, model.energy, model.tidy

    size = model.size
    go_through = stages_of(rates, size, STAGES)
    blend5, blend3 = blend_of(SCHEME.E5, size), blend_of(SCHEME.E3, size)

    @rare
    def tried(room, rules, dt):
        """One step to `new`: its error over the scales, infinite if not a number."""
        go_through(room, rules, dt)
        size_of_all = 0.0
        for row in range(size):
            size_of_all += abs(room.new[row])
        if not size_of_all < math.inf:  # scales and maxima would hide what is not a number
            return math.inf
        blend5(room.nought, room.rate, dt, room.error)
        fifth = error_of(room.y, room.error, rules)
        blend3(room.nought, room.rate, dt, room.error)
        third = error_of(room.y, room.error, rules)
        if not (fifth + third < math.inf):
            return math.inf
        return fifth * fifth / math.sqrt(fifth * fifth + 0.01 * third * third) if fifth > 0.0 else 0.0

    @loop
    def fly(room, rules, limits):
        y, new, rate = room.y, room.new, room.rate
        r, u = at(y, R), at(y, U)
        outside = limits.escape if limits.escape > 0.0 else norm(r)
        first = norm(r) / norm(u)
        rates(y, rate[0], rules)
        begun = energy_of(y, rules)
        gap, longest = gap_of(y, rules)
        time, dt, closest, steps = 0.0, FIRST * first, gap, 0
        fastest, end = dot(u, u), BOUND
        note(room.trail, 0, time, y)
        while steps < limits.most_steps:
            dt = min(dt, longest)
            off = tried(room, rules, dt) / limits.tolerance
            if not off <= 1.0:
                dt *= step_size_factor(off, ORDER)
                if not dt > SMALLEST * first:
                    return FAILED, time, steps, closest, 0.0
                continue
            new_gap, longest = gap_of(new, rules)
            if new_gap < -EXACT * limits.touch and gap > 0.0:  # beyond the touch: to where the chord has it
                dt *= max(0.1, gap / (gap - new_gap))
                continue
            tidy(new)
            for row in range(size):
                y[row] = new[row]
                rate[0, row] = rate[STAGES, row]
            gap, time, steps = new_gap, time + dt, steps + 1
            dt *= step_size_factor(off, ORDER)
            closest = min(closest, gap)
            note(room.trail, steps, time, y)
            r, u = at(y, R), at(y, U)
            fastest = max(fastest, dot(u, u))
            if gap <= EXACT * limits.touch:
                end = HIT
                break
            if dot(r, r) >= outside * outside and dot(r, u) > 0.0:
                end = MISS
                break
        return end, time, steps, closest, abs(energy_of(y, rules) - begun) / (0.5 * limits.reduced * fastest)

    return fly


@functools.cache
def flights_of(model: Model) -> Callable:
    """The compiled loop that flies many pairs.

    It takes the seed, their strata and numbers (K,), the least and largest b² of each (K,) [m²], a `Room`, `results`
    (K, 8) and `ends` (K, size) to fill, and the numbers of start, kind of pair and limits.
    """
    fly, pose = flight_of(model), model.pose

    def fly_all(seed, strata, numbers, low, high, room, results, ends, start, rules, limits):
        y = room.y
        for flight in range(numbers.size):
            address = (seed, strata[flight], numbers[flight])
            b = draw_path(y, address, low[flight], high[flight], start)
            pose(y, address, start, rules)
            speed = norm(at(y, U))
            end, time, steps, closest, drift = fly(room, rules, limits)
            told = (float(end), b, speed, time, float(steps), closest, norm(at(y, U)), drift)
            for column in range(len(told)):
                results[flight, column] = told[column]
            for row in range(y.size):
                ends[flight, row] = y[row]

    return kernel(fly_all)
