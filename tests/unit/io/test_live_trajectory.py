"""Frames of a growing trajectory."""

import pytest

from sand.io.live_trajectory import LiveTrajectory

from ..synthetic_trajectories import write_trajectory


def test_a_live_trajectory_is_a_sequence(tmp_path):
    """Slices, negative indices and an end."""
    frames = LiveTrajectory(write_trajectory(tmp_path / "a.gsd", [[(0, 1)], [], [(1, 2)]], 3))
    assert frames.contacts.tolist() == [1, 0, 1] and frames.steps.tolist() == [0, 10, 20]
    assert [frame.step for frame in frames[1:]] == [10, 20] and frames[-1].step == 20
    assert [frames.pairs(k).tolist() for k in range(3)] == [[[0, 1]], [], [[1, 2]]]
    with pytest.raises(IndexError):
        frames[3]
