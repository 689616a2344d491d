"""Energies, displacements and loads of contacts, measured between steps for the energy table and for output."""

import math

from ..basics.state import CONTACTS
from ..compiler.jit import loop
from ..compiler.recipes import factory
from ..compiler.stage import Stage, stage
from ..numerics.flow import with_flow
from ..numerics.vec import across, add, cross, dot, load, norm, scale, sub
from .constants_table import column_loops
from .damping import loads_on_grains, measured_load
from .law import ContactLaw
from .mechanics import contact_load, displacements_of, energies, scaled_stiffness
from .poses import pose_at
from .settling import list_cluster, rigid_motion

ENERGIES = ("normal", "sliding", "rolling", "twisting")
"""Energies [J] of contacts that `measure_energies` computes."""


@factory
def energies_stage(law: ContactLaw) -> Stage:
    """The stage that measures energies, for one contact law."""
    constants_at, radius_root, normal_energy = column_loops(law).at, law.radius_root, law.energy

    @stage("the energies of contacts")
    def measure_energies(grains, contacts, count, span, settings, parameters):
        """Fill the array parameters[0] with the energies [J] listed in ENERGIES."""
        out = parameters[0]
        for mode in range(4):
            out[mode] = 0.0
        for c in range(count[CONTACTS]):
            i, j = contacts.pair[0, c], contacts.pair[1, c]
            r1, r2 = grains.radius[i], grains.radius[j]
            pose = pose_at(grains, contacts, span, c, contacts.twist[c])
            overlap, constants = r1 + r2 - pose.distance, constants_at(contacts, c)
            y = radius_root(overlap, constants)
            normal = normal_energy(overlap, y, constants)
            stored = energies(pose, normal, r1, r2, scaled_stiffness(constants, y, settings.follow))
            for mode in range(4):
                out[mode] += stored[mode]
        return 0

    return measure_energies


BODY_ROWS = 5
"""Rows of `measure_bodies`: the fields of `analysis.body_motion.BodyMotion`."""


@stage("the motion of bodies")
def measure_bodies(grains, contacts, span, parameters):
    """Fill the array parameters[0] (BODY_ROWS, N) with the motion of each body, in the order of their lowest grains.

    `analysis.body_motion` has the equations. parameters[1] is memory for one cluster. Returns the number of bodies.
    """
    out, clusters = parameters
    bodies = 0
    clusters.listed[:] = 0
    for first in range(grains.mass.size):
        if clusters.listed[first]:
            continue
        size, mass, rotation, internal = 1, grains.mass[first], 0.0, 0.0
        v, w = load(grains.velocity, first), load(grains.spin, first)
        if contacts.start[first + 1] > contacts.start[first]:
            size, mass = list_cluster(grains, contacts, clusters, span, first, math.inf), 0.0
            v, w = rigid_motion(grains, clusters, size, span)
        else:
            rotation = 0.5 * grains.inertia[first] * dot(w, w)
        for k in range(size if size > 1 else 0):
            i = clusters.member[k]
            mass += grains.mass[i]
            turning = cross(w, load(clusters.offset, i))
            rotation += 0.5 * (grains.mass[i] * dot(turning, turning) + grains.inertia[i] * dot(w, w))
            # velocities relative to the rigid motion, so that no energies of almost equal size are subtracted
            own_v = sub(with_flow(sub(load(grains.velocity, i), v), load(clusters.offset, i), span), turning)
            own_w = sub(load(grains.spin, i), w)
            internal += 0.5 * (grains.mass[i] * dot(own_v, own_v) + grains.inertia[i] * dot(own_w, own_w))
        out[0, bodies], out[1, bodies], out[2, bodies] = size, mass, 0.5 * mass * dot(v, v)
        out[3, bodies], out[4, bodies] = rotation, internal
        bodies += 1
    return bodies


CONTACT_ROWS = (
    ("overlap", "m", "overlap δ, positive in compression"),
    ("contact_radius", "m", "radius a of the contact"),
    ("slide", "m", "size of the sliding displacement ζ"),
    ("roll", "m", "size of the rolling displacement ξ"),
    ("twist", "rad", "twisting angle φ"),
    (
        "stretch_share",
        "1",
        "−δ/δ_c, how far the surfaces are apart over the distance at which the contact breaks: 1 where it breaks, "
        "negative if they overlap, −1.21 in a JKR contact without load; −δ/R if it breaks at δ = 0",
    ),
    ("slide_share", "1", "|ζ|/ζ_c: sliding displacement over its limit, 1 where the contact slips"),
    ("roll_share", "1", "|ξ|/ξ_c: rolling displacement over its limit, 1 where the contact slips"),
    ("twist_share", "1", "|φ|/φ_c: twisting angle over its limit, 1 where the contact slips"),
    ("normal_force", "N", "normal force, push positive, damping included"),
    ("slide_force", "N", "size of the sliding force"),
    ("roll_torque", "N m", "size of the rolling torque"),
    ("twist_torque", "N m", "twisting torque −k_t φ on grain 1 along n"),
    ("energy_normal", "J", "stored by the normal mode"),
    ("energy_sliding", "J", "stored by the sliding spring"),
    ("energy_rolling", "J", "stored by the rolling spring"),
    ("energy_twisting", "J", "stored by the twisting spring"),
)
"""Scalars that `measure_contacts` computes for each contact: name, unit, meaning."""
CONTACT_VECTORS = (
    ("slide_vector", "m", "sliding displacement ζ"),
    ("roll_vector", "m", "rolling displacement ξ"),
)
CONTACT_LOADS = ("force", "torque1", "torque2")
"""Rows of `measure_contacts` after the scalars: CONTACT_VECTORS, then the loads including damping, three rows each."""


@loop
def put_row(out, c, moved, roll, stored, forces, constants):
    """Fill column c with CONTACT_ROWS and CONTACT_VECTORS, of contacts of grains and with walls.

    `moved` is a `Displacements`, `roll` its ξ [m], `stored` are the energies [J], `forces` the contact radius [m] and
    the normal force [N], that of dashpots included.
    """
    slide, size = norm(moved.slide), norm(roll)
    longest = constants.break_overlap if constants.break_overlap > 0.0 else constants.reduced_radius
    out[0, c], out[1, c] = moved.overlap, forces[0]
    out[2, c], out[3, c], out[4, c] = slide, size, moved.twist
    out[5, c] = -moved.overlap / longest
    out[6, c] = slide / constants.slide_limit if constants.slide_limit > 0.0 else 0.0
    out[7, c] = size / constants.roll_limit
    out[8, c] = abs(moved.twist) / constants.twist_limit
    out[9, c] = forces[1]
    out[10, c] = constants.slide_stiffness * slide
    out[11, c] = constants.reduced_radius * constants.roll_stiffness * size
    out[12, c] = -constants.twist_stiffness * moved.twist
    for mode in range(4):
        out[13 + mode, c] = stored[mode]
    for axis in range(3):
        out[17 + axis, c], out[20 + axis, c] = moved.slide[axis], roll[axis]


@factory
def contacts_stage(law: ContactLaw) -> Stage:
    """The stage that measures contacts, for one contact law."""
    constants_at, radius_root, contact_radius = column_loops(law).at, law.radius_root, law.contact_radius
    normal_force, normal_energy = law.force, law.energy

    @stage("the table of contacts", seconds=1.5)
    def measure_contacts(grains, contacts, count, span, settings, parameters):
        """Fill `parameters[0]` (rows, C) with the quantities of CONTACT_ROWS, CONTACT_VECTORS and CONTACT_LOADS."""
        out, follow = parameters[0], settings.follow
        for c in range(count[CONTACTS]):
            i, j = contacts.pair[0, c], contacts.pair[1, c]
            r1, r2 = grains.radius[i], grains.radius[j]
            pose = pose_at(grains, contacts, span, c, contacts.twist[c])
            overlap, frozen = r1 + r2 - pose.distance, constants_at(contacts, c)
            y = radius_root(overlap, frozen)
            constants = scaled_stiffness(frozen, y, follow)
            displacements = displacements_of(pose, overlap, r1, r2, constants)
            xi = across(displacements.roll, pose.n)
            stored = energies(pose, normal_energy(overlap, y, constants), r1, r2, constants)
            normal = normal_force(overlap, y, constants)
            damping = measured_load(contacts, c)
            forces = contact_radius(overlap, y, constants), normal + dot(damping.force, pose.n)
            put_row(out, c, displacements, xi, stored, forces, constants)
            force, torque1, torque2 = contact_load(pose, normal, r1, r2, constants)
            more, more1, more2 = loads_on_grains(damping, scale(pose.distance, pose.n), r1 / (r1 + r2))
            force, torque1, torque2 = add(force, more), add(torque1, more1), add(torque2, more2)
            for axis in range(3):
                out[23 + axis, c], out[26 + axis, c], out[29 + axis, c] = force[axis], torque1[axis], torque2[axis]
        return 0

    return measure_contacts
