"""A file system that fills up at any write of a run, and folders that vanish: nothing is lost, one clear message."""

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
    """What must be the same as if the disk had been large enough."""
    frames = read_frames(folder / "trajectory.gsd")
    return read_ledger(folder / "ledger.csv"), [(f.step, f.position.tobytes(), f.pair.tobytes()) for f in frames]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Case and folder of a run with room enough."""
    place = tmp_path_factory.mktemp("room")
    (place / "case.toml").write_text(CASE)
    assert main(["run", str(place / "case.toml"), "--out", str(place / "run"), "--quiet"]) == 0
    return place / "case.toml", place / "run"


@contextlib.contextmanager
def no_file_longer_than(limit):
    """A write that would make a file longer fails, in compiled code, too, as it does on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def gone_on(whole, folder):
    """After the disk has room again: what was flushed is there; the run goes on, or starts again, to the same end."""
    if list(folder.glob("checkpoint-*.npz")):
        frames, rows = content(folder)[1], content(whole[1])[1]
        assert frames == rows[: len(frames)]
        assert main(["resume", str(folder), "--quiet"]) == 0
    else:
        assert main(["run", str(whole[0]), "--out", str(folder), "--overwrite", "--quiet"]) == 0
    assert content(folder) == content(whole[1])


@pytest.mark.compiled("contacts")
@pytest.mark.skipif(sys.platform != "linux", reason="relies on Linux's limits for files")
@pytest.mark.parametrize(
    "limit", [0, 700, 3000, 20_000, 50_000, *(pytest.param(n, marks=pytest.mark.draws) for n in (90_000, 120_000))]
)
def test_files_that_cannot_grow(whole, tmp_path, capsys, limit):
    """Limits hit the case, the ledger, the trajectory, checkpoints and the figure: one line, nothing half written."""
    folder = tmp_path / "run"
    with no_file_longer_than(limit):
        assert main(["run", str(whole[0]), "--out", str(folder), "--quiet"]) == 2
    said = [line for line in capsys.readouterr().err.splitlines() if "note:" not in line]
    assert len(said) == 1
    assert "cannot write" in said[0] and "File too large" in said[0]
    assert ("sand resume" if list(folder.glob("checkpoint-*.npz")) else "--overwrite") in said[0]
    assert {path.name for path in folder.glob(".*")} <= {LOCK}
    gone_on(whole, folder)


def flying(out):
    """Two grains that fly past each other, with a frame in every step."""
    grains = sand.Grains([[0, 0, 0], [3e-6, 0, 0]], 1e-6, "silica", velocity=[[1.0, 0, 0], [0, 0, 2.0]])
    return sand.Simulation(grains, [sand.Contact()], out=out, stepping=sand.Verlet(step=1e-11), frame_every=1e-11)


@pytest.fixture(scope="module")
def many_frames(tmp_path_factory):
    """The folder of a run of 200 frames with room enough."""
    folder = tmp_path_factory.mktemp("frames") / "whole"
    flying(folder).run(steps=200)
    return folder


@pytest.mark.compiled("contacts")
@pytest.mark.skipif(sys.platform != "linux", reason="relies on Linux's limits for files")
@pytest.mark.parametrize(
    "limit", [120_000, 165_000, *(pytest.param(n, marks=pytest.mark.validate) for n in (150_000, 180_000))]
)
def test_many_small_frames(many_frames, tmp_path, limit):
    """Two grains, 200 frames before the first flush: the index must be lengthened several times over.

    GSD goes on where it cannot lengthen its index, and writes entries over the first frames; it is not let.
    """
    whole, sim = many_frames, flying(tmp_path / "run")
    with no_file_longer_than(limit), pytest.raises(sand.FilesFailed, match="File too large"):
        sim.run(steps=200)
    with pytest.raises(sand.BadInput, match=r"cannot continue.*sand\.resume"):
        sim.run(steps=1)
    before = len(read_frames(tmp_path / "run" / "trajectory.gsd"))
    assert before >= 1
    sand.resume(tmp_path / "run").run()
    assert content(tmp_path / "run") == content(whole)


@pytest.mark.compiled("contacts")
def test_a_folder_that_vanishes(whole, tmp_path):
    """Removed while the run goes on: told, with the folder's name, exit code 2; no traceback."""
    script = (
        "import shutil, sys, sand; from sand.cli.main import main; from sand.simulation.ledger import Ledger\n"
        "plain, seen = Ledger.add, []\n"
        "def add(self, row):\n"
        "    seen.append(row)\n"
        "    if len(seen) == 5: shutil.rmtree(sys.argv[2])\n"
        "    return plain(self, row)\n"
        "Ledger.add = add\n"
        "sys.exit(main(['run', sys.argv[1], '--out', sys.argv[2], '--quiet']))\n"
    )
    job = subprocess.run(
        [sys.executable, "-c", script, str(whole[0]), str(tmp_path / "run")], capture_output=True, text=True
    )
    assert job.returncode == 2, job.stderr
    assert f"cannot write {tmp_path / 'run'}" in job.stderr
    assert "No such file or directory" in job.stderr
    assert "Traceback" not in job.stderr


def small_disk(place, kilobytes):
    """A file system of its own, of so many kB; skips the test where that is not allowed."""
    place.mkdir(exist_ok=True)
    words = ["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", str(place)]
    if shutil.which("mount") is None or not IS_ROOT or subprocess.run(words, capture_output=True).returncode:
        pytest.skip("no leave to mount a small file system")


@pytest.mark.validate
@pytest.mark.parametrize("kilobytes", range(4, 420, 4))
def test_a_disk_that_fills_up(whole, tmp_path, kilobytes):
    """A disk of 4, 8, 12 … kB, so that each write of the run is the one that fails; then the disk grows."""
    disk = tmp_path / "disk"
    small_disk(disk, kilobytes)
    try:
        words = [sys.executable, "-m", "sand", "run", str(whole[0]), "--out", str(disk / "run"), "--quiet"]
        job = subprocess.run(words, capture_output=True, text=True)
        said = [line for line in job.stderr.splitlines() if "note:" not in line]
        if job.returncode:
            assert job.returncode == 2, job.stderr
            assert len(said) == 1, job.stderr
            assert "No space left on device" in said[0]
            assert not [p for p in (disk / "run").glob(".*") if p.name not in (".probe", LOCK)]
        subprocess.run(["mount", "-o", "remount,size=4m", str(disk)], check=True)
        gone_on(whole, disk / "run")
    finally:
        subprocess.run(["umount", "-l", str(disk)], check=True)  # a simulation may hold its file
