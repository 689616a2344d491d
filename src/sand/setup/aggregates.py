"""Regular aggregates (chains and lattices), and the registry of all aggregate builders."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..basics.arguments import MOST_GRAINS, checked
from ..basics.errors import BadInput, did_you_mean, shown
from ..basics.grains import Grains
from ..basics.material import PRESETS, Material, as_material
from ..basics.units import dimensions, si
from .deposit import rbd
from .fractal import fractal
from .growing import bcca, bpca, dla, dlca
from .moments import assign_moments, magnetic_fraction
from .population import (
    RandomStreams,
    centred_grains,
    grain_count,
    grain_set_of,
    population,
    random_streams,
    rest_distances,
)


@checked
def rest_distance(material: Material | str, radius: float) -> float:
    """Distance of the centres of two equal grains in mechanical equilibrium [m]: 2r − δ0.

    Parameters
    ----------
    material : Material or str
        Material or name of a preset.
    radius : float
        Radius of both grains [m] > 0.

    Raises
    ------
    BadInput
        If the radius is not above 0, or so small that the grains would overlap by more than half of it.
    """
    one, size = as_material(material), si(radius, "m", "radius", above=0.0)
    pair = grain_set_of(np.full(2, size), [one, one])
    return float(rest_distances(pair, np.array([0]), np.array([1]))[0])


@checked
def grain(*, radius: Any, material: Any, moment: Any = None, moments: str = "aligned", seed: int = 0) -> Grains:
    """A single grain at the origin.

    Parameters as for `chain`.
    """
    return chain(1, radius=radius, material=material, moment=moment, moments=moments, seed=seed)


@checked
def chain(
    grains: int, *, radius: Any, material: Any, moment: Any = None, moments: str = "aligned", magnetic: Any = 1.0,
    seed: int = 0,
) -> Grains:  # fmt: skip
    """A straight chain along x with contacts in mechanical equilibrium and its centre of mass at the origin.

    Parameters
    ----------
    grains : int
        Number of grains N ≥ 1.
    radius, material, moment, magnetic, seed
        As for `bpca`.
    moments : str, optional
        "aligned": along the chain, head to tail; "random" or "relaxed" as for `bpca`.

    Raises
    ------
    BadInput
        If N < 1, a radius is not positive, or a grain is so small that its neighbours touch.
    """
    count, rng = grain_count(grains, "grains of a chain"), random_streams(seed)
    sample = population(count, radius, material, rng.population)
    number = np.arange(count)
    position = np.zeros((count, 3))
    position[1:, 0] = np.cumsum(rest_distances(sample.grain_set, number[:-1], number[1:]))
    across = position[2:, 0] - position[:-2, 0] - sample.radius[2:] - sample.radius[:-2]
    if (across <= 0.0).any():
        small = int(np.argmin(across)) + 1
        raise BadInput(f"grain {small} of the chain is so small that its neighbours touch; use larger grains")
    return assign_moments(centred_grains(position, sample), moment, moments, magnetic, rng.moments, axis=0)


@checked
def lattice(
    nx: int, ny: int | None = None, nz: int | None = None, *, radius: Any, material: Any, moment: Any = None,
    moments: str = "random", magnetic: Any = 1.0, seed: int = 0,
) -> Grains:  # fmt: skip
    """A centred simple cubic lattice of nx × ny × nz equal grains, contacts in equilibrium.

    Parameters
    ----------
    nx : int
        Number of grains along x.
    ny, nz : int, optional
        Numbers along y and z; nx by default.
    radius, material, moment, moments, magnetic, seed
        As for `bpca`, but one radius and one material.

    Raises
    ------
    BadInput
        If a number is not a whole number ≥ 1, or the grains are not equal, so that not all contacts can be in
        equilibrium.
    """
    grid, rng = _sites(nx, ny, nz), random_streams(seed)
    return _regular(grid, radius, material, moment, moments, magnetic, rng)


@checked
def hexagonal(
    nx: int, ny: int | None = None, nz: int | None = None, *, radius: Any, material: Any, moment: Any = None,
    moments: str = "random", magnetic: Any = 1.0, seed: int = 0,
) -> Grains:  # fmt: skip
    """Hexagonal close packing (A B A B …): nz triangular layers of ny rows of nx equal grains, in equilibrium.

    Grains in the interior have twelve contacts; the filling factor is 0.74. nz = 1 gives a single triangular layer.
    Parameters and errors as for `lattice`.
    """
    i, j, k = _sites(nx, ny, nz).T
    i, j, k = i - i.min(), j - j.min(), k - k.min()
    odd = k % 2
    grid = np.column_stack([i + 0.5 * ((j + odd) % 2), np.sqrt(0.75) * (j + odd / 3.0), np.sqrt(2.0 / 3.0) * k])
    return _regular(grid, radius, material, moment, moments, magnetic, random_streams(seed))


def _sites(nx: int, ny: int | None, nz: int | None) -> np.ndarray:
    """Sites (N, 3) of a centred cubic lattice of unit spacing."""
    sides = [grain_count(n, "side of a lattice") for n in (nx, nx if ny is None else ny, nx if nz is None else nz)]
    if math.prod(sides) > MOST_GRAINS:
        raise BadInput(f"a lattice of {' x '.join(map(str, sides))} is too large: at most {MOST_GRAINS:.3g} grains")
    return np.stack(np.meshgrid(*(np.arange(n) - 0.5 * (n - 1) for n in sides), indexing="ij"), -1).reshape(-1, 3)


def _regular(
    grid: np.ndarray, radius: Any, material: Any, moment: Any, moments: str, magnetic: Any, rng: RandomStreams
) -> Grains:
    if (
        not isinstance(material, (str, Material))
        or (isinstance(radius, str) and "(" in radius)
        or dimensions(radius) > 0
    ):
        raise BadInput("a lattice is in equilibrium only if its grains are equal: give one radius and one material")
    r = si(radius, "m", "radius", above=0.0)
    sample = population(len(grid), r, material, rng.population)
    spacing = rest_distance(material, r)
    return assign_moments(centred_grains(spacing * grid, sample), moment, moments, magnetic, rng.moments)


KINDS: dict[str, Callable[..., Grains]] = {
    "grain": grain,
    "chain": chain,
    "lattice": lattice,
    "hexagonal": hexagonal,
    "bpca": bpca,
    "bcca": bcca,
    "dla": dla,
    "dlca": dlca,
    "fractal": fractal,
    "rbd": rbd,
}
"""Builders by name, as in case files."""
_DIMENSIONS = {"chain": "1", "bcca": "1.9", "dla": "2.5", "dlca": "1.8"}
"""Fractal dimensions for messages; 3 for all others."""


@checked
def build(
    kind: str, grains: int | None = None, *, shape: Sequence[int] | None = None, seed: int = 0, **given: Any
) -> Grains:
    """Build an aggregate by the name of its builder, as in case files and `sand build`.

    Parameters
    ----------
    kind : str
        A name of `KINDS`.
    grains : int or None, optional
        Number of grains N; for lattices a cube number, or None with a `shape`.
    shape : sequence of int, optional
        Numbers of grains [nx, ny, nz] of a lattice.
    seed : int, optional
        Seed of the random numbers.
    **given
        Other arguments of the builder; arguments that are None keep its default.

    Raises
    ------
    BadInput
        If an argument does not apply to this builder, or the builder raises it.
    """
    if kind not in KINDS:
        advice = f"a material; allowed: {', '.join(KINDS)}" if kind in PRESETS else did_you_mean(kind, list(KINDS))
        raise BadInput(f"kind = {kind!r}; {advice}")
    if shape is not None and len(shape) != 3:
        raise BadInput(f"shape = {shown(shape)} must be three whole numbers, such as [5, 5, 5]")
    wanted = {name: value for name, value in given.items() if value is not None}
    if kind != "fractal" and (extra := [n for n in ("dimension", "prefactor") if n in wanted]):
        dimension = _DIMENSIONS.get(kind, "3")
        raise BadInput(
            f"{extra[0]} = {wanted[extra[0]]!r}: a {kind} always has a dimension of about {dimension}; "
            "leave it out, or use kind = 'fractal'"
        )
    if kind in ("lattice", "hexagonal"):
        return KINDS[kind](*(shape or _cube(kind, grains)), seed=seed, **wanted)
    if shape is not None:
        raise BadInput(f"shape = {list(shape)!r} is for lattice and hexagonal; a {kind} takes a number of grains")
    if kind == "grain":
        if grains not in (None, 1):
            raise BadInput(f"grains = {grains!r}: kind = 'grain' is a single one; leave it out")
        return grain(seed=seed, **wanted)
    if grains is None:
        raise BadInput(f"grains is missing: how many does the {kind} have?")
    # checked before the aggregate is built, which may take minutes
    magnetic_fraction(wanted.get("moment"), wanted.get("moments", "random"), wanted.get("magnetic", 1.0))
    return KINDS[kind](grains, seed=seed, **wanted)


def _cube(kind: str, grains: int | None) -> tuple[int]:
    if grains is None:
        raise BadInput(f"shape is missing: three whole numbers, such as [5, 5, 5], of the {kind}")
    side = round(grain_count(grains, "grains of a lattice") ** (1.0 / 3.0))
    if side**3 != grains:
        raise BadInput(f"{grains} is not a cube number; give a shape [nx, ny, nz], or {side**3} grains")
    return (side,)
