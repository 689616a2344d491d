"""Tables of numbers: each row is written once, in its place, and read back to the last bit."""

import csv

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
