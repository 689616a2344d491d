"""Python code of README and docs: whole scripts in blocks, and the cells of a page, which the docs execute in order."""

from __future__ import annotations

import linecache
import re
import sys
import types
from collections.abc import Callable
from pathlib import Path

from .quoted import TOP

PAGES = (TOP / "README.md", *sorted((TOP / "docs").rglob("*.md")))
SCRIPT = re.compile(r"^```python\n(import .*?)^```$", re.MULTILINE | re.DOTALL)
"""A block of Python that begins with an import is a whole script; others are parts."""
CELL = re.compile(r"^```\{code-cell\}[^\n]*\n((?::[^\n]*\n)*)(.*?)^```$", re.MULTILINE | re.DOTALL)


def scripts(page: Path) -> list[str]:
    """The whole scripts of a page."""
    return SCRIPT.findall(page.read_text("utf-8"))


def cells(page: Path) -> list[str]:
    """The code of the cells of a page, in order."""
    return [code for _, code in CELL.findall(page.read_text("utf-8"))]


def run_cells(codes: list[str]) -> None:
    """Run the cells of a page in the current folder as one program; `%%name` calls the magic that a cell defined."""
    magics: dict[str, Callable[[str, str], None]] = {}
    module = types.ModuleType("IPython.core.magic")
    module.register_cell_magic = lambda magic: magics.setdefault(magic.__name__, magic)  # type: ignore[attr-defined]
    before = sys.modules.get(module.__name__)
    sys.modules[module.__name__] = module
    names: dict[str, object] = {"__name__": "__main__"}
    try:
        for number, code in enumerate(codes, 1):
            first, _, rest = code.partition("\n")
            if first.startswith("%%"):
                magics[first[2:]]("", rest)
            else:
                file = f"<cell {number}>"
                # formulas of the user are compiled from their source
                linecache.cache[file] = (len(code), None, code.splitlines(True), file)
                exec(compile(code, file, "exec"), names)
    finally:
        del sys.modules[module.__name__]
        if before is not None:
            sys.modules[module.__name__] = before
