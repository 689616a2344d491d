"""Initial contacts: of grains that overlap at the start, and of an earlier run."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..basics.box import Box
from ..basics.errors import BadInput, first_problems
from ..basics.grains import Grains
from ..basics.initial_pairs import StrainedContacts, most_overlap
from ..contact.events import InitialContacts, forming_loops
from ..contact.model import Contact
from .engine import Engine

NAMED = 10
"""Pairs named one by one in a message."""


class OverlappingPairs(NamedTuple):
    """Pairs of grains that overlap."""

    pair: np.ndarray  # (P, 2), the lower index first, sorted
    overlap: np.ndarray  # (P,) [m] > 0


NO_OVERLAPS = OverlappingPairs(np.zeros((0, 2), np.int64), np.zeros(0))


def overlapping_pairs(grains: Grains, box: Box) -> OverlappingPairs:
    """All pairs of grains that overlap."""
    pair, overlap = grains.touching(box)
    return OverlappingPairs(pair[overlap > 0.0], overlap[overlap > 0.0])


def with_contacts(pair: np.ndarray, contacts: StrainedContacts | None, count: int) -> np.ndarray:
    """Pairs of grains (P, 2) and those of contacts, unless these name others than `count` grains; sorted."""
    given = NO_OVERLAPS.pair if contacts is None else np.asarray(contacts.pair)
    if given.ndim != 2 or given.shape[1] != 2 or ((given < 0) | (given >= count)).any():
        return pair  # refused when they are added
    return np.unique(np.sort(np.concatenate([pair, given.astype(pair.dtype)]), axis=1), axis=0)


def add_contacts(engine: Engine, contact: Contact | None, contacts: StrainedContacts | None) -> np.ndarray:
    """Add contacts of an earlier run to the state.

    Returns
    -------
    ndarray
        Their pairs (C, 2), sorted.

    Raises
    ------
    BadInput
        If they do not fit the grains, the materials or the forces.
    """
    if contacts is None or not len(contacts.pair):
        return NO_OVERLAPS.pair
    count, pair = len(engine.state.grains), np.asarray(contacts.pair)
    if contact is None:
        raise BadInput(f"{len(pair)} contacts are given, but there is no sand.Contact() among the forces; add it")
    shapes = tuple(np.shape(part) for part in contacts)
    if shapes != ((len(pair), 2), (len(pair), 3), (len(pair), 3), (len(pair),)):
        raise BadInput(f"contacts have shapes {shapes}; they must be (C, 2), (C, 3), (C, 3), (C,)")
    if pair.min() < 0 or pair.max() >= count or (pair[:, 0] == pair[:, 1]).any():
        raise BadInput(f"contacts name grains that do not exist; each needs two different grains of 0 to {count - 1}")
    given = np.unique(np.sort(pair.astype(np.int64), axis=1), axis=0)
    if len(given) < len(pair) or not all(np.isfinite(part).all() for part in contacts):
        raise BadInput("contacts: a pair is given twice, or a displacement is not finite")
    state, law, settings = engine.state, engine.law, engine.parameters.settings
    if state.contacts.pair.shape[1] < len(pair):
        state.grow("contacts", len(pair))
    vectors = (np.ascontiguousarray(np.transpose(array), dtype=np.float64) for array in contacts[1:])
    initial = InitialContacts(np.ascontiguousarray(pair.T, dtype=np.uint32), *vectors)
    arrays = state.grains.arrays, state.contacts, state.count
    with engine.heavy_grains(state):
        wrong = forming_loops(law).add_initial(*arrays, state.box.span, settings, initial)
    if wrong >= 0:
        i, j = pair[wrong]
        raise BadInput(
            f"the contact of grains {i} and {j} is stretched beyond its breaking point for these materials and radii"
        )
    return given


def refuse_overlaps(
    grains: Grains, contact: Contact | None, found: OverlappingPairs, given: np.ndarray, when: str = "at the start"
) -> None:
    """Refuse pairs that overlap by too much at the start.

    Parameters
    ----------
    found : OverlappingPairs
        The pairs that overlap.
    given : ndarray
        Pairs of contacts from an earlier run, sorted, (C, 2); they may be in the middle of an impact.
    when : str, optional
        When they overlap, for the message.

    Raises
    ------
    BadInput
        If a pair overlaps by more than `basics.initial_pairs.most_overlap`; the first ten pairs are named.
    """
    if contact is None:
        return
    (i, j), radius = found.pair.T, grains.radius
    count = np.int64(len(grains))
    reduced = radius[i] * radius[j] / (radius[i] + radius[j])
    gamma, modulus = contact.pairings(grains.materials)[:2, grains.material[i], grains.material[j]]
    different, number = np.unique(np.stack([gamma, modulus, reduced]), axis=1, return_inverse=True)
    rest = np.array([contact.contact_law.normal_mode(*one).rest_overlap for one in different.T.tolist()])
    rest = rest[number.ravel()] if len(reduced) else np.zeros(0)
    limit = most_overlap(rest, np.minimum(radius[i], radius[j]))
    is_new = ~np.isin(i * count + j, given[:, 0] * count + given[:, 1])
    wrong = np.flatnonzero((found.overlap > limit) & is_new)
    problems = [
        f"grains {i[k]} and {j[k]} overlap by {found.overlap[k]:.3g} m {when}; "
        f"at most {limit[k]:.3g} m is allowed: move them apart"
        for k in wrong[:NAMED]
    ]
    if problems:
        raise BadInput(first_problems(problems, len(wrong), "overlapping pairs"))
