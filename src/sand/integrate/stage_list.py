"""The program of a simulation: which stages it has, with the parameters of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
from .hooks import Hook, HookStages
from .parts import ContactParameters, StepParameters
from .stages import StageNumber


class ProgramContent(NamedTuple):
    """What the program of a simulation is made of."""

    law: ContactLaw
    pair_forces: Sequence[tuple[LongRangeSums, Any]]  # loops and parameters of each
    external_forces: Sequence[tuple[Callable, Any]]  # formula and parameters of each
    flight: Stage | None  # takes one step while there are no contacts (integrator.Integrator); None: velocity Verlet
    magnetic: bool  # some grain has a moment
    wide: bool  # enough grains for the longest SIMD vectors
    of_components: HookStages
    heavy: np.ndarray  # grains whose mass counts as infinite in contacts

    def for_part(self, grains: int) -> ProgramContent:
        """The same for a part with this number of grains, among them the heavy ones, which have other numbers there.

        Parameters of components that depend on these have a method `for_part`.
        """
        heavy = self.heavy.copy()

        def own(numbers: Any) -> Any:
            return numbers.for_part(heavy, grains) if hasattr(numbers, "for_part") else numbers

        stages = {hook: [(each, own(given)) for each, given in found] for hook, found in self.of_components.items()}
        return self._replace(heavy=heavy, of_components=stages)


def stages_of(given: ProgramContent, parameters: StepParameters) -> dict[int, tuple[Stage | PythonStage, Any]]:
    """The stages that a simulation calls, by number, with their own parameters."""
    respa, work = parameters.respa, parameters.external_work
    found: dict[int, Stage] = {
        StageNumber.DRIFT: stages.drift_stage(given.magnetic, given.wide),
        StageNumber.EXPLAIN: stages.explain_stop,
    }
    if given.pair_forces or given.external_forces or given.of_components.get(Hook.LOADS):
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
    if given.flight is not None:
        found[StageNumber.FLIGHT] = given.flight
    program: dict[int, tuple[Stage | PythonStage, Any]] = {number: (each, ()) for number, each in found.items()}
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
    found: dict[int, Stage] = stages.contact_event_stages(given.law, damping) | {
        StageNumber.PAIR_LIST: stages.pair_list_stage(given.law, parameters.search.celled),
        StageNumber.INNER_LIST: stages.inner_list,
        StageNumber.CONTACT_PASS: stages.contact_pass_stage(given.law, variant, given.wide),
        StageNumber.SORT: resort_contacts_by_grain,
        StageNumber.CONTACT_LIMIT: stages.set_contact_limit,
        StageNumber.REMOVE_BROKEN: stages.remove_broken,
    }
    if not settings.follow:
        del found[StageNumber.STIFFNESS_WORK]
    return found


def hooks_of(given: ProgramContent, parameters: StepParameters) -> HookStages:
    """The stages at each place of a step: those of contacts, then those of components."""
    found: dict[Hook, list[tuple[Any, Any]]] = {}
    if variant_of(parameters.settings) == THERMAL:
        found[Hook.BATH_WORK] = [(stages.bath_work, ())]
    for hook, own in given.of_components.items():
        found.setdefault(hook, []).extend(own)
    return {hook: own for hook, own in found.items() if own}


def build_program(given: ProgramContent, parameters: StepParameters, table: Table) -> Program:
    """The program of a simulation, for the parts in a table; stages are compiled when they are first called."""
    size = StageNumber.FIRST_FORCE + PAIR_STAGES * len(given.pair_forces) + EXTERNAL_STAGES * len(given.external_forces)
    return Program(table, stages_of(given, parameters), size, hooks_of(given, parameters))
