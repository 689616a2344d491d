"""A lock that gives one process the right to write to a folder; the system releases it when the process ends.

The lock file stays in the folder: removing it would let two processes lock two files of the same name. It names
the process that had the lock last, which is valid only while the lock is held. Reading needs no lock.
"""

from __future__ import annotations

import contextlib
import os
import platform
import secrets
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..basics.errors import BadInput, FilesFailed

LOCK = ".lock"
"""The lock file in a folder."""
CLAIM = ".claim"
"""File in the folder of a run of a sweep that is locked by who computes it."""
READ_ATTEMPTS, READ_SECONDS = 5, 0.1
"""Attempts to read the pid in a lock file, and the time [s] for all of them."""
_written: set[str] = set()
"""What this process has written to the lock files of folders that it holds, where there are no locks."""


class FolderLock:
    """The exclusive right to write to a folder, until `release` or the end of the process.

    Where the file system has no locks (some network file systems), the right is granted with a warning, unless the lock
    file names a process of this machine that runs. `is_held` tells whether another process has taken the folder since.

    Parameters
    ----------
    folder : Path
        An existing folder.
    write_pid : bool, optional
        Whether this process is named in the lock file: its pid, machine, and a random number.
    patience : float, optional
        Longest wall time [s] to wait for another process.
    name : str, optional
        Name of the lock file.

    Raises
    ------
    BadInput
        If another process, or another simulation of this process, holds the lock.
    FilesFailed
        If the folder does not exist, or nothing can be written to it.
    """

    def __init__(self, folder: Path, *, write_pid: bool = True, patience: float = 0.0, name: str = LOCK):
        from filelock import FileLock, Timeout

        self._path, self._process = folder / name, os.getpid()
        self._lock: Any = None
        self._name = ""  # what this process has written to the lock file
        if not folder.is_dir():  # filelock would create it
            raise FilesFailed(f"cannot write to folder {folder}: there is no such folder")
        if self._path.is_symlink():
            raise BadInput(f"{self._path} is a link, through which a file elsewhere would be changed; remove it")
        lock: Any = FileLock(self._path, timeout=patience, thread_local=False, fallback_to_soft=False)
        try:
            lock.acquire()
        except Timeout:
            raise BadInput(_in_use(folder)) from None
        except PermissionError as error:
            raise FilesFailed(f"cannot write to folder {folder}: {error.strerror}") from error
        except (OSError, NotImplementedError) as error:
            if _is_full(error):
                raise FilesFailed(f"cannot write to folder {folder}: {os.strerror(error.errno)}") from error  # type: ignore[union-attr,arg-type]
            self._without_locks(folder, patience)
        else:
            self._lock = lock
        if write_pid and not (self._path.exists() and self._path.stat().st_nlink > 1):  # in a copy by hard links, too
            self._name = f"{os.getpid():<20} {platform.node() or '-'} {secrets.token_hex(8)}\n"
            self._write(self._name)
            if self._lock is None:
                _written.add(self._name)

    def _without_locks(self, folder: Path, patience: float) -> None:
        """Warn that there are no locks.  Raises BadInput if a process of this machine writes to the folder."""
        end = time.monotonic() + patience
        while _runs_here(folder):
            if time.monotonic() >= end:
                raise BadInput(_in_use(folder))
            time.sleep(READ_SECONDS)
        warnings.warn(
            f"the file system of {folder} has no locks: make sure that no other process writes to that folder",
            stacklevel=4,
        )

    def _write(self, name: str) -> None:
        """Write to the lock file after its first byte, which is locked: on Windows others could not read it."""
        mode = "r+b" if self._path.exists() else "w+b"
        with contextlib.suppress(OSError), open(self._path, mode, buffering=0) as file:  # a full disk does no harm
            file.seek(1)
            file.write(name.encode())
            file.truncate()

    @property
    def is_held(self) -> bool:
        """Whether no other process has taken the folder; always true where there are locks."""
        return self._lock is not None or not self._name or _content(self._path) in (self._name, None)

    def release(self) -> None:
        """Release the lock; has no effect a second time, or in a forked process."""
        lock, self._lock = self._lock, None
        if self._process != os.getpid():
            return
        if lock is not None:
            lock.release()
        elif self._name and self.is_held:  # nothing else tells others that this process has finished
            self._write("\n")
        _written.discard(self._name)
        self._name = ""


def _is_full(error: BaseException) -> bool:
    """Whether the lock file could not be created, as opposed to locked."""
    import errno

    full = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG, errno.ENOENT, errno.ENOTDIR)
    return isinstance(error, OSError) and error.errno in full


def _content(path: Path) -> str | None:
    """The text in a lock file after its first byte; None if it cannot be read."""
    with contextlib.suppress(OSError, UnicodeDecodeError), open(path, "rb", buffering=0) as file:
        file.seek(1)
        return file.read(512).decode()
    return None


def holder(folder: Path, name: str = LOCK) -> int | None:
    """The pid in a lock file, of the process that had the lock last; None if it cannot be read."""
    for _ in range(READ_ATTEMPTS):
        with contextlib.suppress(ValueError, IndexError):
            return int((_content(folder / name) or "").split()[0])
        time.sleep(READ_SECONDS / READ_ATTEMPTS)  # the holder may be writing it
    return None


def _runs_here(folder: Path) -> bool:
    """Whether a lock file names a process of this machine that exists.

    In a container each start may have the same pid and the same name of the machine: an earlier process with those of
    this one has ended, whatever it has left.
    """
    name = _content(folder / LOCK) or ""
    words = name.split()
    if len(words) < 3 or not words[0].isdecimal() or words[1] != (platform.node() or "-"):
        return False
    if os.name == "nt":  # where there are locks, also in shared folders
        return False
    if int(words[0]) == os.getpid():
        return name in _written
    try:
        os.kill(int(words[0]), 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:  # it belongs to somebody else
        pass
    return True


def _in_use(folder: Path) -> str:
    """Error message for a folder whose lock is held."""
    number = holder(folder)
    if number == os.getpid():
        return f"another simulation of this process (pid {number}) writes to {folder}; give each a folder of its own"
    pid = "" if number is None else f" (pid {number})"
    return f"another process{pid} writes to {folder}; wait until it has ended, or give another folder"


@contextlib.contextmanager
def writing(folder: Path, patience: float = 0.0) -> Iterator[None]:
    """Hold the lock of a folder during the block; raises as `FolderLock`."""
    lock = FolderLock(folder, patience=patience)
    try:
        yield
    finally:
        lock.release()


def refuse_locked(folder: Path) -> None:
    """Raise BadInput if another process, or another simulation of this process, writes to a folder."""
    with contextlib.suppress(FilesFailed):
        FolderLock(folder, write_pid=False).release()
