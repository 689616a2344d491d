"""A figure of a paper that SAND reproduces: the campaign, what the paper gives, and the comparison with it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from ..plotting.papers import Panel

MEMORY = "from memory"
"""Mark of a number that was recalled from the literature, not read at its source."""
Row = dict[str, Any]
"""Parameters and results of one run of a campaign."""


class Compared(NamedTuple):
    """One result of a paper beside that of the campaign."""

    what: str
    paper: str  # with its source, or `MEMORY`
    ours: str  # with its 95 % interval
    verdict: str  # "agrees", or the reason why it does not


@dataclass(frozen=True)
class PaperFigure:
    """A figure of a paper.

    Attributes
    ----------
    name : str
        Name for `sand reproduce`, and of the case file of the campaign, examples/papers/NAME.toml.
    title : str
        What it shows.
    references : tuple of str
        The papers.
    compare : callable
        Comparison of the rows of the campaign with the papers.
    panels : callable
        Panels of the figure, of the same rows.
    small, small_sweep : dict
        Keys of the case, and of [sweep], that make the campaign small.
    columns : tuple of str
        Columns of the tables of the runs that figure and comparison need; the others are left out of the results.
        Each row of such a table is a row of the campaign, with the parameters and results of its run.
    also : tuple of str
        Further names for `sand reproduce`, of papers whose figures the same runs give.
    compressed : dict or None
        If runs start from packings that are compressed before, those of the case examples/papers/NAME-compression.toml:
        the keys that make these small. The campaign varies `aggregate.filling`.
    """

    name: str
    title: str
    references: tuple[str, ...]
    compare: Callable[[Sequence[Row]], list[Compared]]
    panels: Callable[[Sequence[Row]], list[Panel]]
    small: dict[str, Any] = field(default_factory=dict)
    small_sweep: dict[str, Any] = field(default_factory=dict)
    columns: tuple[str, ...] = ()
    also: tuple[str, ...] = ()
    compressed: dict[str, Any] | None = None


def grouped(rows: Sequence[Row], *keys: str) -> dict[Any, list[Row]]:
    """Rows by the value of a key, or by the values of several, in increasing order."""
    groups: dict[Any, list[Row]] = {}
    for row in rows:
        groups.setdefault(row[keys[0]] if len(keys) == 1 else tuple(row[key] for key in keys), []).append(row)
    return dict(sorted(groups.items()))
