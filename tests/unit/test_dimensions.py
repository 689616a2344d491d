"""Fractal dimensions of single clusters, as the page is told them."""

import pytest

import sand
from sand.viewer.dataset import run_dataset
from sand.viewer.dimensions import Dimensions

from .synthetic_trajectories import write_trajectory


def test_dimensions(tmp_path, monkeypatch):
    """A straight chain has dimension 1; too few grains give a reason; the same grains are not measured again."""
    from sand.viewer import dimensions

    chain = [(k, k + 1) for k in range(39)]
    story = run_dataset(write_trajectory(tmp_path / "a.gsd", [chain, chain, chain[:10]], 42))
    assert story.dimension(0, 5)["value"] == pytest.approx(1.0, abs=0.1)
    assert "at least 32" in story.dimension(2, 5)["reason"]
    assert "has no contact" in story.dimension(0, 41)["reason"]
    with pytest.raises(sand.BadInput, match="no grain 42"):
        story.dimension(0, 42)
    calls = []
    real = dimensions.cluster_dimension
    monkeypatch.setattr(dimensions, "cluster_dimension", lambda *a: calls.append(a) or real(*a))
    measure = Dimensions()
    found = [measure.of(*story.read(k)) for k in range(3)]
    assert len(calls) == 1 and list(found[0]) == ["0"] and found[0] == found[1] and found[2] == {}
