"""What the grains of an aggregate are, before there are places for them: their radii and materials."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..arguments import MOST_GRAINS, checked
from ..contact.jkr import rest_overlap, rest_radius
from ..contact.mixing import pairing_between
from ..errors import BadInput, shown
from ..grains import Grains, materials_of
from ..material import Material, as_material
from ..units import format_quantity, in_unit, seed_given, si, whole_number
from ._kernels.hash_grid import GrainSet

WIDEST = 200.0
"""Largest radius over smallest; beyond it nearly all grains of a power law are too small to matter."""
DEEPEST = 0.5
"""Overlap at rest, as a part of the smaller radius, from which on grains are too small for JKR to make sense."""
FORMS = "a length, N of them, 'lognormal(MEDIAN, SIGMA, LEAST, MOST)' or 'power law(EXPONENT, LEAST, MOST)'"


@checked
@dataclass(frozen=True)
class Lognormal:
    """Radii whose logarithms are normal about ln(median), with spread sigma, none outside least … most.

    Parameters
    ----------
    median
        [m] > 0.
    sigma
        standard deviation of ln r, 0 < σ ≤ 2.
    least, most : optional
        [m]; by default 3 σ from the median, which cuts 0.27 %.  What falls outside is drawn again.
    """

    median: Any
    sigma: Any
    least: Any = None
    most: Any = None

    def bounds(self) -> tuple[float, float]:
        """Least and most radius [m].  Raises BadInput."""
        middle, spread = si(self.median, "m", "median of the radii", above=0.0), self._spread()
        least = middle * math.exp(-3.0 * spread) if self.least is None else self.least
        most = middle * math.exp(3.0 * spread) if self.most is None else self.most
        return _bounds(least, most)

    def _spread(self) -> float:
        spread = si(self.sigma, "1", "sigma of the radii", above=0.0)
        if spread > 2.0:
            raise BadInput(f"sigma of the radii = {self.sigma!r} must not exceed 2")
        return spread

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Radii (count,) [m].  Raises BadInput."""
        from scipy.special import ndtr, ndtri

        (least, most), spread = self.bounds(), self._spread()
        middle = math.log(si(self.median, "m", "median of the radii", above=0.0))
        low, high = (float(ndtr((math.log(v) - middle) / spread)) for v in (least, most))
        if high - low < 1e-12:
            raise BadInput("radii: hardly any of this lognormal law lie between least and most; move the bounds")
        drawn = np.exp(middle + spread * ndtri(low + (high - low) * rng.random(count)))
        return np.clip(drawn, least, most)


@checked
@dataclass(frozen=True)
class PowerLaw:
    """Radii with dN/dr ∝ r^exponent between least and most.

    Parameters
    ----------
    exponent
        such as −3.5 (Mathis, Rumpl & Nordsieck 1977).
    least, most
        [m], at most a factor of 200 apart.
    """

    exponent: Any
    least: Any
    most: Any

    def bounds(self) -> tuple[float, float]:
        """Least and most radius [m].  Raises BadInput."""
        return _bounds(self.least, self.most)

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Radii (count,) [m].  Raises BadInput."""
        (least, most), power = self.bounds(), si(self.exponent, "1", "exponent of the radii") + 1.0
        if abs(power) > 100.0:
            raise BadInput(f"exponent of the radii = {self.exponent!r} must lie within ±100")
        u, ratio = rng.random(count), math.log(most / least)
        if abs(power * ratio) < 1e-9:
            return least * np.exp(u * ratio)
        return np.clip(least * np.exp(np.log1p(u * math.expm1(power * ratio)) / power), least, most)


def _bounds(least: Any, most: Any) -> tuple[float, float]:
    low, high = (si(v, "m", f"{n} of the radii", above=0.0) for v, n in ((least, "least"), (most, "most")))
    if not low < high:
        raise BadInput(f"radii: least = {format_quantity(low, 'm')} must be below most = {format_quantity(high, 'm')}")
    _refuse_wide(low, high)
    return low, high


def _refuse_wide(low: float, high: float) -> None:
    if high > WIDEST * low:
        raise BadInput(
            f"radii from {format_quantity(low, 'm')} to {format_quantity(high, 'm')} differ by a factor of {high / low:.3g}; such grains "
            f"do not pack into one aggregate, at most {WIDEST:g} is allowed: raise the least or lower the most"
        )


def radii_of(given: Any) -> Any:
    """One radius [m], N of them (N,), or a law, from a number, an array, or text.

    Text is a length, 'lognormal(0.1 um, 0.3)', 'lognormal(0.1 um, 0.3, 50 nm, 0.3 um)' or
    'power law(-3.5, 50 nm, 500 nm)'.

    Raises
    ------
    BadInput
        none of these.
    """
    if isinstance(given, (Lognormal, PowerLaw)):
        given.bounds()
        return given
    match = re.fullmatch(r"\s*(lognormal|power law)\s*\((.*)\)\s*", given) if isinstance(given, str) else None
    if match:
        words = [word.strip() for word in match.group(2).split(",")]
        if not (2 <= len(words) <= 4 if match.group(1) == "lognormal" else len(words) == 3):
            raise BadInput(f"radius = {given!r} has the wrong number of arguments; give {FORMS}")
        law: Any = (Lognormal if match.group(1) == "lognormal" else PowerLaw)(*words)
        law.bounds()
        return law
    values = in_unit(given, "m")
    if values is None:
        raise BadInput(f"radius = {shown(given)} is not known; give {FORMS}")
    if np.ndim(values) == 0:
        return si(given, "m", "radius", above=0.0)
    values = np.asarray(values)
    bad = np.flatnonzero(~(np.isfinite(values) & (values > 0.0))) if values.ndim == 1 else [0]
    if len(bad):
        raise BadInput(f"radius: give N numbers above 0 in m; that of grain {bad[0]} is not")
    _refuse_wide(float(values.min()), float(values.max()))
    return values


class Population(NamedTuple):
    """Grains that have no places yet."""

    radius: np.ndarray  # (N,) [m]
    material: list[Material]  # N of them
    grain_set: GrainSet  # the same for kernels


def population(count: int, radius: Any, material: Any, rng: np.random.Generator) -> Population:
    """So many grains.

    Parameters
    ----------
    radius
        as for `radii_of`.
    material
        one, or N of them, or parts of each as {"silica": 0.7, "iron": 0.3}: the grains that get it are
        drawn by chance, their number is N times the part to within rounding (of a whole deposit for `rbd`).

    Raises
    ------
    BadInput
        numbers of radii or materials that are not N, parts that are not positive, or grains so small that
        they would sink into one another.
    """
    size, kinds = radii_of(radius), _materials(material, count, rng)
    if isinstance(size, np.ndarray) and len(size) != count:
        raise BadInput(f"radius has {len(size)} entries but there are {count} grains; give as many, or a law")
    if isinstance(size, float):
        size = np.full(count, size)
    elif not isinstance(size, np.ndarray):
        size = size.draw(count, rng)
    return Population(size, kinds, grain_set_of(size, kinds))


def _materials(given: Any, count: int, rng: np.random.Generator) -> list[Material]:
    if not isinstance(given, Mapping):
        distinct, index = materials_of(given, count)
        return [distinct[k] for k in index]
    parts = np.array([si(part, "1", f"part of {name}", above=0.0) for name, part in given.items()])
    if not len(parts):
        raise BadInput("material = {} names no material; give parts such as {'silica': 0.7, 'iron': 0.3}")
    kinds = [as_material(m) for m in given]
    ends = np.rint(count * np.cumsum(parts) / parts.sum()).astype(int)
    index = rng.permutation(np.searchsorted(ends, np.arange(count), side="right"))
    return [kinds[k] for k in index]


def grain_set_of(radius: np.ndarray, kinds: list[Material]) -> GrainSet:
    """The grains for kernels.

    Raises
    ------
    BadInput
        grains so small that two of them at rest overlap by more than half the smaller radius.
    """
    distinct, index = materials_of(kinds, len(radius))
    pairings = [[pairing_between(_sticky(a), _sticky(b)) for b in distinct] for a in distinct]
    gamma, modulus = (np.array([[p[k] for p in row] for row in pairings], dtype=float) for k in (0, 1))
    for a in range(len(distinct)):
        for b in range(len(distinct)):
            small, other = float(radius[index == a].min()), float(radius[index == b].max())
            reduced = small * other / (small + other)
            sunk = rest_overlap(rest_radius(gamma[a, b], reduced, modulus[a, b]), reduced)
            if sunk > DEEPEST * small:
                raise BadInput(
                    f"grains of {distinct[a].name} of radius {format_quantity(small, 'm')} would sink by {format_quantity(sunk, 'm')} "
                    f"into grains of {distinct[b].name}: too small for JKR contacts; take larger ones"
                )
    mass = np.array([m.density for m in distinct])[index] * (4.0 / 3.0 * np.pi) * radius**3
    return GrainSet(radius, mass, index.astype(np.int64), gamma, modulus, float(radius.max()))


def _sticky(material: Material) -> Material:
    """The material, without adhesion where no surface energy is known."""
    return material if material.surface_energy is not None else material.but(surface_energy=0.0)


def rest_distances(grain_set: GrainSet, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Distances of the centres of pairs of grains in contact at rest [m]: r1 + r2 − δ0."""
    r1, r2 = grain_set.radius[first], grain_set.radius[second]
    pair = grain_set.material[first], grain_set.material[second]
    reduced = r1 * r2 / (r1 + r2)
    return (
        r1 + r2 - rest_overlap(rest_radius(grain_set.surface_energy[pair], reduced, grain_set.modulus[pair]), reduced)
    )


class Streams(NamedTuple):
    """Sources of chance that do not depend on one another."""

    population: np.random.Generator
    places: np.uint64  # seed for kernels
    moments: np.random.Generator


def whole(number: Any, name: str) -> int:
    """A number of grains, from 1 to what a machine can hold.  Raises BadInput."""
    return whole_number(number, name, 1, MOST_GRAINS)


def streams(seed: Any) -> Streams:
    """Raises BadInput for a seed that is not a whole number."""
    one, two, three = np.random.SeedSequence(seed_given(seed)).spawn(3)
    return Streams(np.random.default_rng(one), two.generate_state(1, np.uint64)[0], np.random.default_rng(three))


def centred_grains(position: np.ndarray, made: Population) -> Grains:
    """Grains at these places (N, 3) [m], at rest, their centre of mass at the origin."""
    middle = np.average(position, axis=0, weights=made.grain_set.mass)
    return Grains(position - middle, made.radius, made.material)
