"""The work of stiffnesses that follow the contact radius."""

import functools
from collections.abc import Callable

from ..basics.state import CONTACTS
from ..compiler.jit import rare
from .constants_table import column_loops
from .law import ContactLaw
from .losses import record_stiffness_loss
from .mechanics import displacements_of, scaled_stiffness, stiffness_loss
from .poses import displacements_before, pose_at


@functools.cache
def stiffness_work_loop(law: ContactLaw) -> Callable:
    """The loop that logs the work of changing stiffnesses, for one contact law."""
    constants_at, radius_root = column_loops(law).at, law.radius_root

    @rare
    def log_stiffness_work(grains, contacts, count, lost, step):
        """Log the energy that stiffnesses following a(δ) removed from the springs of all contacts in this step.

        `step` is an `update.PresentStep`.
        """
        for c in range(count[CONTACTS]):
            constants = constants_at(contacts, c)
            pose = pose_at(grains, contacts, step.span, c, contacts.twist[c])
            r1, r2 = grains.radius[contacts.pair[0, c]], grains.radius[contacts.pair[1, c]]
            start = displacements_before(grains, contacts, c, pose, constants, step)
            displacements = displacements_of(pose, r1 + r2 - pose.distance, r1, r2, constants)
            at_start = scaled_stiffness(constants, radius_root(start.overlap, constants), True)
            now = scaled_stiffness(constants, radius_root(displacements.overlap, constants), True)
            record_stiffness_loss(contacts, lost, c, stiffness_loss(start, displacements, at_start, now))

    return log_stiffness_work
