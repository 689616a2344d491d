"""What to cite: SAND and the papers that it is built on, as text, BibTeX and the file CITATION.cff."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from ..basics.version import __version__

TITLE, AUTHORS, LICENSE = "SAND: Soft Aggregate Numerical Dynamics", "The SAND developers", "BSD-3-Clause"
LATEX = {"ü": r"{\"u}", "–": "--", "&": r"\&"}
"""Characters that BibTeX needs in another form."""


class Article(NamedTuple):
    """An article in a journal."""

    key: str
    reason: str
    authors: tuple[tuple[str, str], ...]  # family names, given names
    title: str
    journal: str
    abbreviation: str  # of the journal
    year: int
    volume: int
    page: int
    doi: str = ""
    eprint: str = ""  # number at arXiv

    def text(self) -> str:
        """The reference as one line."""
        names = ", ".join(f"{family} {_initials(given)}" for family, given in self.authors)
        where = f"doi:{self.doi}" if self.doi else f"arXiv:{self.eprint}"
        return f"{names} ({self.year}): {self.title}. {self.abbreviation} {self.volume}, {self.page}. {where}"

    def short(self) -> str:
        """Family names and year."""
        names = [family for family, _ in self.authors]
        shown = f"{names[0]} et al." if len(names) > 2 else " & ".join(names)
        return f"{shown} {self.year}"

    def bibtex(self) -> str:
        """The reference as an entry of BibTeX."""
        fields = {
            "author": " and ".join(f"{family}, {given}" for family, given in self.authors),
            "title": f"{{{self.title}}}",  # keeps capitals
            "journal": self.journal,
            "year": str(self.year),
            "volume": str(self.volume),
            "pages": str(self.page),
        }
        fields |= {"doi": self.doi} if self.doi else {}
        fields |= {"eprint": self.eprint, "archiveprefix": "arXiv"} if self.eprint else {}
        return _entry("article", self.key, fields)

    def cff(self) -> str:
        """The reference as an item of CITATION.cff."""
        lines = ["  - type: article", f'    title: "{self.title}"', "    authors:"]
        for family, given in self.authors:
            lines += [f'      - family-names: "{family}"', f'        given-names: "{given}"']
        lines += [f'    journal: "{self.journal}"', f"    year: {self.year}", f"    volume: {self.volume}"]
        lines += [f"    start: {self.page}"]
        lines += [f'    doi: "{self.doi}"'] if self.doi else []
        if self.eprint:
            lines += ["    identifiers:", "      - type: other", f'        value: "arXiv:{self.eprint}"']
        return "\n".join(lines)


ARTICLES = (
    Article(
        "DominikNuebold2002",
        "the equations of SAND, magnetic aggregation",
        (("Dominik", "Carsten"), ("Nübold", "Henrik")),
        "Magnetic Aggregation I: Aggregation Dynamics and Numerical Modelling",
        "Icarus",
        "Icarus",
        2002,
        157,
        173,
        eprint="astro-ph/0201500",
    ),
    Article(
        "DominikTielens1997",
        "contacts of grains: rolling, sliding, twisting",
        (("Dominik", "Carsten"), ("Tielens", "A. G. G. M.")),
        "The Physics of Dust Coagulation and the Structure of Dust Aggregates in Space",
        "The Astrophysical Journal",
        "ApJ",
        1997,
        480,
        647,
        doi="10.1086/303996",
    ),
    Article(
        "JohnsonKendallRoberts1971",
        "adhesion",
        (("Johnson", "K. L."), ("Kendall", "K."), ("Roberts", "A. D.")),
        "Surface energy and the contact of elastic solids",
        "Proceedings of the Royal Society of London A",
        "Proc. R. Soc. Lond. A",
        1971,
        324,
        301,
        doi="10.1098/rspa.1971.0141",
    ),
    Article(
        "DerjaguinMullerToporov1975",
        "adhesion of small, hard grains (law = dmt)",
        (("Derjaguin", "B. V."), ("Muller", "V. M."), ("Toporov", "Yu. P.")),
        "Effect of contact deformations on the adhesion of particles",
        "Journal of Colloid and Interface Science",
        "J. Colloid Interface Sci.",
        1975,
        53,
        314,
        doi="10.1016/0021-9797(75)90018-1",
    ),
)
"""The paper whose program SAND is, and the papers of its contacts."""


def software(version: str | None = __version__) -> str:
    """SAND as one line of text; without a version if that is None."""
    return TITLE if version is None else f"{TITLE}, version {version}"


def bibtex(articles: Iterable[Article] = ARTICLES, version: str | None = __version__) -> str:
    """SAND, of a version unless that is None, and articles as a file of BibTeX, in ASCII."""
    fields = {"author": f"{{{AUTHORS}}}", "title": f"{{{TITLE}}}"}
    fields |= {"note": f"Version {version}"} if version else {}
    return "\n\n".join([_entry("misc", "SAND", fields), *(article.bibtex() for article in articles)])


def cff() -> str:
    """Text of the file CITATION.cff; `python -m sand.cli.references > CITATION.cff` writes it."""
    head = [
        "cff-version: 1.2.0",
        f'title: "{TITLE}"',
        'message: "If you use SAND, please cite it and the paper that describes the original program."',
        "type: software",
        "authors:",
        f'  - name: "{AUTHORS}"',
        f"version: {__version__}",
        f"license: {LICENSE}",
        "references:",
    ]
    return "\n".join([*head, *(article.cff() for article in ARTICLES)]) + "\n"


def _initials(given: str) -> str:
    return " ".join(name if name.endswith(".") else f"{name[0]}." for name in given.split())


def _entry(kind: str, key: str, fields: dict[str, str]) -> str:
    width = max(map(len, fields))
    lines = [f"  {name:<{width}} = {{{_latex(value)}}}" for name, value in fields.items()]
    return f"@{kind}{{{key},\n" + ",\n".join(lines) + "\n}"


def _latex(text: str) -> str:
    return "".join(LATEX.get(character, character) for character in text)


if __name__ == "__main__":
    print(cff(), end="")
