"""Growth of clusters in an ensemble of boxes (Dominik & Nübold 2002, Figure 1, Eqs. 15–25)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..analysis.body_motion import BodyMotion, BodyTemperatures, body_motion, body_temperatures
from ..analysis.clusters import cluster_labels
from ..analysis.fits import PowerLawFit, mean_interval, power_law
from ..analysis.fractal import Dimension, ensemble_dimension
from ..analysis.frame_statistics import COLUMNS, aggregate_statistics
from ..analysis.growth_law import LocalDegree, RateLaw, local_degrees, rate_law
from ..basics.errors import BadInput, naming
from ..basics.paths import user_path
from ..io import run_folder as files
from ..results import Run
from .dilute_case import is_dilute
from .growth_boxes import shared_settings

__all__ = ["BoxResult", "GrowthResult", "Temperatures", "boxes_in", "growth_of", "read_box"]

LOOKS = 10
"""Number of frames of each box in which aggregates are measured, evenly over the run, including the last."""
FIRST_SIZE = 2.0
"""Smallest S of the fit; below it most grains have not collided."""
LARGEST_PART = 0.1
"""Largest S of the fit as a fraction of all grains; beyond it few clusters are left in a box."""
LEAST = 3
"""Smallest number of grains of an aggregate in the fit of moments."""
KINDS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "all": lambda grains: grains > 0,
    "single": lambda grains: grains == 1,
    "clusters": lambda grains: grains > 1,
}
"""Kinds of bodies, by their numbers of grains."""


class BoxResult(NamedTuple):
    """Growth history and aggregates of one run of an ensemble."""

    folder: Path
    time: np.ndarray  # (K,) [s]
    size: np.ndarray  # (K,) S(t)
    grains: int
    radius: float  # mean of the grains [m]
    moment: float  # mean magnitude of the non-zero moments of the grains [A m²]; 0 if there are none
    aggregates: dict[str, np.ndarray]  # columns of `aggregate_statistics` of all frames read, and `time` [s]
    case: dict[str, Any]  # settings that boxes of an ensemble share
    bodies: tuple[tuple[float, BodyMotion], ...] = ()  # time [s] and motion of all bodies of all frames read
    last_sizes: np.ndarray = np.zeros(0, np.int64)  # grains of each cluster of the last frame, copies too


def read_box(folder: str | Path, looks: int = LOOKS, least: int = 2) -> BoxResult:
    """Read S(t) and the aggregates of one run.

    Parameters
    ----------
    folder : str or Path
        Folder of the run.
    looks : int, optional
        Number of frames, evenly over the run, in which aggregates are measured.
    least : int, optional
        Smallest number of grains of an aggregate.

    Raises
    ------
    BadInput
        If there is no readable run.
    """
    run = Run(folder)
    frames, ledger = run.frames, run.ledger
    if not len(frames) or "mean_cluster_size" not in ledger:
        raise BadInput(f"{folder} contains a run without frames or ledger")
    numbers = np.unique(np.linspace(0, len(frames) - 1, looks + 1).round().astype(int)[1:])
    found: list[dict[str, np.ndarray]] = []
    bodies = []
    for number in numbers:
        frame = frames[int(number)]
        rows = aggregate_statistics(frame, least)
        if not is_dilute(run.case):  # whose frames show bodies at rest
            bodies.append((frame.time, body_motion(frame, frame.pair, frame.box)))
        found.append(rows | {"time": np.full(len(rows["grains"]), frame.time)})
    first = frames[0]
    frames.close()
    with naming(folder):
        shared = shared_settings(run.case)
    moments = np.linalg.norm(first.moment, axis=1)
    return BoxResult(
        user_path(folder),
        ledger["time"],
        ledger["mean_cluster_size"],
        len(first),
        float(first.radius.mean()),
        float(moments[moments > 0.0].mean()) if moments.any() else 0.0,
        {name: np.concatenate([rows[name] for rows in found]) for name in (*COLUMNS, "time")},
        shared,
        tuple(bodies),
        np.bincount(cluster_labels(len(frame.position), frame.pair)),
    )


def boxes_in(folder: str | Path) -> list[Path]:
    """Folders of the run in a folder, or of the runs in its subfolders, in numerical order.

    Raises
    ------
    BadInput
        If there is none.
    """
    place = user_path(folder)
    if (place / files.TRAJECTORY).exists():
        return [place]
    found = [one.parent for one in place.glob(f"*/{files.TRAJECTORY}")]
    if not found:
        raise BadInput(f"{folder} and its subfolders contain no run")
    return sorted(found, key=lambda one: (len(one.name), one.name))


class Temperatures(NamedTuple):
    """Temperatures [K] of the bodies of an ensemble: of all of them, and of some.

    Single grains and clusters apart. `value` is the mean over boxes of the temperatures of the bodies of a box, those
    of all frames read; `error` the standard error of this mean, NaN for a single box. NaN if no box has such a body.
    """

    value: BodyTemperatures
    error: BodyTemperatures
    bodies: float  # mean number of such bodies in a frame


class GrowthResult(NamedTuple):
    """Growth laws of an ensemble; a law that cannot be fitted is None, with the reason in `missing`."""

    time: np.ndarray  # (K,) [s], common to all boxes
    sizes: np.ndarray  # S(t), (boxes, K)
    window: tuple[float, float]  # range of S of the fit of z
    z: RateLaw | None  # degree λ of the kernel, z = 1/(1 − λ)
    local_degrees: list[LocalDegree] | None  # λ(S) = d ln(dS/dt)/d ln S
    slope: PowerLawFit | None  # fit S ∝ t^slope
    moment: PowerLawFit | None  # μ/μ1 = N^γ
    moment_without_rings: PowerLawFit | None  # fit of μ for aggregates without rings
    dimension: Dimension | None  # N = k (r_g/a)^D
    missing: dict[str, str]
    temperatures: dict[str, Temperatures]  # of "all" bodies, "single" grains and "clusters"; empty if unknown

    @property
    def mean(self) -> np.ndarray:
        """Mean of S(t) over boxes."""
        return self.sizes.mean(axis=0)

    @property
    def error(self) -> np.ndarray:
        """Standard error of the mean; NaN for a single box."""
        if len(self.sizes) < 2:
            return np.full(self.sizes.shape[1], np.nan)
        return self.sizes.std(axis=0, ddof=1) / np.sqrt(len(self.sizes))

    @property
    def fitted(self) -> np.ndarray:
        """Whether a time belongs to the fits of z and λ(S), (K,)."""
        return _in_window(self.time, self.sizes, self.window)

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the mean of S at the last time (`analysis.fits.mean_interval`)."""
        return mean_interval(self.sizes[:, -1])


def growth_of(boxes: Sequence[BoxResult], window: tuple[float, float] | None = None) -> GrowthResult:
    """Fit growth exponent, local degree, moment exponent and fractal dimension of an ensemble.

    Parameters
    ----------
    boxes : sequence of BoxResult
        Boxes with equal settings except for the seed.
    window : tuple of float or None, optional
        Range of S, mean over boxes, for the fits of z and of the local degree. By default 2 and 0.1 N, beyond which
        few clusters are left in a box of N grains.

    Returns
    -------
    GrowthResult
        Fitted laws.

    Raises
    ------
    BadInput
        If there are no boxes, or their settings differ.
    """
    if not boxes:
        raise BadInput("an ensemble needs at least one box")
    for box in boxes[1:]:
        for name in {**boxes[0].case, **box.case}:
            if boxes[0].case.get(name) != box.case.get(name):
                raise BadInput(f"{box.folder} and {boxes[0].folder} have different [{name}]; move one elsewhere")
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

    rows = all_aggregates(boxes)
    of_box = np.repeat(np.arange(len(boxes)), [len(box.aggregates["grains"]) for box in boxes])

    def moment_law(which: np.ndarray) -> PowerLawFit:
        if boxes[0].moment == 0.0:
            raise BadInput("the grains have no moments")
        return power_law(rows["grains"][which], rows["moment"][which] / boxes[0].moment, of_box[which])

    def dimension() -> Dimension:
        sized = ~np.isnan(rows["gyration_radius"])  # percolating ones have none
        return ensemble_dimension(rows["grains"][sized], rows["gyration_radius"][sized], boxes[0].radius, of_box[sized])

    # moments that vanish within rounding have no logarithm
    heavy = (rows["grains"] >= LEAST) & (rows["moment"] > 1e-9 * boxes[0].moment)
    return GrowthResult(
        time,
        sizes,
        chosen,
        law("z", lambda: rate_law(*_within(time, sizes, chosen), boxes[0].grains)),
        law("local_degrees", lambda: local_degrees(*_within(time, sizes, chosen), boxes[0].grains)),
        law("slope", lambda: _slope(*_within(time, sizes, chosen))),
        law("moment", lambda: moment_law(heavy)),
        law("moment_without_rings", lambda: moment_law(heavy & (rows["rings"] == 0))),
        law("dimension", dimension),
        missing,
        _temperatures(boxes),
    )


def _temperatures(boxes: Sequence[BoxResult]) -> dict[str, Temperatures]:
    """Temperatures of the bodies by kind, see `Temperatures`."""
    if not all(box.bodies for box in boxes):
        return {}
    motions = [joined([motion for _, motion in box.bodies]) for box in boxes]
    found = {}
    for kind, chosen in KINDS.items():
        of_boxes = np.array([body_temperatures(one, chosen(one.grains)) for one in motions])
        known = of_boxes[~np.isnan(of_boxes).any(axis=1)]
        none = np.full(3, np.nan)
        value = known.mean(axis=0) if len(known) else none
        error = known.std(axis=0, ddof=1) / np.sqrt(len(known)) if len(known) > 1 else none
        number = sum(int(chosen(one.grains).sum()) for one in motions) / sum(len(box.bodies) for box in boxes)
        found[kind] = Temperatures(BodyTemperatures(*value.tolist()), BodyTemperatures(*error.tolist()), number)
    return found


def joined(motions: Sequence[BodyMotion]) -> BodyMotion:
    """The bodies of several frames or boxes together."""
    return BodyMotion(*map(np.concatenate, zip(*motions, strict=True)))


def _within(time: np.ndarray, sizes: np.ndarray, window: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Times at which the mean over boxes is in the window, and S (boxes, K) at these."""
    used = _in_window(time, sizes, window)
    if used.sum() < 3:
        raise BadInput(
            f"fewer than three times have S between {window[0]:g} and {window[1]:g}; "
            f"the mean of S goes from {sizes.mean(axis=0)[0]:.3g} to {sizes.mean(axis=0)[-1]:.3g}"
        )
    return time[used], sizes[:, used]


def _in_window(time: np.ndarray, sizes: np.ndarray, window: tuple[float, float]) -> np.ndarray:
    """Whether the mean of S over boxes is in the window, until it first leaves it."""
    mean = sizes.mean(axis=0)
    return (mean >= window[0]) & (np.maximum.accumulate(mean) <= window[1]) & (time > 0.0)


def _slope(time: np.ndarray, sizes: np.ndarray) -> PowerLawFit:
    return power_law(np.tile(time, len(sizes)), sizes.ravel(), np.repeat(np.arange(len(sizes)), len(time)))


def all_aggregates(boxes: Sequence[BoxResult]) -> dict[str, np.ndarray]:
    """Columns of `BoxResult.aggregates` with the rows of all boxes."""
    return {name: np.concatenate([box.aggregates[name] for box in boxes]) for name in boxes[0].aggregates}
