"""Energies for the books.  Looked at between steps, never inside them."""

from ..core.jit import kernel, loop
from ..core.vec import dot, load
from ..core.world import CONTACTS
from ..physics import adhesion
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
def measure_energies(grains, contacts, count, span, dipoles, follow, out):
    """Fill `out` with the energies [J] named in ENERGIES."""
    out[0], out[1] = _kinetic(grains)
    for mode in range(4):
        out[2 + mode] = 0.0
    for c in range(count[CONTACTS]):
        i, j = contacts.pair[0, c], contacts.pair[1, c]
        r1, r2 = grains.radius[i], grains.radius[j]
        pose = pose_at(grains, contacts, span, c, contacts.twist[c])
        overlap, bond = r1 + r2 - pose.distance, bond_at(contacts, c)
        y = adhesion.root(adhesion.stretch(overlap, bond.pull_off_overlap))
        stored = law_of.energies(pose, overlap, y, r1, r2, law_of.stiffened(bond, y, follow))
        for mode in range(4):
            out[2 + mode] += stored[mode]
    out[6] = dipole_energy(grains, span, dipoles)
