"""The tiers of the tests: default and excluded tests, and the guard against unmarked compilation."""

from types import SimpleNamespace

import pytest

from sand.compiler.jit import COMPILED, kernel

from ...claims import rows_of
from ...validation import BoundRecorder, Recorder, parse_part, part_of


def test_an_unmarked_test_compiles_nothing():
    """The guard of conftest.py raises before a stage is compiled; a disk cache would make this pass by chance."""
    if not COMPILED:
        pytest.skip("nothing is compiled")
    new = kernel(lambda x: x + 1.0, cached=False)
    with pytest.raises(AssertionError, match=r"compiles .*pytest\.mark\.compiled"):
        new(1.0)


def test_parts_are_a_partition():
    """Each test is in exactly one of ten parts, independent of other tests."""
    names = [f"tests/unit/test_a.py::test_{k}" for k in range(200)]
    parts = [[name for name in names if part_of(name, (k, 10))] for k in range(10)]
    assert sorted(name for part in parts for name in part) == sorted(names)
    assert all(len(part) > 5 for part in parts)
    assert parse_part("3/10") == (3, 10)


@pytest.mark.parametrize("text", ["10/10", "1", "a/b", "-1/3"])
def test_parts_that_do_not_exist(text):
    """K of N is from 0 to N − 1."""
    with pytest.raises(Exception, match="must be K/N"):
        parse_part(text)


def test_the_record_has_the_numbers_of_passed_tests(tmp_path):
    """Rows of tests that ran are replaced or removed, those of tests that are gone removed, others stay as they are."""
    other, same = (
        "tests/unit/repository/test_tiers.py::test_parts_are_a_partition",
        "tests/unit/repository/test_tiers.py::test_parts_that",
    )
    old = [
        (name, "x", "1", "", "2", "2020-01-01", "abc")
        for name in ("tests/gone.py::test_it", other, f"{same}_do[a]", f"{same}_do_not_exist[of another version]")
    ]
    path = tmp_path / "record.csv"
    lines = ["test,quantity,value,least,most,date,commit", *(",".join(row) for row in old)]
    path.write_text("\n".join(lines) + "\n", "utf-8")
    recorder, properties = Recorder(path), []
    recorder.cases.add(f"{same}_do_not_exist[a/b]")
    check = BoundRecorder(properties)
    check("energy error", 2e-7, most=1e-6)
    for quantity, value, bounds in (("a", 2.0, {"most": 1.0}), ("b", float("nan"), {"least": 0.0}), ("c", 0.0, {})):
        with pytest.raises(AssertionError, match=r"is not within|give a bound"):
            check(quantity, value, **bounds)
    for name, passed in (("new", True), ("that_do[a]", False)):
        report = {"when": "call", "skipped": False, "passed": passed, "user_properties": properties[:1]}
        nodeid = f"tests/unit/repository/test_tiers.py::test_{name}" if passed else f"{same}_do[a]"
        recorder.pytest_runtest_logreport(SimpleNamespace(nodeid=nodeid, **report))
    recorder.pytest_sessionfinish(None)
    new, kept = rows_of(path)
    assert (new["test"], new["value"], new["least"], new["most"]) == (
        "tests/unit/repository/test_tiers.py::test_new", "2e-07", "", "1e-06",
    )  # fmt: skip
    assert tuple(kept.values()) == old[1]
