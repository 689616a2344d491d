"""How aggregates grow: what the boxes of an ensemble have in common (Figure 1, Eqs. 15–25)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..analysis.fits import PowerLawFit, RateLaw, power_law, rate_law
from ..analysis.fractal import Dimension, ensemble_dimension
from ..analysis.frame_statistics import COLUMNS, aggregate_statistics
from ..errors import BadInput
from ..io import run_folder as files
from ..results import Run
from .growth_boxes import grow, run_box, shared_settings

__all__ = ["BoxResult", "GrowthResult", "shared_settings", "boxes_in", "grow", "growth_of", "run_box", "read_box"]

LOOKS = 10
"""Frames of each box at which its aggregates are measured, evenly over the run, the last among them."""
FIRST_SIZE = 2.0
"""S from which growth is fitted; before, most grains have met nobody."""
LARGEST_PART = 0.15
"""Part of all grains up to which S is fitted: beyond, a box runs out of partners."""
LEAST = 3
"""Grains of an aggregate from which its moment counts."""


class BoxResult(NamedTuple):
    """One run of an ensemble."""

    folder: Path
    time: np.ndarray  # (K,) [s]
    size: np.ndarray  # (K,) S(t)
    grains: int
    radius: float  # mean of the grains [m]
    moment: float  # mean size of theirs [A m²]
    aggregates: dict[str, np.ndarray]  # census of all looks, and `time` [s] of each row
    case: dict[str, Any]  # as understood, without [run]


def read_box(folder: str | Path, looks: int = LOOKS, least: int = 2) -> BoxResult:
    """S(t) and the aggregates of one run.

    Raises
    ------
    BadInput
        there is no run, or one that cannot be read.
    """
    run = Run(folder)
    frames, ledger = run.frames, run.ledger
    if not len(frames) or "mean_cluster_size" not in ledger:
        raise BadInput(f"{folder} holds a run without frames or ledger")
    numbers = np.unique(np.linspace(0, len(frames) - 1, looks + 1).round().astype(int)[1:])
    found: list[dict[str, np.ndarray]] = []
    for number in numbers:
        frame = frames[int(number)]
        rows = aggregate_statistics(frame, least)
        found.append(rows | {"time": np.full(len(rows["grains"]), frame.time)})
    first = frames[0]
    frames.close()
    return BoxResult(
        Path(folder),
        ledger["time"],
        ledger["mean_cluster_size"],
        len(first),
        float(first.radius.mean()),
        _usual(np.linalg.norm(first.moment, axis=1)),
        {name: np.concatenate([rows[name] for rows in found]) for name in (*COLUMNS, "time")},
        shared_settings(run.case),
    )


def _usual(moments: np.ndarray) -> float:
    """Mean size of the moments of the grains that have one; 0 if none has."""
    return float(moments[moments > 0.0].mean()) if (moments > 0.0).any() else 0.0


def boxes_in(folder: str | Path) -> list[Path]:
    """The run in a folder, or the runs in its folders, in the order of their numbers.

    Raises
    ------
    BadInput
        there is none.
    """
    place = Path(folder)
    if (place / files.TRAJECTORY).exists():
        return [place]
    found = [one.parent for one in place.glob(f"*/{files.TRAJECTORY}")]
    if not found:
        raise BadInput(f"{folder} holds no run, and none of its folders does")
    return sorted(found, key=lambda one: (len(one.name), one.name))


class GrowthResult(NamedTuple):
    """What an ensemble says; a law that it cannot tell is None, with the reason in `missing`."""

    time: np.ndarray  # (K,) [s], common to all boxes
    sizes: np.ndarray  # (boxes, K): S(t)
    window: tuple[float, float]  # of S, for z
    z: RateLaw | None  # dS/dt ∝ S^λ, S = (1 + t/zτ)^z
    slope: PowerLawFit | None  # the straight line S ∝ t^slope
    moment: PowerLawFit | None  # μ/μ1 = N^γ
    moment_without_rings: PowerLawFit | None  # the same, of aggregates without rings
    dimension: Dimension | None  # N = k (r_g/a)^D
    missing: dict[str, str]

    @property
    def mean(self) -> np.ndarray:
        """S(t), mean over boxes."""
        return self.sizes.mean(axis=0)

    @property
    def error(self) -> np.ndarray:
        """Its standard error; not a number for one box."""
        if len(self.sizes) < 2:
            return np.full(self.sizes.shape[1], np.nan)
        return self.sizes.std(axis=0, ddof=1) / np.sqrt(len(self.sizes))


def growth_of(boxes: Sequence[BoxResult], window: tuple[float, float] | None = None) -> GrowthResult:
    """S(t), z, the exponent of moments and the fractal dimension of an ensemble.

    Parameters
    ----------
    boxes : Sequence[BoxResult]
        shared_settings but for their seeds.
    window : tuple[float, float] or None, optional
        values of S for z: from where the mean over boxes is at the first until any box is at the second; by
        default 2 and 0.15 N, where a box runs out of partners.

    Raises
    ------
    BadInput
        no box, or boxes that are not shared_settings.
    """
    if not boxes:
        raise BadInput("an ensemble needs at least one box")
    for box in boxes[1:]:
        for name in {**boxes[0].case, **box.case}:
            if boxes[0].case.get(name) != box.case.get(name):
                raise BadInput(f"{box.folder} is not like {boxes[0].folder}: [{name}] differs; put it elsewhere")
    last = min(box.time[-1] for box in boxes)
    time = np.append(boxes[0].time[boxes[0].time < last], last)
    sizes = np.array([np.interp(time, box.time, box.size) for box in boxes])
    chosen = window or (FIRST_SIZE, max(LARGEST_PART * boxes[0].grains, FIRST_SIZE))
    missing: dict[str, str] = {}

    def law(name: str, fit: Callable[[], Any]) -> Any:
        try:
            return fit()
        except BadInput as error:
            missing[name] = str(error)
            return None

    of_box, rows = _all_aggregates(boxes)

    def moment_law(which: np.ndarray) -> PowerLawFit:
        if boxes[0].moment == 0.0:
            raise BadInput("the grains have no moments")
        return power_law(rows["grains"][which], rows["moment"][which] / boxes[0].moment, of_box[which])

    # moments that cancel to rounding, or of grains without any, have no logarithm
    heavy = (rows["grains"] >= LEAST) & (rows["moment"] > 1e-9 * boxes[0].moment)
    return GrowthResult(
        time,
        sizes,
        chosen,
        law("z", lambda: rate_law(*_within(time, sizes, chosen))),
        law("slope", lambda: _slope(*_within(time, sizes, chosen))),
        law("moment", lambda: moment_law(heavy)),
        law("moment_without_rings", lambda: moment_law(heavy & (rows["rings"] == 0))),
        law("dimension", lambda: ensemble_dimension(rows["grains"], rows["gyration_radius"], boxes[0].radius, of_box)),
        missing,
    )


def _within(time: np.ndarray, sizes: np.ndarray, window: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Times from which the mean over boxes is in the window until any box leaves it, and S (boxes, K) then."""
    used = (sizes.mean(axis=0) >= window[0]) & (sizes.max(axis=0) <= window[1]) & (time > 0.0)
    if used.sum() < 3:
        raise BadInput(
            f"the boxes are not between S = {window[0]:g} and {window[1]:g} at three times or more; "
            f"their mean goes from {sizes.mean(axis=0)[0]:.3g} to {sizes.mean(axis=0)[-1]:.3g}"
        )
    return time[used], sizes[:, used]


def _slope(time: np.ndarray, sizes: np.ndarray) -> PowerLawFit:
    return power_law(np.tile(time, len(sizes)), sizes.ravel(), np.repeat(np.arange(len(sizes)), len(time)))


def _all_aggregates(boxes: Sequence[BoxResult]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """BoxResult number of each row, and the rows of all boxes."""
    of_box = np.concatenate([np.full(len(box.aggregates["grains"]), k) for k, box in enumerate(boxes)])
    return of_box, {name: np.concatenate([box.aggregates[name] for box in boxes]) for name in boxes[0].aggregates}
