"""Assembly of the engine: forces, box and settings become the content of a program, step parameters and state."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence
from typing import Any, cast

import numpy as np

from ..basics.arrays import OVER_ALLOCATION
from ..basics.box import Box
from ..basics.constants import BOLTZMANN
from ..basics.errors import BadInput
from ..basics.grains import Grains
from ..basics.initial_pairs import StrainedContacts
from ..basics.material import SILICA
from ..basics.ramps import ramps_of
from ..basics.state import COMPARED, CUT_RADIUS
from ..contact.model import Contact
from ..forces.base import ExternalForce, Force, LongRangeForce
from ..forces.gas import Gas
from ..forces.gas_loops import VACUUM
from ..forces.pair.ewald_force import EwaldForce
from ..forces.pair.long_range_loops import LongRangeSums
from ..integrate.integrator import Integrator
from ..integrate.parts import (
    ContactParameters,
    ExternalWork,
    ForceNumbers,
    GasSettings,
    RespaSettings,
    StepParameters,
)
from ..integrate.stage_list import ProgramContent
from ..integrate.step_control import IMPACT_DISPLACEMENT, StepCriteria
from ..integrate.verlet import Verlet
from ..limits.solid_limits import torn_clusters
from ..neighbours.search import ChosenSearch, Neighbours
from .cluster_cutoff import follow_clusters
from .component import Component, Setup, check
from .engine import Engine
from .initial_contacts import NO_OVERLAPS, add_contacts, overlapping_pairs, refuse_overlaps
from .input_checks import check_system
from .kinds import ForcesByType, Kind
from .new_state import new_state
from .ramped import RampedForces
from .rigid.assembly import BodiesKind

KINDS: dict[str, type[Kind]] = {each.integrator: each for each in (BodiesKind,)}
"""Kinds of engines that are not those of grains, by the name of their integrator."""
WIDE_FROM = 64
"""Fewest grains for the widest SIMD vectors; with fewer, most lanes of the last vector would be idle."""
IDLE = 1e5
"""Longest step in sound-crossing times of a grain, where nothing else limits the step."""
GAS_PERIOD_FRACTION = 0.05
"""Time between two gas kicks, in shortest stopping times.

Kicks are applied at ends of steps or cycles, at intervals h of 2/3 to 4/3 of it; free grains then diffuse too fast by
h²/12τ², at most 4e-4.
"""


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
    cutoff: np.ndarray | None = None,
) -> Engine:
    """Check that grains, forces, box and settings fit together, and build the engine.

    Parameters
    ----------
    seed : int, optional
        Seed of the random kicks of gas and bath.
    extra : Sequence[Component], optional
        Components, such as walls.
    fresh : bool, optional
        Whether this is a new start, whose overlaps are checked; a resumed run may be in the middle of an impact.
    contacts : StrainedContacts or None, optional
        Contacts present from the start, with their displacements.
    cutoff : ndarray or None, optional
        `State.cutoff` of the checkpoint from which the run continues.

    Raises
    ------
    BadInput
        If something does not fit; all problems at once.
    """
    kind, nouns = KINDS.get(stepping.name, Kind)(), [each.noun for each in extra]
    warnings = check_system(grains, forces, box, fresh=fresh) + kind.check(forces, nouns, neighbours)
    by_type = _forces_by_type(forces, grains)
    setup = Setup(grains, by_type, box, stepping, neighbours, fresh)
    check(extra, setup)
    pair_gap = kind.pair_gap(grains, box)
    wrapped = grains.copy()
    wrapped.arrays.position[...] = box.wrap(grains.position).T
    if fresh:  # grains of another simulation may have other identities, and have crossed its box
        wrapped.arrays.id[...] = np.arange(len(grains))
        wrapped.arrays.image[...] = 0
    for each in extra:
        each.prepare(wrapped)
    if kind.keeps_order or any(each.keeps_order for each in extra):
        neighbours = dataclasses.replace(neighbours, order="as given")
    start = overlapping_pairs(wrapped, box) if by_type.contact is not None and fresh else NO_OVERLAPS
    if by_type.contact is not None and fresh:
        touching = start.pair
        if contacts is not None:
            given = np.asarray(contacts.pair, dtype=touching.dtype).reshape(-1, 2)
            touching = np.unique(np.sort(np.concatenate([touching, given]), axis=1), axis=0)
        warnings += torn_clusters(wrapped, by_type.contact, touching, box)
    follower = follow_clusters(by_type.long_range, grains, box, start.pair, contacts, cutoff)
    cutoffs = [f.choose(grains, box).radius for f in by_type.long_range]
    if follower is not None:
        cutoffs[follower.index] = float(follower.values[CUT_RADIUS])
    flights = stepping.flight is not None
    found = neighbours.choose(grains, box, pair_gap, [r for r in cutoffs if r is not None], long_steps=flights)
    listed = [found.search.listed and r is not None for r in cutoffs]
    long_range = _long_range_loops(by_type, grains, box, listed)
    if follower is not None:
        force, sums, _ = long_range[follower.index]
        long_range[follower.index] = force, sums, follower.force.numbers_at(cutoffs[follower.index])
    verlet, uniform = stepping.contact_stepping, not any(each.own_columns for each in extra)
    control = _step_control(grains, verlet, kind.limiting_forces(by_type), pair_gap)
    stepping = stepping.resolved(grains, control)
    parameters = StepParameters(
        box.span,
        _contact_parameters(by_type.contact, grains, verlet, seed, uniform=uniform),
        found.search,
        _respa_settings(by_type, verlet, long_range, every_step=any(each.every_step for each in extra)),
        _external_work(by_type.external, box),
        _gas_settings(by_type.gas, grains, seed),
        control,
        stepping.flight_limits(grains, _longest_displacement(grains, box, found)),
        ForceNumbers(len(long_range), len(by_type.external)),
    )
    parameters = parameters._replace(flight_limits=kind.flight_limits(parameters, by_type, grains))
    law = (by_type.contact or Contact()).contact_law
    of_components: dict[int, tuple[Any, Any]] = {}
    for each in extra:
        stages = each.stages(setup, law, parameters.settings)
        if stages.keys() & of_components.keys():  # the driver calls one stage of each number
            raise BadInput(f"{each.name}: {each.noun} cannot be used together with another component; leave one out")
        of_components |= stages
    content = ProgramContent(
        law,
        [(sums, numbers) for _, sums, numbers in long_range],
        [(force.formula, force.numbers()) for force in by_type.external],
        stepping.flight,
        bool(by_type.gas),
        bool(grains.body_moment.any()),
        len(grains) >= WIDE_FROM,
        of_components,
        np.array([i for each in extra for i in each.heavy()], np.int64),
    )
    capacity = int(OVER_ALLOCATION * (len(start.pair) + (0 if contacts is None else len(contacts.pair))))
    over_all_pairs = any(not own and not sums.own_memory for own, (_, sums, _) in zip(listed, long_range, strict=True))
    state = new_state(wrapped, box, parameters, content, capacity, over_all_pairs=over_all_pairs)
    for each in extra:
        each.add_arrays(state, law, parameters.settings)
    chosen = neighbours.settled(found.search, len(grains)) if fresh else neighbours
    search = found.reason + (
        "; arrays sorted along a space-filling curve" if chosen.uses_spatial_sort(len(grains)) else ""
    )
    state.count[COMPARED] = -1 if follower is None else 0
    if follower is not None:
        state.cutoff[:] = follower.values
    parts = (state, parameters, warnings, by_type.external, long_range, search, stepping, chosen, content, follower)
    engine = Engine(*parts)

    def build(others: Sequence[Force], search: Neighbours) -> Engine:
        return build_engine(wrapped, others, box, verlet, search, seed, fresh=False)

    kind.complete(engine, forces, build)
    if any(map(ramps_of, forces)):
        changing = functools.partial(_changing_parameters, verlet=verlet, seed=seed, pair_gap=pair_gap, uniform=uniform)
        engine.ramped = RampedForces(forces, changing)
        engine.set_ramped_parameters()
    given = add_contacts(engine, by_type.contact, contacts)
    if by_type.contact is not None:
        refuse_overlaps(wrapped, by_type.contact, start, given)
    return engine


def fitting_forces(forces: tuple[Force, ...], stepping: Integrator) -> tuple[Force, ...]:
    """The forces, with nearest images where "auto" would choose an Ewald sum whose rates a Taylor scheme needs."""
    taylor = stepping.contact_stepping.far.startswith("taylor")
    if not taylor or not any(isinstance(force, Contact) for force in forces):
        return forces
    return tuple(_of_nearest_images(force) for force in forces)


def _of_nearest_images(force: Force) -> Force:
    """The force, with nearest images instead of an automatic choice."""
    given: Any = force
    auto = isinstance(force, EwaldForce) and force.periodic == "auto"
    return cast("Force", dataclasses.replace(given, periodic="nearest image")) if auto else force


def _changing_parameters(
    forces: Sequence[Force], grains: Grains, *, verlet: Verlet, seed: int, pair_gap: float, uniform: bool
) -> dict[str, Any]:
    """The fields of `StepParameters` that depend on parameters of forces."""
    by_type = _forces_by_type(forces, grains)
    return {
        "settings": _contact_parameters(by_type.contact, grains, verlet, seed, uniform=uniform),
        "gas": _gas_settings(by_type.gas, grains, seed),
        "criteria": _step_control(grains, verlet, by_type, pair_gap),
    }


def _long_range_loops(
    forces: ForcesByType, grains: Grains, box: Box, listed: Sequence[bool]
) -> list[tuple[LongRangeForce, LongRangeSums, Any]]:
    """Long-range forces with their loops and numbers."""
    sums = [force.sums(box, own, grains) for force, own in zip(forces.long_range, listed, strict=True)]
    return [(force, own, force.numbers(grains, box)) for force, own in zip(forces.long_range, sums, strict=True)]


def _forces_by_type(forces: Sequence[Force], grains: Grains) -> ForcesByType:
    return ForcesByType(
        next((f for f in forces if isinstance(f, Contact)), None),
        [f for f in forces if isinstance(f, LongRangeForce) and f.acts_on(grains)],
        [f for f in forces if isinstance(f, ExternalForce)],
        [f for f in forces if isinstance(f, Gas)],
    )


def _respa_settings(
    forces: ForcesByType,
    verlet: Verlet,
    loops: Sequence[tuple[LongRangeForce, LongRangeSums, Any]],
    *,
    every_step: bool,
) -> RespaSettings:
    """Multiple time stepping; cycles of one step without long-range forces, or with `every_step`: driven grains.

    Without contacts, or with cycles of one step, there is neither extrapolation nor a constant force.
    """
    most = verlet.max_cycle_steps if forces.long_range and not every_step else 1
    scheme = verlet.far if forces.contact and most > 1 else "every step"
    taylor = scheme.startswith("taylor")
    if taylor:
        without = [force.name for force, sums, _ in loops if sums.rates is None]
        if without:
            raise BadInput(
                f"stepping: far = '{scheme}' needs the rate of change of every pair force, which {', '.join(without)} "
                "lacks; use far = 'impulse' or 'every step'"
            )
    return RespaSettings(most, verlet.far == "taylor-literal", scheme == "impulse", taylor)


def _longest_displacement(grains: Grains, box: Box, found: ChosenSearch) -> float:
    """Longest displacement [m] of a grain in one step of an integrator's `flight` for which no pair can be missed.

    With a Verlet list: Δr/4. Pairs that are not listed were farther apart than the reach, at least r1 + r2 plus Δr, and
    a grain moves by at most Δr/4 between the construction of the list and the start of a step
    (`integrate.flight.refresh_verlet_list`), and by at most Δr/4 in the step. In a periodic box, two grains must also
    not touch through an image other than the nearest, which is half a box side away: together they may approach by that
    distance minus r1 + r2. A tenth is subtracted for positions within a step.
    """
    images = 0.9 * 0.5 * (0.5 * box.shortest - 2.0 * float(grains.radius.max()))
    return min(images, 0.9 * 0.25 * found.search.margin) if found.search.listed else images


def _external_work(external: Sequence[ExternalForce], box: Box) -> ExternalWork:
    """Whether the energy of external forces depends on time, or on a position that periodic boundaries make jump."""
    position_dependent = any(getattr(f, "position_dependent", False) for f in external)
    return ExternalWork(
        any(getattr(f, "time_dependent", False) for f in external), position_dependent and not box.is_open
    )


def _gas_settings(gas: Sequence[Gas], grains: Grains, seed: int) -> GasSettings:
    if not gas:
        return GasSettings(math.inf, seed, VACUUM)
    return GasSettings(GAS_PERIOD_FRACTION * gas[0].shortest_time(grains), seed, gas[0].numbers())


def _step_control(grains: Grains, stepping: Verlet, forces: ForcesByType, pair_gap: float) -> StepCriteria:
    """Parameters of the choice of the step size."""
    steps = [own() for f in forces.external if (own := getattr(f, "longest_step", None)) is not None]
    idle = IDLE * min(sound_crossing(grains, number) for number in range(len(grains.materials)))
    return StepCriteria(
        fixed=0.0 if stepping.step == "auto" else stepping.step,
        pair_gap=pair_gap,
        energy_scale=max((f.energy_scale(grains) for f in forces.long_range), default=0.0),
        accuracy=stepping.accuracy,
        outer_field=math.fsum(f.flux_density_size() for f in forces.external),
        impact=IMPACT_DISPLACEMENT / stepping.steps_per_period,
        longest=min([idle, *steps, *(GAS_PERIOD_FRACTION * gas.shortest_time(grains) for gas in forces.gas)]),
    )


def sound_crossing(grains: Grains, number: int) -> float:
    """Sound-crossing time r √(ρ/E) [s] of the smallest grain of one material."""
    material = grains.materials[number]
    radius = float(grains.radius[grains.material == number].min())
    return radius * math.sqrt(material.density / material.young_modulus)


def _contact_parameters(
    contact: Contact | None, grains: Grains, stepping: Verlet, seed: int, *, uniform: bool
) -> ContactParameters:
    law = contact or Contact()
    # without a Contact no grains touch, and materials may lack the constants of contacts
    pairings = law.pairings(grains.materials if contact else (SILICA,) * len(grains.materials))
    return ContactParameters(
        on=contact is not None,
        pairings=pairings,
        reset=law.slip == "reset",
        follow=law.stiffness == "dt97",
        damped=law.damping != "none",
        bath=0.0 if law.bath_temperature is None else BOLTZMANN * law.bath_temperature,
        seed=seed,
        per_period=stepping.steps_per_period,
        settling_time=math.inf if law.settling_time is None else law.settling_time,
        uniform_contacts=uniform
        and all(own.min() == own.max() for own in (grains.material, grains.radius, grains.mass)),
    )
