"""Frames and viewer data of a run whose grains change."""

import numpy as np
import pytest

import sand
from sand.basics.box import Box
from sand.basics.schema import MODES
from sand.engine.changed_state import joined, subset
from sand.io.live_trajectory import LiveTrajectory
from sand.io.trajectory import TrajectoryWriter, read_frames
from sand.viewer.by_identity import ByIdentity
from sand.viewer.dataset import run_dataset


def contacts(*pairs):
    """Columns of contacts, with numbers that tell them apart."""
    count = len(pairs)
    scalars = {name: np.arange(count) * 1e-10 for name in ("overlap", "formed", "twist")}
    vectors = {name: np.ones((count, 3)) for name in ("force", "slide_vector", "roll_vector")}
    shares = {f"{mode}_share": np.zeros(count) for mode in MODES}
    return {"pair": np.array(pairs, np.uint32).reshape(-1, 2), **scalars, **vectors, **shares}


@pytest.fixture
def trajectory(tmp_path):
    """A trajectory of grains 0-4 at 77 K, then without 1, then also with 5 (ice, 300 K), then without 5."""
    x = np.arange(5) * 30e-9
    first = sand.Grains(np.stack([x, 0 * x, 0 * x], axis=1), "10 nm", "silica", own={"heat": "77 K"}, charge="1e-19 C")
    less = subset(first, np.array([0, 2, 3, 4]))
    warm = sand.Grains([[0, 1e-7, 0]], "8 nm", "ice", own={"heat": "300 K"})
    more = joined(less, warm, np.array([5], np.uint32))
    writer = TrajectoryWriter(tmp_path / "trajectory.gsd")
    for step, (grains, pair) in enumerate([(first, [0, 1]), (less, [1, 2]), (more, [1, 4]), (less, [1, 2])]):
        writer.write(step, step * 1e-9, grains, Box.open(), contacts(pair))
    writer.close()
    return tmp_path / "trajectory.gsd"


def test_frames_keep_identities_and_own_quantities(trajectory):
    """Checksums hold although chunks appear after the first frame; own quantities are those of the frame."""
    frames = read_frames(trajectory)
    ids = [[0, 1, 2, 3, 4], [0, 2, 3, 4], [0, 2, 3, 4, 5], [0, 2, 3, 4]]
    assert [frame.id.tolist() for frame in frames] == ids
    assert frames[2].heat.tolist() == [77.0, 77.0, 77.0, 77.0, 300.0]
    assert frames[1].heat.tolist() == [77.0] * 4 and frames[1].own.units == {"heat": "K"}
    assert [frames[2].materials[k] for k in frames[2].material] == ["silica"] * 4 + ["ice"]


def test_rows_are_identities_and_absent_grains_have_no_position(trajectory):
    """Row k is grain k in every frame: position NaN where it is absent, and contacts in these rows."""
    frames = ByIdentity(LiveTrajectory(trajectory))
    assert frames.identity.tolist() == [0, 1, 2, 3, 4, 5] and frames.materials == ["silica", "ice"]
    assert [np.flatnonzero(np.isnan(frames[k].own["heat"])).tolist() for k in range(4)] == [[5], [1, 5], [1], [1, 5]]
    assert frames[2].own["heat"][[0, 5]].tolist() == [77.0, 300.0] and (frames[2].charge > 0.0).tolist()[5] is False
    absent = [np.flatnonzero(np.isnan(frames[k].position[:, 0])).tolist() for k in range(4)]
    assert absent == [[5], [1, 5], [1], [1, 5]]
    assert [frames[k].pair.tolist() for k in range(4)] == [[[0, 1]], [[2, 3]], [[2, 5]], [[2, 3]]]
    assert [frames.pairs(k).tolist() for k in range(4)] == [frames[k].pair.tolist() for k in range(4)]
    assert frames[3].radius[5] == pytest.approx(8e-9, rel=1e-6, abs=0.0) and frames[3].material[5] == 1
    data = run_dataset(trajectory)
    assert data.manifest()["grains"] == 6
    names = [data.read(k)[1] for k in range(4)]
    assert names[1][2] == names[1][3] == names[3][2] == names[3][3] and len(data.frame(3)) > 0


def test_grains_added_later_begin_a_new_generation(trajectory):
    """The page reloads the constant quantities when a frame has a grain that no earlier one had."""
    frames = ByIdentity(LiveTrajectory(trajectory))
    before = frames.generation
    grains = sand.Grains([[0, 0, 0], [0, 0, 3e-8]], "9 nm", "iron", own={"heat": "5 K"})
    grains.arrays.id[:] = [6, 7]
    writer = TrajectoryWriter(trajectory, resume_at=3 * 1e-9, written=[k * 1e-9 for k in range(4)])
    writer.write(4, 4e-9, grains, Box.open(), contacts())
    writer.close()
    assert frames.refresh() and frames.generation == before + 1
    assert frames.identity.tolist() == list(range(8)) and np.isnan(frames[4].position).any(axis=1).sum() == 6
