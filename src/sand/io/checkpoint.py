"""Checkpoints checkpoint-*.npz: the complete state in float64, versioned and with a checksum; the newest two are kept.

A checkpoint is a NumPy archive of plain arrays without pickles, replaced atomically.

| array | meaning |
|---|---|
| meta.json | JSON as bytes: `format`, `version`, `sha256` of all arrays, step, time, planned end, case, choices, … |
| clock | time and step [s], remaining length of the r-RESPA cycle [s], …; meta.json names all entries |
| count | numbers of steps, contacts, candidate pairs, contacts formed and broken, slip events; builds of the lists |
| lost | energy lost per channel [J] |
| cutoff | the cut-off of dipoles that follows the largest clusters, and the choice; meta.json names all entries |
| ledger | all rows so far, (K, columns of ledger.csv) |
| grains/… | every quantity of a grain, (N,) or (3, N), SI, and indices of materials; `own`: own quantities (K, N) |
| contacts/… | pairs, pointers in body frames, twist, time of formation, constants, losses, loads, contacts per grain |
| pair_list/… | the list of candidate pairs, and the positions at its last rebuild |
| order | grain index at each array position, (N,), with spatial sorting; all other arrays are in the user's order |
| bodies/… | bodies, their momenta, and what is at rest; only with rigid clusters |
| long_range/… | loads of the last long-range summation, state of the cycle, positions at the last rebuild of the list |
| GROUP/… | arrays of the components in use, such as `walls/…`: those that they declare as `Component.groups` |

`io.state_arrays` checks each array.

Random numbers are functions of the seed, the grain and the index of the kick, so there is no generator state to save.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import warnings
import zipfile
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import numpy as np

from ..basics.errors import BadInput, FilesFailed
from .checkpoint_files import META, checkpoint_files
from .damage import set_aside
from .run_folder import refuse_devices, replace_file
from .state_arrays import Groups, check_state

VERSION = 10
"""Version of the file format; other versions are refused. Versions before 9 were never released."""
KEPT = 2
"""Checkpoints kept in a folder."""


Reader = Callable[[Path], tuple[dict[str, np.ndarray], dict[str, Any]]]
"""Reads a checkpoint: arrays and metadata."""


def _checksum(arrays: dict[str, np.ndarray]) -> str:
    digest = hashlib.sha256()
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def checkpoint_name(steps: int) -> str:
    """File name of the checkpoint after `steps` steps; alphabetical order is the order of steps."""
    return f"checkpoint-{int(steps):015d}.npz"


def write_checkpoint(folder: Path, arrays: dict[str, np.ndarray], meta: dict[str, Any]) -> Path:
    """Write one checkpoint, then delete all but the newest two.

    Parameters
    ----------
    arrays : dict[str, ndarray]
        Arrays of the state by name.
    meta : dict[str, Any]
        Metadata: numbers and text, among them `steps`.

    Raises
    ------
    FilesFailed
        If it cannot be written; older checkpoints stay.
    """
    header = {"format": "SAND checkpoint", "version": VERSION, "sha256": _checksum(arrays), **meta}
    text = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    memory = io.BytesIO()
    np.savez(memory, **{META: text}, **arrays)  # type: ignore[arg-type]
    path = folder / checkpoint_name(meta["steps"])
    replace_file(path, memory.getvalue())
    for old in checkpoint_files(folder)[:-KEPT]:
        with contextlib.suppress(OSError):  # Windows cannot remove an open file; the next call tries again
            old.unlink(missing_ok=True)
    return path


class OtherFormat(BadInput):
    """A checkpoint of another version of the format; the file is not damaged."""


def read_checkpoint(path: Path, components: Collection[Groups] = ()) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Read and check one checkpoint.

    Parameters
    ----------
    components : Collection[Mapping[str, type]], optional
        Groups of arrays of each component, `components.groups()`; arrays of other groups are not checked.

    Returns
    -------
    tuple[dict[str, ndarray], dict[str, Any]]
        Arrays of the state by name, and the metadata.

    Raises
    ------
    OtherFormat
        If it has another version of the format.
    FilesFailed
        If the system does not let it be read: no permission, an error of the device, too many open files, no memory.
    BadInput
        If it is not a checkpoint, is damaged, or has numbers that a state cannot have.
    """
    arrays, meta = read_archive(path)
    _name_own(arrays, meta)
    try:
        check_state(arrays, meta, components)
    except BadInput as error:
        raise BadInput(f"{path} cannot be resumed: {error}") from None
    return arrays, meta


def read_archive(path: Path) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Arrays and metadata as `write_checkpoint` wrote them, of a state or of anything else; raises its errors."""
    refuse_devices(path)
    try:
        content = path.read_bytes()
    except (OSError, MemoryError) as error:
        raise _unreadable(path, error) from error
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = archive.infolist()
            # SAND does not compress: members that exceed the file are not from SAND, and need not be unpacked to know
            size = sum(one.file_size for one in members)
            if size > len(content) or any(one.compress_type != zipfile.ZIP_STORED for one in members):
                raise zipfile.BadZipFile
            if archive.testzip():  # before NumPy allocates arrays of sizes that may be wrong
                raise zipfile.BadZipFile
        with np.load(io.BytesIO(content), allow_pickle=False) as saved:
            arrays = {name: saved[name] for name in saved.files}
        meta = json.loads(arrays.pop(META).tobytes())
        is_dictionary = isinstance(meta, dict)
    except MemoryError as error:
        raise _unreadable(path, error) from error
    except Exception as error:  # numpy and zipfile raise various exceptions for broken files
        raise BadInput(f"{path} is not a readable checkpoint ({type(error).__name__})") from error
    if not is_dictionary or meta.get("format") != "SAND checkpoint" or not isinstance(meta.get("version"), int):
        raise BadInput(f"{path} is not a checkpoint of SAND")
    if meta["version"] != VERSION:
        advice = "update SAND" if meta["version"] > VERSION else "resume it with the development version that wrote it"
        raise OtherFormat(f"{path} has format {meta['version']}, and this SAND reads format {VERSION}; {advice}")
    if _checksum(arrays) != meta.get("sha256"):
        raise BadInput(f"{path} is damaged: its checksum is wrong")
    return arrays, meta


def _unreadable(path: Path, error: BaseException) -> FilesFailed:
    """The error of a file that may be whole, but cannot be read now."""
    code = getattr(error, "errno", None)
    reason = "not enough memory" if isinstance(error, MemoryError) else os.strerror(code) if code else str(error)
    return FilesFailed(
        f"cannot read {path}: {reason}; it may be whole, so it stays as it is, and no older one is taken: try again "
        "when it can be read, or move it elsewhere to continue from the one before"
    )


def _name_own(arrays: dict[str, np.ndarray], meta: dict[str, Any]) -> None:
    """Own quantities of a checkpoint that was written when the only one was the temperature of the grain."""
    only = arrays.pop("grains/internal_temperature", None)
    if only is not None and "grains/own" not in arrays:
        meta["own"] = {"internal_temperature": "K"} if only.any() else {}
        arrays["grains/own"] = only[None][: len(meta["own"])]


def newest_checkpoint(
    folder: Path, components: Collection[Groups] = (), read: Reader | None = None
) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Read the newest intact checkpoint of a folder; damaged newer ones are renamed, with a warning.

    Parameters
    ----------
    components : Collection[Mapping[str, type]], optional
        As of `read_checkpoint`.
    read : callable or None, optional
        What reads a file, such as `read_archive`; by default `read_checkpoint`.

    Returns
    -------
    tuple[dict[str, ndarray], dict[str, Any]]
        Arrays of the state by name, and the metadata.

    Raises
    ------
    OtherFormat
        If the newest readable file has another version of the format.
    BadInput
        If there is no intact checkpoint; no file is renamed then.
    FilesFailed
        If one cannot be read, though it may be whole, or a damaged one cannot be renamed.
    """
    problems: list[tuple[Path, str]] = []
    for path in reversed(checkpoint_files(folder)):
        try:
            arrays, meta = read_checkpoint(path, components) if read is None else read(path)
        except OtherFormat:
            raise
        except BadInput as error:
            problems.append((path, str(error)))
            continue
        for damaged, message in problems:
            try:
                aside = set_aside(damaged)
            except OSError as error:
                raise FilesFailed(f"cannot rename {damaged}, which is damaged: {error.strerror}") from error
            warnings.warn(f"{message}; it is now {aside.name}, and the run continues from {path.name}", stacklevel=2)
        return arrays, meta
    raise BadInput([*(message for _, message in problems), f"{folder} holds no checkpoint to continue from"])
