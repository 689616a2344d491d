"""A disk that fills up at any write of a run, and folders that disappear: no data are lost, one clear message."""

import contextlib
import shutil
import subprocess
import sys

import pytest

import sand
from sand.cli.main import main
from sand.io.ledger_table import read_ledger
from sand.io.lock import LOCK
from sand.io.trajectory import read_frames

from ..systems import IS_ROOT

try:
    import resource
except ImportError:  # Windows
    resource = None

CASE = """
[run]
until = "2 ns"
frame_every = "0.1 ns"

[box]
periodic = "0.3 um"

[grains]
kind = "gas"
number = 40
radius = "10 nm"
material = "silica"
temperature = "300 K"

[forces.contact]
"""


def content(folder):
    """Ledger and frames, which must equal those of a run on a large enough disk."""
    frames = read_frames(folder / "trajectory.gsd")
    return read_ledger(folder / "ledger.csv"), [(f.step, f.position.tobytes(), f.pair.tobytes()) for f in frames]


@pytest.fixture(scope="module")
def undisturbed_run(tmp_path_factory):
    """Case and folder of a run on a large enough disk."""
    parent = tmp_path_factory.mktemp("room")
    (parent / "case.toml").write_text(CASE)
    assert main(["run", str(parent / "case.toml"), "--out", str(parent / "run"), "--quiet"]) == 0
    return parent / "case.toml", parent / "run"


@contextlib.contextmanager
def file_size_limit(limit):
    """Writes beyond this file size fail, also in compiled code, as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def assert_run_can_be_completed(undisturbed_run, folder):
    """With space again, flushed frames are intact and resuming, or running again, gives the undisturbed result."""
    if list(folder.glob("checkpoint-*.npz")):
        frames, rows = content(folder)[1], content(undisturbed_run[1])[1]
        assert frames == rows[: len(frames)]
        assert main(["resume", str(folder), "--quiet"]) == 0
    else:
        assert main(["run", str(undisturbed_run[0]), "--out", str(folder), "--overwrite", "--quiet"]) == 0
    assert content(folder) == content(undisturbed_run[1])


@pytest.mark.compiled("contacts")
@pytest.mark.skipif(sys.platform != "linux", reason="relies on Linux's limits for files")
@pytest.mark.parametrize(
    "limit",
    [
        *(0, 700, 3000, 20_000, 50_000),
        pytest.param(90_000, marks=pytest.mark.draws),
        pytest.param(120_000, marks=[pytest.mark.draws, pytest.mark.validate]),
    ],
)
def test_writes_beyond_a_file_size_limit(undisturbed_run, tmp_path, capsys, limit):
    """The limit hits the case, ledger, trajectory, checkpoint or figure: one line, no partial file."""
    folder = tmp_path / "run"
    with file_size_limit(limit):
        assert main(["run", str(undisturbed_run[0]), "--out", str(folder), "--quiet"]) == 2
    errors = [line for line in capsys.readouterr().err.splitlines() if "note:" not in line]
    assert len(errors) == 1
    assert "cannot write" in errors[0] and "File too large" in errors[0]
    assert ("sand resume" if list(folder.glob("checkpoint-*.npz")) else "--overwrite") in errors[0]
    assert {path.name for path in folder.glob(".*")} <= {LOCK}
    assert_run_can_be_completed(undisturbed_run, folder)


def passing_grains(out):
    """Two grains that pass each other, with a frame in every step."""
    grains = sand.Grains([[0, 0, 0], [3e-6, 0, 0]], 1e-6, "silica", velocity=[[1.0, 0, 0], [0, 0, 2.0]])
    return sand.Simulation(grains, [sand.Contact()], out=out, stepping=sand.Verlet(step=1e-11), frame_every=1e-11)


@pytest.fixture(scope="module")
def many_frames(tmp_path_factory):
    """The folder of a run of 200 frames on a large enough disk."""
    folder = tmp_path_factory.mktemp("frames") / "whole"
    passing_grains(folder).run(steps=200)
    return folder


@pytest.mark.compiled("contacts")
@pytest.mark.skipif(sys.platform != "linux", reason="relies on Linux's limits for files")
@pytest.mark.parametrize(
    "limit", [120_000, 165_000, *(pytest.param(n, marks=pytest.mark.validate) for n in (150_000, 180_000))]
)
def test_trajectory_index_that_cannot_grow(many_frames, tmp_path, limit):
    """Two grains, 200 frames before the first flush: the index of the GSD file must grow several times.

    GSD itself would continue after a failed growth and write index entries over the first frames; SAND stops it.
    """
    undisturbed_run, sim = many_frames, passing_grains(tmp_path / "run")
    with file_size_limit(limit), pytest.raises(sand.FilesFailed, match="File too large"):
        sim.run(steps=200)
    with pytest.raises(sand.BadInput, match=r"cannot continue.*sand\.resume"):
        sim.run(steps=1)
    before = len(read_frames(tmp_path / "run" / "trajectory.gsd"))
    assert before >= 1
    sand.resume(tmp_path / "run").run()
    assert content(tmp_path / "run") == content(undisturbed_run)


@pytest.mark.compiled("contacts")
def test_a_folder_removed_during_a_run(undisturbed_run, tmp_path):
    """One line with the folder's name, exit code 2, no traceback."""
    script = (
        "import shutil, sys, sand; from sand.cli.main import main; from sand.simulation.ledger import Ledger\n"
        "plain, seen = Ledger.add, []\n"
        "def add(self, row, with_frame=False):\n"
        "    seen.append(row)\n"
        "    if len(seen) == 5: shutil.rmtree(sys.argv[2])\n"
        "    return plain(self, row, with_frame)\n"
        "Ledger.add = add\n"
        "sys.exit(main(['run', sys.argv[1], '--out', sys.argv[2], '--quiet']))\n"
    )
    job = subprocess.run(
        [sys.executable, "-c", script, str(undisturbed_run[0]), str(tmp_path / "run")], capture_output=True, text=True
    )
    assert job.returncode == 2, job.stderr
    assert f"cannot write {tmp_path / 'run'}" in job.stderr
    assert "No such file or directory" in job.stderr
    assert "Traceback" not in job.stderr


def small_disk(parent, kilobytes):
    """A file system of this many kB; skips the test where mounting is not allowed."""
    parent.mkdir(exist_ok=True)
    words = ["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", str(parent)]
    if shutil.which("mount") is None or not IS_ROOT or subprocess.run(words, capture_output=True).returncode:
        pytest.skip("no leave to mount a small file system")


@pytest.mark.validate
@pytest.mark.parametrize("kilobytes", range(4, 420, 4))
def test_a_disk_that_fills_up(undisturbed_run, tmp_path, kilobytes):
    """Disks of 4, 8, 12 … kB, so that each write of the run fails once; then the disk grows."""
    disk = tmp_path / "disk"
    small_disk(disk, kilobytes)
    try:
        words = [sys.executable, "-m", "sand", "run", str(undisturbed_run[0]), "--out", str(disk / "run"), "--quiet"]
        job = subprocess.run(words, capture_output=True, text=True)
        errors = [line for line in job.stderr.splitlines() if "note:" not in line]
        if job.returncode:
            assert job.returncode == 2, job.stderr
            assert len(errors) == 1, job.stderr
            assert "No space left on device" in errors[0]
            assert not [p for p in (disk / "run").glob(".*") if p.name not in (".probe", LOCK)]
        subprocess.run(["mount", "-o", "remount,size=4m", str(disk)], check=True)
        assert_run_can_be_completed(undisturbed_run, disk / "run")
    finally:
        subprocess.run(["umount", "-l", str(disk)], check=True)  # an earlier simulation may keep its file open
