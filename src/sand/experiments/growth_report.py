"""Report of `sand analyse`: numbers, tables and a figure of one or more ensembles."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..analysis.fits import separation
from ..errors import BadInput
from ..io.run_folder import make_folder, write_json
from ..io.table import write_table
from ..paths import user_path
from .growth import BoxResult, GrowthResult, all_aggregates, boxes_in, growth_of, read_box

NAMES = ("analysis.json", "growth.csv", "aggregates.csv", "growth.png")
"""Files of an analysis."""


class Ensemble(NamedTuple):
    """Boxes with equal settings except for the seed, and their growth laws."""

    name: str
    growth: GrowthResult
    boxes: list[BoxResult]


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
    try:
        return Ensemble(user_path(folder).absolute().name, growth_of(boxes, window), boxes)
    except BadInput as error:
        raise error.at(str(folder)) from None


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
        "missing": growth.missing,
    }


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


def write_analysis(folder: Path, ensembles: Sequence[Ensemble], content: dict[str, Any]) -> None:
    """Write analysis.json, the tables of S(t) and of all aggregates, and the figure.

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
    write_table(folder / NAMES[2], [row for one in ensembles for row in _aggregate_rows(one)])
    drawn = []
    for one in ensembles:
        units = {"unit_moment": one.boxes[0].moment, "unit_radius": one.boxes[0].radius}
        drawn.append((one.name, one.growth, all_aggregates(one.boxes) | units))
    save(growth_figure(drawn), folder / NAMES[3])


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


def _aggregate_rows(one: Ensemble) -> list[dict[str, Any]]:
    return [
        {"ensemble": one.name, "box": box.folder.name, **dict(zip(box.aggregates, values, strict=True))}
        for box in one.boxes
        for values in zip(*(column.tolist() for column in box.aggregates.values()), strict=True)
    ]
