"""Quantities of grains and contacts in a frame: one table for colours, histograms and the viewer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from ..basics.arguments import checked
from ..basics.errors import BadInput, did_you_mean, refuse_other
from ..basics.schema import MODES as SHARES
from ..basics.schema import REST
from ..basics.virial import virials_of_frame
from .clusters import aggregate_moments, cluster_labels, cluster_sizes
from .shape import coordination

MODES = ("within its limits", *SHARES)
"""Names of the values of `mode`: the contact mode that is at its limit."""
REST_NAMES = ("awake", "at rest")
"""Names of the values of `at_rest`."""
AT_LIMIT = 0.999
"""Fraction of the critical displacement from which a mode is at its limit; clamping keeps it at 1 but for rounding."""


class Quantity(NamedTuple):
    """One number per grain, or per contact.

    `of(frame, field)` computes them, NaN where undefined; `field` is the external flux density (3,) [T] or None.
    """

    name: str
    unit: str  # "1" for pure numbers
    meaning: str
    kind: str  # "sequential", "diverging" about zero, "categorical": whole numbers
    of: Callable[[Any, np.ndarray | None], np.ndarray]
    missing: str  # reason if all values are NaN


def cluster_rank(count: int, pairs: np.ndarray) -> np.ndarray:
    """Rank of the cluster of each grain (N,) by size, 0 for the largest; equal sizes by their lowest grain."""
    labels = cluster_labels(count, pairs)
    order = np.argsort(-cluster_sizes(labels), kind="stable")
    return np.argsort(order, kind="stable")[labels]


def category_names(name: str, frame: Any) -> tuple[str, ...]:
    """Names of the values 0, 1, … of a quantity of whole numbers: `material`, `at_rest` or `mode`."""
    return {"material": tuple(material_names(frame)), REST: REST_NAMES, "mode": MODES}[name]


def material_names(frame: Any) -> list[str]:
    """Names of the materials, in the order of the indices in `material`."""
    return [str(getattr(one, "name", one)) for one in frame.materials]


def _size(vectors: Any) -> np.ndarray:
    return np.linalg.norm(np.asarray(vectors, dtype=np.float64), axis=1)


def _kinetic(frame: Any, _: np.ndarray | None) -> np.ndarray:
    mass = np.asarray(frame.mass, dtype=np.float64)
    inertia = 0.4 * mass * np.asarray(frame.radius, dtype=np.float64) ** 2
    return np.asarray(0.5 * (mass * _size(frame.velocity) ** 2 + inertia * _size(frame.spin) ** 2))


def _cosine(vectors: np.ndarray, others: np.ndarray) -> np.ndarray:
    sizes = _size(vectors) * _size(others)
    with np.errstate(invalid="ignore", divide="ignore"):
        product = (np.asarray(vectors, float) * others).sum(axis=1) / sizes
    return np.where(sizes > 0.0, np.clip(product, -1.0, 1.0), np.nan)


def _cluster_size(frame: Any) -> np.ndarray:
    labels = cluster_labels(len(frame.radius), frame.pair)
    return cluster_sizes(labels)[labels]


def _alignment(frame: Any, _: np.ndarray | None) -> np.ndarray:
    labels = cluster_labels(len(frame.radius), frame.pair)
    sums, aligned = aggregate_moments(frame.moment, labels)
    known = (aligned > 1e-9) & (cluster_sizes(labels) > 1)  # a single grain is trivially aligned
    return _cosine(frame.moment, np.where(known[:, None], sums, 0.0)[labels])


def _field_alignment(frame: Any, field: np.ndarray | None) -> np.ndarray:
    direction = np.zeros(3) if field is None else np.asarray(field, dtype=np.float64)
    return _cosine(frame.moment, np.broadcast_to(direction, np.shape(frame.moment)))


def _load(frame: Any, _: np.ndarray | None) -> np.ndarray:
    i, j = np.asarray(frame.pair, dtype=np.int64).reshape(-1, 2).T
    normal = frame.box.nearest(frame.position[i] - frame.position[j])  # from the second to the first
    size = np.maximum(_size(normal), 1e-300)
    return np.asarray((np.asarray(frame.force, dtype=np.float64) * normal).sum(axis=1) / size)


def _pressure(frame: Any, _: np.ndarray | None) -> np.ndarray:
    if len(frame.pair) and np.isnan(frame.force).all():
        return np.full(len(frame.radius), np.nan)
    virial = getattr(frame, "virial", None)
    trace = np.trace(virials_of_frame(frame) if virial is None else virial, axis1=1, axis2=2)
    return np.asarray(trace / (4.0 * np.pi * np.asarray(frame.radius, dtype=np.float64) ** 3))


def _mode(frame: Any, _: np.ndarray | None) -> np.ndarray:
    share = np.abs(np.asarray(frame.share, dtype=np.float64)).reshape(-1, 4)
    share[:, 0] = np.asarray(frame.share, dtype=np.float64).reshape(-1, 4)[:, 0]  # compression has no limit
    worst = np.argmax(np.where(np.isnan(share), -np.inf, share), axis=1) + 1.0
    reached = np.max(share, axis=1, initial=-np.inf, where=~np.isnan(share)) >= AT_LIMIT
    return np.where(np.isnan(share).all(axis=1), np.nan, np.where(reached, worst, 0.0))


def _at_rest(frame: Any, _: np.ndarray | None) -> np.ndarray:
    found = getattr(frame, REST, None)
    return np.full(len(frame.radius), np.nan) if found is None else np.asarray(found, dtype=np.float64)


def _floats(of: Callable[[Any], Any]) -> Callable[[Any, np.ndarray | None], np.ndarray]:
    return lambda frame, _: np.asarray(of(frame), dtype=np.float64)


GRAINS = (
    Quantity("cluster", "1", "cluster", "categorical", _floats(lambda f: cluster_rank(len(f.radius), f.pair)), ""),
    Quantity("size", "1", "grains in its cluster", "sequential", _floats(_cluster_size), ""),
    Quantity("radius", "m", "radius", "sequential", _floats(lambda f: f.radius), ""),
    Quantity("coordination", "1", "contacts", "sequential", _floats(lambda f: coordination(len(f.radius), f.pair)), ""),
    Quantity("speed", "m/s", "speed", "sequential", _floats(lambda f: _size(f.velocity)), ""),
    Quantity("spin", "rad/s", "spin", "sequential", _floats(lambda f: _size(f.spin)), ""),
    Quantity("kinetic_energy", "J", "kinetic energy", "sequential", _kinetic, ""),
    Quantity(
        "pressure", "Pa", "pressure by contacts, mean in the grain", "diverging", _pressure, "the file holds no forces"
    ),
    Quantity(
        "alignment",
        "1",
        "cosine of moment to that of its cluster",
        "diverging",
        _alignment,
        "no grain in contact has a moment",
    ),
    Quantity(
        "field_alignment",
        "1",
        "cosine of moment to field",
        "diverging",
        _field_alignment,
        "no grain has a moment, or there is no external field",
    ),
    Quantity("material", "1", "material", "categorical", _floats(lambda f: f.material), ""),
    Quantity(REST, "1", "awake or at rest", "categorical", _at_rest, "only runs with rigid clusters have it"),
)
"""Quantities of grains (N,), besides own quantities of the user."""
CONTACTS = (
    Quantity("load", "N", "normal force, above 0 if pressed", "diverging", _load, "the file holds no forces"),
    Quantity("mode", "1", "mode at its limit", "categorical", _mode, "the file has no contact displacements"),
)
"""Quantities of contacts (C,)."""
GRAIN_NAMES = tuple(one.name for one in GRAINS)
CONTACT_NAMES = tuple(one.name for one in CONTACTS)
_QUANTITIES: Mapping[str, Quantity] = {one.name: one for one in (*GRAINS, *CONTACTS)}


def own_label(name: str) -> str:
    """An own quantity in legends: its name with spaces."""
    return name.replace("_", " ")


def names_of(frame: Any) -> tuple[str, ...]:
    """Quantities of the grains of a frame, own quantities of the user included."""
    return (*GRAIN_NAMES, *getattr(frame, "own", ()))


@checked
def quantity(name: str, allowed: tuple[str, ...] = GRAIN_NAMES, frame: Any = None) -> Quantity:
    """Look up a quantity by name, also an own quantity of `frame`. Raises BadInput if it is not one of `allowed`."""
    refuse_other(frame)
    own: Any = getattr(frame, "own", {})
    if name in own:
        return Quantity(name, own.units[name], own_label(name), "sequential", _floats(lambda f: f.own[name]), "")
    if name not in allowed:
        raise BadInput(f"there is no quantity '{name}'; {did_you_mean(name, (*allowed, *own))}")
    return _QUANTITIES[name]


@checked
def measured(frame: Any, name: str, field: np.ndarray | None = None) -> np.ndarray:
    """Values of a quantity in a frame (SI): (N,) for grains or (C,) for contacts, NaN where undefined.

    Parameters
    ----------
    frame : Frame
        Frame of a trajectory, or any object with its attributes.
    name : str
        Name in `GRAINS` or `CONTACTS`, or of an own quantity of the frame.
    field : ndarray or None, optional
        External flux density (3,) [T].

    Raises
    ------
    BadInput
        If there is no such quantity, or all its values are undefined.
    """
    refuse_other(frame, "radius", "pair")
    found = quantity(name, GRAIN_NAMES + CONTACT_NAMES, frame)
    values = found.of(frame, field)
    if values.size and np.isnan(values).all():
        raise BadInput(f"{name} is not known: {found.missing or 'no number is finite'}")
    return values
