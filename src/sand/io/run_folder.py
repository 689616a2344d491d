"""A run's folder: what lies where, and how small files are written without ever being half there."""

from __future__ import annotations

import codecs
import contextlib
import errno
import io
import json
import os
import stat
import tomllib
from pathlib import Path
from typing import Any

from ..errors import BadInput, FilesFailed
from .damage import DIGEST, digest_of, set_aside_in
from .lock import LOCK, refuse_locked, writing

CASE, TRAJECTORY, LEDGER, SUMMARY, FIGURE, COLLISION, SCATTERING, RESULTS, FLIGHTS, VIEW, GROWTH = (
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
    "growth.json",
)
_NO_SYNC = (errno.EINVAL, errno.EBADF, errno.ENOTSUP, errno.EACCES, errno.EPERM)
"""Errors by which systems say that they cannot sync a folder."""
ONE_COLLISION = "collision.toml"
"""The case of a collision with one seed, in whose folder case.toml is that of the simulation."""
OUTCOMES = "collisions.jsonl"
"""Outcomes of the collisions that are finished, while others of the same job are not."""
OURS = (
    CASE, TRAJECTORY, LEDGER, SUMMARY, FIGURE, ONE_COLLISION, OUTCOMES, COLLISION, SCATTERING, RESULTS, FLIGHTS, GROWTH,
    VIEW,
)  # fmt: skip


def checked_name(text: str, name: str) -> str:
    """The name of a file or folder as a user gives it.

    Parameters
    ----------
    name : str
        of the option or setting, for the message.

    Raises
    ------
    BadInput
        it is empty, or no system takes it.
    """
    if not text.strip() or "\0" in text:
        raise BadInput(f"{name} = {text!r} is not the name of a file or folder")
    longest = max(len(os.fsencode(part)) for part in text.replace("\\", "/").split("/"))
    if longest > 255 or len(text) > 4000:
        raise BadInput(f"{name} = '{text[:40]}…' is too long for the name of a file or folder")
    return text


def make_folder(path: str | Path, *, overwrite: bool = False, shared: bool = False) -> Path:
    """Make the folder of a new run.

    Parameters
    ----------
    shared : bool, optional
        the folder may hold other things, which stay.

    Raises
    ------
    BadInput
        it exists and is not empty (unless `overwrite`, which removes an earlier run's own files and
        nothing else); or another process writes to it.
    FilesFailed
        it cannot be made or written to.
    """
    folder = Path(path)
    try:
        if folder.exists() and not folder.is_dir():
            raise BadInput(f"{folder} is a file; give the name of a new folder")
        if (folder / LOCK).exists():
            refuse_locked(folder)
        if is_used(folder) and not shared:
            if not overwrite:
                raise BadInput(
                    f"folder {folder} exists and is not empty; give another one, remove it, "
                    "or allow it to be overwritten (--overwrite, in Python overwrite=True)"
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

    Raises
    ------
    FilesFailed
        the disk is full, the folder has vanished, …
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
        left = "what was there is untouched" if path.parent.is_dir() else "its folder has vanished"
        raise FilesFailed(f"cannot write {path}: {error.strerror}; {left}") from error


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

    Raises
    ------
    BadInput
        it is missing, broken, or not what was written: the digest in it is wrong.
    """
    text = read_text(path)
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):  # also numbers of more than 4300 digits, and lists in lists without end
        raise BadInput(f"{path} is not JSON") from None
    if not isinstance(content, dict):
        raise BadInput(f"{path} is not a summary of SAND")
    if content.get(DIGEST, digest_of(content)) != digest_of(content):
        raise BadInput(f"{path} is damaged: its numbers are not those that were written, as its digest tells")
    return content


def refuse_devices(path: str | Path) -> None:
    """Raises BadInput for what may have no end: a device, a pipe."""
    try:
        kind = os.stat(path).st_mode
    except (OSError, ValueError):
        return  # whoever opens it says so
    if not (stat.S_ISREG(kind) or stat.S_ISDIR(kind)):
        raise BadInput(f"{path} is a device or a pipe; give an ordinary file")


def read_text(path: str | Path, most: int | None = None) -> str:
    """The text of a UTF-8 file, with or without a byte-order mark, lines ending with "\\n".

    Parameters
    ----------
    most : int or None, optional
        bytes that are read at most, from a file of any kind; by default all of an ordinary file.

    Raises
    ------
    BadInput
        a missing, unreadable or larger file, or none of text.
    """
    if most is None:
        refuse_devices(path)
    try:
        with open(path, "rb") as file:
            content = file.read() if most is None else file.read(most + 1)
    except FileNotFoundError:
        raise BadInput(f"there is no file {path}") from None
    except OSError as error:
        raise BadInput(f"cannot read {path}: {error.strerror}") from None
    except ValueError:  # a NUL in the name
        raise BadInput(f"there is no file {str(path)!r}") from None
    if most is not None and len(content) > most:
        raise BadInput(f"{path} holds more than {most / 2**20:g} MiB; a case file is much smaller")
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise BadInput(f"{path} is not a text file in UTF-8, but one in UTF-16; save it as UTF-8")
    try:
        return io.TextIOWrapper(io.BytesIO(content), encoding="utf-8-sig").read()
    except UnicodeDecodeError:
        raise BadInput(f"{path} is not a text file") from None


MOST_TOML = 4 * 2**20
"""Bytes of a case file."""
DEEPEST = 16
"""Tables and lists within each other in a case file."""
LONGEST_STRING = 4096
"""Characters of a text in a case file."""


def read_toml(path: str | Path) -> dict[str, Any]:
    """Raises BadInput for a missing file, one that is no case file, or with the line of a slip in its grammar."""
    text = read_text(path, MOST_TOML)
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise BadInput(f"{path} is not TOML: {error}") from None
    except RecursionError:
        raise BadInput(f"{path}: tables and lists lie more than {DEEPEST} deep in each other") from None
    except ValueError as error:  # whole numbers of more than 4300 digits, dates that are none
        raise BadInput(f"{path} is not TOML: {str(error).split(':')[0]}") from None
    _refuse_extremes(path, content)
    return content


def _refuse_extremes(path: str | Path, content: dict[str, Any]) -> None:
    """Raises BadInput for what no case file needs, and what could not be computed with or printed."""
    layer: list[tuple[str, Any]] = list(content.items())
    for _ in range(DEEPEST):
        deeper: list[tuple[str, Any]] = []
        for name, value in layer:
            if isinstance(value, int) and not -(2**63) <= value < 2**63:
                raise BadInput(f"{path}: {name[:80]} is a whole number beyond 2^63; that is more than TOML allows")
            if (isinstance(value, str) and len(value) > LONGEST_STRING) or len(name) > LONGEST_STRING:
                raise BadInput(f"{path}: {name[:80]} holds more than {LONGEST_STRING} characters")
            if isinstance(value, dict):
                deeper += [(f"{name}.{key}", inner) for key, inner in value.items()]
            elif isinstance(value, list):
                deeper += [(name, inner) for inner in value]
        layer = deeper
    if layer:
        raise BadInput(f"{path}: tables and lists lie more than {DEEPEST} deep in each other")


def was_written_by_sand(path: Path) -> bool:
    """Whether a case file in a folder was written by a run or job, and not by the user: its first line says so."""
    try:
        first = path.read_text("utf-8").partition("\n")[0]
    except (OSError, UnicodeDecodeError):
        return False
    return first.startswith("# sand ") or "as understood by SAND" in first


def write_toml(path: Path, content: dict[str, Any], comment: str) -> None:
    """A case file, with a comment on top."""
    import tomli_w

    text = "".join(f"# {line}\n" for line in comment.splitlines()) + "\n" + tomli_w.dumps(content)
    replace_file(path, text.encode())
