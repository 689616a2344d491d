"""The gas brakes and jostles every grain: exact over any time, given that nothing else acts meanwhile."""

from typing import NamedTuple

import numpy as np

from ...compiler.jit import formula, loop
from ...numerics.random import normal_vector
from ...numerics.vec import add, dot, load, put, sub
from .drag import decayed_fraction, ornstein_uhlenbeck, rotation_friction, thermal_spread, translation_friction

TRANSLATION, ROTATION = range(2)
"""Streams of random numbers: what a deviate is for.  Others that draw from `numerics.random` take other numbers."""


class GasParameters(NamedTuple):
    """The gas's run-time numbers."""

    on: bool  # False: vacuum
    density: float  # ρ_g [kg/m³]
    mean_speed: float  # v̄ of the molecules [m/s]
    temperature_energy: float  # k_B T [J]; 0: no Brownian kicks
    accommodation: float  # α, part of the molecules that leaves diffusely
    wind_x: float  # velocity of the gas [m/s]
    wind_y: float
    wind_z: float


VACUUM = GasParameters(False, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""No gas: `gas_kick` does nothing."""


@formula
def kick_one(grains, i, seed, number, elapsed, gas):
    """`gas_kick` for grain i alone; returns the energy it gave to the gas [J]."""
    r, m, inertia, v, w = (
        grains.radius[i],
        grains.mass[i],
        grains.inertia[i],
        load(grains.velocity, i),
        load(grains.spin, i),
    )
    slowed = decayed_fraction(translation_friction(r, gas.density, gas.mean_speed, gas.accommodation) / m, elapsed)
    spun_down = decayed_fraction(
        rotation_friction(r, gas.density, gas.mean_speed, gas.accommodation) / inertia, elapsed
    )
    push = twirl = (0.0, 0.0, 0.0)
    if gas.temperature_energy > 0.0:
        push = normal_vector(seed, number, grains.id[i], TRANSLATION)
        twirl = normal_vector(seed, number, grains.id[i], ROTATION)
    wind = (gas.wind_x, gas.wind_y, gas.wind_z)
    new_v = ornstein_uhlenbeck(v, wind, slowed, thermal_spread(slowed, gas.temperature_energy, m), push)
    new_w = ornstein_uhlenbeck(
        w, (0.0, 0.0, 0.0), spun_down, thermal_spread(spun_down, gas.temperature_energy, inertia), twirl
    )
    put(grains.velocity, i, new_v)
    put(grains.spin, i, new_w)
    # v² − v'² as a product: no digits are lost where the two are nearly the same
    moving = 0.5 * m * dot(sub(v, new_v), add(v, new_v))
    return moving + 0.5 * inertia * dot(sub(w, new_w), add(w, new_w))


@loop
def gas_kick(grains, seed, number, elapsed, gas):
    """Let the gas act on velocity and spin of every grain for `elapsed` seconds.

    Parameters
    ----------
    seed
        of the run, 0 ≤ seed < 2⁶³.
    number
        of this kick; a number used twice gives the same deviates twice.
    elapsed
        [s] ≥ 0.
    gas
        GasParameters.

    Returns
    -------
    result
        Kinetic energy [J] that the grains gave to the gas, laboratory frame; negative if they gained.

    Deviates belong to the id of a grain, not to its place, and grains do not see each other: the same bits come
    out whatever the order, or the pieces, in which grains are visited.
    """
    given = 0.0
    if gas.on:
        for i in range(grains.mass.size):
            given += kick_one(grains, i, seed, number, elapsed, gas)
    return given


def shortest_stopping_time(grains, gas):
    """The shortest of all m/f_t and I/f_r [s]; infinite without gas.  Not compiled.

    Parameters
    ----------
    grains
        grains.GrainArrays.
    gas
        GasParameters.
    """
    numbers = (gas.density, gas.mean_speed, gas.accommodation)
    fastest = max(
        np.max(translation_friction(grains.radius, *numbers) / grains.mass),
        np.max(rotation_friction(grains.radius, *numbers) / grains.inertia),
    )
    return float(1.0 / fastest) if gas.on and fastest > 0.0 else float("inf")
