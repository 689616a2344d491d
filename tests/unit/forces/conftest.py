"""Settings of the tests of forces."""

import pytest

from sand.engine import assemble


@pytest.fixture(autouse=True)
def one_vector_width(monkeypatch):
    """Sums over pairs are compiled for the longest vectors alone, as for many grains: few grains need no other code."""
    monkeypatch.setattr(assemble, "WIDE_FROM", 1)
