"""Changes by the user between two runs: velocities, spins, moments and charges of grains, and parameters of forces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import BadInput, ErrorCollector, did_you_mean
from ..forces.base import Force
from ..grains import Grains
from ..integrate.step_control import INCREASE_INTERVAL
from ..numerics.quaternion import turned_back
from ..schema import BY_NAME, stored
from ..state.state import CHECKED, FLIGHT, NEEDED, STEP_INCREASES, STEPS, State
from .settings import read_forces

QUANTITIES = ("velocity", "spin", "moment", "charge")
"""Quantities of the grains that can be changed."""


class Change:
    """What can be changed between two runs; see `Simulation.change`.

    Attributes
    ----------
    velocity, spin, moment : ndarray
        (N, 3) [m/s, rad/s, A m²] in the laboratory frame, to be changed in place or assigned.
    charge : ndarray
        (N,) [C].
    forces : tuple[Force, ...]
        The forces; `replace` exchanges one.
    """

    def __init__(self, grains: Grains, forces: Sequence[Force]):
        self.velocity, self.spin = grains.velocity.copy(), grains.spin.copy()
        self.moment, self.charge = grains.moment.copy(), grains.charge.copy()
        self.forces = tuple(forces)

    def __setattr__(self, name: str, value: Any) -> None:
        """Assign a quantity.  Raises BadInput for other names."""
        if name not in (*QUANTITIES, "forces"):
            raise BadInput(f"a change has no '{name}'; {did_you_mean(name, (*QUANTITIES, 'forces'))}")
        object.__setattr__(self, name, value)

    def replace(self, force: Force) -> None:
        """Exchange the force of the same kind, such as `sand.Field("0 T")` for the present field.

        Raises
        ------
        BadInput
            If the simulation has no force of this kind.
        """
        (given,) = read_forces(force)
        names = [own.name for own in self.forces]
        if given.name not in names:
            raise BadInput(f"forces: the simulation has no '{given.name}'; {did_you_mean(given.name, names)}")
        self.forces = tuple(given if own.name == given.name else own for own in self.forces)

    def checked_forces(self, present: Sequence[Force]) -> tuple[Force, ...]:
        """The forces of the change.

        Raises
        ------
        BadInput
            If their kinds are not those of the simulation, which the columns of its ledger name, or if the contact
            model differs: existing contacts were formed with the present one.
        """
        forces = read_forces(self.forces)
        if {force.name for force in forces} != {force.name for force in present}:
            names = ", ".join(force.name for force in present)
            raise BadInput(f"forces: a change keeps the kinds of forces, {names}, and alters parameters only")
        before = {force.name: force for force in present}
        for force in forces:
            if force.name == "contact" and force.parameters() != before["contact"].parameters():
                raise BadInput("forces: the contact model cannot change; start a new simulation from a frame")
        return forces

    def arrays(self, state: State) -> dict[str, np.ndarray]:
        """The arrays of a checkpoint of this state, with the changed quantities.

        Raises
        ------
        BadInput
            If a quantity has another shape, or is out of range.
        """
        grains, errors = state.grains, ErrorCollector()
        out = {name: array.copy() for name, array in state.to_arrays().items()}
        for name in QUANTITIES:
            column = BY_NAME["body_moment" if name == "moment" else name]
            values = errors.take(stored, column, getattr(self, name), len(grains), called=name)
            if values is None:
                continue
            changed = np.atleast_2d(values != getattr(grains.arrays, name)).any(axis=0)
            out[f"grains/{name}"][..., changed] = values[..., changed]
            if name == "moment":
                for i in np.flatnonzero(changed):
                    turned = turned_back(tuple(grains.arrays.orientation[:, i]), tuple(values[:, i]))
                    out["grains/body_moment"][:, i] = turned
        errors.done()
        count, clock = out["count"], out["clock"]
        # the next step is chosen anew, as after a start
        count[CHECKED] = count[STEP_INCREASES] = count[NEEDED] = count[STEPS] - INCREASE_INTERVAL
        clock[FLIGHT] = 0.0
        return out
