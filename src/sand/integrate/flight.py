"""What an integrator with steps of its own for grains without contacts builds on.

`examples/plugins/forest_ruth.py` is such an integrator: its stage, `Integrator.flight`, calls these functions.
"""

import math

from ..basics.state import CHECKED, CYCLE, FLIGHT, LEFT, OUTSIDE, PHASE, STEP, STEP_INCREASES, STEPS, TIME
from ..compiler.jit import caller, rare
from ..compiler.program import call_stage
from ..neighbours.skin import invalidate_skins, invalidate_speeds, largest_displacement
from ..numerics.vec import put
from .force_calls import add_external_loads, sum_external, sum_pair_forces
from .force_stages import ENERGY, WRAPPING
from .motion import wrap_all
from .parts import Stop
from .respa import add_long_range_loads
from .stages import StageNumber
from .step_control import INCREASE_INTERVAL

STALE_FRACTION = 0.25
"""Largest displacement of a grain since the list was built, at the start of a step, in units of the list's margin."""


@caller
def refresh_verlet_list(s):
    """Rebuild the Verlet list once a quarter of its margin is used up; returns a `Stop`."""
    if not s.search.listed:
        return Stop.NONE.value
    moved = largest_displacement(s.grains, s.long_range.anchor, s.long_range.built, s.span)
    # written so that an anchor at infinity (no list yet) counts as stale
    if not moved <= STALE_FRACTION * s.search.margin:
        return call_stage(s, StageNumber.VERLET_LIST)
    return Stop.NONE.value


@rare
def sum_free_loads(s, time):
    """Sum all loads of grains without contacts at their present positions."""
    for i in range(s.grains.mass.size):
        put(s.grains.force, i, (0.0, 0.0, 0.0))
        put(s.grains.torque, i, (0.0, 0.0, 0.0))
    add_external_loads(s, time)
    if s.forces.pair > 0:
        sum_pair_forces(s)
        add_long_range_loads(s.grains, s.long_range)


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
        s.count[PHASE] = 1
    else:
        s.clock[STEP] = dt
        s.count[STEPS] += 1
