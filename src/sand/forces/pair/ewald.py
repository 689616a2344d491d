"""Parameters of the Ewald sum of charges or dipoles: the choice of α, r_c and of the wave vectors for an accuracy.

Errors are rms errors at a grain, for N charges of equal size and random sign, or N dipoles of equal size in random
directions, at random positions.  They are relative to the rms loads of all grains farther away than the radius
a = (3V/4πN)^(1/3) of the volume of a grain, F = √3 kq²/a² of charges, F = √6 kμ²/a⁴ and B = √2 kμ/a³ of dipoles
(typical loads without those of close pairs), and to φ = kq/a.  From the real part (`ewald_fit`), and from the omitted
wave vectors, q > q_max (in the manner of Kolafa & Perram 1992 and Wang & Holm 2001, with n = N/V),

    charges  δF² = 4πn/r_c e_F² (kq²)²,   δF² = 8n ∫ exp(−q²/2α²) dq (kq²)²
             δφ² = 4πn r_c e_φ² (kq)²,    δφ² = 8n ∫ q⁻² exp(−q²/2α²) dq (kq)²
    dipoles  δF² = 4πn/r_c⁵ e_F² (kμ²)²,  δF² = (8n/9) ∫ q⁴ exp(−q²/2α²) dq (kμ²)²
             δB² = 4πn/r_c³ e_B² (kμ)²,   δB² = (8n/3) ∫ q² exp(−q²/2α²) dq (kμ)²
"""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import numpy as np

from ...box import Box
from ...errors import BadInput
from ...numerics.simd import padded_size
from .ewald_fit import DIPOLES, Sources, fitted
from .ewald_loops import UNUSED, Buffers, EwaldParameters, Waves
from .loops import ALL_PAIRS_BLOCKS, PARALLEL_FROM

DEGREES = {5e-2: 8, 1e-3: 12, 1e-4: 16, 1e-6: 24, 1e-8: 32}
"""Degree of the polynomial of the real part, by the smallest accuracy for which it is used."""
PRODUCTS = tuple(round(0.1 * k, 1) for k in range(16, 64))
"""Values of α r_c that are compared."""
RADII = 1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.25, 0.2, 0.15, 0.1
"""Values of r_c, in units of half the shortest side, that are compared."""
PAIR_COST, LISTED_COST, WAVE_COST = 1.0, 1.2, 0.16
"""Relative costs of a pair, of an entry of the Verlet list, and of a wave vector of one grain; 1 is 8 ns (Zen 3)."""
LIST_FROM, LIST_REACH, LIST_UP_TO = 64, 1.1, 0.38
"""Conditions for a Verlet list, as in `neighbours.settings`: grains, reach in units of r_c, fraction within reach."""
LARGEST_SPACING = 0.8
"""Upper limit of a in units of half the shortest side, for few grains and long boxes."""
MOST_WAVES = 1_000_000
"""Largest number of wave vectors, half of all."""


class EwaldChoice(NamedTuple):
    """Parameters of an Ewald sum, with its predicted errors."""

    alpha: float  # α [1/m]
    radius: float  # r_c [m]
    largest: float  # q_max [1/m]
    waves: int  # number of wave vectors, half of all
    degree: int  # of the polynomial of the real part
    product: float  # α r_c
    force_error: float
    field_error: float  # of torque (dipoles) or potential (charges)


def degree_for(accuracy: float) -> int:
    """Degree of the polynomial of the real part; the loops are compiled for each degree."""
    return next(degree for least, degree in DEGREES.items() if accuracy >= least or least == min(DEGREES))


def half_of_vectors(lengths: tuple[float, float, float], largest: float) -> np.ndarray:
    """Half of the integers (n_x, n_y, n_z) ≠ 0, (K, 3), with |q| ≤ `largest`, sorted by n_x, n_y, n_z."""
    most = [int(largest * side / (2.0 * math.pi)) for side in lengths]
    n_x, n_y, n_z = np.meshgrid(*(np.arange(-m if axis else 0, m + 1) for axis, m in enumerate(most)), indexing="ij")
    found = np.stack([n_x, n_y, n_z], axis=-1).reshape(-1, 3)
    half = (found[:, 0] > 0) | ((found[:, 0] == 0) & ((found[:, 1] > 0) | ((found[:, 1] == 0) & (found[:, 2] > 0))))
    return found[half & (_squares(found, lengths) <= largest**2)]


def _squares(vectors: np.ndarray, lengths: tuple[float, float, float]) -> np.ndarray:
    return ((2.0 * math.pi * vectors / np.array(lengths)) ** 2).sum(axis=1)


def sphere(waves: Any, volume: float) -> Any:
    """Radius [1/m] of the sphere that has the volume of q = 0, `waves` vectors and their opposites."""
    return (6.0 * math.pi**2 * (2.0 * waves + 1.0) / volume) ** (1.0 / 3.0)


def omitted_waves(
    alpha: float, largest: np.ndarray, spacing: float, sources: Sources = DIPOLES
) -> tuple[np.ndarray, np.ndarray]:
    """Relative errors of force and of flux density or potential by wave vectors beyond `largest`; `spacing` is a.

    Integrals I_n of qⁿ exp(−q²/w²) from I_0 by I_n = (w²/2) [q_max^(n−1) exp(−q_max²/w²) + (n − 1) I_(n−2)], w² = 2α².
    """
    from scipy.special import erfc  # slow import

    width = math.sqrt(2.0) * alpha
    z = largest / width
    gauss, rest = np.exp(-z * z), math.sqrt(math.pi) * erfc(z)
    if sources.order == 0:
        force, field = 0.5 * width * rest, gauss / largest - rest / width
    else:
        field = width**3 * (0.5 * z * gauss + 0.25 * rest)
        force = width**5 * (0.5 * z**3 * gauss + 0.75 * z * gauss + 0.375 * rest)
    density, power = 3.0 / (4.0 * math.pi * spacing**3), 2 * sources.order
    force = np.sqrt(8.0 / 3.0**power * density * force / sources.force_size) * spacing ** (power + 2)
    return force, np.sqrt(8.0 / 3.0**sources.order * density * field / sources.field_size) * spacing ** (power + 1)


def real_errors(
    product: float, degree: int, radius: float, spacing: float, sources: Sources = DIPOLES
) -> tuple[float, float]:
    """Relative errors of force and of flux density or potential by the real part; `spacing` is a."""
    found, ratio, power = fitted(product, degree, sources.order), spacing / radius, 4 * sources.order
    force = math.sqrt(3.0 / sources.force_size * ratio ** (power + 1)) * found.force_error
    return force, math.sqrt(3.0 / sources.field_size * ratio ** (power - 1)) * found.field_error


def _waves_needed(alpha: float, spacing: float, volume: float, limits: tuple[float, float], sources: Sources) -> int:
    """Least number of wave vectors, half of all, for which the errors are below the limits."""
    largest = alpha * np.linspace(0.5, 16.0, 1551)
    force, field = omitted_waves(alpha, largest, spacing, sources)
    fine = (force <= limits[0]) & (field <= limits[1])
    return math.ceil(volume * float(largest[np.argmax(fine)]) ** 3 / (12.0 * math.pi**2)) if fine.any() else MOST_WAVES


def _cost_of_pairs(count: int, radius: float, volume: float) -> float:
    """Cost of the real part, by a Verlet list where there will be one."""
    share = 4.0 / 3.0 * math.pi * (LIST_REACH * radius) ** 3 / volume
    if count >= LIST_FROM and share <= LIST_UP_TO:
        return LISTED_COST * count * count * share
    return PAIR_COST * 0.5 * count * count


@functools.lru_cache(64)
def choose_ewald(
    lengths: tuple[float, float, float],
    count: int,
    carriers: int,
    accuracy: float,
    least: float,
    sources: Sources = DIPOLES,
) -> EwaldChoice:
    """The cheapest parameters for an accuracy.

    Parameters
    ----------
    lengths : tuple of float
        Sides of the box [m].
    count : int
        Number of grains, which determines the cost.
    carriers : int
        Number of grains with a charge or moment, which determines the error.
    accuracy : float
        Largest relative error of force, and of torque or potential.
    least : float
        Smallest r_c [m]; half the shortest side if that is smaller.
    sources : Sources
        `ewald_fit.CHARGES` or `DIPOLES`.

    Raises
    ------
    BadInput
        If more than a million wave vectors are needed.
    """
    volume, half, degree = math.prod(lengths), 0.5 * min(lengths), degree_for(accuracy)
    spacing = min((3.0 * volume / (4.0 * math.pi * carriers)) ** (1.0 / 3.0), LARGEST_SPACING * half)
    found = []
    for radius in {max(min(least, half), fraction * half) for fraction in RADII}:
        for product in PRODUCTS:
            force, field = real_errors(product, degree, radius, spacing, sources)
            if max(force, field) < accuracy:
                limits = math.sqrt(accuracy**2 - force**2), math.sqrt(accuracy**2 - field**2)
                waves = _waves_needed(product / radius, spacing, volume, limits, sources)
                cost = _cost_of_pairs(count, radius, volume) + WAVE_COST * count * waves
                found.append((cost, -radius, product, waves))
    if not found:
        raise BadInput(
            f"{sources.name}: periodic = 'ewald' with accuracy = {accuracy:g} is not possible in this box; "
            "give a larger accuracy, such as 1e-3"
        )
    _, radius, product, waves = min(found)
    if waves >= MOST_WAVES:
        raise BadInput(
            f"{sources.name}: periodic = 'ewald' with accuracy = {accuracy:g} needs more than {MOST_WAVES} wave "
            f"vectors in a box of {' x '.join(f'{side:.3g}' for side in lengths)} m; "
            "give a larger accuracy, or sides more alike"
        )
    return _with_whole_shells(lengths, volume, spacing, accuracy, degree, -radius, product, waves, sources)


def _with_whole_shells(
    lengths: tuple[float, float, float],
    volume: float,
    spacing: float,
    accuracy: float,
    degree: int,
    radius: float,
    product: float,
    waves: int,
    sources: Sources,
) -> EwaldChoice:
    """All vectors up to the smallest length for which the errors are below the accuracy.

    The errors of a set of vectors are those beyond the sphere of the same volume.
    """
    alpha = product / radius
    beyond = 1.15 * (12.0 * math.pi**2 * waves / volume) ** (1.0 / 3.0) + 4.0 * math.pi / min(lengths)
    lengths_of = np.sqrt(np.sort(_squares(half_of_vectors(lengths, beyond), lengths)))
    last = np.flatnonzero(np.append(np.diff(lengths_of) > 1e-9 * lengths_of[0], True))  # of each shell
    largest = sphere(last + 1, volume)
    real = real_errors(product, degree, radius, spacing, sources)
    omitted = omitted_waves(alpha, largest, spacing, sources)
    force, field = (np.hypot(own, other) for own, other in zip(real, omitted, strict=True))
    shell = int(np.argmax((force <= accuracy) & (field <= accuracy)))
    end = last[shell]
    return EwaldChoice(
        alpha,
        radius,
        float(lengths_of[end]) * (1.0 + 1e-9),
        int(end) + 1,
        degree,
        product,
        float(force[shell]),
        float(field[shell]),
    )


def own_field(alpha: float, waves: int, volume: float, sources: Sources = DIPOLES) -> float:
    """What the summed wave vectors give at a grain by its own smeared charge or dipole, to be removed.

    Integrals over the sphere that has the volume of the vectors: the potential [V/C] (2k/π) ∫ exp(−q²/4α²) dq of a
    charge, 2αk/√π for all vectors; the flux density [T/(A m²)] (2k/3π) ∫ q² exp(−q²/4α²) dq of a dipole, with the
    opposite sign, 4α³k/(3√π) for all vectors.
    """
    z = sphere(waves, volume) / (2.0 * alpha)
    if sources.order == 0:
        return 2.0 * alpha * sources.k / math.sqrt(math.pi) * math.erf(z)
    part = math.erf(z) - 2.0 / math.sqrt(math.pi) * z * math.exp(-z * z)
    return 4.0 * alpha**3 * sources.k / (3.0 * math.sqrt(math.pi)) * part


def mean_field(alpha: float, volume: float, vacuum: bool, sources: Sources = DIPOLES) -> float:
    """Potential [V] per net charge of its neutralising background, −πk/(Vα²); flux density [T] per total moment.

    The uniform background, of density −Q/V, acts on a charge by the real part alone, ∫ k erfc(αr)/r d³r = πk/α².
    """
    if sources.order == 0:
        return -math.pi * sources.k / (volume * alpha**2)
    return -4.0 * math.pi * sources.k / (3.0 * volume) if vacuum else 0.0


def ewald_parameters(
    choice: EwaldChoice, box: Box, count: int, vacuum: bool, sources: Sources = DIPOLES
) -> EwaldParameters:
    """Parameters of the loops, with buffers for `count` grains."""
    lengths, volume = sides(box), box.volume
    radius, alpha, order = choice.radius, choice.alpha, sources.order
    blocks = ALL_PAIRS_BLOCKS if count >= PARALLEL_FROM else 1
    found = fitted(choice.product, choice.degree, order)
    size = padded_size(count)
    return EwaldParameters(
        sources.k,
        radius**2,
        2.0 / radius**2,
        tuple(c / radius ** (2 * order + 1) for c in found.coefficients),
        own_field(alpha, choice.waves, volume, sources),
        mean_field(alpha, volume, vacuum, sources),
        _waves(lengths, choice, count, blocks, sources),
        Buffers(*(np.zeros((blocks, 0 if name in UNUSED[order] else size)) for name in Buffers._fields)),
    )


def sides(box: Box) -> tuple[float, float, float]:
    """Sides [m] of a box that is periodic along all axes."""
    x, y, z = (float(side) for side in box.lengths if side is not None)
    return x, y, z


def _waves(
    lengths: tuple[float, float, float], choice: EwaldChoice, count: int, blocks: int, sources: Sources
) -> Waves:
    """Wave vectors in columns of equal n_x and n_y, which have n_z = 0, ±1, … up to q_max."""
    vectors = half_of_vectors(lengths, choice.largest)
    vectors = vectors[vectors[:, 2] >= 0]
    pairs, first, numbers = np.unique(vectors[:, :2], axis=0, return_index=True, return_counts=True)
    if (pairs[0] == 0).all():  # its first vector is n_z = 1
        vectors = np.concatenate([[[0, 0, 0]], vectors])
        first, numbers = np.append(0, first[1:] + 1), np.append(numbers[0] + 1, numbers[1:])
    square = _squares(vectors, lengths)
    with np.errstate(divide="ignore"):
        weight = 8.0 * math.pi * sources.k / math.prod(lengths) * np.exp(-square / (4.0 * choice.alpha**2)) / square
    weight[square == 0.0] = 0.0
    twice = (vectors[:, :2] == 0).all(axis=1)
    ends = np.append(0, np.cumsum(numbers))
    block = np.searchsorted(ends, np.linspace(0, ends[-1], blocks + 1).round())
    cosine, sine = np.zeros((2, 3, max(int(np.abs(vectors).max()), 1) + 1, padded_size(count)))
    cosine[:, 0] = 1.0
    return Waves(
        np.ascontiguousarray(np.stack([*pairs.T, numbers, first]), np.int64),
        np.where(twice, 0.5, 1.0) * weight,
        block.astype(np.int64),
        cosine.copy(),
        sine.copy(),
        np.zeros((2 * sources.order + 1, padded_size(count))),
    )
