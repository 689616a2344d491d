"""Directives of the page on validation: what tests and campaigns show, from tests/claims.py."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from docutils import nodes
from sand_docs import paragraph
from sphinx.util.docutils import SphinxDirective
from tests import claims

KINDS = {"agrees": "agree", "differs": "differ", "undecided": "not decided"}

SHARE = re.compile(r"\((.\d+)%\)")
"""The relative difference in a verdict."""


def table(heads: Sequence[str], groups: Sequence[tuple[Sequence[str], Sequence[Sequence[str]]]]) -> nodes.table:
    """A table; each group is the paragraphs of its first cell, and the other cells of its rows."""
    group = nodes.tgroup("", *[nodes.colspec(colwidth=10) for _ in heads], cols=len(heads))
    group += nodes.thead("", nodes.row("", *[nodes.entry("", paragraph(head)) for head in heads]))
    body = nodes.tbody()
    for first, rows in groups:
        for k, row in enumerate(rows):
            own = [] if k else [nodes.entry("", *map(paragraph, first), morerows=len(rows) - 1)]
            body += nodes.row("", *own, *[nodes.entry("", paragraph(cell)) for cell in row])
    group += body
    return nodes.table("", group, classes=["colwidths-auto", "claims"])


def limits(number: claims.Number) -> str:
    """Bounds of a number."""
    if number.least and number.most:
        return f"{number.least} … {number.most}"
    return f"≤ {number.most}" if number.most else f"≥ {number.least}"


def shown(number: claims.Number) -> str:
    """Its value, or the range of its values."""
    low, high = min(number.values), max(number.values)
    if len(number.values) == 1:
        return f"{low:g}"
    return f"{low:g} … {high:g} ({len(number.values)} cases)" if high > low else f"{low:g} ({len(number.values)} cases)"


def of_tier(tier: str) -> tuple[list[claims.Claim], list[claims.Campaign]]:
    """Claims and campaigns of a tier."""
    if tier not in claims.TIERS:
        raise ValueError(f"'{tier}' is none of {', '.join(claims.TIERS)}")
    return tuple([one for one in found() if one.tier == tier] for found in (claims.claims, claims.campaigns))


class FromSources(SphinxDirective):
    """A directive whose page is read again when tests or tables change."""

    def note_sources(self) -> None:
        """Tell Sphinx what the page depends on."""
        for path in (claims.RECORD, claims.CAMPAIGNS, *(claims.TOP / "tests").rglob("test_*.py")):
            self.env.note_dependency(str(path))
        for path in claims.PAPERS.glob("*/comparison.csv"):
            self.env.note_dependency(str(path))


class Claims(FromSources):
    """`claims:: TIER`: what tests of a tier show, with their recorded numbers."""

    required_arguments = 1
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        """The table."""
        self.note_sources()
        numbers, groups = claims.numbers(), []
        for claim in of_tier(self.arguments[0])[0]:
            file, _, name = claim.test.partition("::")
            first = [claim.text + (f". Differs: {claim.differs}." if claim.differs else "."), f"`{name}`", f"`{file}`"]
            rows = [(n.quantity, shown(n), limits(n), f"{n.date} `{n.commit}`") for n in numbers.get(claim.test, [])]
            groups.append((first, rows))
        return [table(("claim, and its test", "quantity", "value", "limits", "last run"), groups)]


class Campaigns(FromSources):
    """`campaigns:: TIER`: numbers of papers beside those of campaigns of `sand reproduce`."""

    required_arguments = 1
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        """The table; numbers that differ come first."""
        self.note_sources()
        groups = []
        for one in of_tier(self.arguments[0])[1]:
            lines = sorted((line for line in one.lines if line.kind), key=lambda line: line.kind == "agrees")
            done = next(line.ours for line in one.lines if line.what == "runs that are done")
            first = [f"{one.claim}.", f"`sand reproduce {one.name}`, last run {one.date}: {done}", counts(one)]
            groups.append((first, [(line.what, line.paper, line.ours, line.verdict) for line in lines]))
        return [table(("claim, command, last run", "quantity", "paper", "SAND", "verdict"), groups)]


def counts(campaign: claims.Campaign) -> str:
    """How many numbers of a campaign agree, differ, are not decided; by how much they differ."""
    kinds = [line.kind for line in campaign.lines]
    apart = [int(share) for line in campaign.lines if line.kind == "differs" for share in SHARE.findall(line.verdict)]
    words = [f"{kinds.count(kind)} {word}" for kind, word in KINDS.items() if kind in kinds]
    if not apart:
        return ", ".join(words)
    low, high = min(apart), max(apart)
    return ", ".join(words) + (f", by {low:+d} to {high:+d} %" if low < high else f", by {low:+d} %")


class Misses(FromSources):
    """`misses::`: what does not agree with experiments or papers, of all tiers."""

    def run(self) -> list[nodes.Node]:
        """A list of the claims, with how many of their numbers differ."""
        self.note_sources()
        items = [
            f"{one.claim} (`sand reproduce {one.name}`): {counts(one)}"
            for one in claims.campaigns()
            if "differ" in counts(one)
        ]
        items += [f"{one.text}: {one.differs}" for one in claims.claims() if one.differs]
        return [nodes.bullet_list("", *[nodes.list_item("", paragraph(f"{item}.")) for item in items])]


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    for name, directive in {"claims": Claims, "campaigns": Campaigns, "misses": Misses}.items():
        app.add_directive(name, directive)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
