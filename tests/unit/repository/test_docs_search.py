"""The search of the built docs finds the words of the field: the check that the build runs on its own index."""

import importlib.util
from pathlib import Path

import pytest

pytest.importorskip("sphinx", reason="sphinx is not installed (extra: docs)")
TOP = Path(__file__).parents[3]
INDEX = """Search.setIndex({"docnames": ["a", "b", "c"], "terms": {"magnet": [0, 2], "grain": [0, 1], "stick": 1},
"titleterms": {"cluster": 2}})"""


@pytest.fixture(scope="module")
def searched():
    spec = importlib.util.spec_from_file_location("searched", TOP / "docs" / "_ext" / "searched.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("query", "pages"),
    [
        ("magnetic", {"a", "c"}),  # the stem of the word
        ("Magnetic grains", {"a"}),  # pages with both words
        ("sticking", {"b"}),  # a term with a single page
        ("clusters", {"c"}),  # a word of a title
        ("lust", {"c"}),  # a part of a word
        ("the magnets", {"a", "c"}),  # words such as "the" are left out
        ("dust", set()),
        ("grain dust", set()),
    ],
)
def test_pages_that_a_query_finds(searched, query, pages):
    """All words of a query, cut to their stems, occur in a page that is found."""
    assert searched.pages_found(searched.read_index(INDEX), query) == pages


def test_queries_without_their_page_are_reported(searched):
    """One line for each."""
    index = searched.read_index(INDEX)
    assert searched.missing(index, {"magnetic": "a", "sticking": "a", "dust": "b"}) == [
        "the search for 'sticking' does not find a",
        "the search for 'dust' does not find b",
    ]


def test_the_docs_build_runs_the_check(searched):
    """conf.py has the check, and the pages that queries shall find exist."""
    assert '"searched"' in (TOP / "docs" / "conf.py").read_text("utf-8")
    for page in set(searched.EXPECTED.values()):
        sources = [TOP / "docs" / f"{page}{ending}" for ending in (".md", ".rst")]
        assert any(path.is_file() for path in [*sources, TOP / "examples" / f"{page}.py"]), page
