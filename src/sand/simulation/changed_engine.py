"""A change of a simulation by the user, and the engine after it."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..basics.arrays import SAVED_LONG_RANGE
from ..basics.box import Box
from ..basics.errors import BadInput, ErrorCollector
from ..basics.grains import Grains
from ..basics.state import (
    BROKEN,
    CHECKED,
    COMPARED,
    CONTACTS,
    FLIGHT,
    FORMING,
    MADE,
    NEEDED,
    OUTSIDE,
    STEP_INCREASES,
    STEPS,
    TIME,
    State,
    grains_from_arrays,
)
from ..components import components_of
from ..components.deformation import DeformedBox
from ..engine.assemble import build_engine, fitting_forces
from ..engine.changed_state import regrouped_arrays
from ..engine.component import Component, in_use
from ..engine.engine import Engine
from ..engine.measures import force_columns
from ..forces.base import Force, LongRangeForce
from ..integrate.step_control import INCREASE_INTERVAL
from ..limits.truncation import truncation_warnings
from .change import Change
from .stress import check_stress_rows


def changed(simulation: Any) -> Iterator[Change]:
    """The change that the user makes, see `Simulation.change`, and its effect on the simulation after that."""
    system = simulation._system
    present = tuple(as_chosen(force, simulation.start, system.box) for force in simulation.forces)
    pair = simulation.state.contacts.pair[:, : simulation.state.count[CONTACTS]].T.copy()
    change = Change(simulation.grains, present, simulation.box, pair, system.next_id, simulation.deformation)
    yield change
    given = system.given
    if change.deformation is not simulation.deformation:
        given = given | {DeformedBox.name: DeformedBox((change.deformation,))}
    if change.is_of_own:
        own = change.checked_grains().arrays.own
        for grains in (simulation._engine.state.grains, simulation.regular_state.grains, simulation.start):
            grains.arrays.own[...] = own
        if simulation.writer:
            simulation.writer.changed(simulation)
        return
    fixed = int(simulation.seed or 0), given
    engine, forces, given = changed_engine(change, present, simulation._engine, simulation.ledger.columns, *fixed)
    if simulation.ledger.stress:
        check_stress_rows(engine)
    before = simulation._log_row()["total"]
    simulation._engine = engine
    start, box, next_id = simulation.grains.copy(), change.box, change._next_id
    simulation._system = replace(system, start=start, forces=forces, box=box, given=given, next_id=next_id)
    for text in truncation_warnings(simulation.grains, forces, box):
        simulation._warnings.show(text, text.partition(",")[0])
    simulation._origin.choices = {}  # chosen anew
    if change.regroups:  # the description of the grains in a case file no longer holds
        simulation.recipe = None
    engine.regular_state.lost[OUTSIDE] += before - simulation._log_row()["total"]
    if simulation.writer:
        simulation.writer.changed(simulation)


def as_chosen(force: Force, grains: Grains, box: Box) -> Force:
    """The force with its automatic cut-off as a number, if it was chosen once for these grains at the start.

    A run that is resumed has this number, too, so that a change has the same result in it.
    """
    if not isinstance(force, LongRangeForce) or getattr(force, "cutoff", None) != "auto":
        return force
    radius = force.resolved(grains, box).get("cutoff")
    if radius == "auto":
        return force
    chosen = copy.copy(force)
    object.__setattr__(chosen, "cutoff", None if radius == "none" else radius)
    return chosen


def changed_engine(
    change: Change,
    present: Sequence[Force],
    engine: Engine,
    columns: Sequence[str],
    seed: int,
    given: Mapping[str, Component],
) -> tuple[Engine, tuple[Force, ...], dict[str, Component]]:
    """The engine after a change, its forces and components; the engine before stays as it is.

    Parameters
    ----------
    present : Sequence[Force]
        The forces before.
    engine : Engine
        The engine before.
    columns : Sequence[str]
        Columns of the ledger, which are those of the start.
    given : Mapping[str, Component]
        The components before that the user gave.

    Raises
    ------
    BadInput
        If something does not fit; all problems at once, as far as each can be found without the others.
    """
    errors, state = ErrorCollector(), engine.state
    given = {name: each.kept(change.kept) for name, each in given.items()}
    forces = errors.take(change.checked_forces, present)
    grains = errors.take(change.checked_grains)
    if forces is not None and grains is not None:
        errors.take(change.refuse_overlaps, grains, forces)
    if grains is not None:
        for each in in_use(given):
            errors.problems += each.problems_of_motion(grains)
    errors.done()
    regroups = change.regroups
    arrays = {f"grains/{name}": array for name, array in grains.arrays._asdict().items()}
    same = grains_from_arrays(arrays, [grains.materials[k] for k in grains.material], grains.own_units)
    forces = fitting_forces(forces, engine.stepping)
    extra = components_of(given, forces, same, change.box)
    saved = {name: array for each in extra for name, array in each.saved_for_change(state, change.box).items()}
    parts = (same, forces, change.box, engine.stepping, engine.neighbours, seed, extra)
    new = build_engine(*parts, fresh=False, saved=saved)
    without = [name for name in force_columns(new) if name not in columns]
    if without:
        raise BadInput(
            f"forces: the ledger of this run has no column for {', '.join(without)}; give the force at the start, such "
            "as with a strength of 0, and change it then"
        )
    for each in in_use(given):
        if lacking := [name for name in each.columns() if name not in columns]:
            raise BadInput(
                f"{each.name}: the ledger of this run has no column for {', '.join(lacking)}; give it at the start, "
                "such as shear = 0, and change it then"
            )
    grains.arrays.material[...] = same.arrays.material  # materials are numbered anew
    # shapes of long-range arrays change if a force begins or ceases to act
    shapes = [[getattr(each.long_range, name).shape for name in SAVED_LONG_RANGE] for each in (state, new.state)]
    rebuilt = regroups or shapes[0] != shapes[1]
    if rebuilt or change.box != state.box:
        for each in extra:
            errors.problems += each.problems_of_arrays()
        errors.done()
    if rebuilt:
        arrays = regrouped_arrays(state, change.kept, grains, new.state)
    else:
        arrays = {name: array.copy() for name, array in state.to_arrays().items()}
        arrays |= {f"grains/{name}": array for name, array in grains.arrays._asdict().items()}
    count, clock = arrays["count"], arrays["clock"]
    for each in extra:
        each.changed(arrays, regroups=regroups)
    # the next step is chosen anew, as after a start
    count[CHECKED] = count[STEP_INCREASES] = count[NEEDED] = count[STEPS] - INCREASE_INTERVAL
    clock[FLIGHT] = 0.0
    for each in extra:
        if each.last_action is not None and each.name not in {own.name for own in engine.components}:
            clock[each.last_action] = clock[TIME]
    new.load_state(arrays)
    new.refresh_loads()
    if regroups:
        _as_initial(new.regular_state, int(arrays["count"][MADE]), float(arrays["lost"][FORMING]))
    return new, forces, given


def _as_initial(state: State, made: int, lost: float) -> None:
    """Contacts that the change formed are initial ones: they are not counted as formed, and nothing is lost by them."""
    formed = int(state.count[MADE]) - made
    if formed == 0:
        return
    used = int(state.count[CONTACTS])
    state.contacts.lost[:, used - formed : used] = 0.0
    state.lost[FORMING], state.count[MADE] = lost, made
    if state.count[COMPARED] >= 0:
        state.count[COMPARED] = made + state.count[BROKEN]
