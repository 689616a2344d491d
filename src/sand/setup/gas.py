"""Gas of grains at random positions with thermal velocities."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from time import monotonic
from typing import Any, NamedTuple

import numpy as np

from ..basics.arguments import MOST_GRAINS, checked
from ..basics.box import Box, Span, as_box
from ..basics.constants import BOLTZMANN, LIGHT
from ..basics.errors import BadInput, ErrorCollector, did_you_mean, shown, warn
from ..basics.grains import Grains
from ..basics.material import PRESETS, Material
from ..basics.units import MELTED, dimensions, format_quantity, in_unit, is_word, seed_given, si, whole_number
from .from_frame import Start
from .grain_classes import GrainClass, Members, class_from, class_numbers, joined_members, members_of
from .moments import directions

SPINS = {"kT/2": 1.0 / 3.0, "equipartition": 1.0, "none": 0.0}
"""Variance of each spin component in units of kT/I, for a mean rotational energy of kT/2, (3/2)kT or 0."""

CLEARANCE = 0.1
"""Smallest initial gap between surfaces, in mean radii."""
TRIES = 2000
"""Largest number of attempts to place a grain."""
JAMMED, REACHED, PACKED = 0.38, 0.34, 0.64
"""Upper limits of the filling factor: equal spheres at random; more than `MANY` equal spheres; unequal spheres."""
MANY = 1000
"""Number of grains above which the limit `REACHED` applies."""
PATIENCE = 5.0
"""Wall time [s] after which placing grains warns once."""
RELATIVE = 0.2
"""Largest thermal speed over the speed of light; no grain of a large sample then exceeds the speed of light."""


@checked
def gas(
    number: int | None,
    box: Any,
    *,
    radius: Any = None,
    material: Any = None,
    moment: Any = None,
    charge: Any = None,
    temperature: Any = "0 K",
    spins: str = "kT/2",
    exact_temperature: bool = True,
    classes: Sequence[Any] = (),
    extent: Any = None,
    seed: int = 0,
) -> Grains:
    """Thermal gas of grains, or of grains and aggregates, at random positions without overlaps, with random moments.

    Parameters
    ----------
    number : int or None
        Number of members N ≥ 1: grains, and with `classes` also aggregates. None if each class has a number.
    box : Box or float or str or None
        Box, or the length of a cubic one; None is open space. `extent` is the length of the gas along open axes.
    radius : float or str or array_like or Lognormal or PowerLaw
        One radius or (N,) [m], or a distribution: `Lognormal`, `PowerLaw`, or text as for `bpca`.
    material : Material or str or sequence or mapping
        Material or name of a preset, N of them, or fractions with the sum 1, {"silica": 0.7, "iron": 0.3}: randomly
        chosen grains get each material, N times the fraction to within rounding.
    moment : float or str or array_like, optional
        Magnitude of each moment, absolute [A m²] or per mass ("200 A m^2/kg"), or "material" for the material's
        specific moment; directions are isotropic. One vector (3,) [A m²] is the moment of every grain.
    charge : float or str or array_like, optional
        Charge of each grain [C], one number or (N,). Default: 0.
    temperature : float or str, optional
        Temperature T [K] ≥ 0 of velocities and spins; thermal speeds must be far below that of light. Velocities are
        Maxwellian with zero total momentum. An aggregate moves and rotates as a rigid body.
    spins : str, optional
        Mean rotational energy per member: "kT/2" as in Dominik & Nübold (2002), section 3; "equipartition", (3/2) kT;
        "none". It is divided equally among the three principal axes.
    exact_temperature : bool, optional
        True: velocities and spins are scaled, each by one factor, so that the translational energy is (3/2)(N − 1) kT
        and the rotational energy N times that of `spins`. False: random draws of the canonical ensemble, whose
        energies scatter by a fraction of about √(2/3N). A single grain is at rest, as its momentum is zero, and its
        spin is not scaled.
    classes : sequence of GrainClass or dict, optional
        Classes of members, with the keys of `GrainClass`; keys that a class lacks are the arguments above. Grains have
        the order of the classes.
    extent : float or str or sequence, optional
        Length [m] of the region that the gas fills, centred on the origin, along each open axis of the box: one length,
        or three with "periodic" along periodic axes. Members are wholly inside it, as between walls at its ends.
    seed : int, optional
        Seed of the random numbers. Positions, velocities, spins, moments and each class use separate streams.

    Raises
    ------
    BadInput
        If an argument is invalid, the box is too full for random positions, or members have contacts with displacements
        (`gas_with_contacts` returns them).

    Notes
    -----
    Positions are found in order of decreasing size. An aggregate takes the space of the sphere about its centre of mass
    that encloses it.
    """
    given = {"radius": radius, "material": material, "moment": moment, "charge": charge, "temperature": temperature}
    given |= {"spins": spins, "exact_temperature": exact_temperature, "classes": classes}
    given |= {"extent": extent, "seed": seed}
    start = gas_with_contacts(number, box, **given)
    if start.contacts is not None:
        raise BadInput(
            "the aggregates come from a frame with contacts, whose displacements would be lost; use "
            "sand.setup.gas_with_contacts, and Simulation(start.grains, …, contacts=start.contacts)"
        )
    return start.grains


@checked
def gas_with_contacts(
    number: int | None,
    box: Any,
    *,
    radius: Any = None,
    material: Any = None,
    moment: Any = None,
    charge: Any = None,
    temperature: Any = "0 K",
    spins: str = "kT/2",
    exact_temperature: bool = True,
    classes: Sequence[Any] = (),
    extent: Any = None,
    seed: int = 0,
    materials: Mapping[str, Material] = PRESETS,
) -> Start:
    """The gas of `gas`, and the contacts of aggregates from frames of earlier runs, with their displacements.

    Parameters
    ----------
    number, box, radius, material, moment, charge, temperature, spins, exact_temperature, classes, extent, seed
        As for `gas`.
    materials : mapping of str to Material, optional
        Materials by name; by default the presets.

    Returns
    -------
    Start
        Grains, contacts (None if there are none with displacements), and the box.

    Raises
    ------
    BadInput
        If an argument is invalid, or the box is too full for random positions.
    """
    space, classes = as_box(box), list(classes)
    region = _region(space, extent)
    if spins not in SPINS:
        raise BadInput(f"spins = {spins!r}; {did_you_mean(spins, list(SPINS))}")
    if number is not None or not classes:
        whole_number(number, "number", 1, MOST_GRAINS)
    kelvin = si(temperature, "K", "temperature", least=0.0)
    streams = np.random.SeedSequence(seed_given(seed)).spawn(4 + max(1, len(classes)))
    places, speeds, turns, axes = (np.random.default_rng(stream) for stream in streams[:4])
    defaults = {"radius": radius, "material": material, "moment": moment, "charge": charge}
    members = _members(number, region, classes, defaults, streams[4:], materials)
    grains, of, count = members.grains, members.member, len(members.reach)
    _refuse_hot(grains, kelvin)
    centre = scatter(members.reach, region, space, places)
    rigid = rigid_bodies(grains, of, count)
    mass = rigid.mass[:, None]
    velocity = speeds.normal(size=(count, 3)) * np.sqrt(BOLTZMANN * kelvin / mass)
    velocity -= (mass * velocity).sum(axis=0) / mass.sum()
    rate = turns.normal(size=(count, 3)) * np.sqrt(SPINS[spins] * BOLTZMANN * kelvin / rigid.inertia)
    if exact_temperature and count > 1:
        velocity *= _factor_to(1.5 * (count - 1) * BOLTZMANN * kelvin, mass, velocity)
        rate *= _factor_to(1.5 * count * SPINS[spins] * BOLTZMANN * kelvin, rigid.inertia, rate)
    spin = rate if rigid.axes is None else np.einsum("mij,mj->mi", rigid.axes, rate)
    relative = grains.position
    arrays, rows = grains.arrays, np.flatnonzero(members.directed)
    arrays.velocity[...] = (velocity[of] + np.cross(spin[of], relative)).T
    arrays.spin[...] = spin[of].T
    if len(rows):
        size = arrays.body_moment[2, rows]
        arrays.body_moment[:, rows] = directions(len(grains), axes)[rows].T * size
        arrays.moment[...] = arrays.body_moment
    arrays.position[...] = space.wrap(centre[of] + relative).T if rigid.axes is not None else centre.T
    return Start(grains, members.contacts, space, "")


def _region(box: Box, extent: Any) -> Box:
    """Region that a gas fills: the box, with `extent` along its open axes.  Raises BadInput."""
    if box.tilt:
        raise BadInput("box: a gas cannot be placed in a tilted box; leave tilt out, and shear the box")
    if isinstance(extent, (list, tuple)) or dimensions(extent) == 1:
        given = [None if is_word(own, "periodic") else own for own in extent]
    else:
        given = [extent if length is None else None for length in box.lengths]
    if len(given) != 3:
        raise BadInput(f"extent = {shown(extent)} must be one length, or three, 'periodic' along periodic axes")
    missing = [a for a, length, own in zip("xyz", box.lengths, given, strict=True) if length is None and own is None]
    if missing:
        raise BadInput(
            f"a gas needs a box that is periodic, or its extent along open axes, and this box is open along "
            f"{', '.join(missing)}; give extent, such as '1 um'"
        )
    periodic = [
        a for a, length, own in zip("xyz", box.lengths, given, strict=True) if not (length is None or own is None)
    ]
    if periodic or (extent is not None and None not in box.lengths):
        along = ", ".join(periodic or "xyz")
        raise BadInput(f"extent: the box is periodic along {along}; give extent along open axes only")
    lengths = [
        si(own, "m", f"extent along {axis}", above=0.0) if length is None else length
        for axis, length, own in zip("xyz", box.lengths, given, strict=True)
    ]
    return Box(tuple(lengths))  # type: ignore[arg-type]


def _members(
    number: int | None,
    region: Box,
    classes: Sequence[Any],
    defaults: Mapping[str, Any],
    streams: Sequence[np.random.SeedSequence],
    materials: Mapping[str, Material],
) -> Members:
    """Members of all classes; without classes there is one, of single grains. Raises BadInput with all errors."""
    if not classes:
        if missing := [name for name in ("radius", "material") if defaults[name] is None]:
            raise BadInput(f"gas: {name} is missing; add {name}=…" for name in missing)
        size = in_unit(defaults["radius"], "m")
        if number is not None and number > MANY and size is not None and np.ndim(size) == 0:
            _refuse_full(np.full(1, size), number, region)  # before arrays of this length are allocated
        return members_of(GrainClass(number=number, **defaults), number or 0, streams[0], materials)
    errors, groups = ErrorCollector(), []
    found = [errors.take(class_from, one, defaults, f"classes[{k}]") for k, one in enumerate(classes)]
    errors.done()
    numbers = class_numbers(found, number)
    for k, (one, count) in enumerate(zip(found, numbers, strict=True)):
        try:
            groups.append(members_of(one, count, streams[k], materials))
        except BadInput as error:
            errors.problems += error.at(f"classes[{k}]").problems
    errors.done()
    return joined_members(groups)


class RigidBodies(NamedTuple):
    """Masses and principal moments of inertia of the members of a gas."""

    mass: np.ndarray  # (M,) [kg]
    inertia: np.ndarray  # (M, 3), or (M, 1) for single grains [kg m²]
    axes: np.ndarray | None  # (M, 3, 3) principal axes in columns; None if all members are single grains


def rigid_bodies(grains: Grains, of: np.ndarray, count: int) -> RigidBodies:
    """Inertia of members: J = Σ (m (x² 1 − x xᵀ) + (2/5) m r² 1) over their grains.

    Parameters
    ----------
    grains : Grains
        Grains of all members, positions relative to the centre of mass of each.
    of : ndarray
        Member of each grain (N,), 0 … `count` − 1.
    """
    if len(grains) == count:
        return RigidBodies(grains.mass, grains.inertia[:, None], None)
    x = grains.position
    square = ((x**2).sum(axis=1) * grains.mass + grains.inertia)[:, None, None] * np.eye(3)
    tensor = np.zeros((count, 3, 3))
    np.add.at(tensor, of, square - grains.mass[:, None, None] * x[:, :, None] * x[:, None, :])
    inertia, axes = np.linalg.eigh(tensor)
    return RigidBodies(np.bincount(of, weights=grains.mass, minlength=count), inertia, axes)


def _factor_to(energy: float, inertia: np.ndarray, rate: np.ndarray) -> float:
    """Factor of velocities (or spins) (N, 3) that gives them this kinetic energy [J]; masses or moments of inertia."""
    present = 0.5 * float((inertia * rate**2).sum())
    return math.sqrt(energy / present) if present > 0.0 else 1.0


def _refuse_hot(grains: Grains, kelvin: float) -> None:
    """Raise BadInput if grains or their surfaces would reach relativistic speeds; warn above the solid range."""
    speed = math.sqrt(3.0 * BOLTZMANN * kelvin / float(grains.mass.min()))
    surface = float(np.sqrt(BOLTZMANN * kelvin / grains.inertia * grains.radius**2).max())
    if max(speed, surface) > RELATIVE * LIGHT:
        raise BadInput(
            f"temperature = {kelvin:g} K: grains would move at {max(speed, surface):.3g} m/s, speed of light "
            f"{LIGHT:.4g} m/s; use a lower temperature, or larger grains"
        )
    if kelvin > MELTED:
        warn(f"temperature = {kelvin:g} K: no material is solid above {MELTED:g} K; grains are treated as solid")


def _refuse_full(radius: np.ndarray, number: int, box: Box) -> None:
    """Raise BadInput if so many grains of these radii (in turn) cannot be placed by random sequential addition.

    Equal spheres with their clearance fill at most 0.38 of space (Widom 1966; Zhang & Torquato 2013); many grains reach
    less within `TRIES` attempts each.
    """
    equal = radius.max() < 1.1 * radius.min()
    most = (JAMMED if number < MANY else REACHED) if equal else PACKED
    each = (radius + 0.5 * CLEARANCE * radius.mean()) ** 3
    filled = 4.0 / 3.0 * math.pi * float(each.mean()) * number / box.volume
    if filled > most:
        raise BadInput(
            f"the box is too full: {number} grains with their clearance would fill {filled:.3g} of it, and random "
            f"positions fill at most {most:g}; use a larger box or fewer grains, up to {int(number * most / filled)}"
        )


def scatter(radius: np.ndarray, region: Box, box: Box, rng: np.random.Generator) -> np.ndarray:
    """Random centres (N, 3) [m] in a region, placed in order of decreasing radius with gaps of `CLEARANCE`.

    Along open axes of the box, spheres are wholly inside the region and keep the gap from its ends.

    Raises
    ------
    BadInput
        If no position was found for a grain in `TRIES` attempts.
    """
    lengths = np.array(region.lengths, dtype=np.float64)
    is_open = [v is None for v in box.lengths]
    gap = CLEARANCE * float(radius.mean())
    if 2.0 * (2.0 * radius.max() + gap) > lengths.min():
        name = "an extent" if is_open[int(lengths.argmin())] else "a box"
        raise BadInput(
            f"{name} of {format_quantity(lengths.min(), 'm')} is too small for grains of radius "
            f"{format_quantity(radius.max(), 'm')}; use one of at least 3 diameters"
        )
    _refuse_full(radius, len(radius), region)
    # cells wider than the interaction range, so that only the 27 cells around a position are searched
    sides = np.floor(lengths / (2.0 * radius.max() + gap)).astype(int).tolist()
    near: dict[tuple[int, ...], list[tuple[float, ...]]] = {}  # spheres in and around each cell
    placed, attempts = np.empty((len(radius), 3)), _attempts(rng, lengths, sides)
    start, warned = monotonic(), False
    for n, i in enumerate(np.argsort(-radius, kind="stable").tolist()):
        own = float(radius[i])
        most = [0.5 * v - own - gap if opened else math.inf for v, opened in zip(lengths, is_open, strict=True)]
        for position, cell in itertools.islice(attempts, TRIES):
            inside = all(abs(x) <= end for x, end in zip(position, most, strict=True))
            if inside and _is_free(position, own, gap, near.get(cell, ()), Span(*box.span[:6])):
                placed[i] = position
                around = itertools.product(
                    *({(c + k) % m for k in (-1, 0, 1)} for c, m in zip(cell, sides, strict=True))
                )
                for neighbour in around:
                    near.setdefault(neighbour, []).append((*position, own))
                break
        else:
            filled = 4.0 / 3.0 * math.pi * (radius**3).sum() / lengths.prod()
            raise BadInput(
                f"no free position for grain {n + 1} of {len(radius)} in {TRIES} attempts (filling factor "
                f"{filled:.1%}); use a larger box or fewer grains"
            )
        if not warned and monotonic() > start + PATIENCE:
            warned = True
            warn(f"placing {len(radius)} grains is slow in a box this full: {n + 1} placed in {PATIENCE:g} s")
    return placed


def _attempts(
    rng: np.random.Generator, lengths: np.ndarray, sides: list[int]
) -> Iterator[tuple[tuple[float, ...], tuple[int, ...]]]:
    """Endless random positions in the box, each with its cell; generated in batches."""
    while True:
        positions = (rng.random((256, 3)) - 0.5) * lengths
        cells = np.floor((positions / lengths + 0.5) * sides).astype(int) % sides
        yield from zip(map(tuple, positions.tolist()), map(tuple, cells.tolist()), strict=True)


def _is_free(place: tuple[float, ...], own: float, gap: float, others: Iterable[tuple[float, ...]], span: Span) -> bool:
    """Whether a sphere of radius `own` keeps a distance above `gap` from all these spheres (x, y, z, radius)."""
    px, py, pz = place
    lx, ly, lz, ix, iy, iz = span
    for x, y, z, radius in others:
        dx, dy, dz = px - x, py - y, pz - z
        dx, dy, dz = dx - lx * round(dx * ix), dy - ly * round(dy * iy), dz - lz * round(dz * iz)
        if not dx * dx + dy * dy + dz * dz > (own + radius + gap) ** 2:
            return False
    return True
