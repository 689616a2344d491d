"""Run dataset of the viewer: finished runs, growing runs and damaged files."""

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
from sand.io.damage import sealed
from sand.io.gsd_index import ENTRY, read_index
from sand.io.run_folder import write_json
from sand.io.trajectory import TrajectoryWriter
from sand.viewer.dataset import run_dataset
from sand.viewer.external_field import read_field
from sand.viewer.series import EXTREMES, PERCENTILES

from ..pages import decode
from ..synthetic_trajectories import append, contacts_of, write_trajectory

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
    "own",
    "at_rest",
    "periodic",
    "field",
    "ranges",
    "percentiles",
    "hints",
    "palettes",
    "colours",
    "dimensions",
]


@pytest.mark.compiled("fields")
def test_manifest_of_a_run(finished_run):
    """All keys of the wire format, the run's numbers, and only values that JSON can represent."""
    folder, sim = finished_run
    manifest = run_dataset(folder, read_field(folder)).manifest()
    assert list(manifest) == KEYS
    json.dumps(manifest, allow_nan=False)
    assert (manifest["format"], manifest["name"], manifest["grains"], manifest["materials"]) == (1, "run", 6, ["iron"])
    assert manifest["times"] == pytest.approx(sim.ledger["time"], rel=1e-15, abs=0)
    assert manifest["steps"] == sim.ledger["step"].tolist()
    assert manifest["unit"] == pytest.approx(1e-8, rel=1e-12, abs=0)
    assert not manifest["running"] and "reached" in manifest["outcome"] and manifest["note"] is None
    assert manifest["periodic"] == [False] * 3 and manifest["generation"] == 0
    assert str(folder.parent) not in json.dumps(manifest)
    assert all(np.shape(colours) == (64, 3) for colours in manifest["palettes"].values())
    for low, high in manifest["ranges"].values():
        assert 0.0 <= low <= high
    speed = np.linalg.norm(sim.grains.velocity, axis=1)
    assert manifest["ranges"]["speed"][1] >= 0.99 * speed.max()
    kinetic = sim.ledger["translation"][-1] + sim.ledger["rotation"][-1]
    assert (
        kinetic / 6 <= 1.01 * manifest["ranges"]["kinetic_energy"][1] <= 10 * (sim.ledger["translation"] + 1e-15).max()
    )


@pytest.mark.compiled("fields")
def test_times_since_a_frame(finished_run):
    """`since` omits earlier frames and nothing else, and may exceed the number of frames."""
    dataset = run_dataset(finished_run[0])
    whole, late, none = dataset.manifest(), dataset.manifest(4), dataset.manifest(10**8)
    assert late["times"] == whole["times"][4:] and late["steps"] == whole["steps"][4:]
    assert none["times"] == [] and {k: v for k, v in late.items() if k not in ("times", "steps")} == {
        k: v for k, v in whole.items() if k not in ("times", "steps")
    }


def test_packets_of_frames(finished_run):
    """A packet holds the numbers of the file; cluster ids persist over frames."""
    folder, sim = finished_run
    dataset = run_dataset(folder / "trajectory.gsd")  # the file stands for the run in its folder
    assert dataset.manifest()["outcome"]
    head, arrays = decode(dataset.frame(5))
    assert head["time"] == sim.time and head["frame"] == 5
    place = arrays["position"] * dataset.unit
    assert place == pytest.approx(sim.grains.position, abs=1e-14)
    assert arrays["cluster"].tolist() == [0] * 5 + [SINGLE]
    assert abs(sum(len(dataset.frame(k)) for k in range(6)) / dataset.size - 1.0) < 0.25
    with pytest.raises(sand.BadInput, match="no frame 6"):
        dataset.frame(6)


def test_a_growing_run(tmp_path, finished_run):
    """New frames are found; cluster ids, times and the ledger continue; the summary marks the end."""
    shutil.copy(finished_run[0] / "case.toml", tmp_path)
    writer = TrajectoryWriter(tmp_path / "trajectory.gsd")
    append(writer, [[(1, 2)]], 4)
    dataset = run_dataset(tmp_path)
    assert dataset.manifest()["running"] and len(dataset) == 1
    assert not dataset.frames.refresh()
    append(writer, [[(1, 2), (0, 1)], [(1, 2), (0, 1)]], 4, first=1)
    assert len(dataset) == 1  # unchanged until the dataset reads the files again
    dataset.refresh()
    manifest = dataset.manifest(1)
    assert len(manifest["times"]) == 2 and manifest["steps"] == [10, 20]
    assert decode(dataset.frame(2))[1]["cluster"].tolist() == [1, 1, 1, SINGLE]
    write_json(tmp_path / "summary.json", sealed({"steps": 20, "time": 2e-12, "outcome_text": "done"}))
    assert dataset.manifest()["running"]  # unchanged until the dataset reads the files again
    dataset.refresh()
    assert dataset.manifest()["outcome"] == "done"
    append(writer, [[]], 4, first=3)  # resumed
    dataset.refresh()
    assert dataset.manifest()["running"]
    writer.close()


def test_a_replaced_trajectory_is_a_new_run(tmp_path):
    """If the file is replaced by one of other grains, nothing of the old run is sent."""
    dataset = run_dataset(write_trajectory(tmp_path / "a.gsd", [[(0, 1)]] * 3, 4))
    (tmp_path / "a.gsd").unlink()
    write_trajectory(tmp_path / "a.gsd", [[(2, 3)], [(2, 3)]], 6)
    dataset.refresh()
    assert dataset.manifest()["grains"] == 6 and len(dataset) == 2 and dataset.manifest()["generation"] == 1
    assert decode(dataset.frame(1))[1]["cluster"].tolist() == [SINGLE, SINGLE, 2, 2, SINGLE, SINGLE]


def test_a_replaced_trajectory_without_frames(tmp_path):
    """The old dataset remains until the new file has a frame, however often it is refreshed."""
    path = tmp_path / "a.gsd"
    dataset = run_dataset(write_trajectory(path, [[(0, 1)]] * 3, 4))
    path.unlink()
    writer = TrajectoryWriter(path)
    for _ in range(2):
        dataset.refresh()
        manifest = dataset.manifest()
        assert (manifest["generation"], manifest["grains"], len(manifest["times"])) == (0, 4, 3)
        dataset.frame(2)
    append(writer, [[(2, 3)]], 6)
    dataset.refresh()
    manifest = dataset.manifest()
    assert (manifest["generation"], manifest["grains"], len(manifest["times"])) == (1, 6, 1)
    writer.close()


def test_a_run_that_ends_between_two_refreshes(tmp_path):
    """Its last frames are sent before it is reported as finished."""
    (tmp_path / "case.toml").write_text("")
    writer = TrajectoryWriter(tmp_path / "trajectory.gsd")
    append(writer, [[]], 4)
    dataset = run_dataset(tmp_path)
    reader = dataset.frames.refresh

    def late():
        found = reader()
        append(writer, [[], []], 4, first=1)
        write_json(tmp_path / "summary.json", sealed({"steps": 20, "time": 2e-12, "outcome_text": "done"}))
        dataset.frames.refresh = reader
        return found

    dataset.frames.refresh = late
    dataset.refresh()
    assert dataset.manifest()["running"]
    dataset.refresh()
    assert not dataset.manifest()["running"] and len(dataset) == 3
    writer.close()


def test_a_run_that_was_killed(tmp_path):
    """Hours without a frame and no summary: the state names possible reasons and what to do."""
    (tmp_path / "case.toml").write_text("")
    path = write_trajectory(tmp_path / "trajectory.gsd", [[]], 4)
    dataset = run_dataset(tmp_path)
    assert dataset.manifest()["note"] is None
    for age, duration in ((7200, "2 h"), (86400 * 3, "3 days")):
        os.utime(path, (time.time() - age,) * 2)
        note = f"no new frame for {duration}: the run may have been killed; sand resume continues it"
        assert dataset.manifest()["note"] == note and dataset.manifest()["running"]
    write_json(tmp_path / "summary.json", sealed({"steps": 0}))
    dataset.refresh()
    assert dataset.manifest()["note"] is None


def test_negative_frame_ranges_are_resolved_once(tmp_path):
    """Frames counted from the end are chosen once, not again when more frames have come."""
    path = tmp_path / "a.gsd"
    writer = TrajectoryWriter(path)
    append(writer, [[]] * 6, 4)
    dataset = run_dataset(path)
    dataset.select(slice(-2, None))
    append(writer, [[]] * 2, 4, first=6)
    dataset.refresh()
    assert dataset.manifest()["steps"] == [40, 50, 60, 70] and decode(dataset.frame(0))[0]["step"] == 40
    dataset.select(slice(-100, -3, 2))
    append(writer, [[]], 4, first=8)
    dataset.refresh()
    assert dataset.manifest()["steps"] == [0, 20, 40]
    writer.close()


def test_a_damaged_frame_affects_no_other(tmp_path):
    """Contacts of invalid grain indices: an error for that frame only; manifest, series, other ids unaffected."""
    frames = [[(0, 1)], [(0, 1), (1, 2)], [(0, 1), (1, 2), (2, 3)]]
    for damaged in (0, 1):
        path = write_trajectory(tmp_path / f"{damaged}.gsd", frames, 5)
        entries = read_index(path)[1]
        chunk = entries[(entries["frame"] == damaged) & (entries["rows"] == damaged + 1) & (entries["columns"] == 2)]
        with open(path, "r+b") as file:
            file.seek(int(chunk[0]["location"]))
            file.write(b"\xff" * 4)
        dataset = run_dataset(path)
        manifest = dataset.manifest()
        assert len(manifest["times"]) == 3 and manifest["colours"]["named"] == {"0": 0}
        with pytest.raises(sand.BadInput, match="checksum"):
            dataset.frame(damaged)
        with pytest.raises(sand.BadInput, match="contact of grain"):
            dataset.frames.pairs(damaged)
        assert decode(dataset.frame(2))[1]["cluster"].tolist() == [0, 0, 0, 0, SINGLE]
        lines = dataset.series()["plots"][0]["lines"]
        assert lines[1]["values"][damaged] is None and lines[1]["values"][2] == 4.0


def test_an_incomplete_last_frame_is_omitted(tmp_path):
    """A last frame without data does not hide the others and is reported."""
    path = write_trajectory(tmp_path / "a.gsd", [[(0, 1)], [(0, 2)], [(1, 2)]], 5)
    place, entries = read_index(path)
    with open(path, "r+b") as file:  # positions of the last frame are zeros, as after a power cut
        late = entries[(entries["frame"] == 2) & (entries["rows"] == 5) & (entries["columns"] == 3)][0]
        file.seek(int(late["location"]))
        file.write(bytes(60))
    dataset = run_dataset(path)
    assert len(dataset) == 2 and "1 incomplete frame at the end left out" in dataset.manifest()["note"]
    assert decode(dataset.frame(1))[1]["pair"].tolist() == [[0, 2]]
    assert ENTRY.itemsize == 32 and place > 0


def test_unreadable_files(tmp_path):
    """No run, no frame yet, another format, a damaged file: one sentence with the reason and the path."""
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


def test_frames_with_another_number_of_grains(tmp_path):
    """A grain that the first frame lacks has a row in all frames, and no position in the first."""
    writer = TrajectoryWriter(tmp_path / "a.gsd")
    append(writer, [[]], 4)
    append(writer, [[]], 5, first=1)
    writer.close()
    dataset = run_dataset(tmp_path / "a.gsd")
    absent = [np.isnan(dataset.read(k)[0].position[:, 0]).tolist() for k in range(2)]
    assert absent == [[False] * 4 + [True], [False] * 5]


@pytest.mark.slow
def test_concurrent_readers(tmp_path):
    """Eight threads that request frames in random order all get the right ones."""
    dataset = run_dataset(write_trajectory(tmp_path / "a.gsd", [[(k % 5, k % 5 + 1)] for k in range(30)], 9))
    expected, wrong = [dataset.frame(k) for k in range(30)], []

    def ask(seed):
        for k in np.random.default_rng(seed).integers(0, 30, 40).tolist():
            if dataset.frame(k) != expected[k]:
                wrong.append(k)

    threads = [threading.Thread(target=ask, args=(seed,)) for seed in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def test_ranges_of_quantities(finished_run, tmp_path):
    """Ranges are the extremes over all frames, named as in the table except `moment`; without moments 0 to 0."""
    folder, _ = finished_run
    ranges, frames = run_dataset(folder).ranges(), sand.open(folder).frames
    assert set(ranges) == {*PERCENTILES, *EXTREMES} and set(ranges) - {"moment"} <= {*GRAIN_NAMES, *CONTACT_NAMES}
    for name in ("size", "radius", "coordination", "load"):
        every = np.concatenate([np.abs(measured(frame, name)) for frame in frames])
        assert ranges[name] == [every.min(), every.max()]
    assert ranges["size"] == [1.0, 5.0] and ranges["moment"][1] > 0.0
    writer = TrajectoryWriter(tmp_path / "a.gsd")
    unchanged = sand.Grains([[0.0, 0.0, 0.0]], "10 nm", sand.SILICA)
    writer.write(0, 0.0, unchanged, sand.Box.open(), contacts_of([]))
    writer.close()
    ranges = run_dataset(tmp_path / "a.gsd").ranges()
    assert ranges["moment"] == ranges["load"] == ranges["speed"] == [0.0, 0.0] and ranges["size"] == [1.0, 1.0]


def test_ids_of_the_largest_clusters_at_the_end(tmp_path, monkeypatch):
    """The pair 0–1 grows to 4 grains, the pair 6–7 stays, 4–5 breaks: ids by final size.

    Where tracking would take too long, none are given.
    """
    bonds = [[(0, 1), (4, 5), (6, 7)], [(0, 1), (1, 2), (2, 3), (6, 7)]]
    path = write_trajectory(tmp_path / "a.gsd", bonds, 9)
    assert run_dataset(path).manifest()["colours"]["named"] == {"0": 0, "6": 1}
    monkeypatch.setattr("sand.viewer.dataset.MAX_TRACKED", 17)
    assert run_dataset(path).manifest()["colours"]["named"] == {}
