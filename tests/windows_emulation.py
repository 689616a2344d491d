"""Emulation of Windows and macOS in Python on Linux.

`become_windows()` removes the names that Python lacks there and changes files: a folder cannot be opened, a file
opened for reading cannot be synced, and a file that this process has open can be neither replaced nor removed.
With `-p tests.windows_emulation` pytest runs any tests in this emulation.
"""

from __future__ import annotations

import builtins
import errno
import os
import signal
import stat
import sys
import time
from collections.abc import Callable
from types import ModuleType
from typing import Any

try:
    import fcntl
except ImportError:
    fcntl = None

OURS = ("sand", "tests", "benchmarks", "hatch_build", "__main__")
"""Packages whose look-ups and imports are refused; others detect the system and have code for Windows."""
MODULES = ("fcntl", "grp", "posix", "pty", "pwd", "resource", "termios", "tty")
NAMES = {
    os: (
        "O_CLOEXEC O_DIRECTORY O_NOFOLLOW O_SYNC chown ctermid fchdir fchmod fchown fdatasync fork forkpty getegid "
        "geteuid getgid getgroups getloadavg getpgid getsid getuid killpg lchown lockf mkfifo mknod nice openpty "
        "posix_fadvise posix_fallocate pread preadv pwrite pwritev sched_getaffinity sched_setaffinity sched_yield "
        "sendfile setsid setuid sync sysconf ttyname uname wait"
    ),
    signal: "SIGALRM SIGHUP SIGKILL SIGPIPE SIGUSR1 SIGUSR2 alarm pause pthread_kill setitimer sigwait",
    time: "tzset",
}
"""Names that Windows lacks; macOS lacks some of them, such as os.sched_getaffinity and os.posix_fallocate."""


def become_windows() -> None:
    """Change this process permanently."""
    for module, names in NAMES.items():
        module.__class__ = _without(frozenset(names.split()))
    builtins.__import__ = _refusing(builtins.__import__)
    os.open = _without_folders(os.open)
    os.fsync = _for_writers(os.fsync)
    for name in ("replace", "rename", "unlink", "remove"):
        setattr(os, name, _of_closed_files(getattr(os, name)))


def _is_ours(module: str) -> bool:
    return module.partition(".")[0] in OURS


def _without(names: frozenset[str]) -> type[ModuleType]:
    """A class of modules that lack these names for SAND's code; other code still finds them."""

    class Narrowed(ModuleType):
        def __getattribute__(self, name: str) -> Any:
            if name in names and _is_ours(sys._getframe(1).f_globals.get("__name__", "")):
                raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}", name=name, obj=self)
            return super().__getattribute__(name)

    return Narrowed


def _refusing(plain: Callable[..., Any]) -> Callable[..., Any]:
    def imported(name: str, globals: Any = None, locals: Any = None, fromlist: Any = (), level: int = 0) -> Any:
        importer = (globals or {}).get("__name__") or ""
        if level == 0 and name in MODULES and _is_ours(importer):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return plain(name, globals, locals, fromlist, level)

    return imported


def _without_folders(plain: Callable[..., int]) -> Callable[..., int]:
    def opened(path: Any, flags: int, mode: int = 0o777, *, dir_fd: int | None = None) -> int:
        if dir_fd is None and os.path.isdir(path) and not _by_library():
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return plain(path, flags, mode, dir_fd=dir_fd)

    return opened


def _by_library() -> bool:
    """Whether the caller is a standard-library module that has other code for Windows."""
    return sys._getframe(2).f_globals.get("__name__") in ("shutil", "tempfile")


def _for_writers(plain: Callable[[Any], None]) -> Callable[[Any], None]:
    if fcntl is None:
        return plain

    def synced(fd: Any) -> None:
        if fcntl.fcntl(fd, fcntl.F_GETFL) & os.O_ACCMODE == os.O_RDONLY:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        plain(fd)

    return synced


def _of_closed_files(plain: Callable[..., None]) -> Callable[..., None]:
    """Refuse files open in this process; where /proc does not list open files (not Linux), all count as closed."""

    def changed(*paths: Any, **options: Any) -> None:
        if not any(value is not None for value in options.values()) and not _by_library():
            for path in paths:
                if _is_open(path):
                    raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        plain(*paths, **options)

    return changed


def _is_open(path: Any) -> bool:
    try:
        wanted = os.stat(path)
    except (OSError, TypeError):
        return False
    if not stat.S_ISREG(wanted.st_mode) or not os.path.isdir("/proc/self/fd"):
        return False
    for number in os.listdir("/proc/self/fd"):
        try:
            found = os.fstat(int(number))
        except OSError:
            continue
        if (found.st_dev, found.st_ino) == (wanted.st_dev, wanted.st_ino):
            return True
    return False


def pytest_configure() -> None:
    """Activate the emulation as a pytest plugin."""
    become_windows()
