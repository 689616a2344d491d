"""The page on validation: each claim has its numbers and each number its claim; campaigns are those of their tables."""

import ast
import math

import pytest
from matplotlib.figure import Figure

from sand.experiments import reproduce
from sand.experiments.reproduce import Reproduction, papers_folder
from sand.experiments.seed_table import Interval

from ...claims import (
    CAMPAIGNS,
    RECORD,
    TIERS,
    TOP,
    Comparison,
    campaigns,
    claims,
    claims_in,
    digest_of,
    numbers,
    rows_of,
)
from ...validation import BoundRecorder, exists, recorded


def uses_of_the_fixture() -> set[str]:
    """Test functions with the fixture `record_bound`, also methods, which the page would not find."""
    found = set()
    for path in sorted((TOP / "tests").rglob("test_*.py")):
        text = path.read_text("utf-8")
        for node in ast.walk(ast.parse(text)) if "record_bound" in text else ():
            is_test = isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
            if is_test and "record_bound" in [argument.arg for argument in node.args.args]:
                found.add(f"{path.relative_to(TOP).as_posix()}::{node.name}")
    return found


def test_every_claim_has_numbers_and_every_number_a_claim():
    """Marked tests, tests with the fixture, and tests of the table are the same; tiers are those of the page."""
    marked = [claim.test for claim in claims()]
    assert len(set(marked)) == len(marked) > 60
    assert set(marked) == uses_of_the_fixture() == set(numbers())
    assert {claim.tier for claim in claims()} | {one.tier for one in campaigns()} == set(TIERS)


def test_every_row_of_the_record_has_a_test_and_is_within_its_bounds():
    """The table in the repository names tests that exist; `pytest --record` removes rows of others."""
    rows = rows_of(RECORD)
    assert [row["test"] for row in rows if not exists(row["test"])] == []
    for row in rows:
        assert float(row["least"] or "-inf") <= float(row["value"]) <= float(row["most"] or "inf"), row


def test_a_number_that_is_not_recorded_fails_its_test():
    """A new quantity, and other bounds, are those of no row; what is recorded passes."""
    known = {("energy error", "", "1e-06")}
    BoundRecorder([], known)("energy error", 2e-7, most=1e-6)
    for quantity, most in (("energy error", 1e-5), ("error of the energy", 1e-6)):
        with pytest.raises(AssertionError, match=r"lacks .* --record"):
            BoundRecorder([], known)(quantity, 2e-7, most=most)
    assert set(recorded()) == set(numbers())


def test_claims_are_read_from_the_source(tmp_path):
    """Tier, text and reason of the marks of a file; other decorators and functions are left out."""
    path = tmp_path / "test_it.py"
    path.write_text(
        "@pytest.mark.slow\ndef test_a(): ...\n\n"
        '@pytest.mark.validates("experiment", "one " "two", differs="so")\n@pytest.mark.slow\ndef test_b(): ...\n'
    )
    assert [tuple(one) for one in claims_in(path)] == [("experiment", "one two", "test_it.py::test_b", "so")]


def test_numbers_of_several_cases_are_one():
    """Values of all cases with the same bounds are together, without the name of the case in front of the quantity."""
    found = [one for some in numbers().values() for one in some]
    assert sum(len(one.values) for one in found) == len(rows_of(RECORD)) > len(found)
    speeds = numbers()["tests/physics/test_contact_numbers.py::test_rebound_speed"]
    assert len(speeds) == 1 and len(speeds[0].values) > 10


def test_every_campaign_is_that_of_its_table():
    """A table of runs that changed needs the date of its last run: renew date and digest in campaigns.csv."""
    folders = {path.name for path in papers_folder().iterdir() if path.is_dir()}
    assert {one.name for one in campaigns()} == folders and len(rows_of(CAMPAIGNS)) == len(folders)
    assert {one.name: one.digest for one in campaigns()} == {name: digest_of(name) for name in folders}


@pytest.mark.slow
@pytest.mark.parametrize("campaign", campaigns(), ids=lambda one: one.name)
def test_every_comparison_is_that_of_its_table(campaign, tmp_path, monkeypatch):
    """The comparison that comes with SAND is what the present program makes of the table of runs."""
    monkeypatch.setattr(reproduce, "panels_figure", lambda *_: Figure(figsize=(1.0, 1.0)))
    Reproduction(campaign.name, tmp_path / "again", known=True).conclude()
    lines = rows_of(tmp_path / "again" / "results" / "comparison.csv")
    assert [tuple(line.values()) for line in lines] == [tuple(line) for line in campaign.lines]


@pytest.mark.parametrize(
    ("interval", "within", "kind"),
    [
        (Interval(1.0, 0.9, 1.1), 0.0, "agrees"),
        (Interval(1.2, 1.05, 1.3), 0.1, "agrees"),
        (Interval(1.2, 1.1, 1.3), 0.0, "differs"),
        (Interval(1.2, math.nan, math.nan), 0.0, "differs"),
        (Interval(1.0, -1.0, 3.0), 0.0, "undecided"),
    ],
)
def test_verdicts_are_understood(interval, within, kind):
    """What `Interval.verdict` says of a value of 1, with any reason; "within 20%" as a reason is near enough."""
    assert Comparison("x", "1", "", interval.verdict(1.0, "no reason is known", within)).kind == kind
    near = Comparison("x", "1", "", Interval(1.1, 1.05, 1.15).verdict(1.0, "within 20%"))
    assert near.kind == "agrees" and Comparison("x", "", "0.64", "").kind == ""
