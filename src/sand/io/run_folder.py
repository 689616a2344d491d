"""The folder of a run: names of its files, atomic writing of small files, and reading of text, JSON and TOML."""

from __future__ import annotations

import codecs
import contextlib
import errno
import io
import json
import os
import re
import secrets
import shutil
import stat
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

from ..basics.errors import BadInput, FilesFailed, shown, warn
from ..basics.paths import user_path
from .damage import DAMAGED, DIGEST, digest_of
from .lock import CLAIM, LOCK, refuse_locked, writing

OWN_FILES = (
    CASE, TRAJECTORY, LEDGER, SUMMARY, FIGURE, ONE_COLLISION, OUTCOMES, COLLISION, SCATTERING, RESULTS_CSV, FLIGHTS,
    GROWTH, VIEW, SWEEP, SWEEP_CSV, COMPARISON, LABORATORY, LOADED, ROWS_CSV, ENCOUNTERS, AGGREGATES,
) = (
    "case.toml",
    "trajectory.gsd",
    "ledger.csv",
    "summary.json",
    "figure.png",
    "collision.toml",  # the case of a collision with one seed, whose folder has the case of the simulation in case.toml
    "collisions.jsonl",  # outcomes of the finished collisions of a job that is not finished
    "collision.json",
    "scattering.json",
    "results.csv",
    "flights.csv",
    "growth.json",
    "view.html",
    "sweep.json",
    "sweep.csv",
    "comparison.csv",
    "laboratory.json",
    "loaded.jsonl",  # outcomes of the finished runs of sand compress, stretch or shear until all are
    "rows.csv",  # rows of the tables of all runs of a sweep
    "encounters.csv",
    "aggregates.csv",
)  # fmt: skip
"""Names of all files that SAND writes to a folder, checkpoints excepted."""
CHECKPOINT = re.compile(r"checkpoint-(\d{15,})\.npz")
"""Names of checkpoints, with the number of steps; other names are those of copies that the user keeps."""
PLOTS = "plots"
"""Subfolder of figures."""
RUNS, ROW, RESULTS = "runs", "row.json", "results"
"""Subfolder of the runs of a sweep, file with the row of one, and subfolder of what `sand reproduce` makes of them."""
DERIVED = (
    *(".xyz", ".dump", ".data", ".vtp", ".pvd", ".png", ".pdf", ".svg", ".html", ".csv", ".json"),
    *(".geom", ".dat", ".pos"),
)
"""Ends of the names of exports, figures and tables that are made from a run."""
NAMED = 5
"""Files that are named one by one in a message."""
_NO_SYNC = (errno.EINVAL, errno.EBADF, errno.ENOTSUP, errno.EACCES, errno.EPERM)
"""Errors by which systems report that they cannot sync a folder."""


def make_folder(path: str | Path, *, overwrite: bool = False, shared: bool = False) -> Path:
    """Create the folder of a new run.

    Parameters
    ----------
    overwrite : bool, optional
        Whether the files of an earlier run may be removed; other files stay, and a warning names exports and figures.
    shared : bool, optional
        Whether the folder may hold other files.

    Raises
    ------
    BadInput
        If the folder is not empty, or another process writes to it; with `overwrite` if it holds files, but none shows
        that a run or job of SAND wrote them, or a sweep.
    FilesFailed
        If it cannot be created or written to.
    """
    folder = user_path(path, "folder")
    try:
        if folder.exists() and not folder.is_dir():
            raise BadInput(f"{folder} is a file; give the name of a new folder")
        if not shared and (folder / LOCK).exists():  # those who share it wait for each other
            refuse_locked(folder)
        if is_used(folder) and not shared:
            refuse_sweep(folder)
            if not overwrite:
                raise BadInput(
                    f"folder {folder} exists and is not empty; give another one, remove it, "
                    "or allow it to be overwritten (--overwrite, in Python overwrite=True)"
                )
            found = files_of_runs(folder)
            if found and not shows_a_run(folder):
                names = ", ".join(path.name for path in found)
                raise BadInput(
                    f"{folder} holds {names}, but nothing shows that SAND wrote them, so they are not replaced: give "
                    "another folder, or remove them"
                )
            with writing(folder):
                # begin with the file that readers keep open: if Windows refuses to remove it, all files stay
                for old in [folder / TRAJECTORY, *found]:
                    old.unlink(missing_ok=True)
            if left := _of_earlier_results(folder):
                called = [str(path.relative_to(folder)) for path in left]
                more = f" and {len(called) - NAMED} more" if len(called) > NAMED else ""
                warn(
                    f"{folder} keeps {', '.join(called[:NAMED])}{more}, which the earlier run may have left; remove "
                    "them, or make them again from the new results"
                )
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=folder, prefix=LOCK):
            pass
    except FilesFailed:
        raise
    except OSError as error:
        raise FilesFailed(f"cannot write to folder {folder}: {error.strerror}") from error
    return folder


def holds_sweep(folder: Path) -> bool:
    """Whether a folder holds a sweep, also one whose table is not written yet."""
    if (folder / SWEEP_CSV).exists() or any(folder.glob(f"{RUNS}/*/{ROW}")):
        return True
    with contextlib.suppress(BadInput):
        return was_written_by_sand(folder / CASE) and "sweep" in read_toml(folder / CASE)
    return False


def refuse_sweep(folder: Path) -> None:
    """Raise BadInput if a folder for a run or job holds a sweep, whose results may have taken long."""
    if holds_sweep(folder):
        raise BadInput(f"{folder} holds a sweep, which is not replaced: give another folder, or remove it")


def files_of_runs(folder: Path) -> list[Path]:
    """Files of a folder that have names which SAND gives, also to damaged files."""
    names = {path: path.name.partition(DAMAGED)[0] for path in folder.iterdir()}
    return sorted(path for path, name in names.items() if name in OWN_FILES or CHECKPOINT.fullmatch(name))


def shows_a_run(folder: Path) -> bool:
    """Whether the content of a file in a folder, not only its name, shows that SAND wrote it."""
    for name in (CASE, ONE_COLLISION):
        if was_written_by_sand(folder / name):
            return True
    for path in files_of_runs(folder):
        with contextlib.suppress(OSError), open(path, "rb") as file:
            begin = file.read(4096)
            if path.name == TRAJECTORY and len(begin) >= 40:
                file.seek(
                    min(int.from_bytes(begin[24:32], "little"), 2**62)
                )  # where the header says names of chunks are
                if b"log/scale/length" in file.read(8192):
                    return True
            if path.name == LEDGER and begin.startswith(b"step,time,translation,rotation,"):
                return True
            if CHECKPOINT.fullmatch(path.name) and begin.startswith(b"PK") and b"meta.json" in begin:
                return True
    return False


def _of_earlier_results(folder: Path) -> list[Path]:
    """Exports and pictures in a folder and in its subfolder `plots`: what was made of a run, not by the run."""
    found = [path for place in (folder, folder / PLOTS) if place.is_dir() for path in place.iterdir()]
    return sorted(path for path in found if path.suffix in DERIVED and path.is_file())


def is_used(folder: Path) -> bool:
    """Whether a folder exists and holds more than lock files, and the one by which `make_folder` finds it writable."""
    return folder.is_dir() and any(not one.name.startswith((LOCK, CLAIM)) for one in folder.iterdir())


def replace_file(path: str | Path, content: bytes) -> None:
    """Replace a file, named as by a user (`~`), atomically.  Raises FilesFailed, as `replacing`."""
    with replacing(user_path(path)) as file:
        file.write(content)


def replace_by_copy(path: str | Path, source: Path) -> None:
    """Replace a file, named as by a user (`~`), atomically by a copy.  Raises FilesFailed, as `replacing`."""
    with replacing(user_path(path)) as file, open(source, "rb") as content:
        shutil.copyfileobj(content, file)


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """Replace a file atomically by what the block writes: write a temporary file, sync, rename.

    Raises
    ------
    FilesFailed
        If the file cannot be written; the old one is untouched then.
    """
    # a new file of a random name: one of a fixed name may be a link to a file elsewhere
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.new")
    try:
        with open(temporary, "xb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
        _sync_names(path.parent)
    except OSError as error:
        left = "the old content is untouched" if path.parent.is_dir() else "its folder has been removed"
        raise FilesFailed(f"cannot write {path}: {error.strerror}; {left}") from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def give_own_content(path: Path) -> None:
    """Replace a file that has several names, by a link or by hard links, with a copy of its own.

    Raises
    ------
    FilesFailed
        If it cannot be copied.
    """
    try:
        shared = path.is_symlink() or path.stat().st_nlink > 1
    except FileNotFoundError:
        path.unlink(missing_ok=True)  # a link to nothing, through which a file elsewhere would be created
        return
    except OSError as error:
        raise FilesFailed(f"cannot read {path}: {error.strerror}") from error
    if shared:
        with open(path, "rb") as old, replacing(path) as new:
            shutil.copyfileobj(old, new)


def append_text(path: Path, text: str) -> None:
    """Append to a file.  Raises FilesFailed."""
    try:
        with open(path, "ab") as file:
            file.write(text.encode())
    except OSError as error:
        raise FilesFailed(f"cannot write {path}: {error.strerror}") from error


def _sync_names(folder: Path) -> None:
    """Sync the entries of a folder, so that a power failure does not undo a renaming.

    Windows does not open folders, and some file systems cannot sync them: there the system decides when.
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
    """Write readable JSON; NaN and infinities become null."""
    replace_file(path, (json.dumps(plain(content), indent=2, allow_nan=False) + "\n").encode())


def plain(value: Any) -> Any:
    """Convert to JSON types: NumPy arrays become lists, NumPy scalars become numbers, NaN and infinities null."""
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
    """Read a JSON file that holds an object.

    Raises
    ------
    BadInput
        If it is missing or broken, or its digest does not match its content.
    """
    text = read_text(path)
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):  # also numbers of more than 4300 digits, and deeply nested lists
        raise BadInput(f"{path} is not JSON") from None
    if not isinstance(content, dict):
        raise BadInput(f"{path} is not a summary of SAND")
    # every summary has a digest: one without it was changed, too
    without = None if path.name == SUMMARY else digest_of(content)
    if content.get(DIGEST, without) != digest_of(content):
        raise BadInput(f"{path} is damaged: its content does not match its digest")
    return content


def refuse_devices(path: str | Path) -> None:
    """Raise BadInput for devices and pipes, which may have no end."""
    try:
        kind = os.stat(path).st_mode
    except (OSError, ValueError):
        return  # reported when the file is opened
    if not (stat.S_ISREG(kind) or stat.S_ISDIR(kind)):
        raise BadInput(f"{path} is a device or a pipe; give an ordinary file")


def read_text(path: str | Path, most: int | None = None, errors: str = "strict") -> str:
    """Read the text of a UTF-8 file, with or without a byte-order mark; lines end with "\\n".

    Parameters
    ----------
    most : int or None, optional
        Largest accepted size in bytes, for files of any type; by default all of an ordinary file is read.
    errors : str, optional
        What is done with bytes that are not text, as for `bytes.decode`.

    Raises
    ------
    BadInput
        If the file is missing, unreadable, too large, or not text.
    """
    path = user_path(path, "file")
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
        return io.TextIOWrapper(io.BytesIO(content), encoding="utf-8-sig", errors=errors).read()
    except UnicodeDecodeError as error:
        raise BadInput(_not_utf8(path, content, error.start)) from None


def _not_utf8(path: str | Path, content: bytes, start: int) -> str:
    """Message about a file that is not text in UTF-8; names the line, and the encoding if it is probably Latin-1."""
    if b"\0" in content:
        return f"{path} is not a text file"
    before = content[:start]
    number = len(before.splitlines()) + (not before or before.endswith((b"\n", b"\r")))
    line = content[before.rfind(b"\n") + 1 :].splitlines()[0].decode("latin-1").strip()
    return (
        f"{path} is not UTF-8: line {number}, {shown(line)}, has byte 0x{content[start]:02x}, "
        f"{content[start : start + 1].decode('latin-1')!r} in Latin-1; save the file as UTF-8"
    )


MOST_TOML = 4 * 2**20
"""Largest size of a case file in bytes."""
DEEPEST = 16
"""Largest nesting depth of tables and lists in a case file."""
LONGEST_STRING = 4096
"""Largest number of characters of a text in a case file."""


def read_toml(path: str | Path) -> dict[str, Any]:
    """Read a TOML file.  Raises BadInput for a missing file, or with the line of a syntax error."""
    text = read_text(path, MOST_TOML)
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise BadInput(f"{path} is not TOML: {error}{_line_with(text, str(error))}") from None
    except RecursionError:
        raise BadInput(f"{path}: tables and lists are nested more than {DEEPEST} deep") from None
    except ValueError as error:  # integers of more than 4300 digits, invalid dates
        raise BadInput(f"{path} is not TOML: {str(error).split(':')[0]}") from None
    _refuse_extremes(path, content)
    return content


_QUANTITY = re.compile(r"(?:^|[=\[,])\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?\s*(?![eE][-+\d])[^\W\d_][^,\]}'=]*)(?=[,\]}]|$)")
_WORD = re.compile(r"[=\[,]\s*(?!(?i:true|false|inf|nan)\b)([^\W\d][^,\]}'=]*)(?=[,\]}]|$)")
"""A number with a unit, and a word, without quotation marks."""
_OF_VALUES = ("Invalid value", "Expected newline", "Unclosed array")
"""Beginnings of errors of tomllib where a value may lack its quotation marks."""


def _line_with(text: str, error: str) -> str:
    """The line that a syntax error names, with advice on a value without the quotation marks that it needs."""
    place = re.search(r"line (\d+)", error)
    lines = text.split("\n")
    if place is None or int(place[1]) > len(lines):
        return ""
    line = lines[int(place[1]) - 1].strip()
    if not error.startswith(_OF_VALUES):
        return f": {shown(line)}"
    bare = re.sub(r"\"[^\"]*\"|'[^']*'", "''", line).partition("#")[0]
    unit, word = _QUANTITY.search(bare), _WORD.search(bare)
    found, what = (unit, "a value with a unit") if unit else (word, "text")
    advice = f'; {what} needs quotation marks: "{found[1].strip()}"' if found else ""
    if not found and (logical := re.search(r"[=\[,]\s*(True|False|TRUE|FALSE)\b", bare)):
        advice = f"; write {logical[1].lower()}"
    return f": {shown(line)}{advice}"


def _refuse_extremes(path: str | Path, content: dict[str, Any]) -> None:
    """Raise BadInput for values that no case file needs and that could not be processed or printed."""
    level: list[tuple[str, Any]] = list(content.items())
    for _ in range(DEEPEST):
        deeper: list[tuple[str, Any]] = []
        for name, value in level:
            if isinstance(value, int) and not -(2**63) <= value < 2**63:
                raise BadInput(f"{path}: {name[:80]} is a whole number beyond 2^63, more than TOML allows")
            if (isinstance(value, str) and len(value) > LONGEST_STRING) or len(name) > LONGEST_STRING:
                raise BadInput(f"{path}: {name[:80]} holds more than {LONGEST_STRING} characters")
            if isinstance(value, dict):
                deeper += [(f"{name}.{key}", inner) for key, inner in value.items()]
            elif isinstance(value, list):
                deeper += [(name, inner) for inner in value]
        level = deeper
    if level:
        raise BadInput(f"{path}: tables and lists are nested more than {DEEPEST} deep")


WRITTEN = "# Written by SAND:"
"""Beginning of the first line of case files in the folders of runs and jobs."""


def was_written_by_sand(path: Path) -> bool:
    """Whether a case file in a folder was written by a run or job, and not by the user: its first line says so."""
    try:
        first = path.read_text("utf-8-sig").partition("\n")[0]
    except (OSError, UnicodeDecodeError):
        return False
    return first.startswith(WRITTEN)


def is_job(folder: Path, case: Path) -> bool:
    """Whether SAND works or worked in a folder with a case file, and the case file is not just one of the user."""
    names = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
    results = {COLLISION, FLIGHTS, GROWTH, LABORATORY, OUTCOMES, SCATTERING, SWEEP, TRAJECTORY}
    return (
        was_written_by_sand(case)
        or bool(results & names)
        or any(CHECKPOINT.fullmatch(name) or name.startswith("seed-") for name in names)
    )


def write_toml(path: Path, content: dict[str, Any], comment: str) -> None:
    """Write a case file with a comment at its top."""
    import tomli_w

    text = f"{WRITTEN} {' '.join(comment.split())}\n\n{tomli_w.dumps(content)}"
    replace_file(path, text.encode())
