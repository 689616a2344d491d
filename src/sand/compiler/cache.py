"""The folder for compiled code.

Numba's index files are pickles, and the code beside them is run: whoever can write into the folder can run code as the
user who reads it.  So a folder is used only if it belongs to the user and nobody else can write into it.
"""

from __future__ import annotations

import atexit
import os
import shutil
import stat
import tempfile
from pathlib import Path

from ..errors import warn

__all__ = ["private_folder", "unsafe"]

_WRITABLE_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH


class _Unsafe(Exception):
    """Another user could put code into this folder."""


def private_folder(name: str) -> Path:
    """The folder `name` in the cache of this user, made if it does not exist.

    The cache is `$SAND_CACHE`, by default the system's folder for a user's caches (`~/.cache/sand` on Linux).  If that
    cannot be used, it is a folder of this user among the temporary files, and if that is unsafe too, a new temporary
    folder that is deleted at the end of the process.  A warning says why the wished folder is not used.

    Parameters
    ----------
    name : str
        of the folder in the cache.
    """
    wished = os.environ.get("SAND_CACHE")
    reasons, to_be_said = [], False
    for base in [Path(wished).absolute() if wished else _default(), *_fallback()]:
        try:
            folder = _made(_made(base) / name)
        except (OSError, _Unsafe) as error:
            reasons.append(f"{base} {error.strerror}" if isinstance(error, OSError) else str(error))
            # a home that cannot be written is nothing unusual, and the fallback is as good
            to_be_said |= isinstance(error, _Unsafe) or bool(wished)
            continue
        if to_be_said:
            warn(f"compiled code is kept in {base}: {'; '.join(reasons)}")
        return folder
    base = Path(tempfile.mkdtemp(prefix="sand-cache-"))
    atexit.register(_delete, base, os.getpid())
    warn(f"compiled code is not kept, every start compiles anew: {'; '.join(reasons)}")
    return _made(base / name)


def unsafe(folder: Path) -> str | None:
    """Why an existing folder must not be used for compiled code; None if it may be used."""
    found = os.lstat(folder)
    if stat.S_ISLNK(found.st_mode):
        return "is a symbolic link; give the folder itself"
    if not stat.S_ISDIR(found.st_mode):
        return "is not a folder"
    own = getattr(os, "getuid", None)
    if own is None:  # Windows: who may write is no matter of modes; the default lies in the user's profile
        return None
    if found.st_uid != own():
        return f"belongs to another user (uid {found.st_uid}), who could run code as you"
    if found.st_mode & _WRITABLE_BY_OTHERS:
        return f"can be written by other users (mode {stat.S_IMODE(found.st_mode):04o}); chmod go-w, or delete it"
    return None


def _made(folder: Path) -> Path:
    """The folder, new ones for this user alone.

    Raises
    ------
    OSError
        it cannot be made or written.
    _Unsafe
        another user could write into it.
    """
    if not os.path.lexists(folder):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    reason = unsafe(folder)
    if reason is not None:
        raise _Unsafe(f"{folder} {reason}")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(13, "cannot be written")
    return folder


def _default() -> Path:
    import platformdirs

    return Path(platformdirs.user_cache_dir("sand", appauthor=False))


def _fallback() -> list[Path]:
    """The folder of this user among the temporary files; none where users have no numbers."""
    own = getattr(os, "getuid", None)
    return [] if own is None else [Path(tempfile.gettempdir()) / f"sand-cache-{own()}"]


def _delete(folder: Path, process: int) -> None:
    """Delete a temporary folder, in the process that made it only."""
    if os.getpid() == process:
        shutil.rmtree(folder, ignore_errors=True)
