"""Damping of the motion of grains relative to the rigid motion of their cluster, at a rate of the user.

For the grains of a cluster, with s = x − X from its centre of mass, V = P/M and Ω = J⁻¹ L,

    v → V + Ω×s + e^(−t/τ) (v − V − Ω×s),   ω → Ω + e^(−t/τ) (ω − Ω)
    L = Σ m s×(v − V) + I ω,   J = Σ m (s² 1 − s s) + I 1

Momentum and angular momentum of every cluster are unchanged: those of the rigid motion are P and L, so that the rest
has none.  The internal kinetic energy, K − P²/2M − ½ Ω·J Ω, falls by the factor e^(−2t/τ).
"""

from ..compiler.jit import formula, loop
from ..numerics.flow import spans_half, with_flow
from ..numerics.vec import add, axpy, cross, dot, load, nearest_image, put, scale, sub

PERIOD_FRACTION = 0.05
"""Time between two applications, in τ."""


@formula
def with_grain(tensor, m, inertia, s):
    """Tensor (xx, yy, zz, xy, xz, yz) of inertia, with that of a grain at s from the centre: m (s² 1 − s s) + I 1."""
    xx, yy, zz, xy, xz, yz = tensor
    x, y, z = s
    a, b, c = (m * (y * y + z * z) + inertia), (m * (x * x + z * z) + inertia), (m * (x * x + y * y) + inertia)
    return xx + a, yy + b, zz + c, xy - m * x * y, xz - m * x * z, yz - m * y * z


@formula
def solve_symmetric(tensor, b):
    """Solution x of A x = b, with a symmetric, positive definite A (xx, yy, zz, xy, xz, yz), by its factors L D Lᵀ.

    The residual is of the order of rounding for any condition of A, as for the tensor of inertia of a long chain.
    """
    xx, yy, zz, xy, xz, yz = tensor
    l1, l2 = xy / xx, xz / xx
    d = yy - l1 * xy
    rest = yz - l1 * xz
    l3 = rest / d
    z1 = b[1] - l1 * b[0]
    z = (b[2] - l2 * b[0] - l3 * z1) / (zz - l2 * xz - l3 * rest)
    y = z1 / d - l3 * z
    return b[0] / xx - l1 * y - l2 * z, y, z


@loop
def list_cluster(grains, contacts, clusters, span, first, since):
    """List the grains connected with grain `first` by contacts that formed until `since` [s].

    Their vectors from grain `first` are sums of nearest images along contacts, valid across periodic boundaries.

    Returns
    -------
    int
        Number of grains, the first ones of `clusters.member`.
    """
    clusters.member[0], clusters.listed[first] = first, 1
    put(clusters.offset, first, (0.0, 0.0, 0.0))
    size, k = 1, 0
    while k < size:
        i = clusters.member[k]
        for entry in range(contacts.start[i], contacts.start[i + 1]):
            side = contacts.side[entry]
            c = side >> 1
            j = contacts.pair[1 - (side & 1), c]
            if clusters.listed[j] == 0 and contacts.formed[c] <= since:
                step = nearest_image(sub(load(grains.position, j), load(grains.position, i)), span)
                put(clusters.offset, j, add(load(clusters.offset, i), step))
                clusters.member[size], clusters.listed[j] = j, 1
                size += 1
        k += 1
    return size


@loop
def rigid_motion(grains, clusters, size, span):
    """Velocity V and rotation Ω of the listed cluster; its offsets become those from the centre of mass.

    In a box that is deformed, V is that relative to the flow at the centre of mass, and Ω that of the laboratory.
    """
    mass, centre, momentum = 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for k in range(size):
        i = clusters.member[k]
        mass += grains.mass[i]
        centre = axpy(grains.mass[i], load(clusters.offset, i), centre)
        momentum = axpy(grains.mass[i], load(grains.velocity, i), momentum)
    centre, velocity, angular = scale(1.0 / mass, centre), scale(1.0 / mass, momentum), (0.0, 0.0, 0.0)
    tensor = (0.0,) * 6
    for k in range(size):
        i = clusters.member[k]
        m, inertia, s = grains.mass[i], grains.inertia[i], sub(load(clusters.offset, i), centre)
        put(clusters.offset, i, s)
        angular = axpy(m, cross(s, with_flow(sub(load(grains.velocity, i), velocity), s, span)), angular)
        angular = axpy(inertia, load(grains.spin, i), angular)
        tensor = with_grain(tensor, m, inertia, s)
    return velocity, solve_symmetric(tensor, angular)


@loop
def settle_clusters(grains, contacts, clusters, span, since, part):
    """Remove a part of the motion of all grains relative to the rigid motion of their cluster.

    In a box that is deformed, clusters that span half of it are left out: they may be joined to their own images, and
    are then strained with the box.

    Parameters
    ----------
    clusters : ClusterArrays
        Memory for one cluster at a time.
    since : float
        Time of the last application [s].  Contacts that formed later do not connect: their grains were not in contact
        all the time.
    part : float
        1 − e^(−t/τ).

    Returns
    -------
    float
        Kinetic energy removed [J].
    """
    removed = 0.0
    clusters.listed[:] = 0
    for first in range(grains.mass.size):
        if clusters.listed[first] == 0 and contacts.start[first + 1] > contacts.start[first]:
            size = list_cluster(grains, contacts, clusters, span, first, since)
            if size > 1:
                velocity, rotation = rigid_motion(grains, clusters, size, span)
                if spans_half(clusters.offset, clusters.member, 0, size, span):
                    continue
                for k in range(size):
                    i = clusters.member[k]
                    v, w, s = load(grains.velocity, i), load(grains.spin, i), load(clusters.offset, i)
                    rigid = add(velocity, cross(rotation, s))
                    change_v = scale(part, sub(with_flow(v, s, span), rigid))
                    change_w = scale(part, sub(w, rotation))
                    new_v, new_w = sub(v, change_v), sub(w, change_w)
                    put(grains.velocity, i, new_v)
                    put(grains.spin, i, new_w)
                    # v² − v'² as a product: accurate where the two are nearly equal
                    removed += 0.5 * grains.mass[i] * dot(sub(v, new_v), add(v, new_v))
                    removed += 0.5 * grains.inertia[i] * dot(sub(w, new_w), add(w, new_w))
    return removed
