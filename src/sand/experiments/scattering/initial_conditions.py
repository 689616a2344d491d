"""Initial conditions of flights. All random numbers are functions of (seed, stratum, number)."""

import math
from typing import NamedTuple

from ...compiler.jit import formula, loop
from ...numerics.random import normal_vector, random_words, uniform
from ...numerics.vec import add, axpy, cross, dot, norm, scale, sub

OFFSET, AXIS1, AXIS2, SPIN_STREAM1, SPIN_STREAM2, DRIFT = range(16, 22)
"""Streams of random numbers, distinct from those of the gas."""
RANDOM, ALIGNED, GIVEN = range(3)
"""Directions of the moments: random, along the initial line of centres, or as given."""
R, U = 0, 3
"""Offsets of the separation r = x1 − x2 and the relative velocity u = v1 − v2 in the state of a pair."""


class InitialConditions(NamedTuple):
    """Parameters from which the kernel draws the initial state of a flight."""

    speed: float  # speed of the projectile v∞ [m/s]
    along: tuple  # unit vector of its velocity
    drift: tuple  # velocity of the target [m/s]
    drift_spread: float  # standard deviation of each component of that velocity [m/s]
    distance: float  # distance of the plane, or radius of the sphere, on which flights start [m]
    sphere: bool
    axes: int  # RANDOM, ALIGNED or GIVEN
    spin: tuple  # mean spins of both bodies [rad/s]; thermal spins are added
    spin_energy: tuple  # mean energies of the thermal spins [J], a third about each axis
    axis: tuple  # directions of the moments if GIVEN
    azimuth: float  # azimuth of the impact parameter about the line of flight [rad]; random if negative


@formula
def vector_at(y, first):
    """Three components of a state, from index `first`."""
    return y[first], y[first + 1], y[first + 2]


@formula
def set_vector(y, first, v):
    """Set three components of a state, from index `first`."""
    y[first] = v[0]
    y[first + 1] = v[1]
    y[first + 2] = v[2]


@formula
def unit(v):
    """Unit vector v/|v|."""
    return scale(1.0 / math.sqrt(dot(v, v)), v)


@formula
def perpendicular_to(flight):
    """Unit vector perpendicular to a unit vector; +y for a flight along +x."""
    reference = (1.0, 0.0, 0.0) if abs(flight[2]) > 0.9 else (0.0, 0.0, 1.0)
    return unit(cross(reference, flight))


@loop
def draw_path(y, flight_id, low, high, start):
    """Draw separation and relative velocity of a flight into its state, and return the impact parameter [m].

    b² is uniform in low … high [m²]. The flight begins on the plane at `distance` before the target, or on the sphere;
    both refer to the direction of the relative velocity v1 − v2.
    """
    seed, stratum, number = flight_id
    word1, word2, _, _ = random_words(seed, number, stratum, OFFSET)
    drift = axpy(start.drift_spread, normal_vector(seed, number, stratum, DRIFT), start.drift)
    velocity = sub(scale(start.speed, start.along), drift)
    flight = scale(1.0 / norm(velocity), velocity)
    square = low + (high - low) * uniform(word1)
    b = math.sqrt(square)
    back = math.sqrt(max(start.distance**2 - square, 0.0)) if start.sphere else start.distance
    angle = start.azimuth if start.azimuth >= 0.0 else 2.0 * math.pi * uniform(word2)
    side = perpendicular_to(flight)
    across = add(scale(math.cos(angle), side), scale(math.sin(angle), cross(flight, side)))
    set_vector(y, R, axpy(-back, flight, scale(b, across)))
    set_vector(y, U, velocity)
    return b


@loop
def draw_axis(flight_id, stream, mode, given, line):
    """Unit vector of a moment: random, along `line`, or as given."""
    seed, stratum, number = flight_id
    if mode == ALIGNED:
        return line
    if mode == GIVEN:
        return given
    return unit(normal_vector(seed, number, stratum, stream))


@loop
def draw_spin(flight_id, stream, mean, spread):
    """Random spin ω = mean + spread ξ [rad/s], ξ standard normal."""
    seed, stratum, number = flight_id
    return axpy(spread, normal_vector(seed, number, stratum, stream), mean)
