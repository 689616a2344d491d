"""`sand cite`: references to cite."""

from __future__ import annotations

import click

from ..basics.version import __version__
from . import options, parsing, report
from .references import ARTICLES, bibtex, software


@parsing.command("cite", short_help="What to cite.")
@click.option("--bibtex", "as_bibtex", is_flag=True, help="Print a file of BibTeX.")
@options.as_json
@options.debug
def command(as_bibtex: bool, as_json: bool) -> None:
    """What to cite when SAND was of use.

    \b
    sand cite --bibtex > sand.bib
    """
    if as_json:
        references = [{"for": one.reason, "reference": one.text(), "bibtex": one.bibtex()} for one in ARTICLES]
        report.emit({"software": software(), "version": __version__, "references": references, "bibtex": bibtex()})
    elif as_bibtex:
        click.echo(bibtex())
    else:
        click.echo(f"Please cite the version you used:\n  {software()}\nand what it is built on:")
        for one in ARTICLES:
            click.echo(f"  {one.text()}\n      ({one.reason})")
        click.echo("As BibTeX: sand cite --bibtex")
