"""A run's folder: what lies where, and how small files are written without ever being half there."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import tomllib
from pathlib import Path
from typing import Any

from ..core.errors import BadInput, FilesFailed
from .damaged import DIGEST, digest_of, set_aside_in
from .lock import LOCK, refuse_locked, writing

CASE, TRAJECTORY, LEDGER, SUMMARY, FIGURE, COLLISION, SCATTERING, RESULTS, FLIGHTS, VIEW = (
    "case.toml",
    "trajectory.gsd",
    "ledger.csv",
    "summary.json",
    "figure.png",
    "collision.json",
    "scattering.json",
    "results.csv",
    "flights.csv",
    "view.html",
)
_NO_SYNC = (errno.EINVAL, errno.EBADF, errno.ENOTSUP, errno.EACCES, errno.EPERM)
"""Errors by which systems say that they cannot sync a folder."""
OURS = (CASE, TRAJECTORY, LEDGER, SUMMARY, FIGURE, COLLISION, SCATTERING, RESULTS, FLIGHTS, VIEW)


def make_folder(path: str | Path, *, overwrite: bool = False) -> Path:
    """Make the folder of a new run.

    Raises:
        BadInput: it exists and is not empty (unless `overwrite`, which removes an earlier run's own files and
            nothing else); or another process writes to it.
        FilesFailed: it cannot be made or written to.
    """
    folder = Path(path)
    try:
        if folder.exists() and not folder.is_dir():
            raise BadInput(f"{folder} is a file; give the name of a new folder")
        if (folder / LOCK).exists():
            refuse_locked(folder)
        if is_used(folder):
            if not overwrite:
                raise BadInput(
                    f"folder {folder} exists and is not empty; give another one, remove it, "
                    "or say that it may be overwritten"
                )
            with writing(folder):
                damaged = set_aside_in(folder, (*OURS, "checkpoint-*.npz"))
                ours = [*(folder / name for name in OURS), *folder.glob("checkpoint-*.npz"), *damaged]
                # first the one file that others keep open: where that forbids removing it (Windows), nothing is removed
                for old in [folder / TRAJECTORY, *ours]:
                    old.unlink(missing_ok=True)
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".probe"
        probe.write_bytes(b"")
        probe.unlink()
    except FilesFailed:
        raise
    except OSError as error:
        raise FilesFailed(f"cannot write to folder {folder}: {error.strerror}") from error
    return folder


def is_used(folder: Path) -> bool:
    """True if a folder is there and holds more than what a lock left."""
    return folder.is_dir() and any(one.name != LOCK for one in folder.iterdir())


def replace_file(path: Path, content: bytes) -> None:
    """Write beside, sync, rename: the file is the old one or the new one, never half of it.

    Raises:
        FilesFailed: the disk is full, the folder has vanished, …
    """
    beside = path.with_name(f".{path.name}.new")
    try:
        with open(beside, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(beside, path)
        _sync_names(path.parent)
    except OSError as error:
        with contextlib.suppress(OSError):
            beside.unlink(missing_ok=True)
        raise FilesFailed(f"cannot write {path}: {error.strerror}; what was there is untouched") from error


def _sync_names(folder: Path) -> None:
    """Write the names in a folder to the disk, so that a power cut does not undo a renaming.

    Windows opens no folder, and some file systems cannot sync one: there the system decides when names are written.
    """
    try:
        handle = os.open(folder, os.O_RDONLY)
    except PermissionError:
        return
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in _NO_SYNC:
            raise
    finally:
        os.close(handle)


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Readable JSON; NaN and infinities become null."""
    replace_file(path, (json.dumps(plain(content), indent=2, allow_nan=False) + "\n").encode())


def plain(value: Any) -> Any:
    """What JSON can hold: NumPy arrays and numbers become lists and numbers, NaN and infinities null."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float) and not abs(value) < float("inf"):
        return None
    return value


def read_json(path: Path) -> dict[str, Any]:
    """What a JSON file holds.

    Raises:
        BadInput: it is missing, broken, or not what was written: the digest in it is wrong.
    """
    try:
        content = json.loads(read_text(path))
    except json.JSONDecodeError:
        raise BadInput(f"{path} is not JSON") from None
    if not isinstance(content, dict):
        raise BadInput(f"{path} is not a summary of SAND")
    if content.get(DIGEST, digest_of(content)) != digest_of(content):
        raise BadInput(f"{path} is damaged: its numbers are not those that were written, as its digest tells")
    return content


def read_text(path: str | Path) -> str:
    """Raises BadInput for a missing or unreadable file."""
    try:
        return Path(path).read_text(encoding="utf-8")
    except FileNotFoundError:
        raise BadInput(f"there is no file {path}") from None
    except UnicodeDecodeError:
        raise BadInput(f"{path} is not a text file") from None
    except OSError as error:
        raise BadInput(f"cannot read {path}: {error.strerror}") from None


def read_toml(path: str | Path) -> dict[str, Any]:
    """Raises BadInput for a missing file, or with the line of a slip in its grammar."""
    try:
        return tomllib.loads(read_text(path))
    except tomllib.TOMLDecodeError as error:
        raise BadInput(f"{path} is not TOML: {error}") from None


def write_toml(path: Path, content: dict[str, Any], comment: str) -> None:
    """A case file, with a comment on top."""
    import tomli_w

    text = "".join(f"# {line}\n" for line in comment.splitlines()) + "\n" + tomli_w.dumps(content)
    replace_file(path, text.encode())
