"""Drag and Brownian kicks of all grains: the exact solution over any time in the absence of other forces."""

from typing import NamedTuple

import numpy as np

from ..compiler.jit import formula, loop
from ..numerics.random import normal_vector
from ..numerics.vec import add, dot, load, put, sub
from .gas_drag import decayed_fraction, ornstein_uhlenbeck, rotation_friction, thermal_spread, translation_friction

TRANSLATION, ROTATION = range(2)
"""Random-number streams of `numerics.random`, distinct from those of all other uses."""


class GasParameters(NamedTuple):
    """Run-time parameters of the gas."""

    on: bool  # False: vacuum
    density: float  # ρ_g [kg/m³]
    mean_speed: float  # v̄ of the molecules [m/s]
    temperature_energy: float  # k_B T [J]; 0: no Brownian kicks
    accommodation: float  # α, fraction of molecules reflected diffusely
    wind_x: float  # velocity of the gas [m/s]
    wind_y: float
    wind_z: float


VACUUM = GasParameters(False, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""No gas: `gas_kick` has no effect."""


@formula
def kick_grain(grains, i, seed, number, elapsed, gas):
    """Apply `gas_kick` to grain i; returns the energy [J] transferred to the gas."""
    r, m, inertia, v, w = (
        grains.radius[i],
        grains.mass[i],
        grains.inertia[i],
        load(grains.velocity, i),
        load(grains.spin, i),
    )
    decayed_v = decayed_fraction(translation_friction(r, gas.density, gas.mean_speed, gas.accommodation) / m, elapsed)
    decayed_w = decayed_fraction(
        rotation_friction(r, gas.density, gas.mean_speed, gas.accommodation) / inertia, elapsed
    )
    noise_v = noise_w = (0.0, 0.0, 0.0)
    if gas.temperature_energy > 0.0:
        noise_v = normal_vector(seed, number, grains.id[i], TRANSLATION)
        noise_w = normal_vector(seed, number, grains.id[i], ROTATION)
    wind = (gas.wind_x, gas.wind_y, gas.wind_z)
    new_v = ornstein_uhlenbeck(v, wind, decayed_v, thermal_spread(decayed_v, gas.temperature_energy, m), noise_v)
    new_w = ornstein_uhlenbeck(
        w, (0.0, 0.0, 0.0), decayed_w, thermal_spread(decayed_w, gas.temperature_energy, inertia), noise_w
    )
    put(grains.velocity, i, new_v)
    put(grains.spin, i, new_w)
    # v² − v'² as a product: accurate where the two are nearly equal
    translational = 0.5 * m * dot(sub(v, new_v), add(v, new_v))
    return translational + 0.5 * inertia * dot(sub(w, new_w), add(w, new_w))


@loop
def gas_kick(grains, seed, number, elapsed, gas):
    """Apply drag and Brownian kicks of `elapsed` seconds to velocity and spin of every grain.

    Random deviates depend on the id of a grain, not on its index, and grains do not interact here: the results have
    the same bits in any order of the grains.

    Parameters
    ----------
    seed : int
        Seed of the run, 0 ≤ seed < 2⁶³.
    number : int
        Number of this kick; equal numbers give equal deviates.
    elapsed : float
        Time [s] ≥ 0.
    gas : GasParameters
        Properties of the gas.

    Returns
    -------
    float
        Kinetic energy [J] transferred from the grains to the gas, laboratory frame; negative if the grains gained.
    """
    transferred = 0.0
    if gas.on:
        for i in range(grains.mass.size):
            transferred += kick_grain(grains, i, seed, number, elapsed, gas)
    return transferred


def shortest_stopping_time(grains, gas):
    """Shortest stopping time [s], m/f_t or I/f_r, of all grains; infinite without gas.  Not compiled.

    Parameters
    ----------
    grains : GrainArrays
        All grains.
    gas : GasParameters
        Properties of the gas.
    """
    numbers = (gas.density, gas.mean_speed, gas.accommodation)
    fastest = max(
        np.max(translation_friction(grains.radius, *numbers) / grains.mass),
        np.max(rotation_friction(grains.radius, *numbers) / grains.inertia),
    )
    return float(1.0 / fastest) if gas.on and fastest > 0.0 else float("inf")
