"""Damaged files: digests that detect a change, and the names under which damaged files are kept."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path
from typing import Any

DAMAGED = ".damaged"
"""Suffix of damaged files, which are kept for inspection."""
DIGEST = "sha256"
"""Key of a JSON file with the digest of all other content."""


def sealed(content: dict[str, Any]) -> dict[str, Any]:
    """Add the digest to content that is to be written as JSON."""
    return {**content, DIGEST: digest_of(content)}


def digest_of(content: dict[str, Any]) -> str:
    """SHA-256 of JSON content without its own digest, independent of the order of keys and of white space."""
    rest = {key: value for key, value in content.items() if key != DIGEST}
    return hashlib.sha256(json.dumps(rest, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def set_aside(path: Path, *, copy: bool = False) -> Path:
    """Rename a damaged file to an unused name, or copy it.

    Returns
    -------
    Path
        The new name.

    Raises
    ------
    OSError
        If it cannot be renamed or copied.
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
