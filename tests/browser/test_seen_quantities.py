"""What grains are coloured by on the page is what `sand.analysis.quantities` finds in the file, grain by grain."""

import numpy as np
import pytest

from sand.analysis.clusters import cluster_labels
from sand.analysis.quantities import GRAIN_NAMES, measured
from sand.basics.errors import BadInput
from sand.basics.schema import REST

from .looking import SOURCES, View

FIELD = np.array([3e-3, 0.0, 4e-3])
PRECISION = {"server": 4e-6, "file": 2.5e-3}
"""Of the largest number of a frame: numbers in single precision (6e-8) whose squares and cosines are summed; halves
(5e-4), of which an energy has the squares of two, and a cosine two vectors whose sums may cancel by half."""


def shown(view: View, name: str) -> np.ndarray:
    view.set(colour=name)
    values = view.page.evaluate("() => [...sandView.picture.painted.values].map((v) => Number.isNaN(v) ? null : v)")
    return np.array([np.nan if v is None else v for v in values], dtype=float)


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("kind", ["two", "hundred", "resting"])
def test_every_quantity_is_that_of_the_file(page, shows, kind, source):
    """All names of the table, at three frames, grain by grain, also where there is none (NaN in both)."""
    view = View(page, shows(kind), source, shade=0)
    offered = {name for name, _ in page.evaluate("() => sandView.state.setting('colour').options")}
    first = view.shown.frames[0]
    known = {*first.own} | ({REST} if first.at_rest is not None else set())
    assert offered == {*GRAIN_NAMES} - {REST} | known
    for k in (0, len(view.shown.frames) // 2, len(view.shown.frames) - 1):
        frame = view.go(k)
        for name in offered:
            values = shown(view, name)
            if name == "cluster":
                labels = cluster_labels(len(frame), frame.pair)
                single = np.bincount(labels)[labels] == 1
                assert np.array_equal(np.isnan(values), single)
                together = values[~single, None] == values[None, ~single]
                assert np.array_equal(together, labels[~single, None] == labels[None, ~single])
                continue
            try:
                truth = measured(frame, name, FIELD)
            except BadInput:
                truth = np.full(len(frame), np.nan)
            assert np.array_equal(np.isnan(values), np.isnan(truth)), name
            known = ~np.isnan(truth)
            bound = PRECISION[source] * np.abs(truth[known]).max(initial=0.0)
            assert np.abs(values - truth)[known].max(initial=0.0) <= bound, name
