"""Where and how a flight begins: everything that is drawn by chance is a function of its address."""

import math
from typing import NamedTuple

from ...compiler.jit import formula, loop
from ...numerics.random import normal_vector, random_words, uniform
from ...numerics.vec import add, axpy, cross, dot, norm, scale, sub

PLACE, AXIS1, AXIS2, WHIRL1, WHIRL2, DRIFT = range(16, 22)
"""Streams of random numbers, apart from those of the gas."""
RANDOM, ALIGNED, GIVEN = range(3)
"""Directions of the moments: by chance, along the line of centres at the start, or as given."""
R, U = 0, 3
"""Where separation r = x1 − x2 and relative velocity u = v1 − v2 begin in the state of a pair."""


class Start(NamedTuple):
    """How pairs are sent off."""

    speed: float  # of the projectile, v∞ [m/s]
    along: tuple  # unit vector of its flight
    drift: tuple  # velocity of the target [m/s]
    drift_spread: float  # standard deviation of each component of it [m/s]
    distance: float  # of the plane, or radius of the sphere, that flights start on [m]
    sphere: bool
    azimuth: float  # of the impact parameter about the line of flight [rad]; below 0: by chance
    axes: int  # RANDOM, ALIGNED, GIVEN
    axis1: tuple  # directions of the moments if GIVEN
    axis2: tuple
    spin1: tuple  # [rad/s], to which a thermal one is added
    spin2: tuple
    spin_energy1: float  # mean energy of the thermal spin [J], a third about each axis
    spin_energy2: float


@formula
def at(y, first):
    """Three numbers of a state."""
    return y[first], y[first + 1], y[first + 2]


@formula
def write(y, first, v):
    """Put three numbers into a state."""
    y[first] = v[0]
    y[first + 1] = v[1]
    y[first + 2] = v[2]


@formula
def unit(v):
    """v/|v|"""
    return scale(1.0 / math.sqrt(dot(v, v)), v)


@formula
def beside(flight):
    """A unit vector across a unit vector; +y for a flight along +x."""
    reference = (1.0, 0.0, 0.0) if abs(flight[2]) > 0.9 else (0.0, 0.0, 1.0)
    return unit(cross(reference, flight))


@loop
def draw_path(y, address, low, high, start):
    """Separation and relative velocity of a flight; its impact parameter [m].

    b² is spread evenly over low² … high² [m²].  The flight begins on the plane `distance` before the target, or on
    the sphere; before and beside are told by the relative velocity, v1 − v2.
    """
    seed, stratum, number = address
    part, turn, _, _ = random_words(seed, number, stratum, PLACE)
    drift = axpy(start.drift_spread, normal_vector(seed, number, stratum, DRIFT), start.drift)
    velocity = sub(scale(start.speed, start.along), drift)
    flight = scale(1.0 / norm(velocity), velocity)
    square = low + (high - low) * uniform(part)
    b = math.sqrt(square)
    back = math.sqrt(max(start.distance**2 - square, 0.0)) if start.sphere else start.distance
    angle = start.azimuth if start.azimuth >= 0.0 else 2.0 * math.pi * uniform(turn)
    side = beside(flight)
    across = add(scale(math.cos(angle), side), scale(math.sin(angle), cross(flight, side)))
    write(y, R, axpy(-back, flight, scale(b, across)))
    write(y, U, velocity)
    return b


@loop
def drawn_axis(address, stream, mode, given, line):
    """Unit vector of a moment: by chance, along `line`, or as given."""
    seed, stratum, number = address
    if mode == ALIGNED:
        return line
    if mode == GIVEN:
        return given
    return unit(normal_vector(seed, number, stratum, stream))


@loop
def drawn_spin(address, stream, mean, spread):
    """ω = mean + spread ξ [rad/s]."""
    seed, stratum, number = address
    return axpy(spread, normal_vector(seed, number, stratum, stream), mean)
