"""Chunks of trajectory.gsd: what is left out of a frame, against frames that gsd.hoomd writes."""

import tracemalloc

import gsd.fl
import gsd.hoomd
import numpy as np
import pytest

import sand
from sand.basics.box import Box
from sand.io.bodies import read_grains
from sand.io.frame_chunks import stored_frame
from sand.io.trajectory import TrajectoryWriter, read_frames

from ..synthetic_trajectories import contacts_of

RNG = np.random.default_rng(4)
SIDE = 1e-6
PARTS = {
    "configuration": ("step", "dimensions", "box"),
    "particles": ("N", "types", "typeid", "mass", "charge", "diameter", "position", "orientation", "velocity", "image"),
    "bonds": ("N", "types", "typeid", "group"),
}


def moments_of_a_run():
    """Step, grains, box and pairs of frames in which everything changes, and returns to what it was or to a default."""
    place, speed = RNG.uniform(-SIDE / 2, SIDE / 2, (6, 3)), RNG.normal(size=(6, 3))
    box, larger = Box.periodic(SIDE), Box.periodic(2 * SIDE)
    copper = sand.IRON.but(name="A")  # a name that readers assume where a file has none
    grains = [
        sand.Grains(place, 1e-8, copper),
        sand.Grains(place, 1e-8, copper, velocity=speed, charge=1e-19),
        sand.Grains(place + 1e-9, 1e-8, [copper, *[sand.IRON] * 5], velocity=-0.0 * speed, mass=2e-20),
        sand.Grains(place[:4], [1e-8, 2e-8, 1e-8, 1e-8], copper, spin=1e6 * speed[:4]),
        sand.Grains(place, 1e-8, copper),
    ]
    pairs = ([], [(0, 1)], [(0, 1), (2, 3)], [(0, 1)], [])
    boxes = (box, box, larger, larger, box)
    return list(zip((0, 7, 0, 7, 7), grains, boxes, pairs, strict=True))


def as_in_gsd(frame):
    """The frame that gsd.hoomd writes."""
    found = gsd.hoomd.Frame()
    for part, names in PARTS.items():
        for name in names:
            if hasattr(getattr(frame, part), name):
                setattr(getattr(found, part), name, getattr(getattr(frame, part), name))
    found.log = dict(frame.log)
    return found


def test_readers_find_the_same_frames(tmp_path):
    """Frame by frame the values of a file that gsd.hoomd has written, with types and shapes; zeros of any sign.

    Frames are written twice, the second time to a file that is opened again for each of them.
    """
    moments, theirs = moments_of_a_run(), tmp_path / "theirs.gsd"
    known: dict = {"scale": None, "materials": []}
    with gsd.hoomd.open(theirs, "w") as file:
        for k, (step, grains, box, pairs) in enumerate(moments):
            frame = stored_frame(step, 1e-9 * k, grains, box, contacts_of(pairs), **known)
            file.append(as_in_gsd(frame))
            known = {"scale": float(frame.log["scale/length"][0]), "materials": frame.particles.types}
    for name, reopened in (("at once", False), ("one by one", True)):
        writer = TrajectoryWriter(tmp_path / f"{name}.gsd")
        for k, (step, grains, box, pairs) in enumerate(moments):
            writer.write(step, 1e-9 * k, grains, box, contacts_of(pairs))
            if reopened:
                writer.close()
        writer.close()
        with gsd.hoomd.open(writer.path, "r") as own, gsd.hoomd.open(theirs, "r") as expected:
            assert len(own) == len(expected) == len(moments)
            for found, frame in zip(own, expected, strict=True):
                for part, names in PARTS.items():
                    for each in names:
                        one, other = (np.asarray(getattr(getattr(f, part), each)) for f in (found, frame))
                        assert (one.dtype, one.shape) == (other.dtype, other.shape), (part, each)
                        assert (one == other).all(), (part, each)
                assert {key: values.tobytes() for key, values in found.log.items()} == {
                    key: values.tobytes() for key, values in frame.log.items()
                }
        assert [frame.materials for frame in read_frames(writer.path)] == [["A"]] * 2 + [["A", "iron"]] * 3


def test_what_stays_is_written_once(tmp_path):
    """Of a frame with the grains and the box of the first one only numbers that have changed are in the file."""
    place, speed = RNG.uniform(-SIDE / 2, SIDE / 2, (6, 3)), RNG.normal(size=(6, 3))
    writer = TrajectoryWriter(tmp_path / "trajectory.gsd")
    for k in range(3):
        grains = sand.Grains(place + 1e-9 * k, 1e-8, sand.IRON, velocity=speed, charge=1e-19)
        writer.write(k, 1e-9 * k, grains, Box.periodic(SIDE), contacts_of([(0, 1)]))
    writer.close()
    with gsd.fl.open(writer.path, "r") as file:
        names = [
            name for part in ("configuration/", "particles/", "bonds/") for name in file.find_matching_chunk_names(part)
        ]
        first, last = ({name for name in names if file.chunk_exists(frame, name)} for frame in (0, 2))
        assert {"particles/mass", "particles/charge", "particles/velocity", "configuration/box"} <= first
        assert last == {"configuration/step", "particles/position"}
        assert not file.chunk_exists(2, "log/lengths") and file.chunk_exists(2, "log/time")


@pytest.mark.parametrize("part", ["particles", "bonds", "angles"])
@pytest.mark.parametrize("own", [True, False], ids=["of SAND", "of others"])
def test_numbers_without_rows_are_refused(tmp_path, part, own):
    """A number of grains or bonds that the arrays do not have: the reader would fill arrays of that length.

    3 GB for 2³¹ types; the memory in use stays below 20 MB.
    """
    path, many = tmp_path / "trajectory.gsd", 2**31
    pair = sand.Grains([[0, 0, 0], [3e-8, 0, 0]], 1e-8, "iron")
    log = stored_frame(0, 0.0, pair, Box.open(), contacts_of([(0, 1)])).log if own else {}
    arrays = {"particles/position": np.array([[0, 0, 0], [3, 0, 0]], np.float32)}
    arrays |= {"bonds/group": np.array([[0, 1]], np.uint32)} | {f"log/{name}": values for name, values in log.items()}
    numbers = {"particles/N": 2, "bonds/N": 1} | {f"{part}/N": many}
    with gsd.fl.open(path, "w", application="a test", schema="hoomd", schema_version=[1, 4]) as file:
        for name, chunk in ({name: np.array([k], np.uint32) for name, k in numbers.items()} | arrays).items():
            file.write_chunk(name, chunk)
        file.end_frame()
    tracemalloc.start()
    with pytest.raises(sand.BadInput, match=f"{part}/N is {many}, but .* has . rows"):
        read_frames(path) if own else read_grains(path, sand.SILICA, length="10 nm")
    largest = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert largest < 2e7
