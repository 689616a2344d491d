"""Grains whose motion the user prescribes: `sand.Driven`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np

from ..basics.arguments import checked
from ..basics.grains import Grains
from ..basics.settings import Settings, Vector, Wholes
from ..contact.model import Contact
from ..errors import BadInput, shown
from ..forces.base import Force
from ..integrate.driven import DrivenArrays
from ..integrate.integrator import Integrator
from ..neighbours.search import Neighbours

AT_REST = (0.0, 0.0, 0.0)


@checked
@dataclass(frozen=True)
class Driven(Settings):
    """Grains with prescribed velocity and spin, by default held at rest.

    Their contacts and all forces on other grains act as usual; loads on them do not change their motion, as if mass and
    moment of inertia were infinite. The work of the drive is recorded in `lost_outside`.

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

    grains: Annotated[Sequence[int], Wholes(0, "indices of grains, such as [0, 1]")]
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


def check_driven(
    driven: Sequence[Driven], grains: Grains, forces: Sequence[Force], stepping: Integrator, neighbours: Neighbours
) -> None:
    """Check that driven grains fit the simulation.  Raises BadInput with all problems."""
    if not driven:
        return
    index = [i for each in driven for i in each.grains]
    problems = [
        f"driven: there is no grain {i}; indices of the {len(grains)} grains are 0 … {len(grains) - 1}"
        for i in sorted(set(index))
        if i >= len(grains)
    ]
    problems += [
        f"driven: grain {i} is given more than once; keep one" for i in sorted(set(index)) if index.count(i) > 1
    ]
    if len(set(index)) >= len(grains) and not problems:
        problems.append(f"driven: all {len(grains)} grains are driven; leave at least one free")
    if stepping.flight is not None:
        problems.append(f"driven: stepping = '{stepping.name}' cannot drive grains; use sand.Verlet()")
    if neighbours.order == "curve":
        problems.append("driven: neighbours order = 'curve' cannot drive grains; use order = 'as given'")
    if any(isinstance(force, Contact) and force.settling_time is not None for force in forces):
        problems.append("driven: contact settling_time acts on whole clusters and cannot be used; remove it")
    if problems:
        raise BadInput(problems)


def kept_driven(driven: Sequence[Driven], kept: np.ndarray) -> tuple[Driven, ...]:
    """The driven grains that stay in the simulation; `kept` (K,) are the earlier indices of grains 0 … K − 1."""
    now = {int(before): after for after, before in enumerate(kept)}
    left = [(each, [now[i] for i in each.grains if i in now]) for each in driven]
    return tuple(replace(each, grains=index) for each, index in left if index)


def refuse_changed_motion(driven: Sequence[Driven], grains: Grains) -> None:
    """Raise BadInput if driven grains have another velocity or spin than the prescribed one."""
    problems = [
        f"{name} of grain {i} is prescribed by sand.Driven and cannot change"
        for each in driven
        for name, motion in (("velocity", each.velocity), ("spin", each.spin))
        for i in each.grains
        if tuple(getattr(grains.arrays, name)[:, i]) != tuple(motion)
    ]
    if problems:
        raise BadInput(problems)


def driven_arrays(driven: Sequence[Driven], grains: Grains) -> DrivenArrays | None:
    """Arrays of the driven grains; None without any."""
    if not driven:
        return None
    motion = [[each.velocity, each.spin] for each in driven for _ in each.grains]
    velocity, spin = np.ascontiguousarray(np.moveaxis(np.array(motion, np.float64), 0, -1))
    index = np.array([i for each in driven for i in each.grains], np.int64)
    own = grains.arrays
    vectors = np.ascontiguousarray(velocity), np.ascontiguousarray(spin)
    return DrivenArrays(index, *vectors, own.mass[index], own.inertia[index])
