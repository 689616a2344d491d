"""The program of a simulation: which stages it has, with the parameters of each."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ..compiler.program import Program
from ..compiler.stage import PythonStage, Stage
from ..compiler.table import Table
from ..contact.damping import DASHPOTS, NONE, THERMAL
from ..contact.gather import resort_contacts_by_grain
from ..contact.law import ContactLaw, Pairing
from ..contact.update import PassVariant
from ..forces.pair.long_range_loops import LongRangeSums
from . import stages, taylor
from .force_stages import (
    EXTERNAL_STAGES,
    IN_CONTACT,
    LOADS,
    PAIR_STAGES,
    RATES,
    REASSIGN,
    ROUND,
    SUM,
    WORK,
    external_force_stages,
    pair_force_stages,
)
from .parts import ContactParameters, StepParameters
from .stages import StageNumber

NO_GRAINS = np.zeros(0, np.int64)


class ProgramContent(NamedTuple):
    """What the program of a simulation is made of."""

    law: ContactLaw
    pair_forces: Sequence[tuple[LongRangeSums, Any]]  # loops and parameters of each
    external_forces: Sequence[tuple[Callable, Any]]  # formula and parameters of each
    flight: Stage | None  # takes one step while there are no contacts (integrator.Integrator); None: velocity Verlet
    gas: bool  # drag and Brownian kicks
    magnetic: bool  # some grain has a moment
    wide: bool  # enough grains for the longest SIMD vectors
    of_components: Mapping[int, tuple[Stage, Any]] = MappingProxyType(
        {}
    )  # stages of components by number, with parameters
    heavy: np.ndarray = NO_GRAINS  # grains whose mass counts as infinite in contacts


def stages_of(given: ProgramContent, parameters: StepParameters) -> dict[int, tuple[Stage | PythonStage, Any]]:
    """The stages that a simulation calls, by number, with their own parameters."""
    respa, work = parameters.respa, parameters.external_work
    found: dict[int, Stage] = {
        StageNumber.DRIFT: stages.drift_stage(given.magnetic, given.wide),
        StageNumber.EXPLAIN: stages.explain_stop,
    }
    if given.pair_forces or given.external_forces or StageNumber.COMPONENT_LOADS in given.of_components:
        found[StageNumber.GATHER] = stages.gather_stage(given.wide)
    else:
        found[StageNumber.GATHER_AND_KICK] = stages.gather_and_kick_stage(given.wide)
    if parameters.search.listed:
        found[StageNumber.VERLET_LIST] = stages.verlet_list
    if parameters.settings.on:
        found |= _contact_stages(given, parameters)
    if respa.taylor:
        found[StageNumber.PREPARE_RATES] = taylor.prepare_rates
        found[StageNumber.STORE_POSITIONS] = taylor.store_summation_positions
        found[StageNumber.EXTRAPOLATE] = taylor.extrapolate
    if given.gas:
        found[StageNumber.GAS_KICK] = stages.kick_by_gas
    if given.flight is not None:
        found[StageNumber.FLIGHT] = given.flight
    program: dict[int, tuple[Stage | PythonStage, Any]] = {number: (each, ()) for number, each in found.items()}
    program |= given.of_components
    number: int = StageNumber.FIRST_FORCE
    needed = {SUM, *((IN_CONTACT, REASSIGN) if respa.impulse else ()), *((RATES,) if respa.taylor else ())}
    for sums, own in given.pair_forces:
        own_stages = pair_force_stages(sums, given.wide)
        rounds = range(ROUND, ROUND + len(sums.rounds))
        program |= {number + k: (own_stages[k], own) for k in (*needed, *rounds)}
        number += PAIR_STAGES
    needed = {LOADS, *((WORK,) if work.time_dependent or work.position_dependent else ())}
    for formula, own in given.external_forces:
        of_force = external_force_stages(formula)
        program |= {number + k: (of_force[k], own) for k in needed}
        number += EXTERNAL_STAGES
    return program


def variant_of(settings: ContactParameters) -> str:
    """Variant of the contact update: undamped, damped, or damped with thermal noise."""
    if not settings.damped:
        return NONE
    return THERMAL if settings.bath > 0.0 else DASHPOTS


def _contact_stages(given: ProgramContent, parameters: StepParameters) -> dict[int, Stage]:
    """The stages of contacts by number."""
    settings, damping = parameters.settings, variant_of(parameters.settings)
    adhesive = bool((settings.pairings[Pairing._fields.index("surface_energy")] > 0.0).all())
    variant = PassVariant(damping, any(parameters.span), settings.follow, adhesive)
    events = stages.contact_event_stages(given.law, damping)
    found: dict[int, Stage] = {
        StageNumber.PAIR_LIST: stages.pair_list_stage(given.law, parameters.search.celled),
        StageNumber.INNER_LIST: stages.inner_list,
        StageNumber.CONTACT_PASS: stages.contact_pass_stage(given.law, variant, given.wide),
        StageNumber.SLIP_AND_BREAK: events[StageNumber.SLIP_AND_BREAK],
        StageNumber.FORM: events[StageNumber.FORM],
        StageNumber.SORT: resort_contacts_by_grain,
        StageNumber.CONTACT_STEP: stages.set_contact_step,
        StageNumber.REMOVE_BROKEN: stages.remove_broken,
    }
    if damping == THERMAL:
        found[StageNumber.BATH_WORK] = stages.bath_work
    if settings.follow:
        found[StageNumber.STIFFNESS_WORK] = events[StageNumber.STIFFNESS_WORK]
    if settings.settling_time < math.inf:
        found[StageNumber.SETTLE_CLUSTERS] = stages.settle
    return found


def build_program(given: ProgramContent, parameters: StepParameters, table: Table) -> Program:
    """The program of a simulation, for the parts in a table; stages are compiled when they are first called."""
    size = StageNumber.FIRST_FORCE + PAIR_STAGES * len(given.pair_forces) + EXTERNAL_STAGES * len(given.external_forces)
    return Program(table, stages_of(given, parameters), size)
