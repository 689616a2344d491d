"""File modes, folder sync and disk space, where Linux, Windows and macOS differ."""

import errno
import os
import shutil
import stat
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import sand
from sand.basics.errors import FilesFailed
from sand.experiments.executors import MOST_ON_WINDOWS, executor_for
from sand.io.bodies import contacts_of
from sand.io.checkpoint import write_checkpoint
from sand.io.gsd_index import reserve_space
from sand.io.ledger_table import LedgerFile
from sand.io.run_folder import make_folder, replace_file, write_json
from sand.io.trajectory import TrajectoryWriter, read_frames

from ...systems import keeps_modes

GRAINS = sand.Grains([[0, 0, 0], [3e-6, 0, 0]], 1e-6, "silica")


def add_frame(writer, step):
    writer.write(step, 1e-9 * step, GRAINS, sand.Box.open(), contacts_of(GRAINS))


@keeps_modes
@pytest.mark.parametrize("mask", [0o022, 0o027, 0o077])
def test_all_files_of_a_run_have_the_same_mode(tmp_path, mask):
    """Each has 0666 minus the umask; GSD itself would use 0660."""
    before = os.umask(mask)
    try:
        writer = TrajectoryWriter(tmp_path / "trajectory.gsd")
        add_frame(writer, 0)
        writer.close()
        LedgerFile(tmp_path / "ledger.csv", ["step"])
        write_json(tmp_path / "summary.json", {})
        write_checkpoint(tmp_path, {"clock": np.zeros(3)}, {"steps": 1})
    finally:
        os.umask(before)
    modes = {path.name: stat.S_IMODE(path.stat().st_mode) for path in tmp_path.iterdir()}
    assert len(modes) == 4
    assert set(modes.values()) == {0o666 & ~mask}, modes


def test_a_closed_trajectory_is_reopened_for_the_next_frame(tmp_path):
    """Between runs the file is closed, so that Windows can move or remove it; no frame is lost."""
    writer = TrajectoryWriter(tmp_path / "trajectory.gsd")
    for step in range(4):
        add_frame(writer, step)
        writer.close()
        writer.flush(sync=True)
    assert [frame.step for frame in read_frames(tmp_path / "trajectory.gsd")] == [0, 1, 2, 3]
    (tmp_path / "trajectory.gsd").unlink()
    with pytest.raises(FilesFailed, match=r"cannot write .*trajectory\.gsd"):
        add_frame(writer, 4)
    assert not (tmp_path / "trajectory.gsd").exists()


@pytest.mark.parametrize("code", [errno.EINVAL, errno.EBADF, errno.EACCES])
def test_folders_that_cannot_be_synced(tmp_path, monkeypatch, code):
    """Some file systems refuse to sync a folder; the file is written all the same."""
    plain = os.fsync

    def sync(number):
        if stat.S_ISDIR(os.fstat(number).st_mode):
            raise OSError(code, os.strerror(code))
        plain(number)

    monkeypatch.setattr(os, "fsync", sync)
    replace_file(tmp_path / "a.json", b"{}")
    assert (tmp_path / "a.json").read_bytes() == b"{}"


def test_folders_that_cannot_be_opened(tmp_path, monkeypatch):
    """Windows opens no folder: the file is written all the same."""
    plain = os.open

    def opened(path, *words, **options):
        if os.path.isdir(path):
            raise PermissionError(errno.EACCES, "Permission denied")
        return plain(path, *words, **options)

    monkeypatch.setattr(os, "open", opened)
    replace_file(tmp_path / "a.json", b"{}")
    assert (tmp_path / "a.json").read_bytes() == b"{}"


def test_a_disk_error_is_raised(tmp_path, monkeypatch):
    """EIO during the sync of a folder is an error of the disk."""
    plain = os.fsync

    def sync(number):
        if not stat.S_ISREG(os.fstat(number).st_mode):
            raise OSError(errno.EIO, "Input/output error")
        plain(number)

    monkeypatch.setattr(os, "fsync", sync)
    if os.name != "nt":
        with pytest.raises(FilesFailed, match="Input/output error"):
            replace_file(tmp_path / "a.json", b"{}")


def test_a_full_disk_without_posix_fallocate(tmp_path, monkeypatch):
    """macOS and Windows lack it: the free space of the disk is checked instead."""
    writer = TrajectoryWriter(tmp_path / "trajectory.gsd")
    add_frame(writer, 0)
    writer.close()
    size = (tmp_path / "trajectory.gsd").stat().st_size
    monkeypatch.delattr(os, "posix_fallocate", raising=False)
    reserve_space(tmp_path / "trajectory.gsd", 40, 1000)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(total=100, used=90, free=10))
    with pytest.raises(OSError, match="No space left") as error:
        reserve_space(tmp_path / "trajectory.gsd", 40, 1000)
    assert error.value.errno == errno.ENOSPC
    assert (tmp_path / "trajectory.gsd").stat().st_size == size


def test_overwriting_a_run_that_is_open_elsewhere(tmp_path, monkeypatch):
    """Windows removes no open file: then no other file is removed either."""
    names = {"case.toml", "trajectory.gsd", "summary.json"}
    for name in names:
        (tmp_path / name).write_text("# Written by SAND: a run\n", encoding="utf-8")
    plain = os.unlink

    def unlink(path, *words, **options):
        if str(path).endswith(".gsd"):
            raise PermissionError(errno.EACCES, "The process cannot access the file")
        plain(path, *words, **options)

    monkeypatch.setattr(os, "unlink", unlink)
    with pytest.raises(FilesFailed, match="cannot access the file"):
        make_folder(tmp_path, overwrite=True)
    assert names <= {path.name for path in tmp_path.iterdir()}


def test_too_many_processes_for_windows(monkeypatch):
    """BadInput with one line, where `concurrent.futures` raises ValueError."""
    monkeypatch.setattr(sys, "platform", "win32")
    with pytest.raises(sand.BadInput, match="at most 61"), executor_for(MOST_ON_WINDOWS + 1):
        pass
