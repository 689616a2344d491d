"""Files that were found damaged: digests that tell a change, and the names under which such files are kept."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path
from typing import Any

DAMAGED = ".damaged"
"""Ending of the names of files that were found damaged, kept for the user to look at."""
DIGEST = "sha256"
"""The key of a JSON file under which the digest of all else in it stands."""


def sealed(content: dict[str, Any]) -> dict[str, Any]:
    """Plain content to be written as JSON, and with it its digest."""
    return {**content, DIGEST: digest_of(content)}


def digest_of(content: dict[str, Any]) -> str:
    """SHA-256 of plain content but for its own digest, whatever the order of its keys and the spaces between them."""
    rest = {key: value for key, value in content.items() if key != DIGEST}
    return hashlib.sha256(json.dumps(rest, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def set_aside(path: Path, *, copy: bool = False) -> Path:
    """Rename a damaged file to a free name that nothing reads, or copy it to one; returns that.

    Raises
    ------
    OSError
        it cannot be renamed or copied.
    """
    aside, number = path.with_name(path.name + DAMAGED), 1
    while aside.exists():
        number += 1
        aside = path.with_name(f"{path.name}{DAMAGED}-{number}")
    if copy:
        shutil.copyfile(path, aside)
    else:
        path.replace(aside)
    return aside


def set_aside_in(folder: Path, names: tuple[str, ...]) -> list[Path]:
    """The files that `set_aside` has left of files with these names or patterns."""
    return [path for name in names for path in folder.glob(f"{name}{DAMAGED}*")]
