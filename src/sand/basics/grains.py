"""Class Grains: spheres with position, velocity, spin, magnetic moment and charge."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np

from .arguments import checked
from .array_groups import GRAINS, Array
from .box import Box
from .constants import LIGHT
from .conversion import kind_of
from .errors import BadInput, NoSuchAttribute, NoSuchGrain, did_you_mean, shown
from .material import Material, as_material
from .own_quantities import OwnQuantities, read_own, refuse_same_letters
from .schema import BY_NAME, CHANGEABLE, FIELDS, public, stored
from .units import dimensions, format_quantity, has_unit_within, in_unit, not_a_quantity, too_large

ROUNDING = 1e-7
"""Largest gap of a contact without adhesion, relative to the sum of radii; allows for coordinates of seven digits."""

ROUNDED = 1e-3
"""Largest gap, in smaller radii of the pair, of grains in a file that are in contact: their coordinates are rounded."""

SMALLEST = 1e-10
"""Smallest radius [m] of a grain, that of an atom."""


def _of(name: str, rule: str = "finite") -> Array:
    """Declaration of the array of a quantity in the field table."""
    field = BY_NAME[name]
    return Array((GRAINS,) if field.width == 1 else (field.width, GRAINS), field.unit, rule=rule)


class GrainArrays(NamedTuple):
    """Arrays of the field table in stored shape, (N,) or (width, N), on which kernels work."""

    radius: Annotated[np.ndarray, _of("radius", "above 0")]
    mass: Annotated[np.ndarray, _of("mass", "above 0")]
    inertia: Annotated[np.ndarray, _of("inertia", "above 0")]
    charge: Annotated[np.ndarray, _of("charge")]
    body_moment: Annotated[np.ndarray, _of("body_moment")]
    position: Annotated[np.ndarray, _of("position")]
    velocity: Annotated[np.ndarray, _of("velocity")]
    orientation: Annotated[np.ndarray, _of("orientation")]
    spin: Annotated[np.ndarray, _of("spin")]
    moment: Annotated[np.ndarray, _of("moment")]
    force: Annotated[np.ndarray, _of("force")]
    torque: Annotated[np.ndarray, _of("torque")]
    field: Annotated[np.ndarray, _of("field")]
    own: Annotated[np.ndarray, Array(("own", GRAINS))]  # own quantities; names and units are those of Grains.own
    material: Annotated[np.ndarray, Array((GRAINS,), dtype="u4", rule="any")]  # index into Grains.materials
    id: Annotated[np.ndarray, Array((GRAINS,), dtype="u4", rule="ascending")]  # the user's index of the grain
    # how often it has crossed the periodic box along each axis; earlier versions did not count this
    image: Annotated[np.ndarray, Array((3, GRAINS), dtype="i4", rule="any", required=False)]


NAMES = tuple(name for name in GrainArrays._fields if name != "own")
"""Public quantities of `Grains`."""


def materials_of(material: Any, count: int) -> tuple[tuple[Material, ...], np.ndarray]:
    """Find the distinct materials and each grain's index into them.

    Parameters
    ----------
    material : Material or str or sequence
        A Material or preset name for all grains, or a sequence of N of them.
    count : int
        Number of grains N.

    Returns
    -------
    materials : tuple of Material
        Distinct materials, in order of first occurrence.
    index : ndarray
        Index (N,) into `materials`, uint32.

    Raises
    ------
    BadInput
        If the length is not N, a material is unknown, or two different materials have the same name.
    """
    several = (
        isinstance(material, (Sequence, np.ndarray)) and not isinstance(material, str) and dimensions(material) > 0
    )
    each: Sequence[Any] = list(material) if several else [as_material(material)] * count
    if len(each) != count:
        raise BadInput(f"material has {len(each)} entries but there are {count} grains")
    index: dict[Material, int] = {}
    numbers = np.empty(count, dtype=np.uint32)
    for i, given in enumerate(each):
        found = as_material(given, f"material of grain {i}")
        numbers[i] = index.setdefault(found, len(index))
    names = [m.name for m in index]
    if doubles := sorted({name for name in names if names.count(name) > 1}):
        raise BadInput(f"two different materials are called '{doubles[0]}'; rename one: material.but(name='…')")
    return tuple(index), numbers


@checked
class Grains:
    """N spherical grains. Their properties are read-only; a simulation works on a copy.

    `grains[3]`, `grains[2:5]` and `grains[mask]` are new grains, copies of these; a loop gives one after the other.

    All numbers may be SI floats, text with a unit, or quantities of pint, astropy or unyt, also within lists.

    Parameters
    ----------
    position : array_like
        Centres (N, 3) [m] in the laboratory frame.
    radius : float or str or array_like
        Scalar or (N,) [m], at least 1e-10 m, the radius of an atom.
    material : Material or str or sequence
        One `sand.Material` (or preset name) for all grains, or a sequence of N.
    velocity : array_like, optional
        (N, 3), or (3,) for all grains [m/s], below the speed of light. Default: zero.
    spin : array_like, optional
        Angular velocity (N, 3) or (3,) [rad/s] in the laboratory frame, with surface speeds below that of light.
        Default: zero.
    moment : array_like or str, optional
        Magnetic moments (N, 3) or (3,) [A m²] in the laboratory frame at the start; or one magnitude, along +z, as
        text: absolute "6.6e-18 A m^2", per mass "200 A m^2/kg", or "material" for the specific moment of each material.
        Default: zero.
    charge : float or str or array_like, optional
        Scalar or (N,) [C]. Default: zero.
    mass : float or str or array_like, optional
        Scalar or (N,) [kg] > 0. Default: density × volume.
    own : dict, optional
        Own quantities by name: text with a unit, as {"temperature": "300 K"}; numbers and their unit, one or (N,), as
        {"heating": (values, "W/m^2")}; numbers without a unit; or the `own` of other grains. Values are kept in SI.
        No force depends on them; updaters may change them; all files, figures and the viewer have them.

    Raises
    ------
    BadInput
        If quantities are invalid; one line for each.
    """

    def __init__(
        self,
        position: Any,
        radius: Any,
        material: Any,
        *,
        velocity: Any = None,
        spin: Any = None,
        moment: Any = None,
        charge: Any = None,
        mass: Any = None,
        own: Mapping[str, Any] | None = None,
    ):
        count = _count(position)
        problems: list[str] = []
        arrays = {f.name: np.zeros(count if f.width == 1 else (f.width, count)) for f in FIELDS}
        given = {"position": position, "radius": radius, "velocity": velocity, "spin": spin, "charge": charge}
        carried = OwnQuantities({}, {})
        try:
            carried = read_own(own, count)
        except BadInput as error:
            problems += error.problems
        for name, values in given.items():
            if values is None and name not in ("position", "radius"):
                continue
            try:
                arrays[name] = stored(BY_NAME[name], values, count, positive=name == "radius")
            except BadInput as error:
                problems += error.problems
        try:
            self.materials, index = materials_of(material, count)
            density = np.array([m.density for m in self.materials])[index]
            sphere = density * (4.0 / 3.0) * np.pi * arrays["radius"] ** 3
            arrays["mass"] = sphere if mass is None else stored(BY_NAME["mass"], mass, count, positive=True)
            if moment is not None:
                specific = np.array([m.specific_moment for m in self.materials])[index]
                arrays["body_moment"] = _moments(moment, arrays["mass"], specific, count)
        except BadInput as error:
            problems += error.problems
        if problems := problems or _range_errors(arrays):
            raise BadInput(problems)
        arrays["inertia"] = 0.4 * arrays["mass"] * arrays["radius"] ** 2
        arrays["orientation"][3] = 1.0
        arrays["moment"] = arrays["body_moment"].copy()
        self.own_units = carried.units
        rows = np.array(list(carried.values())).reshape(len(carried), count)
        image = np.zeros((3, count), np.int32)
        self.arrays = GrainArrays(**arrays, own=rows, material=index, id=np.arange(count, dtype=np.uint32), image=image)

    def __len__(self) -> int:
        return self.arrays.radius.size

    def __getattr__(self, name: str) -> np.ndarray:
        """Read-only view of a quantity of the field table, (N,) or (N, width), or of an own quantity."""
        units = self.__dict__.get("own_units", {})
        if name in units:
            return public(self.arrays.own[list(units).index(name)])
        if name not in NAMES:
            raise NoSuchAttribute(f"grains have no '{name}'; {did_you_mean(name, (*NAMES, *units))}")
        return public(getattr(self.arrays, name))

    @property
    def own(self) -> OwnQuantities:
        """Own quantities by name, read-only (N,), and their `units`."""
        return OwnQuantities(dict(zip(self.own_units, self.arrays.own, strict=True)), self.own_units)

    def with_own(self, own: Mapping[str, Any]) -> Grains:
        """A copy with these own quantities, as in the argument `own`, beside or in place of those that it has.

        Raises
        ------
        BadInput
            If a name or a value cannot be used; one line for each.
        """
        more, other = read_own(own, len(self)), self.copy()
        for name in more:
            refuse_same_letters(name, (other_name for other_name in self.own_units if other_name != name))
        units = self.own_units | more.units
        rows = [more[name] if name in more else self.own[name] for name in units]
        other.__dict__["own_units"] = units
        other.arrays = other.arrays._replace(own=np.array(rows).reshape(len(units), len(self)))
        return other

    def __setattr__(self, name: str, value: Any) -> None:
        """Refuse assignments, which would leave the arrays and derived quantities unchanged."""
        if name == "arrays" or (name in ("materials", "own_units") and name not in self.__dict__):
            object.__setattr__(self, name, value)
        elif name in (*NAMES, "materials", "own", "own_units", *self.own_units):
            own = "own={…}" if name.startswith("own") else f'own={{"{name}": …}}'
            is_own = name in ("own", "own_units", *self.own_units)
            key = own if is_own else "material=…" if name == "materials" else f"{name}=…"
            raise NoSuchAttribute(
                f"{name} of grains cannot be assigned; make new grains, sand.Grains(…, {key}), "
                "and build a new Simulation from them"
                + (
                    f"; or in a simulation: with sim.change() as change: change.{name}[…] = …"
                    if name in CHANGEABLE
                    else ""
                )
            )
        elif type(self).__module__.startswith("sand."):
            raise NoSuchAttribute(f"grains have no '{name}'; {did_you_mean(name, (*NAMES, *self.own_units))}")
        else:
            object.__setattr__(self, name, value)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *NAMES, *self.own_units]

    def __getitem__(self, index: Any) -> Grains:
        """Grains of this index, slice, mask (N,) or list of indices, as new grains with indices from 0.

        Raises
        ------
        BadInput
            If there are no such grains; it is also an IndexError, so that loops over grains end.
        """
        numbers = np.arange(len(self))
        try:
            chosen = np.atleast_1d(numbers[index])
        except Exception:  # errors of NumPy, and of the object
            chosen = numbers[:0]
        if chosen.ndim != 1 or not chosen.size:
            asked = shown(index)
            raise NoSuchGrain(
                f"grains[{asked}] names no grain: there are {len(self)}; give an index from 0, a slice, or a mask"
            )
        other = copy.copy(self)
        own, material = materials_of([self.materials[k] for k in self.arrays.material[chosen]], chosen.size)
        arrays = GrainArrays(*(array[..., chosen].copy() for array in self.arrays))
        other.__dict__["materials"] = own
        other.arrays = arrays._replace(material=material, id=np.arange(chosen.size, dtype=np.uint32))
        return other

    def __iter__(self) -> Iterator[Grains]:
        return (self[k] for k in range(len(self)))

    def __repr__(self) -> str:
        names = ", ".join(m.name for m in self.materials)
        radii = " to ".join(format_quantity(r, "m") for r in sorted({self.radius.min(), self.radius.max()}))
        return f"<{len(self)} {'grain' if len(self) == 1 else 'grains'} of {names}, radius {radii}>"

    @checked
    def overlaps(self, pairs: np.ndarray, box: Box) -> np.ndarray:
        """Overlaps δ = r_i + r_j − |x_i − x_j| [m] of pairs (P, 2) of grains; negative for a gap."""
        if pairs.ndim != 2 or pairs.shape[1] != 2 or (pairs.size and pairs.dtype.kind not in "iu"):
            raise BadInput(f"pairs = {shown(pairs)} must be whole numbers (P, 2)")
        if pairs.size and not -len(self) <= pairs.min() <= pairs.max() < len(self):
            raise BadInput(f"pairs name grains from {pairs.min()} to {pairs.max()}; there are {len(self)}")
        i, j = np.asarray(pairs, np.int64).T
        separation = box.nearest(self.position[i] - self.position[j])
        return self.radius[i] + self.radius[j] - np.linalg.norm(separation, axis=1)

    @checked
    def touching(self, box: Box, gap: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Pairs (P, 2) of grains in contact, sorted, with their overlaps [m].

        A gap up to `ROUNDING`, or up to `gap` smaller radii of the pair, counts as a contact.
        """
        pairs = box.close_pairs(self.position, 2.0 * float(self.radius.max()) * (1.0 + max(ROUNDING, 0.5 * gap)))
        overlap, radius = self.overlaps(pairs, box), self.radius[pairs]
        found = overlap >= -np.maximum(ROUNDING * radius.sum(axis=1), gap * radius.min(axis=1))
        return pairs[found], overlap[found]

    def copy(self) -> Grains:
        """Return an independent copy."""
        return self.with_arrays(GrainArrays(*(a.copy() for a in self.arrays)))

    def with_arrays(self, arrays: GrainArrays) -> Grains:
        """Return grains of the same materials with other arrays."""
        other = object.__new__(type(self))
        vars(other).update(vars(self))
        object.__setattr__(other, "arrays", arrays)
        return other


def _count(position: Any) -> int:
    array = in_unit(position, "m")
    if array is None and has_unit_within(position):
        raise not_a_quantity(position, "m", "position")
    if array is None or np.ndim(array) != 2 or np.shape(array)[1] != 3 or np.shape(array)[0] == 0:
        shape = "" if array is None else f", not {np.shape(array)}"
        raise BadInput(f"position must be an array of shape (N, 3) in m with N ≥ 1{shape}")
    return int(np.shape(array)[0])


def _range_errors(arrays: dict[str, np.ndarray]) -> list[str]:
    """Messages about radii below that of an atom and speeds or surface speeds above that of light."""
    radius, speed, spin = arrays["radius"], _magnitudes(arrays["velocity"]), _magnitudes(arrays["spin"])
    small, fast, spinning = int(np.argmin(radius)), int(np.argmax(speed)), int(np.argmax(spin * radius))
    problems = []
    if radius[small] < SMALLEST:
        problems.append(f"radius of grain {small} is {radius[small]:g} m, less than that of an atom, {SMALLEST:g} m")
    if speed[fast] >= LIGHT:
        problems.append(
            f"velocity of grain {fast} is {speed[fast]:g} m/s; it must be below that of light, {LIGHT:.4g} m/s"
        )
    if spin[spinning] * radius[spinning] >= LIGHT:
        surface = f"{spin[spinning] * radius[spinning]:g} m/s"
        problems.append(
            f"spin of grain {spinning} moves its surface at {surface}; it must be below that of light, {LIGHT:.4g} m/s"
        )
    return problems


def _magnitudes(vectors: np.ndarray) -> np.ndarray:
    """Magnitudes (N,) of vectors (3, N), without overflow of the squares."""
    return np.hypot(np.hypot(vectors[0], vectors[1]), vectors[2])


def vector_for_all(moment: Any) -> np.ndarray | None:
    """Moment (3,) [A m²] common to all grains; None if `moment` is a magnitude or (N, 3). Raises BadInput."""
    vector = None if isinstance(moment, str) else in_unit(moment, "A m^2")
    if vector is None or np.shape(vector) != (3,):
        return None
    return stored(BY_NAME["body_moment"], moment, 1)[:, 0]


def _moments(moment: Any, mass: np.ndarray, specific: np.ndarray, count: int) -> np.ndarray:
    """Moments (3, N) [A m²] from vectors, or from a magnitude (absolute or per mass) along +z."""
    if not isinstance(moment, str) and np.ndim(in_unit(moment, "A m^2")) > 0:
        return stored(BY_NAME["body_moment"], moment, count, called="moment")
    vectors = np.zeros((3, count))
    vectors[2] = moment_size(moment, mass, specific)
    return vectors


def net_charge(charge: np.ndarray) -> float:
    """Σq [C] of charges (n,); 0 where it is below 1e-9 Σ|q|, which counts as rounding."""
    net = math.fsum(charge)
    return net if abs(net) > 1e-9 * np.abs(charge).sum() else 0.0


def moment_size(moment: Any, mass: np.ndarray, specific: np.ndarray | float = 0.0) -> np.ndarray:
    """Magnitudes (N,) [A m²] of moments given as a number [A m²] or as text, absolute or per mass.

    Parameters
    ----------
    moment : float or str or array_like
        One magnitude or N of them; "material" for `specific` × `mass`.
    mass : ndarray
        Masses (N,) [kg].
    specific : ndarray or float, optional
        Moment per mass [A m²/kg] of each grain's material, for "material".

    Raises
    ------
    BadInput
        If the unit or the number of values is wrong, or a value is negative, not finite, or nonsense (`LARGEST`).
    """
    if isinstance(moment, str) and moment == "material":
        return specific * mass
    size: Any = None
    for unit, factor in (("A m^2", 1.0), ("A m^2/kg", mass)):
        found = in_unit(moment, unit) if size is None else None
        if found is not None:
            if np.size(found) and (reason := too_large(float(np.max(found)), unit)):
                raise BadInput(f"moment = {shown(moment)} is {reason}")
            size = found * factor
    fits = size is not None and np.shape(size) in ((), mass.shape)
    wrong = f"is {kind[:-2]}; it " if size is None and (kind := kind_of(moment)) else ""
    if not fits or not np.all(np.isfinite(size)) or np.any(np.asarray(size) < 0.0):
        raise BadInput(
            f"moment = {shown(moment)} {wrong}must be (N, 3) or three numbers in A m^2, or a size ≥ 0 such as "
            "'6.6e-18 A m^2' or, per mass, '200 A m^2/kg', or 'material'"
        )
    return np.broadcast_to(np.asarray(size, dtype=np.float64), mass.shape)
