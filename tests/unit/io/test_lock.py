"""One writer per folder: others are refused in one line; the lock ends with its process."""

import errno
import subprocess
import sys
import warnings

import pytest

import sand
from sand.basics.errors import FilesFailed
from sand.cli.main import main
from sand.io import lock as lock_files
from sand.io.lock import LOCK, FolderLock, writing
from sand.io.run_folder import make_folder
from sand.simulation.observers import Observer

from ...physics.setups import struck_chain

HOLD = (
    "import sys; from pathlib import Path; from sand.io.lock import FolderLock\n"
    "held = FolderLock(Path(sys.argv[1])); print('held', flush=True); sys.stdin.read()\n"
)


@pytest.fixture
def locked_folder(tmp_path):
    """A folder with a file, locked by another process; and that process."""
    (tmp_path / "case.toml").write_text("")
    job = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert job.stdout.readline() == "held\n"
    yield tmp_path, job
    job.kill()
    job.communicate()


def test_the_lock_names_its_process_and_ends_with_it(locked_folder):
    """Refused with the process id; when the process is killed the system releases the lock."""
    folder, job = locked_folder
    for _ in range(2):
        with pytest.raises(sand.BadInput, match=rf"another process \(pid {job.pid}\) writes to {folder}"):
            FolderLock(folder)
    job.kill()
    job.wait()
    with writing(folder):
        pass


@pytest.mark.parametrize(
    "words",
    [["resume"], ["run", "CASE", "--out"], ["run", "CASE", "--overwrite", "--out"], ["scatter", "CASE", "--out"]],
)
def test_commands_refuse_a_locked_folder(locked_folder, tmp_path, capsys, words):
    """Exit code 2, one line; the files are unchanged."""
    folder, job = locked_folder
    case = tmp_path.parent / f"{tmp_path.name}.toml"
    if words[0] == "run":
        case.write_text(
            '[run]\nuntil = "1 ns"\n[box]\nperiodic = "1 um"\n[grains]\nkind = "gas"\nnumber = 2\nradius = "10 nm"\n'
            'material = "silica"\ntemperature = "1 K"\n[forces.contact]\n'
        )
    else:
        case.write_text(
            '[projectile]\nradius = "10 nm"\nmaterial = "iron"\n[flight]\nspeed = "1 m/s"\nstart = "100 nm"\n'
            '[measure]\njob = "trajectories"\nimpact_parameters = ["0 nm"]\n'
        )
    (folder / "checkpoint-000000000000001.npz").write_bytes(b"")
    assert main([*(str(case) if word == "CASE" else word for word in words), str(folder)]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1 and f"another process (pid {job.pid}) writes to {folder}" in lines[0]
    assert sorted(path.name for path in folder.iterdir()) == [LOCK, "case.toml", "checkpoint-000000000000001.npz"]


def test_a_released_lock_file_is_no_run(tmp_path):
    """The lock file stays with a process id that means nothing; the folder counts as empty."""
    with writing(tmp_path), pytest.raises(sand.BadInput, match="another simulation of this process"):
        make_folder(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [LOCK]
    assert make_folder(tmp_path) == tmp_path
    (tmp_path / LOCK).write_text("\n4194305\n")
    with writing(tmp_path):
        pass


def test_double_release_and_removed_folder(tmp_path):
    """The first is no error; the second is one line, and the folder is not created again."""
    one = FolderLock(tmp_path)
    one.release()
    other = FolderLock(tmp_path)
    one.release()
    with pytest.raises(sand.BadInput):
        FolderLock(tmp_path)
    other.release()
    with pytest.raises(FilesFailed, match="no such folder"):
        FolderLock(tmp_path / "gone")
    assert not (tmp_path / "gone").exists()


def test_without_locks_a_run_goes_on_with_a_warning(tmp_path, monkeypatch):
    """A network file system without locks gives a warning; a full disk is an error."""
    import filelock

    for number, raised in ((errno.ENOLCK, False), (errno.ENOSYS, False), (errno.ENOSPC, True)):

        def fails(self, number=number):
            raise OSError(number, "as it is there")

        monkeypatch.setattr(filelock.FileLock, "_acquire", fails)
        if raised:
            with pytest.raises(FilesFailed, match="cannot write"):
                FolderLock(tmp_path)
        else:
            with pytest.warns(UserWarning, match="has no locks: make sure that no other process"):
                FolderLock(tmp_path).release()


def test_without_locks_an_earlier_process_of_the_same_pid_has_ended(tmp_path, monkeypatch):
    """In a container, each start may have the same pid and name: a job that was killed can be resumed by the next."""
    import filelock

    def fails(self):
        raise OSError(errno.ENOLCK, "as it is there")

    monkeypatch.setattr(filelock.FileLock, "_acquire", fails)
    with pytest.warns(UserWarning, match="has no locks"):
        first = FolderLock(tmp_path)
    with pytest.raises(sand.BadInput, match="another simulation of this process"):
        FolderLock(tmp_path)
    name = (tmp_path / LOCK).read_bytes()
    first.release()
    (tmp_path / LOCK).write_bytes(name[:-8] + b"0123456\n")  # of an earlier process
    with pytest.warns(UserWarning, match="has no locks"):
        second = FolderLock(tmp_path)
    assert second.is_held
    second.release()


def test_an_unreadable_process_id(locked_folder, monkeypatch):
    """As on Windows, or while it is being written: the line omits it."""
    monkeypatch.setattr(lock_files, "LOCK", LOCK)
    (locked_folder[0] / LOCK).write_bytes(b"")
    with pytest.raises(sand.BadInput, match="another process writes to"):
        FolderLock(locked_folder[0])


class CompetingWriter(Observer):
    """Tries to write to the folder of a run while it runs."""

    def __init__(self, folder):
        self.folder, self.messages = folder, []

    def see(self, simulation, row):
        if self.messages:
            return
        for attempt in (
            lambda: sand.resume(self.folder),
            lambda: sand.Simulation(simulation.start, simulation.forces, out=self.folder, overwrite=True),
        ):
            with pytest.raises(sand.BadInput) as error:
                attempt()
            self.messages.append(str(error.value))


@pytest.mark.filterwarnings("ignore:grains overlap too deeply")
@pytest.mark.compiled("contacts")
def test_simulations_of_one_process(tmp_path):
    """While one runs no other writes to its folder; afterwards another may, and the first is refused."""
    folder, setup = tmp_path / "run", struck_chain()
    first = sand.Simulation(setup.grains, setup.forces, out=folder, frame_every="0.1 ns")
    late = sand.Simulation(setup.grains, setup.forces, out=folder, frame_every="0.1 ns")
    first.run(until="0.1 ns")
    others = CompetingWriter(folder)
    first.observers.append(others)
    first.run(until="0.2 ns")
    assert len(others.messages) == 2 and all(
        "another simulation of this process" in message for message in others.messages
    )
    with pytest.raises(sand.BadInput, match=r"another run has written to .*give another folder"):
        late.run(until="0.1 ns")
    again, never = sand.resume(folder), sand.resume(folder)
    again.run(until="0.3 ns")
    for old in (first, never):
        with pytest.raises(sand.BadInput, match=r"another run has written to .*sand\.resume"):
            old.run(until="0.4 ns")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert again.run(until="0.4 ns").outcome is sand.Outcome.FINISHED
        assert [row["step"] for row in again.ledger.rows] == sand.open(folder).ledger["step"].tolist()
    with pytest.raises(sand.BadInput, match="another run"):  # refused twice
        first.run(until="0.4 ns")


def test_a_shared_folder_may_be_locked_for_a_moment(tmp_path):
    """Processes that share a folder wait for each other when they write; other jobs refuse a folder in use."""
    with writing(tmp_path):
        assert make_folder(tmp_path, shared=True) == tmp_path
        with pytest.raises(sand.BadInput, match="writes to"):
            make_folder(tmp_path)
