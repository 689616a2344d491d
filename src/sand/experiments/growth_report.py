"""Report of `sand analyse`: numbers, tables and a figure of one or more ensembles."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..analysis.body_motion import body_temperatures
from ..analysis.fits import separation
from ..basics.errors import naming
from ..basics.paths import user_path
from ..io.run_folder import make_folder, write_json
from ..io.table import write_table
from .dilute_law import PopulationKernel, kernel_of_populations
from .growth import BoxResult, GrowthResult, Temperatures, all_aggregates, boxes_in, growth_of, joined, read_box

NAMES = ("analysis.json", "growth.csv", "degrees.csv", "aggregates.csv", "growth.png")
"""Files of an analysis."""
KERNEL_CSV = "kernel.csv"
"""One more file, if populations of dilute dust are among the runs."""
SAME_TIME = 1e-9
"""Relative difference of the times of frames up to which they are of one time."""


class Ensemble(NamedTuple):
    """Boxes with equal settings except for the seed, and their growth laws."""

    name: str
    growth: GrowthResult
    boxes: list[BoxResult]
    kernel: PopulationKernel | None = None  # of populations of dilute dust


def read_ensemble(folder: str | Path, window: tuple[float, float] | None = None) -> Ensemble:
    """Read the runs in a folder as one ensemble.

    Parameters
    ----------
    folder : str or Path
        Folder of a run, or of several.
    window : tuple of float or None, optional
        Range of S for the fit of z.

    Raises
    ------
    BadInput
        If there is no run, or the settings of the runs differ.
    """
    boxes = [read_box(one) for one in boxes_in(folder)]
    with naming(folder):
        kernel = kernel_of_populations([box.folder for box in boxes])
        return Ensemble(user_path(folder).absolute().name, growth_of(boxes, window), boxes, kernel)


def ensemble_summary(one: Ensemble) -> dict[str, Any]:
    """Entry of one ensemble in analysis.json; laws with value, error and interval, None where unknown."""
    growth = one.growth
    laws = {name: getattr(growth, name) for name in ("z", "slope", "moment", "moment_without_rings", "dimension")}
    return {
        "name": one.name,
        "boxes": len(one.boxes),
        "grains": one.boxes[0].grains,
        "time": float(growth.time[-1]),
        "mean_size": float(growth.mean[-1]),
        "mean_size_error": float(growth.error[-1]),
        "mean_size_interval": [None if np.isnan(end) else end for end in growth.interval],
        "window": list(growth.window),
        **{name: None if law is None else law._asdict() for name, law in laws.items()},
        "local_degrees": None if growth.local_degrees is None else [one._asdict() for one in growth.local_degrees],
        "missing": growth.missing,
        "temperatures": {kind: _described(found) for kind, found in growth.temperatures.items()},
        **({} if one.kernel is None else {"kernel": one.kernel.to_dict()}),
    }


def _described(found: Temperatures) -> dict[str, Any]:
    """Temperatures of one kind of bodies as an entry of analysis.json; None where unknown."""
    entry: dict[str, Any] = {"bodies": found.bodies}
    for name, value, error in zip(found.value._fields, found.value, found.error, strict=True):
        entry[name], entry[f"{name}_error"] = (None if np.isnan(number) else number for number in (value, error))
    return entry


def compare_growth(ensembles: Sequence[Ensemble]) -> dict[str, Any] | None:
    """Difference of two ensembles at their last common time in standard errors, positive if the first is larger.

    `sigma` compares ln S. S itself (`sigma_of_size`) has a skewed distribution, because late collisions of few large
    clusters dominate it. None unless there are two ensembles of at least two boxes each.
    """
    if len(ensembles) != 2 or min(len(one.boxes) for one in ensembles) < 2:
        return None
    time = float(min(one.growth.time[-1] for one in ensembles))
    sizes = [[float(np.interp(time, box.time, box.size)) for box in one.boxes] for one in ensembles]
    first, second = (one.name for one in ensembles)
    content = {"first": first, "second": second, "time": time, "sizes": sizes}
    one, other = (np.array(size) for size in sizes)
    return content | {"sigma": separation(np.log(one), np.log(other)), "sigma_of_size": separation(one, other)}


def write_analysis(folder: Path, ensembles: Sequence[Ensemble], content: dict[str, Any], guides: bool = False) -> None:
    """Write analysis.json, tables of S(t), of local degrees and of aggregates, and the figure, with `guides` or not.

    Raises
    ------
    FilesFailed
        If a file cannot be written.
    """
    from ..plotting.growth import growth_figure
    from ..plotting.run_figure import save

    if not folder.exists():
        make_folder(folder)
    write_json(folder / NAMES[0], content)
    most = max(len(one.boxes) for one in ensembles)
    write_table(folder / NAMES[1], [row for one in ensembles for row in _growth_rows(one, most)])
    write_table(folder / NAMES[2], [row for one in ensembles for row in _degree_rows(one)])
    write_table(folder / NAMES[3], [row for one in ensembles for row in _aggregate_rows(one)])
    kernels = [{"ensemble": one.name, **row} for one in ensembles if one.kernel for row in one.kernel.rows()]
    if kernels:
        write_table(folder / KERNEL_CSV, kernels)
    drawn = []
    for one in ensembles:
        units = {"unit_moment": one.boxes[0].moment, "unit_radius": one.boxes[0].radius}
        rows: dict[str, Any] = all_aggregates(one.boxes) | units | {"temperatures": temperatures_over_time(one.boxes)}
        rows["sizes"] = last_sizes(one.boxes)
        if one.kernel is not None:
            rows |= {"coagulation": (one.kernel.time, one.kernel.size)}
        drawn.append((one.name, one.growth, rows))
    save(growth_figure(drawn, guides), folder / NAMES[4])


def last_sizes(boxes: Sequence[BoxResult]) -> np.ndarray:
    """Grains of each cluster, single grains included, in the last frame of every box."""
    return np.concatenate([box.last_sizes for box in boxes])


def temperatures_over_time(boxes: Sequence[BoxResult]) -> np.ndarray:
    """Rows of time [s] and `BodyTemperatures` [K] of the bodies of all boxes, for each time that half of them have.

    Boxes that ended at another time, or wrote frames at other times, have none at those of the others.

    Returns
    -------
    ndarray
        (K, 4).
    """
    looks = sorted(((time, motion) for box in boxes for time, motion in box.bodies), key=itemgetter(0))
    starts = [k for k, (time, _) in enumerate(looks) if k == 0 or time > looks[k - 1][0] * (1.0 + SAME_TIME)]
    groups = [looks[k:end] for k, end in pairwise([*starts, len(looks)])]
    rows = [
        [group[0][0], *body_temperatures(joined([motion for _, motion in group]))]
        for group in groups
        if 2 * len(group) >= len(boxes)
    ]
    return np.array(rows).reshape(-1, 4)


def _growth_rows(one: Ensemble, most: int) -> list[dict[str, Any]]:
    """One row for each time, with empty columns for boxes that only other ensembles have."""
    growth = one.growth
    rows = []
    for k, time in enumerate(growth.time.tolist()):
        row: dict[str, Any] = {"ensemble": one.name, "time": time}
        row |= {"mean_size": float(growth.mean[k]), "error": float(growth.error[k])}
        own = growth.sizes[:, k].tolist()
        rows.append(row | {f"box_{b + 1}": own[b] if b < len(own) else "" for b in range(most)})
    return rows


def _degree_rows(one: Ensemble) -> list[dict[str, Any]]:
    """One row for each window of S."""
    return [{"ensemble": one.name, **found._asdict()} for found in one.growth.local_degrees or []]


def _aggregate_rows(one: Ensemble) -> list[dict[str, Any]]:
    return [
        {"ensemble": one.name, "box": box.folder.name, **dict(zip(box.aggregates, values, strict=True))}
        for box in one.boxes
        for values in zip(*(column.tolist() for column in box.aggregates.values()), strict=True)
    ]
