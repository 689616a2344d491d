"""Combinations of parameters, of which some are tested by default and the others with --validate."""

from collections.abc import Collection, Sequence
from itertools import product
from typing import Any

import pytest


def combinations(*values: Sequence[Any], default: Collection[tuple[Any, ...]]) -> list[Any]:
    """All combinations of values of the parameters of a test; those that are not among `default` are long checks."""
    assert set(default) <= set(product(*values))
    return [pytest.param(*each, marks=() if each in default else pytest.mark.validate) for each in product(*values)]
