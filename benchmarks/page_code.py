"""Python code of README and docs: whole scripts in blocks, and the cells of a page, which the docs execute in order."""

from __future__ import annotations

import linecache
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from .quoted import TOP

PAGES = (TOP / "README.md", *sorted((TOP / "docs").rglob("*.md")))
SCRIPT = re.compile(r"^```python\n(import .*?)^```$", re.MULTILINE | re.DOTALL)
"""A block of Python that begins with an import is a whole script; others are parts."""
CELL = re.compile(r"^```\{code-cell\}[^\n]*\n(?::[^\n]*\n)*(.*?)^```$", re.MULTILINE | re.DOTALL)


def scripts(page: Path) -> list[str]:
    """The whole scripts of a page."""
    return SCRIPT.findall(page.read_text("utf-8"))


def cells(page: Path) -> list[str]:
    """The code of the cells of a page, in order."""
    return CELL.findall(page.read_text("utf-8"))


def run_cells(codes: list[str]) -> None:
    """Run the cells of a page in the current folder as one program, without IPython.

    `%%name` calls the magic that a cell defined; `%%bash` by itself runs a shell script, which must succeed, and
    `%%writefile FILE` writes a file, which later cells may import.
    """
    magics: dict[str, Callable[[str, str], object]] = {
        "bash": lambda _, script: subprocess.run(["bash", "-c", script], check=True),
        "writefile": lambda file, text: Path(file).write_text(text, encoding="utf-8"),
    }
    instead: dict[str, Any] = {
        "IPython.core.magic": SimpleNamespace(register_cell_magic=lambda f: magics.update({f.__name__: f})),
        "IPython.display": SimpleNamespace(Markdown=str),
    }
    names: dict[str, object] = {"__name__": "__main__"}
    before = {name: sys.modules.get(name) for name in instead}
    path = list(sys.path)
    sys.modules.update(instead)
    sys.path.insert(0, os.getcwd())
    try:
        for number, code in enumerate(codes, 1):
            first, _, rest = code.partition("\n")
            if first.startswith("%%"):
                name, _, line = first[2:].partition(" ")
                magics[name](line, rest)
            else:
                file = f"<cell {number}>"
                # formulas of the user are compiled from their source
                linecache.cache[file] = (len(code), None, code.splitlines(True), file)
                exec(compile(code, file, "exec"), names)
    finally:
        sys.path[:] = path
        for name, module in before.items():
            sys.modules.pop(name) if module is None else sys.modules.update({name: module})
