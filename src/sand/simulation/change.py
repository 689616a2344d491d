"""Changes by the user: grains, their velocities, spins, moments and charges, the box, and forces."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..analysis.clusters import unwrapped
from ..basics.box import Box, as_box
from ..basics.errors import BadInput, ErrorCollector, NoSuchAttribute, did_you_mean, shown
from ..basics.grains import Grains
from ..basics.initial_pairs import at_same_place
from ..basics.own_quantities import own_values
from ..basics.quantity_array import QuantityArray
from ..basics.schema import BY_NAME, CHANGEABLE, stored
from ..basics.units import has_unit_within, si
from ..components.deformation import read_deformation
from ..contact.model import Contact
from ..engine.changed_state import joined, refuse_cut_contacts, scaled_positions, subset
from ..engine.initial_contacts import overlapping_pairs, refuse_overlaps
from ..engine.input_checks import outside_box
from ..forces.base import Force
from ..numerics.quaternion import turned_back
from .settings import read_forces

QUANTITIES = CHANGEABLE
"""Quantities of the grains that can be changed."""
ASSIGNED = (*QUANTITIES, "forces", "box", "deformation")
"""Attributes of a change that can be assigned."""
MOST_ID = 2**32 - 1
"""Largest identity of a grain."""


class Change:
    """What can be changed between two runs, or by an updater; see `Simulation.change`.

    `remove` and `add` act at once: the arrays then have the rows of the grains that stay, in their order, followed by
    those of the grains added.

    Attributes
    ----------
    velocity, spin, moment : ndarray
        (N, 3) [m/s, rad/s, A m²] in the laboratory frame, to be changed in place or assigned; text and quantities with
        a unit are converted.
    charge : ndarray
        (N,) [C].
    own : dict of ndarray
        Own quantities (N,) by name, in their units of SI, also as attributes: `change.temperature`.
    forces : tuple[Force, ...]
        The forces; `replace` exchanges one, and one that is left out acts no longer.
    box : Box
        The box; an assigned one (a `sand.Box`, or lengths) leaves all positions as they are.
    deformation : Deformation or None
        How the box is deformed, to be assigned; None in a simulation that had no deformation at its start.
    grains : Grains
        The grains, to be read: `position`, `radius`, …
    id : ndarray
        (N,) uint32: identity of each grain, its index at the start or the next number that no grain has had.
    kept : ndarray
        (K,) indices, before the change, of the grains that stay.
    """

    velocity: np.ndarray
    spin: np.ndarray
    moment: np.ndarray
    charge: np.ndarray
    own: dict[str, Any]
    forces: tuple[Force, ...]
    box: Box
    deformation: Any
    grains: Grains
    kept: np.ndarray
    _before: tuple[Grains, Box, tuple[Force, ...], Any]
    _pair: np.ndarray  # contacts (C, 2) before
    _next_id: int
    _errors: ErrorCollector  # of `remove` and `add`
    _is_scaled: bool

    def __init__(
        self,
        grains: Grains,
        forces: Sequence[Force],
        box: Box,
        pair: np.ndarray,
        next_id: int,
        deformation: Any = None,
    ):
        fixed: dict[str, Any] = {
            "grains": grains.copy(),
            "_before": (grains, box, tuple(forces), deformation),
            "kept": np.arange(len(grains)),
            "_pair": pair,
        }
        fixed |= {"_next_id": next_id, "_errors": ErrorCollector(), "_is_scaled": False}
        fixed["own"] = {name: values.copy() for name, values in grains.own.items()}
        for name, value in fixed.items():
            object.__setattr__(self, name, value)
        for name in QUANTITIES:
            setattr(self, name, getattr(grains, name))
        self.forces, self.box, self.deformation = tuple(forces), box, deformation

    def __setattr__(self, name: str, value: Any) -> None:
        """Assign a quantity, the forces or the box.  Raises BadInput for another name or an invalid box."""
        if name in self.grains.own_units:
            self.own[name] = value
            return
        if name not in ASSIGNED:
            known = (*ASSIGNED, *self.grains.own_units)
            raise BadInput(f"a change has no '{name}' to assign; {did_you_mean(name, known)}")
        if name == "box":
            value = as_box(value)
        elif name == "deformation":
            value = self._checked_deformation(value)
        elif name in QUANTITIES:
            value = QuantityArray(value, BY_NAME[name].unit, name)
        object.__setattr__(self, name, value)

    def __getattr__(self, name: str) -> Any:
        """Values of an own quantity."""
        own = self.__dict__.get("own", {})
        if name not in own:
            raise NoSuchAttribute(f"a change has no '{name}'; {did_you_mean(name, (*ASSIGNED, 'grains', 'id', *own))}")
        return own[name]

    def _checked_deformation(self, value: Any) -> Any:
        """A deformation in place of that before.  Raises BadInput."""
        if (value is None) != (self._before[3] is None):
            columns = "the ledger has the columns of its start: with those of a deformation or without"
            raise BadInput(f"deformation: {columns}; for a box at rest give sand.Deformation(0)")
        return next(iter(read_deformation(value)), None)

    @property
    def id(self) -> np.ndarray:
        """Identity (N,) of each grain."""
        return self.grains.id

    @property
    def regroups(self) -> bool:
        """Whether grains are added or removed, or the box is another one."""
        same = np.array_equal(self.grains.id, self._before[0].id)
        return not same or self._is_scaled or self.box != self._before[1]

    @property
    def is_of_own(self) -> bool:
        """Whether nothing but own quantities can be different, so that the motion is as without the change."""
        before, _, forces, deformation = self._before
        same = all(np.array_equal(np.asarray(getattr(self, name)), getattr(before, name)) for name in QUANTITIES)
        kept = len(self.forces) == len(forces) and all(a is b for a, b in zip(self.forces, forces, strict=True))
        kept = kept and self.deformation is deformation
        return bool(before.own_units) and same and kept and not self.regroups and not self._errors.problems

    def remove(self, which: Any) -> None:
        """Remove grains, with their contacts.

        Parameters
        ----------
        which : array_like of int or bool
            Indices of grains, or (N,) True for those to be removed, such as `np.isin(state.id, [3, 5])`.

        Raises
        ------
        BadInput
            At the end of the change, if there is no such grain, or no grain would remain.
        """
        count, given = len(self.grains), np.zeros(1)  # in place of values that are no array, refused below
        if not has_unit_within(which):
            with contextlib.suppress(TypeError, ValueError, OverflowError, RecursionError):
                given = np.atleast_1d(np.asarray(which))
        if given.size == 0:
            return
        if given.dtype == bool and given.shape != (count,):
            self._errors.problems.append(f"remove: array of shape {given.shape}, but there are {count} grains")
            return
        if given.dtype != bool and (given.ndim != 1 or given.dtype.kind not in "iu"):
            self._errors.problems.append(f"remove: {shown(which)} must be whole numbers, or True and False")
            return
        if given.dtype != bool and len(wrong := given[(given < 0) | (given >= count)]):
            self._errors.problems.append(f"remove: there is no grain {wrong[0]}; there are {count}, 0 to {count - 1}")
            return
        stays = np.ones(count, bool)
        stays[given] = False
        if not stays.any():
            self._errors.problems.append(f"remove: all {count} grains would be removed; at least one must stay")
            return
        rows = np.flatnonzero(stays)
        self._read_own()
        self._set_grains(subset(self.grains, rows), lambda values: values[rows] if len(values) == count else values)
        object.__setattr__(self, "kept", self.kept[stays[: len(self.kept)]])

    def add(self, grains: Grains) -> None:
        """Add grains, such as those of `sand.setup`; they may touch others, and have contacts then, without strain.

        Parameters
        ----------
        grains : Grains
            The grains, also of materials that no grain had before.

        Raises
        ------
        BadInput
            At the end of the change, if a grain lies outside the box, or overlaps another one by more than at a start.
        """
        if not isinstance(grains, Grains):
            self._errors.problems.append(f"add: {shown(grains)} must be sand.Grains")
            return
        if self._next_id + len(grains) > MOST_ID:
            self._errors.problems.append(f"add: a simulation can have at most {MOST_ID} grains in all")
            return
        identity = np.arange(self._next_id, self._next_id + len(grains), dtype=np.uint32)
        self._read_own()
        together = self._errors.take(joined, self.grains, grains, identity)
        if together is None:
            return
        object.__setattr__(self, "_next_id", self._next_id + len(grains))
        values = {name: np.asarray(getattr(grains, name)) for name in QUANTITIES}
        object.__setattr__(self, "grains", together)
        for name, more in grains.own.items():
            self.own[name] = np.concatenate([self.own[name], more])
        for name, more in values.items():
            present = np.asarray(getattr(self, name))
            fits = present.ndim == more.ndim and present.shape[1:] == more.shape[1:]
            setattr(self, name, np.concatenate([present, more]) if fits else present)

    def scale_box(self, factor: Any) -> None:
        """Scale the periodic axes of the box by a factor > 0, and with them the centres of mass of all clusters.

        Clusters keep their shape: a position x becomes x + (f − 1) R, with R the centre of mass of the cluster.
        Positions of grains that touch without being in contact are not looked at until the end of the change.

        Raises
        ------
        BadInput
            If the factor is not above 0, or the box is open.
        """
        value = si(factor, "1", "factor of scale_box", above=0.0)
        if self.box.is_open:
            raise BadInput("scale_box: the box is open")
        lengths = tuple(None if length is None else value * length for length in self.box.lengths)
        factors = np.array([1.0 if length is None else value for length in lengths])
        moved, box = self.grains.copy(), Box(lengths, value * self.box.tilt)  # type: ignore[arg-type]
        position = scaled_positions(self.grains, self._pairs(), self.box, factors)
        moved.arrays.position[...] = box.wrap(position).T
        # grains of clusters that lie across a boundary may come to lie on its other side
        whole = unwrapped(self.grains.position, self._pairs(), self.box)
        moved.arrays.image[...] += (box.image(position) - self.box.image(whole)).T
        object.__setattr__(self, "grains", moved)
        object.__setattr__(self, "_is_scaled", True)
        self.box = box

    def replace(self, force: Force) -> None:
        """Exchange the force of the same kind, such as `sand.Field("0 T")` for the present field.

        Raises
        ------
        BadInput
            If the simulation has no force of this kind.
        """
        given, *others = read_forces(force) or (None,)
        if given is None or others:
            raise BadInput(f"replace: {shown(force)}; give one force, such as sand.Field('0 T')")
        names = [own.name for own in self.forces]
        if given.name not in names:
            raise BadInput(f"forces: the simulation has no '{given.name}'; {did_you_mean(given.name, names)}")
        self.forces = tuple(given if own.name == given.name else own for own in self.forces)

    def _set_grains(self, grains: Grains, rows: Any) -> None:
        """Use other grains, and the quantities that `rows` makes of the present ones."""
        object.__setattr__(self, "grains", grains)
        for name in QUANTITIES:
            setattr(self, name, rows(np.atleast_1d(np.asarray(getattr(self, name)))))
        for name in self.grains.own_units:
            self.own[name] = rows(self.own[name])

    def _read_own(self) -> None:
        """Convert the own quantities to arrays (N,) in their units; those that cannot be used become as before."""
        units = self.grains.own_units
        for name in [name for name in self.own if name not in units]:
            self._errors.problems.append(
                f"own: the simulation has no '{name}'; a quantity is given at the start: "
                f"sand.Grains(…, own={{'{name}': …}})"
            )
            del self.own[name]
        for name, unit in units.items():
            present = self.grains.own[name].copy()
            if name not in self.own:
                self._errors.problems.append(f"own: '{name}' cannot be left out of a simulation; set it to 0")
            given = self.own.get(name, present)
            self.own[name] = self._errors.take(own_values, name, unit, given, len(present), instead=present)

    def _pairs(self) -> np.ndarray:
        """Contacts (C, 2) of the grains that stay, in the numbers of the change."""
        number = np.full(len(self._before[0]), -1, np.int64)
        number[self.kept] = np.arange(len(self.kept))
        pair = number[self._pair]
        return pair[(pair >= 0).all(axis=1)]

    def checked_forces(self, present: Sequence[Force]) -> tuple[Force, ...]:
        """The forces of the change.

        Raises
        ------
        BadInput
            If the contact model differs: existing contacts were formed with the present one.
        """
        forces = read_forces(self.forces)
        contact = [[force.parameters() for force in each if isinstance(force, Contact)] for each in (present, forces)]
        if contact[0] != contact[1]:
            raise BadInput("forces: the contact model cannot change; start a new simulation from a frame")
        return forces

    def checked_grains(self) -> Grains:
        """The grains with the quantities of the change.

        Raises
        ------
        BadInput
            If grains could not be removed or added, a quantity has another shape or is out of range, or the box does
            not fit.
        """
        self._errors.done()
        grains, errors = self.grains.copy(), ErrorCollector()
        for name in QUANTITIES:
            column = BY_NAME["body_moment" if name == "moment" else name]
            values = errors.take(stored, column, getattr(self, name), len(grains), called=name)
            if values is None:
                continue
            changed = np.atleast_2d(values != getattr(grains.arrays, name)).any(axis=0)
            getattr(grains.arrays, name)[..., changed] = values[..., changed]
            if name == "moment":
                for i in np.flatnonzero(changed):
                    turned = turned_back(tuple(grains.arrays.orientation[:, i]), tuple(values[:, i]))
                    grains.arrays.body_moment[:, i] = turned
        self._read_own()
        errors.problems += self._errors.problems
        grains.arrays.own[...] = np.array([self.own[name] for name in grains.own_units]).reshape(-1, len(grains))
        if self.regroups:
            errors.problems += outside_box(grains, self.box)
            before, box, *_ = self._before
            errors.take(refuse_cut_contacts, subset(before, self.kept), box, grains, self.box, self._pairs())
        errors.done()
        return grains

    def refuse_overlaps(self, grains: Grains, forces: Sequence[Force]) -> None:
        """Refuse added grains, and a box, in which grains overlap by more than at a start, or are at the same place."""
        if self.regroups and (same := at_same_place(grains, self.box)):
            raise BadInput(same)
        contact = next((force for force in forces if isinstance(force, Contact)), None)
        if contact is None or not self.regroups:
            return
        added = len(grains) - len(self.kept)
        numbers = f"{len(self.kept)} to {len(grains) - 1} are those added" if added else "none is added"
        found, given = overlapping_pairs(grains, self.box), np.sort(self._pairs(), axis=1)
        refuse_overlaps(grains, contact, found, given, f"after the change, in whose numbers {numbers}")
