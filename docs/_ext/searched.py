"""The search of the built pages finds the words of the field: what readers may type, and the page that they expect."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

EXPECTED = {
    "JKR": "physics/contacts",
    "DMT": "physics/contact-options",
    "surface energy": "reference/materials",
    "pull-off force": "physics/contact-numbers",
    "rolling friction": "physics/contacts",
    "coefficient of restitution": "gallery/collisions/sticking_speed",
    "sticking": "gallery/collisions/sticking_speed",
    "bouncing": "recipes",
    "fragmentation": "recipes",
    "erosion": "recipes",
    "growth efficiency": "gallery/collisions/growth_efficiency",
    "collision": "physics/collisions",
    "cross-section": "physics/cross-sections",
    "kernel": "physics/growth",
    "Smoluchowski": "physics/growth",
    "coagulation": "physics/growth",
    "fractal dimension": "gallery/aggregates/fractal_dimension",
    "porosity": "laboratory",
    "filling factor": "laboratory",
    "compression": "laboratory",
    "tensile strength": "laboratory",
    "sound": "elastic",
    "magnetic": "gallery/growth/magnetic_chain",
    "dipole": "physics/dipoles",
    "Ewald": "physics/ewald",
    "charges": "gallery/growth/charged_grains",
    "Epstein": "physics/gas",
    "Brownian": "gallery/growth/brownian_motion",
    "time step": "choose",
    "neighbour list": "physics/long-range",
    "restart": "howto",
    "units": "conventions",
    "cost": "cost",
    "LAMMPS": "other-programs",
    "REBOUND": "other-programs",
    "ESPResSo": "other-programs",
    "DustPy": "recipes",
    "notebook": "notebooks/index",
    "own contact law": "notebooks/own-force-and-law",
}
"""Queries, and a page that each must find."""


def read_index(text: str) -> dict[str, Any]:
    """The content of searchindex.js."""
    return dict(json.loads(text[text.index("{") : text.rindex("}") + 1]))


def pages_found(index: dict[str, Any], query: str) -> set[str]:
    """Pages that the search of Sphinx lists for a query: those in whose text or titles each word occurs.

    Words are cut to their stems, as when the index is made; a word of three letters or more is also found within a
    longer one.  This is the search for terms of Sphinx' searchtools.js.
    """
    from sphinx.search.en import SearchEnglish

    language = SearchEnglish({})
    found: set[int] | None = None
    for word in re.findall(r"\w+", query.lower()):
        if not language.word_filter(word):
            continue
        stem = language.stem(word)
        pages: set[int] = set()
        for terms in (index["terms"], index["titleterms"]):
            for term, where in terms.items():
                if term == stem or (len(stem) > 2 and stem in term):
                    pages |= {where} if isinstance(where, int) else set(where)
        found = pages if found is None else found & pages
    return {index["docnames"][k] for k in found or ()}


def missing(index: dict[str, Any], expected: dict[str, str]) -> list[str]:
    """One line for each query that does not find its page."""
    return [
        f"the search for {query!r} does not find {page}"
        for query, page in expected.items()
        if page not in pages_found(index, query)
    ]


def check(app: Any, error: Exception | None) -> None:
    """A warning, which `-W` makes an error, for each query without its page."""
    from sphinx.util import logging

    if error is not None or app.builder.format != "html":
        return
    index = read_index((Path(app.outdir) / "searchindex.js").read_text("utf-8"))
    for line in missing(index, EXPECTED):
        logging.getLogger(__name__).warning("%s", line)


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("build-finished", check, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
