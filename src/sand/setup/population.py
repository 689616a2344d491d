"""Radii and materials of the grains of an aggregate, before their positions are known."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..basics.arguments import MOST_GRAINS, checked
from ..basics.conversion import kind_of
from ..basics.errors import BadInput, shown
from ..basics.grains import Grains, materials_of
from ..basics.material import Material, as_material
from ..basics.units import dimensions, format_quantity, in_unit, not_a_quantity, seed_given, si, whole_number
from ..contact.jkr import rest_overlap, rest_radius
from ..contact.mixing import pairing_between
from ._kernels.hash_grid import GrainSet

WIDEST = 200.0
"""Largest ratio of radii; above it nearly all grains of a power law are too small to matter."""
DEEPEST = 0.5
"""Largest equilibrium overlap, in units of the smaller radius, for which JKR theory is used."""
FRACTION_ROUNDING = 1e-6
"""Largest deviation of a sum of fractions from 1."""
FORMS = "a length, N of them, 'lognormal(MEDIAN, SIGMA, LEAST, MOST)' or 'power law(EXPONENT, LEAST, MOST)'"


@checked
@dataclass(frozen=True)
class Lognormal:
    """Truncated lognormal distribution of radii: ln r is normal about ln(median) with standard deviation sigma.

    Parameters
    ----------
    median : float or str
        Median [m] > 0.
    sigma : float
        Standard deviation of ln r, 0 < σ ≤ 2.
    least, most : float or str, optional
        Range of the radii [m], 3 σ from the median by default, which excludes 0.27 % of the distribution.

    Raises
    ------
    BadInput
        If a number is invalid.
    """

    median: Any
    sigma: Any
    least: Any = None
    most: Any = None

    def __post_init__(self) -> None:
        median = si(self.median, "m", "median of the radii", above=0.0)
        sigma = si(self.sigma, "1", "sigma of the radii", above=0.0)
        if sigma > 2.0:
            raise BadInput(f"sigma of the radii = {self.sigma!r} must not exceed 2")
        least = median * math.exp(-3.0 * sigma) if self.least is None else self.least
        most = median * math.exp(3.0 * sigma) if self.most is None else self.most
        _set(self, median=median, sigma=sigma, **_bounds(least, most))

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Draw radii (count,) [m] by inversion. Raises BadInput."""
        from scipy.special import ndtr, ndtri

        middle = math.log(self.median)
        low, high = (float(ndtr((math.log(v) - middle) / self.sigma)) for v in (self.least, self.most))
        if high - low < 1e-12:
            raise BadInput("radii: less than 1e-12 of this lognormal distribution lies between least and most")
        drawn = np.exp(middle + self.sigma * ndtri(low + (high - low) * rng.random(count)))
        return np.clip(drawn, self.least, self.most)


@checked
@dataclass(frozen=True)
class PowerLaw:
    """Power-law distribution of radii: dN/dr ∝ r^exponent for least ≤ r ≤ most.

    Parameters
    ----------
    exponent : float
        For example −3.5 (Mathis, Rumpl & Nordsieck 1977).
    least, most : float or str
        Range [m], with a ratio of at most 200.

    Raises
    ------
    BadInput
        If a number is invalid.
    """

    exponent: Any
    least: Any
    most: Any

    def __post_init__(self) -> None:
        exponent = si(self.exponent, "1", "exponent of the radii")
        if abs(exponent + 1.0) > 100.0:
            raise BadInput(f"exponent of the radii = {self.exponent!r} must lie within ±100")
        _set(self, exponent=exponent, **_bounds(self.least, self.most))

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Draw radii (count,) [m] by inversion."""
        power, u, ratio = self.exponent + 1.0, rng.random(count), math.log(self.most / self.least)
        if abs(power * ratio) < 1e-9:
            return self.least * np.exp(u * ratio)
        drawn = self.least * np.exp(np.log1p(u * math.expm1(power * ratio)) / power)
        return np.clip(drawn, self.least, self.most)


def _set(law: Lognormal | PowerLaw, **numbers: float) -> None:
    """Replace the given values of a frozen object by SI numbers."""
    for name, number in numbers.items():
        object.__setattr__(law, name, number)


def _bounds(least: Any, most: Any) -> dict[str, float]:
    """Smallest and largest radius [m]. Raises BadInput."""
    low, high = (si(v, "m", f"{n} of the radii", above=0.0) for v, n in ((least, "least"), (most, "most")))
    if not low < high:
        raise BadInput(f"radii: least = {format_quantity(low, 'm')} must be below most = {format_quantity(high, 'm')}")
    _refuse_wide(low, high)
    return {"least": low, "most": high}


def _refuse_wide(low: float, high: float) -> None:
    if high > WIDEST * low:
        raise BadInput(
            f"radii from {format_quantity(low, 'm')} to {format_quantity(high, 'm')} differ by a factor of "
            f"{high / low:.3g}; at most {WIDEST:g} is allowed: raise the least or lower the most"
        )


def radii_of(given: Any) -> Any:
    """Read radii from a number, an array or text.

    Text is a length, 'lognormal(0.1 um, 0.3)', 'lognormal(0.1 um, 0.3, 50 nm, 0.3 um)' or 'power law(-3.5, 50 nm, 500
    nm)'.

    Returns
    -------
    float or ndarray or Lognormal or PowerLaw
        One radius [m], radii (N,) [m], or a distribution.

    Raises
    ------
    BadInput
        If it is none of these.
    """
    if isinstance(given, (Lognormal, PowerLaw)):
        return given
    match = re.fullmatch(r"\s*(lognormal|power law)\s*\((.*)\)\s*", given) if isinstance(given, str) else None
    if match:
        words = [word.strip() for word in match.group(2).split(",")]
        if match.group(1) == "lognormal" and len(words) == 1:
            raise BadInput(f"radius = {given!r} lacks its width SIGMA; give {FORMS}")
        if not (2 <= len(words) <= 4 if match.group(1) == "lognormal" else len(words) == 3):
            raise BadInput(f"radius = {given!r} has the wrong number of arguments; give {FORMS}")
        return (Lognormal if match.group(1) == "lognormal" else PowerLaw)(*words)
    texts = isinstance(given, (list, tuple)) and any(isinstance(one, str) for one in given)
    values = [si(one, "m", f"radius of grain {k}") for k, one in enumerate(given)] if texts else in_unit(given, "m")
    if values is None:
        if dimensions(given):
            raise not_a_quantity(given, "m", "radius")
        raise BadInput(f"radius = {shown(given)} is {kind_of(given)}not a radius or a distribution; give {FORMS}")
    if np.ndim(values) == 0:
        return si(given, "m", "radius", above=0.0)
    values = np.asarray(values)
    is_list = values.ndim == 1 and values.size > 0
    bad = np.flatnonzero(~(np.isfinite(values) & (values > 0.0))) if is_list else [0]
    if len(bad):
        raise BadInput(f"radius: give N numbers above 0 in m; that of grain {bad[0]} is not")
    _refuse_wide(float(values.min()), float(values.max()))
    return values


class Population(NamedTuple):
    """Radii and materials of N grains."""

    radius: np.ndarray  # (N,) [m]
    material: list[Material]  # material of each grain
    grain_set: GrainSet  # properties for the kernels


def population(count: int, radius: Any, material: Any, rng: np.random.Generator) -> Population:
    """Radii and materials of `count` grains.

    Parameters
    ----------
    count : int
        Number of grains N.
    radius : float or str or array_like or Lognormal or PowerLaw
        As for `radii_of`.
    material : Material or str or sequence or mapping
        One material, N of them, or fractions with the sum 1, {"silica": 0.7, "iron": 0.3}: randomly chosen grains get
        each material, N times the fraction to within rounding (for `rbd` N is the number of grains of the deposit).
    rng : Generator
        Source of random numbers.

    Raises
    ------
    BadInput
        If the number of radii or materials is not N, a fraction is not positive, their sum is not 1, or grains are too
        small for JKR contacts.
    """
    size, kinds = drawn(count, radius, material, rng)
    return Population(size, kinds, grain_set_of(size, kinds))


def drawn(count: int, radius: Any, material: Any, rng: np.random.Generator) -> tuple[np.ndarray, list[Material]]:
    """Radii (N,) [m] and materials of `count` grains; arguments and errors as for `population`, any size of grains."""
    size, kinds = radii_of(radius), _materials(material, count, rng)
    if isinstance(size, np.ndarray) and len(size) != count:
        raise BadInput(f"radius has {len(size)} entries but there are {count} grains; give {count}, or a distribution")
    if isinstance(size, float):
        size = np.full(count, size)
    elif not isinstance(size, np.ndarray):
        size = size.draw(count, rng)
    return size, kinds


def _materials(given: Any, count: int, rng: np.random.Generator) -> list[Material]:
    if not isinstance(given, Mapping):
        distinct, index = materials_of(given, count)
        return [distinct[k] for k in index]
    numbers = divided(count, fractions_of(given, "material"))
    kinds = [as_material(m) for m in given]
    return [kinds[k] for k in rng.permutation(np.repeat(np.arange(len(kinds)), numbers))]


def fractions_of(given: Mapping[Any, Any], name: str) -> np.ndarray:
    """Check fractions of a mixture by name, each above 0, with the sum 1 to `FRACTION_ROUNDING`.

    Raises
    ------
    BadInput
        If they are not; `name` is the argument, for the message.
    """
    if not given:
        raise BadInput(f"{name} = {{}} names no material; give fractions such as {{'silica': 0.7, 'iron': 0.3}}")
    label = {m: getattr(m, "name", m) for m in given}
    fractions = np.array([si(part, "1", f"{name}: part of {label[m]}", above=0.0) for m, part in given.items()])
    refuse_sum(fractions, f"{name}: the fractions {', '.join(f'{v:g}' for v in fractions)}")
    return fractions


def refuse_sum(fractions: np.ndarray, label: str) -> None:
    """Raise BadInput if fractions do not add up to 1; `label` begins the message."""
    total = float(np.sum(fractions))
    if abs(total - 1.0) > FRACTION_ROUNDING:
        raise BadInput(f"{label} have the sum {total:.6g}; it must be 1")


def divided(count: int, fractions: np.ndarray) -> np.ndarray:
    """Divide `count` grains by fractions with the sum 1: N times each fraction, to within rounding."""
    ends = np.rint(count * np.cumsum(fractions) / np.sum(fractions)).astype(int)
    return np.diff(ends, prepend=0)


def grain_set_of(radius: np.ndarray, kinds: list[Material]) -> GrainSet:
    """Properties of grains for the kernels.

    Raises
    ------
    BadInput
        If grains are so small that the equilibrium overlap of a pair exceeds half the smaller radius.
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
                    f"grains of {distinct[a].name} of radius {format_quantity(small, 'm')} would overlap grains of "
                    f"{distinct[b].name} by {format_quantity(sunk, 'm')}: too small for JKR contacts; use larger grains"
                )
    mass = np.array([m.density for m in distinct])[index] * (4.0 / 3.0 * np.pi) * radius**3
    return GrainSet(radius, mass, index.astype(np.int64), gamma, modulus, float(radius.max()))


def _sticky(material: Material) -> Material:
    """The material, with zero surface energy if none is defined."""
    return material if material.surface_energy is not None else material.but(surface_energy=0.0)


def rest_distances(grain_set: GrainSet, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Equilibrium distances of the centres of pairs of grains in contact [m]: r1 + r2 − δ0."""
    r1, r2 = grain_set.radius[first], grain_set.radius[second]
    pair = grain_set.material[first], grain_set.material[second]
    reduced = r1 * r2 / (r1 + r2)
    return (
        r1 + r2 - rest_overlap(rest_radius(grain_set.surface_energy[pair], reduced, grain_set.modulus[pair]), reduced)
    )


class RandomStreams(NamedTuple):
    """Independent sources of random numbers."""

    population: np.random.Generator
    positions: np.uint64  # seed for kernels
    moments: np.random.Generator


def grain_count(number: Any, name: str) -> int:
    """Check a number of grains, from 1 to `MOST_GRAINS`. Raises BadInput."""
    return whole_number(number, name, 1, MOST_GRAINS)


def random_streams(seed: Any) -> RandomStreams:
    """Independent streams of random numbers from one seed. Raises BadInput if it is not a whole number."""
    one, two, three = np.random.SeedSequence(seed_given(seed)).spawn(3)
    return RandomStreams(np.random.default_rng(one), two.generate_state(1, np.uint64)[0], np.random.default_rng(three))


def centred_grains(position: np.ndarray, sample: Population) -> Grains:
    """Grains at rest at these positions (N, 3) [m], shifted so that their centre of mass is the origin."""
    middle = np.average(position, axis=0, weights=sample.grain_set.mass)
    return Grains(position - middle, sample.radius, sample.material)
