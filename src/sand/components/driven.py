"""Grains whose motion the user prescribes: `sand.Driven`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np

from ..basics.arguments import checked
from ..basics.errors import BadInput, shown
from ..basics.grains import Grains
from ..basics.settings import List, Settings, Vector, Whole
from ..contact.law import ContactLaw
from ..engine.component import Component, Setup
from ..integrate.hooks import HookStages
from ..integrate.parts import ContactParameters
from .driven_stage import CHANGES, CONTACTS, KICKS, DrivenArrays, drive

AT_REST = (0.0, 0.0, 0.0)


@checked
@dataclass(frozen=True)
class Driven(Settings):
    """Grains with prescribed velocity and spin, by default held at rest.

    Their contacts and all forces on other grains act as usual; loads on them do not change their motion, as if mass and
    moment of inertia were infinite. The work of the drive is recorded in `lost_outside`. With a `settling_time` of
    contacts all driven grains have the same velocity, and no spin if there are several. Settling
    (`Contact.settling_time`) of their clusters leads to their rigid motion.

    Parameters
    ----------
    grains : Sequence[int]
        Indices of the grains.
    velocity : Sequence, optional
        Three components [m/s], constant; 0 by default.
    spin : Sequence, optional
        Three components [rad/s], constant; 0 by default.

    Raises
    ------
    BadInput
        If there is no index, or a value is invalid; one line each.
    """

    grains: Annotated[Sequence[int], List(Whole(0), "indices of grains, such as [0, 1]")]
    velocity: Annotated[Sequence[Any], Vector("m/s")] = AT_REST
    spin: Annotated[Sequence[Any], Vector("rad/s")] = AT_REST

    place: ClassVar[str] = "driven"


def read_driven(value: Any) -> tuple[Driven, ...]:
    """Driven grains given as a list, one `Driven` or None.  Raises BadInput."""
    try:
        given = [value] if isinstance(value, Driven) else [] if value is None else list(value)
    except TypeError:
        given = [value]
    wrong = [each for each in given if not isinstance(each, Driven)]
    if wrong:
        raise BadInput(f"driven = {shown(wrong[0])}; give sand.Driven([0, 1]), or a list of these")
    return tuple(given)


class DrivenGrains(Component):
    """Grains with prescribed motion (`Driven`)."""

    name = "driven"
    noun = "driven grains"
    keeps_order = every_step = own_columns = holds = in_parts = True

    def problems(self, setup: Setup) -> list[str]:
        """As `Component.problems`."""
        index, count = self.heavy(), len(setup.grains)
        problems = [
            f"driven: there is no grain {i}; indices of the {count} grains are 0 … {count - 1}"
            for i in sorted(set(index))
            if i >= count
        ]
        problems += [
            f"driven: grain {i} is given more than once; keep one" for i in sorted(set(index)) if index.count(i) > 1
        ]
        if len(set(index)) >= count and not problems:
            problems.append(f"driven: all {count} grains are driven; leave at least one free")
        if setup.stepping.flight is not None:
            problems.append(f"driven: stepping = '{setup.stepping.name}' cannot drive grains; use sand.Verlet()")
        if setup.neighbours.order == "curve":
            problems.append("driven: neighbours order = 'curve' cannot drive grains; use order = 'as given'")
        motions = {(tuple(each.velocity), tuple(each.spin)) for each in self.items}
        rotates = len(index) > 1 and any(any(each.spin) for each in self.items)
        if (len(motions) > 1 or rotates) and getattr(setup.forces.contact, "settling_time", None) is not None:
            # in one cluster, settling would remove the motion of driven grains relative to each other, with any energy
            problems.append(
                "driven: contact settling_time needs one motion to which clusters settle; give all driven grains the "
                "same velocity, and no spin if there are several, or leave settling_time out"
            )
        return problems

    def prepare(self, grains: Grains) -> None:
        """Give driven grains their velocity and spin."""
        for each in self.items:
            for name in ("velocity", "spin"):
                getattr(grains.arrays, name)[:, list(each.grains)] = np.array(getattr(each, name))[:, None]

    def stages(self, setup: Setup, law: ContactLaw, settings: ContactParameters) -> HookStages:
        """The drive."""
        motion = [[each.velocity, each.spin] for each in self.items for _ in each.grains]
        velocity, spin = np.ascontiguousarray(np.moveaxis(np.array(motion, np.float64), 0, -1))
        index, own = np.array(self.heavy(), np.int64), setup.grains.arrays
        vectors = np.ascontiguousarray(velocity), np.ascontiguousarray(spin)
        driven = DrivenArrays(index, *vectors, own.mass[index], own.inertia[index])
        changes = setup.forces.gas or getattr(setup.forces.contact, "settling_time", None) is not None
        hooks = (*KICKS, *CONTACTS, *CHANGES) if changes else (*KICKS, *CONTACTS)
        return {hook: [(drive, driven)] for hook in hooks}

    def heavy(self) -> list[int]:
        """Indices of all driven grains."""
        return [i for each in self.items for i in each.grains]

    def kept(self, kept: np.ndarray) -> Component:
        """The driven grains that stay in the simulation."""
        now = {int(before): after for after, before in enumerate(kept)}
        left = [(each, [now[i] for i in each.grains if i in now]) for each in self.items]
        return DrivenGrains([replace(each, grains=index) for each, index in left if index])

    def problems_of_motion(self, grains: Grains) -> list[str]:
        """Driven grains with another velocity or spin than the prescribed one."""
        return [
            f"{name} of grain {i} is prescribed by sand.Driven and cannot change"
            for each in self.items
            for name, motion in (("velocity", each.velocity), ("spin", each.spin))
            for i in each.grains
            if tuple(getattr(grains.arrays, name)[:, i]) != tuple(motion)
        ]
