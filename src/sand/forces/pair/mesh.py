"""The influence function of a particle mesh for charges or dipoles, and the errors of the mesh.

With the nodes' spacing h along each axis, aliases q_m = q + 2πm/h of a wave vector q, W = Π sinc(q_a h_a/2)^p the
transform of a spline, and R = 4π exp(−q²/4α²)/q², the loads by a grain at a random position of the mesh have the mean
square errors, for s = 0, 1 of potential and force (charges, per q², over k²/V²), or s = 1, 2 of flux density and force
(dipoles, per μ², over k²/3V² and k²/9V²), with n = 0 for charges and 1 for dipoles

    Σ_q Σ_{m,m'} (G W_m W_m' − δ_mm' R_m)² q_m^(2n) q_m'^(2s)
    least for  G = Σ_m R_m W_m² q_m^(2n+2s) / (Σ_m W_m² q_m^(2n) Σ_m W_m² q_m^(2s))

G is that with the least error of the force of charges, or of the flux density of dipoles, and so of their energy
(s = 1 both times).  R q² and R q⁴ are sums of products of functions of q_x, q_y and q_z, so that all sums over aliases
are sums of products of sums along the axes.  Where the errors of charges contain lower powers, 1/q_m² of an alias is
replaced by 1/q² of the vector itself: aliases count near the edge of the mesh, where both are almost the same.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from ...basics.alignment import SIMD_WIDTH
from .ewald_fit import DIPOLES, Sources
from .long_range_loops import blocks_for
from .mesh_loops import ORDERS, Mesh

ALIASES = 3
"""Aliases on each side; W² q⁴ of the next one is below 1e-6 of the first's at p = 5."""
MOST_NODES = 2**25
"""Largest number of nodes: 0.8 GB of memory for mesh, transform and influence function."""
CELLS = 24
"""Nodes along each axis of the mesh of which the errors of any mesh are estimated."""
PRODUCTS = np.geomspace(0.05, 1.6, 36)
"""Values of α h of this estimate."""
QUADRATURE = 128
"""Gauss–Legendre nodes of `lattice_sum`, which has errors below 1e-12."""
NEGLIGIBLE = 40.0
"""Terms below exp(−40) are left out of it."""


class MeshSums(NamedTuple):
    """Influence function and errors of a mesh."""

    influence: np.ndarray  # G [m²] (K_x, K_y, K_z/2 + 1)
    field_square: float  # Σ_q of the mean square error of flux density or potential, see the module
    force_square: float  # of the force
    # error of the mean flux density of a dipole at itself, Σ_q (G Σ_m W_m² q_m² − Σ_m R_m q_m²)/3, or of the mean
    # potential of a charge, Σ_q (G Σ_m W_m² − Σ_m R_m)
    self_mean: float
    # (3, 3): amplitudes of its variation along a, Σ_q G Σ_m W_m W_m+1(a) q_b² for the moment's b; without q_b² for
    # charges, b = 0
    self_wave: np.ndarray


class _Axis(NamedTuple):
    """Sums over the aliases along one axis, of functions of q: [power of q / 2]."""

    splines: tuple[np.ndarray, ...]  # W² q⁰, q², q⁴
    smeared: tuple[np.ndarray, ...]  # W² e^(−q²/4α²) q⁰, q², q⁴
    gauss: np.ndarray  # e^(−q²/4α²)
    square: tuple[np.ndarray, ...]  # e^(−q²/2α²) q⁰, q²
    neighbours: tuple[np.ndarray, ...]  # W_m W_{m+1} q_m⁰ q_{m+1}⁰, q_m q_{m+1}


def _axis(side: float, nodes: int, order: int, alpha: float, *, half: bool) -> _Axis:
    n = np.arange(nodes // 2 + 1) if half else np.fft.fftfreq(nodes, 1.0 / nodes)
    m = np.arange(-ALIASES, ALIASES + 1)
    turns = n[:, None] / nodes + m  # q h / 2π
    q = 2.0 * math.pi * nodes / side * turns
    w = np.sinc(turns) ** order
    e = np.exp(-((q / (2.0 * alpha)) ** 2))
    pair = w[:, 1:] * w[:, :-1]
    return _Axis(
        tuple((w * w * q**k).sum(axis=1) for k in (0, 2, 4)),
        tuple((w * w * e * q**k).sum(axis=1) for k in (0, 2, 4)),
        e.sum(axis=1),
        tuple((e * e * q**k).sum(axis=1) for k in (0, 2)),
        (pair.sum(axis=1), (pair * q[:, 1:] * q[:, :-1]).sum(axis=1)),
    )


def _product(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    return x[:, None, None] * y[None, :, None] * z[None, None, :]


def _moments(x: tuple, y: tuple, z: tuple, power: int) -> np.ndarray:
    """Sum of products with (q_x² + q_y² + q_z²)^power, for powers 0, 1 and 2."""
    if power == 0:
        return _product(x[0], y[0], z[0])
    if power == 1:
        return _product(x[1], y[0], z[0]) + _product(x[0], y[1], z[0]) + _product(x[0], y[0], z[1])
    found = _product(x[2], y[0], z[0]) + _product(x[0], y[2], z[0]) + _product(x[0], y[0], z[2])
    return found + 2.0 * (_product(x[1], y[1], z[0]) + _product(x[1], y[0], z[1]) + _product(x[0], y[1], z[1]))


_legendre = functools.cache(np.polynomial.legendre.leggauss)


def lattice_sum(lengths: tuple[float, float, float], alpha: float) -> float:
    """Σ R over all wave vectors q ≠ 0 [m²].

    4π ∫ (Π_a Σ_n exp(−q_a² t) − 1) dt from 1/4α², over ln t.
    """
    start, end = 1.0 / (4.0 * alpha**2), NEGLIGIBLE * (max(lengths) / (2.0 * math.pi)) ** 2
    x, weight = _legendre(QUADRATURE)
    t = start * (end / start) ** (0.5 * (x + 1.0))
    product = np.ones_like(t)
    for side in lengths:
        n = np.arange(1, int(math.sqrt(NEGLIGIBLE / start) * side / (2.0 * math.pi)) + 1)
        product *= 1.0 + 2.0 * np.exp(-np.outer(t, (2.0 * math.pi * n / side) ** 2)).sum(axis=1)
    return 4.0 * math.pi * 0.5 * math.log(end / start) * float(weight @ (t * (product - 1.0)))


def mesh_sums(
    lengths: tuple[float, float, float],
    nodes: tuple[int, int, int],
    order: int,
    alpha: float,
    sources: Sources = DIPOLES,
    *,
    with_waves: bool = True,
) -> MeshSums:
    """Influence function and errors of a mesh of K_x × K_y × K_z nodes in a box.

    Parameters
    ----------
    lengths : tuple of float
        Sides of the box [m].
    nodes : tuple of int
        Even numbers of nodes along the axes.
    order : int
        Order p of the splines.
    alpha : float
        α [1/m].
    sources : Sources, optional
        `ewald_fit.CHARGES` or `DIPOLES`.
    with_waves : bool, optional
        Whether `waves` is computed, or left 0.
    """
    x, y, z = (
        _axis(side, number, order, alpha, half=a == 2)
        for a, (side, number) in enumerate(zip(lengths, nodes, strict=True))
    )
    twice = np.full(nodes[2] // 2 + 1, 2.0)  # q_z and −q_z
    twice[0] = twice[-1] = 1.0
    n = sources.order
    square_of_q = np.full((nodes[0], nodes[1], nodes[2] // 2 + 1), 0.0)
    for a, (side, number) in enumerate(zip(lengths, nodes, strict=True)):
        q = 2.0 * math.pi / side * (np.arange(number // 2 + 1) if a == 2 else np.fft.fftfreq(number, 1.0 / number))
        square_of_q += np.expand_dims(q**2, [axis for axis in range(3) if axis != a])
    square_of_q[0, 0, 0] = math.inf

    def sum_of(part: str, power: int) -> np.ndarray:
        """Sum over aliases of W², of W² e^(−q²/4α²) or of e^(−q²/2α²), times q^(2 power)."""
        found = _moments(getattr(x, part), getattr(y, part), getattr(z, part), max(power, 0))
        if power == 0 and part == "square":
            found[0, 0, 0] -= 1.0
        return found / square_of_q**-power if power < 0 else found

    twice = np.full(nodes[2] // 2 + 1, 2.0)  # q_z and −q_z
    twice[0] = twice[-1] = 1.0
    splines = sum_of("splines", n)
    splines[0, 0, 0] = 1.0  # 0 up to rounding for dipoles, not divided by
    other = splines
    if n == 0:
        other = sum_of("splines", 1)
        other[0, 0, 0] = 1.0
    influence = 4.0 * math.pi * sum_of("smeared", n) / (splines * other)
    influence[0, 0, 0] = 0.0
    least = (4.0 * math.pi) ** 2 * sum_of("square", n - 1) - (influence * splines) * (influence * other)
    s = 2 * n
    rest = influence**2 * splines * sum_of("splines", s)
    rest -= 8.0 * math.pi * influence * sum_of("smeared", n + s - 1)
    rest += (4.0 * math.pi) ** 2 * sum_of("square", n + s - 2)
    errors = [max(float((each * twice).sum()), 0.0) for each in (least, rest)]
    field, force = errors if n else errors[::-1]
    weighted = influence * twice
    if n:
        gauss = _product(x.gauss, y.gauss, z.gauss)
        gauss[0, 0, 0] -= 1.0
        own = float(((influence * splines - 4.0 * math.pi * gauss) * twice).sum()) / 3.0
    else:
        own = float((weighted * splines).sum()) - lattice_sum(lengths, alpha)
    waves = np.zeros((3, 3))
    axes = (x, y, z)
    for a in range(3 if with_waves else 0):
        for b in range(2 * n + 1):
            rows = [each.splines[n] if c == b else each.splines[0] for c, each in enumerate(axes)]
            rows[a] = axes[a].neighbours[n if a == b else 0]
            waves[a, b] = np.einsum("ijk,i,j,k", weighted, *rows, optimize=True)
    return MeshSums(influence, field, force, own, waves * (-1.0) ** order)


def mesh_errors(sums: MeshSums, volume: float, spacing: float, sources: Sources = DIPOLES) -> tuple[float, float]:
    """Relative errors of force and of flux density or potential, in the units of `ewald`; `spacing` is a."""
    density, n = 3.0 / (4.0 * math.pi * spacing**3), sources.order
    force = math.sqrt(density * sums.force_square / (9.0**n * volume) / sources.force_size) * spacing ** (2 * n + 2)
    field = math.sqrt(density * sums.field_square / (3.0**n * volume) / sources.field_size) * spacing ** (2 * n + 1)
    return force, field


@functools.cache
def _estimates(order: int, sources: Sources) -> tuple[np.ndarray, np.ndarray]:
    """Logarithms of force_square h^(4n+1)/V and field_square h^(4n−1)/V for each α h, of a mesh of cubic cells."""
    found = [mesh_sums((CELLS,) * 3, (CELLS,) * 3, order, product, sources, with_waves=False) for product in PRODUCTS]
    force, field = np.array([(each.force_square, each.field_square) for each in found]).T / CELLS**3
    return (
        np.log(np.maximum.accumulate(np.maximum(force, 1e-30))),
        np.log(np.maximum.accumulate(np.maximum(field, 1e-30))),
    )


def widest_cells(
    order: int, alpha: float, spacing: float, limits: tuple[float, float], sources: Sources = DIPOLES
) -> float:
    """Largest spacing h [m] of the nodes for which the errors of `mesh_errors` are below the limits."""
    density, n = 3.0 / (4.0 * math.pi * spacing**3), sources.order
    force, field = _estimates(order, sources)
    h, a = np.log(PRODUCTS / alpha), math.log(spacing)
    # errors of `mesh_errors`, squared
    least = math.log(density / (9.0**n * sources.force_size)) + (4 * n + 4) * a + force - (4 * n + 1) * h
    other = math.log(density / (3.0**n * sources.field_size)) + (4 * n + 2) * a + field - (4 * n - 1) * h
    fine = (least <= 2.0 * math.log(limits[0])) & (other <= 2.0 * math.log(limits[1]))
    return float(np.exp(h[np.flatnonzero(fine)[-1]])) if fine.any() else 0.0


@functools.cache
def _sizes() -> np.ndarray:
    """Even numbers 2^a 3^b 5^c, whose Fourier transforms are fast."""
    found = {2**a * 3**b * 5**c for a in range(1, 14) for b in range(9) for c in range(6)}
    return np.array(sorted(n for n in found if n <= 8192))


def nodes_for(lengths: tuple[float, float, float], spacing: float, order: int) -> tuple[int, int, int]:
    """Numbers of nodes along the axes for at most this spacing [m]; at least 2p."""
    sizes = _sizes()
    least = [max(math.ceil(side / spacing * (1.0 - 1e-12)), 2 * order) for side in lengths]
    x, y, z = (int(sizes[min(int(np.searchsorted(sizes, number)), len(sizes) - 1)]) for number in least)
    return x, y, z


def new_mesh(
    sums: MeshSums,
    nodes: tuple[int, int, int],
    lengths: tuple[float, float, float],
    count: int,
    sources: Sources = DIPOLES,
    *,
    follows_box: bool = False,
) -> Mesh:
    """The mesh of the loops for a number of grains; `follows_box`: in a box that may be deformed."""
    scale = sources.k / math.prod(lengths)
    rows, columns = nodes[:2], nodes[2] // 2 + 1
    of_moving, most = (1, max(nodes)) if follows_box else (0, 0)
    influence = scale * math.prod(nodes) * sums.influence
    return Mesh(
        np.zeros((*rows, nodes[2] + SIMD_WIDTH - 1)),
        np.zeros((*rows, columns, 2)),
        influence,
        np.zeros((count, 9, SIMD_WIDTH)),
        np.zeros((3, count), np.int64),
        np.zeros(nodes[0] + 1, np.int64),
        np.zeros(count, np.int64),
        np.zeros((3, count)),
        np.zeros((3, count)),
        scale * sums.self_wave,
        influence[: of_moving * nodes[0]].copy(),
        np.zeros((of_moving * nodes[0], *influence.shape[1:])),
        np.array(lengths[: 3 * of_moving]),
        np.zeros((3, most)),
        np.zeros((2, 3, most)),
        np.zeros((3, of_moving * blocks_for(count))),
    )


__all__ = ["ORDERS", "lattice_sum", "mesh_errors", "mesh_sums", "new_mesh", "nodes_for", "widest_cells"]
