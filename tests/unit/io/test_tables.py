"""Tables of numbers: each row is written once, in its place, and read back to the last bit."""

import csv
import math

import pytest

from sand.io.sweep_files import read_lines, read_runs, read_sweep, write_sweep
from sand.io.table import GrowingTable, write_table

ROWS = [[1, 0.1], [2, 0.2], [3, 1e-300], [4, 5e22]]
HEAD = ("number", "size")


def test_a_table_has_all_its_rows(tmp_path):
    """A header and a line for each row, in their order; floats by `repr`, text as it is."""
    rows = [{"name": f"row {k}", "size": size} for k, (_, size) in enumerate(ROWS)]
    write_table(tmp_path / "a.csv", rows)
    with open(tmp_path / "a.csv", newline="") as file:
        assert list(csv.reader(file)) == [["name", "size"], *([row["name"], repr(row["size"])] for row in rows)]


def test_a_table_is_continued_after_a_kill(tmp_path):
    """Complete rows survive a kill that cut the last one, and new rows follow them."""
    table = GrowingTable(tmp_path / "a.csv", HEAD)
    table.add(ROWS[:2])
    table.add(ROWS[2:3])
    with open(tmp_path / "a.csv", "a") as torn:
        torn.write("4,5e")
    again = GrowingTable(tmp_path / "a.csv", HEAD, resume=True)
    assert again.rows == ROWS[:3]
    again.add(ROWS[3:])
    assert GrowingTable(tmp_path / "a.csv", HEAD, resume=True).rows == ROWS
    assert GrowingTable(tmp_path / "a.csv", HEAD).rows == []


def test_a_table_is_sorted_by_number(tmp_path):
    """By value, not as text, without losing a row."""
    table = GrowingTable(tmp_path / "a.csv", HEAD)
    table.add([[10, 1.0], [9, 2.0], [9, 1.5]])
    table.sort()
    assert GrowingTable(tmp_path / "a.csv", HEAD, resume=True).rows == [[9, 1.5], [9, 2.0], [10, 1.0]]


def test_rows_of_a_sweep(tmp_path):
    """Tables of runs are in one table of all rows, with keys, seed and run, and are found again run by run.

    Names of runs stay texts, also if all of them are digits; a run that failed has no rows.
    """
    shared = {"message": "", "seconds": 1.0, "cpu_seconds": 1.0, "version": "1"}
    tables = {"640712345678": {"x": [1.0, 2.5], "word": ["a", "b"]}, "012345678901": {"x": [None], "word": ["c"]}}
    runs = [
        {"key": 10 * k, "seed": k, "state": "done", **shared, "run": name, "table": table}
        for k, (name, table) in enumerate(tables.items(), 1)
    ]
    failed = {"key": 30, "seed": 3, "state": "failed", **shared, "run": "999999999999"}
    write_sweep(tmp_path, [*runs, failed])
    lines = read_lines(tmp_path)
    assert list(lines) == ["key", "seed", "x", "word", "run"]
    assert lines["run"].tolist() == ["640712345678", "640712345678", "012345678901"]
    assert lines["key"].tolist() == [10, 10, 20] and lines["word"].tolist() == ["a", "b", "c"]
    first, second, third = read_runs(tmp_path)
    assert first["table"] == {"x": [1.0, 2.5], "word": ["a", "b"]} and first["seed"] == 1
    assert math.isnan(second["table"]["x"][0]) and second["run"] == "012345678901"
    assert "table" not in third and "table" not in read_sweep(tmp_path)
    pyarrow = pytest.importorskip("pyarrow.parquet")
    write_sweep(tmp_path, [*runs, failed], parquet=True)
    assert pyarrow.read_table(tmp_path / "rows.parquet")["x"].to_pylist() == [1.0, 2.5, None]
