"""Fractal dimension of single clusters of a frame, for the viewer page."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..analysis.clusters import unwrapped
from ..analysis.fractal import FEWEST, Dimension, correlation_dimension
from ..analysis.tracking import SINGLE
from ..basics.errors import BadInput
from ..io.run_folder import plain

MAX_CLUSTERS = 8
"""Number of clusters per frame, largest first, whose dimension is stored in a single-file page."""


def cluster_dimension(frame: Any, members: np.ndarray) -> Dimension:
    """Correlation dimension of one cluster.

    Parameters
    ----------
    frame : Frame
        Frame of a trajectory.
    members : ndarray
        (S,) indices of the grains of the cluster, ascending.

    Raises
    ------
    BadInput
        If the cluster has too few grains for a fit, or touches its own periodic image.
    """
    is_member = np.zeros(len(frame.position), dtype=bool)
    is_member[members] = True
    pairs = np.searchsorted(members, frame.pair[is_member[frame.pair[:, 0]]])
    return correlation_dimension(unwrapped(frame.position[members], pairs, frame.box, True))


def fit_dimension(frame: Any, names: np.ndarray, grain: int) -> dict[str, Any]:
    """Dimension of the cluster of a grain: `value` and `error`, or the `reason` why there is none.

    Parameters
    ----------
    frame : Frame
        Frame of a trajectory.
    names : ndarray
        (N,) name of the cluster of each grain.
    grain : int
        Index of the grain.
    """
    if names[grain] == SINGLE:
        return {"reason": f"grain {grain} has no contact"}
    try:
        fit = cluster_dimension(frame, np.flatnonzero(names == names[grain]))
    except BadInput as error:
        return {"reason": str(error)}
    return dict(plain({"value": fit.value, "error": fit.error}))


class Dimensions:
    """Dimensions of the largest clusters, frame by frame; unchanged clusters are not fitted again."""

    def __init__(self) -> None:
        self._previous: dict[int, tuple[bytes, dict[str, Any]]] = {}

    def of(self, frame: Any, names: np.ndarray) -> dict[str, list[float | None]]:
        """Dimension and its error by cluster name, for at most MAX_CLUSTERS clusters of at least 32 grains."""
        clusters, sizes = np.unique(names[names != SINGLE], return_counts=True)
        order = np.argsort(-sizes, kind="stable")[:MAX_CLUSTERS]
        fits: dict[int, tuple[bytes, dict[str, Any]]] = {}
        for name in clusters[order[sizes[order] >= FEWEST]].tolist():
            members = np.flatnonzero(names == name)
            key = members.astype(np.uint32).tobytes()
            previous = self._previous.get(name, (b"", {}))
            fits[name] = previous if previous[0] == key else (key, fit_dimension(frame, names, members[0]))
        self._previous = fits
        return {str(name): [fit["value"], fit["error"]] for name, (_, fit) in fits.items() if "value" in fit}
