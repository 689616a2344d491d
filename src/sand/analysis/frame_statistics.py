"""Statistics of all aggregates of one frame."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..basics.arguments import checked
from ..basics.errors import refuse_other
from .clusters import aggregate_moments, checked_labels, cluster_labels, percolating_clusters, unwrapped
from .network import network
from .shape import elongation, filling_factor, gyration_radius

COLUMNS = {
    "grains": ("1", "number of grains N"),
    "mass": ("kg", "mass"),
    "gyration_radius": ("m", "radius of gyration, centres only"),
    "elongation": ("1", "longest over shortest principal length, extent of grains included"),
    "filling_factor": (
        "1",
        "volume of grains over that of the sphere of radius (5/3)^(1/2) r_g, r_g with the extent of grains",
    ),
    "moment": ("A m^2", "magnitude of the total moment"),
    "alignment": ("1", "magnitude of the total moment over the sum of the magnitudes"),
    "coordination": ("1", "mean number of contacts of a grain"),
    "ends": ("1", "grains with one contact"),
    "junctions": ("1", "grains with three or more contacts"),
    "rings": ("1", "independent closed loops"),
    "longest": ("1", "grains on the longest path along contacts"),
    "percolating": ("1", "1 if it touches its own periodic image, and so has no size and shape (NaN), else 0"),
}
"""Unit and meaning of every column of `aggregate_statistics`."""


@checked
def aggregate_statistics(frame: Any, least: int = 2) -> dict[str, np.ndarray]:
    """Size, shape, moment and contact network of each aggregate of a frame, largest first.

    Parameters
    ----------
    frame : Frame
        Frame of a trajectory, or any object with position, radius, mass, moment, pair (C, 2) and box.
    least : int, optional
        Smallest number of grains of an aggregate.

    Returns
    -------
    dict of str to ndarray
        Columns (K,) as in `COLUMNS`. Of a percolating aggregate, which touches its own periodic image, radius of
        gyration, elongation and filling factor are NaN.
    """
    refuse_other(frame, "position", "pair", "moment", "box")
    labels = cluster_labels(len(frame.position), frame.pair)
    sizes = np.bincount(labels)
    whole = unwrapped(frame.position, frame.pair, frame.box)
    percolates = percolating_clusters(frame.position, frame.pair, frame.box)
    moments, aligned = aggregate_moments(frame.moment, labels)
    order = np.argsort(-sizes, kind="stable")
    members = np.split(np.argsort(labels, kind="stable"), np.cumsum(sizes)[:-1])
    label_of_pair = labels[frame.pair[:, 0]] if len(frame.pair) else np.zeros(0, int)
    rows = []
    for k in order[sizes[order] >= least]:
        grains = members[k]
        pairs = np.searchsorted(grains, frame.pair[label_of_pair == k])
        position, mass, radius = whole[grains], np.asarray(frame.mass, float)[grains], frame.radius[grains]
        values = network(len(grains), pairs)._asdict() | {
            "grains": len(grains),
            "mass": mass.sum(),
            "gyration_radius": np.nan if percolates[k] else gyration_radius(position, mass),
            "elongation": np.nan if percolates[k] else elongation(position, mass, radius),
            "filling_factor": np.nan if percolates[k] else filling_factor(position, radius),
            "percolating": percolates[k],
            "moment": np.linalg.norm(moments[k]),
            "alignment": aligned[k],
        }
        rows.append([values[name] for name in COLUMNS])
    table = np.array(rows, dtype=float).reshape(-1, len(COLUMNS))
    return {name: table[:, c] for c, name in enumerate(COLUMNS)}


@checked
def size_distribution(labels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sizes s (K,) that occur, and the number n_s (K,) of clusters of each size.

    Parameters
    ----------
    labels : ndarray
        Cluster of each grain (N,).
    """
    sizes, numbers = np.unique(np.bincount(checked_labels(labels)), return_counts=True)
    return sizes, numbers


def mass_spectrum(sizes: np.ndarray, per_decade: float = 5.0) -> tuple[np.ndarray, ...]:
    r"""s² n_s over the size s, averaged over classes of sizes of equal logarithmic width, per grain.

    n_s is the number of clusters of s grains over the number of all grains, so that the sum over s of s n_s is 1, and
    s² n_s is the share of the grains in clusters of a range d ln s of sizes, over that range. The value of a class from
    a up to, and without, b is the mean over all its whole numbers, those without a cluster included:

    .. math:: \langle s^2 n_s \rangle = \frac{1}{b-a} \sum_{s=a}^{b-1} s^2 n_s

    Parameters
    ----------
    sizes : ndarray
        (K,) grains of each cluster, single grains included; those of several boxes together.
    per_decade : float, optional
        Number of classes per factor of 10 of s; small sizes have a class each.

    Returns
    -------
    tuple of ndarray
        Geometric mean of the ends a and b − 1 of each class with a cluster, the mean of s² n_s, and its relative
        standard error 1/√clusters, as for independent clusters.
    """
    grains = np.asarray(sizes, np.int64)
    steps = np.arange(int(per_decade * np.log10(max(int(grains.max(initial=1)), 1))) + 2) / per_decade
    ends = np.unique(np.append(np.ceil(10.0**steps - 1e-9).astype(np.int64), grains.max(initial=1) + 1))
    ends = ends[ends <= grains.max(initial=1) + 1]
    number = np.searchsorted(ends, grains, "right") - 1
    count = np.bincount(number, minlength=len(ends) - 1)
    total = np.bincount(number, grains.astype(float) ** 2, len(ends) - 1) / max(int(grains.sum()), 1)
    found = count > 0
    low, high = ends[:-1][found], ends[1:][found]
    return np.sqrt(low * (high - 1.0)), total[found] / (high - low), 1.0 / np.sqrt(count[found])
