"""The table of planted faults matches the sources and tests, and planting restores every file."""

import ast
import shutil
import subprocess
import sys
from collections import Counter

import pytest

from sand.io import page_bundle

from .faults import AREAS, FAULTS, KINDS, SOURCES, Fault
from .plant import BUILT, CRASH, HERE, MISSED, TIMEOUT, Finding, as_markdown, chosen, copy_of, planted, verdict


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_fits_its_file_and_names_a_test_that_exists(fault):
    """Its text occurs once, the replacement differs and is valid Python, and the named test exists."""
    text = (HERE / SOURCES / fault.file).read_text(encoding="utf-8")
    assert text.count(fault.old) == 1
    assert fault.old != fault.new and "\n" not in fault.old.rstrip("\n")
    compile(text.replace(fault.old, fault.new), fault.file, "exec")
    file, *parts = fault.named.split("::")
    found = ast.parse((HERE / file).read_text(encoding="utf-8")).body
    assert parts
    for part in parts:
        found = next(node.body for node in found if getattr(node, "name", None) == part.split("[")[0])


def test_faults_are_of_all_kinds_everywhere():
    """At least thirty with unique names; every kind, and every part of the program."""
    assert len(FAULTS) == len({fault.name for fault in FAULTS}) >= 30
    assert {fault.kind for fault in FAULTS} == set(KINDS)
    assert {fault.area for fault in FAULTS} == set(AREAS)
    assert min(Counter(fault.area for fault in FAULTS if fault.area not in ("analysis", "set-up")).values()) >= 3
    assert chosen(["forgotten image"]) == [fault for fault in FAULTS if fault.kind == "forgotten image"]


@pytest.mark.parametrize(
    ("code", "output", "expected"),
    [
        (0, "3 passed", None),
        (1, "F\nFAILED tests/a.py::test_b[x-1] - assert 1 == 2\n1 failed", "tests/a.py::test_b[x-1]"),
        (1, "FAILED tests/a.py::test_b[two words] - E\n", "tests/a.py::test_b[two words]"),
        (2, "ERROR tests/a.py - NameError\n!!! Interrupted", "tests/a.py"),
        (None, "", TIMEOUT),
        (-11, "", CRASH),
    ],
)
def test_verdict_from_the_output_of_pytest(code, output, expected):
    """Exit code and summary give the name of the failed test, or CRASH or TIMEOUT."""
    assert verdict(code, output) == expected


@pytest.mark.parametrize("code", [1, 3, 4, 5])
def test_a_run_without_a_failed_test_is_no_catch(code):
    """A wrong name or an internal error of pytest ends the script and does not count as a failed test."""
    with pytest.raises(SystemExit, match=f"exit code {code}"):
        verdict(code, "no tests ran")


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
def test_planting_changes_a_copy_temporarily(tmp_path):
    """The copy has the fault inside the block and the old file with its times after it; the tree never changes."""
    tree = tmp_path / "tree"
    (tree / BUILT).mkdir(parents=True)
    (tree / SOURCES / "one.py").write_text("x = 1\n", encoding="utf-8")
    (tree / "built.js").write_text("ignored")
    (tree / BUILT / "page.js").write_text("built")
    (tree / ".gitignore").write_text("built.js\npage/\n")
    subprocess.run(["git", "init", "-q"], cwd=tree, check=True)
    copy = copy_of(tree, tmp_path / "copy")
    assert {path.name for path in copy.rglob("*") if path.is_file()} == {"one.py", ".gitignore", "page.js"}
    times, fault = (copy / SOURCES / "one.py").stat(), Fault("two", "sign", "formula", "one.py", "1", "2", "t")
    with planted(copy, fault):
        assert (copy / SOURCES / "one.py").read_text() == "x = 2\n"
    assert (copy / SOURCES / "one.py").read_text() == (tree / SOURCES / "one.py").read_text() == "x = 1\n"
    assert (copy / SOURCES / "one.py").stat().st_mtime_ns == times.st_mtime_ns
    with pytest.raises(SystemExit, match="occurs 0 times"), planted(copy, Fault("no", "", "", "one.py", "y", "z", "t")):
        raise AssertionError


def test_the_table_counts_caught_faults():
    """A failed test and a crash catch a fault; a pass and a timeout do not."""
    found = [Finding(FAULTS[0], by, "the named test", 1.0) for by in ("tests/a.py::test_b", CRASH, MISSED, TIMEOUT)]
    assert [one.caught for one in found] == [True, True, False, False]
    table = as_markdown(found, "abc", 60.0)
    assert "2 of 4 caught" in table and "MISSED by the named test" in table


def test_the_script_lists_its_faults():
    """`python -m tests.faults.plant --list` from the top of a checkout."""
    words = [sys.executable, "-m", "tests.faults.plant", "--list", "--only", "command"]
    done = subprocess.run(words, cwd=HERE, capture_output=True, text=True, check=True)
    assert len(done.stdout.splitlines()) == 3


def test_the_built_page_is_where_the_program_reads_it():
    """The copy in which faults are planted needs the page bundle, which is not in git."""
    assert HERE / BUILT == page_bundle.PAGE
