"""Walls: planes to which grains stick, at rest, moving with a given velocity, or with a mass and a given force."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from ..basics.arguments import checked
from ..basics.arrays import empty_contact_arrays, wall_arrays
from ..basics.box import Box
from ..basics.grains import Grains
from ..basics.material import Material, as_material
from ..basics.ramps import ramps_of
from ..basics.settings import Direction, Number, Reading, Settings, Vector
from ..basics.state import WALL_CONTACTS, State
from ..contact.constants_table import constant_names
from ..contact.model import Contact
from ..contact.wall_loops import WallNumbers
from ..errors import BadInput, shown
from ..integrate.integrator import Integrator
from ..setup.checks import most_overlap


def _name_of_columns(value: Any, name: str) -> str:
    """Check a name that begins the names of columns; empty for none.  Raises BadInput."""
    if not isinstance(value, str) or (value and not value.isidentifier()):
        raise BadInput(f"{name} = {shown(value)} must be made of letters, digits and '_', such as 'left'")
    return value


@checked
@dataclass(frozen=True)
class Wall(Settings):
    """A plane wall to which grains stick, by the contact law of `sand.Contact` in the limit of an infinite sphere.

    Parameters
    ----------
    point : sequence
        A point of the plane at the start, three components [m].
    normal : sequence
        Direction from the wall to the grains, three components, of any length above 0.
    material : Material or str
        Material, or the name of a preset.
    velocity : sequence, optional
        Velocity, three components [m/s]; (0, 0, 0) by default. The components along the plane are always constant; that
        along the normal is constant for a wall without a mass, and otherwise the velocity at the start.
    mass : float or str, optional
        Mass [kg] > 0 of a wall that moves along its normal by Newton's law, under the forces of the grains and `force`.
        By default the motion of the wall is given by `velocity`.
    force : float or str, optional
        Force [N] on a wall with a mass along its normal: above 0 it presses the wall against the grains.
    name : str, optional
        Name in the ledger's columns, made of letters, digits and "_"; "wall1", "wall2", … by default.

    Raises
    ------
    BadInput
        If a number is out of range; one line for each.
    """

    point: Annotated[Any, Vector("m")]
    normal: Annotated[Any, Direction("that from the wall to the grains", unit_length=True)]
    material: Annotated[Any, Reading(as_material, write=lambda material: material.name)]
    velocity: Annotated[Any, Vector("m/s")] = (0.0, 0.0, 0.0)
    mass: Annotated[Any, Number("kg", above=0.0)] = None
    force: Annotated[Any, Number("N")] = None
    name: Annotated[str, Reading(_name_of_columns, write=lambda name: name or None)] = ""

    place: ClassVar[str] = "wall"

    def contradictions(self, wrong: Set[str]) -> Iterator[str]:
        """A force without a mass."""
        if self.force is not None and self.mass is None:
            yield "force is given without a mass; give the mass of the wall, such as '1e-15 kg'"


@dataclass(frozen=True)
class WallState:
    """A wall at the present time.

    Attributes
    ----------
    name : str
        Name.
    position : ndarray
        (3,) the point of the plane that was `Wall.point` at the start [m].
    velocity : ndarray
        (3,) [m/s].
    force : ndarray
        (3,) force of the grains on the wall [N].
    impulse : ndarray
        (3,) its integral over time since the start [N s].
    work : float
        Energy [J] that the wall has given to grains and contacts by its motion since the start.
    contacts : int
        Number of contacts.
    """

    name: str
    position: np.ndarray
    velocity: np.ndarray
    force: np.ndarray
    impulse: np.ndarray
    work: float
    contacts: int


def read_walls(value: Any) -> tuple[Wall, ...]:
    """Check walls given as a list, or a single wall; unnamed ones get the names wall1, wall2, …  Raises BadInput."""
    if isinstance(value, Wall):
        value = [value]
    if not isinstance(value, (list, tuple)) or not all(isinstance(one, Wall) for one in value):
        raise BadInput(f"walls = {shown(value)}; give a list of sand.Wall(point, normal, material)")
    names = [one.name or f"wall{k}" for k, one in enumerate(value, 1)]
    if repeated := sorted({name for name in names if names.count(name) > 1}):
        raise BadInput(f"walls: two walls have the name '{repeated[0]}'; give each its own")
    return tuple(dataclasses.replace(one, name=name) for one, name in zip(value, names, strict=True))


def check_walls(
    walls: Sequence[Wall], grains: Grains, contact: Contact | None, box: Box, stepping: Integrator, *, fresh: bool
) -> None:
    """Check that walls, grains, contact model, box and integrator fit together.

    Raises
    ------
    BadInput
        With all problems.
    """
    problems: list[str] = []
    if walls and contact is None:
        problems.append("walls: there is no sand.Contact() among the forces, by which grains stick to walls; add it")
    if walls and ramps_of(contact):
        problems.append("walls: ramps of sand.Contact do not reach contacts with walls; give constant values")
    if walls and stepping.flight is not None:
        problems.append(f"walls: {type(stepping).__name__} does not know walls; use stepping=sand.Verlet()")
    for wall in walls:
        problems += _material_problems(wall, grains, contact)
        axes = [axis for axis, v, length in zip("xyz", wall.normal, box.lengths, strict=True) if v and length]
        if axes:
            problems.append(
                f"walls: the normal of '{wall.name}' has a component along {axes[0]}, along which the box is periodic; "
                "open this axis, or give another normal"
            )
        elif fresh and contact is not None and wall.material.surface_energy is not None:
            problems += _grain_problems(wall, grains, contact)
    if problems:
        raise BadInput(problems)


def _material_problems(wall: Wall, grains: Grains, contact: Contact | None) -> list[str]:
    material: Material = wall.material
    problems = []
    if material.surface_energy is None:
        problems.append(
            f"walls: material '{material.name}' of '{wall.name}' has no surface energy; give one, 0 for none: "
            f'{material.name} with surface_energy = "… J/m^2"'
        )
    if contact is not None and contact.damping == "viscoelastic" and not material.poisson_ratio > 0.0:
        problems.append(
            f"walls: material '{material.name}' has poisson_ratio {material.poisson_ratio:g}: viscoelastic damping "
            "needs one above 0"
        )
    if any(own.name == material.name and own != material for own in grains.materials):
        problems.append(
            f"walls: material '{material.name}' of '{wall.name}' differs from that of the grains with this name; "
            "give one of them another name"
        )
    return problems


def _grain_problems(wall: Wall, grains: Grains, contact: Contact) -> list[str]:
    """Grains behind a wall at the start, or cut by it."""
    overlap = grains.radius - (grains.position - np.array(wall.point)) @ np.array(wall.normal)
    rest = np.zeros(len(grains))
    for k in np.flatnonzero(overlap > 0.0):
        pairing = contact.pairing(grains.materials[grains.material[k]], wall.material)
        normal_mode = contact.contact_law.normal_mode
        rest[k] = normal_mode(pairing.surface_energy, pairing.modulus, float(grains.radius[k])).rest_overlap
    most = most_overlap(rest, grains.radius)
    wrong = np.flatnonzero(overlap > most)
    if not len(wrong):
        return []
    k = wrong[np.argmax(overlap[wrong] / grains.radius[wrong])]
    others = f" and {len(wrong) - 1} more" if len(wrong) > 1 else ""
    if overlap[k] > grains.radius[k]:
        return [
            f"walls: grain {k}{others} lies behind wall '{wall.name}', {overlap[k] - grains.radius[k]:.3g} m from its "
            "plane; the normal must point to the grains"
        ]
    return [
        f"walls: wall '{wall.name}' cuts grain {k}{others}: they overlap by {overlap[k]:.3g} m at the start; at most "
        f"{most[k]:.3g} m is allowed: move the wall or the grains"
    ]


def wall_numbers(walls: Sequence[Wall], grains: Grains, contact: Contact | None) -> WallNumbers | None:
    """Constant numbers of the walls for their stages; None without walls."""
    if not walls or contact is None:
        return None
    table = [[contact.pairing(material, wall.material) for wall in walls] for material in grains.materials]
    return WallNumbers(
        np.ascontiguousarray(np.moveaxis(np.array(table, dtype=np.float64), -1, 0)),
        np.array([math.inf if wall.mass is None else wall.mass for wall in walls]),
        np.array([wall.force or 0.0 for wall in walls]),
    )


def place_walls(state: State, walls: Sequence[Wall], law: Any, channels: int, *, damped: bool) -> None:
    """Give a new state its walls, and memory for their contacts; `channels` is the number of losses per contact."""
    if not walls:
        return
    arrays = wall_arrays(len(walls), len(state.grains))
    arrays.position[...] = np.array([wall.point for wall in walls]).T
    arrays.normal[...] = np.array([wall.normal for wall in walls]).T
    arrays.velocity[...] = np.array([wall.velocity for wall in walls]).T
    state.walls = arrays
    state.wall_contacts = empty_contact_arrays(0, 0, len(constant_names(law)), channels=channels, damped=damped)
    state.__post_init__()  # aligns the arrays


def wall_states(walls: Sequence[Wall], state: State) -> tuple[WallState, ...]:
    """The walls in a state."""
    arrays, on = state.walls, state.wall_contacts.pair[1, : state.count[WALL_CONTACTS]]
    return tuple(
        WallState(
            wall.name,
            position=arrays.position[:, w].copy(),
            velocity=arrays.velocity[:, w].copy(),
            force=arrays.force[:, w].copy(),
            impulse=arrays.impulse[:, w].copy(),
            work=float(arrays.work[w]),
            contacts=int((on == w).sum()),
        )
        for w, wall in enumerate(walls)
    )


def wall_columns(walls: Sequence[Wall]) -> list[str]:
    """Columns of the ledger: force of the grains on each wall [N], position along its normal [m], contacts."""
    own = ("force_x", "force_y", "force_z", "position")
    return [*(f"{wall.name}_{key}" for wall in walls for key in own), *(["wall_contacts"] if walls else [])]


def wall_row(state: State, columns: Sequence[str]) -> dict[str, float]:
    """Values of `columns`, those of `wall_columns`, in a state; empty without walls."""
    if not columns:
        return {}
    arrays = state.walls
    along = (arrays.position * arrays.normal).sum(axis=0)
    values = [float(v) for v in np.vstack([arrays.force, along]).T.ravel()]
    return dict(zip(columns, [*values, int(state.count[WALL_CONTACTS])], strict=True))
