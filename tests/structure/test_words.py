"""Identifiers in the sources are terms of the field: replaced words of a private vocabulary do not return."""

import re

import pytest

from .layers import SOURCE
from .sources import SOURCES, identifiers

pytestmark = pytest.mark.xdist_group("sources")

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


def words_of(name: str) -> list[str]:
    """Words of an identifier: `remove_broken`, `RunWriter` and `MAX_SPEED` have two each."""
    return [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)]


@pytest.mark.slow
def test_replaced_words_do_not_come_back():
    """No identifier contains a word of REPLACED."""
    wrong = {
        f"{path.relative_to(SOURCE)}: {name} ({word}: say {REPLACED[word]})"
        for path in SOURCES
        for name in identifiers(path) | set(path.relative_to(SOURCE).with_suffix("").parts)
        for word in words_of(name)
        if word in REPLACED
    }
    assert not wrong, sorted(wrong)
