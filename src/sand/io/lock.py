"""A lock that gives one process the right to write to a folder; the system releases it when the process ends.

The lock file stays in the folder: removing it would let two processes lock two files of the same name. It holds the pid
of the process that had the lock last, which is valid only while the lock is held. Reading needs no lock.
"""

from __future__ import annotations

import contextlib
import os
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..errors import BadInput, FilesFailed

LOCK = ".lock"
"""The lock file in a folder."""
READ_ATTEMPTS, READ_SECONDS = 5, 0.1
"""Attempts to read the pid in a lock file, and the time [s] for all of them."""


class FolderLock:
    """The exclusive right to write to a folder, until `release` or the end of the process.

    Where the file system has no locks (some network file systems), the right is granted with a warning.

    Parameters
    ----------
    folder : Path
        An existing folder.
    write_pid : bool, optional
        Whether the pid of this process is written to the lock file, for the messages of other processes.

    Raises
    ------
    BadInput
        If another process, or another simulation of this process, holds the lock.
    FilesFailed
        If the folder does not exist, or nothing can be written to it.
    """

    def __init__(self, folder: Path, *, write_pid: bool = True):
        from filelock import FileLock, Timeout

        path = folder / LOCK
        self._lock: Any = None
        if not folder.is_dir():  # filelock would create it
            raise FilesFailed(f"cannot write to folder {folder}: there is no such folder")
        if path.is_symlink():
            raise BadInput(f"{path} is a link, through which a file elsewhere would be changed; remove it")
        lock = FileLock(path, timeout=0, thread_local=False, fallback_to_soft=False)
        try:
            lock.acquire()
        except Timeout:
            raise BadInput(_in_use(folder)) from None
        except PermissionError as error:
            raise FilesFailed(f"cannot write to folder {folder}: {error.strerror}") from error
        except (OSError, NotImplementedError) as error:
            if _is_full(error):
                raise FilesFailed(f"cannot write to folder {folder}: {os.strerror(error.errno)}") from error  # type: ignore[union-attr,arg-type]
            warnings.warn(
                f"the file system of {folder} has no locks: make sure that no other process writes to that folder",
                stacklevel=3,
            )
            return
        self._lock, self._process = lock, os.getpid()
        if not write_pid or path.stat().st_nlink > 1:  # a copy of the folder by hard links may have it, too
            return
        with contextlib.suppress(OSError), open(path, "r+b", buffering=0) as file:  # a full disk does no harm
            file.seek(1)  # the first byte is locked; on Windows other processes can neither read nor write it
            file.write(f"{os.getpid():<20}\n".encode())

    def release(self) -> None:
        """Release the lock; has no effect a second time, or in a forked process."""
        lock, self._lock = self._lock, None
        if lock is not None and self._process == os.getpid():
            lock.release()


def _is_full(error: BaseException) -> bool:
    """Whether the lock file could not be created, as opposed to locked."""
    import errno

    full = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG, errno.ENOENT, errno.ENOTDIR)
    return isinstance(error, OSError) and error.errno in full


def _holder(folder: Path) -> int | None:
    """The pid in a lock file; None if it cannot be read."""
    for _ in range(READ_ATTEMPTS):
        with contextlib.suppress(OSError, ValueError), open(folder / LOCK, "rb", buffering=0) as file:
            file.seek(1)
            return int(file.read(32))
        time.sleep(READ_SECONDS / READ_ATTEMPTS)  # the holder may be writing it
    return None


def _in_use(folder: Path) -> str:
    """Error message for a folder whose lock is held."""
    number = _holder(folder)
    if number == os.getpid():
        return f"another simulation of this process (pid {number}) writes to {folder}; give each a folder of its own"
    pid = "" if number is None else f" (pid {number})"
    return f"another process{pid} writes to {folder}; wait until it has ended, or give another folder"


@contextlib.contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder during the block; raises as `FolderLock`."""
    lock = FolderLock(folder)
    try:
        yield
    finally:
        lock.release()


def refuse_locked(folder: Path) -> None:
    """Raise BadInput if another process, or another simulation of this process, writes to a folder."""
    with contextlib.suppress(FilesFailed):
        FolderLock(folder, write_pid=False).release()
