"""What the page of a run is told: of a finished one, one that is going, and files that are not what they should be."""

import json
import os
import shutil
import threading
import time

import numpy as np
import pytest

import sand
from sand.analysis.quantities import CONTACT_NAMES, GRAIN_NAMES, measured
from sand.analysis.tracking import SINGLE
from sand.io.gsd_index import ENTRY, read_index
from sand.io.trajectory import TrajectoryWriter
from sand.viewer.dataset import run_dataset
from sand.viewer.external_field import read_field
from sand.viewer.series import EXTREMES, PERCENTILES

from .pages import decode
from .synthetic_trajectories import append, contacts_of, write_trajectory

KEYS = [
    "format",
    "name",
    "version",
    "generation",
    "grains",
    "times",
    "steps",
    "bytes",
    "running",
    "outcome",
    "note",
    "unit",
    "materials",
    "periodic",
    "field",
    "ranges",
    "palettes",
    "colours",
    "dimensions",
]


@pytest.mark.compiled("fields")
def test_the_manifest_of_a_run(finished_run):
    """All keys of the contract, the run's own numbers, nothing that JSON cannot hold."""
    folder, sim = finished_run
    told = run_dataset(folder, read_field(folder)).manifest()
    assert list(told) == KEYS
    json.dumps(told, allow_nan=False)
    assert (told["format"], told["name"], told["grains"], told["materials"]) == (1, "run", 6, ["iron"])
    assert told["times"] == pytest.approx(sim.ledger["time"], rel=1e-15, abs=0)
    assert told["steps"] == sim.ledger["step"].tolist()
    assert told["unit"] == pytest.approx(1e-8, rel=1e-12, abs=0)
    assert not told["running"] and "reached" in told["outcome"] and told["note"] is None
    assert told["periodic"] == [False] * 3 and told["generation"] == 0
    assert str(folder.parent) not in json.dumps(told)
    assert all(np.shape(colours) == (64, 3) for colours in told["palettes"].values())
    for low, high in told["ranges"].values():
        assert 0.0 <= low <= high
    speed = np.linalg.norm(sim.grains.velocity, axis=1)
    assert told["ranges"]["speed"][1] >= 0.99 * speed.max()
    kinetic = sim.ledger["translation"][-1] + sim.ledger["rotation"][-1]
    assert kinetic / 6 <= 1.01 * told["ranges"]["kinetic_energy"][1] <= 10 * (sim.ledger["translation"] + 1e-15).max()


@pytest.mark.compiled("fields")
def test_times_are_told_from_a_frame_on(finished_run):
    """`since` leaves out earlier ones and nothing else, and may be beyond the end."""
    story = run_dataset(finished_run[0])
    whole, late, none = story.manifest(), story.manifest(4), story.manifest(10**8)
    assert late["times"] == whole["times"][4:] and late["steps"] == whole["steps"][4:]
    assert none["times"] == [] and {k: v for k, v in late.items() if k not in ("times", "steps")} == {
        k: v for k, v in whole.items() if k not in ("times", "steps")
    }


def test_frames_of_a_run(finished_run):
    """A packet holds what the file holds, and names that stay."""
    folder, sim = finished_run
    story = run_dataset(folder / "trajectory.gsd")  # the file means the run it lies in
    assert story.manifest()["outcome"]
    head, arrays = decode(story.frame(5))
    assert head["time"] == sim.time and head["frame"] == 5
    place = arrays["position"] * story.unit
    assert place == pytest.approx(sim.grains.position, abs=1e-14)
    assert arrays["cluster"].tolist() == [0] * 5 + [SINGLE]
    assert abs(sum(len(story.frame(k)) for k in range(6)) / story.size - 1.0) < 0.25
    with pytest.raises(sand.BadInput, match="no frame 6"):
        story.frame(6)


def test_a_run_that_goes_on(tmp_path, finished_run):
    """Frames that come later are found; names, times and the ledger go on; its summary ends it."""
    shutil.copy(finished_run[0] / "case.toml", tmp_path)
    writer = TrajectoryWriter(tmp_path / "trajectory.gsd")
    append(writer, [[(1, 2)]], 4)
    story = run_dataset(tmp_path)
    assert story.manifest()["running"] and len(story) == 1
    assert not story.frames.refresh()
    append(writer, [[(1, 2), (0, 1)], [(1, 2), (0, 1)]], 4, first=1)
    assert len(story) == 1  # not before it looks
    story.refresh()
    told = story.manifest(1)
    assert len(told["times"]) == 2 and told["steps"] == [10, 20]
    assert decode(story.frame(2))[1]["cluster"].tolist() == [1, 1, 1, SINGLE]
    (tmp_path / "summary.json").write_text('{"steps": 20, "outcome_text": "done"}')
    assert story.manifest()["running"]  # not before it looks
    story.refresh()
    assert story.manifest()["outcome"] == "done"
    append(writer, [[]], 4, first=3)  # resumed
    story.refresh()
    assert story.manifest()["running"]
    writer.close()


def test_a_run_begun_anew_is_another(tmp_path):
    """Where the file is replaced by one of other grains, nothing of the old one is told."""
    story = run_dataset(write_trajectory(tmp_path / "a.gsd", [[(0, 1)]] * 3, 4))
    (tmp_path / "a.gsd").unlink()
    write_trajectory(tmp_path / "a.gsd", [[(2, 3)], [(2, 3)]], 6)
    story.refresh()
    assert story.manifest()["grains"] == 6 and len(story) == 2 and story.manifest()["generation"] == 1
    assert decode(story.frame(1))[1]["cluster"].tolist() == [SINGLE, SINGLE, 2, 2, SINGLE, SINGLE]


def test_a_run_begun_anew_without_a_frame(tmp_path):
    """Until the new file has a frame the old story stays, though it is looked at again and again."""
    path = tmp_path / "a.gsd"
    story = run_dataset(write_trajectory(path, [[(0, 1)]] * 3, 4))
    path.unlink()
    writer = TrajectoryWriter(path)
    for _ in range(2):
        story.refresh()
        told = story.manifest()
        assert (told["generation"], told["grains"], len(told["times"])) == (0, 4, 3)
        story.frame(2)
    append(writer, [[(2, 3)]], 6)
    story.refresh()
    told = story.manifest()
    assert (told["generation"], told["grains"], len(told["times"])) == (1, 6, 1)
    writer.close()


def test_a_run_that_ends_while_it_is_looked_at(tmp_path):
    """Its last frames and its end come between two looks at its files: it is not over before they are told."""
    (tmp_path / "case.toml").write_text("")
    writer = TrajectoryWriter(tmp_path / "trajectory.gsd")
    append(writer, [[]], 4)
    story = run_dataset(tmp_path)
    look = story.frames.refresh

    def late():
        found = look()
        append(writer, [[], []], 4, first=1)
        (tmp_path / "summary.json").write_text('{"steps": 20, "outcome_text": "done"}')
        story.frames.refresh = look
        return found

    story.frames.refresh = late
    story.refresh()
    assert story.manifest()["running"]
    story.refresh()
    assert not story.manifest()["running"] and len(story) == 3
    writer.close()


def test_a_run_that_was_killed(tmp_path):
    """Without an end and for hours without a frame: what may have happened, and what to do."""
    (tmp_path / "case.toml").write_text("")
    path = write_trajectory(tmp_path / "trajectory.gsd", [[]], 4)
    story = run_dataset(tmp_path)
    assert story.manifest()["note"] is None
    for age, duration in ((7200, "2 h"), (86400 * 3, "3 days")):
        os.utime(path, (time.time() - age,) * 2)
        note = f"no new frame for {duration}: the run may have been killed; sand resume continues it"
        assert story.manifest()["note"] == note and story.manifest()["running"]
    (tmp_path / "summary.json").write_text('{"steps": 0}')
    story.refresh()
    assert story.manifest()["note"] is None


def test_the_last_frames_stay_the_same_ones(tmp_path):
    """Counted from the end when they are chosen, not again when more have come."""
    path = tmp_path / "a.gsd"
    writer = TrajectoryWriter(path)
    append(writer, [[]] * 6, 4)
    story = run_dataset(path)
    story.select(slice(-2, None))
    append(writer, [[]] * 2, 4, first=6)
    story.refresh()
    assert story.manifest()["steps"] == [40, 50, 60, 70] and decode(story.frame(0))[0]["step"] == 40
    story.select(slice(-100, -3, 2))
    append(writer, [[]], 4, first=8)
    story.refresh()
    assert story.manifest()["steps"] == [0, 20, 40]
    writer.close()


def test_a_damaged_frame_spoils_no_other(tmp_path):
    """Contacts of grains that are none: that frame is an error; manifest, series and the names of others are not."""
    frames = [[(0, 1)], [(0, 1), (1, 2)], [(0, 1), (1, 2), (2, 3)]]
    for damaged in (0, 1):
        path = write_trajectory(tmp_path / f"{damaged}.gsd", frames, 5)
        entries = read_index(path)[1]
        chunk = entries[(entries["frame"] == damaged) & (entries["rows"] == damaged + 1) & (entries["columns"] == 2)]
        with open(path, "r+b") as file:
            file.seek(int(chunk[0]["location"]))
            file.write(b"\xff" * 4)
        story = run_dataset(path)
        told = story.manifest()
        assert len(told["times"]) == 3 and told["colours"]["named"] == {"0": 0}
        with pytest.raises(sand.BadInput, match="checksum"):
            story.frame(damaged)
        with pytest.raises(sand.BadInput, match="contact of grain"):
            story.frames.pairs(damaged)
        assert decode(story.frame(2))[1]["cluster"].tolist() == [0, 0, 0, 0, SINGLE]
        lines = story.series()["plots"][0]["lines"]
        assert lines[1]["values"][damaged] is None and lines[1]["values"][2] == 4.0


def test_a_torn_end_is_left_out(tmp_path):
    """A last frame whose data were never written does not keep the others from being seen, and is mentioned."""
    path = write_trajectory(tmp_path / "a.gsd", [[(0, 1)], [(0, 2)], [(1, 2)]], 5)
    place, entries = read_index(path)
    with open(path, "r+b") as file:  # positions of the last frame are zeros, as after a power cut
        late = entries[(entries["frame"] == 2) & (entries["rows"] == 5) & (entries["columns"] == 3)][0]
        file.seek(int(late["location"]))
        file.write(bytes(60))
    story = run_dataset(path)
    assert len(story) == 2 and "1 incomplete frame at the end left out" in story.manifest()["note"]
    assert decode(story.frame(1))[1]["pair"].tolist() == [[0, 2]]
    assert ENTRY.itemsize == 32 and place > 0


def test_files_that_are_none(tmp_path):
    """No run, no frame yet, a foreign file, a broken one: one sentence that says what and where."""
    import gsd.hoomd

    with pytest.raises(sand.BadInput, match="no such folder"):
        run_dataset(tmp_path / "none")
    with pytest.raises(sand.BadInput, match=r"no trajectory.gsd in it"):
        run_dataset(tmp_path)
    TrajectoryWriter(tmp_path / "trajectory.gsd").close()
    with pytest.raises(sand.BadInput, match="no frame yet"):
        run_dataset(tmp_path)
    with gsd.hoomd.open(str(tmp_path / "other.gsd"), "w") as file:
        frame = gsd.hoomd.Frame()
        frame.particles.N = 3
        file.append(frame)
    with pytest.raises(sand.BadInput, match="not written by SAND"):
        run_dataset(tmp_path / "other.gsd")
    (tmp_path / "text.gsd").write_text("no frames here")
    with pytest.raises(sand.BadInput, match="not a trajectory"):
        run_dataset(tmp_path / "text.gsd")


def test_other_numbers_of_grains(tmp_path):
    """A frame with other grains than the first is refused by itself."""
    writer = TrajectoryWriter(tmp_path / "a.gsd")
    append(writer, [[]], 4)
    append(writer, [[]], 5, first=1)
    writer.close()
    story = run_dataset(tmp_path / "a.gsd")
    story.frame(0)
    with pytest.raises(sand.BadInput, match="frame 1 has 5 grains"):
        story.frame(1)


@pytest.mark.slow
def test_several_readers_at_once(tmp_path):
    """Eight threads that ask for frames in any order all get the right ones."""
    story = run_dataset(write_trajectory(tmp_path / "a.gsd", [[(k % 5, k % 5 + 1)] for k in range(30)], 9))
    expected, wrong = [story.frame(k) for k in range(30)], []

    def ask(seed):
        for k in np.random.default_rng(seed).integers(0, 30, 40).tolist():
            if story.frame(k) != expected[k]:
                wrong.append(k)

    threads = [threading.Thread(target=ask, args=(seed,)) for seed in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def test_ranges_are_those_of_the_quantities(finished_run, tmp_path):
    """Names are those of the table but for `moment`; extremes are those of all frames; without moments 0 to 0."""
    folder, _ = finished_run
    ranges, frames = run_dataset(folder).ranges(), sand.open(folder).frames
    assert set(ranges) == {*PERCENTILES, *EXTREMES} and set(ranges) - {"moment"} <= {*GRAIN_NAMES, *CONTACT_NAMES}
    for name in ("size", "radius", "coordination", "load"):
        every = np.concatenate([np.abs(measured(frame, name)) for frame in frames])
        assert ranges[name] == [every.min(), every.max()]
    assert ranges["size"] == [1.0, 5.0] and ranges["moment"][1] > 0.0
    writer = TrajectoryWriter(tmp_path / "a.gsd")
    still = sand.Grains([[0.0, 0.0, 0.0]], "10 nm", sand.SILICA)
    writer.write(0, 0.0, still, sand.Box.open(), contacts_of([]))
    writer.close()
    ranges = run_dataset(tmp_path / "a.gsd").ranges()
    assert ranges["moment"] == ranges["load"] == ranges["speed"] == [0.0, 0.0] and ranges["size"] == [1.0, 1.0]


def test_clusters_that_end_as_the_largest_are_named(tmp_path, monkeypatch):
    """The pair 0–1 grows to 4 grains, the pair 6–7 stays, 4–5 breaks: places by size at the end, by name.

    Where following them would take long, there are none.
    """
    bonds = [[(0, 1), (4, 5), (6, 7)], [(0, 1), (1, 2), (2, 3), (6, 7)]]
    path = write_trajectory(tmp_path / "a.gsd", bonds, 9)
    assert run_dataset(path).manifest()["colours"]["named"] == {"0": 0, "6": 1}
    monkeypatch.setattr("sand.viewer.dataset.MAX_TRACKED", 17)
    assert run_dataset(path).manifest()["colours"]["named"] == {}
