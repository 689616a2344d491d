"""Fractal dimensions of single clusters, as sent to the page."""

import pytest

import sand
from sand.viewer.dataset import run_dataset
from sand.viewer.dimensions import Dimensions

from ..synthetic_trajectories import write_trajectory


def test_dimensions(tmp_path, monkeypatch):
    """A straight chain has dimension 1; too few grains give a reason; results are cached by grains."""
    from sand.viewer import dimensions

    chain = [(k, k + 1) for k in range(39)]
    dataset = run_dataset(write_trajectory(tmp_path / "a.gsd", [chain, chain, chain[:10]], 42))
    assert dataset.dimension(0, 5)["value"] == pytest.approx(1.0, abs=0.1)
    assert "at least 32" in dataset.dimension(2, 5)["reason"]
    assert "has no contact" in dataset.dimension(0, 41)["reason"]
    with pytest.raises(sand.BadInput, match="no grain 42"):
        dataset.dimension(0, 42)
    calls = []
    real = dimensions.cluster_dimension
    monkeypatch.setattr(dimensions, "cluster_dimension", lambda *a: calls.append(a) or real(*a))
    measure = Dimensions()
    found = [measure.of(*dataset.read(k)) for k in range(3)]
    assert len(calls) == 1 and list(found[0]) == ["0"] and found[0] == found[1] and found[2] == {}
