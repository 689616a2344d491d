"""One writer for a folder: a lock that the system releases when the process ends, however it ends.

The lock file stays in the folder. Removing it would let two processes hold locks of two files of one name; it holds
the number of the process that had the lock last, which is looked at only while the lock is held. Reading needs no lock.
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
LOOKS, LOOKING = 5, 0.1
"""How often the number of a process is looked for, and within which time [s]."""


class FolderLock:
    """The right to write to a folder, held from now to `release` or to the end of the process.

    Parameters
    ----------
    folder : Path
        there already.
    told : bool, optional
        whether the number of this process is written to the lock file, for those who are refused.

    Raises
    ------
    BadInput
        another process holds it, or another simulation of this one.
    FilesFailed
        the folder has vanished, or nothing can be written there.

    Where the file system knows no locks (some network file systems), it is granted with a warning.
    """

    def __init__(self, folder: Path, *, told: bool = True):
        from filelock import FileLock, Timeout

        path = folder / LOCK
        self._lock: Any = None
        if not folder.is_dir():  # the library would make it
            raise FilesFailed(f"cannot write to folder {folder}: there is no such folder")
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
                f"the file system of {folder} has no locks: see that no other process writes to that folder",
                stacklevel=3,
            )
            return
        self._lock, self._process = lock, os.getpid()
        if not told:
            return
        with contextlib.suppress(OSError), open(path, "r+b", buffering=0) as file:  # on a full disk it does without
            file.seek(1)  # the first byte is what is locked; Windows lets nobody else read or write it
            file.write(f"{os.getpid():<20}\n".encode())

    def release(self) -> None:
        """Let others write to the folder; a second time, and in a process that was forked off, it does nothing."""
        lock, self._lock = self._lock, None
        if lock is not None and self._process == os.getpid():
            lock.release()


def _is_full(error: BaseException) -> bool:
    """True where a file could not be made, rather than locked."""
    import errno

    full = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG, errno.ENOENT, errno.ENOTDIR)
    return isinstance(error, OSError) and error.errno in full


def _holder(folder: Path) -> int | None:
    """The number of the process in a lock file; None where it cannot be read, also a moment later."""
    for _ in range(LOOKS):
        with contextlib.suppress(OSError, ValueError), open(folder / LOCK, "rb", buffering=0) as file:
            file.seek(1)
            return int(file.read(32))
        time.sleep(LOOKING / LOOKS)  # it may just be being written
    return None


def _in_use(folder: Path) -> str:
    """What to say of a folder whose lock another one holds."""
    number = _holder(folder)
    if number is None:
        return f"another process writes to {folder}; wait until it has ended, or give another folder"
    if number == os.getpid():
        return f"another simulation of this process (pid {number}) writes to {folder}; give each a folder of its own"
    return f"another process (pid {number}) writes to {folder}; wait until it has ended, or give another folder"


@contextlib.contextmanager
def writing(folder: Path) -> Iterator[None]:
    """The lock of a folder for the block; see `FolderLock` for what is raised."""
    lock = FolderLock(folder)
    try:
        yield
    finally:
        lock.release()


def refuse_locked(folder: Path) -> None:
    """Raises BadInput if another process, or another simulation of this one, writes to a folder with a lock file."""
    with contextlib.suppress(FilesFailed):
        FolderLock(folder, told=False).release()
