"""A population as arrays, for checkpoints and frames."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..basics.grains import GrainArrays, Grains
from ..basics.initial_pairs import StrainedContacts
from .dilute_body import Body, Motion, body_at_rest
from .dilute_encounters import Encounters
from .dilute_majorant import Majorant
from .dilute_population import Population

STORED = ("radius", "mass", "inertia", "charge", "position", "moment", "own", "material", "id", "image")
"""Quantities of grains that a body has; all others are those of a body at rest."""
BODY = "body_number"
"""Own quantity of the grains of frames: the number of their body, equal for copies."""
SPACING = 1.5
"""Distance of aggregates in a frame, in diameters of the largest one."""
SINGLE_NUMBERS = ("time", "event", "flights", "hits_seen", "bound", "others", "recent_others", "numbers")
"""What `Encounters` counts."""


def joined(bodies: Sequence[Body]) -> tuple[GrainArrays, StrainedContacts]:
    """Grains and contacts of all bodies, each in its principal frame."""
    starts = np.cumsum([0, *(len(body) for body in bodies)])
    grains = GrainArrays(*(np.concatenate(parts, axis=-1) for parts in zip(*(b.grains for b in bodies), strict=True)))
    contacts = StrainedContacts(*map(np.concatenate, zip(*(b.contacts for b in bodies), strict=True)))
    shift = np.repeat(starts[:-1], [len(body.contacts.pair) for body in bodies])
    return grains, contacts._replace(pair=contacts.pair + shift[:, None])


def arrays_of(now: Encounters) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Arrays and numbers that a population continues from."""
    population = now.population
    bodies = population.bodies
    grains, contacts = joined(bodies)
    arrays = {f"grains/{name}": getattr(grains, name) for name in STORED}
    arrays |= {f"contacts/{name}": array for name, array in contacts._asdict().items()}
    arrays |= {
        "bodies/grains": np.array([len(body) for body in bodies]),
        "bodies/contacts": np.array([len(body.contacts.pair) for body in bodies]),
        "bodies/inertia": np.array([body.flying.inertia for body in bodies]),
        "bodies/identity": np.array([(body.number, body.born, body.copy) for body in bodies]),
        "bodies/sums": population.sums.copy(),
    }
    motions = [body.motion for body in bodies if body.motion is not None]
    arrays |= {f"motion/{name}": np.array([getattr(each, name) for each in motions]) for name in Motion._fields}
    numbers = {name: getattr(now, name) for name in SINGLE_NUMBERS}
    more = {"volume": population.volume, "start": population.start, "doublings": population.doublings}
    return arrays, numbers | more


def holds_all(arrays: dict[str, np.ndarray], meta: dict[str, Any]) -> bool:
    """Whether a checkpoint has all that a population continues from; those of earlier versions lack some of it."""
    names = [*(f"grains/{name}" for name in STORED), *(f"motion/{name}" for name in Motion._fields), "bodies/sums"]
    return all(name in arrays for name in names) and all(name in meta for name in SINGLE_NUMBERS)


def population_from(arrays: dict[str, np.ndarray], meta: dict[str, Any], majorant: Majorant) -> Population:
    """The population of `arrays_of`, with the same bits."""
    rest = {
        name: np.zeros((4 if name == "orientation" else 3, arrays["grains/mass"].size)) for name in GrainArrays._fields
    }
    grains = GrainArrays(**rest | {name: arrays[f"grains/{name}"] for name in STORED})
    contacts = StrainedContacts(*(arrays[f"contacts/{name}"] for name in StrainedContacts._fields))
    ends, joints = np.cumsum(arrays["bodies/grains"]), np.cumsum(arrays["bodies/contacts"])
    motions = [arrays[f"motion/{name}"] for name in Motion._fields]
    bodies = []
    for k, (count, links) in enumerate(zip(arrays["bodies/grains"], arrays["bodies/contacts"], strict=True)):
        own, part = slice(ends[k] - count, ends[k]), slice(joints[k] - links, joints[k])
        mine = StrainedContacts(*(np.ascontiguousarray(array[part]) for array in contacts))
        members = GrainArrays(*(np.ascontiguousarray(array[..., own]) for array in grains))
        identity = tuple(int(each) for each in arrays["bodies/identity"][k])
        moved = mine._replace(pair=mine.pair - int(ends[k] - count))
        body = body_at_rest(members, moved, arrays["bodies/inertia"][k], identity)  # type: ignore[arg-type]
        if len(motions[0]):
            body = dataclasses.replace(body, motion=Motion(*(array[k] for array in motions)))
        bodies.append(body)
    found = Population(bodies, meta["volume"], majorant, arrays["bodies/sums"], meta["start"])
    found.doublings = meta["doublings"]
    return found


def set_apart(bodies: Sequence[Body], kind: Grains) -> tuple[Grains, StrainedContacts]:
    """All bodies on a cubic lattice, apart from each other, the largest first; grains like those of `kind`.

    They have the number of their body as an own quantity, `BODY`.
    """
    order = sorted(range(len(bodies)), key=lambda k: (-len(bodies[k]), bodies[k].number, bodies[k].copy))
    ordered = [bodies[k] for k in order]
    grains, contacts = joined(ordered)
    side, spacing = int(np.ceil(len(bodies) ** (1.0 / 3.0))), 2.0 * SPACING * max(body.extent for body in bodies)
    place = np.array(np.unravel_index(np.arange(len(bodies)), (side,) * 3)) - 0.5 * (side - 1)
    counts = [len(body) for body in ordered]
    at = np.repeat(spacing * place, counts, axis=1)
    number = np.arange(grains.mass.size, dtype=np.uint32)
    whole = kind.with_arrays(grains._replace(position=grains.position + at, id=number))
    return whole.with_own({BODY: np.repeat([float(body.number) for body in ordered], counts)}), contacts
