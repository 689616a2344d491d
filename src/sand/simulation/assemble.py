"""From objects to the numbers the compiled driver takes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from ..box import Box
from ..contact.law import Bond
from ..contact.model import Contact
from ..errors import BadInput
from ..forces.base import ExternalForce, Force, LongRangeForce, compose, compose_long_range
from ..forces.external.loops import is_builtin
from ..forces.gas.loops import VACUUM
from ..forces.gas.model import Gas
from ..forces.pair.loops import NO_LONG_RANGE_FORCE, LongRangeSums, all_blocks
from ..grains import Grains
from ..integrate.adaptive import Adaptive
from ..integrate.kernel_spec import ContactParameters, ExternalWork, GasSettings, KernelSpec, StepParameters
from ..integrate.step_control import IMPACT_DISPLACEMENT, StepCriteria
from ..integrate.task_queue import uses_task_queue
from ..integrate.verlet import Verlet
from ..material import SILICA
from ..neighbours.settings import Found, Neighbours
from ..setup.from_frame import Bonds
from ..state.arrays import (
    ALWAYS,
    FOR_CELLS,
    FOR_FORCES,
    FOR_IMPULSES,
    FOR_LIST,
    FOR_RATES,
    SPARE,
    empty_contact_arrays,
    empty_long_range_arrays,
    empty_pair_list,
)
from ..state.stages import stage_arrays
from ..state.state import RECORDED, State
from .checks import impossible, unusual
from .engine import Engine
from .initial_contacts import NOTHING_TOUCHES, refuse_overlaps, seed_contacts, touching

MATES = 4
"""Room per grain for neighbours in the list to begin with; it grows when needed."""
IN_REACH = 1000
"""Room for the neighbours of one grain, where they are forgotten once those that may touch are picked."""
WIDE_FROM = 64
"""Fewest grains for the longest vectors: of less, much is left over that fills none."""
IDLE = 1e5
"""Longest step in sound-crossing times of a grain, for worlds in which nothing happens."""
GAS_PERIOD_FRACTION = 0.05
"""Time between two kicks of the gas, in shortest stopping times.

Kicks come at ends of steps or cycles, 2/3 to 4/3 of it apart; free grains diffuse h²/12τ² too fast, at most 4e-4.
"""


class Given(NamedTuple):
    """The forces by kind."""

    contact: Contact | None
    distant: list[LongRangeForce]  # those that some grain feels
    external: list[ExternalForce]
    gas: list[Gas]  # one or none


def build_engine(
    grains: Grains,
    forces: Sequence[Force],
    box: Box,
    stepping: Verlet | Adaptive,
    neighbours: Neighbours,
    seed: int = 0,
    *,
    fresh: bool = True,
    contacts: Bonds | None = None,
) -> Engine:
    """Check that everything fits together and translate it.

    Parameters
    ----------
    seed : int, optional
        of random kicks.
    fresh : bool, optional
        a new start, whose overlaps are looked at; a restart may be in the middle of an impact.
    contacts : Bonds or None, optional
        that are there from the start, with what they remember.

    Raises
    ------
    BadInput
        every problem at once.
    """
    warnings = _checked(grains, forces, box, fresh=fresh)
    given = _given(forces, grains)
    reach = float(grains.radius.min())
    cutoffs = [f.choose(grains, box).radius for f in given.distant]
    flights = isinstance(stepping, Adaptive)
    found = neighbours.choose(grains, box, reach, [r for r in cutoffs if r is not None], flights=flights)
    long_range = _far(given, grains, box, [found.search.listed and r is not None for r in cutoffs])
    verlet = stepping.touching if isinstance(stepping, Adaptive) else stepping
    control = _control(grains, verlet, given, reach)
    if isinstance(stepping, Adaptive):
        stepping = stepping.resolved(grains, control)
    composed, numbers = compose(given.external)
    sums, far_numbers = compose_long_range([sums for _, sums, _ in long_range], [own for _, _, own in long_range])
    rules = StepParameters(
        box.span,
        _contact_rules(given.contact, grains, verlet),
        far_numbers,
        numbers,
        found.search,
        verlet.respa_settings(bool(long_range)),
        _ledger_columns(given.external, box),
        _stirring(given.gas, grains, seed),
        control,
        stepping.error_limits(_stride(grains, box, found)) if isinstance(stepping, Adaptive) else (),
    )
    plan = _plan(grains, given, composed, sums, verlet, isinstance(stepping, Adaptive))
    here = grains.copy()
    here.arrays.position[...] = box.wrap(grains.position).T
    start = touching(here, box) if given.contact is not None and fresh else NOTHING_TOUCHES
    room = int(SPARE * (len(start.pair) + (0 if contacts is None else len(contacts.pair))))
    state = _world(here, box, rules, plan, room, all_pairs=not found.search.listed or None in cutoffs)
    chosen = neighbours.settled(found.search, len(grains)) if fresh else neighbours
    search = found.reason + ("; in memory along a curve through space" if chosen.along_curve(len(grains)) else "")
    engine = Engine(state, rules, warnings, given.external, long_range, search, stepping, chosen, plan)
    held = seed_contacts(engine, given.contact, contacts)
    if given.contact is not None:
        refuse_overlaps(here, given.contact, start, held)
    return engine


def _far(
    given: Given, grains: Grains, box: Box, listed: Sequence[bool]
) -> list[tuple[LongRangeForce, LongRangeSums, Any]]:
    """Each long-range force with its loops and numbers."""
    sums = [force.sums(box, own) for force, own in zip(given.distant, listed, strict=True)]
    if len(grains) >= WIDE_FROM:
        sums = [own.wide or own for own in sums]
    return [(f, own, f.numbers(grains, box)) for f, own in zip(given.distant, sums, strict=True)]


def _given(forces: Sequence[Force], grains: Grains) -> Given:
    return Given(
        next((f for f in forces if isinstance(f, Contact)), None),
        [f for f in forces if isinstance(f, LongRangeForce) and f.acts_on(grains)],
        [f for f in forces if isinstance(f, ExternalForce)],
        [f for f in forces if isinstance(f, Gas)],
    )


def _plan(
    grains: Grains, given: Given, external: Callable, sums: LongRangeSums, verlet: Verlet, adaptive: bool
) -> KernelSpec:
    """What the driver is compiled from."""
    # where nothing can touch, or a cycle is one step, nothing is foretold or given apart
    way = verlet.far if given.distant and given.contact and verlet.max_cycle_steps > 1 else "every step"
    return KernelSpec(
        external,
        sums,
        split=way == "impulse",
        impulse=way == "impulse",
        taylor=way.startswith("taylor"),
        gas=bool(given.gas),
        adaptive=adaptive,
        queue=uses_task_queue(len(grains)),
        keep=all(is_builtin(f.formula) for f in given.external),
        magnetic=bool(grains.body_moment.any()),
        wide=len(grains) >= WIDE_FROM,
    )


def _world(grains: Grains, box: Box, rules: StepParameters, plan: KernelSpec, room: int, *, all_pairs: bool) -> State:
    """The grains in their box, with `room` for contacts and pairs, and for whatever else plan and rules need."""
    count, listed, uniform_contacts = len(grains), rules.search.listed, rules.contact.uniform_contacts
    channels = len(RECORDED) if rules.contact.damped or rules.contact.follow else ALWAYS
    blocks = all_blocks(grains) if plan.long_range is not NO_LONG_RANGE_FORCE and all_pairs else 0
    needed = set(FOR_LIST if listed else FOR_CELLS if rules.search.celled else ())
    needed |= set(FOR_IMPULSES if plan.impulse else ())
    needed |= set(FOR_RATES if plan.taylor else ())
    needed |= {"packed_position", "source"} if blocks else set()
    needed |= set(FOR_FORCES if plan.long_range is not NO_LONG_RANGE_FORCE or plan.adaptive else ())
    return State(
        grains,
        box,
        empty_contact_arrays(count, room, len(Bond._fields), uniform_contacts=uniform_contacts, channels=channels),
        empty_pair_list(count, room, uniform_contacts=uniform_contacts),
        empty_long_range_arrays(
            count,
            MATES * count if listed else IN_REACH if rules.search.celled else 0,
            blocks,
            needless={*FOR_FORCES, *FOR_LIST, *FOR_IMPULSES, *FOR_RATES} - needed,
        ),
        stages=stage_arrays(count if plan.adaptive else 0),
        uniform_contacts=uniform_contacts,
    )


def _stride(grains: Grains, box: Box, found: Found) -> float:
    """The longest way [m] that a grain may go in one Runge–Kutta step, so that no pair is missed.

    With a list, Δr/4, as `integrate.event_location.first_contact_time` argues.  And an image of a grain other than the nearest must not
    come to touch: it is half a box side away, and two grains close that less r1 + r2 together.  A tenth is kept back
    for what lies between two stages.
    """
    images = 0.9 * 0.5 * (0.5 * box.shortest - 2.0 * float(grains.radius.max()))
    return min(images, 0.9 * 0.25 * found.search.margin) if found.search.listed else images


def _ledger_columns(external: Sequence[ExternalForce], box: Box) -> ExternalWork:
    position_dependent = any(getattr(f, "position_dependent", False) for f in external)
    return ExternalWork(
        any(getattr(f, "time_dependent", False) for f in external), position_dependent and not box.is_open
    )


def _stirring(gas: Sequence[Gas], grains: Grains, seed: int) -> GasSettings:
    if not gas:
        return GasSettings(math.inf, seed, VACUUM)
    return GasSettings(GAS_PERIOD_FRACTION * gas[0].shortest_time(grains), seed, gas[0].numbers())


def _checked(grains: Grains, forces: Sequence[Force], box: Box, *, fresh: bool) -> list[str]:
    """Warnings of what is unusual.  Raises BadInput for everything that does not fit together."""
    problems = impossible(grains, forces, box) if fresh else []
    warnings: list[str] = []
    for force in forces:
        try:
            warnings += force.check(grains, box)
        except BadInput as error:
            problems += error.problems
    least = 2.0 * (2.0 * float(grains.radius.max()) + float(grains.radius.min()))
    if box.shortest < least:
        problems.append(
            f"box = {box.describe()} is too small: its shortest side must be at least {least:.3g} m, "
            "or a grain would meet two images of its neighbour"
        )
    if problems:
        raise BadInput(problems)
    return warnings + (unusual(grains, forces, box) if fresh else [])


def _control(grains: Grains, stepping: Verlet, given: Given, reach: float) -> StepCriteria:
    """What the choice of the step needs."""
    steps = [own() for f in given.external if (own := getattr(f, "longest_step", None)) is not None]
    idle = IDLE * min(sound_crossing(grains, number) for number in range(len(grains.materials)))
    return StepCriteria(
        fixed=0.0 if stepping.step == "auto" else stepping.step,
        reach=reach,
        energy_scale=max((f.energy_scale(grains) for f in given.distant), default=0.0),
        accuracy=stepping.accuracy,
        outer_field=math.fsum(f.flux_density_size() for f in given.external),
        impact=IMPACT_DISPLACEMENT / stepping.steps_per_period,
        longest=min([idle, *steps, *(GAS_PERIOD_FRACTION * gas.shortest_time(grains) for gas in given.gas)]),
    )


def sound_crossing(grains: Grains, number: int) -> float:
    """r √(ρ/E) [s] of the smallest grain of one material."""
    material = grains.materials[number]
    radius = float(grains.radius[grains.material == number].min())
    return radius * math.sqrt(material.density / material.young_modulus)


def _contact_rules(contact: Contact | None, grains: Grains, stepping: Verlet) -> ContactParameters:
    law = contact or Contact()
    # without a Contact nothing ever touches, and materials may lack what contacts need
    pairings = law.pairings(grains.materials if contact else (SILICA,) * len(grains.materials))
    return ContactParameters(
        on=contact is not None,
        pairings=pairings,
        release=law.beyond == "release",
        follow=law.stiffness == "dt97",
        damped=law.damping != "none",
        per_period=stepping.steps_per_period,
        uniform_contacts=all(own.min() == own.max() for own in (grains.material, grains.radius, grains.mass)),
    )
