"""Assembly of the engine: forces, box and settings become the components of a program, step parameters and state."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple, cast

import numpy as np

from ..basics.arrays import OVER_ALLOCATION, body_arrays
from ..basics.box import Box
from ..basics.constants import BOLTZMANN
from ..basics.grains import Grains
from ..basics.material import SILICA
from ..basics.ramps import ramps_of
from ..basics.state import COMPARED, CUT_RADIUS
from ..contact.model import Contact
from ..errors import BadInput
from ..forces.base import ExternalForce, Force, LongRangeForce
from ..forces.gas.gas_loops import VACUUM
from ..forces.gas.model import Gas
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
from ..integrate.rigid.body_friction import LARGEST_DEVIATE
from ..integrate.rigid.rigid_clusters import RigidClusters, RigidLimits
from ..integrate.rigid.rigid_driver import LARGEST_FLIGHT
from ..integrate.stage_list import Components
from ..integrate.step_control import IMPACT_DISPLACEMENT, StepCriteria
from ..integrate.verlet import Verlet
from ..limits.solid_limits import torn_clusters
from ..neighbours.search import ChosenSearch, Neighbours
from ..setup.from_frame import StrainedContacts
from .cluster_cutoff import follow_clusters
from .driven import Driven, check_driven, driven_arrays
from .engine import Engine
from .initial_contacts import NO_OVERLAPS, add_contacts, overlapping_pairs, refuse_overlaps
from .input_checks import check_system
from .new_state import new_state
from .ramped import RampedForces
from .rigid.quick_bodies import SubstepEngine
from .rigid.rigid_engine import RigidEngine, list_gap, longest_step_awake
from .walls import Wall, check_walls, place_walls, wall_numbers

WIDE_FROM = 64
"""Fewest grains for the widest SIMD vectors; with fewer, most lanes of the last vector would be idle."""
IDLE = 1e5
"""Longest step in sound-crossing times of a grain, where nothing else limits the step."""
GAS_PERIOD_FRACTION = 0.05
"""Time between two gas kicks, in shortest stopping times.

Kicks are applied at ends of steps or cycles, at intervals h of 2/3 to 4/3 of it; free grains then diffuse too fast by
h²/12τ², at most 4e-4.
"""


class ForcesByType(NamedTuple):
    """The forces of a simulation by type."""

    contact: Contact | None
    long_range: list[LongRangeForce]  # the forces that act on at least one grain
    external: list[ExternalForce]
    gas: list[Gas]  # at most one


def build_engine(
    grains: Grains,
    forces: Sequence[Force],
    box: Box,
    stepping: Integrator,
    neighbours: Neighbours,
    seed: int = 0,
    driven: Sequence[Driven] = (),
    walls: Sequence[Wall] = (),
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
    driven : Sequence[Driven], optional
        Grains with prescribed motion.
    walls : Sequence[Wall], optional
        Walls, each with its own name.
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
    warnings = check_system(grains, forces, box, fresh=fresh)
    if isinstance(stepping, RigidClusters):
        warnings += check_rigid_clusters(forces, driven, walls, neighbours)
    check_driven(driven, grains, forces, stepping, neighbours)
    by_type = _forces_by_type(forces, grains)
    check_walls(walls, grains, by_type.contact, box, stepping, fresh=fresh)
    rigid = isinstance(stepping, RigidClusters)
    pair_gap = list_gap(grains, box) if rigid else float(grains.radius.min())
    wrapped = grains.copy()
    wrapped.arrays.position[...] = box.wrap(grains.position).T
    if fresh:  # grains of another simulation may have other identities, and have crossed its box
        wrapped.arrays.id[...] = np.arange(len(grains))
        wrapped.arrays.image[...] = 0
    if rigid:
        neighbours = dataclasses.replace(neighbours, order="as given")
    held = driven_arrays(driven, grains)
    if held is not None:
        wrapped.arrays.velocity[:, held.grain], wrapped.arrays.spin[:, held.grain] = held.velocity, held.spin
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
    found = neighbours.choose(grains, box, pair_gap, [r for r in cutoffs if r is not None], adaptive_steps=flights)
    listed = [found.search.listed and r is not None for r in cutoffs]
    long_range = _long_range_loops(by_type, grains, box, listed)
    if follower is not None:
        force, sums, _ = long_range[follower.index]
        long_range[follower.index] = force, sums, follower.force.numbers_at(cutoffs[follower.index])
    verlet = stepping.contact_stepping
    # friction and noise of bodies are exact: `_rigid_limits` says how long their steps may be
    control = _step_control(grains, verlet, by_type._replace(gas=[]) if rigid else by_type, pair_gap)
    stepping = stepping.resolved(grains, control)
    parameters = StepParameters(
        box.span,
        _contact_parameters(by_type.contact, grains, verlet, seed, uniform=held is None),
        found.search,
        _respa_settings(by_type, verlet, long_range, every_step=held is not None),
        _external_work(by_type.external, box),
        _gas_settings(by_type.gas, grains, seed),
        control,
        stepping.flight_limits(_longest_displacement(grains, box, found)),
        ForceNumbers(len(long_range), len(by_type.external)),
    )
    if rigid:
        limits = _rigid_limits(parameters, by_type, grains)
        parameters = parameters._replace(flight_limits=limits)
    components = Components(
        (by_type.contact or Contact()).contact_law,
        [(sums, numbers) for _, sums, numbers in long_range],
        [(force.formula, force.numbers()) for force in by_type.external],
        stepping.flight,
        bool(by_type.gas),
        bool(grains.body_moment.any()),
        len(grains) >= WIDE_FROM,
        held,
        wall_numbers(walls, grains, by_type.contact),
    )
    capacity = int(OVER_ALLOCATION * (len(start.pair) + (0 if contacts is None else len(contacts.pair))))
    over_all_pairs = any(not own and not sums.own_memory for own, (_, sums, _) in zip(listed, long_range, strict=True))
    state = new_state(wrapped, box, parameters, components, capacity, over_all_pairs=over_all_pairs)
    place_walls(state, walls, components.law, state.contacts.lost.shape[0], damped=parameters.settings.damped)
    chosen = neighbours.settled(found.search, len(grains)) if fresh else neighbours
    search = found.reason + (
        "; arrays sorted along a space-filling curve" if chosen.uses_spatial_sort(len(grains)) else ""
    )
    state.count[COMPARED] = -1 if follower is None else 0
    if follower is not None:
        state.cutoff[:] = follower.values
    parts = (state, parameters, warnings, by_type.external, long_range, search, stepping, chosen, components, follower)
    engine = Engine(*parts)
    if rigid:
        state.bodies = body_arrays(len(grains), in_gas=bool(by_type.gas))
        inner = inner_engine(wrapped, forces, box, verlet, seed)
        engine = SubstepEngine(*parts, inner=inner, part=part_engine(inner, parameters))
    if any(map(ramps_of, forces)):
        changing = functools.partial(
            _changing_parameters, verlet=verlet, seed=seed, pair_gap=pair_gap, uniform=held is None
        )
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


def _between_all(force: Force) -> Force:
    """The force between nearest images of all pairs of grains, without a cut-off, which would depend on time."""
    near: Any = force.of_nearest_images() if isinstance(force, EwaldForce) else force
    defaults = {each.name: each.default for each in dataclasses.fields(near)}
    settings = {"cutoff": None} | ({"cut": defaults["cut"]} if "cut" in defaults else {})
    return cast("Force", dataclasses.replace(near, **settings)) if "cutoff" in defaults else cast("Force", near)


def inner_engine(grains: Grains, forces: Sequence[Force], box: Box, verlet: Verlet, seed: int) -> Engine:
    """The engine of the grains of awake clusters; what images other than the nearest one add is left to the bodies."""
    near = [_between_all(force) for force in forces]
    return build_engine(grains, near, box, verlet, Neighbours("all pairs", order="as given"), seed, fresh=False)


def part_engine(inner: Engine, parameters: StepParameters) -> RigidEngine:
    """The engine of substeps: the forces of the engine of awake grains, and the steps of bodies of these parameters."""
    limits = parameters.flight_limits._replace(substeps=False, holds_loads=True)
    own = inner.parameters._replace(flight_limits=limits, criteria=parameters.criteria)
    settings = {each.name: getattr(inner, each.name) for each in dataclasses.fields(Engine) if each.init}
    return RigidEngine(**settings | {"parameters": own}, inner=inner)


def _rigid_limits(parameters: StepParameters, forces: ForcesByType, grains: Grains) -> RigidLimits:
    """Limits of the steps of rigid clusters that depend on grains, contacts and gas.

    In a gas a step is at most η τ, with the shortest stopping time τ of a grain, which no mode of a body falls below:
    the exact friction needs no short step, but drifts of half a step with the velocities before and after it let a free
    body diffuse too fast by h²/12τ², an error of the order of η² as that of the loads. Nor may noise alone move a grain
    farther than half of `LARGEST_FLIGHT`: half a step with `LARGEST_DEVIATE` standard deviations √(2 k_B T h/τ m).
    """
    law, limits = (forces.contact or Contact()).contact_law, parameters.flight_limits
    longest, rate, gas = limits.longest_step, 0.0, parameters.gas.gas
    if forces.gas:
        rate = 1.0 / forces.gas[0].shortest_time(grains)
        spread = LARGEST_DEVIATE * math.sqrt(2.0 * gas.temperature_energy * rate / float(grains.mass.min()))
        longest = min(longest, limits.step_fraction / rate)
        if spread > 0.0:
            longest = min(longest, (LARGEST_FLIGHT * parameters.criteria.pair_gap / spread) ** (2.0 / 3.0))
    awake = min(longest, longest_step_awake(law, parameters.settings, grains))
    return limits._replace(
        longest_step=longest,
        longest_awake=awake,
        smallest_radius=float(grains.radius.min()),
        friction_rate=rate,
        substeps=True,
    )


GRAINS = "use clusters = 'grains' (sand.Verlet)"


def check_rigid_clusters(
    forces: Sequence[Force], driven: Sequence[Driven], walls: Sequence[Wall], neighbours: Neighbours
) -> list[str]:
    """Refuse what rigid clusters cannot do, all problems at once; returns warnings."""
    contact = next((f for f in forces if isinstance(f, Contact)), None)
    problems = []
    if contact is None:
        problems.append("rigid clusters need sand.Contact; without contacts use clusters = 'grains' (sand.Verlet)")
    elif contact.damping == "none":
        problems.append(
            "without damping no cluster comes to rest; use damping = 'critical' and a settling_time, such as 5 ns, in "
            "[forces.contact] (sand.Contact)"
        )
    for name in ("slide_factor", "roll_factor", "twist_factor") if contact is not None else ():
        if getattr(contact, name) == 0.0:
            problems.append(f"with {name} = 0 in [forces.contact] a contact has no limit to rest at; {GRAINS}")
    if contact is not None and contact.bath_temperature is not None:
        problems.append(
            f"with bath_temperature in [forces.contact] no cluster comes to rest; leave it out, or {GRAINS}"
        )
    for force in forces:
        for name in ramps_of(force):
            problems.append(f"rigid clusters cannot follow the ramp {force.name}.{name}; use a number, or {GRAINS}")
    if driven:
        problems.append(f"rigid clusters cannot have driven grains; {GRAINS}")
    if walls:
        problems.append(f"rigid clusters cannot have walls; {GRAINS}")
    if neighbours.order == "curve":
        problems.append(f"rigid clusters need order = 'as given' or 'auto' in [neighbours], not 'curve'; or {GRAINS}")
    if problems:
        raise BadInput([f"stepping: {line}" for line in problems])
    if contact is not None and contact.settling_time is None:
        return [
            "without settling_time in [forces.contact] (sand.Contact) long chains vibrate, and stay awake, for "
            "microseconds; 5 ns is usual for grains of 10 nm"
        ]
    return []


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
    """Longest displacement [m] of a grain in one Runge–Kutta step for which no pair can be missed.

    With a Verlet list: Δr/4, derived in `integrate.event_location.first_contact_time`. In a periodic box, two grains
    must also not touch through an image other than the nearest, which is half a box side away: together they may
    approach by that distance minus r1 + r2. A tenth is subtracted for positions between two stages.
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
