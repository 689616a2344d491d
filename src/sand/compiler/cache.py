"""Folder for compiled code.

Numba's index files are pickles, and the cached machine code is executed: whoever can write into the folder can run code
as the user who reads it.  A folder is therefore used only if it belongs to the user and nobody else can write into it.
"""

from __future__ import annotations

import atexit
import json
import os
import shutil
import stat
import tempfile
from pathlib import Path
from typing import Any

from ..errors import warn

__all__ = ["private_folder", "read_record", "unsafe", "write_record"]

_WRITABLE_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH


class _UnsafeFolder(Exception):
    """Another user could place code in this folder."""


def private_folder(name: str) -> Path:
    """Folder `name` in the user's cache, created if it does not exist.

    The cache is `$SAND_CACHE`, by default the system's folder for user caches (`~/.cache/sand` on Linux).  If that
    cannot be used, it is a folder of this user among the temporary files; if that is unsafe, too, it is a new temporary
    folder that is deleted at the end of the process.  A warning gives the reason, unless
    the default folder merely cannot be written and the folder among the temporary files serves.

    Parameters
    ----------
    name : str
        Name of the folder in the cache.

    Returns
    -------
    Path
        The folder.
    """
    requested = os.environ.get("SAND_CACHE")
    reasons, warn_user = [], False
    for base in [Path(os.path.expanduser(requested)).absolute() if requested else _default(), *_fallback()]:
        try:
            folder = _create(_create(base) / name)
        except (OSError, _UnsafeFolder) as error:
            reasons.append(f"{base} {error.strerror}" if isinstance(error, OSError) else str(error))
            # an unwritable home folder is common, and the fallback is equivalent: no warning
            warn_user |= isinstance(error, _UnsafeFolder) or bool(requested)
            continue
        if warn_user:
            warn(f"compiled code is cached in {base}: {'; '.join(reasons)}")
        return folder
    base = Path(tempfile.mkdtemp(prefix="sand-cache-"))
    atexit.register(_delete, base, os.getpid())
    warn(f"compiled code is not cached, so that every start compiles it again: {'; '.join(reasons)}")
    return _create(base / name)


def read_record(path: Path) -> Any:
    """Content of a record in the cache, a JSON file; {} if it cannot be read."""
    try:
        return json.loads(path.read_text("utf-8"))
    except (OSError, ValueError):
        return {}


def write_record(path: Path, content: Any) -> None:
    """Replace a record in the cache; one that cannot be written is no error."""
    try:
        draft = path.with_suffix(f".{os.getpid()}")
        draft.write_text(json.dumps(content, indent=1), "utf-8")
        draft.replace(path)
    except OSError:
        pass


def unsafe(folder: Path) -> str | None:
    """Reason why an existing folder must not be used for compiled code; None if it may be used."""
    status = os.lstat(folder)
    if stat.S_ISLNK(status.st_mode):
        return "is a symbolic link; give the folder itself"
    if not stat.S_ISDIR(status.st_mode):
        return "is not a folder"
    getuid = getattr(os, "getuid", None)
    if getuid is None:  # Windows has no such modes; the default folder is in the user's profile
        return None
    if status.st_uid != getuid():
        return f"belongs to another user (uid {status.st_uid}), who could run code as you"
    if status.st_mode & _WRITABLE_BY_OTHERS:
        return f"can be written by other users (mode {stat.S_IMODE(status.st_mode):04o}); chmod go-w, or delete it"
    return None


def _create(folder: Path) -> Path:
    """The folder, created for this user alone if it does not exist.

    Raises
    ------
    OSError
        If it cannot be created or written.
    _UnsafeFolder
        If another user could write into it.
    """
    if not os.path.lexists(folder):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    reason = unsafe(folder)
    if reason is not None:
        raise _UnsafeFolder(f"{folder} {reason}")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(13, "cannot be written")
    return folder


def _default() -> Path:
    """The system's folder for user caches."""
    import platformdirs

    return Path(platformdirs.user_cache_dir("sand", appauthor=False))


def _fallback() -> list[Path]:
    """Folder of this user among the temporary files; none on systems without user ids."""
    getuid = getattr(os, "getuid", None)
    return [] if getuid is None else [Path(tempfile.gettempdir()) / f"sand-cache-{getuid()}"]


def _delete(folder: Path, process: int) -> None:
    """Delete a temporary folder, only in the process that created it."""
    if os.getpid() == process:
        shutil.rmtree(folder, ignore_errors=True)
