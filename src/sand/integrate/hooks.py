"""Places of a step at which components act: each hook is a list of stages, which the driver calls one after another.

The driver calls nothing else of components (`components`), and knows none.  An empty list costs one comparison.
"""

from collections.abc import Mapping
from enum import IntEnum
from typing import Any

from ..compiler.jit import caller, rare
from ..compiler.program import call_stage, has_stage, range_of
from .parts import Stop


class Hook(IntEnum):
    """Places of a step, in the order in which a step comes to them; first entries of the program of a simulation.

    Stages of LIMIT_STEP and CONTACTS return the value of a `Stop`; any other than NONE ends the list, and the driver
    returns.  One of CONTACTS that stops because an array is full has changed nothing, and is called again in the same
    step; only one component has such contacts.  The stages of other hooks return 0.
    """

    LIMIT_STEP = 0  # lower scratch[LIMIT], the longest next step, or stop the run; everything is at the time TIME
    BEFORE_DRIFT = 1  # half a kick and the drift follow; the length of the step is scratch[DT]
    BATH_WORK = 2  # Δt has changed: the work of noise in half kicks; a step of scratch[DT] follows, or `stages.NO_STEP`
    AFTER_DRIFT = 3  # positions are those of the end of the step; contacts, lists and loads are older
    BEFORE_CONTACTS = 4  # lists are up to date; contacts slip, break and form next
    CONTACTS = 5  # update contacts other than those between two grains
    AFTER_CONTACTS = 6  # contacts are those of the end of the step; loads are summed next
    LOADS = 7  # add to the loads of grains, which have those of contacts; external and long-range ones follow
    BEFORE_KICK = 8  # the second half kick follows, in one loop with the loads if contacts are the only ones
    AFTER_KICK = 9  # velocities, positions and loads are those of the end of the step; its length is scratch[DT]
    END_STEP = 10  # the step is counted: TIME and STEPS are those of its end
    BETWEEN_CYCLES = 11  # after END_STEP, but not within a cycle of r-RESPA: change velocities
    AFTER_CHANGES = 12  # all stages of BETWEEN_CYCLES have changed velocities
    NEAR_BODIES = 13  # of a step of bodies of clock[STEP]: mark those that may touch what is no body, such as a wall
    NONE_AWAKE = 14  # bodies have moved by clock[STEP], and no cluster takes contact steps in which other things move
    END_OF_BODIES = 15  # called by the engine: awake clusters end a step of bodies; act for all time since the last
    ENERGIES = 16  # not called by the driver: add energies to an array, for a row of the ledger
    BEFORE_BODIES = 17  # as BEFORE_DRIFT, of bodies
    AFTER_BODIES = 18  # bodies are where they are at the end of the step; grains of awake clusters are not
    KICKED_BODIES = 19  # momenta of bodies, and loads, are those of the end of the step; velocities of grains follow


HookStages = Mapping[Hook, list[tuple[Any, Any]]]
"""Stages with their own parameters, by the place at which they are called."""
FIRST_STAGE = len(Hook)
"""Entry of the program that follows those of the hooks."""


@rare
def call_stages(s, hook, block):
    """Call the stages of a hook until one returns another value of `Stop` than NONE; returns the last value."""
    first, end = range_of(s, hook)
    for number in range(first, end):
        stop = call_stage(s, number, block)
        if stop != Stop.NONE.value:
            return stop
    return Stop.NONE.value


@caller
def call_hook(s, hook):
    """Call the stages of a hook, if it has any, with the hook as their block; returns the value of a `Stop`."""
    return call_stages(s, hook, hook) if has_stage(s, hook) else Stop.NONE.value
