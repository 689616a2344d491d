"""Assembly of the engine: forces, box and settings become the content of a program, step parameters and state."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, cast

import numpy as np

from ..basics.arrays import OVER_ALLOCATION
from ..basics.box import Box
from ..basics.errors import ErrorCollector
from ..basics.grains import Grains
from ..basics.initial_pairs import StrainedContacts
from ..basics.state import COMPARED
from ..contact.model import Contact
from ..forces.base import Force
from ..forces.pair.ewald_force import EwaldForce
from ..integrate.hooks import Hook
from ..integrate.integrator import Integrator
from ..integrate.parts import ForceNumbers, StepParameters
from ..integrate.stage_list import ProgramContent
from ..limits.solid_limits import torn_clusters
from ..neighbours.search import Neighbours
from .component import Component, Setup
from .engine import Engine
from .initial_contacts import NO_OVERLAPS, add_contacts, overlapping_pairs, refuse_overlaps, with_contacts
from .input_checks import check_system, problems_of_tilt
from .kinds import Kind
from .new_state import new_state
from .rigid.assembly import BodiesKind
from .step_parameters import (
    external_work,
    force_dependent,
    forces_by_type,
    longest_displacement,
    respa_settings,
    step_criteria,
)

KINDS: dict[str, type[Kind]] = {each.integrator: each for each in (BodiesKind,)}
"""Kinds of engines that are not those of grains, by the name of their integrator."""
WIDE_FROM = 64
"""Fewest grains for the widest SIMD vectors; with fewer, most lanes of the last vector would be idle."""
SORTED = "; arrays sorted along a space-filling curve"


def build_engine(
    grains: Grains,
    forces: Sequence[Force],
    box: Box,
    stepping: Integrator,
    neighbours: Neighbours,
    seed: int = 0,
    extra: Sequence[Component] = (),
    *,
    fresh: bool = True,
    contacts: StrainedContacts | None = None,
    saved: Mapping[str, np.ndarray] = MappingProxyType({}),
) -> Engine:
    """Check that grains, forces, box and settings fit together, and build the engine.

    Parameters
    ----------
    seed : int, optional
        Seed of the random kicks of gas and bath.
    extra : Sequence[Component], optional
        Components, those of the forces included.
    fresh : bool, optional
        Whether this is a new start, whose overlaps are checked; a resumed run may be in the middle of an impact.
    contacts : StrainedContacts or None, optional
        Contacts present from the start, with their displacements.
    saved : mapping of str to ndarray, optional
        Arrays of the checkpoint from which the run continues.

    Raises
    ------
    BadInput
        If something does not fit; all problems at once.
    """
    holding, verlet, errors = [each for each in extra if each.holds], stepping.contact_stepping, ErrorCollector()
    kind = KINDS.get(stepping.name, Kind)(holds=bool(holding))
    by_type = forces_by_type(forces, grains)
    setup = Setup(grains, by_type, box, stepping, neighbours, fresh, saved, extra)
    warnings = errors.take(check_system, grains, forces, box, fresh=fresh, instead=[])
    warnings += errors.take(kind.check, forces, neighbours, instead=[])
    errors.problems += [line for each in extra for line in each.problems(setup)]
    if box.tilt and not any(each.moves_box for each in extra):
        errors.problems += problems_of_tilt(by_type, stepping)
    errors.done()
    wrapped = _wrapped(grains, box, fresh=fresh)
    for each in extra:
        each.prepare(wrapped)
    if kind.keeps_order or any(each.keeps_order for each in extra):
        neighbours = dataclasses.replace(neighbours, order="as given")
    overlapping = overlapping_pairs(wrapped, box) if by_type.contact and fresh else NO_OVERLAPS
    touching = with_contacts(overlapping.pair, contacts, len(grains))
    warnings += torn_clusters(wrapped, by_type.contact, touching, box)
    setup = setup._replace(touching=touching)
    for each in extra:
        by_type = each.at_start(by_type, setup)
    pair_gap, flights = kind.pair_gap(grains, box), stepping.flight is not None
    cutoffs = [force.choose(grains, box).radius for force in by_type.long_range]
    found = neighbours.choose(grains, box, pair_gap, [r for r in cutoffs if r is not None], long_steps=flights)
    listed = [found.search.listed and r is not None for r in cutoffs]
    loops = [f.sums(box, own, grains) for f, own in zip(by_type.long_range, listed, strict=True)]
    long_range = [(f, own, f.numbers(grains, box)) for f, own in zip(by_type.long_range, loops, strict=True)]
    uniform = not any(each.own_columns for each in extra)
    stepping = stepping.resolved(grains, step_criteria(grains, verlet, kind.limiting_forces(by_type), pair_gap))
    limits = stepping.flight_limits(grains, longest_displacement(grains, box, found))
    dependent = functools.partial(
        force_dependent, kind=kind, verlet=verlet, seed=seed, pair_gap=pair_gap, uniform=uniform, limits=limits
    )
    parameters = StepParameters(
        span=next((each.span(box) for each in extra if each.moves_box), box.span),
        search=found.search,
        respa=respa_settings(by_type, verlet, long_range, every_step=any(each.every_step for each in extra)),
        external_work=external_work(by_type.external, box),
        forces=ForceNumbers(len(long_range), len(by_type.external)),
        **dependent(forces, grains)._asdict(),
    )
    law = (by_type.contact or Contact()).contact_law
    of_components: dict[Hook, list[tuple[Any, Any]]] = {}
    for each in extra:
        for hook, stages in each.stages(setup, law, parameters.settings).items():
            of_components.setdefault(hook, []).extend(stages)
    content = ProgramContent(
        law=law,
        pair_forces=[own[1:] for own in long_range],
        external_forces=[(force.formula, force.numbers()) for force in by_type.external],
        flight=stepping.flight,
        magnetic=bool(grains.body_moment.any()),
        wide=len(grains) >= WIDE_FROM,
        of_components=of_components,
        heavy=np.array([i for each in extra for i in each.heavy()], np.int64),
    )
    all_pairs = any(not own and not sums.own_memory for own, sums in zip(listed, loops, strict=True))
    state = new_state(wrapped, box, parameters, content, int(OVER_ALLOCATION * len(touching)), over_all_pairs=all_pairs)
    state.count[COMPARED] = 0 if any(each.watches_contacts for each in extra) else -1
    for each in extra:
        each.add_arrays(state, law, parameters.settings)
    chosen = neighbours.settled(found.search, len(grains)) if fresh else neighbours
    engine = Engine(
        state,
        parameters,
        content,
        warnings=warnings,
        external=by_type.external,
        long_range=long_range,
        search=found.reason + (SORTED if chosen.uses_spatial_sort(len(grains)) else ""),
        stepping=stepping,
        neighbours=chosen,
        force_dependent=dependent,
        components=extra,
    )

    def build(others: Sequence[Force], search: Neighbours) -> Engine:
        own = [each for each in extra if each.in_parts]
        # held loads are the loads of all pairs less the sum of the part, from which impulses leave out pairs in contact
        steps = dataclasses.replace(verlet, far="every step") if holding else verlet
        return build_engine(wrapped, others, box, steps, search, seed, own, fresh=False)

    kind.complete(engine, forces, build)
    for each in extra:
        each.begin(engine)
    refuse_overlaps(wrapped, by_type.contact, overlapping, add_contacts(engine, by_type.contact, contacts))
    return engine


def _wrapped(grains: Grains, box: Box, *, fresh: bool) -> Grains:
    """A copy of the grains within the box; those of a new start may have been numbered in, and crossed, another box."""
    wrapped = grains.copy()
    wrapped.arrays.position[...] = box.wrap(grains.position).T
    if fresh:
        wrapped.arrays.id[...] = np.arange(len(grains))
        wrapped.arrays.image[...] = 0
    return wrapped


def fitting_forces(forces: tuple[Force, ...], stepping: Integrator) -> tuple[Force, ...]:
    """The forces, with nearest images where "auto" would choose an Ewald sum whose rates a Taylor scheme needs."""

    def fitted(force: Any) -> Force:
        auto = isinstance(force, EwaldForce) and force.periodic == "auto"
        return cast("Force", dataclasses.replace(force, periodic="nearest image") if auto else force)

    taylor = stepping.contact_stepping.far.startswith("taylor")
    return tuple(map(fitted, forces)) if taylor and any(isinstance(force, Contact) for force in forces) else forces
