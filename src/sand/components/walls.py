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
from ..basics.box import Box
from ..basics.errors import BadInput, shown
from ..basics.grains import Grains
from ..basics.initial_pairs import most_overlap
from ..basics.material import Material, as_material
from ..basics.ramps import force_at, rampable, ramps_of
from ..basics.settings import RAMP, Direction, Number, Reading, Settings, Vector
from ..basics.state import RECORDED, State
from ..contact.constants_table import constant_names
from ..contact.law import ContactLaw
from ..contact.measure import CONTACT_ROWS, CONTACT_VECTORS
from ..contact.model import Contact
from ..engine.component import Component, Setup
from ..engine.engine import Engine
from ..integrate.hooks import HookStages
from ..integrate.integrator import moves_bodies
from ..integrate.parts import ContactParameters
from ..integrate.stage_list import variant_of
from .wall_arrays import WallArrays, WallContactArrays
from .wall_loops import WallNumbers
from .wall_stages import table_stage, wall_stages

LOST = "lost_walls"
"""Column of the ledger: energy [J] that moving walls took from grains and contacts."""
CONTACTS_OF_ALL = "wall_contacts"
"""Column of the ledger: number of contacts with walls."""
PARALLEL = 1e-9
"""Largest component of n1 + n2 of the normals of two walls that count as parallel and facing each other."""


def _name_of_columns(value: Any, name: str) -> str:
    """Check a name that begins the names of columns; empty for none.  Raises BadInput."""
    if not isinstance(value, str) or (value and not value.isidentifier()):
        raise BadInput(f"{name} = {shown(value)} must be made of letters, digits and '_', such as 'left'")
    return value


@checked
@rampable
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
        Force [N] on a wall with a mass along its normal: above 0 it presses the wall against the grains; or a `Ramp`.
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
    force: Annotated[Any, Number("N"), RAMP] = None
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
    pressure : float
        Force of the grains against the wall, −force · normal, over its area [Pa], positive if they press. The area is
        that of the periodic box across the normal; NaN where the box is open along the wall.
    gap : float
        Distance to the wall opposite [m]; NaN without a parallel wall that faces this one.
    filling : float
        Volume of the grains over that of the gap, gap × area; NaN without both.
    """

    name: str
    position: np.ndarray
    velocity: np.ndarray
    force: np.ndarray
    impulse: np.ndarray
    work: float
    contacts: int
    pressure: float
    gap: float
    filling: float


def read_walls(value: Any) -> tuple[Wall, ...]:
    """Check walls given as a list, or a single wall; unnamed ones get the names wall1, wall2, …  Raises BadInput."""
    if isinstance(value, Wall):
        value = [value]
    if not isinstance(value, (list, tuple)) or not all(isinstance(one, Wall) for one in value):
        raise BadInput(f"walls = {shown(value)}; give a list of sand.Wall(point, normal, material)")
    names = [one.name or f"wall{k}" for k, one in enumerate(value, 1)]
    if repeated := sorted({name for name in names if names.count(name) > 1}):
        raise BadInput(f"walls: two walls have the name '{repeated[0]}'; give each its own")
    return tuple(dataclasses.replace(one, name=name, **ramps_of(one)) for one, name in zip(value, names, strict=True))


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

    def begin(self, engine: Engine) -> None:
        """Set the forces on the walls of the present intervals of their ramps."""
        state = engine.stored_state
        state.of_components["walls"].push[:] = [force_at(wall, state.time).force or 0.0 for wall in self.items]

    def next_time(self, engine: Engine) -> float:
        """Next time [s] at which a ramp changes a force."""
        ramps = [ramp for wall in self.items for ramp in ramps_of(wall).values()]
        return min((ramp.next_change(engine.stored_state.time) for ramp in ramps), default=math.inf)

    def update(self, engine: Engine) -> None:
        """As `begin`."""
        self.begin(engine)

    def problems_of_arrays(self) -> list[str]:
        """As `Component.problems_of_arrays`."""
        return [
            "walls: with walls a change cannot add or remove grains, set or scale the box, or leave out a force; start "
            "a new simulation from a frame"
        ]

    def columns(self) -> list[str]:
        """Force of the grains on each wall [N], its integral over time, position [m]; number of contacts."""
        own = [f"{name}_{axis}" for name in ("force", "impulse") for axis in "xyz"]
        return [*(f"{wall.name}_{key}" for wall in self.items for key in (*own, "position")), CONTACTS_OF_ALL]

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
        values = [float(v) for v in np.vstack([arrays.force, arrays.impulse, along]).T.ravel()]
        found = dict(zip(self.columns(), [*values, int(state.of_components["wall_contacts"].used[0])], strict=True))
        return {LOST: -math.fsum(arrays.work)} | found

    def materials(self) -> list[Material]:
        """Materials of the walls."""
        return [wall.material for wall in self.items]

    def virials(self, state: State) -> np.ndarray:
        """Of contacts with walls, h n_a F_b: from the plane along its normal n to the centre of the grain, at h [m]."""
        arrays, contacts, position = *_arrays_of(state), state.grains.arrays.position
        grain, wall = contacts.pair[:, : contacts.used[0]].astype(np.int64)
        n = arrays.normal[:, wall]
        arm = ((position[:, grain] - arrays.position[:, wall]) * n).sum(axis=0) * n
        found = np.zeros((position.shape[1], 3, 3))
        np.add.at(found, grain, np.einsum("ac,bc->cab", arm, contacts.force[:, : grain.size]))
        return found

    def volume(self, state: State) -> float | None:
        """That between two walls that face each other, in a box that is periodic along them."""
        volumes = [_area(state.box) * gap for gap in _gaps(state.of_components["walls"])]
        return None if len(volumes) != 2 or math.isnan(volumes[0]) else volumes[0]

    def contact_table(self, state: State, law: ContactLaw, table: Any) -> tuple[dict[str, np.ndarray], dict[str, str]]:
        """Columns of the contacts with walls, and their units by name; `table` is that of the stages."""
        rows = [*((name, unit) for name, unit, _ in (*CONTACT_ROWS, *CONTACT_VECTORS))]
        units = {"grain": "", "wall": "", "formed": "s", **dict(rows), "force": "N", "torque": "N m"}
        units |= {f"lost_{name}": "J" for name in RECORDED}
        vectors = {name for name, _, _ in CONTACT_VECTORS} | {"force", "torque"}
        if not self.items:
            return {name: np.zeros((0, 3) if name in vectors else 0) for name in units}, units
        contacts = _arrays_of(state)[1]
        used, scalars = int(contacts.used[0]), len(CONTACT_ROWS)
        out = np.zeros((scalars + 3 * len(CONTACT_VECTORS), used))
        table_stage(law).run(table, (out,))
        found: dict[str, np.ndarray] = dict(zip(("grain", "wall"), contacts.pair[:, :used].copy(), strict=True))
        found |= {"formed": contacts.formed[:used].copy()}
        found |= {name: out[k] for k, (name, _, _) in enumerate(CONTACT_ROWS)}
        for k, (name, _, _) in enumerate(CONTACT_VECTORS):
            found[name] = out[scalars + 3 * k : scalars + 3 * k + 3].T.copy()
        found |= {"force": contacts.force[:, :used].T.copy(), "torque": contacts.torque1[:, :used].T.copy()}
        for k, name in enumerate(RECORDED):
            found[f"lost_{name}"] = contacts.lost[k, :used].copy() if k < len(contacts.lost) else np.zeros(used)
        return found, units


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


def _arrays_of(state: State) -> tuple[WallArrays, WallContactArrays]:
    return state.of_components["walls"], state.of_components["wall_contacts"]


def _area(box: Box) -> float:
    """Area [m²] of a wall across the open axis of a box that is periodic along both others; NaN for other boxes."""
    lengths = [length for length in box.lengths if length is not None]
    return math.prod(lengths) if len(lengths) == 2 else math.nan


def _gaps(walls: WallArrays) -> list[float]:
    """Distance [m] of each wall to the only other one, if this is parallel and faces it; NaN else."""
    normal, position = walls.normal.T, walls.position.T
    if len(normal) != 2 or (np.abs(normal[0] + normal[1]) > PARALLEL).any():
        return [math.nan] * len(normal)
    return [float((position[1] - position[0]) @ normal[0])] * 2


def wall_states(walls: Sequence[Wall], state: State) -> tuple[WallState, ...]:
    """The walls in a state."""
    if not walls:
        return ()
    arrays, contacts = _arrays_of(state)
    on, area, gaps = contacts.pair[1, : contacts.used[0]], _area(state.box), _gaps(arrays)
    solid = 4.0 / 3.0 * math.pi * float((state.grains.arrays.radius**3).sum())
    return tuple(
        WallState(
            wall.name,
            position=arrays.position[:, w].copy(),
            velocity=arrays.velocity[:, w].copy(),
            force=arrays.force[:, w].copy(),
            impulse=arrays.impulse[:, w].copy(),
            work=float(arrays.work[w]),
            contacts=int((on == w).sum()),
            pressure=-float(arrays.force[:, w] @ arrays.normal[:, w]) / area,
            gap=gaps[w],
            filling=solid / (area * gaps[w]),
        )
        for w, wall in enumerate(walls)
    )
