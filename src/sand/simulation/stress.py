"""The stress of a packing of grains, from the forces in it: `Simulation.stress`, and its columns in the ledger."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..basics.errors import BadInput
from ..basics.units import format_quantity, si
from ..contact.virial import measure_virial
from ..engine.engine import Engine
from ..engine.measures import pair_virials, refuse_forces_without_virial
from .contact_table import measured_columns

PLACES = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "yz": (1, 2), "xz": (0, 2), "xy": (0, 1)}
"""Elements of the symmetric part of a tensor, in the order of their columns."""
PRESSURES = ("pressure", *(f"pressure_{axes}" for axes in PLACES), "pressure_asymmetry")
"""Columns of the stress in the ledger [Pa]."""


@dataclass(frozen=True, repr=False)
class Stress:
    """The pressure tensor of a simulation at one time, positive in compression; the Cauchy stress is its negative.

    P_ab is the force along b per area of a face with the normal along a. Tensors of the parts add up to `total`.

    Attributes
    ----------
    total : ndarray
        (3, 3) pressure tensor P [Pa].
    parts : dict[str, ndarray]
        (3, 3) [Pa] of `contacts`, `kinetic`, `walls`, and of each long-range force by its column of the ledger.
    volume : float
        Volume V [m³] to which it refers.
    couple : ndarray
        (3, 3) couple stress of the contacts [N/m]: the couple along b per area of a face with the normal along a.
    """

    total: np.ndarray
    parts: dict[str, np.ndarray]
    volume: float
    couple: np.ndarray

    @property
    def pressure(self) -> float:
        """Pressure, a third of the trace of P [Pa]."""
        return float(self.total.trace()) / 3.0

    @property
    def asymmetry(self) -> np.ndarray:
        """(3,) P_yz − P_zy, P_zx − P_xz, P_xy − P_yx [Pa]: minus the torques of contacts and pair forces, over V.

        Of contacts with walls it is the torque of the force alone, without the couple. At rest it vanishes, unless
        fields, couples of walls or the drive of grains balance it.
        """
        p = self.total
        return np.array([p[1, 2] - p[2, 1], p[2, 0] - p[0, 2], p[0, 1] - p[1, 0]])

    def row(self) -> dict[str, float]:
        """Columns of the ledger [Pa]: pressure, elements of the symmetric part of P, and the size of its asymmetry."""
        values = [0.5 * (self.total[a, b] + self.total[b, a]) for a, b in PLACES.values()]
        numbers = (self.pressure, *map(float, values), float(np.linalg.norm(self.asymmetry)))
        return dict(zip(PRESSURES, numbers, strict=True))

    def __repr__(self) -> str:
        diagonal = ", ".join(f"{axis}{axis} {format_quantity(self.total[a, a], 'Pa')}" for a, axis in enumerate("xyz"))
        parts = ", ".join(self.parts)
        return f"<pressure {format_quantity(self.pressure, 'Pa')} ({diagonal}) in {self.volume:.4g} m^3: {parts}>"


def volume_of(engine: Engine, given: Any = None) -> float:
    """Volume [m³] to which a stress refers: the given one, or that of the periodic box, or between two walls.

    Raises
    ------
    BadInput
        If there is none, or the given one is not positive.
    """
    if given is not None:
        return si(given, "m^3", "volume", above=0.0)
    state = engine.state
    if math.isfinite(state.box.volume):
        return state.box.volume
    bounded = (each.volume(state) for each in engine.components)
    if (found := next((volume for volume in bounded if volume is not None), None)) is not None:
        return found
    raise BadInput(
        f"stress: the box is {state.box.describe()}, without two walls that face each other across its open axis; give "
        "the volume of the body, such as sim.stress(volume='1 um^3')"
    )


def check_stress_rows(engine: Engine) -> None:
    """Raise BadInput if rows of the ledger cannot have the stress."""
    try:
        volume_of(engine)
    except BadInput:
        raise BadInput(
            f"stress: rows of the ledger need the volume, and the box is {engine.state.box.describe()}; use a box that "
            "is periodic along x, y and z, or two walls across its only open axis, or leave stress out"
        ) from None
    refuse_forces_without_virial(engine)


def contact_virials(engine: Engine) -> tuple[np.ndarray, np.ndarray]:
    """Virial Σ l_a f_b [J] of the contacts of grains, and Σ l_a C_b [N m²] of their couples, (3, 3) each.

    C = M1 − (x_c − x1) × f is the couple about the point that divides the distance of the centres as the radii.  For
    contacts in clusters at rest the engine has no loads at the present time; see `GrainSteps.virial_at_rest`.
    """
    state, out = engine.state, np.zeros(9)
    if not engine.parameters.settings.on:
        return np.zeros((3, 3)), np.zeros((3, 3))
    table = engine.table_of(state)
    columns, grains = measured_columns(state, engine.law, table), state.grains
    pair, force = columns["pair"].astype(np.int64), np.array(columns["force"].T)
    at_rest = engine.stepper.virial_at_rest(engine)
    if state.at_rest is not None:
        force[:, state.at_rest[pair[:, 0]]] = 0.0
    measure_virial.run(table, (force, out))
    separation = state.box.nearest(grains.position[pair[:, 0]] - grains.position[pair[:, 1]])
    first, second = grains.radius[pair].T
    arm = -separation * (first / (first + second))[:, None]
    couple = separation.T @ (columns["torque1"] - np.cross(arm, columns["force"]))
    return out.reshape(3, 3) + at_rest, couple


def stress_of(engine: Engine, volume: float | None = None) -> Stress:
    """The stress of the state of an engine, see `Simulation.stress`.  Raises BadInput."""
    size, state = volume_of(engine, volume), engine.state
    contacts, couple = contact_virials(engine)
    others = ((each.name, each.virials(state)) for each in engine.components)
    bounds = {name: virials.sum(axis=0) for name, virials in others if virials is not None}
    mass, velocity = state.grains.arrays.mass, state.grains.arrays.velocity
    if not bounds:  # nothing else is at rest along open axes
        is_open = np.array([length is None for length in state.box.lengths])
        velocity = velocity - (is_open * (velocity @ mass) / mass.sum())[:, None]
    parts = {"contacts": contacts, "kinetic": (mass * velocity) @ velocity.T, **bounds, **pair_virials(engine)}
    parts = {name: virial / size for name, virial in parts.items()}
    return Stress(np.sum(list(parts.values()), axis=0), parts, size, couple / size)
