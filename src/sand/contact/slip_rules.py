"""What the loops over contacts do with a contact beyond a limit: flag it, or let it slip in rolling or in any mode.

Each rule takes and returns the same, for every contact and without branches, so that the loop around it vectorises:
where contacts slip, both cases are computed and selected from at the end.

The energy that slip dissipates depends on the displacements at the start of the step (`mechanics.slip_losses`).  The
rules of slip keep those at the end of a step for the next one, with the number of that step.  Where they are those of
another step, because the contact is new or was only flagged, `kept_loop` computes them from the motion in the step.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

from ..compiler.jit import formula, loop, rare
from ..numerics.quaternion import turned_back
from ..numerics.vec import load, load4, put
from . import tangential
from .constants_table import column_loops
from .damping import load_rows, store_rows
from .law import ContactLaw
from .losses import ROLLING_ROW, add_slip_losses
from .mechanics import (
    Displacements,
    Pose,
    after_rolling,
    after_slip,
    breaks,
    exceeds_limits,
    exceeds_rolling,
    exceeds_sliding_or_twisting,
    roll_loss,
    slip_losses,
)
from .poses import displacements_at_step_start, pose_at
from .transitions import PENDING_FLAG, SLID_FLAG, SLIPPED_FLAG

SLIDE, ROLL, STEP_KEPT = 0, 3, 6
"""First rows of ζ and R (n1 + n2) in `ContactArrays.kept`, and the row of the step at whose start they are valid."""


class Reached(NamedTuple):
    """A contact at the end of a step, before slip."""

    pose: Any  # mechanics.Pose
    displacements: Any  # mechanics.Displacements
    along: Any  # d·n [m] of `tangential.sliding`
    constants: Any  # law.ContactConstants
    valid: bool  # whether the contact radius is


@formula
def next_step(number, dt):
    """What row STEP_KEPT holds for displacements at the end of step `number` of dt [s]; 0, for none, if dt is 0.

    A step of no length, in which loads are summed anew, has the number of the one that follows.
    """
    return float(number + 2) if dt > 0.0 else 0.0


@formula
def select(condition, u, v):
    """Vector u where the condition holds, else v."""
    return u[0] if condition else v[0], u[1] if condition else v[1], u[2] if condition else v[2]


@formula
def slipped_pose(left, pose, constants):
    """Pose after slip, and its d·n [m] of `tangential.sliding`.

    The pointers and the twist represent the displacements that `mechanics.after_slip` leaves.
    """
    d, n = constants.derived, pose.n
    n1, n2, c1, c2 = tangential.pointers_by(
        left.slide, left.roll, n, d.inverse_radius1, d.inverse_radius2, d.inverse_sum
    )
    slipped = Pose(n, pose.distance, pose.inverse_distance, n1, n2, left.twist)
    return slipped, -d.radius1 * c1 - d.radius2 * c2


@loop
def flag_contact(grains, contacts, c, reached, step):
    """Only flag a contact beyond a limit.

    Returns its pose, ζ and d·n [m], the energies [J] dissipated by slip, and its flag.
    """
    exceeded = exceeds_limits(reached.displacements, reached.pose.n, reached.constants) | (not reached.valid)
    sliding = reached.displacements.slide, reached.along
    return reached.pose, sliding, (0.0, 0.0, 0.0), PENDING_FLAG if exceeded else 0


@loop
def roll_contact(grains, contacts, c, reached, step):
    """As `flag_contact`, but let a contact slip that is beyond the limit of rolling alone."""
    pose, displacements, _, constants, valid = reached
    others = breaks(displacements, constants) | exceeds_sliding_or_twisting(displacements, constants) | (not valid)
    slips = exceeds_rolling(displacements, pose.n, constants) & (not others)
    left = after_rolling(displacements, pose.n, constants, step.settings.reset)
    pose, along = _slipped_where(slips, grains, contacts, c, slipped_pose(left, pose, constants), reached)
    roll = tangential.rolling(pose.n1, pose.n2, constants.reduced_radius)
    lost = roll_loss(load_rows(contacts.kept, ROLL, c), displacements.roll, roll, constants)
    lost = lost if slips else 0.0
    contacts.lost[ROLLING_ROW, c] += lost
    _keep(contacts, c, displacements.slide, roll, 0.0 if others else next_step(step.number, step.dt))
    flag = PENDING_FLAG if others else SLIPPED_FLAG if slips else 0
    return pose, (displacements.slide, along), (0.0, lost, 0.0), flag


@loop
def slip_contact(grains, contacts, c, reached, step):
    """As `flag_contact`, but let a contact beyond a limit slip.

    Contacts that break, or whose contact radius is not valid, are only flagged.
    """
    pose, displacements, _, constants, valid = reached
    slides = exceeds_sliding_or_twisting(displacements, constants)
    needs_event = breaks(displacements, constants) | (not valid)
    slips = (slides | exceeds_rolling(displacements, pose.n, constants)) & (not needs_event)
    slide, roll = load_rows(contacts.kept, SLIDE, c), load_rows(contacts.kept, ROLL, c)
    start = Displacements(0.0, slide, roll, contacts.twist[c])
    left = after_slip(displacements, pose.n, constants, step.settings.reset)
    pose, along = _slipped_where(slips, grains, contacts, c, slipped_pose(left, pose, constants), reached)
    slide = select(slips, left.slide, displacements.slide)
    roll = tangential.rolling(pose.n1, pose.n2, constants.reduced_radius)
    left = Displacements(displacements.overlap, slide, roll, pose.twist)
    lost = select(slips, slip_losses(start, displacements, left, constants), (0.0, 0.0, 0.0))
    add_slip_losses(contacts.lost, c, lost)
    _keep(contacts, c, left.slide, left.roll, 0.0 if needs_event else next_step(step.number, step.dt))
    flag = SLID_FLAG if slides else SLIPPED_FLAG
    return pose, (slide, along), lost, PENDING_FLAG if needs_event else flag if slips else 0


@loop
def _slipped_where(slips, grains, contacts, c, left, reached):
    """The pose of contact c, its d·n [m] and its stored pointers: those after slip where it slips."""
    (slipped, along), pose = left, reached.pose
    i, j = contacts.pair[0, c], contacts.pair[1, c]
    body1 = turned_back(load4(grains.orientation, i), slipped.n1)
    body2 = turned_back(load4(grains.orientation, j), slipped.n2)
    put(contacts.pointer1, c, select(slips, body1, load(contacts.pointer1, c)))
    put(contacts.pointer2, c, select(slips, body2, load(contacts.pointer2, c)))
    n1, n2 = select(slips, slipped.n1, pose.n1), select(slips, slipped.n2, pose.n2)
    twist = slipped.twist if slips else pose.twist
    return Pose(pose.n, pose.distance, pose.inverse_distance, n1, n2, twist), along if slips else reached.along


@loop
def _keep(contacts, c, slide, roll, step):
    """Keep displacements ζ and R (n1 + n2) [m] for a step."""
    store_rows(contacts.kept, SLIDE, c, slide)
    store_rows(contacts.kept, ROLL, c, roll)
    contacts.kept[STEP_KEPT, c] = step


@functools.cache
def kept_loop(law: ContactLaw) -> Callable:
    """The loop that completes the kept displacements of a range of contacts, for one contact law."""
    load_constants = column_loops(law).load

    @rare
    def complete(grains, contacts, part, step):
        """Compute displacements at the start of the step that led to the present poses where others are kept."""
        present = next_step(step.number - 1, 1.0)
        for k in range(part.last - part.first):
            c = part.first + k
            if contacts.kept[STEP_KEPT, c] != present:
                constants = load_constants(contacts.constants, part.column + k)
                pose = pose_at(grains, contacts, step.span, c, 0.0)
                start = displacements_at_step_start(grains, contacts, c, pose, contacts.twist[c], constants, step)
                _keep(contacts, c, start.slide, start.roll, present)

    @loop
    def complete_if_needed(grains, contacts, part, step):
        """As `complete`, which is not called where all are kept."""
        present, others = next_step(step.number - 1, 1.0), 0.0
        for k in range(part.last - part.first):
            others += 1.0 if contacts.kept[STEP_KEPT, part.first + k] != present else 0.0
        if others > 0.0:
            complete(grains, contacts, part, step)

    return complete_if_needed
