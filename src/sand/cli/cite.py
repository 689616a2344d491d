"""`sand cite`: references to cite."""

from __future__ import annotations

import click

from ..version import __version__
from . import options, parsing, report

#: topic, and the reference
REFERENCES = (
    (
        "the equations of SAND, magnetic aggregation",
        "Dominik C., Nübold H. (2002): Magnetic Aggregation I: Aggregation Dynamics and Numerical Modelling. "
        "Icarus 157, 173. arXiv:astro-ph/0201500",
    ),
    (
        "contacts of grains: rolling, sliding, twisting",
        "Dominik C., Tielens A. G. G. M. (1997): The Physics of Dust Coagulation and the Structure of Dust "
        "Aggregates in Space. ApJ 480, 647. doi:10.1086/303996",
    ),
    (
        "adhesion",
        "Johnson K. L., Kendall K., Roberts A. D. (1971): Surface energy and the contact of elastic solids. "
        "Proc. R. Soc. Lond. A 324, 301. doi:10.1098/rspa.1971.0141",
    ),
    (
        "adhesion of small, hard grains (law = dmt)",
        "Derjaguin B. V., Muller V. M., Toporov Yu. P. (1975): Effect of contact deformations on the adhesion of "
        "particles. J. Colloid Interface Sci. 53, 314. doi:10.1016/0021-9797(75)90018-1",
    ),
)


@parsing.command("cite", short_help="What to cite.")
@options.output
def command(as_json: bool) -> None:
    """What to cite when SAND was of use."""
    software = f"SAND, Soft Aggregate Numerical Dynamics, version {__version__}"
    if as_json:
        references = [{"for": reason, "reference": text} for reason, text in REFERENCES]
        report.emit({"software": software, "version": __version__, "references": references})
        return
    click.echo(f"Please cite the version you used:\n  {software}\nand what it is built on:")
    for reason, text in REFERENCES:
        click.echo(f"  {text}\n      ({reason})")
