"""Packets of the viewer: decoding returns the encoded frame."""

import json

import numpy as np
import pytest

from sand.basics.box import Box
from sand.io.trajectory import Frames, TrajectoryWriter
from sand.viewer.packets import encode, frame_bytes, frame_packet, grains_packet

from ..pages import decode
from ..synthetic_trajectories import contacts_of, grains_of, write_trajectory


@pytest.fixture(scope="module")
def frame(tmp_path_factory):
    """One of seven grains and two contacts."""
    return Frames(write_trajectory(tmp_path_factory.mktemp("packets") / "a.gsd", [[(0, 1), (5, 3)]], 7))[0]


def test_packets_round_trip(frame):
    """All arrays to single precision, positions and cluster ids exactly; each begins at a multiple of 8."""
    names = np.array([0, 0, 2**32 - 1, 3, 2**32 - 1, 3, 2**32 - 1], np.uint32)
    packet = frame_packet(4, frame, names, 1e-8)
    head, arrays = decode(packet)
    assert (head["frame"], head["step"], head["time"]) == (4, 0, 0.0)
    assert head["box"] == pytest.approx([100.0] * 3, rel=1e-12, abs=0)
    assert (arrays["position"] == (frame.position / 1e-8).astype(np.float32)).all()
    assert (arrays["cluster"] == names).all() and (arrays["pair"] == frame.pair).all()
    for name in ("velocity", "spin", "moment", "force", "share", "overlap", "formed"):
        assert arrays[name] == pytest.approx(getattr(frame, name), rel=1e-7, abs=0)
    begin = 12 + int.from_bytes(packet[8:12], "little")
    assert begin % 8 == 0 and all(entry["offset"] % 8 == 0 for entry in head["arrays"])
    assert len(packet) % 8 == 0 and abs(len(packet) - frame_bytes(7, 2)) < 500


def test_compact_packets_keep_eleven_bits(frame):
    """Half precision within 2⁻¹¹ of each value, positions unchanged; no warning, nothing infinite."""
    _, whole = decode(frame_packet(0, frame, np.zeros(7), 1e-8))
    head, arrays = decode(frame_packet(0, frame, np.zeros(7), 1e-8, compact=True))
    assert {entry["type"] for entry in head["arrays"]} == {"f4", "f2", "u4"}
    assert (arrays["position"] == whole["position"]).all()
    for name in ("velocity", "spin", "moment", "share", "overlap", "formed"):
        assert arrays[name] == pytest.approx(whole[name], rel=2.0**-11, abs=0)


def test_scales_span_nine_decades():
    """From the maximum to 1e-9 of it all values keep 11 bits, for any maximum; zeros and NaN stay."""
    for peak in (1e-30, 7e-7, 1.0, 65504.0, 3e38, 1e200):
        values = peak * np.concatenate([np.geomspace(1e-9, 1.0, 1000), [-1.0, 0.0, np.nan]])
        _, arrays = decode(encode({}, {"force": values}, compact=True))
        assert arrays["force"][:-1] == pytest.approx(values[:-1], rel=2.0**-11, abs=0)
        assert np.isnan(arrays["force"][-1])
    for blank in (np.zeros((0, 3)), np.zeros(4), np.full(2, np.nan)):
        _, arrays = decode(encode({}, {"force": blank}, compact=True))
        assert np.array_equal(arrays["force"], blank, equal_nan=True)


def test_grains_keep_their_size(frame):
    """Radius in units, mass and material; the charge, which an updater may change, is in the packet of each frame."""
    _, arrays = decode(grains_packet(frame, 2e-8))
    assert arrays["radius"] == pytest.approx(frame.radius / 2e-8, rel=1e-7, abs=0)
    assert arrays["mass"] == pytest.approx(frame.mass, rel=1e-7, abs=0)
    _, of_frame = decode(frame_packet(0, frame, np.zeros(7), 2e-8))
    assert of_frame["charge"] == pytest.approx(1.6e-19, rel=1e-7, abs=0)
    assert arrays["material"].dtype == np.uint8 and not arrays["material"].any()


def test_headers_are_json():
    """A header never contains NaN, which is not JSON."""
    packet = encode({"time": np.nan}, {"a": np.arange(6.0)})
    assert json.loads(packet[12 : 12 + int.from_bytes(packet[8:12], "little")])["time"] is None


def test_the_tilt_of_a_box(tmp_path):
    """In units of lengths, of tilted boxes alone."""
    grains, writer = grains_of(3), TrajectoryWriter(tmp_path / "a.gsd")
    for k, tilt in enumerate((0.0, -2e-7)):
        writer.write(k, 1e-9 * k, grains, Box.periodic("1 um", tilt=tilt), contacts_of([]))
    writer.close()
    heads = [decode(frame_packet(0, frame, np.zeros(3), 1e-8))[0] for frame in Frames(tmp_path / "a.gsd")]
    assert "tilt" not in heads[0] and heads[1]["tilt"] == pytest.approx(-20.0, rel=1e-12, abs=0)
