"""A gas of grains in a box."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from ..core.box import Box, as_box
from ..core.constants import BOLTZMANN
from ..core.errors import BadInput, did_you_mean
from ..core.grains import Grains, moment_size
from ..core.material import Material
from ..core.units import si, spoken

SPINS = {"kT/2": 1.0 / 3.0, "equipartition": 1.0, "none": 0.0}
"""Variance of each spin component in units of kT/I: mean rotational energy kT/2 in all, (3/2)kT, or none."""

CLEARANCE = 0.1
"""Least gap between surfaces at the start, in mean radii."""
TRIES = 2000


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

    Args:
        number: N ≥ 1.
        box: a Box periodic on all axes (or a length for a cube).
        radius: one [m], or (N,).
        material: a Material or the name of a preset.
        moment: size of each moment, absolute [A m²] or per mass ("200 A m^2/kg"), or "material" for the material's
            own; directions are isotropic.
        charge: of each grain [C], one number or (N,); none by default.
        temperature: T [K] ≥ 0 of velocities and spins.  Velocities are Maxwellian, total momentum 0.
        spins: "kT/2" mean rotational energy per grain as in Dominik & Nübold (2002), section 3;
            "equipartition" (3/2) kT; "none".
        seed: same seed, same grains; positions, velocities, spins and moments draw from separate streams.

    Raises:
        BadInput: wrong numbers, or a box too full to place the grains at random.
    """
    space = as_box(box)
    if any(v is None for v in space.lengths):
        raise BadInput("a gas needs a box that is periodic on all three axes")
    if spins not in SPINS:
        raise BadInput(f"spins = {spins!r}; {did_you_mean(str(spins), list(SPINS))}")
    if isinstance(number, bool) or not isinstance(number, (int, np.integer)) or number < 1:
        raise BadInput(f"number = {number!r} of grains must be a whole number of at least 1")
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0:
        raise BadInput(f"seed = {seed!r} must be a whole number of at least 0")
    kelvin = si(temperature, "K", "temperature", least=0.0)
    streams = [np.random.default_rng(s) for s in np.random.SeedSequence(int(seed)).spawn(4)]
    blank = Grains(np.zeros((number, 3)), radius, material, charge=charge)
    position = scatter(blank.radius, space, streams[0])
    mass, inertia = blank.mass[:, None], blank.arrays.inertia[:, None]
    velocity = streams[1].normal(size=(number, 3)) * np.sqrt(BOLTZMANN * kelvin / mass)
    velocity -= (mass * velocity).sum(axis=0) / mass.sum()
    spin = streams[2].normal(size=(number, 3)) * np.sqrt(SPINS[spins] * BOLTZMANN * kelvin / inertia)
    moments = None
    if moment is not None:
        specific = np.array([m.specific_moment for m in blank.materials])[blank.material]
        moments = directions(number, streams[3]) * moment_size(moment, blank.mass, specific)[:, None]
    return Grains(position, radius, material, velocity=velocity, spin=spin, moment=moments, charge=charge)


def directions(count: int, rng: np.random.Generator) -> np.ndarray:
    """Isotropic unit vectors (count, 3)."""
    v = rng.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1)[:, None]


def scatter(radius: np.ndarray, box: Box, rng: np.random.Generator) -> np.ndarray:
    """Random centres (N, 3) [m] in a periodic box, largest grains first, CLEARANCE mean radii apart.

    Raises:
        BadInput: no place found for a grain in TRIES attempts.
    """
    lengths = np.array(box.lengths, dtype=np.float64)
    gap = CLEARANCE * float(radius.mean())
    if 2.0 * (2.0 * radius.max() + gap) > lengths.min():
        raise BadInput(
            f"a box of {spoken(lengths.min(), 'm')} is too small for grains of radius {spoken(radius.max(), 'm')}; "
            "take one of at least 3 diameters"
        )
    placed = np.empty((len(radius), 3))
    # cells wider than any two grains need, so that only those in and around a grain's own can be too close
    sides = np.floor(lengths / (2.0 * radius.max() + gap)).astype(int).tolist()
    cells: dict[tuple[int, ...], list[int]] = {}
    for n, i in enumerate(np.argsort(-radius, kind="stable").tolist()):
        for _ in range(TRIES):
            here = (rng.random(3) - 0.5) * lengths
            home = tuple((np.floor((here / lengths + 0.5) * sides).astype(int) % sides).tolist())
            around = itertools.product(*({(c + k) % m for k in (-1, 0, 1)} for c, m in zip(home, sides, strict=True)))
            done = [j for cell in around for j in cells.get(cell, ())]
            apart = box.nearest(here - placed[done])
            if np.all((apart**2).sum(axis=1) > (radius[i] + radius[done] + gap) ** 2):
                placed[i] = here
                cells.setdefault(home, []).append(i)
                break
        else:
            filled = 4.0 / 3.0 * math.pi * (radius**3).sum() / lengths.prod()
            raise BadInput(
                f"no room for grain {n + 1} of {len(radius)} after {TRIES} tries (filling {filled:.1%}); "
                "take a larger box or fewer grains"
            )
    return placed
