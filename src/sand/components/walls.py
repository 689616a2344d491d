"""Walls: planes to which grains stick, at rest, moving with a given velocity, or with a mass and a given force.

Their energies reach the ledger in two ways: what their contacts store is added to the columns of contacts (`normal`, …)
by a stage of `Hook.ENERGIES`, and what moving walls took from grains and contacts is `lost_walls`, in `Walls.row`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from ..basics.arguments import checked
from ..basics.errors import BadInput, shown
from ..basics.grains import Grains
from ..basics.initial_pairs import most_overlap
from ..basics.material import Material, as_material
from ..basics.ramps import ramps_of
from ..basics.settings import Direction, Number, Reading, Settings, Vector
from ..basics.state import State
from ..contact.constants_table import constant_names
from ..contact.law import ContactLaw
from ..contact.model import Contact
from ..engine.component import Component, Setup
from ..integrate.hooks import HookStages
from ..integrate.integrator import moves_bodies
from ..integrate.parts import ContactParameters
from ..integrate.stage_list import variant_of
from .wall_arrays import WallArrays, WallContactArrays
from .wall_loops import WallNumbers
from .wall_stages import wall_stages

LOST = "lost_walls"
"""Column of the ledger: energy [J] that moving walls took from grains and contacts."""
CONTACTS_OF_ALL = "wall_contacts"
"""Column of the ledger: number of contacts with walls."""


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


class Walls(Component):
    """Walls to which grains stick (`Wall`)."""

    name = "walls"
    noun = "walls"
    holds = in_parts = True
    groups: ClassVar = {"walls": WallArrays, "wall_contacts": WallContactArrays}

    def problems(self, setup: Setup) -> list[str]:
        """As `Component.problems`."""
        problems: list[str] = []
        contact, stepping = setup.forces.contact, setup.stepping
        if contact is None:
            problems.append(
                "walls: there is no sand.Contact() among the forces, by which grains stick to walls; add it"
            )
        if ramps_of(contact):
            problems.append("walls: ramps of sand.Contact do not reach contacts with walls; give constant values")
        if stepping.flight is not None:
            problems.append(f"walls: sand.{type(stepping).__name__} does not know walls; use stepping=sand.Verlet()")
        for wall in self.items:
            problems += _material_problems(wall, setup.grains, contact)
            lengths, materials = setup.box.lengths, (wall.material, *setup.grains.materials)
            axes = [axis for axis, v, length in zip("xyz", wall.normal, lengths, strict=True) if v and length]
            if axes:
                problems.append(
                    f"walls: the normal of '{wall.name}' has a component along {axes[0]}, along which the box is "
                    "periodic; open this axis, or give another normal"
                )
            elif setup.fresh and contact is not None and all(m.surface_energy is not None for m in materials):
                problems += _grain_problems(wall, setup.grains, contact)
        return problems

    def stages(self, setup: Setup, law: ContactLaw, settings: ContactParameters) -> HookStages:
        """Contacts, loads, the limit of the step, and the work of a bath."""
        contact = setup.forces.contact
        assert contact is not None
        table = [
            [contact.pairing(material, wall.material) for wall in self.items] for material in setup.grains.materials
        ]
        numbers = WallNumbers(
            np.ascontiguousarray(np.moveaxis(np.array(table, dtype=np.float64), -1, 0)),
            np.array([math.inf if wall.mass is None else wall.mass for wall in self.items]),
            np.array([wall.force or 0.0 for wall in self.items]),
        )
        return wall_stages(law, variant_of(settings), numbers, moves_bodies=moves_bodies(setup.stepping))

    def add_arrays(self, state: State, law: ContactLaw, settings: ContactParameters) -> None:
        """Give a new state its walls, and memory for their contacts."""
        sizes = {"walls": len(self.items), "constants": len(constant_names(law))}
        columns = {} if settings.damped else {"damping": 0}
        state.add_groups(self.groups, sizes | {"channels": len(state.contacts.lost)}, columns)
        for name in ("position", "normal", "velocity"):
            given = [getattr(wall, "point" if name == "position" else name) for wall in self.items]
            getattr(state.of_components["walls"], name)[...] = np.array(given).T

    def problems_of_arrays(self) -> list[str]:
        """As `Component.problems_of_arrays`."""
        return [
            "walls: with walls a change cannot add or remove grains, set or scale the box, or leave out a force; start "
            "a new simulation from a frame"
        ]

    def columns(self) -> list[str]:
        """Force of the grains on each wall [N], position along its normal [m]; number of contacts."""
        own = ("force_x", "force_y", "force_z", "position")
        return [*(f"{wall.name}_{key}" for wall in self.items for key in own), CONTACTS_OF_ALL]

    def whole(self) -> list[str]:
        """Numbers of contacts."""
        return [CONTACTS_OF_ALL]

    def losses(self) -> list[str]:
        """The energy that moving walls took from grains and contacts."""
        return [LOST]

    def row(self, state: State) -> dict[str, float]:
        """As `Component.row`."""
        arrays = state.of_components["walls"]
        along = (arrays.position * arrays.normal).sum(axis=0)
        values = [float(v) for v in np.vstack([arrays.force, along]).T.ravel()]
        found = dict(zip(self.columns(), [*values, int(state.of_components["wall_contacts"].used[0])], strict=True))
        return {LOST: -math.fsum(arrays.work)} | found

    def materials(self) -> list[Material]:
        """Materials of the walls."""
        return [wall.material for wall in self.items]


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


def wall_states(walls: Sequence[Wall], state: State) -> tuple[WallState, ...]:
    """The walls in a state."""
    if not walls:
        return ()
    arrays, contacts = state.of_components["walls"], state.of_components["wall_contacts"]
    on = contacts.pair[1, : contacts.used[0]]
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
