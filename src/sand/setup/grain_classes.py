"""Classes of the members of a gas: single grains with laws of radii, and aggregates from builders and files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np

from ..basics.arguments import MOST_GRAINS, checked
from ..basics.errors import BadInput, shown, warn
from ..basics.grains import Grains, moment_size, vector_for_all
from ..basics.initial_pairs import StrainedContacts
from ..basics.material import PRESETS, Material, as_material
from ..basics.paths import checked_name
from ..basics.settings import For, Number, Reading, Settings, Whole, Word
from ..basics.units import dimensions, exact_quantity, has_unit_within, si
from .aggregates import KINDS, build
from .encounters import combined, turned
from .from_file import body_from_file, from_trajectory, is_own_trajectory, largest_body
from .population import Lognormal, PowerLaw, divided, drawn, fractions_of, radii_of, refuse_sum

BUILDERS = tuple(kind for kind in KINDS if kind != "grain")
"""Kinds of aggregates that are built."""
LARGEST_PLAIN = 1e-3
"""Radius [m] above which a number needs its unit: grains of dust are smaller, so that a length in nm was meant."""
LEAST_PLAIN_NM = 0.1
"""Least number that may be a radius in nm or µm."""
BODY_FILE = "a file that holds the aggregate, such as 'body.xyz'"


def radius_as_given(value: Any) -> Any:
    """Check radii as `radii_of` does; a length becomes a number [m], a law stays as it is.

    Raises
    ------
    BadInput
        As `radii_of`, or for a number above `LARGEST_PLAIN`, which text may have: as text it stays text.
    """
    radii = radii_of(value)
    if isinstance(radii, (Lognormal, PowerLaw)):
        return value
    if (largest := float(np.max(radii))) <= LARGEST_PLAIN:
        return np.asarray(radii).tolist()
    if not (has_unit_within(value) or isinstance(value, (np.ndarray, np.generic))):  # computed, in SI
        metres = f"'{largest:g} m'" if largest >= 1.0 else f"'{1e3 * largest:g} mm'"
        others = "" if largest < LEAST_PLAIN_NM else f", or did you mean '{largest:g} nm' or '{largest:g} um'?"
        raise BadInput(f"radius = {shown(value)}: a number without a unit is in m; give {metres} if it is in m{others}")
    texts = [exact_quantity(one, "m") for one in np.atleast_1d(radii).tolist()]
    return texts if np.ndim(radii) else texts[0]


def moment_as_given(value: Any) -> Any:
    """Check a moment as `moment_size` does; it stays as it is. Raises BadInput."""
    if dimensions(value) == 0:  # an array is checked against the number of grains
        moment_size(value, np.ones(1))
    return value


def material_as_given(value: Any) -> Any:
    """Check the form of a material: a name, a list of names, or fractions; the names are not looked up.

    Raises
    ------
    BadInput
        If it has none of these forms, or the fractions do not add up to 1.
    """
    if isinstance(value, Mapping):
        fractions_of(value, "material")
    elif not isinstance(value, (str, Material, Sequence)):
        raise BadInput(f"material = {shown(value)} must be a name, or fractions such as {{silica = 0.7, iron = 0.3}}")
    return value


def _charge_as_given(value: Any, name: str) -> Any:
    """Check one charge [C]; an array is checked by `Grains`.  Raises BadInput."""
    return si(value, "C", name) if dimensions(value) == 0 else value


Radii = Annotated[Any, Reading(lambda value, name: radius_as_given(value), unit="m")]
"""Radii: a length, which becomes SI, a law of radii as text, or a list."""
Materials = Annotated[Any, Reading(lambda value, name: material_as_given(value))]
"""A material, its name, a list of names, or fractions by name."""
MOMENT = Reading(lambda value, name: moment_as_given(value), unit="A m^2")
FILE = Reading(lambda value, name: checked_name(str(value), name))


@checked
@dataclass(frozen=True)
class GrainClass(Settings):
    """A class of equal or similar members of a gas: single grains, or aggregates.

    Keys that a class lacks, of `radius`, `material`, `moment` and `charge`, are those of the gas.

    Parameters
    ----------
    share : float, optional
        Fraction of the members of the gas that belong to the class; the shares of all classes have the sum 1.
    number : int, optional
        Number of members, in place of `share`; then all classes have one.
    kind : str, optional
        "grain": single grains; the name of a builder, as for `sand build`: a different aggregate for each member; or
        "file": copies of the body in `file`. Aggregates have random orientations.
    radius : float or str or list, optional
        Radius of the grains [m]: a length, 'lognormal(MEDIAN, SIGMA, LEAST, MOST)', 'power law(EXPONENT, LEAST, MOST)',
        or a list with one length for each grain.
    material : str or table, optional
        Preset or name in [materials]; or fractions with the sum 1, {silica = 0.7, iron = 0.3}.
    moment : float or str, optional
        Moment of each grain [A m²], per mass ("200 A m^2/kg"), or "material".
    charge : float or str, optional
        Charge of each grain [C], of either sign.
    grains : int, optional
        Number of grains of each aggregate.
    shape : list, optional
        Grains along the three sides of a lattice, such as [5, 5, 5].
    moments : str, optional
        Directions of the moments of an aggregate: "random", "aligned" or "relaxed".
    magnetic : float, optional
        Fraction of the grains of an aggregate that have a moment, 0 … 1.
    dimension, prefactor : float, optional
        Fractal dimension and prefactor, for kind "fractal".
    file : str, optional
        Body or trajectory for kind "file", in any format that `file` of [grains] may have; of a frame of a run the
        largest cluster, with its contacts and their displacements. Velocities and spins in the file are not used.
    frame : int, optional
        Index of the frame; −1, the last, by default.
    length : str, optional
        Unit of the file's lengths, such as 1 nm.

    Raises
    ------
    BadInput
        If a value is invalid or does not belong to the kind; one line for each.
    """

    share: Annotated[Any, Number(above=0.0, most=1.0)] = None
    number: Annotated[Any, Whole(1, MOST_GRAINS)] = None
    kind: Annotated[str, Word("file", among=KINDS)] = "grain"
    radius: Radii = None
    material: Materials = None
    moment: Annotated[Any, MOMENT, For("kind", *KINDS)] = None
    charge: Annotated[Any, Reading(_charge_as_given, unit="C")] = None
    grains: Annotated[Any, Whole(1, MOST_GRAINS), For("kind", *BUILDERS)] = None
    shape: Annotated[Any, For("kind", *BUILDERS)] = None
    moments: Annotated[Any, For("kind", *BUILDERS)] = None
    magnetic: Annotated[Any, For("kind", *BUILDERS)] = None
    dimension: Annotated[Any, For("kind", *BUILDERS)] = None
    prefactor: Annotated[Any, For("kind", *BUILDERS)] = None
    file: Annotated[Any, FILE, For("kind", "file", needed=BODY_FILE)] = None
    frame: Annotated[Any, Whole(-(2**31), 2**31 - 1), For("kind", "file")] = None
    length: Annotated[Any, For("kind", "file")] = None

    place: ClassVar[str] = ""

    def contradictions(self, wrong: Set[str]) -> Iterator[str]:
        """The number of members, which is given in one way, and that of the grains of an aggregate."""
        if (self.share is None) == (self.number is None):
            yield "give either share, a fraction such as 0.5, or number"
        if "kind" not in wrong and self.kind in BUILDERS and self.grains is None and self.shape is None:
            yield f"grains is missing: how many does the {self.kind} have?"


def class_numbers(classes: Sequence[GrainClass], number: int | None) -> list[int]:
    """Number of members of each class.

    Parameters
    ----------
    number : int or None
        Number of all members; None if each class has one.

    Raises
    ------
    BadInput
        If shares do not add up to 1, numbers do not add up to `number`, both occur, or a class has no member.
    """
    shares = [one.share for one in classes if one.share is not None]
    if shares and len(shares) < len(classes):
        raise BadInput("classes: give every class a share, or every class a number")
    if not shares:
        numbers = [int(one.number) for one in classes]
        if number is not None and sum(numbers) != number:
            raise BadInput(f"number = {number}, but the numbers of the classes have the sum {sum(numbers)}; remove one")
        return numbers
    refuse_sum(np.array(shares), f"classes: the shares {', '.join(f'{v:g}' for v in shares)}")
    if number is None:
        raise BadInput("number is missing: of how many members are these the shares? For example number = 125")
    numbers = divided(number, np.array(shares)).tolist()
    if 0 in numbers:
        k = numbers.index(0)
        raise BadInput(f"classes[{k}]: share = {shares[k]:g} of number = {number} is no member; raise one of them")
    return numbers


class Members(NamedTuple):
    """Members of a gas, each with its centre of mass at the origin."""

    grains: Grains  # grains of all members; positions relative to the centres of mass
    member: np.ndarray  # (N,) member of each grain
    reach: np.ndarray  # (M,) outer radius of each member [m]
    contacts: StrainedContacts | None  # contacts with displacements, of members from frames
    directed: np.ndarray  # (N,) whether the direction of the moment is still to be drawn, with the size along z


def members_of(
    given: GrainClass, count: int, stream: np.random.SeedSequence, library: Mapping[str, Material] = PRESETS
) -> Members:
    """Members of one class.

    Parameters
    ----------
    given : GrainClass
        The class, with the keys that it lacks filled in.
    count : int
        Number of its members.
    stream : SeedSequence
        Source of random numbers.
    library : mapping of str to Material, optional
        Materials by name.

    Raises
    ------
    BadInput
        If a material is unknown, radii and numbers do not fit, or a builder or a file refuses its arguments.
    """
    rng = np.random.default_rng(stream)
    if given.kind != "file" and given.radius is None:
        raise BadInput("radius is missing; add radius=…")
    if given.kind != "file" and given.material is None:
        raise BadInput("material is missing; add material=…")
    material = None if given.material is None else in_library(given.material, library)
    if given.kind == "grain":
        return _single(replace(given, material=material), count, rng)
    contacts, bodies = [], []
    copied = _body_and_contacts(given, material, library) if given.kind == "file" else None
    for _ in range(count):
        if copied is not None:
            body, strained = copied
        else:
            builder = {
                name: getattr(given, name)
                for name in ("radius", "moment", "moments", "magnetic", "dimension", "prefactor")
            }
            seed = int(rng.integers(2**62))
            body = build(given.kind, given.grains, shape=given.shape, seed=seed, material=material, **builder)
            strained = None
        rotation = _random_rotation(rng)
        bodies.append(turned(body, rotation))
        if strained is not None:
            slide, roll = (rotation.apply(np.array(v)) for v in (strained.slide, strained.roll))
            contacts.append(StrainedContacts(strained.pair, slide, roll, strained.twist))
    sizes = np.array([len(body) for body in bodies])
    grains = combined(bodies, [np.zeros(3)] * count, [np.zeros(3)] * count)
    if given.charge is not None and grains.charge.any():
        raise BadInput(
            f"charge: {given.file} has the charges of its grains; leave charge out, or give it to other classes"
        )
    if given.charge is not None:
        grains.arrays.charge[:] = given.charge
    for name in ("velocity", "spin"):
        getattr(grains.arrays, name)[...] = 0.0
    reach = [float((np.linalg.norm(body.position, axis=1) + body.radius).max()) for body in bodies]
    directed = np.zeros(len(grains), dtype=bool)
    joined = joined_contacts(contacts, sizes) if contacts else None
    return Members(grains, np.repeat(np.arange(count), sizes), np.array(reach), joined, directed)


def _body_and_contacts(
    given: GrainClass, material: Material | None, library: Mapping[str, Material]
) -> tuple[Grains, StrainedContacts | None]:
    """The aggregate of a class with a `file`, its centre of mass at the origin, and its contacts from a trajectory.

    Raises
    ------
    BadInput
        If the file cannot be read, or a key does not apply to it.
    """
    path = Path(given.file)
    number = -1 if given.frame is None else given.frame
    if not is_own_trajectory(path):
        body = body_from_file(path, material, given.radius, given.length, library, frame=number)
        if body.velocity.any() or body.spin.any():
            warn(f"{path}: its velocities and spins are not used; those of a gas follow from its temperature")
        return body, None
    if extra := [name for name in ("radius", "material", "length") if getattr(given, name) is not None]:
        raise BadInput(f"{extra[0]}: the trajectory {path} has it; leave {extra[0]} out")
    return largest_body(from_trajectory(path, number, library))


def _single(given: GrainClass, count: int, rng: np.random.Generator) -> Members:
    """Single grains; the direction of a moment given by its size is drawn later."""
    radius, kinds = drawn(count, given.radius, given.material, rng)
    refuse_missing(given.material, kinds)
    grains = Grains(np.zeros((count, 3)), radius, kinds, charge=given.charge)
    vector = None if given.moment is None else vector_for_all(given.moment)
    directed = np.full(count, given.moment is not None and vector is None)
    moment = grains.arrays.body_moment
    if vector is not None:
        moment[...] = vector[:, None]
    elif given.moment is not None:
        specific = np.array([m.specific_moment for m in grains.materials])[grains.material]
        moment[2] = moment_size(given.moment, grains.mass, specific)
    grains.arrays.moment[...] = moment
    return Members(grains, np.arange(count), grains.radius, None, directed)


def _random_rotation(rng: np.random.Generator) -> Any:
    from scipy.spatial.transform import Rotation  # slow to import

    return Rotation.random(random_state=rng)


def joined_members(groups: Sequence[Members]) -> Members:
    """Members of several classes, in this order."""
    if len(groups) == 1:
        return groups[0]
    none = [np.zeros(3)] * len(groups)
    members = np.cumsum([0, *(len(group.reach) for group in groups)])
    sizes = [len(group.grains) for group in groups]
    empty = StrainedContacts(np.zeros((0, 2), np.int64), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    strained = any(group.contacts is not None for group in groups)
    return Members(
        combined([group.grains for group in groups], none, none),
        np.concatenate([group.member + first for group, first in zip(groups, members, strict=False)]),
        np.concatenate([group.reach for group in groups]),
        joined_contacts([group.contacts or empty for group in groups], sizes) if strained else None,
        np.concatenate([group.directed for group in groups]),
    )


def joined_contacts(contacts: Sequence[StrainedContacts], sizes: Sequence[int] | np.ndarray) -> StrainedContacts:
    """Contacts of several sets of grains of these sizes, as one table."""
    first = np.cumsum([0, *sizes])
    pairs = [table.pair + start for table, start in zip(contacts, first, strict=False)]
    rest = zip(*(table[1:] for table in contacts), strict=True)
    return StrainedContacts(np.concatenate(pairs), *(np.concatenate(part) for part in rest))


def in_library(given: Any, library: Mapping[str, Material]) -> Any:
    """Materials for names, in the form given: one, a list, or fractions. Raises BadInput for unknown names."""
    if isinstance(given, str):
        return library[given] if given in library else as_material(given)
    if isinstance(given, Mapping):
        return {in_library(name, library): part for name, part in given.items()}
    if isinstance(given, (Sequence, np.ndarray)) and dimensions(given) == 1:
        return [in_library(one, library) for one in given]
    return as_material(given)


def refuse_missing(fractions: Any, kinds: Sequence[Material]) -> None:
    """Raise BadInput if a material of a mixture has no grain."""
    if not isinstance(fractions, Mapping):
        return
    found = {material.name for material in kinds}
    for material, part in fractions.items():
        name = getattr(material, "name", material)
        if name not in found:
            raise BadInput(
                f"material: fraction {part:g} of {len(kinds)} grains is no grain of {name}; raise one of them"
            )


def class_from(given: Any, defaults: Mapping[str, Any], place: str) -> GrainClass:
    """A class from an object or a table, with `defaults` for the keys that it lacks. Raises BadInput at `place`."""
    try:
        one = given if isinstance(given, GrainClass) else GrainClass(**given)
        lacking = ("charge",) if one.kind == "file" else tuple(defaults)
        return replace(one, **{name: defaults[name] for name in lacking if getattr(one, name) is None})
    except BadInput as error:
        raise error.at(place) from None
    except TypeError:
        raise BadInput(f"{place} = {shown(given)}; give a table, such as {{'share': 0.5, 'charge': 1e-19}}") from None
