"""Results of a run opened with `sand.open`, their export, and unreadable folders."""

import json

import numpy as np
import pytest

import sand
from sand.cli.main import main


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


@pytest.mark.compiled("fields")
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--to", "vtk", "--frames", "a:b"], "--frames"),
        (["--to", "vtk", "--frames", "50:60"], "no frame"),
        (["--to", "xyz", "--out", "/nowhere/at/all"], "no folder"),
        (["--to", "pdb"], "pdb"),
    ],
)
def test_wrong_arguments_of_export(finished_run, capsys, words, message):
    """One line, exit code 2."""
    assert main(["export", str(finished_run[0]), *words]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert message in lines[0]


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
