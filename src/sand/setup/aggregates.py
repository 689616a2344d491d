"""Aggregates: grains in contact at rest, to collide or to look at.  Here the regular ones, and the list of all."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..arguments import MOST_GRAINS, checked
from ..errors import BadInput, did_you_mean, shown
from ..grains import Grains
from ..material import PRESETS, Material, as_material
from ..units import si
from .ballistic import bcca, bpca
from .deposit import rbd
from .diffusion import dla, dlca
from .fractal import fractal
from .moments import magnetised, part_given
from .population import Streams, centred_grains, grain_set_of, population, rest_distances, streams, whole


@checked
def rest_distance(material: Material | str, radius: float) -> float:
    """Distance of the centres of two equal grains in contact at rest [m]: 2r − δ0."""
    one = as_material(material)
    pair = grain_set_of(np.full(2, radius), [one, one])
    return float(rest_distances(pair, np.array([0]), np.array([1]))[0])


@checked
def grain(*, radius: Any, material: Any, moment: Any = None, moments: str = "aligned", seed: int = 0) -> Grains:
    """A single grain at the origin."""
    return chain(1, radius=radius, material=material, moment=moment, moments=moments, seed=seed)


@checked
def chain(
    grains: int, *, radius: Any, material: Any, moment: Any = None, moments: str = "aligned", magnetic: Any = 1.0,
    seed: int = 0,
) -> Grains:  # fmt: skip
    """A straight chain along x, contacts at rest, its centre of mass at the origin.

    Parameters
    ----------
    grains : int
        N ≥ 1.
    moments : str, optional
        "aligned": along the chain, head to tail; "random" or "relaxed".
    radius, material, moment, magnetic, seed
        as for `bpca`.

    Raises
    ------
    BadInput
        a chain of length 0, a radius that is not positive, or grains so small that their neighbours touch.
    """
    count, chance = whole(grains, "grains of a chain"), streams(seed)
    made = population(count, radius, material, chance.population)
    number = np.arange(count)
    position = np.zeros((count, 3))
    position[1:, 0] = np.cumsum(rest_distances(made.grain_set, number[:-1], number[1:]))
    across = position[2:, 0] - position[:-2, 0] - made.radius[2:] - made.radius[:-2]
    if (across <= 0.0).any():
        small = int(np.argmin(across)) + 1
        raise BadInput(f"grain {small} of the chain is so small that its neighbours touch; take larger ones")
    return magnetised(centred_grains(position, made), moment, moments, magnetic, chance.moments, axis=0)


@checked
def lattice(
    nx: int, ny: int | None = None, nz: int | None = None, *, radius: Any, material: Any, moment: Any = None,
    moments: str = "random", magnetic: Any = 1.0, seed: int = 0,
) -> Grains:  # fmt: skip
    """A cubic lattice of nx × ny × nz equal grains, contacts at rest, centred (a cube if only nx is given).

    Raises
    ------
    BadInput
        sides that are not whole numbers, or grains that are not equal, for which no lattice can be at rest.
    """
    grid, chance = _sites(nx, ny, nz), streams(seed)
    return _regular(grid, radius, material, moment, moments, magnetic, chance)


@checked
def hexagonal(
    nx: int, ny: int | None = None, nz: int | None = None, *, radius: Any, material: Any, moment: Any = None,
    moments: str = "random", magnetic: Any = 1.0, seed: int = 0,
) -> Grains:  # fmt: skip
    """Hexagonal close packing: nz triangular layers, A B A B …, of ny rows of nx equal grains, contacts at rest.

    Inside each grain has twelve contacts, and 0.74 of space is filled; nz = 1 gives one triangular layer.

    Raises
    ------
    BadInput
        as for `lattice`.
    """
    i, j, k = _sites(nx, ny, nz).T
    i, j, k = i - i.min(), j - j.min(), k - k.min()
    odd = k % 2
    grid = np.column_stack(
        [i + 0.5 * ((j + odd) % 2), np.sqrt(0.75) * (j + odd / 3.0), np.sqrt(2.0 / 3.0) * k],
    )
    return _regular(grid, radius, material, moment, moments, magnetic, streams(seed))


def _sites(nx: int, ny: int | None, nz: int | None) -> np.ndarray:
    """Sites of a cubic lattice of unit spacing (N, 3), centred."""
    sides = [whole(n, "side of a lattice") for n in (nx, nx if ny is None else ny, nx if nz is None else nz)]
    if math.prod(sides) > MOST_GRAINS:
        raise BadInput(f"a lattice of {' x '.join(map(str, sides))} is too large: at most {MOST_GRAINS:.3g} grains")
    return np.stack(np.meshgrid(*(np.arange(n) - 0.5 * (n - 1) for n in sides), indexing="ij"), -1).reshape(-1, 3)


def _regular(
    grid: np.ndarray, radius: Any, material: Any, moment: Any, moments: str, magnetic: Any, chance: Streams
) -> Grains:
    if not isinstance(material, (str, Material)) or (isinstance(radius, str) and "(" in radius) or np.ndim(radius) > 0:
        raise BadInput(
            "the contacts of a lattice are all at rest only if its grains are equal: give one radius and one material"
        )
    r = si(radius, "m", "radius", above=0.0)
    made = population(len(grid), r, material, chance.population)
    spacing = rest_distance(material, r)
    return magnetised(centred_grains(spacing * grid, made), moment, moments, magnetic, chance.moments)


KINDS: dict[str, Callable[..., Grains]] = {
    "grain": grain,
    "chain": chain,
    "lattice": lattice,
    "hexagonal": hexagonal,
    "bpca": bpca,
    "pca": bpca,
    "bcca": bcca,
    "dla": dla,
    "dlca": dlca,
    "fractal": fractal,
    "rbd": rbd,
}
"""Builders by the name a case file gives them; "pca" is the former name of "bpca"."""


@checked
def build(
    kind: str, grains: int | None = None, *, shape: Sequence[int] | None = None, seed: int = 0, **given: Any
) -> Grains:
    """An aggregate of a kind that is named, as case files and `sand build` do.

    Parameters
    ----------
    kind : str
        a name of KINDS.
    grains : int or None, optional
        N; for lattices a cube number, or None with a `shape` [nx, ny, nz].
    given
        what else the builder takes; what is None is left to its default.

    Raises
    ------
    BadInput
        an argument that this kind has no use for, with the reason, and all that the builder refuses.
    """
    if kind not in KINDS:
        advice = f"a material; allowed: {', '.join(KINDS)}" if kind in PRESETS else did_you_mean(kind, list(KINDS))
        raise BadInput(f"kind = {kind!r}; {advice}")
    if shape is not None and len(shape) != 3:
        raise BadInput(f"shape = {shown(shape)} must be three whole numbers, such as [5, 5, 5]")
    wanted = {name: value for name, value in given.items() if value is not None}
    if kind != "fractal" and (told := [n for n in ("dimension", "prefactor") if n in wanted]):
        raise BadInput(f"{told[0]} = {wanted[told[0]]!r}: {_own(kind)}; leave it out, or take kind = 'fractal'")
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
    # before the aggregate grows, which may take long
    part_given(wanted.get("moment"), wanted.get("moments", "random"), wanted.get("magnetic", 1.0))
    return KINDS[kind](grains, seed=seed, **wanted)


def _own(kind: str) -> str:
    own = {"chain": "1", "lattice": "3", "hexagonal": "3", "rbd": "3", "bcca": "1.9", "dla": "2.5", "dlca": "1.8"}
    return f"a {kind} has a dimension of its own, about {own.get(kind, '3')}, at any size"


def _cube(kind: str, grains: int | None) -> tuple[int]:
    if grains is None:
        raise BadInput(f"shape is missing: three whole numbers, such as [5, 5, 5], of the {kind}")
    side = round(whole(grains, "grains of a lattice") ** (1.0 / 3.0))
    if side**3 != grains:
        raise BadInput(f"{grains} grains are no cube; give a shape [nx, ny, nz], or {side**3} grains")
    return (side,)
