"""The figures of cost that README, docs, CONTRIBUTING and ARCHITECTURE quote: one file, and copies.

`docs/measured.json` has a record for each measurement: what was measured, by which command, at which commit, when and
on which machine; `values` by name, each a number and its unit, or a text; or a table, `columns` and `rows`.

A page of the docs quotes a value as `{{ main_job.time }}` and a table as `{{ scaling.table }}` on a line of its own.
README and the other pages at the top have copies between comments, `<!-- main_job.time -->4.7 s<!-- end -->`;
`python -m benchmarks --quoted` writes file and copies (`quick_figures.py`).
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

TOP = Path(__file__).parents[1]
FILE = TOP / "docs" / "measured.json"
COPIES = tuple(TOP / name for name in ("README.md", "CONTRIBUTING.md", "ARCHITECTURE.md"))
"""Pages that hold copies."""
COPY = re.compile(r"<!-- (\w+\.\w+) -->(.*?)<!-- end -->", re.DOTALL)
"""A copy in a page: the name, and the text."""
QUOTE = re.compile(r"\{\{ ([\w.]+) \}\}")
"""A quotation in a page of the docs."""
ABOUT = ("what", "command", "commit", "date", "machine")
"""What a record says besides its values."""


def read() -> dict[str, Any]:
    """All records by name."""
    return dict(json.loads(FILE.read_text("utf-8")))


def write(records: dict[str, Any]) -> None:
    """Write the file: a line for each value and each row."""
    text = json.dumps(records, indent=2, ensure_ascii=False)
    text = re.sub(r"\[\s+([^\[\]]*?)\s+\]", lambda found: "[" + re.sub(r"\s*\n\s*", " ", found[1]) + "]", text)
    FILE.write_text(text + "\n", encoding="utf-8")


def text_of(value: Any) -> str:
    """4.7 s of [4.7, "s"], 9,885 of [9885, ""]; a text as it is."""
    if isinstance(value, str):
        return value
    number, unit = value
    return f"{number:,} {unit}".rstrip()


def table_of(record: dict[str, Any]) -> str:
    """The table of a record in Markdown."""
    rows = [record["columns"], ["---"] * len(record["columns"]), *record["rows"]]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def sources(records: dict[str, Any]) -> str:
    """A table in Markdown: where and when each record was measured."""
    rows = [[record[name] for name in ABOUT] for record in records.values()]
    return table_of({"columns": list(ABOUT), "rows": [[row[0], f"`{row[1]}`", *row[2:]] for row in rows]})


def quotable() -> dict[str, dict[str, str] | str]:
    """What pages may quote: of each record its values, its table and what it says of itself, as text."""
    records = read()
    found: dict[str, dict[str, str] | str] = {"sources": sources(records)}
    for name, record in records.items():
        texts = {key: text_of(value) for key, value in record.get("values", {}).items()}
        tables = {"table": table_of(record)} if "rows" in record else {}
        found[name] = {key: record[key] for key in ABOUT} | texts | tables
    return found


def with_copies(page: str) -> str:
    """A page of the top with the copies that it should have, in text or as a block of code."""
    values = quotable()

    def copy(found: re.Match[str]) -> str:
        record, _, name = found[1].partition(".")
        text = dict(values[record])[name]
        block = re.match(r"\n```\w+\n", found[2])
        text = f"{block[0]}{text}\n```\n" if block else text
        return f"<!-- {found[1]} -->{text}<!-- end -->"

    return COPY.sub(copy, page)


def write_copies() -> None:
    """Bring the pages of the top up to date."""
    for page in COPIES:
        page.write_text(with_copies(page.read_text("utf-8")), encoding="utf-8")
