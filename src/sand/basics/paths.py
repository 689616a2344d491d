"""Names of files and folders as the user gives them: `~` is the home folder."""

from __future__ import annotations

import os
from pathlib import Path

from .errors import BadInput, shown

LONGEST_NAME, LONGEST_PATH = 255, 4000
"""Bytes of one name, and characters of a whole path."""


def checked_name(text: str, name: str) -> str:
    """Check the name of a file or folder, and replace a leading `~` or `~USER` by the home folder.

    Parameters
    ----------
    text : str
        The name as the user gave it.
    name : str
        Name of the option or setting, for the message.

    Raises
    ------
    BadInput
        If it is empty, or not valid on any system.
    """
    if not text.strip() or "\0" in text:
        raise BadInput(f"{name} = {text!r} is not the name of a file or folder")
    try:
        longest = max(len(os.fsencode(part)) for part in text.replace("\\", "/").split("/"))
    except UnicodeEncodeError:  # half of a surrogate pair
        raise BadInput(f"{name} = {text!r} is not the name of a file or folder") from None
    if longest > LONGEST_NAME or len(text) > LONGEST_PATH:
        raise BadInput(f"{name} = '{text[:40]}…' is too long for the name of a file or folder")
    return os.path.expanduser(text)


def user_path(path: str | Path, name: str = "path") -> Path:
    """A path from a name as the user gives it; see `checked_name`.  Raises BadInput."""
    if not isinstance(path, (str, Path)):
        raise BadInput(f"{name} = {shown(path)} must be a path")
    return Path(checked_name(str(path), name))
