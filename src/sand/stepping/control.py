"""The choice of the step: contact periods while anything touches, magnetic and closing times otherwise."""

import math
from typing import NamedTuple

from ..core.box import nearest_image
from ..core.jit import formula, loop
from ..core.vec import dot, load, sub
from ..core.world import CONTACT_STEP, CONTACTS, GRAIN1, GRAIN2, LEVEL, PAIRS, STEPS
from ..physics.surroundings import stiffness_of_field

CHECK_EVERY = 16
"""Steps between two looks at the physics while contacts set the step."""
GROW_EVERY = 64
"""The step is halved at once but doubled only at multiples of this many steps, so that it does not flap."""
SPIN_ANGLE = 0.05
"""Largest turn of a grain in one step [rad]."""
FIELD_ANGLE = 0.03
"""Largest phase √(μB/I) dt of a moment swinging in its field; Verlet then errs by 4e-5 in its frequency."""
CLOSING_PART = 0.2
"""Largest part of the gap that two grains about to touch may close in one step."""
IMPACT_PART = 25.0
"""Largest way two grains in contact, or about to be, may move past each other in one step, in δ_c / per_period."""
REACH_PART = 1.0 / 16.0
"""Largest part of the list's reach that a grain may fly in one step; keeps `list_is_stale` safe."""


class Control(NamedTuple):
    """What the choice of the step needs to know."""

    fixed: float  # the user's own step [s]; 0: choose
    reach: float  # of the list of near pairs [m]
    energy_scale: float  # what the magnetics may put at stake, |U_min| [J]; 0: no such force
    accuracy: float  # part of it that a step may misplace
    outer_field: float  # size of the external flux density [T]
    longest: float  # for worlds in which nothing happens [s]
    impact: float  # largest way past each other in one step, in δ_c


@formula
def field_step(moment, b, outer, inertia):
    """Longest step [s] for a moment in the field b of the others plus an external one of size `outer`."""
    square = stiffness_of_field(moment, b, inertia) + math.sqrt(dot(moment, moment)) * outer / inertia
    return FIELD_ANGLE / math.sqrt(square) if square > 0.0 else math.inf


@formula
def load_step(force, torque, mass, inertia, control):
    """Longest step [s] for which Verlet's energy error dt²/24 (F²/m + M²/I) stays below its share."""
    rate = dot(force, force) / mass + dot(torque, torque) / inertia
    stake = 24.0 * control.accuracy * control.energy_scale
    return math.sqrt(stake / rate) if rate > 0.0 and stake > 0.0 else math.inf


@loop
def wanted_step(grains, start, near, count, span, control):
    """The longest step [s] that all but the contacts allow, and the grains that want it (GRAIN1, GRAIN2).

    `start` (N + 1,) tells who has contacts (core.world.ContactArrays).

    0 if a speed or spin is not finite.

    Bound grains are left out of the accuracy rule: they ring, and their step is that of contacts.
    """
    wanted = control.longest
    slowest1 = slowest2 = -1
    for i in range(grains.mass.size):
        v, w = load(grains.velocity, i), load(grains.spin, i)
        speed, turning = math.sqrt(dot(v, v)), math.sqrt(dot(w, w))
        if not (speed < math.inf and turning < math.inf):
            count[GRAIN1] = i
            return 0.0
        mine = control.longest
        if speed > 0.0:
            mine = min(mine, REACH_PART * control.reach / speed)
        if turning > 0.0:
            mine = min(mine, SPIN_ANGLE / turning)
        moment, inertia = load(grains.moment, i), grains.inertia[i]
        mine = min(mine, field_step(moment, load(grains.field, i), control.outer_field, inertia))
        if start[i + 1] == start[i]:
            force, torque = load(grains.force, i), load(grains.torque, i)
            mine = min(mine, load_step(force, torque, grains.mass[i], inertia, control))
        if mine < wanted:
            wanted, slowest1, slowest2 = mine, i, -1
    for p in range(count[PAIRS]):
        i, j = near.pair[0, p], near.pair[1, p]
        moving = sub(load(grains.velocity, i), load(grains.velocity, j))
        need = near.step[p]
        speed = math.sqrt(dot(moving, moving))
        fast = near.length[p] > 0.0 and speed * need > control.impact * near.length[p]
        if fast:
            need = control.impact * near.length[p] / speed
        # slow pairs in contact are served by the step of the contacts
        ours = need if fast else math.inf
        if near.touching[p] == 0:
            apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
            distance = math.sqrt(dot(apart, apart))
            closing = -dot(moving, apart) / distance
            gap = distance - grains.radius[i] - grains.radius[j]
            ours = max(need, CLOSING_PART * gap / closing) if closing > 0.0 else math.inf
        if ours < wanted:
            wanted, slowest1, slowest2 = ours, i, j
    count[GRAIN1], count[GRAIN2] = slowest1, slowest2
    return wanted


@loop
def choose_step(grains, start, near, clock, count, span, control):
    """The next step [s], or 0 if there is none: that of the contacts, or less if something else needs less.

    Steps that are not the contacts' are powers of two of a second and change seldom, because every change
    costs velocity Verlet a little energy.
    """
    if count[CONTACTS] == 0 or count[STEPS] % CHECK_EVERY == 0:
        wanted = wanted_step(grains, start, near, count, span, control)
        if not wanted > 0.0:
            return 0.0
        level = clock[LEVEL] if clock[LEVEL] > 0.0 else 1.0
        while level > wanted:
            level *= 0.5
        if count[STEPS] % GROW_EVERY == 0:
            while 2.0 * level <= wanted:
                level *= 2.0
        clock[LEVEL] = level
    if control.fixed > 0.0:
        return control.fixed
    return min(clock[LEVEL], clock[CONTACT_STEP])
