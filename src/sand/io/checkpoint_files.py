"""Which files of a folder are checkpoints, without NumPy, which takes long to load."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

from .run_folder import CHECKPOINT

META = "meta.json"
"""Name of the metadata in a checkpoint."""


def checkpoint_files(folder: Path) -> list[Path]:
    """The checkpoints of a folder, oldest first: files with the names that SAND gives, by the steps stored in them.

    A copy with a name that the user gave is none, and a copy of an older one under a later name stays the older one.
    """
    found = [path for path in folder.glob("checkpoint-*.npz") if CHECKPOINT.fullmatch(path.name)]
    return sorted(found, key=lambda path: (_stored_steps(path), path.name))


def _stored_steps(path: Path) -> int:
    """Number of steps stored in a checkpoint; that of its name if it cannot be read."""
    match = CHECKPOINT.fullmatch(path.name)
    named = int(match.group(1)) if match else -1
    try:
        with zipfile.ZipFile(path) as archive:
            if archive.getinfo(f"{META}.npy").compress_type != zipfile.ZIP_STORED:  # not from SAND, perhaps huge
                return named
            array = archive.read(f"{META}.npy")
        # bytes after the header of the format of NumPy, whose length is in bytes 8 and 9 (version 1)
        return int(json.loads(array[10 + int.from_bytes(array[8:10], "little") :])["steps"])
    except Exception:  # zipfile raises various exceptions for broken files
        return named
