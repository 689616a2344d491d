"""Additions to autodoc: tables of records and of case-file keys; formulas and |x| in docstrings; named tuples."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import json
import re
from typing import Any

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

from sand.config import template


def attribute(path: str) -> Any:
    """The object of a dotted name, in a module that is imported if necessary."""
    module, _, name = path.rpartition(".")
    try:
        return getattr(importlib.import_module(module), name)
    except ModuleNotFoundError:
        return getattr(attribute(module), name)


def paragraph(text: str) -> nodes.paragraph:
    """A paragraph; text in `backticks` is code."""
    parts = [(nodes.literal if k % 2 else nodes.Text)(*[part] * (1 + k % 2)) for k, part in enumerate(text.split("`"))]
    return nodes.paragraph("", "", *parts)


def _entry(value: Any) -> nodes.entry:
    """A cell; text in `backticks` is code."""
    return nodes.entry("", paragraph(f"{value:g}" if isinstance(value, float) else str(value)))


def keys_of(model: Any) -> list[tuple[str, str, str]]:
    """Key, default and description of each field of a section of a case file."""
    rows = []
    for name, meaning, value in template.keys_of(model):
        default = "required" if value is template.REQUIRED else "none" if value is None else f"`{json.dumps(value)}`"
        rows.append((name, default, meaning))
    return rows


class Records(SphinxDirective):
    """`records:: NAME`: a table of the fields of a pydantic model, of records in a tuple or dict, or returned."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """The table; the first column is code."""
        thing = attribute(self.arguments[0])
        if isinstance(thing, type):
            heads, rows = ["key", "default", "meaning"], keys_of(thing)
        else:
            thing = thing() if callable(thing) else thing
            records = list(thing.values()) if isinstance(thing, dict) else list(thing)
            first = records[0]
            heads = first._fields if isinstance(first, tuple) else [field.name for field in dataclasses.fields(first)]
            rows = [[getattr(record, head) for head in heads] for record in records]
        widths = [max(len(str(text)) for text in column) for column in zip(heads, *rows, strict=True)]
        group = nodes.tgroup("", *[nodes.colspec(colwidth=min(width, 60)) for width in widths], cols=len(heads))
        group += nodes.thead("", nodes.row("", *[_entry(head.replace("_", " ")) for head in heads]))
        group += nodes.tbody("", *[nodes.row("", _entry(f"`{row[0]}`"), *map(_entry, row[1:])) for row in rows])
        return [nodes.table("", group, classes=["colwidths-auto"])]


def escaped(line: str) -> str:
    """A line of text in which |x| is a magnitude and * a product; both stay as they are in `backticks`."""
    bullet = re.match(r" *\* |", line)[0]
    parts = re.split(r"(`+[^`]+`+)", line[len(bullet) :])
    return bullet + "".join(part if k % 2 else re.sub(r"(?<!\\)([|*])", r"\\\1", part) for k, part in enumerate(parts))


def plain_text(app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Prepare a docstring: formulas, which are indented, as literal blocks; Markdown tables as lists; |x| escaped."""
    if what == "attribute" and lines and lines[0].startswith("Alias for field number"):
        owner, _, field = name.rpartition(".")
        note = re.search(rf"^    {field}: [^\n#]*# (.*)$", inspect.getsource(attribute(owner)), re.M)
        lines[:] = [note[1] if note else ""]
    out: list[str] = []
    literal = table = sections = False
    for line, before in zip(lines, ["", *lines], strict=False):
        if re.fullmatch("-{3,}", line):  # the heading of a section
            sections = before not in ("Notes", "Examples")
        indented = line.startswith("    ") and not sections
        if indented and not before.strip() and not literal:
            literal = True
            out += ["::", ""]
        elif line.strip() and not indented:
            literal = False
        if line.startswith("|") and line.endswith("|"):
            if not table:
                out += [".. list-table::", "   :header-rows: 1", ""]
            table = True
            cells = [escaped(cell.strip()) for cell in line.strip("|").split(" | ")]
            if not set(line) <= set("|-: "):
                out += [f"   {'* -' if k == 0 else '  -'} {cell}" for k, cell in enumerate(cells)]
            continue
        if table:
            out.append("")
            table = False
        out.append(line if literal else escaped(line))
    lines[:] = out


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.add_directive("records", Records)
    app.connect("autodoc-process-docstring", plain_text, priority=100)  # before numpydoc
    return {"parallel_read_safe": True, "parallel_write_safe": True}
