"""The order of imports: a package or module of `src/sand` imports only from rows above its own.

This table is the only one.  ``python -m tests.structure.layers`` writes it into ARCHITECTURE.md.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

TOP = Path(__file__).parents[2]
SOURCE = TOP / "src" / "sand"
PLAN = TOP / "ARCHITECTURE.md"
MARKS = "<!-- layers -->\n", "<!-- end of layers -->"

LAYERS = (
    ("basics",),
    ("compiler",),
    ("numerics",),
    ("contact",),
    ("neighbours", "forces"),
    ("integrate", "theory", "io"),
    ("analysis",),
    ("setup", "limits"),
    ("engine",),
    ("components",),
    ("simulation",),
    ("config",),
    ("plotting",),
    ("viewer",),
    ("results",),
    ("experiments",),
    ("cli",),
    ("entry_points",),
)


def rank(name: str) -> int:
    """The row of a package or module; the top level (`sand/__init__.py`, `__main__.py`) comes last."""
    return next((row for row, names in enumerate(LAYERS) if name in names), len(LAYERS))


def purpose(name: str) -> str:
    """First sentence of the docstring of a package or module."""
    path = SOURCE / name / "__init__.py"
    text = ast.get_docstring(ast.parse((path if path.exists() else SOURCE / f"{name}.py").read_text("utf-8"))) or ""
    return " ".join(text.split("\n\n")[0].split()).rstrip(".")


def table() -> str:
    """The table as Markdown."""
    rows = [f"| `{name}` | {purpose(name)} |" for names in LAYERS for name in names]
    return "\n".join(["| imports only from rows above | contents |", "|---|---|", *rows, ""])


def written() -> str:
    """ARCHITECTURE.md with the table as it is now."""
    begin, end = map(re.escape, MARKS)
    return re.sub(f"(?<={begin}).*?(?={end})", lambda _: table(), PLAN.read_text("utf-8"), flags=re.DOTALL)


if __name__ == "__main__":
    PLAN.write_text(written(), "utf-8")
