"""A gas of grains in a box."""

from __future__ import annotations

import itertools
import math
import time as wall
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from ..arguments import checked
from ..box import Box, Span, as_box
from ..constants import BOLTZMANN, LIGHT
from ..errors import BadInput, did_you_mean, warn
from ..grains import Grains, moment_size, vector_for_all
from ..material import Material
from ..units import MELTED, MOST_GRAINS, format_quantity, in_unit, seed_given, si, whole_number

SPINS = {"kT/2": 1.0 / 3.0, "equipartition": 1.0, "none": 0.0}
"""Variance of each spin component in units of kT/I: mean rotational energy kT/2 in all, (3/2)kT, or none."""

CLEARANCE = 0.1
"""Least gap between surfaces at the start, in mean radii."""
TRIES = 2000
JAMMED, REACHED, PACKED = 0.38, 0.34, 0.64
"""Parts of space that spheres placed at random fill at most: equal ones; many of them, in `TRIES` tries; others."""
MANY = 1000
"""Grains from which on that is certain."""
PATIENCE = 5.0
"""Wall time [s] after which placing grains is worth a word."""
RELATIVE = 0.2
"""Thermal speeds over that of light at which no grain of a large number is faster."""


@checked
def gas(
    number: int,
    box: Any,
    *,
    radius: Any,
    material: Material | str,
    moment: Any = None,
    charge: Any = None,
    temperature: Any = "0 K",
    spins: str = "kT/2",
    seed: int = 0,
) -> Grains:
    """Grains at random places, thermal, with random moments, none overlapping.

    Parameters
    ----------
    number : int
        N ≥ 1.
    box
        a Box periodic on all axes (or a length for a cube).
    radius
        one [m], or (N,).
    material : Material or str
        a Material or the name of a preset.
    moment : optional
        size of each moment, absolute [A m²] or per mass ("200 A m^2/kg"), or "material" for the material's
        own; directions are isotropic. One vector (3,) [A m²] is the moment of every grain.
    charge : optional
        of each grain [C], one number or (N,); none by default.
    temperature : optional
        T [K] ≥ 0 of velocities and spins, thermal speeds far below that of light.  Velocities are
        Maxwellian, total momentum 0.
    spins : str, optional
        "kT/2" mean rotational energy per grain as in Dominik & Nübold (2002), section 3;
        "equipartition" (3/2) kT; "none".
    seed : int, optional
        same seed, same grains; positions, velocities, spins and moments draw from separate streams.

    Raises
    ------
    BadInput
        wrong numbers, or a box too full to place the grains at random.
    """
    space = as_box(box)
    if any(v is None for v in space.lengths):
        raise BadInput("a gas needs a box that is periodic on all three axes")
    if spins not in SPINS:
        raise BadInput(f"spins = {spins!r}; {did_you_mean(spins, list(SPINS))}")
    whole_number(number, "number", 1, MOST_GRAINS)
    kelvin = si(temperature, "K", "temperature", least=0.0)
    streams = [np.random.default_rng(s) for s in np.random.SeedSequence(seed_given(seed)).spawn(4)]
    size = in_unit(radius, "m")
    if number > MANY and size is not None and np.ndim(size) == 0:  # before arrays of this length are made
        _refuse_full(np.full(1, size), number, space)
    blank = Grains(np.zeros((number, 3)), radius, material, charge=charge)
    _refuse_hot(blank, kelvin)
    position = scatter(blank.radius, space, streams[0])
    mass, inertia = blank.mass[:, None], blank.arrays.inertia[:, None]
    velocity = streams[1].normal(size=(number, 3)) * np.sqrt(BOLTZMANN * kelvin / mass)
    velocity -= (mass * velocity).sum(axis=0) / mass.sum()
    spin = streams[2].normal(size=(number, 3)) * np.sqrt(SPINS[spins] * BOLTZMANN * kelvin / inertia)
    moments = None
    if (vector := vector_for_all(moment)) is not None:
        moments = np.tile(vector, (number, 1))
    elif moment is not None:
        specific = np.array([m.specific_moment for m in blank.materials])[blank.material]
        moments = directions(number, streams[3]) * moment_size(moment, blank.mass, specific)[:, None]
    return Grains(position, radius, material, velocity=velocity, spin=spin, moment=moments, charge=charge)


def directions(count: int, rng: np.random.Generator) -> np.ndarray:
    """Isotropic unit vectors (count, 3)."""
    v = rng.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1)[:, None]


def _refuse_hot(grains: Grains, kelvin: float) -> None:
    """Raises BadInput where grains would move as fast as light, or their surfaces; warns where no grain is solid."""
    speed = math.sqrt(3.0 * BOLTZMANN * kelvin / float(grains.mass.min()))
    surface = float(np.sqrt(BOLTZMANN * kelvin / grains.inertia * grains.radius**2).max())
    if max(speed, surface) > RELATIVE * LIGHT:
        raise BadInput(
            f"temperature = {kelvin:g} K: grains would move at {max(speed, surface):.3g} m/s, and that of light is "
            f"{LIGHT:.4g} m/s; take a lower temperature, or larger grains"
        )
    if kelvin > MELTED:
        warn(f"temperature = {kelvin:g} K: no material is solid above {MELTED:g} K; grains only move as if they were")


def _refuse_full(radius: np.ndarray, number: int, box: Box) -> None:
    """Raises BadInput where so many grains, with these radii in turn, cannot be placed at random.

    With their clearance, spheres placed one after the other fill at most 0.38 of space (Widom 1966; Zhang & Torquato
    2013), and many of them less in `TRIES` tries each.
    """
    equal = radius.max() < 1.1 * radius.min()
    most = (JAMMED if number < MANY else REACHED) if equal else PACKED
    each = (radius + 0.5 * CLEARANCE * radius.mean()) ** 3
    filled = 4.0 / 3.0 * math.pi * float(each.mean()) * number / box.volume
    if filled > most:
        raise BadInput(
            f"no room for grains: {number} would fill {filled:.3g} with their clearance, and random places fill "
            f"at most {most:g} of a box; take a larger box or fewer grains, up to {int(number * most / filled)}"
        )


def scatter(radius: np.ndarray, box: Box, rng: np.random.Generator) -> np.ndarray:
    """Random centres (N, 3) [m] in a periodic box, largest grains first, CLEARANCE mean radii apart.

    Raises
    ------
    BadInput
        no place found for a grain in TRIES attempts.
    """
    lengths = np.array(box.lengths, dtype=np.float64)
    gap = CLEARANCE * float(radius.mean())
    if 2.0 * (2.0 * radius.max() + gap) > lengths.min():
        raise BadInput(
            f"a box of {format_quantity(lengths.min(), 'm')} is too small for grains of radius {format_quantity(radius.max(), 'm')}; "
            "take one of at least 3 diameters"
        )
    _refuse_full(radius, len(radius), box)
    # cells wider than any two grains need, so that only those in and around a grain's own can be too close
    sides = np.floor(lengths / (2.0 * radius.max() + gap)).astype(int).tolist()
    near: dict[tuple[int, ...], list[tuple[float, ...]]] = {}  # spheres in and around a cell
    placed, tries = np.empty((len(radius), 3)), _tries(rng, lengths, sides)
    begun, told = wall.monotonic(), False
    for n, i in enumerate(np.argsort(-radius, kind="stable").tolist()):
        own = float(radius[i])
        for place, home in itertools.islice(tries, TRIES):
            if _is_free(place, own, gap, near.get(home, ()), box.span):
                placed[i] = place
                around = itertools.product(
                    *({(c + k) % m for k in (-1, 0, 1)} for c, m in zip(home, sides, strict=True))
                )
                for cell in around:
                    near.setdefault(cell, []).append((*place, own))
                break
        else:
            filled = 4.0 / 3.0 * math.pi * (radius**3).sum() / lengths.prod()
            raise BadInput(
                f"no room for grain {n + 1} of {len(radius)} after {TRIES} tries (filling {filled:.1%}); "
                "take a larger box or fewer grains"
            )
        if not told and wall.monotonic() > begun + PATIENCE:
            told = True
            warn(
                f"placing {len(radius)} grains takes long: {n + 1} after {PATIENCE:g} s, and the box gets fuller"
            )
    return placed


def _tries(
    rng: np.random.Generator, lengths: np.ndarray, sides: list[int]
) -> Iterator[tuple[tuple[float, ...], tuple[int, ...]]]:
    """Random places in the box without end, each with its cell; drawn many at a time."""
    while True:
        places = (rng.random((256, 3)) - 0.5) * lengths
        cells = np.floor((places / lengths + 0.5) * sides).astype(int) % sides
        yield from zip(map(tuple, places.tolist()), map(tuple, cells.tolist()), strict=True)


def _is_free(place: tuple[float, ...], own: float, gap: float, others: Iterable[tuple[float, ...]], span: Span) -> bool:
    """True if a sphere of this radius is farther than `gap` from all these spheres (x, y, z, radius)."""
    px, py, pz = place
    lx, ly, lz, ix, iy, iz = span
    for x, y, z, radius in others:
        dx, dy, dz = px - x, py - y, pz - z
        dx, dy, dz = dx - lx * round(dx * ix), dy - ly * round(dy * iy), dz - lz * round(dz * iz)
        if not dx * dx + dy * dy + dz * dz > (own + radius + gap) ** 2:
            return False
    return True
