"""`sand cite`: references as text, BibTeX and JSON, from one table that also makes CITATION.cff."""

import json
import re
from pathlib import Path

import pytest

from sand.basics.version import __version__
from sand.cli.main import main
from sand.cli.references import ARTICLES, bibtex, cff

ROOT = Path(__file__).parents[3]


def entries(text):
    """Entries of a file of BibTeX: kind, key and fields; braces must be balanced.  ValueError if it is none."""
    found, k = [], 0
    while head := re.compile(r"\s*@(\w+)\{([^\s,{}]+),").match(text, k):
        k, fields = head.end(), {}
        while field := re.compile(r"\s*(\w+)\s*=\s*\{").match(text, k):
            depth, start, k = 1, field.end(), field.end()
            while depth:
                if k == len(text):
                    raise ValueError(f"unbalanced braces in {head[2]}")
                depth += {"{": 1, "}": -1}.get(text[k], 0)
                k += 1
            fields[field[1]] = text[start : k - 1]
            k = re.compile(r"\s*,?").match(text, k).end()
        end = re.compile(r"\s*\}").match(text, k)
        if not end:
            raise ValueError(f"no end of {head[2]}")
        k = end.end()
        found.append((head[1], head[2], fields))
    if text[k:].strip():
        raise ValueError(f"no entry: {text[k : k + 40]!r}")
    return found


def test_bibtex_can_be_parsed(capsys):
    """SAND and every article, in ASCII, with the fields that BibTeX requires of them."""
    assert main(["cite", "--bibtex"]) == 0
    text = capsys.readouterr().out
    assert text.isascii()
    (kind, key, fields), *articles = entries(text)
    assert (kind, key, fields["note"]) == ("misc", "SAND", f"Version {__version__}")
    assert len(articles) == len(ARTICLES) and len({key for _, key, _ in articles}) == len(ARTICLES)
    for (kind, key, fields), one in zip(articles, ARTICLES, strict=True):
        assert kind == "article" and key == one.key
        assert {"author", "title", "journal", "year", "volume", "pages"} <= fields.keys()
        assert fields["author"].count(" and ") == len(one.authors) - 1
        assert "doi" in fields or "eprint" in fields
    assert r"N{\"u}bold, Henrik" in articles[0][2]["author"]


@pytest.mark.parametrize("broken", ["@misc{a, title = {x}", "@misc{a, title = {x}}}", "@misc{a title = {x}}", "text"])
def test_the_parser_of_this_test_refuses_what_is_broken(broken):
    """So the test above can fail."""
    with pytest.raises(ValueError):
        entries(broken)


def test_the_citation_file_is_made_of_the_same_table():
    """`python -m sand.cli.references > CITATION.cff`."""
    assert (ROOT / "CITATION.cff").read_text("utf-8") == cff()


def test_text_and_json(capsys):
    """The same references in all forms, with the version."""
    assert main(["cite"]) == 0
    text = capsys.readouterr().out
    assert f"version {__version__}" in text and all(one.text() in text for one in ARTICLES)
    assert "Dominik C., Nübold H. (2002): Magnetic Aggregation I" in text and "Derjaguin B. V., Muller V. M." in text
    assert main(["cite", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["bibtex"] == bibtex() and len(content["references"]) == len(ARTICLES)
