"""Assembly of the engine of rigid clusters: what it refuses, its limits, and its parts."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence
from typing import Any, cast

import numpy as np

from ...basics.arrays import body_arrays
from ...basics.box import Box
from ...basics.errors import BadInput
from ...basics.grains import Grains
from ...basics.ramps import ramps_of
from ...basics.state import CONTACT_STEPS, SUBSTEPS
from ...contact.law import ContactLaw, Pairing, contact_constants
from ...contact.model import Contact
from ...forces.base import Force
from ...forces.pair.ewald_force import EwaldForce
from ...integrate.hooks import Hook
from ...integrate.parts import ContactParameters
from ...integrate.rigid.awake_clusters import PERIODS, add_held_loads, no_loads
from ...integrate.rigid.body_friction import LARGEST_DEVIATE
from ...integrate.rigid.rigid_clusters import RigidLimits
from ...integrate.rigid.rigid_driver import LARGEST_FLIGHT
from ...neighbours.search import Neighbours
from ..engine import Engine
from ..kinds import Build, Kind
from ..part import Part
from ..step_parameters import ForceDependent, ForcesByType
from .awake_steps import AwakeSteps
from .body_steps import BodySteps
from .quick_bodies import QuickBodies

GRAINS = "use clusters = 'grains' (sand.Verlet)"
LIST_GAP, SHARE_OF_SPACING = 3.0, 0.3
"""Largest gap of pairs that the driver of bodies looks at, in smallest radii, and, in thin gases, in mean distances of
neighbours: steps of bodies are long, and no body flies farther in a step than a fifth of it."""


class BodiesKind(Kind):
    """An engine of rigid clusters."""

    integrator = "rigid-clusters"

    keeps_order = True

    def check(self, forces: Sequence[Force], neighbours: Neighbours) -> list[str]:
        """Refuse what rigid clusters cannot do, all problems at once; returns warnings."""
        contact = next((f for f in forces if isinstance(f, Contact)), None)
        problems = []
        if contact is None:
            problems.append("rigid clusters need sand.Contact; without contacts use clusters = 'grains' (sand.Verlet)")
        elif contact.damping == "none":
            problems.append(
                "without damping no cluster comes to rest; use damping = 'critical' and a settling_time, such as 5 ns, "
                "in [forces.contact] (sand.Contact)"
            )
        for name in ("slide_factor", "roll_factor", "twist_factor") if contact is not None else ():
            if getattr(contact, name) == 0.0:
                problems.append(f"with {name} = 0 in [forces.contact] a contact has no limit to rest at; {GRAINS}")
        if contact is not None and contact.bath_temperature is not None:
            problems.append(
                f"with bath_temperature in [forces.contact] no cluster comes to rest; leave it out, or {GRAINS}"
            )
        problems += [
            f"rigid clusters cannot follow the ramp contact.{name}: each change of limits of contacts would wake all "
            f"clusters; use a number, or {GRAINS}"
            for name in ramps_of(contact)
        ]
        if neighbours.order == "curve":
            problems.append(
                f"rigid clusters need order = 'as given' or 'auto' in [neighbours], not 'curve'; or {GRAINS}"
            )
        if problems:
            raise BadInput([f"stepping: {line}" for line in problems])
        warning = (
            "without settling_time in [forces.contact] (sand.Contact) long chains vibrate, and stay awake, for "
            "microseconds; 5 ns is usual for grains of 10 nm"
        )
        return [warning] if contact is not None and contact.settling_time is None else []

    def pair_gap(self, grains: Grains, box: Box) -> float:
        """Largest gap [m] of pairs that the driver of bodies looks at."""
        gap = LIST_GAP * float(grains.radius.min())
        sides = [side for side in box.lengths if side is not None]
        spacing = (math.prod(sides) / len(grains)) ** (1.0 / 3.0) if len(sides) == 3 else 0.0
        return max(gap, SHARE_OF_SPACING * spacing)

    def limiting_forces(self, forces: ForcesByType) -> ForcesByType:
        """The forces but a gas: friction and noise of bodies are exact; see `flight_limits`."""
        return forces._replace(gas=[])

    def flight_limits(self, parameters: ForceDependent, forces: ForcesByType, grains: Grains) -> RigidLimits:
        """Limits of the steps of bodies that depend on grains, contacts and gas.

        In a gas a step is at most η τ, with the shortest stopping time τ of a grain, which no mode of a body falls
        below: the exact friction needs no short step, but drifts of half a step with the velocities before and after it
        let a free body diffuse too fast by h²/12τ², an error of the order of η² as that of the loads. Nor may noise
        alone move a grain farther than half of `LARGEST_FLIGHT`: half a step with `LARGEST_DEVIATE` standard deviations
        √(2 k_B T h/τ m).
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
            substeps=not self.holds,
        )

    def complete(self, engine: Engine, forces: Sequence[Force], build: Build) -> None:
        """Give the engine arrays of bodies, and parts for awake clusters and quick bodies.

        all bodies:      engine, BodySteps
        awake clusters:    part: engine, GrainSteps
        quick bodies:      quick.part: engine, BodySteps
        awake ones:          part: engine, GrainSteps

        Parts sum forces between nearest images of all their pairs; what other images add is left to all bodies.
        """
        state = engine.regular_state
        state.bodies = body_arrays(len(state.grains), in_gas=engine.parameters.gas.gas.on)
        engine.stepper = self._steps(engine, forces, build)

    def _steps(self, engine: Engine, forces: Sequence[Force], build: Build) -> BodySteps:
        """Steps of bodies, with parts for forces without ramps."""
        parameters = engine.parameters
        near = [_between_all(force) for force in forces]
        inner = build(near, Neighbours("all pairs", order="as given"))
        if self.holds and engine.content.pair_forces:
            stages = dict(inner.content.of_components)
            stages[Hook.LOADS] = [*stages.get(Hook.LOADS, ()), (add_held_loads, no_loads(0))]
            inner.content = inner.content._replace(of_components=stages).for_part(len(inner.regular_state.grains))
        limits = parameters.flight_limits._replace(substeps=False, excludes_loads=True)
        own = inner.parameters._replace(flight_limits=limits, criteria=parameters.criteria)
        steps = BodySteps(AwakeSteps(Part(inner, CONTACT_STEPS)))
        of_quick = dataclasses.replace(inner, parameters=own, warnings=engine.warnings, stepper=steps)
        quick = QuickBodies(Part(of_quick, SUBSTEPS, has_bodies=True))
        made = functools.partial(self._steps, build=build)
        return BodySteps(AwakeSteps(Part(inner, CONTACT_STEPS)), None if self.holds else quick, made)


def _between_all(force: Force) -> Force:
    """The force between nearest images of all pairs of grains, without a cut-off, which would depend on time."""
    near: Any = force.of_nearest_images() if isinstance(force, EwaldForce) else force
    defaults = {each.name: each.default for each in dataclasses.fields(near)}
    settings = {"cutoff": None} | ({"cut": defaults["cut"]} if "cut" in defaults else {})
    return cast("Force", dataclasses.replace(near, **settings)) if "cutoff" in defaults else cast("Force", near)


def longest_step_awake(law: ContactLaw, settings: ContactParameters, grains: Grains) -> float:
    """Longest step [s] of bodies while clusters are awake: the shortest time after which a cluster may be at rest.

    That is PERIODS of the slowest mode of the contact of two of the smallest grains of each material.
    """
    found, of_pair = math.inf, contact_constants(law)
    members = [np.flatnonzero(grains.arrays.material == k) for k in range(len(grains.materials))]
    smallest = [int(own[np.argmin(grains.radius[own])]) for own in members]
    for i in smallest:
        for j in smallest:
            pairing = Pairing(*settings.pairings[:, grains.arrays.material[i], grains.arrays.material[j]])
            c = of_pair(pairing, grains.radius[i], grains.radius[j], grains.mass[i], grains.mass[j])
            inertia = 1.0 / grains.inertia[i] + 1.0 / grains.inertia[j]
            slowest = min(
                3.5 * c.slide_stiffness * (1.0 / grains.mass[i] + 1.0 / grains.mass[j]),
                c.roll_stiffness * c.reduced_radius**2 * inertia,
                c.twist_stiffness * inertia,
            )
            if slowest > 0.0:
                found = min(found, 2.0 * math.pi / math.sqrt(slowest))
    return PERIODS * found
