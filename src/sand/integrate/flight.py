"""What the integrators of grains without contacts share: the end of a step."""

from __future__ import annotations

import math

from ..basics.state import CHECKED, CYCLE, FLIGHT, LEFT, OUTSIDE, STAGE, STEP, STEP_INCREASES, STEPS, TIME
from ..compiler.jit import caller
from ..neighbours.skin import invalidate_skins, invalidate_speeds
from .force_calls import sum_external
from .force_stages import ENERGY, WRAPPING
from .motion import wrap_all
from .step_control import INCREASE_INTERVAL


@caller
def finish_flight_step(s, dt, in_contact, before, work):
    """Advance the time by dt [s], log the work of external forces, wrap positions, count the step.

    `before` is the energy of the time-dependent external forces at the start of the step, `work` what they did on the
    grains in it [J]. A step that ends at a contact (`in_contact`) is counted after the second half of a Verlet step of
    0 s, which forms the contact with new lists, new loads and a new choice of the step.
    """
    invalidate_speeds(s.pair_list)
    invalidate_skins(s.pair_list)
    s.clock[TIME] += dt
    if s.external_work.time_dependent:
        s.lost[OUTSIDE] -= sum_external(s, s.clock[TIME], ENERGY) - before + work
    if s.external_work.position_dependent:
        s.lost[OUTSIDE] -= sum_external(s, s.clock[TIME], WRAPPING)
    wrap_all(s.grains, s.span)
    s.clock[STEP] = s.clock[CYCLE] = s.clock[LEFT] = 0.0
    if in_contact:
        s.pair_list.anchor[0, 0] = math.inf
        s.clock[FLIGHT] = 0.0
        s.count[CHECKED] = s.count[STEP_INCREASES] = s.count[STEPS] - INCREASE_INTERVAL
        s.count[STAGE] = 1
    else:
        s.clock[STEP] = dt
        s.count[STEPS] += 1
