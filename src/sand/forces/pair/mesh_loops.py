"""Loops of a particle mesh for the reciprocal part of an Ewald sum.

Grains are spread onto a mesh by B-splines M of an order p (smooth particle-mesh Ewald sum, Essmann et al. 1995), with
u_a = K_a x_a/L_a of the K_a nodes along each axis,

    ρ(k) = Σ_j s_j Π_a M(u_aj − k_a),  s_j = μ_j·∇ (dipoles) or q_j (charges)

and the potential φ is the convolution of ρ with the influence function G, by Fourier transforms.  Then

    U = ½ Σ_k ρ φ,  B_j = −∇ψ,  F_j = −∇ s_j ψ,  ψ(x_j) = Σ_k φ(k) Π_a M(u_aj − k_a)

The loads are the exact gradients of this energy.  Dipoles need ∇ψ and the second derivatives of ψ, charges ψ and ∇ψ;
with p ≥ 5 the force is continuous with its derivative.  The loops are the same for both: what a grain adds to the mesh
and what it takes from ψ are formulas (`MeshSource`).

The work is done in rounds, each of blocks that are independent of one another: planes of the mesh are filled (each sums
over its own grains, in a fixed order), transformed, and read.  Blocks depend on the number of grains alone, and so do
results: the bits are the same for any number of threads, and for any division into blocks.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...basics.alignment import SIMD_WIDTH
from ...compiler.jit import formula, loop
from ...compiler.recipes import factory
from ...numerics.flow import add_virial, compression
from ...numerics.kinds_of_box import unless_still
from ...numerics.turns import cosine_and_sine
from ...numerics.vec import accrue, load, put
from .long_range_loops import Round

ORDERS = 5, 6, 7, 8
"""Orders of the splines that are compared; at most `SIMD_WIDTH`."""


class Mesh(NamedTuple):
    """A mesh of K_x × K_y × K_z nodes, and the arrays of its loops; V is the padded number of grains."""

    density: np.ndarray  # (K_x, K_y, K_z + 7): ρ, then φ; the last 7 columns repeat the first
    spectrum: np.ndarray  # (K_x, K_y, K_z/2 + 1, 2): Fourier transform of ρ, real and imaginary parts
    influence: np.ndarray  # (K_x, K_y, K_z/2 + 1): G
    spline: np.ndarray  # (N, 9, 8): M, M′, M″ along x, along y, along z [1, 1/m, 1/m²]; p values, then 0
    node: np.ndarray  # (3, N) int64: first node of each grain
    start: np.ndarray  # (K_x + 1,) int64: first entry of each plane in `order`
    order: np.ndarray  # (N,) int64: grains by their first plane
    force: np.ndarray  # (3, N) [N]
    field: np.ndarray  # (3, N), −∂U/∂s: B [T] of dipoles; (−ψ, 0, 0) [V] of charges
    self_wave: np.ndarray  # (3, 3): amplitude T_ab of the self-interaction, see `remove_self_waves`
    # in a box that is deformed; no elements in other boxes
    chosen: np.ndarray  # (K_x, K_y, K_z/2 + 1): G of the box for which the mesh was chosen
    slope: np.ndarray  # (K_x, K_y, K_z/2 + 1): 2 (1/q² + 1/4α²) [m²] of the present box
    lengths: np.ndarray  # (3,): sides of the first box [m]
    square: np.ndarray  # (3, K): q² along each axis, of the present box
    ratio: np.ndarray  # (2, 3, K): q² of the first box, exp(−(q² of the present one − that)/4α²)
    virial: np.ndarray  # (3, blocks): Σ U_q [1 − q_a² slope] [J]


class MeshSource(NamedTuple):
    """The formulas of grains on a mesh."""

    row: Callable  # (grains, i, m_x, d_x, m_y, d_y) → a, b: ρ along a row of nodes is a M + b M′ of z
    loads: Callable  # (grains, i, ψ, ∇ψ, second derivatives xx, yy, zz, xy, xz, yz) → force [N], −∂U/∂s
    own: Callable  # (grains, i) → s: μ [A m²], or (q, 0, 0) [C]


@formula
def nodes_and_fraction(turns, number):
    """The first node of a coordinate, in units of the side, and its distance from there in units of the spacing."""
    u = (turns - math.floor(turns)) * number
    node = min(int(u), number - 1)
    return node, u - node


@loop
def fill_spline(spline, i, axis, order, t, stretch):
    """M, M′ and M″ of the nodes 0 … p − 1 of a grain, by recursion in the order; `stretch` = K/L [1/m].

    M_n(t + n − 1 − j) for node j; M_p′(u) = M_{p−1}(u) − M_{p−1}(u − 1), M_p″ with the second difference of M_{p−2}.
    """
    row, slope, curve = 3 * axis, 3 * axis + 1, 3 * axis + 2
    for j in range(order):
        spline[i, row, j] = 0.0
    spline[i, row, 0], spline[i, row, 1] = 1.0 - t, t
    for n in range(3, order + 1):
        if n == order:
            for j in range(order):
                here = spline[i, row, j] if j < order - 1 else 0.0
                before = spline[i, row, j - 1] if j > 0 else 0.0
                spline[i, slope, j] = stretch * (before - here)
        elif n == order - 1:
            for j in range(order):
                here = spline[i, row, j] if j < order - 2 else 0.0
                before = spline[i, row, j - 1] if 0 < j < order - 1 else 0.0
                twice = spline[i, row, j - 2] if j > 1 else 0.0
                spline[i, curve, j] = stretch * stretch * (twice - 2.0 * before + here)
        part = 1.0 / (n - 1.0)
        spline[i, row, n - 1] = part * t * spline[i, row, n - 2]
        for m in range(1, n - 1):
            j = n - 1 - m
            spline[i, row, j] = part * ((t + m) * spline[i, row, j - 1] + (n - m - t) * spline[i, row, j])
        spline[i, row, 0] = part * (1.0 - t) * spline[i, row, 0]


@loop
def sort_by_plane(mesh, count):
    """Order of the grains by their first plane, and by index within a plane."""
    start, order = mesh.start, mesh.order
    planes = start.size - 1
    for k in range(planes + 1):
        start[k] = 0
    for i in range(count):
        start[mesh.node[0, i] + 1] += 1
    for k in range(planes):
        start[k + 1] += start[k]
    for i in range(count):  # start[k] moves to the end of plane k, the start of plane k + 1
        k = mesh.node[0, i]
        order[start[k]] = i
        start[k] += 1
    for k in range(planes):
        start[planes - k] = start[planes - k - 1]
    start[0] = 0


@unless_still(lambda parameters, span: None)
def follow_box(parameters, span):
    """Set G, which is the mean of exp(−q²/4α²)/q² over aliases, to that of the present box, and the slopes.

    It changes by the factor exp(−(q² − q₀²)/4α²) q₀²/q² V₀/V of the wave itself from q₀ and V₀ of the first box.
    """
    mesh, quarter = parameters.mesh, 0.25 / parameters.alpha**2
    shape, ratio, square = mesh.influence.shape, mesh.ratio, mesh.square
    change, inverse = compression(parameters.volume, span), (span.inverse_x, span.inverse_y, span.inverse_z)
    for a in range(3):
        for n in range(shape[a]):
            turn = 2.0 * math.pi * (n if a == 2 or 2 * n < shape[a] else n - shape[a])
            square[a, n], ratio[0, a, n] = (turn * inverse[a]) ** 2, (turn / mesh.lengths[a]) ** 2
            ratio[1, a, n] = math.exp(-quarter * (square[a, n] - ratio[0, a, n]))
    for i in range(shape[0]):
        for j in range(shape[1]):
            across, before = square[0, i] + square[1, j], ratio[0, 0, i] + ratio[0, 1, j]
            factor = change * ratio[1, 0, i] * ratio[1, 1, j]
            for k in range(shape[2]):
                inverse_square = 1.0 / max(across + square[2, k], 1e-300)
                mesh.influence[i, j, k] = (
                    mesh.chosen[i, j, k] * factor * ratio[1, 2, k] * (before + ratio[0, 2, k]) * inverse_square
                )
                mesh.slope[i, j, k] = 2.0 * (inverse_square + quarter)
    mesh.influence[0, 0, 0] = mesh.slope[0, 0, 0] = 0.0


@loop
def begin_mesh(grains, span, parameters):
    """Before the first round."""
    follow_box(parameters, span)


@loop
def add_mesh_virial(long_range, mesh, span):
    """Add the virial of all waves of the mesh."""
    for b in range(mesh.virial.shape[1]):
        add_virial(long_range.virial, 0, load(mesh.virial, b), span)


@formula
def block_limits(b, blocks, number):
    """First element of block b, and of the next one, of a number of elements."""
    return b * number // blocks, (b + 1) * number // blocks


@formula
def dipole_row(grains, i, m_x, d_x, m_y, d_y):
    """ρ along a row of nodes is a M + b M′ of z: μ·∇ of the product of splines."""
    mu = load(grains.moment, i)
    return mu[0] * d_x * m_y + mu[1] * m_x * d_y, mu[2] * m_x * m_y


@formula
def dipole_loads(grains, i, potential, slope, curve):
    """Force F_a = −Σ_b μ_b ∂_a∂_b ψ [N] and flux density −∇ψ [T]; `curve` is xx, yy, zz, xy, xz, yz."""
    mu = load(grains.moment, i)
    force = (
        -(curve[0] * mu[0] + curve[3] * mu[1] + curve[4] * mu[2]),
        -(curve[3] * mu[0] + curve[1] * mu[1] + curve[5] * mu[2]),
        -(curve[4] * mu[0] + curve[5] * mu[1] + curve[2] * mu[2]),
    )
    return force, (-slope[0], -slope[1], -slope[2])


@formula
def dipole_moment(grains, i):
    """μ [A m²]."""
    return load(grains.moment, i)


@formula
def charge_row(grains, i, m_x, d_x, m_y, d_y):
    """As `dipole_row`, of charges: q times the product of splines."""
    return grains.charge[i] * m_x * m_y, 0.0


@formula
def charge_loads(grains, i, potential, slope, curve):
    """Force −q ∇ψ [N], and −ψ [V] in place of a flux density."""
    q = grains.charge[i]
    return (-q * slope[0], -q * slope[1], -q * slope[2]), (-potential, 0.0, 0.0)


@formula
def charge_vector(grains, i):
    """(q, 0, 0) [C]."""
    return grains.charge[i], 0.0, 0.0


MESH_DIPOLES = MeshSource(dipole_row, dipole_loads, dipole_moment)
MESH_CHARGES = MeshSource(charge_row, charge_loads, charge_vector)


@loop
def add_to_row(row, weights, z, across, along):
    """Add across · M + along · M′ of z to a row of nodes; whole SIMD vectors."""
    for m in range(np.uint64(SIMD_WIDTH)):
        row[z + m] += across * weights[6, m] + along * weights[7, m]


@loop
def sums_over_row(row, weights, z):
    """Sums of a row of nodes with M, M′ and M″ of z."""
    s0 = s1 = s2 = 0.0
    for m in range(np.uint64(SIMD_WIDTH)):
        value = row[z + m]
        s0 += value * weights[6, m]
        s1 += value * weights[7, m]
        s2 += value * weights[8, m]
    return s0, s1, s2


def transform_planes(parameters: object, b: int, blocks: int) -> None:
    """Fourier transforms of a block of planes along y and z."""
    from scipy.fft import rfft2  # slow import

    mesh: Mesh = parameters.mesh  # type: ignore[attr-defined]
    first, last = block_limits(b, blocks, len(mesh.density))
    spectrum = _complex(mesh.spectrum)
    spectrum[first:last] = rfft2(mesh.density[first:last, :, : _columns(mesh)], axes=(1, 2), workers=1)


def convolve_lines(parameters: object, b: int, blocks: int) -> None:
    """Transforms of a block of lines along x, multiplied by G, and the inverse transforms."""
    from scipy.fft import fft, ifft

    mesh: Mesh = parameters.mesh  # type: ignore[attr-defined]
    first, last = block_limits(b, blocks, mesh.density.shape[1])
    spectrum = _complex(mesh.spectrum)
    lines = fft(spectrum[:, first:last], axis=0, workers=1)
    if mesh.slope.size:
        mesh.virial[:, b] = _virial_of_lines(mesh, lines, first, last)
    lines *= mesh.influence[:, first:last]
    spectrum[:, first:last] = ifft(lines, axis=0, overwrite_x=True, workers=1)


def _virial_of_lines(mesh: Mesh, lines: np.ndarray, first: int, last: int) -> np.ndarray:
    """Σ U_q [1 − q_a² slope] (3,) [J] of the transforms ρ̂ of a block of lines, U_q = G |ρ̂|²/2N for N nodes."""
    columns, nodes = mesh.influence.shape[2], len(mesh.density) * mesh.density.shape[1] * _columns(mesh)
    energy = (lines.real**2 + lines.imag**2) * mesh.influence[:, first:last]
    energy[..., 1 : columns - 1] *= 2.0  # q_z and −q_z
    weighted = energy * mesh.slope[:, first:last]
    parts = (weighted.sum(axis=(1, 2)), weighted.sum(axis=(0, 2)), weighted.sum(axis=(0, 1)))
    squares = mesh.square[0, : len(lines)], mesh.square[1, first:last], mesh.square[2, :columns]
    along = np.array([float(part @ square) for part, square in zip(parts, squares, strict=True)])
    return np.asarray((energy.sum() - along) / (2.0 * nodes))


def transform_back(parameters: object, b: int, blocks: int) -> None:
    """Inverse transforms of a block of planes along y and z, with the columns that repeat the first."""
    from scipy.fft import irfft2

    mesh: Mesh = parameters.mesh  # type: ignore[attr-defined]
    first, last = block_limits(b, blocks, len(mesh.density))
    columns = _columns(mesh)
    shape = mesh.density.shape[1], columns
    mesh.density[first:last, :, :columns] = irfft2(_complex(mesh.spectrum)[first:last], shape, axes=(1, 2), workers=1)
    mesh.density[first:last, :, columns:] = mesh.density[first:last, :, : mesh.density.shape[2] - columns]


def _columns(mesh: Mesh) -> int:
    """K_z."""
    return mesh.density.shape[2] - (SIMD_WIDTH - 1)


def _complex(spectrum: np.ndarray) -> np.ndarray:
    """The spectrum as complex numbers, a view."""
    return spectrum.view(np.complex128)[..., 0]


@factory
def mesh_rounds(order: int, source: MeshSource) -> tuple[Round, ...]:
    """The rounds of a mesh sum with splines of this order, which set `mesh.force` and `mesh.field`.

    The parameters have the field `mesh`, a `Mesh`.  Rows of splines are extended with zeros to whole SIMD vectors, and
    the columns of the mesh with them.
    """
    row, loads = source.row, source.loads
    one, nodes, pad = np.uint64(1), np.uint64(order), np.uint64(SIMD_WIDTH - 1)

    @loop
    def fill_splines(grains, span, parameters, b, blocks):
        mesh = parameters.mesh
        numbers = mesh.density.shape[0], mesh.density.shape[1], mesh.density.shape[2] - (SIMD_WIDTH - 1)
        inverse = span.inverse_x, span.inverse_y, span.inverse_z
        first, last = block_limits(b, blocks, grains.mass.size)
        for i in range(first, last):
            x = load(grains.position, i)
            for axis in range(3):
                node, t = nodes_and_fraction(x[axis] * inverse[axis], numbers[axis])
                mesh.node[axis, i] = node
                fill_spline(mesh.spline, i, axis, order, t, numbers[axis] * inverse[axis])

    @loop
    def prepare_planes(grains, span, parameters):
        sort_by_plane(parameters.mesh, grains.mass.size)

    @loop
    def fill_planes(grains, span, parameters, b, blocks):
        mesh = parameters.mesh
        density, spline = mesh.density, mesh.spline
        planes, rows, width = density.shape[0], np.uint64(density.shape[1]), np.uint64(density.shape[2])
        columns = width - pad
        first, last = block_limits(b, blocks, planes)
        for k in range(np.uint64(first), np.uint64(last)):
            for line in range(rows):
                for m in range(width):
                    density[k, line, m] = 0.0
            for j in range(nodes):
                plane = k - j if k >= j else k + np.uint64(planes) - j
                for s in range(np.uint64(mesh.start[plane]), np.uint64(mesh.start[plane + one])):
                    i = np.uint64(mesh.order[s])
                    weights = spline[i]
                    m_x, d_x = weights[0, j], weights[1, j]
                    n, z = np.uint64(mesh.node[1, i]), np.uint64(mesh.node[2, i])
                    for l in range(nodes):
                        across, along = row(grains, i, m_x, d_x, weights[3, l], weights[4, l])
                        add_to_row(density[k, n], weights, z, across, along)
                        n = n + one if n + one < rows else np.uint64(0)
            for line in range(rows):
                for m in range(pad):
                    density[k, line, m] += density[k, line, columns + m]

    @loop
    def read_planes(grains, span, parameters, b, blocks):
        mesh = parameters.mesh
        density, spline = mesh.density, mesh.spline
        planes, rows = np.uint64(density.shape[0]), np.uint64(density.shape[1])
        first, last = block_limits(b, blocks, grains.mass.size)
        for i in range(np.uint64(first), np.uint64(last)):
            weights = spline[i]
            k, z = np.uint64(mesh.node[0, i]), np.uint64(mesh.node[2, i])
            potential = x1 = y1 = z1 = x2 = y2 = z2 = xy = xz = yz = 0.0
            for j in range(nodes):
                p00 = p10 = p01 = p20 = p02 = p11 = 0.0  # derivatives along y and z
                n = np.uint64(mesh.node[1, i])
                for l in range(nodes):
                    s0, s1, s2 = sums_over_row(density[k, n], weights, z)
                    m_y, d_y = weights[3, l], weights[4, l]
                    p00 += m_y * s0
                    p01 += m_y * s1
                    p02 += m_y * s2
                    p10 += d_y * s0
                    p11 += d_y * s1
                    p20 += weights[5, l] * s0
                    n = n + one if n + one < rows else np.uint64(0)
                m_x, d_x = weights[0, j], weights[1, j]
                potential += m_x * p00
                x1 += d_x * p00
                y1 += m_x * p10
                z1 += m_x * p01
                x2 += weights[2, j] * p00
                y2 += m_x * p20
                z2 += m_x * p02
                xy += d_x * p10
                xz += d_x * p01
                yz += m_x * p11
                k = k + one if k + one < planes else np.uint64(0)
            force, field = loads(grains, i, potential, (x1, y1, z1), (x2, y2, z2, xy, xz, yz))
            put(mesh.force, i, force)
            put(mesh.field, i, field)

    return (
        Round(fill_splines, begin_mesh),
        Round(fill_planes, prepare_planes),
        Round(transform_planes, compiled=False),
        Round(convolve_lines, compiled=False),
        Round(transform_back, compiled=False),
        Round(read_planes),
    )


@factory
def remove_self_waves(source: MeshSource) -> Callable:
    """The loop that removes a part of the interaction of a grain with itself through the mesh.

    It is the part that varies with its position, U = Σ_b s_b² Σ_a T_ab cos 2πu_a with s = μ or (q, 0, 0); there are
    waves of higher orders, which are smaller.
    """
    own = source.own

    @loop
    def remove(grains, span, mesh):
        spacing_x = mesh.density.shape[0] * span.inverse_x
        spacing_y = mesh.density.shape[1] * span.inverse_y
        spacing_z = (mesh.density.shape[2] - (SIMD_WIDTH - 1)) * span.inverse_z
        inverse = spacing_x, spacing_y, spacing_z
        for i in range(grains.mass.size):
            x, s = load(grains.position, i), own(grains, i)
            square = s[0] * s[0], s[1] * s[1], s[2] * s[2]
            for a in range(3):
                u = x[a] * inverse[a]
                cosine, sine = cosine_and_sine(u - np.rint(u))
                along = 0.0
                for b in range(3):
                    amplitude = mesh.self_wave[a, b]
                    along += square[b] * amplitude
                    mesh.field[b, i] += 2.0 * s[b] * amplitude * cosine
                mesh.force[a, i] -= 2.0 * math.pi * inverse[a] * along * sine

    return remove


@loop
def add_mesh_forces(grains, long_range, mesh):
    """Add the forces of the mesh, less the net force, in proportion to the masses.

    The net force of the mesh is not exactly 0.  Its removal is a common acceleration of all grains: the momentum is
    kept, and no work is done in the frame of the centre of mass.
    """
    mass = x = y = z = 0.0
    for i in range(grains.mass.size):
        mass += grains.mass[i]
        x += mesh.force[0, i]
        y += mesh.force[1, i]
        z += mesh.force[2, i]
    for i in range(grains.mass.size):
        share = -grains.mass[i] / mass
        accrue(long_range.force, i, load(mesh.force, i))
        accrue(long_range.force, i, (share * x, share * y, share * z))


@loop
def add_mesh_field(grains, mesh):
    """Add the flux densities of the mesh."""
    for i in range(grains.mass.size):
        accrue(grains.field, i, load(mesh.field, i))
