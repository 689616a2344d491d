"""Figures of one quantity each: drawn values are those of the run."""

import numpy as np
import pytest

import sand
from sand.analysis.ledger_columns import LedgerColumns
from sand.basics.errors import BadInput
from sand.io.ledger_table import read_ledger
from sand.plotting.plots import HISTORY, grains_figure, history_figure


@pytest.mark.compiled("fields")
def test_curves_are_the_columns_of_the_ledger(run_in_field):
    """Drift and columns of ledger.csv are the summary's; drawn curves are the ledger's columns."""
    rows = read_ledger(run_in_field / "ledger.csv")
    ledger = LedgerColumns(tuple(rows[0]), rows)
    assert ledger.drift == sand.open(run_in_field).summary["drift"]
    for name in HISTORY:
        assert history_figure(ledger, name, 8, 0.0, dark=name == "size").axes
    axes = history_figure(ledger, "contacts", 8, 0.0).axes[0]
    for line, column in zip(axes.get_lines(), ("contacts", "made", "broken"), strict=True):
        np.testing.assert_array_equal(line.get_ydata(), ledger[column])


@pytest.mark.compiled("fields")
def test_histograms_count_every_grain(run_in_field):
    """Bars add up to the grains, or clusters; each bar is at its values."""
    frame = sand.open(run_in_field).frames[0]
    for name, total in (("speed", 8), ("radius", 8), ("coordination", 8), ("material", 8), ("cluster", 4)):
        axes = grains_figure(frame, name).axes[0]
        assert sum(bar.get_height() for bar in axes.patches) == total
    axes = grains_figure(frame, "coordination").axes[0]
    assert [(bar.get_x() + bar.get_width() / 2, bar.get_height()) for bar in axes.patches] == [(1.0, 8)]
    assert "speed (mm/s)" in grains_figure(frame, "speed").axes[0].get_xlabel()
    frame.velocity = np.zeros((8, 3))  # all grains at rest: the bars are still visible
    bars = grains_figure(frame, "speed").axes[0].patches
    assert sum(bar.get_height() for bar in bars) == 8 and min(bar.get_width() for bar in bars) > 0.0
    with pytest.raises(BadInput, match="field_alignment is not known"):
        grains_figure(frame, "field_alignment")
