"""A packing that comes to rest, and its response to small strains of its periodic box; see `elastic`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..basics.errors import warn
from ..basics.grains import Grains
from ..basics.initial_pairs import StrainedContacts
from ..config.case import COMPONENTS
from ..contact.law import contact_constants
from ..contact.model import Contact
from ..forces.gas import Gas
from ..setup.from_frame import Start
from ..simulation.simulation import Simulation
from ..theory.elastic import ContactSprings, affine_moduli
from .laboratory import filling_factor

AT_LIMIT = 1.0 - 1e-6
"""Share of the limit of sliding, rolling or twisting above which a contact counts as one that slips."""
DOUBLINGS = 9
"""How often the time in which a packing comes to rest is doubled, at most."""


class Column(NamedTuple):
    """Response to a small strain of the box along one axis."""

    moduli: np.ndarray  # (3,) −dP_aa/dε [Pa]
    changed: float  # relative change of these in the second half of the time
    unrecovered: float  # what stays of the change of stress when the box is as before, over the change
    at_limit_strained: int  # largest number of contacts at a limit
    made: int
    broken: int
    drift_strained: float  # energy error, see `Ledger.drift`


def strain_both_ways(rest: Simulation, axis: int, strain: float, time: float, accuracy: float) -> Column:
    """Strain two copies of a packing by ± ε, read the stress when they are at rest, and return.

    The moduli are −(P(+ε) − P(−ε))/2ε: what goes on without a strain is in both, and cancels.
    """
    pair, length = [rest.copy(), rest.copy()], float(rest.box.lengths[axis] or 0.0)
    for each, sign in zip(pair, (1.0, -1.0), strict=True):
        _stretch(each, axis, length * (1.0 + sign * strain), time)
    begun, held, before, moduli, changed = pair[0].time, 4.0 * time, None, np.zeros(3), math.inf
    for _ in range(DOUBLINGS):
        for each in pair:
            each.run(until=begun + held)
        moduli = -(_pressure(pair[0]) - _pressure(pair[1])) / (2.0 * strain)
        if before is not None and (changed := _change(moduli, before)) < accuracy:
            break
        before, held = moduli, 2.0 * held
    else:
        warn(
            f"the response to a strain of {strain:g} along {'xyz'[axis]} is not complete after {held / 2.0:.3g} s: in "
            f"the second half of this time the moduli changed by {100.0 * changed:.2g} %"
        )
    limits = max(_at_limit(each) for each in pair)
    made, broken = (
        max(each.ledger.rows[-1][name] - rest.ledger.rows[-1][name] for each in pair) for name in ("made", "broken")
    )
    for each in pair:
        _stretch(each, axis, length, time)
        each.run(until=each.time + held)
    left = np.abs(_pressure(pair[0]) - _pressure(pair[1])).max() / (2.0 * strain * np.abs(moduli).max())
    drift = max(abs(each.ledger.drift) for each in pair)
    return Column(moduli, changed, float(left), limits, int(made), int(broken), drift)


def come_to_rest(simulation: Simulation, time: float, accuracy: float, least: float) -> tuple[bool, float]:
    """Run until no element of P changes by more than `accuracy` of the largest, or `least` [Pa], as the time doubles.

    Returns whether it is so, and the last change [Pa]. Warns if it is not so after DOUBLINGS.
    """
    before, held, start = simulation.stress().total, 4.0 * time, simulation.time
    for _ in range(DOUBLINGS):
        simulation.run(until=start + held)
        now = simulation.stress().total
        changed, largest = float(np.abs(now - before).max()), float(np.abs(now).max())
        if changed < max(accuracy * largest, least):
            return True, changed
        before, held = now, 2.0 * held
    warn(
        f"the packing is not at rest after {simulation.time - start:.3g} s: in the second half of this time its stress "
        f"changed by {changed:.3g} Pa, of {largest:.3g} Pa"
    )
    return False, changed


def contact_springs(simulation: Simulation, contact: Contact) -> ContactSprings:
    """The contacts of a packing and their springs, with the present normal stiffness of the contact law."""
    table, grains, law = simulation.contacts, simulation.grains, contact.contact_law
    pair = np.asarray(table["pair"], np.int64)
    constants_of, stiffness = contact_constants(law), np.zeros((2, len(pair)))
    materials = [grains.materials[k] for k in grains.material]
    for c, (i, j) in enumerate(pair.tolist()):
        numbers = (float(value) for value in (*grains.radius[[i, j]], *grains.mass[[i, j]]))
        constants, overlap = constants_of(contact.pairing(materials[i], materials[j]), *numbers), table["overlap"][c]
        root = law.radius_root(overlap, constants)
        stiffness[:, c] = law.stiffness(overlap, root, constants), constants.slide_stiffness
        if contact.stiffness == "dt97":
            stiffness[1, c] *= root * root
    branch = simulation.box.nearest(grains.position[pair[:, 0]] - grains.position[pair[:, 1]])
    vectors = table["slide_vector"], table["roll_vector"]
    return ContactSprings(branch, grains.radius[pair], *vectors, table["normal_force"], *stiffness)


def start_of(simulation: Simulation) -> Start:
    """Grains, contacts and box of a simulation, as the start of another one."""
    table = simulation.contacts
    bonds = (np.array(table[name]) for name in ("slide_vector", "roll_vector", "twist"))
    pair = np.asarray(table["pair"], np.int64)
    return Start(simulation.grains.copy(), StrainedContacts(pair, *bonds), simulation.box, "")


def drag(grains: Grains, time: float) -> Gas:
    """A drag by which the velocity of the quickest grain to stop falls to 1/e in a time [s]."""
    unit = Gas(300.0, density=1.0, brownian=False, cross_section=1e-40)
    return Gas(300.0, density=unit.shortest_time(grains) / time, brownian=False, cross_section=1e-40)


def without_drag(simulation: Simulation) -> Simulation:
    """A copy that the drag slows no longer."""
    free = simulation.copy()
    with free.change() as change:
        change.forces = tuple(force for force in change.forces if not isinstance(force, Gas))
    return free


def _stretch(simulation: Simulation, axis: int, length: float, time: float) -> None:
    """Bring a side of the box to a length [m] in a time [s], by a constant velocity."""
    rates = np.zeros(3)
    rates[axis] = (length / float(simulation.box.lengths[axis] or 1.0) - 1.0) / time
    deformation = COMPONENTS["deformation"]
    for each, ends in ((deformation(tuple(rates), law="linear"), simulation.time + time), (deformation(0.0), None)):
        with simulation.change() as change:
            change.deformation = each
        if ends is not None:
            simulation.run(until=ends)


def _pressure(simulation: Simulation) -> np.ndarray:
    return np.diag(simulation.stress().total).copy()


def _change(now: np.ndarray, before: np.ndarray) -> float:
    return float(np.abs(now - before).max() / np.abs(now).max())


def density_of(simulation: Simulation) -> float:
    """Density ρ of a packing [kg/m³]: the mass of its grains over the volume of its box."""
    return float(simulation.grains.mass.sum()) / simulation.box.volume


def affine_of(simulation: Simulation, springs: ContactSprings) -> np.ndarray:
    """Affine moduli (3, 3) [Pa] of the contacts of a packing."""
    pressure = np.diag(simulation.stress().parts["contacts"])
    return affine_moduli(springs, pressure, simulation.box.volume)


def _at_limit(simulation: Simulation) -> int:
    shares = [simulation.contacts[name] for name in ("slide_share", "roll_share", "twist_share")]
    return int((np.max(shares, axis=0) > AT_LIMIT).sum())


def state_at_rest(simulation: Simulation, at_rest: bool, changed: float) -> dict[str, float]:
    """What describes the packing at rest."""
    stress, grains, contacts = simulation.stress(), simulation.grains, simulation.contacts
    kinetic = float(stress.parts["kinetic"].trace()) * stress.volume / 2.0
    residual = {f"residual_{axis}": float(stress.total[a, a]) for a, axis in enumerate("xyz")}
    return {
        "grains": len(grains),
        "filling": filling_factor(grains.radius, simulation.box.lengths),
        "density": density_of(simulation),
        "coordination": 2.0 * len(contacts["pair"]) / len(grains),
        "at_limit": _at_limit(simulation),
        "residual": stress.pressure,
        **residual,
        "at_rest": at_rest,
        "residual_change": changed,
        "kinetic": kinetic,
        "time": simulation.time,
        "steps": simulation.steps,
        "drift": simulation.ledger.drift,
    }
