"""Identifiers in the sources are terms of the field: replaced words of a private vocabulary do not return."""

import ast
import re
from pathlib import Path

import pytest

from .layers import SOURCE

REPLACED = {
    "alike": "uniform",
    "board": "task queue",
    "books": "ledger",
    "bury": "remove",
    "complaint": "error",
    "complaints": "errors",
    "crew": "worker threads",
    "crowd": "hash grid",
    "crushed": "overcompressed",
    "culprits": "limiting grains",
    "dismiss": "join",
    "flown": "merged, run",
    "foretell": "extrapolate",
    "foretold": "extrapolated",
    "hands": "worker threads",
    "leeway": "remaining skin",
    "mate": "neighbour",
    "mates": "neighbours",
    "moored": "position dependent",
    "people": "user",
    "soon": "inner list",
    "stirring": "gas settings",
    "story": "run dataset",
    "stuff": "grain set",
    "told": "description, message",
    "watch": "skin",
}
"""Replaced words, and the terms of the field in their place."""


def names_in(path: Path) -> set[str]:
    """Names of packages, modules, functions, classes, arguments, variables and attributes in a file."""
    found = set(path.relative_to(SOURCE).with_suffix("").parts)
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        for key in ("name", "id", "arg", "attr"):
            value = getattr(node, key, None)
            if isinstance(value, str):
                found.add(value)
    return found


def words_of(name: str) -> list[str]:
    """Words of an identifier: `remove_broken`, `RunWriter` and `MAX_SPEED` have two each."""
    return [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)]


@pytest.mark.slow
def test_replaced_words_do_not_come_back():
    """No identifier contains a word of REPLACED."""
    wrong = {
        f"{path.relative_to(SOURCE)}: {name} ({word}: say {REPLACED[word]})"
        for path in SOURCE.rglob("*.py")
        for name in names_in(path)
        for word in words_of(name)
        if word in REPLACED
    }
    assert not wrong, sorted(wrong)
