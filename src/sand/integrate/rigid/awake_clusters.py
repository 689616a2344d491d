"""Clusters of rigid-body runs that are awake: rigid kicks by other bodies, and what tells whether they are at rest."""

import math
from typing import NamedTuple, Self

import numpy as np

from ...basics.constants import MAGNETIC
from ...basics.state import CONTACTS
from ...compiler.recipes import factory
from ...compiler.stage import Stage, stage
from ...contact.constants_table import column_loops
from ...contact.law import ContactLaw
from ...contact.mechanics import displacements_of
from ...contact.poses import pose_at
from ...contact.settling import list_cluster, rigid_motion, solve_symmetric, with_grain
from ...forces.pair.dipole_formulas import pair_load
from ...numerics.quaternion import turned_back
from ...numerics.vec import accrue, across, add, cross, dot, load, load4, nearest_image, norm, put, scale, sub
from ..parts import DT
from ..respa import add_long_range_loads
from .rigid_body import store_loads


class ClusterMeasures(NamedTuple):
    """What `measure_clusters` finds; columns of a cluster are those of its first grain."""

    first: np.ndarray  # (n,) float64: first grain of the cluster of each grain
    size: np.ndarray  # (n,) number of grains
    vibration: np.ndarray  # (n,) kinetic energy besides that of the rigid motion [J]
    limit: np.ndarray  # (n,) smallest ½ k q_c² of any contact [J]
    strain: np.ndarray  # (n,) largest displacement, in units of its limit
    period: np.ndarray  # (n,) longest period of sliding, rolling or twisting of a contact [s]
    strength: np.ndarray  # (2, n) smallest force [N] and torque [N m] at which a contact slips or breaks


def cluster_measures(grains: int) -> ClusterMeasures:
    """Allocate the results for a number of grains."""
    return ClusterMeasures(
        *(np.zeros((2, grains) if name == "strength" else grains) for name in ClusterMeasures._fields)
    )


@stage("the kicks of awake clusters")
def kick_clusters(grains, contacts, clusters, span, scratch, parameters):
    """Kick each cluster as a rigid body by the loads `parameters` (2, 3, n) on its grains for scratch[DT] seconds.

    The velocities change by ΔV + ΔΩ×s with M ΔV = F dt and J ΔΩ = T dt, so that P and L are those of the loads and no
    contact vibrates by the kick.
    """
    loads, dt = parameters[0], scratch[DT]
    clusters.listed[:] = 0
    for first in range(grains.mass.size):
        if clusters.listed[first] == 1:
            continue
        size = list_cluster(grains, contacts, clusters, span, first, math.inf)
        rigid_motion(grains, clusters, size)
        mass, force, torque = 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        tensor = (0.0,) * 6
        for k in range(size):
            i = clusters.member[k]
            m, inertia, s = grains.mass[i], grains.inertia[i], load(clusters.offset, i)
            mass += m
            f = (loads[0, 0, i], loads[0, 1, i], loads[0, 2, i])
            force = add(force, f)
            torque = add(torque, add((loads[1, 0, i], loads[1, 1, i], loads[1, 2, i]), cross(s, f)))
            tensor = with_grain(tensor, m, inertia, s)
        velocity = scale(dt / mass, force)
        rotation = solve_symmetric(tensor, scale(dt, torque))
        for k in range(size):
            i = clusters.member[k]
            accrue(grains.velocity, i, add(velocity, cross(rotation, load(clusters.offset, i))))
            accrue(grains.spin, i, rotation)
    return 0


class HeldLoads(NamedTuple):
    """Loads on grains that are constant during a step of bodies."""

    force: np.ndarray  # (3, n) [N]
    torque: np.ndarray  # (3, n) [N m]

    def for_part(self, heavy: np.ndarray, grains: int) -> Self:
        """Memory for another number of grains."""
        return self._replace(force=np.zeros((3, grains)), torque=np.zeros((3, grains)))


@stage("the held loads on awake clusters")
def add_held_loads(grains, parameters):
    """Add `HeldLoads` to the loads of the grains."""
    add_long_range_loads(grains, parameters)
    return 0


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
            velocity, rotation = rigid_motion(grains, clusters, size)
            energy = 0.0
            for k in range(size):
                i = clusters.member[k]
                parameters.first[i] = first
                s = load(clusters.offset, i)
                v = sub(sub(load(grains.velocity, i), velocity), cross(rotation, s))
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
        return 0

    return measure_clusters


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
