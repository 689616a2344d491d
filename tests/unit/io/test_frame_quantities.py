"""Every quantity of a frame is read as it was written."""

import numpy as np
import pytest

import sand
from sand.basics.box import Box
from sand.io.trajectory import TrajectoryWriter, read_frames

from ..synthetic_trajectories import contacts_of

SINGLE = 6e-8
"""Rounding error of float32, in which the format stores most numbers."""


@pytest.mark.parametrize("box", [Box.open(), Box.periodic("1 um", None, "0.8 um")])
def test_a_frame_holds_grains_and_contacts(tmp_path, box):
    """Unequal grains of two materials, random orientations, three contacts: all by name, in SI.

    Values in float32 return to its rounding, positions to that of a mean radius times the extent in mean radii; logged
    values return to the last bit.
    """
    rng = np.random.default_rng(3)
    grains = sand.Grains(
        1e-7 * rng.normal(size=(5, 3)),
        1e-8 * rng.uniform(0.5, 2.0, 5),
        ["iron", "silica", "silica", "iron", "silica"],
        velocity=rng.normal(size=(5, 3)),
        spin=1e6 * rng.normal(size=(5, 3)),
        moment=1e-18 * rng.normal(size=(5, 3)),
        charge=1e-19 * rng.normal(size=5),
    )
    turned = rng.normal(size=(4, 5))
    grains.arrays.orientation[...] = turned / np.linalg.norm(turned, axis=0)
    contacts = contacts_of([(0, 1), (1, 3), (2, 4)])
    writer = TrajectoryWriter(tmp_path / "a.gsd")
    writer.write(7, 0.1 + 0.2, grains, box, contacts)
    writer.close()
    (frame,) = read_frames(tmp_path / "a.gsd")
    assert (frame.step, frame.time, len(frame), frame.box) == (7, 0.1 + 0.2, 5, box)
    for name in ("radius", "mass", "charge", "velocity", "orientation"):
        expected = getattr(grains, name)
        assert getattr(frame, name) == pytest.approx(expected, rel=2 * SINGLE, abs=0.0), name
    assert frame.position == pytest.approx(grains.position, abs=2 * SINGLE * np.abs(grains.position).max())
    assert (frame.moment == grains.moment).all() and (frame.spin == grains.spin).all()
    assert [frame.materials[k] for k in frame.material] == ["iron", "silica", "silica", "iron", "silica"]
    for name in ("pair", "overlap", "formed"):
        assert (getattr(frame, name) == contacts[name]).all(), name
    assert frame.force == pytest.approx(contacts["force"], rel=2 * SINGLE, abs=0.0)
    shares = np.column_stack([contacts[f"{mode}_share"] for mode in ("stretch", "slide", "roll", "twist")])
    assert frame.share == pytest.approx(shares, rel=2 * SINGLE, abs=0.0)
