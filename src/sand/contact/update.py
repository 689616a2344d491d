"""Contact forces, first pass: a vectorised loop over contacts that writes forces and torques per contact.

Contacts are updated in two passes.  The pass over contacts (here and in `slip`) computes pose, displacements, force and
torques of each contact from its two grains and stores them per contact; no two iterations write to the same memory, so
the loop vectorises.  The gather pass over grains (`gather`) then sums the stored forces and torques of the contacts of
each grain in a fixed order.  Contacts beyond a limit are flagged and handled one by one in `events`.
"""

import math

import numpy as np

from ..box import nearest_image
from ..compiler.jit import COMPILED, loop, rare
from ..numerics.quaternion import turned
from ..numerics.simd import round_up_to_simd_width
from ..numerics.vec import across, dot, load, load4, put, scale, sub
from ..state.state import CONTACT_STEP, CONTACTS
from . import jkr, tangential
from .law import ContactConstants, Pose, contact_load, displacements_of, exceeds_limits, scaled_stiffness
from .pair_types import pair_type_count

MIN_REMAINDER = 4
"""Remaining contacts from which a padded SIMD vector is faster than a scalar loop."""
PENDING_FLAG, BROKEN_FLAG, SLIPPED_FLAG = 1, 2, 3
"""Flags of contacts beyond a limit: to be handled by `events.update_flagged_contacts`; broken in this step; slipped in
this step in the pass over contacts.
"""


@loop
def uniform_contacts(contacts):
    """Whether one set of constants serves all contacts.

    Uniform constants are stored as BLOCK identical columns, individual ones as one column per allocated contact.
    If BLOCK contacts are allocated the two cannot be distinguished; the answer False is then also correct.
    """
    return contacts.constants.shape[1] != contacts.flag.size


@loop
def constants_at(contacts, c):
    """Constants of contact c."""
    return load_constants(contacts.constants, 0 if uniform_contacts(contacts) else c)


@loop
def stored_damping_force(contacts, c):
    """Damping force [N] stored for contact c, on grain 1 along n; 0 without damping."""
    return contacts.damped[c] if contacts.damped.size > 0 else 0.0


@loop
def load_constants(b, c):
    """Constants in column c of a (K, …) array."""
    return ContactConstants(
        b[0, c],
        b[1, c],
        b[2, c],
        b[3, c],
        b[4, c],
        b[5, c],
        b[6, c],
        b[7, c],
        b[8, c],
        b[9, c],
        b[10, c],
        b[11, c],
        b[12, c],
        b[13, c],
        b[14, c],
    )


@loop
def pose_at(grains, contacts, span, c, twist):
    """Relative pose of the grains of contact c now, with the given twist φ [rad]."""
    i, j = contacts.pair[0, c], contacts.pair[1, c]
    separation = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    distance = math.sqrt(dot(separation, separation))
    return Pose(
        scale(1.0 / distance, separation),
        distance,
        turned(load4(grains.orientation, i), load(contacts.pointer1, c)),
        turned(load4(grains.orientation, j), load(contacts.pointer2, c)),
        twist,
    )


@loop
def twist_increment(grains, contacts, c, pose, dt):
    """Increase of the twist [rad] in the step that led to this pose, from mid-step velocities and spins."""
    i, j = contacts.pair[0, c], contacts.pair[1, c]
    transverse = across(sub(load(grains.velocity, i), load(grains.velocity, j)), pose.n)
    rate = tangential.twisting_rate(pose.n, load(grains.spin, i), load(grains.spin, j), transverse, pose.distance, dt)
    return dt * rate


@loop
def pose_at_step_end(grains, contacts, span, c, dt):
    """Relative pose at the end of a step of dt [s], with the twist accumulated in the step."""
    pose = pose_at(grains, contacts, span, c, 0.0)
    twist = contacts.twist[c] + twist_increment(grains, contacts, c, pose, dt)
    return Pose(pose.n, pose.distance, pose.n1, pose.n2, twist)


@loop
def contact_loop(grains, contacts, first, last, used, column, span, law, dt):
    """Update twist, loads and flag of the contacts first … last − 1.  Contacts beyond a limit are only flagged.

    The loop has no branches, so that it vectorises.

    Parameters
    ----------
    grains, contacts : GrainArrays, ContactArrays
        Arrays of grains and contacts.
    first, last : uint64
        Range of contacts.
    used : uint64
        Number of contacts in use.  Columns beyond it may be computed as padding; they are never read.
    column : uint64
        Column of the constants of the first contact; those of the others follow.
    span : Span
        The box.
    law : ContactParameters
        Settings of the contact law.
    dt : float
        Time step [s].

    Returns
    -------
    float
        Number of contacts in use that are beyond a limit.
    """
    pending = 0.0
    for k in range(last - first):
        c = first + k
        i, j = contacts.pair[0, c], contacts.pair[1, c]
        constants = load_constants(contacts.constants, column + k)
        r1, r2 = grains.radius[i], grains.radius[j]
        pose = pose_at_step_end(grains, contacts, span, c, dt)
        overlap = r1 + r2 - pose.distance
        s = jkr.stretch(overlap, constants.pull_off_overlap)
        y = jkr.polynomial_root(s)
        constants_now = scaled_stiffness(constants, y, law.follow)
        force, torque1, torque2 = contact_load(pose, overlap, y, r1, r2, constants_now)
        displacements = displacements_of(pose, overlap, r1, r2, constants)
        exceeded = exceeds_limits(displacements, pose.n, constants) | (s > jkr.POLYNOMIAL_RANGE)
        contacts.twist[c] = pose.twist
        put(contacts.force, c, force)
        put(contacts.torque1, c, torque1)
        put(contacts.torque2, c, torque2)
        contacts.flag[c] = PENDING_FLAG if exceeded else 0
        pending += 1.0 if exceeded & (c < used) else 0.0
    return pending


@loop
def padded_contact_count(contacts, number):
    """Number of columns (uint64) to compute for `number` contacts: padded to whole SIMD vectors where faster.

    Padding columns are computed and never read.
    """
    padded = round_up_to_simd_width(number, np.uint64(MIN_REMAINDER))
    return padded if COMPILED and padded <= np.uint64(contacts.pair.shape[1]) else number


@rare
def write_loads(grains, contacts, span, law, c):
    """Compute the loads of one contact from its stored pointers and twist, at any compression."""
    i, j = contacts.pair[0, c], contacts.pair[1, c]
    r1, r2 = grains.radius[i], grains.radius[j]
    constants = constants_at(contacts, c)
    pose = pose_at(grains, contacts, span, c, contacts.twist[c])
    overlap = r1 + r2 - pose.distance
    y = jkr.root(jkr.stretch(overlap, constants.pull_off_overlap))
    constants_now = scaled_stiffness(constants, y, law.follow)
    force, torque1, torque2 = contact_load(pose, overlap, y, r1, r2, constants_now)
    put(contacts.force, c, force)
    put(contacts.torque1, c, torque1)
    put(contacts.torque2, c, torque2)


@rare
def contact_step(contacts, pair_list, count, n, clock, per_period):
    """Set the longest step [s] allowed by contacts: shortest period / per_period, times √(6/z) for z > 6 contacts.

    Contact candidates are included, so that the step is short enough before two small grains touch.  The step is
    infinite without contacts: then the closing speeds of pairs are examined in every step.
    """
    squared_frequency, most_contacts = 0.0, 0
    for c in range(count[CONTACTS]):
        squared_frequency = max(squared_frequency, constants_at(contacts, c).max_squared_frequency)
    for g in range(n):
        most_contacts = max(most_contacts, int(contacts.start[g + 1]) - int(contacts.start[g]))
    coordination = max(1.0, most_contacts / 6.0)
    clock[CONTACT_STEP] = math.inf
    if squared_frequency > 0.0:
        clock[CONTACT_STEP] = 2.0 * math.pi / math.sqrt(squared_frequency * coordination) / per_period
        for k in range(pair_type_count(pair_list, count)):
            clock[CONTACT_STEP] = min(clock[CONTACT_STEP], pair_list.step[k])
        # 24 significant bits, so that sums of steps are exact and r-RESPA cycles conserve momenta to rounding
        clock[CONTACT_STEP] = np.float64(np.float32(clock[CONTACT_STEP]))
