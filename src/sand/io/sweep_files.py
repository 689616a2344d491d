"""Files of a sweep: the row of each run in a folder of its own, and the table of all rows as CSV or Parquet."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..basics.errors import BadInput, import_optional, warn
from .damage import sealed
from .run_folder import ROW, ROWS_CSV, RUNS, SWEEP_CSV, plain, read_json, replacing, write_json
from .table import read_table, write_table

PARQUET = "sweep.parquet"
"""The table for programs that read Apache Parquet."""
STATE, DONE, FAILED = "state", "done", "failed"
"""Column of the table that says how a run ended, and its values."""
LAST = ("message", "seconds", "cpu_seconds", "version", "run")
"""Columns after the results; `COST` of them depend on the machine and on interruptions, `TEXTS` are never numbers."""
COST, TEXTS = ("seconds", "cpu_seconds"), ("message", "version", "run")
TABLE = "table"
"""The result of a run that is a table of its own, such as that of a packing: columns by name, lists of equal length."""


def write_row(place: Path, row: dict[str, Any]) -> None:
    """Write the row of a run to its folder.  Raises FilesFailed."""
    write_json(place / ROW, sealed(plain(row)))


def read_row(place: Path) -> dict[str, Any] | None:
    """The row in the folder of a run; None if there is none, or if it is damaged, which is noted."""
    path = place / ROW
    if not path.exists():
        return None
    try:
        row = read_json(path)
        if {"case", "seed", STATE, "results", *LAST} <= row.keys():
            return row
        reason = f"{path} is not the row of a run"
    except BadInput as error:
        reason = str(error)
    warn(f"{reason}; this run is computed again")
    return None


def read_rows(folder: Path, without: Container[str] = ()) -> Iterator[tuple[str, dict[str, Any]]]:
    """Names and rows of all runs of a sweep that have ended, without those of some names."""
    for place in sorted((folder / RUNS).glob("*")):
        if place.name not in without and (row := read_row(place)) is not None:
            yield place.name, row


def flat(content: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """A dictionary of results as cells of a table: entries of dictionaries as `outer_inner`, lists as text."""
    cells: dict[str, Any] = {}
    for key, value in content.items():
        if isinstance(value, Mapping):
            cells |= flat(value, f"{prefix}{key}_")
        else:
            cells[f"{prefix}{key}"] = cell_of(value)
    return cells


def cell_of(value: Any) -> Any:
    """A value as it is, or the values of a list as text."""
    return " ".join(map(str, value)) if isinstance(value, (list, tuple)) else value


def columns_of(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Names of the columns of rows that may have different ones, the last of which are `LAST`."""
    names = dict.fromkeys(name for row in rows for name in row) or [STATE]
    return [*(name for name in names if name not in LAST), *LAST]


def write_sweep(folder: Path, rows: Sequence[Mapping[str, Any]], parquet: bool = False) -> None:
    """Write the table of a sweep, and `ROWS_CSV` if runs have tables of their own, numbers to full precision.

    With `parquet` also as Parquet.  Raises FilesFailed.
    """
    alone = [{name: cell for name, cell in row.items() if name != TABLE} for row in rows]
    _write(folder / SWEEP_CSV, columns_of(alone), alone, parquet)
    lines = [line for row in rows for line in lines_of(row)]
    if lines:
        names = dict.fromkeys(name for line in lines for name in line if name != "run")
        _write(folder / ROWS_CSV, [*names, "run"], lines, parquet)


def lines_of(row: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Rows of the table of a run, each with its keys, seed and name; none if it has no table."""
    columns, names = row.get(TABLE) or {}, list(row)
    shared = {name: row[name] for name in names[: names.index(STATE)]}
    lines = zip(*columns.values(), strict=True)
    return [{**shared, **dict(zip(columns, line, strict=True)), "run": row["run"]} for line in lines]


def _write(path: Path, names: Sequence[str], rows: Sequence[Mapping[str, Any]], parquet: bool) -> None:
    write_table(path, rows, names)
    if parquet:
        pyarrow = import_optional("pyarrow", "--parquet")
        import_optional("pyarrow.parquet", "--parquet")
        columns = {name: _of_one_type([row.get(name) for row in rows]) for name in names}
        with replacing(path.with_suffix(".parquet")) as file:
            pyarrow.parquet.write_table(pyarrow.table(columns), file)


def _of_one_type(values: list[Any]) -> list[Any]:
    """Values of a column as they are, or as text if they are of several types."""
    types = {type(value) for value in values if value is not None}
    if types <= {int, float}:
        return [None if value is None else float(value) for value in values] if float in types else values
    return values if len(types) < 2 else [None if value is None else str(value) for value in values]


def read_sweep(folder: Path) -> dict[str, np.ndarray]:
    """Columns of the table of a sweep: numbers, flags, or text; empty cells of numbers are NaN.  Raises BadInput."""
    return _read(folder / SWEEP_CSV, {STATE, *LAST}, "the table of a sweep")


def read_lines(folder: Path) -> dict[str, np.ndarray]:
    """Columns of the rows of the tables of all runs of a sweep, see `lines_of`.  Raises BadInput."""
    return _read(folder / ROWS_CSV, {"seed", "run"}, "the table of the rows of a sweep")


def read_runs(folder: Path) -> list[dict[str, Any]]:
    """Rows of the table of a sweep, with `TABLE` if runs have tables of their own.  Raises BadInput."""
    table = read_sweep(folder)
    columns = (column.tolist() for column in table.values())
    runs = [dict(zip(table, line, strict=True)) for line in zip(*columns, strict=True)]
    if not (folder / ROWS_CSV).exists():
        return runs
    lines = read_lines(folder)
    number, own = lines.pop("run"), [name for name in lines if name not in list(table)[: list(table).index(STATE)]]
    places = {number[rows[0]]: rows for rows in np.split(np.arange(len(number)), _changes(number)) if len(rows)}
    tables = {run: {name: lines[name][rows].tolist() for name in own} for run, rows in places.items()}
    return [one | ({TABLE: tables[one["run"]]} if one["run"] in tables else {}) for one in runs]


def _changes(column: np.ndarray) -> np.ndarray:
    """Places at which a column has another value than before."""
    return np.flatnonzero(column[1:] != column[:-1]) + 1


def _read(path: Path, needed: set[str], what: str) -> dict[str, np.ndarray]:
    names, *lines = read_table(path, needed, what)
    columns = {name: [line[k] for line in lines] for k, name in enumerate(names)}
    return {name: np.array(cells, str) if name in TEXTS else _column(cells) for name, cells in columns.items()}


def _column(texts: Iterable[str]) -> np.ndarray:
    """A column of numbers if all cells are numbers or empty, of flags, or of text."""
    cells = list(texts)
    filled = [cell for cell in cells if cell]
    if filled and set(filled) <= {"True", "False"} and len(filled) == len(cells):
        return np.array([cell == "True" for cell in cells])
    for kind in (int, float):
        try:
            numbers = [kind(cell) for cell in filled]
        except ValueError:
            continue
        if filled and len(filled) == len(cells):
            return np.array(numbers)
        if filled:
            return np.array([float(cell) if cell else np.nan for cell in cells])
    return np.array(cells, dtype=str)
