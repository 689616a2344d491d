"""checkpoint-*.npz: the whole state in float64, versioned and checksummed; two are kept.

A NumPy archive of plain arrays, without pickles, written beside, synced and renamed.

| array | meaning |
|---|---|
| meta.json | JSON as bytes: `format`, `version`, `sha256` over all else, step, time, planned end, case, choices |
| clock | time, steps and what is left of the cycle [s]; meta.json names the places of this and of the next two |
| count | numbers of steps, contacts, pairs, made, broken, moved; counters of lists |
| lost | energy lost per channel [J] |
| ledger | all rows so far, (K, columns of ledger.csv) |
| grains/… | every quantity of a grain, (N,) or (3, N), SI, and indices of materials |
| contacts/… | pairs, pointers in body frames, twist, time of touch, constants, losses, loads, contacts per grain |
| near/… | the list of pairs that may touch, and the positions when it was made |
| order | the grain at each place in memory, (N,), where an order is kept; all else is in the order of the grains |
| far/… | loads of the last long-range summation, what their cycle has used up, positions when the list was made |

`io.state_arrays` says what each array must be like.

Random numbers are functions of the seed, the grain and the number of the kick, so that there is no state of a generator
to be kept.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import math
import warnings
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import BadInput, FilesFailed
from .damage import set_aside
from .run_folder import refuse_devices, replace_file
from .state_arrays import check_state

VERSION = 5
"""Version of the file format; files of other versions are refused.  Versions before 5 were never released."""
KEPT = 2
_META = "meta.json"


def _checksum(arrays: dict[str, np.ndarray]) -> str:
    digest = hashlib.sha256()
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def checkpoint_name(steps: int) -> str:
    """Name of the file of the state after so many steps; in the order of the names later ones come later."""
    return f"checkpoint-{int(steps):015d}.npz"


def write_checkpoint(folder: Path, arrays: dict[str, np.ndarray], meta: dict[str, Any]) -> Path:
    """Write one checkpoint, then drop all but the newest two.

    Parameters
    ----------
    arrays : dict[str, ndarray]
        the state by name.
    meta : dict[str, Any]
        plain numbers and text that go with it; must hold `steps`.

    Raises
    ------
    FilesFailed
        nothing is lost, the older checkpoints stay.
    """
    header = {"format": "SAND checkpoint", "version": VERSION, "sha256": _checksum(arrays), **meta}
    text = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    memory = io.BytesIO()
    np.savez(memory, **{_META: text}, **arrays)  # type: ignore[arg-type]
    path = folder / checkpoint_name(meta["steps"])
    replace_file(path, memory.getvalue())
    for old in sorted(folder.glob("checkpoint-*.npz"))[:-KEPT]:
        with contextlib.suppress(OSError):  # Windows removes no file that somebody reads; the next time it goes, too
            old.unlink(missing_ok=True)
    return path


def _refuse_impossible_sizes(path: Path) -> None:
    """Look at the sizes in the archive before memory is taken: ours are stored as they are, so none exceeds the file.

    Raises
    ------
    ValueError
        an array larger than the file, or than its part of it.
    """
    refuse_devices(path)
    size = path.stat().st_size
    with zipfile.ZipFile(path) as archive:
        for part in archive.infolist():
            if part.compress_type != zipfile.ZIP_STORED or part.file_size > size:
                raise ValueError(f"{part.filename} is not what SAND writes")
            with archive.open(part) as file:
                version = np.lib.format.read_magic(file)
                read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
                shape, _, kind = read(file)
                if math.prod(shape) * kind.itemsize > part.file_size:
                    raise ValueError(f"{part.filename} says that it is larger than the file")


class OtherFormat(BadInput):
    """A checkpoint of another version of the format; the file is not damaged."""


def read_checkpoint(path: Path) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Arrays and meta of one checkpoint, fit to go on from.

    Raises
    ------
    OtherFormat
        another version of the format.
    BadInput
        not a checkpoint, damaged, or with numbers that a state cannot have.
    """
    try:
        _refuse_impossible_sizes(path)
        with np.load(path, allow_pickle=False) as saved:
            arrays = {name: saved[name] for name in saved.files}
        meta = json.loads(arrays.pop(_META).tobytes())
        whole = isinstance(meta, dict)
    except Exception as error:  # whatever a broken file makes the readers do
        raise BadInput(f"{path} is not a readable checkpoint ({type(error).__name__})") from error
    if not whole or meta.get("format") != "SAND checkpoint" or not isinstance(meta.get("version"), int):
        raise BadInput(f"{path} is not a checkpoint of SAND")
    if meta["version"] != VERSION:
        advice = "update SAND" if meta["version"] > VERSION else "resume it with the development version that wrote it"
        raise OtherFormat(f"{path} has format {meta['version']}, and this SAND reads format {VERSION}; {advice}")
    if _checksum(arrays) != meta.get("sha256"):
        raise BadInput(f"{path} is damaged: its checksum is wrong")
    try:
        check_state(arrays, meta)
    except BadInput as error:
        raise BadInput(f"{path} cannot be gone on from: {error}") from None
    return arrays, meta


def newest_checkpoint(folder: Path) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """The newest checkpoint that is whole; newer ones that are not are renamed, with a warning that says so.

    Raises
    ------
    OtherFormat
        the newest readable file has another version of the format.
    BadInput
        there is none; no file is renamed then.
    FilesFailed
        a damaged one cannot be renamed.
    """
    problems: list[tuple[Path, str]] = []
    for path in sorted(folder.glob("checkpoint-*.npz"), reverse=True):
        try:
            arrays, meta = read_checkpoint(path)
        except OtherFormat:
            raise
        except BadInput as error:
            problems.append((path, str(error)))
            continue
        for damaged, said in problems:
            try:
                aside = set_aside(damaged)
            except OSError as error:
                raise FilesFailed(f"cannot rename {damaged}, which is damaged: {error.strerror}") from error
            warnings.warn(f"{said}; it is now {aside.name}, and the run goes on from {path.name}", stacklevel=2)
        return arrays, meta
    raise BadInput([*(said for _, said in problems), f"{folder} holds no checkpoint to go on from"])
