"""Folders for compiled code.

Loading compiled code executes it: whoever can write into the folder can run code as the user who reads it.  A folder is
therefore used only if it belongs to the user and nobody else can write into it.  A folder that the user cannot write is
only read: one that was filled before, or that of another user, if nobody else can put another one in its place.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import shutil
import stat
import tempfile
from pathlib import Path
from typing import Any

from ..basics.errors import warn

__all__ = ["WRITABLE_BY_OTHERS", "cache_folders", "private_folder", "read_record", "remade", "unsafe", "write_record"]

WRITABLE_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH
"""Bits of a mode that let group or others write."""


class _UnsafeFolder(Exception):
    """Another user could place code in this folder."""


def cache_folders(name: str) -> tuple[Path, Path | None]:
    """The folder `name` to which code is written, and the one that is only read, if there is one.

    The cache is `$SAND_CACHE`, by default the system's folder for user caches (`~/.cache/sand` on Linux).  If it has a
    folder of this name that cannot be written, because it is on a read-only file system, without permission, or of
    another user, that one is read, and new code is written as by `private_folder`.

    Parameters
    ----------
    name : str
        Name of the folder in the cache.

    Returns
    -------
    tuple of (Path, Path or None)
        The two folders.
    """
    found = _asked_for() / name
    try:
        readable = not unsafe(found.parent, read_only=True) and not unsafe(found, read_only=True)
        writable = not unsafe(found.parent) and not unsafe(found) and os.access(found, os.W_OK | os.X_OK)
    except OSError:
        readable = writable = False
    if readable and not writable and os.access(found, os.R_OK | os.X_OK):
        return private_folder(name, read=found), found
    return private_folder(name), None


def private_folder(name: str, read: Path | None = None) -> Path:
    """Folder `name` in the user's cache, created if it does not exist.

    If the cache cannot be used, it is a folder of this user among the temporary files; if that is unsafe, too, it is a
    new temporary folder that is deleted at the end of the process.  A warning gives the reason, unless
    the default folder merely cannot be written and the folder among the temporary files serves.

    Parameters
    ----------
    name : str
        Name of the folder in the cache.
    read : Path, optional
        A folder of the cache that is only read.  New code is then written to the default cache, without a warning.

    Returns
    -------
    Path
        The folder.
    """
    reasons, warn_user = [], False
    for base in [_asked_for() if read is None else _default(), *_fallback()]:
        try:
            folder = _create(base / name)
        except (OSError, _UnsafeFolder) as error:
            reasons.append(f"{base} {error.strerror}" if isinstance(error, OSError) else str(error))
            # an unwritable home folder is common, and the fallback is equivalent: no warning
            warn_user |= isinstance(error, _UnsafeFolder) or bool(os.environ.get("SAND_CACHE"))
            continue
        if warn_user and read is None:
            warn(f"compiled code is cached in {base}: {'; '.join(reasons)}")
        return folder
    base = Path(tempfile.mkdtemp(prefix="sand-cache-"))
    atexit.register(_delete, base, os.getpid())
    if read is None:
        warn(f"compiled code is not cached, so that every start compiles it again: {'; '.join(reasons)}")
    return _create(base / name)


def remade(folder: Path) -> None:
    """Create a folder of `private_folder` again if it has been deleted.

    Raises
    ------
    OSError
        If it cannot be used.
    """
    try:
        _create(folder)
    except _UnsafeFolder as error:
        raise PermissionError(13, str(error)) from None


def read_record(path: Path) -> Any:
    """Content of a record in the cache, a JSON file; {} if it cannot be read."""
    try:
        return json.loads(path.read_text("utf-8"))
    except (OSError, ValueError):
        return {}


def write_record(path: Path, content: Any) -> None:
    """Replace a record in the cache; one that cannot be written is no error."""
    draft = path.with_suffix(f".{os.getpid()}")
    try:
        draft.write_text(json.dumps(content, indent=1), "utf-8")
        draft.replace(path)
    except OSError:
        with contextlib.suppress(OSError):  # of a file system that is read-only
            draft.unlink(missing_ok=True)


def unsafe(folder: Path, *, read_only: bool = False) -> str | None:
    """Reason why an existing folder must not be used for compiled code, or not be read; None if it may be used."""
    status = os.lstat(folder)
    if stat.S_ISLNK(status.st_mode):
        return "is a symbolic link; give the folder itself"
    if not stat.S_ISDIR(status.st_mode):
        return "is not a folder"
    getuid = getattr(os, "getuid", None)
    if getuid is None:  # Windows has no such modes; the default folder is in the user's profile
        return None
    if status.st_mode & WRITABLE_BY_OTHERS:
        return f"can be written by other users (mode {stat.S_IMODE(status.st_mode):04o}); chmod go-w, or delete it"
    if status.st_uid != getuid():
        place = _open_place(folder, status.st_uid)
        if place is not None:
            others = f"belongs to another user (uid {status.st_uid}), who could run code as you"
            return f"{others}, and lies below {place}, where still others can put a folder in its place"
        if not read_only:
            return f"belongs to another user (uid {status.st_uid}), and holds no code of this version of SAND"
    return None


def _open_place(folder: Path, owner: int) -> Path | None:
    """A folder above, in which others than root, this user and the owner can replace what leads to the folder."""
    me = os.getuid()
    for start in {folder, folder.resolve()}:
        for below, above in zip([start, *start.parents], start.parents, strict=False):
            status = os.lstat(above)
            if stat.S_ISLNK(status.st_mode):
                continue  # where it leads is examined, too
            fixed = status.st_mode & stat.S_ISVTX and os.lstat(below).st_uid in (0, me)
            if status.st_uid not in (0, me, owner) or (status.st_mode & WRITABLE_BY_OTHERS and not fixed):
                return above
    return None


def _create(folder: Path) -> Path:
    """The folder, created for this user alone if it and the one above do not exist.

    In a folder that others may read they may read this one, too.

    Raises
    ------
    OSError
        If it cannot be created or written.
    _UnsafeFolder
        If another user could write into it.
    """
    for each in (folder.parent, folder):
        if not os.path.lexists(each):
            mode = stat.S_IMODE(folder.parent.stat().st_mode) & 0o755 if each is folder else 0o700
            each.mkdir(mode=mode, parents=True, exist_ok=True)
        reason = unsafe(each)
        if reason is not None:
            raise _UnsafeFolder(f"{each} {reason}")
        if not os.access(each, os.W_OK | os.X_OK):
            raise PermissionError(13, "cannot be written")
    return folder


def _asked_for() -> Path:
    """The cache that the user wants."""
    requested = os.environ.get("SAND_CACHE")
    return Path(os.path.expanduser(requested)).absolute() if requested else _default()


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
