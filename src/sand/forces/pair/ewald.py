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

from ...basics.alignment import padded_size
from ...basics.box import Box
from ...basics.errors import BadInput
from .ewald_fit import DIPOLES, Sources, erfc, fitted
from .ewald_loops import UNUSED, Buffers, EwaldParameters, MeshEwaldParameters, Waves
from .long_range_loops import blocks_for
from .mesh import MOST_NODES, mesh_errors, mesh_sums, new_mesh, nodes_for, widest_cells
from .mesh_loops import ORDERS

DEGREES = {5e-2: 8, 1e-3: 12, 1e-4: 16, 1e-6: 24, 1e-8: 32}
"""Degree of the polynomial of the real part, by the smallest accuracy for which it is used."""
PRODUCTS = tuple(round(0.1 * k, 1) for k in range(16, 64))
"""Values of α r_c that are compared."""
RADII = 1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.35, 0.3, 0.25, 0.2, 0.15, 0.12, 0.1, 0.08, 0.06, 0.05, 0.04, 0.03, 0.02
"""Values of r_c, in units of half the shortest side, that are compared."""
LISTED_COST = 1.2
"""Cost of an entry of the Verlet list, relative to that of a pair."""
NODE_COST, ROW_COST, GRAIN_COST = 4.0, 3.3, 20.0
"""Costs of a node of a mesh, of a row of nodes of the spline of one grain (p² rows), and of one grain; 1 is 8 ns."""
TRANSFORMS_COST = 5000.0
"""Cost of the calls of the Fourier transforms, for each block."""
LIST_FROM, LIST_REACH, LIST_UP_TO = 64, 1.1, 0.38
"""Conditions for a Verlet list, as in `neighbours.search`: grains, reach in units of r_c, fraction within reach."""
LARGEST_SPACING = 0.8
"""Upper limit of a in units of half the shortest side, for few grains and long boxes."""
WIDER, OTHER_PRODUCT = 1.3, 0.25
"""Largest ratio of r_c, and difference of α r_c, to those of a choice that the next one shall be like."""
MOST_WAVES = 1_000_000
"""Largest number of wave vectors, half of all."""


class EwaldChoice(NamedTuple):
    """Parameters of an Ewald sum, over wave vectors or with a mesh, with its predicted errors."""

    alpha: float  # α [1/m]
    radius: float  # r_c [m]
    largest: float  # q_max [1/m]; 0 with a mesh
    waves: int  # number of wave vectors, half of all; 0 with a mesh
    degree: int  # of the polynomial of the real part
    product: float  # α r_c
    force_error: float
    field_error: float  # of torque (dipoles) or potential (charges)
    nodes: tuple[int, int, int] = (0, 0, 0)  # of the mesh along the axes
    order: int = 0  # of the splines of a mesh; 0 without one

    @property
    def reciprocal(self) -> str:
        """The reciprocal part in words."""
        if self.order:
            return f"mesh of {' x '.join(map(str, self.nodes))} nodes with splines of order {self.order}"
        return f"{self.waves} wave vectors and their opposites"


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
    """Cost of the real part, by a Verlet list where there will be one, in units of that of a pair."""
    share = 4.0 / 3.0 * math.pi * (LIST_REACH * radius) ** 3 / volume
    if count >= LIST_FROM and share <= LIST_UP_TO:
        return LISTED_COST * count * count * share
    return 0.5 * count * count


class _Problem(NamedTuple):
    """What the parameters are chosen for."""

    lengths: tuple[float, float, float]  # of the box [m]
    volume: float
    spacing: float  # a [m]
    accuracy: float
    degree: int
    grains: int  # number of them
    sources: Sources


@functools.lru_cache(64)
def choose_ewald(
    lengths: tuple[float, float, float],
    count: int,
    carriers: int,
    accuracy: float,
    least: float,
    sources: Sources = DIPOLES,
    reciprocal: str = "auto",
    like: EwaldChoice | None = None,
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
    reciprocal : str, optional
        How the reciprocal part is summed: "direct", over wave vectors; "mesh"; or "auto", the cheaper of both.
    like : EwaldChoice, optional
        A choice for almost the same box: as this one, over wave vectors or with splines of the same order, and with
        similar r_c and α.

    Raises
    ------
    BadInput
        If more than a million wave vectors or 32 million nodes are needed.
    """
    volume, half, degree = math.prod(lengths), 0.5 * min(lengths), degree_for(accuracy)
    spacing = min((3.0 * volume / (4.0 * math.pi * carriers)) ** (1.0 / 3.0), LARGEST_SPACING * half)
    problem = _Problem(lengths, volume, spacing, accuracy, degree, count, sources)
    direct, meshes = [], []
    for radius in sorted({max(min(least, half), fraction * half) for fraction in RADII}):
        if like is not None and not radius < WIDER * like.radius < WIDER**2 * radius:
            continue
        pairs = sources.pair_cost * _cost_of_pairs(count, radius, volume)
        for product in PRODUCTS:
            if like is not None and abs(product - like.product) > OTHER_PRODUCT:
                continue
            force, field = real_errors(product, degree, radius, spacing, sources)
            if max(force, field) >= accuracy:
                continue
            limits = math.sqrt(accuracy**2 - force**2), math.sqrt(accuracy**2 - field**2)
            if reciprocal != "mesh":
                waves = _waves_needed(product / radius, spacing, volume, limits, sources)
                direct.append((pairs + sources.wave_cost * count * waves, -radius, product, waves))
            if reciprocal != "direct":
                found = _meshes(problem, pairs, radius, product, limits)
                meshes += [each for each in found if like is None or each[-1] == like.order]
    if not direct and not meshes:
        instead = "" if reciprocal != "mesh" else ", or leave reciprocal = 'mesh' out"
        raise BadInput(
            f"{sources.name}: periodic = 'ewald' with accuracy = {accuracy:g} is not possible in this box; "
            f"give a larger accuracy, such as 1e-3{instead}"
        )
    possible = [each for each in meshes if math.prod(each[3]) <= MOST_NODES]
    cheapest = min((each for each in direct if each[3] < MOST_WAVES), default=None)
    if possible and (cheapest is None or min(possible)[0] < cheapest[0]):
        _, radius, product, nodes, order = min(possible)
        return _with_mesh(problem, -radius, product, nodes, order)
    if cheapest is None:
        needs = " and ".join(
            what
            for what, used in (
                (f"more than {MOST_WAVES} wave vectors", bool(direct)),
                (f"a mesh of more than {MOST_NODES} nodes", bool(meshes)),
            )
            if used
        ).replace(" and a mesh", ", or a mesh")
        raise BadInput(
            f"{sources.name}: periodic = 'ewald' with accuracy = {accuracy:g} needs {needs} in a "
            f"box of {' x '.join(f'{side:.3g}' for side in lengths)} m; give a larger accuracy, or sides more alike"
        )
    _, radius, product, waves = cheapest
    return _with_whole_shells(problem, -radius, product, waves)


def _meshes(
    problem: _Problem, pairs: float, radius: float, product: float, limits: tuple[float, float]
) -> list[tuple[float, float, float, tuple[int, int, int], int]]:
    """Costs of the meshes of all orders, with −r_c, α r_c, nodes, order; `pairs` is the cost of the real part."""
    found = []
    for order in ORDERS:
        widest = widest_cells(order, product / radius, problem.spacing, limits, problem.sources)
        if widest > 0.0:
            nodes = nodes_for(problem.lengths, widest, order)
            found.append((pairs + _cost_of_mesh(problem.grains, nodes, order), -radius, product, nodes, order))
    return found


def _cost_of_mesh(count: int, nodes: tuple[int, int, int], order: int) -> float:
    return (
        blocks_for(count) * TRANSFORMS_COST + NODE_COST * math.prod(nodes) + count * (GRAIN_COST + ROW_COST * order**2)
    )


def _with_mesh(
    problem: _Problem, radius: float, product: float, nodes: tuple[int, int, int], order: int
) -> EwaldChoice:
    """The choice, with the errors of this mesh; a finer one as long as they exceed the accuracy.

    The estimates by which nodes are chosen are those of cubic cells in a large box.
    """
    alpha = product / radius
    sources = problem.sources
    real = real_errors(product, problem.degree, radius, problem.spacing, sources)
    spacing = max(side / number for side, number in zip(problem.lengths, nodes, strict=True))
    while True:
        sums = mesh_sums(problem.lengths, nodes, order, alpha, sources)
        other = mesh_errors(sums, problem.volume, problem.spacing, sources)
        force, field = (math.hypot(own, mesh) for own, mesh in zip(real, other, strict=True))
        if max(force, field) <= problem.accuracy:
            return EwaldChoice(alpha, radius, 0.0, 0, problem.degree, product, force, field, nodes, order)
        spacing *= 0.97
        nodes = nodes_for(problem.lengths, spacing, order)
        if math.prod(nodes) > 2 * MOST_NODES:
            raise BadInput(
                f"{sources.name}: periodic = 'ewald' with accuracy = {problem.accuracy:g} is not reached by a mesh of "
                f"{MOST_NODES} nodes; give a larger accuracy, or reciprocal = 'direct'"
            )


def _with_whole_shells(problem: _Problem, radius: float, product: float, waves: int) -> EwaldChoice:
    """All vectors up to the smallest length for which the errors are below the accuracy.

    The errors of a set of vectors are those beyond the sphere of the same volume.
    """
    lengths, volume, spacing, accuracy, degree, _, sources = problem
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
    choice: EwaldChoice, box: Box, count: int, vacuum: bool, sources: Sources = DIPOLES, *, follows_box: bool = False
) -> EwaldParameters | MeshEwaldParameters:
    """Parameters of the loops, with buffers for `count` grains; `follows_box`: in a box that may be deformed."""
    lengths, volume = sides(box), box.volume
    radius, alpha, order = choice.radius, choice.alpha, sources.order
    found = fitted(choice.product, choice.degree, order)
    coefficients = tuple(c / radius ** (2 * order + 1) for c in found.coefficients)
    of_pairs = sources.k, radius**2, 2.0 / radius**2, coefficients
    mean = mean_field(alpha, volume, vacuum, sources)
    if choice.order:
        sums = mesh_sums(lengths, choice.nodes, choice.order, alpha, sources)
        smeared = 4.0 * alpha**3 * sources.k / (3.0 * math.sqrt(math.pi))
        if order == 0:
            smeared = 2.0 * alpha * sources.k / math.sqrt(math.pi)
        own = smeared + sources.k / volume * sums.self_mean
        mesh = new_mesh(sums, choice.nodes, lengths, count, sources, follows_box=follows_box)
        return MeshEwaldParameters(*of_pairs, own, mean, alpha, volume, mesh)
    blocks, size = blocks_for(count), padded_size(count)
    return EwaldParameters(
        *of_pairs,
        own_field(alpha, choice.waves, volume, sources),
        mean,
        alpha,
        volume,
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
        np.zeros((3, blocks)),
    )
