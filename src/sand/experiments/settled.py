"""When fragments hold together: the energy left in their motion, and the times in which this motion ends.

`docs/physics/collisions.md` derives the criterion.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..analysis.body_motion import RigidMotion, motion_of, rigid_motion
from ..analysis.bridges import SpanningTrees
from ..basics.arguments import checked
from ..basics.state import CHANGED
from ..contact.constants_table import FASTEST_MODE
from ..contact.law import Strength, contact_strength
from ..contact.measure import ENERGIES
from ..contact.model import Contact
from ..simulation.simulation import Simulation

HORIZON = 10.0
"""A collision is decided if no contact is expected to break until this multiple of its time."""
MOST_BREAKS = 1e-4
"""Largest expected number of contacts that break until then; small, because modes do not exchange energy freely."""


@checked
def expected_breaks(energy: Any, breaking: Any, modes: Any, attempts: Any) -> np.ndarray:
    """Expected number of contacts that break in isolated bodies whose vibrations share their energy at random.

    n = A (1 − E_b/E)^(s−1) for E > E_b, otherwise 0: the probability that one of s harmonic modes has at least E_b of
    the energy E (Kassel 1928), times the number of vibrations of the contacts.

    Parameters
    ----------
    energy, breaking : ndarray
        E ≥ 0, the energy of the vibrations of each body, and E_b > 0, to break its weakest contact [J], (K,).
    modes : ndarray
        s, number of modes, see `modes_of`, (K,).
    attempts : ndarray
        A, number of vibrations of all its contacts in the time for which breaks are counted, (K,).
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(energy > breaking, 1.0 - np.asarray(breaking) / energy, 0.0)
    return np.where(share > 0.0, attempts * share ** (np.maximum(modes, 1) - 1.0), 0.0)


@checked
def modes_of(grains: Any, contacts: Any, springs: int) -> np.ndarray:
    """Number of modes that share the energy of each body: 6N − 6, but no more than it has springs.

    Without springs against sliding, rolling or twisting there are fewer modes, and more of the energy for each. In a
    pair the motion along the line of centres is separate from all others: 1.

    Parameters
    ----------
    grains, contacts : ndarray
        Numbers N of grains and C of contacts of each body (K,).
    springs : int
        Springs of a contact, see `springs_of`.
    """
    count = np.asarray(grains)
    return np.where(count == 2, 1, np.minimum(6 * count - 6, springs * np.asarray(contacts)))


@checked
def swing_time(inertia: Any, energy: Any, moment: Any) -> np.ndarray:
    """Time [s] in which two parts of a body that turn about the contact between them stop, or turn by a radian.

    With the speed Ω = √(2E/J), the shorter one of 1/Ω = √(J/2E) and JΩ/M = √(2EJ)/M, after which the constant moment M
    of a contact that slips has stopped them: at most √(J/M).

    Parameters
    ----------
    inertia, energy, moment : ndarray
        J > 0 [kg m²], 1/J = 1/J₁ + 1/J₂ of the two parts; E ≥ 0, their relative kinetic energy [J]; M ≥ 0 [N m].
    """
    inertia, energy, moment = (np.asarray(each, float) for each in (inertia, energy, moment))
    with np.errstate(divide="ignore", invalid="ignore"):
        stop = np.where(energy > 0.0, np.sqrt(2.0 * energy * inertia) / moment, 0.0)
        return np.minimum(stop, np.sqrt(0.5 * inertia / energy))


class Swings(NamedTuple):
    """Relative motion of the two parts of a body on both sides of each bridge, a contact that alone joins them."""

    contact: np.ndarray  # (B,) index of the bridge
    inertia: np.ndarray  # (B,) largest J of the two parts about the contact, 1/J = 1/J₁ + 1/J₂ [kg m²]
    energy: np.ndarray  # (B,) kinetic energy of both as rigid bodies, relative to the rigid motion of the body [J]


@checked
def swings(grains: Any, pairs: np.ndarray, motion: RigidMotion) -> Swings:
    """Relative motion of the parts of bodies on both sides of their bridges.

    Parameters
    ----------
    grains : Grains
        Grains of a simulation.
    pairs : ndarray
        Contacts (C, 2).
    motion : RigidMotion
        Of the bodies, in an open box.
    """
    label, first = motion.label, np.unique(motion.label, return_index=True)[1]
    x, u, w = motion.offset.T, motion.relative.T, motion.relative_spin.T
    mass, inertia, radius = (np.asarray(each)[:, None] for each in (grains.mass, grains.inertia, grains.radius))
    second = (x[:, :, None] * x[:, None, :]).reshape(-1, 9)
    rows = np.hstack((mass, mass * x, mass * u, mass * np.cross(x, u) + inertia * w, mass * second, inertia))
    trees = SpanningTrees(len(label), pairs, first)
    sums, bridges = trees.over_subtrees(np.add, trees.at_nodes(rows)), trees.bridges()
    contact, one = trees.contact[bridges], sums[bridges]
    i, j = np.asarray(pairs)[contact].T
    other = sums[trees.nodes_of(first[label[trees.grain[bridges]]])] - one
    at = x[i] + radius[i] / (radius[i] + radius[j]) * (x[j] - x[i])
    parts = _inertia_about(one, at), _inertia_about(other, at)
    return Swings(contact, parts[0] * parts[1] / (parts[0] + parts[1]), _kinetic(one) + _kinetic(other))


def _kinetic(part: np.ndarray) -> np.ndarray:
    """Kinetic energy [J] of parts that move as rigid bodies, from their sums in `swings`."""
    mass, momentum = part[:, :1], part[:, 4:7]
    centre = part[:, 1:4] / mass
    angular = part[:, 7:10] - np.cross(centre, momentum)
    second = part[:, 10:19].reshape(-1, 3, 3) - mass[:, :, None] * centre[:, :, None] * centre[:, None, :]
    tensor = (np.trace(second, axis1=1, axis2=2) + part[:, 19])[:, None, None] * np.eye(3) - second
    spin = np.linalg.solve(tensor, angular[:, :, None])[:, :, 0]
    return 0.5 * ((momentum**2).sum(axis=1) / mass[:, 0] + (angular * spin).sum(axis=1))


def _inertia_about(part: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Σ [m |x − c|² + I] [kg m²] about points c (B, 3), which no moment of inertia about an axis exceeds."""
    square = np.trace(part[:, 10:19].reshape(-1, 3, 3), axis1=1, axis2=2)
    return square - 2.0 * (part[:, 1:4] * at).sum(axis=1) + part[:, 0] * (at * at).sum(axis=1) + part[:, 19]


def are_settled(simulation: Simulation, labels: np.ndarray) -> bool:
    """Whether no contact of the fragments of a collision is expected to break any more.

    Parameters
    ----------
    simulation : Simulation
        Simulation in open space, whose only forces are those of contacts.
    labels : ndarray
        Fragment of each grain (N,).
    """
    table, grains, state = simulation.contacts, simulation.grains, simulation.regular_state
    pairs = table["pair"].astype(np.int64)
    if not len(pairs):
        return True
    strength: Any = strength_of(simulation, pairs)
    of_contact, count = labels[pairs[:, 0]], int(labels.max()) + 1
    stored = np.sum([table[f"energy_{mode}"] for mode in ENERGIES], axis=0) - strength.rest
    rigid = rigid_motion(grains, pairs, simulation.box, labels)
    motion = motion_of(grains, rigid)
    weakest, softest = np.full(count, np.inf), np.full(count, np.inf)
    np.minimum.at(weakest, of_contact, strength.breaking)
    np.minimum.at(softest, of_contact, strength.turning)
    energy = np.maximum(motion.internal + np.bincount(of_contact, stored, count), 0.0)
    lonely = motion.grains[of_contact] == 2
    energy[of_contact[lonely]] = _energy_along(grains, pairs[lonely]) + (table["energy_normal"] - strength.rest)[lonely]
    frequency = np.sqrt(state.contacts.constants[FASTEST_MODE].max()) / (2.0 * np.pi)
    contacts = np.bincount(of_contact, minlength=count)
    attempts = (HORIZON - 1.0) * simulation.time * frequency * contacts
    modes = modes_of(motion.grains, contacts, springs_of(contact_model(simulation)))
    if expected_breaks(energy, weakest, modes, attempts).sum() > MOST_BREAKS:
        return False
    found, turns = swings(grains, pairs, rigid), np.linalg.norm(rigid.spin, axis=0)
    fast = (motion.rotation > np.minimum(weakest, softest)) & (turns > 0.0)
    times = [*(1.0 / turns[fast]), *swing_time(found.inertia, found.energy, strength.turning[found.contact])]
    return simulation.time - float(state.clock[CHANGED]) >= max(times, default=0.0)


def _energy_along(grains: Any, pairs: np.ndarray) -> np.ndarray:
    """Kinetic energy ½ m̄ w² [J] of the motion of two grains along the line of their centres, (C,)."""
    one, other = pairs.T
    apart, mass = grains.position[one] - grains.position[other], np.asarray(grains.mass)
    opening = ((grains.velocity[one] - grains.velocity[other]) * apart).sum(axis=1) / np.linalg.norm(apart, axis=1)
    return 0.5 * mass[one] * mass[other] / (mass[one] + mass[other]) * opening**2


def contact_model(simulation: Simulation) -> Contact | None:
    """The contact model of a simulation, if there is one."""
    return next((force for force in simulation.forces if isinstance(force, Contact)), None)


def springs_of(model: Contact | None) -> int:
    """Springs of a contact: one along the line of centres, two against sliding, two against rolling, one of twist."""
    factors = () if model is None else ((model.slide_factor, 2), (model.roll_factor, 2), (model.twist_factor, 1))
    return 1 + sum(number for factor, number in factors if factor > 0.0)


def strength_of(simulation: Simulation, pairs: np.ndarray) -> Strength:
    """`Strength` of each contact, (C,) each; 0 where grains have no contact model."""
    grains, model = simulation.grains, contact_model(simulation)
    if model is None:
        return Strength(*np.zeros((len(Strength._fields), len(pairs))))
    radii, size = np.unique(np.asarray(grains.radius), return_inverse=True)
    material, sizes = np.asarray(grains.material, np.int64), len(radii)
    kind = material * sizes + size  # material and radius of a grain as one number, and of the two of a contact
    kinds = len(grains.materials) * sizes
    both, row = np.unique(kind[pairs[:, 0]] * kinds + kind[pairs[:, 1]], return_inverse=True)
    found = []
    for ends in zip(*np.divmod(both, kinds), strict=True):
        pairing = model.pairing(*(grains.materials[one // sizes] for one in ends))
        found.append(contact_strength(model.contact_law, pairing, *(float(radii[one % sizes]) for one in ends)))
    return Strength(*np.reshape(found, (-1, len(Strength._fields)))[row].T)
