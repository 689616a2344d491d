"""The parameters of steps that follow from the settings of forces and integrator."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from ..basics.box import Box
from ..basics.constants import BOLTZMANN
from ..basics.errors import BadInput
from ..basics.grains import Grains
from ..basics.material import SILICA
from ..contact.model import Contact
from ..forces.base import ExternalForce, Force, LongRangeForce
from ..forces.gas import Gas
from ..forces.gas_loops import VACUUM
from ..forces.pair.long_range_loops import LongRangeSums
from ..integrate.parts import ContactParameters, ExternalWork, GasSettings, RespaSettings
from ..integrate.step_control import IMPACT_DISPLACEMENT, StepCriteria
from ..integrate.verlet import Verlet
from ..neighbours.search import ChosenSearch

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


class ForceDependent(NamedTuple):
    """The fields of `StepParameters` that follow from values of parameters of the forces, which ramps change."""

    settings: ContactParameters
    gas: GasSettings
    criteria: StepCriteria
    flight_limits: Any


def forces_by_type(forces: Sequence[Force], grains: Grains) -> ForcesByType:
    """The forces of a simulation of these grains by type."""
    return ForcesByType(
        next((f for f in forces if isinstance(f, Contact)), None),
        [f for f in forces if isinstance(f, LongRangeForce) and f.acts_on(grains)],
        [f for f in forces if isinstance(f, ExternalForce)],
        [f for f in forces if isinstance(f, Gas)],
    )


def force_dependent(
    forces: Sequence[Force],
    grains: Grains,
    *,
    kind: Any,
    verlet: Verlet,
    seed: int,
    pair_gap: float,
    uniform: bool,
    limits: Any,
) -> ForceDependent:
    """The parameters of steps that follow from values of parameters of the forces.

    Parameters
    ----------
    kind : kinds.Kind
        Kind of engine.
    verlet : Verlet
        Settings of contact steps.
    seed : int
        Seed of the random kicks of gas and bath.
    pair_gap : float
        Largest gap [m] of pairs whose approach limits the step.
    uniform : bool
        Whether contacts between equal grains may share one set of constants.
    limits : Any
        Run-time numbers of the integrator that do not depend on forces.
    """
    by_type = forces_by_type(forces, grains)
    found = ForceDependent(
        settings=_contact_parameters(by_type.contact, grains, verlet, seed, uniform=uniform),
        gas=_gas_settings(by_type.gas, grains, seed),
        criteria=step_criteria(grains, verlet, kind.limiting_forces(by_type), pair_gap),
        flight_limits=limits,
    )
    return found._replace(flight_limits=kind.flight_limits(found, by_type, grains))


def respa_settings(
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
    if without := [force.name for force, sums, _ in loops if taylor and sums.rates is None]:
        raise BadInput(
            f"stepping: far = '{scheme}' needs the rate of change of every pair force, which {', '.join(without)} "
            "lacks; use far = 'impulse' or 'every step'"
        )
    return RespaSettings(most, verlet.far == "taylor-literal", scheme == "impulse", taylor)


def longest_displacement(grains: Grains, box: Box, found: ChosenSearch) -> float:
    """Longest displacement [m] of a grain in one step of an integrator's `flight` for which no pair can be missed.

    With a Verlet list: Δr/4. Pairs that are not listed were farther apart than the reach, at least r1 + r2 plus Δr, and
    a grain moves by at most Δr/4 between the construction of the list and the start of a step
    (`integrate.flight.refresh_verlet_list`), and by at most Δr/4 in the step. In a periodic box, two grains must also
    not touch through an image other than the nearest, which is half a box side away: together they may approach by that
    distance minus r1 + r2. A tenth is subtracted for positions within a step.
    """
    images = 0.9 * 0.5 * (0.5 * box.shortest - 2.0 * float(grains.radius.max()))
    return min(images, 0.9 * 0.25 * found.search.margin) if found.search.listed else images


def external_work(external: Sequence[ExternalForce], box: Box) -> ExternalWork:
    """Whether the energy of external forces depends on time, or on a position that periodic boundaries make jump."""
    of_position = not box.is_open and any(getattr(f, "position_dependent", False) for f in external)
    return ExternalWork(any(getattr(f, "time_dependent", False) for f in external), of_position)


def _gas_settings(gas: Sequence[Gas], grains: Grains, seed: int) -> GasSettings:
    if not gas:
        return GasSettings(math.inf, seed, VACUUM)
    return GasSettings(GAS_PERIOD_FRACTION * gas[0].shortest_time(grains), seed, gas[0].numbers())


def step_criteria(grains: Grains, stepping: Verlet, forces: ForcesByType, pair_gap: float) -> StepCriteria:
    """Parameters of the choice of the step size; `IDLE` is in units of r √(ρ/E) of the smallest grain of a material."""
    steps = [own() for f in forces.external if (own := getattr(f, "longest_step", None)) is not None]
    steps += [GAS_PERIOD_FRACTION * gas.shortest_time(grains) for gas in forces.gas]
    smallest = [float(grains.radius[grains.material == k].min()) for k in range(len(grains.materials))]
    times = [r * math.sqrt(m.density / m.young_modulus) for r, m in zip(smallest, grains.materials, strict=True)]
    return StepCriteria(
        fixed=0.0 if stepping.step == "auto" else stepping.step,
        pair_gap=pair_gap,
        energy_scale=max((f.energy_scale(grains) for f in forces.long_range), default=0.0),
        accuracy=stepping.accuracy,
        outer_field=math.fsum(f.flux_density_size() for f in forces.external),
        impact=IMPACT_DISPLACEMENT / stepping.steps_per_period,
        longest=min([IDLE * min(times), *steps]),
        reach=2.0 * float(grains.radius.max()) + pair_gap,
    )


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
