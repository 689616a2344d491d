"""Parameters of the tree sum of dipoles: total degree p and opening angle θ for an accuracy.

Errors are rms errors of force and flux density at a grain, relative to those of all grains farther away than the radius
a of the volume of a grain, F = √6 kμ²/a⁴ and B = √2 kμ/a³ (as for an Ewald sum, `ewald`), for dipoles at random.  The
omitted terms of two grains at distance s from each other within cells at distance R are Σ_{n>p} sⁿ Pₙ/Rⁿ⁺¹.  Averaged
over directions, the terms of degree n of the loads are, with t = s/R and relative to the loads of the pair at R,

    δB² = n (n−1) (2n−1)/6 t²ⁿ⁻⁴,  δF² = n (n−1) (n−2) (2n−1) (2n−3)/90 t²ⁿ⁻⁶

(the gradient of a harmonic polynomial of degree n has the mean square n (2n+1) ⟨ψ²⟩/s²).  Cells of half diagonal r are
used at distances from R = 2r/θ on, where t ≤ θ s/2r; they are halved as soon as the next smaller are far enough, so
that the largest s/R is between θ/1.5 and θ.  Summed over all distances from that of the leaves, R, on, the errors are

    ΔB = (a/R)^(3/2) δB,  ΔF = (a/R)^(5/2) δF
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from ...basics.alignment import padded_size
from ...basics.constants import MAGNETIC
from .long_range_loops import PARALLEL_FROM
from .multipoles import LANES, tables
from .tree_cells import LARGE_FROM, LEAF, MOST_BLOCKS, SOME_BLOCKS, Cells
from .tree_loops import SOURCES, Scratch, TreeParameters

TREE_FROM = 5000
"""Fewest grains for which "auto" uses a tree: it takes half as long as all pairs there."""
DEGREES = range(3, 17)
OPENINGS = tuple(round(0.05 * k, 2) for k in range(6, 17))
"""Total degrees and opening angles that are compared."""
ACCURACIES = 1e-6, 0.1
"""Smallest and largest accuracy."""
SHAPES = (1.0, 1.0, 1.0), (1.0, 1.0, 0.5), (1.0, 0.5, 0.5)
"""Sides of the cells of a uniform gas, halved along one side after the other."""
HALVED = 1.5
"""Ratio of the largest to the smallest s/R of the pairs of cells that are summed."""
SAFETY = 2.0
"""Factor of the predicted errors, for leaves of few grains and for densities that vary."""
OMITTED = 40
"""Degrees beyond p of which the error is summed."""


class TreeChoice(NamedTuple):
    """Parameters of a tree sum, with its predicted errors."""

    degree: int  # p
    opening: float  # θ
    force_error: float
    torque_error: float


def levels_for(count: int) -> int:
    """Level of the leaves: the first at which they have at most LEAF grains."""
    return max(math.ceil(math.log2(count / LEAF) - 1e-12), 0) if count > 0 else 0


@functools.cache
def spread(half: int, sides: tuple[float, float, float]) -> float:
    """⟨s^2m⟩/(2r)^2m, m = `half`, of the distance s of two points in two equal parallel boxes of half diagonal r."""
    found = 0.0
    for i in range(half + 1):
        for j in range(half + 1 - i):
            powers = i, j, half - i - j
            ways = math.factorial(half) / math.prod(map(math.factorial, powers))
            found += ways * math.prod(
                2.0 * side ** (2 * q) / ((2 * q + 1) * (2 * q + 2)) for side, q in zip(sides, powers, strict=True)
            )
    return found / sum(side**2 for side in sides) ** half


@functools.cache
def spread_of_cells(half: int) -> float:
    """Mean of `spread` over the shapes of cells."""
    return sum(spread(half, sides) for sides in SHAPES) / len(SHAPES)


@functools.cache
def predicted_errors(degree: int, opening: float, grains: float) -> tuple[float, float]:
    """ΔF and ΔB for leaves of so many grains."""
    force = field = 0.0
    for n in range(degree + 1, degree + OMITTED):
        for power, factor, which in (
            (2 * n - 6, n * (n - 1) * (n - 2) * (2 * n - 1) * (2 * n - 3) / 90.0, "force"),
            (2 * n - 4, n * (n - 1) * (2 * n - 1) / 6.0, "field"),
        ):
            mean = (1.0 - HALVED**-power) / (power * math.log(HALVED))  # over equal intervals of ln t
            square = factor * opening**power * spread_of_cells(power // 2) * mean
            force, field = (force + square, field) if which == "force" else (force, field + square)
    # half diagonal in units of a; the outermost of s grains on a line are 2/(s + 1) of it inside a cell
    side = (4.0 * math.pi / 3.0 * grains) ** (1.0 / 3.0)
    halves = [0.5 * math.sqrt(sum(q * q for q in s)) / math.prod(s) ** (1.0 / 3.0) for s in SHAPES]
    distance = 2.0 * side * sum(halves) / len(halves) * (1.0 - 2.0 / (grains + 1.0)) / opening
    return SAFETY * math.sqrt(force) * distance**-2.5, SAFETY * math.sqrt(field) * distance**-1.5


def cost(degree: int, opening: float) -> float:
    """Time per grain, in units of 1.0 us on a Zen 3 core: near pairs, derivatives, products of expansions."""
    products = sum((2 * n + 1) * ((degree + 1 - n) ** 2 - 1) for n in range(1, degree))
    return (2.6 + 0.01 * (degree + 1) ** 2 + 0.0008 * products) * opening**-2.2


@functools.lru_cache(64)
def choose_tree(count: int, accuracy: float) -> TreeChoice:
    """The cheapest degree and opening angle for an accuracy, for so many grains."""
    leaf = max(count / (1 << levels_for(count)), 0.5 * LEAF)
    found = []
    for degree in DEGREES:
        for opening in OPENINGS:
            errors = predicted_errors(degree, opening, leaf)
            if max(errors) <= accuracy:
                found.append((cost(degree, opening), TreeChoice(degree, opening, *errors)))
    return min(found)[1]


def tree_parameters(count: int, degree: int, opening: float) -> TreeParameters:
    """Parameters of the loops, with the memory for `count` grains."""
    levels, few = levels_for(count), degree**2
    leaves = 1 << levels
    blocks = min(leaves, 1 if count < PARALLEL_FROM else SOME_BLOCKS if count < LARGE_FROM else MOST_BLOCKS)
    number = (degree + 1) ** 2 + degree * (degree - 1) // 2
    return TreeParameters(
        MAGNETIC,
        opening,
        tables(degree),
        Cells(
            np.zeros(count, np.uint32),
            np.zeros((3, 2 * leaves - 1)),
            np.zeros((2, 2 * leaves - 1)),
            np.zeros((2 * leaves - 1, few)),
        ),
        Scratch(
            np.zeros((blocks, levels + 2, leaves), np.uint32),
            np.zeros((blocks, levels + 2), np.int64),
            np.zeros((blocks, levels + 1, number)),
            np.zeros((blocks, leaves), np.uint32),
            np.zeros((blocks, LANES), np.uint32),
            np.zeros((blocks, 3, LANES)),
            np.zeros((blocks, LANES)),
            np.zeros((blocks, number, LANES)),
            np.zeros((blocks, number, LANES)),
            np.zeros((blocks, number, LANES)),
            np.zeros((blocks, 6, SOURCES)),
            np.zeros((blocks, 6, padded_size(LEAF) + LANES)),
            np.zeros((blocks, 12)),
        ),
    )
