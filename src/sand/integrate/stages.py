"""The stages of a step: parts of velocity Verlet that the driver calls by address, block by block or for all grains.

Their numbers are the entries of the program of a simulation (`stage_list.build_program`).  Some depend on the contact
law and are compiled once for each; those of forces are in `force_stages`.
"""

from enum import IntEnum, auto

import numpy as np

from ..basics.state import CONTACTS, GRAIN1, STEP, STEPS
from ..compiler.recipes import factory
from ..compiler.stage import Stage, stage
from ..contact.bath_work import half_kick_weight, record_half_kicks
from ..contact.events import compact_contacts, forming_loops, slip_and_break_loop
from ..contact.gather import gather
from ..contact.law import ContactLaw
from ..contact.stiffness_work import stiffness_work_loop
from ..contact.update import PassVariant, PresentStep, contact_limit, contact_pass_loop, store_contact_sums
from ..neighbours.cell_list import FULL, build_verlet_list
from ..neighbours.pair_list import ROW_FULL, PairSearch, build_inner_list, pair_list_loop
from ..neighbours.skin import update_safe_speed
from ..numerics.simd import float_from_bits
from .hooks import FIRST_STAGE
from .motion import box_of_drift, drift_for, gather_and_kick
from .parts import DT, Stop
from .step_control import find_limiting_grains, first_not_finite
from .step_parts import first_too_fast
from .task_queue import CONTACTS_PER_BLOCK, GRAINS_PER_BLOCK


class StageNumber(IntEnum):
    """Entries of the program of a simulation (`stage_list.build_program`) after its hooks, and where each stage is."""

    DRIFT = FIRST_STAGE  # motion: drift
    VERLET_LIST = auto()  # neighbours.cell_list
    PAIR_LIST = auto()  # neighbours.pair_list: candidates for contact
    INNER_LIST = auto()  # the nearest candidates
    CONTACT_PASS = auto()  # contact.update: all contacts of a step
    STIFFNESS_WORK = auto()  # contact.stiffness_work
    SLIP_AND_BREAK = auto()  # contact.events: contacts beyond a limit
    FORM = auto()  # contact.events: new contacts
    SORT = auto()  # contact.gather: contacts of each grain
    CONTACT_LIMIT = auto()  # the step that contacts allow
    REMOVE_BROKEN = auto()  # contact.events
    GATHER = auto()  # contact.gather: loads of contacts on grains, if there are other loads
    GATHER_AND_KICK = auto()  # motion.gather_and_kick: the same, and the kick, with loads of contacts alone
    PREPARE_RATES = auto()  # taylor
    STORE_POSITIONS = auto()  # taylor
    EXTRAPOLATE = auto()  # taylor
    FLIGHT = auto()  # of an integrator of the user
    EXPLAIN = auto()  # step_control: which grains caused a stop
    FIRST_FORCE = auto()  # from here on the stages of forces, see `force_stages`, then those of the hooks


NO_STEP = -1
"""In place of a block of `Hook.BATH_WORK`: no step follows, as at a row of the ledger."""
INNER_SKIN_FRACTION = 0.05
"""Displacement, in units of the largest gap of the pair list, after which the inner list of candidates is rebuilt."""


@factory
def drift_stage(magnetic: bool, long_vectors: bool) -> Stage:
    """First half kick and drift of a block of grains; stores the bits of the largest squared speed."""
    drift_some = drift_for(magnetic)

    @stage("the drift of grains", long_vectors=long_vectors)
    def drift(grains, span, external_work, queue, scratch, block):
        first = block * GRAINS_PER_BLOCK
        last = min(first + GRAINS_PER_BLOCK, grains.mass.size)
        # positions are wrapped afterwards where the work of crossing a boundary is logged
        box = box_of_drift(external_work.position_dependent, span)
        v = drift_some(grains, np.uint64(first), np.uint64(last), box, scratch[DT])
        queue.speeds[block, 0] = float_from_bits(v)
        return 0

    return drift


@stage("the Verlet list")
def verlet_list(grains, long_range, count, span, search):
    """Rebuild the Verlet list; returns `Stop.LIST_FULL` if the array is too short."""
    full = build_verlet_list(grains, long_range, count, span, search) == FULL
    return Stop.LIST_FULL.value if full else Stop.NONE.value


@factory
def pair_list_stage(law: ContactLaw, celled: bool) -> Stage:
    """Rebuild the pair list of a contact law, with cells or without; returns a `Stop`."""
    build_pair_list = pair_list_loop(law, celled)

    @stage(
        "the list of contact candidates",
        seconds=1.0,
        parts=("grains", "contacts", "pair_list", "long_range", "count", "span", "settings", "search", "criteria"),
    )
    def pair_list_of_law(s):
        how = PairSearch(s.span, s.criteria.pair_gap, s.settings, s.search)
        found = build_pair_list(s.grains, s.contacts, s.pair_list, s.long_range, s.count, how)
        if found == FULL:
            return Stop.PAIRS_FULL.value
        if found == ROW_FULL:
            return Stop.LIST_FULL.value
        update_safe_speed(s.pair_list, s.count)
        return Stop.NONE.value

    return pair_list_of_law


@stage("the list of pairs that may touch next")
def inner_list(grains, pair_list, count, span, criteria):
    """Select the pairs that may touch next from the pair list."""
    build_inner_list(grains, pair_list, count, span, 2.0 * INNER_SKIN_FRACTION * criteria.pair_gap)
    return 0


@factory
def contact_pass_stage(law: ContactLaw, variant: PassVariant, long_vectors: bool) -> Stage:
    """Update of a block of contacts; stores its sums."""
    contact_pass = contact_pass_loop(law, variant)

    @stage("the contact forces", long_vectors=long_vectors, seconds=3.5)
    def pass_contacts(grains, contacts, clock, count, span, settings, queue, block):
        first = block * CONTACTS_PER_BLOCK
        last = min(first + CONTACTS_PER_BLOCK, count[CONTACTS])
        step = PresentStep(span, settings, count[STEPS], clock[STEP])
        found = contact_pass(grains, contacts, np.uint64(first), np.uint64(last), step)
        store_contact_sums(queue.passed, block, found)
        return 0

    return pass_contacts


@factory
def contact_event_stages(law: ContactLaw, damping: str) -> dict[int, Stage]:
    """Stages of contact events by number: work of stiffnesses, slip and breaking, forming."""
    slip_and_break, form_contacts = slip_and_break_loop(law, damping), forming_loops(law, damping).form
    log_stiffness_work = stiffness_work_loop(law)

    @stage("the work of changing stiffnesses")
    def stiffness_work(grains, contacts, clock, count, lost, span, settings):
        log_stiffness_work(grains, contacts, count, lost, PresentStep(span, settings, count[STEPS], clock[STEP]))
        return 0

    @stage("the slip and breaking of contacts", seconds=2.0)
    def slip_and_break_contacts(grains, contacts, pair_list, clock, count, lost, span, settings):
        """Slip or break flagged contacts; returns 1 if any contact broke."""
        step = PresentStep(span, settings, count[STEPS], clock[STEP])
        return 1 if slip_and_break(grains, contacts, pair_list, count, lost, step) else 0

    @stage("the forming of contacts", seconds=1.5)
    def form(grains, contacts, pair_list, clock, count, lost, span, settings):
        step = PresentStep(span, settings, count[STEPS], clock[STEP])
        form_contacts(grains, contacts, pair_list, count, lost, clock, step)
        return 0

    return {
        StageNumber.STIFFNESS_WORK: stiffness_work,
        StageNumber.SLIP_AND_BREAK: slip_and_break_contacts,
        StageNumber.FORM: form,
    }


@stage("the work of the noise of contacts")
def bath_work(grains, contacts, clock, count, lost, scratch, span, block):
    """Record the work of the half kick that ended the last step, and take back that of the next one."""
    weight = half_kick_weight(clock[STEP], 0.0 if block == NO_STEP else scratch[DT])
    record_half_kicks(grains, contacts, count, lost, span, weight)
    return 0


@stage("the time step of contacts")
def set_contact_limit(grains, contacts, pair_list, clock, count, settings):
    """Set the longest step that contacts allow."""
    contact_limit(contacts, pair_list, count, grains.mass.size, clock, settings.per_period)
    return 0


@stage("the removal of broken contacts")
def remove_broken(contacts, count):
    """Remove broken contacts from the arrays, where they were kept without loads until the end of the step."""
    count[CONTACTS] = compact_contacts(contacts, count[CONTACTS])
    return 0


@factory
def gather_stage(long_vectors: bool) -> Stage:
    """Sums of the contact loads of a block of grains."""

    @stage("the loads of grains", long_vectors=long_vectors)
    def gather_loads(grains, contacts, block):
        first = block * GRAINS_PER_BLOCK
        last = min(first + GRAINS_PER_BLOCK, grains.mass.size)
        gather(grains, contacts, np.uint64(first), np.uint64(last))
        return 0

    return gather_loads


@factory
def gather_and_kick_stage(long_vectors: bool) -> Stage:
    """Sums of the contact loads of a block of grains, and the second half kick; stores the largest speeds."""

    @stage("the loads and kicks of grains", long_vectors=long_vectors)
    def gather_loads_and_kick(grains, contacts, queue, scratch, block):
        first = block * GRAINS_PER_BLOCK
        last = min(first + GRAINS_PER_BLOCK, grains.mass.size)
        v, w = gather_and_kick(grains, contacts, np.uint64(first), np.uint64(last), scratch[DT])
        queue.speeds[block, 0], queue.speeds[block, 1] = float_from_bits(v), float_from_bits(w)
        return 0

    return gather_loads_and_kick


@stage(
    "the cause of a stop",
    parts=("grains", "contacts", "pair_list", "long_range", "count", "span", "criteria", "scratch"),
)
def explain_stop(s, block):
    """Set GRAIN1 and GRAIN2 to the grains that caused a stop, whose number is the block."""
    if block == Stop.NO_STEP.value:
        find_limiting_grains(s.grains, s.long_range, s.contacts.start, s.pair_list, s.count, s.span, s.criteria)
    elif block == Stop.NOT_FINITE.value:
        s.count[GRAIN1] = first_not_finite(s.grains)
    else:
        s.count[GRAIN1] = first_too_fast(s.grains, s.criteria.pair_gap, s.scratch[DT], block)
    return 0
