"""Results of a run opened with `sand.open`, their export, and unreadable folders."""

import json
import sys

import numpy as np
import pytest

import sand
from sand.cli.main import main
from sand.io.damage import sealed
from sand.io.run_folder import write_json
from tests.unit.synthetic_trajectories import write_trajectory


@pytest.mark.compiled("fields")
def test_frames_ledger_case_and_summary(finished_run):
    """Frames by index, ledger columns, contacts with forces, case and summary."""
    folder, sim = finished_run
    run = sand.open(folder)
    assert len(run.frames) == len(sim.ledger) == 6
    assert run.frames[-1].time == sim.time
    assert [frame.step for frame in run.frames[1:4]] == [int(s) for s in sim.ledger["step"][1:4]]
    assert (run.ledger["total"] == sim.ledger["total"]).all()
    assert run.frames.times == pytest.approx(sim.ledger["time"], rel=1e-15, abs=0)
    contacts = run.contacts()
    assert (contacts["pair"] == sim.contacts["pair"]).all()
    assert contacts["force"] == pytest.approx(sim.contacts["force"], rel=1e-6, abs=0)
    assert run.summary["outcome"] == "finished"
    assert run.case["grains"]["number"] == 6
    with pytest.raises(IndexError, match="from 0 to 5"):
        run.frames[6]


@pytest.mark.compiled("fields")
def test_xarray_and_pandas_tables(finished_run):
    """xarray: dimensions, coordinates, units; pandas: the ledger."""
    pytest.importorskip("xarray", reason="xarray is in the test extra")
    folder, sim = finished_run
    run = sand.open(folder)
    data = run.to_xarray()
    assert dict(data.sizes) == {"frame": 6, "grain": 6, "axis": 3}
    assert data.position.attrs["units"] == "m"
    assert data.position.values[-1] == pytest.approx(sim.grains.position, abs=1e-6 * 1e-8 * 20)
    assert len(set(data.cluster.values[-1].tolist())) == 2
    assert list(run.to_pandas()["total"]) == list(sim.ledger["total"])


@pytest.mark.compiled("fields")
@pytest.mark.parametrize(("form", "files"), [("xyz", 1), ("lammps-dump", 1), ("lammps-data", 6), ("vtk", 7)])
def test_the_export_command(finished_run, tmp_path, capsys, form, files):
    """The announced number of files; existing files are kept without --overwrite; slices choose frames."""
    folder, _ = finished_run
    stem = str(tmp_path / "out")
    assert main(["export", str(folder), "--to", form, "--out", stem, "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["files"]) == files == len(list(tmp_path.iterdir()))
    assert main(["export", str(folder), "--to", form, "--out", stem]) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert main(["export", str(folder), "--to", form, "--out", stem, "--overwrite", "--frames", "-1"]) == 0


def test_folders_without_a_run(tmp_path):
    """A missing folder, and one without a run."""
    for path, message in ((tmp_path / "none", "no folder"), (tmp_path, "not the folder of a run")):
        with pytest.raises(sand.BadInput, match=message):
            sand.open(path)
    (tmp_path / "case.toml").write_text("")
    with pytest.raises(sand.BadInput, match="wait until its run has written a frame"):
        sand.open(tmp_path)


@pytest.mark.compiled("fields")
def test_picture_of_a_frame(run_in_field):
    """`sand.open(DIR).picture()` is the still of a frame, with the field of the case."""
    run = sand.open(run_in_field)
    np.testing.assert_allclose(run.flux_density(0.0), [0.0, 0.0, 1e-3])
    picture = run.picture(0, colour="field_alignment", size=(300, 200))
    assert "B" in [text.get_text() for axes in picture.axes for text in axes.texts]
    assert picture._repr_png_()[:4] == b"\x89PNG"
    assert "t = 0 s" in [text.get_text() for text in picture.texts]


def counted(monkeypatch):
    """Numbers of the frames that are read from now on."""
    read, whole = [], sand.io.trajectory.Frame

    def frame(stored):
        one = whole(stored)
        read.append(one.step // 10)
        return one

    monkeypatch.setattr("sand.io.trajectory.Frame", frame)
    return read


def test_arrays_of_frames_are_read_on_access(tmp_path, monkeypatch):
    """`frames.position` reads only the frames that an index, slice or conversion names, in any combination."""
    path = write_trajectory(tmp_path / "trajectory.gsd", [[]] * 30, 4)
    frames = sand.io.trajectory.Frames(path)
    whole = np.array([frame.position for frame in frames])
    read = counted(monkeypatch)
    position = frames.position
    late = position[-10:]
    assert (len(position), len(late), len(late[::3]), read) == (30, 10, 4, [])
    assert (position[7] == whole[7]).all() and (late[-1] == whole[29]).all()
    assert read == [7, 29]
    read.clear()
    assert (np.asarray(late[::3]) == whole[20::3]).all() and read == [20, 23, 26, 29]
    read.clear()
    assert (position[5:8, 2] == whole[5:8, 2]).all() and (position[3, :, 1] == whole[3, :, 1]).all()
    assert read == [5, 6, 7, 3]
    assert (np.asarray(frames.arrays("radius")) == [frame.radius for frame in frames]).all()
    assert repr(late) == "<position of 10 frames, read on access>"
    assert repr(frames) == f"<30 frames of {path}, t = 0 s to 29 ps>"
    assert repr(frames[3]) == "<frame at t = 3 ps, step 30: 4 grains, 0 contacts>"
    with pytest.raises(sand.BadInput, match="there are 10 frames, from 0 to 9"):
        late[10]
    with pytest.raises(AttributeError, match="frames have no 'positions'; did you mean 'position'"):
        frames.positions  # noqa: B018
    with pytest.raises(sand.BadInput, match="no array 'time'"):
        frames.arrays("time")


def test_arrays_of_different_lengths(tmp_path):
    """Contacts differ in number from frame to frame: each array is read, but not all as one."""
    frames = sand.io.trajectory.Frames(write_trajectory(tmp_path / "trajectory.gsd", [[], [(0, 1)]], 2))
    assert [len(force) for force in frames.force] == [0, 1]
    with pytest.raises(sand.BadInput, match="force: frames differ in the number of entries"):
        np.asarray(frames.force)


def runs_in(folder, seeds, outcome="finished"):
    """Folders of runs with two frames, a ledger and a summary; that of the last seed is still running."""
    for seed in seeds:
        place = folder / f"seed-{seed}"
        place.mkdir()
        write_trajectory(place / "trajectory.gsd", [[], [(0, 1)]], 4)
        (place / "case.toml").write_text(f"[run]\nseed = {seed}\n")
        names = ["step", "time", "contacts", "mean_cluster_size", *([] if seed == 1 else ["charges"])]
        rows = [[0, 0.0, 0, 1.0], [10, 1e-12 * seed, 1, 1.5]]
        lines = [",".join(map(repr, [*row, 0.5][: len(names)])) for row in rows]
        (place / "ledger.csv").write_text("\n".join([",".join(names), *lines]) + "\n")
        last = dict(zip(names, rows[1], strict=False)) | {"seed": seed, "grains": 4, "outcome": outcome}
        if seed != seeds[-1]:
            write_json(place / "summary.json", sealed(last))


def test_many_runs(tmp_path, monkeypatch):
    """Several folders, a list or a pattern: rows in the order of the seeds, ledgers one below the other."""
    monkeypatch.chdir(tmp_path)
    runs_in(tmp_path, [1, 2, 10])
    (tmp_path / "seed-file").write_text("")
    names = ["seed-1", "seed-2", "seed-10"]
    for runs in (sand.open(*names), sand.open(names), sand.open("seed-*"), sand.open(tmp_path / "seed-1", *names[1:])):
        assert [run.folder.name for run in runs] == names and len(runs) == 3
    assert len(sand.open(["seed-1"])) == 1 and len(sand.open(names)[1:]) == 2
    assert sand.open("seed-1").folder.name == runs[0].folder.name
    table = runs.summary()
    assert table["seed"].tolist() == [1, 2, 10] and table["time"].tolist() == [1e-12, 2e-12, 1e-11]
    assert table["outcome"].tolist() == ["finished", "finished", "running"] and table["grains"].tolist() == [4] * 3
    assert "charges" not in runs.ledger and runs.ledger["run"].tolist() == [0, 0, 1, 1, 2, 2]
    assert runs.ledger["time"].tolist() == [0, 1e-12, 0, 2e-12, 0, 1e-11]
    lines = repr(sand.open(names)).splitlines()
    assert lines[0] == "<3 runs>" and lines[1].split()[:3] == ["folder", "seed", "grains"]
    assert lines[4].split() == ["seed-10", "10", "4", "10", "ps", "1.5", "1", "running"]


def test_missing_runs_are_named_together(tmp_path, monkeypatch):
    """One line for each folder that holds no run; a pattern that fits nothing."""
    monkeypatch.chdir(tmp_path)
    runs_in(tmp_path, [1])
    (tmp_path / "empty").mkdir()
    with pytest.raises(sand.BadInput) as error:
        sand.open("seed-1", "nowhere", "empty")
    first, second = str(error.value).splitlines()
    assert first == "there is no folder nowhere" and second.startswith("empty is not the folder of a run")
    with pytest.raises(sand.BadInput, match=r"no folder has a name like box-\*"):
        sand.open("box-*")
    with pytest.raises(sand.BadInput, match="there is no folder of a run"):
        sand.open([])


def test_tables_become_data_frames(tmp_path, monkeypatch):
    """Ledger, contacts and ledgers of many runs in pandas; without pandas one line says how to get it."""
    pandas = pytest.importorskip("pandas", reason="pandas is in the test extra")
    runs_in(tmp_path, [1, 2])
    runs = sand.open([tmp_path / "seed-1", tmp_path / "seed-2"])
    assert list(runs.to_pandas()["run"]) == [0, 0, 1, 1] and list(runs.summary().to_pandas()["seed"]) == [1, 2]
    assert list(runs[0].ledger.to_pandas()["time"]) == list(runs[0].to_pandas()["time"]) == [0, 1e-12]
    contacts = runs[0].contacts().to_pandas()
    assert isinstance(contacts, pandas.DataFrame)
    assert list(contacts.columns) == ["grain1", "grain2", "overlap", "formed", "force_x", "force_y", "force_z"]
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(sand.BadInput, match="to_pandas needs pandas, which is not installed: pip install pandas"):
        runs.to_pandas()
