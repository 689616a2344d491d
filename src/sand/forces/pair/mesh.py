"""The influence function of a particle mesh for dipoles, and the errors of the mesh.

With the nodes' spacing h along each axis, aliases q_m = q + 2πm/h of a wave vector q, W = Π sinc(q_a h_a/2)^p the
transform of a spline, and R = 4π exp(−q²/4α²)/q², the flux density of a dipole at a random position of the mesh has the
mean square error (per μ², over k²/3V²)

    Σ_q Σ_{m,m'} (G W_m W_m' − δ_mm' R_m)² q_m² q_m'²,  least for  G = Σ_m R_m W_m² q_m⁴ / (Σ_m W_m² q_m²)²

and so has the energy; the force has one more q_m'².  R q⁴ is a sum of products of functions of q_x, q_y and q_z,
so that all sums over aliases are sums of products of sums along the axes.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from ...constants import MAGNETIC
from ...numerics.simd import SIMD_WIDTH
from .mesh_loops import ORDERS, Mesh

ALIASES = 3
"""Aliases on each side; W² q⁴ of the next one is below 1e-6 of the first's at p = 5."""
MOST_NODES = 2**25
"""Largest number of nodes: 0.8 GB of memory for mesh, transform and influence function."""
CELLS = 24
"""Nodes along each axis of the mesh of which the errors of any mesh are estimated."""
PRODUCTS = np.geomspace(0.05, 1.6, 36)
"""Values of α h of this estimate."""


class MeshSums(NamedTuple):
    """Influence function and errors of a mesh."""

    influence: np.ndarray  # G [m²] (K_x, K_y, K_z/2 + 1)
    field_square: float  # Σ_q of the field's mean square error, see the module
    force_square: float  # of the force's [1/m²]
    self_mean: float  # Σ_q (G Σ_m W_m² q_m² − Σ_m R_m q_m²)/3: error of the mean flux density of a dipole at itself
    self_wave: np.ndarray  # (3, 3): amplitudes Σ_q G Σ_m W_m W_m+1(a) q_b² of its variation along a, for the moment's b


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


def _second(x: tuple, y: tuple, z: tuple) -> np.ndarray:
    """Sum of products with (q_x² + q_y² + q_z²)."""
    return _product(x[1], y[0], z[0]) + _product(x[0], y[1], z[0]) + _product(x[0], y[0], z[1])


def _fourth(x: tuple, y: tuple, z: tuple) -> np.ndarray:
    """Sum of products with (q_x² + q_y² + q_z²)²."""
    found = _product(x[2], y[0], z[0]) + _product(x[0], y[2], z[0]) + _product(x[0], y[0], z[2])
    return found + 2.0 * (_product(x[1], y[1], z[0]) + _product(x[1], y[0], z[1]) + _product(x[0], y[1], z[1]))


def mesh_sums(lengths: tuple[float, float, float], nodes: tuple[int, int, int], order: int, alpha: float) -> MeshSums:
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
    """
    x, y, z = (
        _axis(side, number, order, alpha, half=a == 2)
        for a, (side, number) in enumerate(zip(lengths, nodes, strict=True))
    )
    twice = np.full(nodes[2] // 2 + 1, 2.0)  # q_z and −q_z
    twice[0] = twice[-1] = 1.0
    splines = _second(x.splines, y.splines, z.splines)
    smeared = _second(x.smeared, y.smeared, z.smeared)
    splines[0, 0, 0] = 1.0  # 0 up to rounding, not divided by
    influence = 4.0 * math.pi * smeared / splines**2
    influence[0, 0, 0] = 0.0
    gauss, square = _product(x.gauss, y.gauss, z.gauss), _product(x.square[0], y.square[0], z.square[0])
    gauss[0, 0, 0] -= 1.0
    square[0, 0, 0] -= 1.0
    field = (4.0 * math.pi) ** 2 * square - (influence * splines) ** 2
    force = influence**2 * splines * _fourth(x.splines, y.splines, z.splines)
    force -= 8.0 * math.pi * influence * _fourth(x.smeared, y.smeared, z.smeared)
    force += (4.0 * math.pi) ** 2 * _second(x.square, y.square, z.square)
    own = influence * splines - 4.0 * math.pi * gauss
    weighted = influence * twice
    waves = np.zeros((3, 3))
    axes = (x, y, z)
    for a in range(3):
        for b in range(3):
            rows = [each.splines[1] if c == b else each.splines[0] for c, each in enumerate(axes)]
            rows[a] = axes[a].neighbours[1 if a == b else 0]
            waves[a, b] = np.einsum("ijk,i,j,k", weighted, *rows, optimize=True)
    return MeshSums(
        influence,
        max(float((field * twice).sum()), 0.0),
        max(float((force * twice).sum()), 0.0),
        float((own * twice).sum()) / 3.0,
        waves * (-1.0) ** order,
    )


def mesh_errors(sums: MeshSums, volume: float, spacing: float) -> tuple[float, float]:
    """Relative errors of force and flux density, in the units of `ewald`; `spacing` is a."""
    density = 3.0 / (4.0 * math.pi * spacing**3)
    force = math.sqrt(density * sums.force_square / (9.0 * volume) / 6.0) * spacing**4
    return force, math.sqrt(density * sums.field_square / (3.0 * volume) / 2.0) * spacing**3


@functools.cache
def _estimates(order: int) -> tuple[np.ndarray, np.ndarray]:
    """Logarithms of force_square h⁵/V and field_square h³/V for each α h, of a mesh of cubic cells."""
    found = [mesh_sums((CELLS,) * 3, (CELLS,) * 3, order, product) for product in PRODUCTS]
    force, field = np.array([(each.force_square, each.field_square) for each in found]).T / CELLS**3
    return (
        np.log(np.maximum.accumulate(np.maximum(force, 1e-30))),
        np.log(np.maximum.accumulate(np.maximum(field, 1e-30))),
    )


def widest_cells(order: int, alpha: float, spacing: float, limits: tuple[float, float]) -> float:
    """Largest spacing h [m] of the nodes for which the errors of force and flux density are below the limits."""
    density = 3.0 / (4.0 * math.pi * spacing**3)
    force, field = _estimates(order)
    h = np.log(PRODUCTS / alpha)
    # errors of `mesh_errors`, squared
    least = math.log(density / 54.0) + 8.0 * math.log(spacing) + force - 5.0 * h
    other = math.log(density / 6.0) + 6.0 * math.log(spacing) + field - 3.0 * h
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


def new_mesh(sums: MeshSums, nodes: tuple[int, int, int], volume: float, count: int) -> Mesh:
    """The mesh of the loops for a number of grains, of dipoles."""
    scale = MAGNETIC / volume
    rows, columns = nodes[:2], nodes[2] // 2 + 1
    return Mesh(
        np.zeros((*rows, nodes[2] + SIMD_WIDTH - 1)),
        np.zeros((*rows, columns, 2)),
        scale * math.prod(nodes) * sums.influence,
        np.zeros((count, 9, SIMD_WIDTH)),
        np.zeros((3, count), np.int64),
        np.zeros(nodes[0] + 1, np.int64),
        np.zeros(count, np.int64),
        np.zeros((3, count)),
        np.zeros((3, count)),
        scale * sums.self_wave,
    )


__all__ = ["ORDERS", "mesh_errors", "mesh_sums", "new_mesh", "nodes_for", "widest_cells"]
