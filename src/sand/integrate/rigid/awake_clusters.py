"""Clusters of rigid-body runs that are awake: rigid kicks by other bodies, and what tells whether they are at rest."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...basics.constants import MAGNETIC
from ...basics.state import CONTACTS, TIME
from ...compiler.jit import formula
from ...compiler.recipes import factory
from ...compiler.stage import Stage, stage
from ...contact.constants_table import column_loops
from ...contact.law import ContactLaw
from ...contact.mechanics import displacements_of
from ...contact.poses import pose_at
from ...contact.settling import list_cluster, rigid_motion, solve_symmetric, with_grain
from ...forces.pair.dipole_formulas import pair_load
from ...numerics.flow import with_flow
from ...numerics.quaternion import turned_back
from ...numerics.vec import accrue, across, add, cross, dot, load, load4, nearest_image, norm, put, put4, scale, sub
from ..parts import DT
from ..respa import add_long_range_loads
from .body_touches import CLEAR
from .rigid_body import store_loads

PERIODS = 10.0
"""Time for which the vibration of a cluster must have been low, in longest periods of its contacts; for clusters of n
more than ten grains n²/10 of these, about half the period of the slowest bending of a straight chain."""


class ClusterMeasures(NamedTuple):
    """What is measured of awake clusters, all float64; columns of a cluster are those of its first grain."""

    grain: np.ndarray  # (n,) index of each grain among all grains
    limits: np.ndarray  # (2,) ε of `vibration_at_rest`, and k_B T of the gas [J]
    first: np.ndarray  # (n,) first grain of the cluster of each grain
    vibrated: np.ndarray  # (n,) 1 for grains that vibrated too much to come to rest, since it was set to 0
    slipped: np.ndarray  # (n,) 1 for grains with contacts that slipped in this step of bodies
    rests: np.ndarray  # (n,) 1 for first grains of clusters that may come to rest
    size: np.ndarray  # (n,) number of grains
    vibration: np.ndarray  # (n,) kinetic energy besides that of the rigid motion [J]
    limit: np.ndarray  # (n,) smallest ½ k q_c² of any contact [J]
    strain: np.ndarray  # (n,) largest displacement, in units of its limit
    period: np.ndarray  # (n,) longest period of sliding, rolling or twisting of a contact [s]
    strength: np.ndarray  # (2, n) smallest force [N] and torque [N m] at which a contact slips or breaks


def cluster_measures(grains: int) -> ClusterMeasures:
    """Allocate the measures of clusters of a number of grains."""
    shapes = {"strength": (2, grains), "limits": 2}
    return ClusterMeasures(*(np.zeros(shapes.get(name, grains)) for name in ClusterMeasures._fields))


@stage("the kicks of awake clusters")
def kick_clusters(grains, contacts, clusters, long_range, span, scratch, parameters, block):
    """Kick each cluster as a rigid body by loads on its grains (`GrainLoads`) for scratch[DT] seconds.

    Block 1: by these loads less those that the grains have on each other, which are subtracted.

    The velocities change by ΔV + ΔΩ×s with M ΔV = F dt and J ΔΩ = T dt, so that P and L are those of the loads and no
    contact vibrates by the kick.
    """
    dt = scratch[DT]
    if block == 1:
        for i in range(grains.mass.size):
            put(parameters.force, i, sub(load(parameters.force, i), load(long_range.force, i)))
            put(parameters.torque, i, sub(load(parameters.torque, i), load(long_range.torque, i)))
    clusters.listed[:] = 0
    for first in range(grains.mass.size):
        if clusters.listed[first] == 1:
            continue
        size = list_cluster(grains, contacts, clusters, span, first, math.inf)
        rigid_motion(grains, clusters, size, span)
        mass, force, torque = 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        tensor = (0.0,) * 6
        for k in range(size):
            i = clusters.member[k]
            m, inertia, s = grains.mass[i], grains.inertia[i], load(clusters.offset, i)
            mass += m
            f = load(parameters.force, i)
            force = add(force, f)
            torque = add(torque, add(load(parameters.torque, i), cross(s, f)))
            tensor = with_grain(tensor, m, inertia, s)
        velocity = scale(dt / mass, force)
        rotation = solve_symmetric(tensor, scale(dt, torque))
        for k in range(size):
            i = clusters.member[k]
            accrue(grains.velocity, i, add(velocity, cross(rotation, load(clusters.offset, i))))
            accrue(grains.spin, i, rotation)
    return 0


class GrainLoads(NamedTuple):
    """Loads on grains."""

    force: np.ndarray  # (3, n) [N]
    torque: np.ndarray  # (3, n) [N m]

    def for_part(self, heavy: np.ndarray, grains: int) -> GrainLoads:
        """Memory for another number of grains."""
        return no_loads(grains)


def no_loads(grains: int) -> GrainLoads:
    """Loads of 0 on a number of grains."""
    return GrainLoads(np.zeros((3, grains)), np.zeros((3, grains)))


@stage("the held loads on awake clusters")
def add_held_loads(grains, parameters):
    """Add `GrainLoads` that are constant during a step of bodies to the loads of the grains."""
    add_long_range_loads(grains, parameters)
    return 0


@formula
def vibration_at_rest(limits, size, limit):
    """Vibrational energy [J] below which a cluster of `size` grains may come to rest; `limit` is its ½ k q_c².

    In a thermal gas this is at least 3 (n − 1) k_B T, the mean kinetic energy of the 6 n − 6 modes of a cluster in
    equilibrium with the gas, but no more than ½ k q_c², with which one contact would slip. Dashpots without noise
    keep the modes colder: measured in chains of two and eight 10 nm iron grains that were kept awake, ζ = 0.2, were
    0.07 and 0.7 k_B T with a stopping time of 20 ns, 0.3 and 3.6 k_B T (at most 1.3 and 10) with 1 ns. So chains
    come to rest as fast as without gas, and few would in a dense or hot gas with ε ½ k q_c² alone.
    """
    return max(limits[0] * limit, min(3.0 * (size - 1.0) * limits[1], limit))


@factory
def measure_clusters_stage(law: ContactLaw) -> Stage:
    """The stage that fills `ClusterMeasures`, its parameters, and `clusters.offset`, from the centres of mass."""
    constants_at, at_break = column_loops(law).at, law.at_break

    @stage("the vibrations of awake clusters", seconds=1.0)
    def measure_clusters(grains, contacts, clusters, count, span, parameters):
        clusters.listed[:] = 0
        for first in range(grains.mass.size):
            if clusters.listed[first] == 1:
                continue
            size = list_cluster(grains, contacts, clusters, span, first, math.inf)
            velocity, rotation = rigid_motion(grains, clusters, size, span)
            energy = 0.0
            for k in range(size):
                i = clusters.member[k]
                parameters.first[i] = first
                s = load(clusters.offset, i)
                v = sub(with_flow(sub(load(grains.velocity, i), velocity), s, span), cross(rotation, s))
                w = sub(load(grains.spin, i), rotation)
                energy += 0.5 * (grains.mass[i] * dot(v, v) + grains.inertia[i] * dot(w, w))
            parameters.size[first], parameters.vibration[first] = size, energy
            parameters.limit[first] = math.inf
            parameters.strain[first] = parameters.period[first] = 0.0
            parameters.strength[0, first] = parameters.strength[1, first] = math.inf
        for c in range(count[CONTACTS]):
            i, j = contacts.pair[0, c], contacts.pair[1, c]
            own_cluster = np.int64(parameters.first[i])
            r1, r2 = grains.radius[i], grains.radius[j]
            pose, own = pose_at(grains, contacts, span, c, contacts.twist[c]), constants_at(contacts, c)
            moved = displacements_of(pose, r1 + r2 - pose.distance, r1, r2, own)
            inverse_mass = 1.0 / grains.mass[i] + 1.0 / grains.mass[j]
            inverse_inertia = 1.0 / grains.inertia[i] + 1.0 / grains.inertia[j]
            roll_stiffness = own.roll_stiffness * own.reduced_radius * own.reduced_radius
            slide, twist = 3.5 * own.slide_stiffness * inverse_mass, own.twist_stiffness * inverse_inertia
            slowest = min(slide, min(roll_stiffness * inverse_inertia, twist))
            period = 2.0 * math.pi / math.sqrt(slowest) if slowest > 0.0 else math.inf
            energy = min(
                own.slide_stiffness * own.slide_limit * own.slide_limit,
                min(
                    own.roll_stiffness * own.roll_limit * own.roll_limit,
                    own.twist_stiffness * own.twist_limit * own.twist_limit,
                ),
            )
            share = max(
                norm(moved.slide) / own.slide_limit,
                max(norm(across(moved.roll, pose.n)) / own.roll_limit, abs(moved.twist) / own.twist_limit),
            )
            force = min(abs(at_break(own)[1]), own.slide_stiffness * own.slide_limit)
            torque = own.reduced_radius * own.roll_stiffness * own.roll_limit
            torque = min(torque, own.twist_stiffness * own.twist_limit)
            parameters.period[own_cluster] = max(parameters.period[own_cluster], period)
            parameters.limit[own_cluster] = min(parameters.limit[own_cluster], 0.5 * energy)
            parameters.strain[own_cluster] = max(parameters.strain[own_cluster], share)
            parameters.strength[0, own_cluster] = min(parameters.strength[0, own_cluster], force)
            parameters.strength[1, own_cluster] = min(parameters.strength[1, own_cluster], torque)
        for i in range(grains.mass.size):
            c = int(parameters.first[i])
            if parameters.vibration[c] > vibration_at_rest(parameters.limits, parameters.size[c], parameters.limit[c]):
                parameters.vibrated[i] = 1.0
        return 0

    return measure_clusters


@stage("the motion of awake clusters")
def place_awake_grains(grains, bodies, parameters):
    """Give grains the motion that they have in their part, in which their velocities and spins are `parameters`.

    Vectors, the third of these, are those from the centres of mass now, as of grains of bodies that are not turned; the
    last are the grains.
    """
    velocity, spin, offset, grain = parameters
    for k in range(grain.size):
        i = int(grain[k])
        put(grains.velocity, i, load(velocity, k))
        put(grains.spin, i, load(spin, k))
        put(bodies.offset, i, load(offset, k))
        put4(bodies.orientation, i, (0.0, 0.0, 0.0, 1.0))
        put(bodies.inner_field, i, (0.0, 0.0, 0.0))
    return 0


@stage("the search for clusters that come to rest")
def find_resting_clusters(bodies, clock, parameters):
    """Note which clusters vibrated or slipped, and mark those that may come to rest (`ClusterMeasures`).

    Returns
    -------
    int
        Number of clusters that may.
    """
    found, time = 0, clock[TIME]
    for k in range(parameters.grain.size):
        c = int(parameters.first[k])
        first = int(parameters.grain[c])
        if parameters.size[c] > 1.0:
            if parameters.slipped[k] == 1.0:
                bodies.event[first] = time
            if parameters.vibrated[k] == 1.0:
                bodies.vibration[first] = time
    for k in range(parameters.grain.size):
        parameters.rests[k] = 0.0
        first, size = int(parameters.grain[k]), parameters.size[k]
        if parameters.first[k] == k and bodies.near[first] == CLEAR:
            wait = parameters.period[k] * max(PERIODS, size * size / 10.0)
            if size == 1.0 or time - max(bodies.vibration[first], bodies.event[first]) > wait:
                parameters.rests[k] = 1.0
                found += 1
    return found


@stage("the loads on a body")
def store_known_loads(grains, bodies, block):
    """Store the present loads on the grains of body `block`, less their inertia, as the ones that are known."""
    store_loads(grains, bodies, block)
    return 0


@stage("the fields between grains of a body")
def store_rest(grains, bodies, span, block):
    """Store loads and fields of body `block` as it comes to rest: what its contacts carry, and what its grains feel.

    `inner_field` becomes the flux density of the other grains of the body, in the frame of the body.
    """
    first = bodies.member[bodies.start[block]]
    q = load4(bodies.orientation, first)
    store_loads(grains, bodies, block)
    for k in range(bodies.start[block], bodies.start[block + 1]):
        i, field = bodies.member[k], (0.0, 0.0, 0.0)
        put(bodies.rest_force, i, load(bodies.known_force, i))
        put(bodies.rest_torque, i, load(bodies.known_torque, i))
        for m in range(bodies.start[block], bodies.start[block + 1]):
            j = bodies.member[m]
            if i != j:
                apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
                field = add(field, pair_load(apart, load(grains.moment, i), load(grains.moment, j), MAGNETIC)[1])
        put(bodies.inner_field, i, turned_back(q, field))
    return 0
