"""A helper process: compiles stages into the cache for a program that waits for them (`ahead`)."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import threading

from .ahead import compile_free, kernel_from
from .progress import suppress_notes


def _end_with_parent() -> None:
    """End at once when the pipe from the parent is closed: it has ended, however that happened."""
    while os.read(sys.stdin.fileno(), 64):
        pass
    os._exit(1)


def main() -> None:
    """Read recipes from stdin, and compile what no other process compiles."""
    suppress_notes()
    recipes = json.loads(sys.stdin.buffer.readline())
    threading.Thread(target=_end_with_parent, daemon=True).start()
    for recipe in recipes:
        with contextlib.suppress(Exception):  # the parent compiles it, and shows why it cannot be compiled
            compile_free([kernel_from(recipe)])
