"""Rigid bodies in a gas: friction of the whole body, and its exact Ornstein–Uhlenbeck step.

Grain i of a body, at sᵢ from the centre of mass, moves at V + Ω×sᵢ in a gas of velocity u.  With the coefficients f_i
of drag and f_r,i of rotational drag of its grains (`forces.gas_drag`), force and torque of the gas on the body are
−Γ w, w = (V − u, Ω) in the frame of the body, where Γ is constant:

    Γ = ( Σ f_i          −Σ f_i [s_i]×                              )
        ( Σ f_i [s_i]×    Σ f_i (s_i² 1 − s_i s_iᵀ) + Σ f_r,i       )

With D = diag(M, M, M, I₁, I₂, I₃) and D^(−1/2) Γ D^(−1/2) = U g Uᵀ, the six modes of friction are e_k = D^(1/2) u_k,
with rates g_k, and the amplitudes c_k = e_k·w are independent: for any time t

    c_k → c_k e^(−g_k t) + √((1 − e^(−2 g_k t)) k_B T) ξ_k,    ΔP, ΔL = Σ_k Δc_k e_k

without other forces, with ξ_k = u_k·ξ.  The six standard normal deviates ξ are along the axes of the laboratory frame,
so that noise depends neither on the choice of modes of equal rates nor on that of equal principal axes.  In equilibrium
the variance of each c_k is k_B T, that of (P − M u, L) is k_B T D, and a body with V = u and Ω = 0 stays so without
noise.  One step of a body in a gas is kick, drift, friction, drift, kick (BAOAB, Leimkuhler & Matthews 2013), with
drifts of half a step.
"""

import math

import numpy as np

from ...basics.state import BODIES, STEPS, SUBSTEPS
from ...compiler.jit import formula, loop
from ...forces.gas_drag import decayed_fraction, rotation_friction, thermal_spread, translation_friction
from ...numerics.quaternion import turned, turned_back
from ...numerics.random import normal_vector
from ...numerics.vec import accrue, add, axpy, dot, load, load4, norm, put, scale, sub
from .rigid_body import move_body, place_grains, takes_one_step

STREAM1, STREAM2 = 32, 33
"""Random-number streams of `numerics.random`, distinct from those of all other uses."""
LARGEST_DEVIATE = 4.0
"""Velocities by noise are taken as large as this many standard deviations to predict a touch."""


def friction_modes(
    radius: np.ndarray, offset: np.ndarray, mass: float, inertia: np.ndarray, gas: tuple[float, float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Rates g_k (6,) [1/s] of the modes of friction of a body, and its modes e_k, columns of (6, 6) [√kg, √kg m].

    Parameters
    ----------
    radius : ndarray
        Radii of its grains (n,) [m].
    offset : ndarray
        Their vectors from the centre of mass (3, n) [m], in the frame of the principal axes.
    mass : float
        Mass of the body [kg].
    inertia : ndarray
        Its principal moments of inertia (3,) [kg m²].
    gas : tuple of float
        Density [kg/m³], mean molecular speed [m/s] and accommodation of the gas.
    """
    friction, spinning = translation_friction(radius, *gas), rotation_friction(radius, *gas)
    x, y, z = (friction * offset).sum(axis=1)
    coupling = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turning = ((friction * offset**2).sum() + spinning.sum()) * np.eye(3) - (friction * offset) @ offset.T
    matrix = np.block([[friction.sum() * np.eye(3), -coupling], [coupling, turning]])
    root = np.sqrt(np.concatenate([np.full(3, mass), inertia]))
    rates, vectors = np.linalg.eigh(matrix / np.outer(root, root))
    return np.maximum(rates, 0.0), root[:, None] * vectors


@formula
def _kick_sphere(grains, bodies, first, seed, number, elapsed, gas):
    """As `kick_body`, of a single grain: changes of P and L."""
    r, m, inertia = grains.radius[first], bodies.mass[first], bodies.inertia[0, first]
    decayed_v = decayed_fraction(translation_friction(r, gas.density, gas.mean_speed, gas.accommodation) / m, elapsed)
    decayed_w = decayed_fraction(
        rotation_friction(r, gas.density, gas.mean_speed, gas.accommodation) / inertia, elapsed
    )
    wind = (gas.wind_x, gas.wind_y, gas.wind_z)
    linear = scale(decayed_v, sub(scale(m, wind), load(bodies.momentum, first)))
    angular = scale(-decayed_w, load(bodies.angular_momentum, first))
    if gas.temperature_energy > 0.0:
        spread_v = m * thermal_spread(decayed_v, gas.temperature_energy, m)
        spread_w = inertia * thermal_spread(decayed_w, gas.temperature_energy, inertia)
        linear = axpy(spread_v, normal_vector(seed, number, grains.id[first], STREAM1), linear)
        angular = axpy(spread_w, normal_vector(seed, number, grains.id[first], STREAM2), angular)
    return linear, angular


@formula
def _kick_cluster(grains, bodies, first, seed, number, elapsed, gas):
    """As `kick_body`, of several grains: changes of P, in the frame of the body, and L."""
    q, own, inertia = (
        load4(bodies.orientation, first),
        load(bodies.angular_momentum, first),
        load(bodies.inertia, first),
    )
    wind = (gas.wind_x, gas.wind_y, gas.wind_z)
    v = turned_back(q, sub(scale(1.0 / bodies.mass[first], load(bodies.momentum, first)), wind))
    w = (own[0] / inertia[0], own[1] / inertia[1], own[2] / inertia[2])
    a = b = (0.0, 0.0, 0.0)
    if gas.temperature_energy > 0.0:
        a = turned_back(q, normal_vector(seed, number, grains.id[first], STREAM1))
        b = turned_back(q, normal_vector(seed, number, grains.id[first], STREAM2))
        a = scale(1.0 / math.sqrt(bodies.mass[first]), a)
        b = (b[0] / math.sqrt(inertia[0]), b[1] / math.sqrt(inertia[1]), b[2] / math.sqrt(inertia[2]))
    linear = angular = (0.0, 0.0, 0.0)
    for k in range(6):
        along = (bodies.mode[6 * k, first], bodies.mode[6 * k + 1, first], bodies.mode[6 * k + 2, first])
        about = (bodies.mode[6 * k + 3, first], bodies.mode[6 * k + 4, first], bodies.mode[6 * k + 5, first])
        decayed = decayed_fraction(bodies.decay[k, first], elapsed)
        change = thermal_spread(decayed, gas.temperature_energy, 1.0) * (dot(along, a) + dot(about, b))
        change -= decayed * (dot(along, v) + dot(about, w))
        linear, angular = axpy(change, along, linear), axpy(change, about, angular)
    return linear, angular


@loop
def kick_body(grains, bodies, b, seed, number, elapsed, gas):
    """Friction and noise of `elapsed` seconds on P and L of body b.

    Parameters
    ----------
    seed : int
        Seed of the run.
    number : int
        Number of the step; with the identity of its first grain it determines the noise of a body.
    elapsed : float
        Time [s].
    gas : GasParameters
        The gas.

    Returns
    -------
    float
        Kinetic energy [J] transferred to the gas, laboratory frame.
    """
    first = bodies.member[bodies.start[b]]
    if bodies.start[b + 1] - bodies.start[b] == 1:
        linear, angular = _kick_sphere(grains, bodies, first, seed, number, elapsed, gas)
    else:
        linear, angular = _kick_cluster(grains, bodies, first, seed, number, elapsed, gas)
        linear = turned(load4(bodies.orientation, first), linear)
    before, own, inertia = (
        load(bodies.momentum, first),
        load(bodies.angular_momentum, first),
        load(bodies.inertia, first),
    )
    accrue(bodies.momentum, first, linear)
    put(bodies.angular_momentum, first, add(own, angular))
    # P² − P'² as a product: accurate where the two are nearly equal
    gained = dot(linear, axpy(2.0, before, linear)) / bodies.mass[first]
    twice = axpy(2.0, own, angular)
    for k in range(3):
        gained += angular[k] * twice[k] / inertia[k]
    return -0.5 * gained


@loop
def drift_bodies_in_gas(grains, bodies, count, span, gas, dt, is_wrapped, piece):
    """Half a drift, friction and noise of dt [s], and half a drift, of the bodies that `rigid_body.drift_bodies` moves.

    Returns
    -------
    float
        Kinetic energy [J] transferred to the gas.
    """
    transferred, number = 0.0, count[STEPS] + count[SUBSTEPS]
    for b in range(count[BODIES]):
        if takes_one_step(bodies, bodies.member[bodies.start[b]]):
            move_body(bodies, b, span, 0.5 * dt, piece)
            transferred += kick_body(grains, bodies, b, gas.seed, number, dt, gas.gas)
            move_body(bodies, b, span, 0.5 * dt, piece)
            place_grains(grains, bodies, b, span, is_wrapped)
    return transferred


@formula
def gas_displacement(grains, bodies, i, rate, gas, h):
    """Bound of the distance [m] that the gas displaces grain i in a step of h [s].

    All rates of friction are at most `rate`, that of the fastest grain.  Friction and noise change velocities in the
    middle of the step, noise by at most `LARGEST_DEVIATE` standard deviations.
    """
    first = bodies.first[i]
    decayed, inertia = decayed_fraction(rate, h), load(bodies.inertia, first)
    s = load(bodies.offset, i)
    smallest = min(inertia[0], min(inertia[1], inertia[2]))
    spread = thermal_spread(decayed, gas.temperature_energy, 1.0) * math.sqrt(
        1.0 / bodies.mass[first] + dot(s, s) / smallest
    )
    apart = norm(sub(load(grains.velocity, i), (gas.wind_x, gas.wind_y, gas.wind_z)))
    return 0.5 * h * (decayed * apart + LARGEST_DEVIATE * spread)
