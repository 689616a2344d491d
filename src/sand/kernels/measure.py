"""What the books need: energies, momenta.  Looked at between steps, never inside them."""

from ..core.box import nearest_image
from ..core.jit import kernel, loop
from ..core.vec import add, cross, dot, load, scale
from ..core.world import CONTACTS
from ..physics import contact as law_of
from .contacts import bond_at, pose_at
from .dipoles import dipole_energy

ENERGIES = ("translation", "rotation", "normal", "sliding", "rolling", "twisting", "magnetic")


@loop
def _kinetic(grains):
    moving = spinning = 0.0
    for i in range(grains.mass.size):
        v, w = load(grains.velocity, i), load(grains.spin, i)
        moving += 0.5 * grains.mass[i] * dot(v, v)
        spinning += 0.5 * grains.inertia[i] * dot(w, w)
    return moving, spinning


@kernel
def measure_energies(grains, contacts, count, span, dipoles, out):
    """Fill `out` with the energies [J] named in ENERGIES."""
    out[0], out[1] = _kinetic(grains)
    for mode in range(4):
        out[2 + mode] = 0.0
    for c in range(count[CONTACTS]):
        i, j = contacts.pair[0, c], contacts.pair[1, c]
        r1, r2 = grains.radius[i], grains.radius[j]
        pose = pose_at(grains, contacts, span, c, contacts.twist[c])
        stored = law_of.energies(pose, r1 + r2 - pose.distance, r1, r2, bond_at(contacts, c))
        for mode in range(4):
            out[2 + mode] += stored[mode]
    out[6] = dipole_energy(grains, span, dipoles)


@kernel
def measure_momenta(grains, out):
    """Fill `out` (6,) with momentum [kg m/s] and angular momentum about the origin [J s], spin included."""
    linear = angular = (0.0, 0.0, 0.0)
    for i in range(grains.mass.size):
        p = scale(grains.mass[i], load(grains.velocity, i))
        linear = add(linear, p)
        orbit = cross(load(grains.position, i), p)
        angular = add(angular, add(orbit, scale(grains.inertia[i], load(grains.spin, i))))
    for axis in range(3):
        out[axis] = linear[axis]
        out[3 + axis] = angular[axis]


@kernel
def measure_gaps(grains, pairs, span, out):
    """Overlap δ [m] of each listed pair (2, P)."""
    for p in range(pairs.shape[1]):
        i, j = pairs[0, p], pairs[1, p]
        apart = nearest_image(
            (
                grains.position[0, i] - grains.position[0, j],
                grains.position[1, i] - grains.position[1, j],
                grains.position[2, i] - grains.position[2, j],
            ),
            span,
        )
        out[p] = grains.radius[i] + grains.radius[j] - dot(apart, apart) ** 0.5
