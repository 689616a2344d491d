"""Fractal dimension of single clusters of a frame, for the page of a run."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..analysis.clusters import unwrapped
from ..analysis.fractal import FEWEST, Dimension, correlation_dimension
from ..analysis.tracking import SINGLE
from ..errors import BadInput
from ..io.run_folder import plain

LARGEST = 8
"""Clusters of a frame that a page without a source knows the dimension of, the largest."""


def cluster_dimension(frame: Any, who: np.ndarray) -> Dimension:
    """Of the cluster of the grains `who` (S,), in ascending order.  Raises BadInput for too few of them."""
    chosen = np.zeros(len(frame.position), dtype=bool)
    chosen[who] = True
    held = np.searchsorted(who, frame.pair[chosen[frame.pair[:, 0]]])
    return correlation_dimension(unwrapped(frame.position[who], held, frame.box))


def answer(frame: Any, names: np.ndarray, grain: int) -> dict[str, Any]:
    """`value` and `error` of the cluster of a grain, or the `reason` why there are none."""
    if names[grain] == SINGLE:
        return {"reason": f"grain {grain} touches none"}
    try:
        found = cluster_dimension(frame, np.flatnonzero(names == names[grain]))
    except BadInput as error:
        return {"reason": str(error)}
    return dict(plain({"value": found.value, "error": found.error}))


class Dimensions:
    """Dimensions of the largest clusters, frame after frame; a cluster of the same grains is not measured again."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[bytes, list[float | None] | None]] = {}

    def of(self, frame: Any, names: np.ndarray) -> dict[str, list[float | None]]:
        """D and its error by name, of at most LARGEST clusters of at least 32 grains."""
        found, sizes = np.unique(names[names != SINGLE], return_counts=True)
        order = np.argsort(-sizes, kind="stable")[:LARGEST]
        now: dict[int, tuple[bytes, list[float | None] | None]] = {}
        for name in found[order[sizes[order] >= FEWEST]].tolist():
            who = np.flatnonzero(names == name)
            key = who.astype(np.uint32).tobytes()
            known = self._known.get(name)
            now[name] = known if known is not None and known[0] == key else (key, _measured(frame, who))
        self._known = now
        return {str(name): pair for name, (_, pair) in now.items() if pair is not None}


def _measured(frame: Any, who: np.ndarray) -> list[float | None] | None:
    try:
        found = cluster_dimension(frame, who)
    except BadInput:
        return None
    return list(plain([found.value, found.error]))
