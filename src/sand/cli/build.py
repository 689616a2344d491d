"""`sand build KIND`: builds an aggregate and writes it to a file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import click

from ..basics.errors import BadInput
from . import options, parsing, report

KINDS = ("grain", "chain", "lattice", "hexagonal", "bpca", "bcca", "dla", "dlca", "fractal", "rbd")


def _shape(_context: click.Context, _option: click.Parameter, text: str | None) -> list[int] | None:
    """Read '5,5,5'.  Raises BadInput."""
    try:
        return None if text is None else [int(word) for word in text.split(",")]
    except ValueError:
        raise BadInput(f"--shape {str(text)[:40]!r} must be three whole numbers above 0, such as 5,5,5") from None


def _number(_context: click.Context, option: click.Parameter, text: str | None) -> float | None:
    """Read a number.  Raises BadInput."""
    try:
        return None if text is None else float(text)
    except ValueError:
        raise BadInput(f"{option.opts[0]} {text!r} is not a number") from None


def _material(_context: click.Context, _option: click.Parameter, text: str) -> str | dict[str, float]:
    """Read 'silica', or parts as in 'silica:0.7,iron:0.3'.  Raises BadInput."""
    if ":" not in text:
        return text
    parts: dict[str, float] = {}
    for word in text.split(","):
        name, _, part = word.partition(":")
        if name.strip() in parts:
            raise BadInput(f"--material {text!r} names {name.strip()} twice")
        try:
            parts[name.strip()] = float(part)
        except ValueError:
            raise BadInput(f"--material {text!r} must be a name, or parts such as 'silica:0.7,iron:0.3'") from None
    return parts


def _check(values: Mapping[str, Any]) -> Iterator[str]:
    """Errors of options that exclude each other."""
    if values["shape"] is not None and values["grains"] is not None:
        yield "--shape sets the number of grains; leave --grains out"


@parsing.command("build", short_help="Build an aggregate and write it to a file.", check=_check)
@click.argument("kind", metavar="KIND", type=click.Choice(KINDS))
@click.option("--grains", type=options.COUNT, metavar="N", help="Number of grains.")
@click.option(
    "--shape", metavar="NX,NY,NZ", callback=_shape, help="Grains along the sides of a lattice, instead of --grains."
)
@click.option(
    "--radius",
    default="0.1 um",
    show_default=True,
    metavar="R",
    help="A length, 'lognormal(MEDIAN, SIGMA, LEAST, MOST)' or 'power law(EXPONENT, LEAST, MOST)'.",
)
@click.option(
    "--material",
    default="silica",
    show_default=True,
    metavar="M",
    callback=_material,
    help="A preset, or parts: 'silica:0.7,iron:0.3'.",
)
@click.option("--moment", metavar="SIZE", help="Moment of each grain: '6.6e-18 A m^2', '200 A m^2/kg' or 'material'.")
@click.option("--moments", type=click.Choice(("random", "aligned", "relaxed")), help="Directions of the moments.")
@click.option(
    "--magnetic", metavar="FRACTION", callback=_number, help="Fraction of the grains that have a moment, 0 to 1."
)
@click.option("--dimension", metavar="D", callback=_number, help="Fractal dimension of KIND fractal (default 1.8).")
@click.option("--prefactor", metavar="K", callback=_number, help="Fractal prefactor of KIND fractal (default 1.3).")
@click.option(
    "--seed",
    type=options.SEED,
    metavar="N",
    default=0,
    show_default=True,
    help="Seed; the same seed gives the same grains.",
)
@click.option(
    "--out", required=True, metavar="FILE", type=options.FILE, help="Extended XYZ (.xyz, .extxyz) or GSD (.gsd)."
)
@click.option("--overwrite", is_flag=True, help="Replace the file if it exists.")
@options.output
def command(kind: str, out: str, overwrite: bool, as_json: bool, quiet: bool, **given: Any) -> None:
    """Build an aggregate with all contacts at rest and write it to FILE for `sand collide`, `sand run`, OVITO and ASE.

    \b
    grain, chain          one grain, a straight chain
    lattice, hexagonal    cubic lattice, hexagonal close packing
    bpca, bcca            ballistic particle-cluster, cluster-cluster aggregation
    dla, dlca             diffusion-limited particle-cluster, cluster-cluster aggregation
    fractal               cluster-cluster aggregate of given fractal dimension and prefactor
    rbd                   compact sphere cut from a random ballistic deposit
    """
    from ..io.bodies import refuse_target, write_body

    target = Path(out)
    refuse_target(target, overwrite=overwrite)
    from ..setup.aggregates import build

    with report.compiling(quiet or as_json):
        body = build(kind, **given)
    write_body(target, body, overwrite=overwrite)
    content = {"kind": kind, "file": str(target), "seed": given["seed"], **_properties(body)}
    report.answer(content, f"build {kind}", _rows(content), as_json=as_json, quiet=quiet)


def _properties(body: Any) -> dict[str, Any]:
    """Properties of an aggregate: grains, radii, mass, size, dimension, contacts, moments."""
    from ..analysis.fractal import correlation_dimension
    from ..analysis.shape import gyration_radius
    from ..io.bodies import contacts_of

    contacts = len(contacts_of(body)["pair"])
    try:
        dimension = correlation_dimension(body.position)
    except BadInput:  # too few grains
        dimension = None
    content = {
        "grains": len(body),
        "materials": [m.name for m in body.materials],
        "radius": [float(body.radius.min()), float(body.radius.max())],
        "mass": float(body.mass.sum()),
        "radius_of_gyration": gyration_radius(body.position, body.mass),
        "fractal_dimension": dimension.value if dimension else None,
        "fractal_dimension_error": dimension.error if dimension else None,
        "contacts": contacts,
        "mean_coordination": 2.0 * contacts / len(body),
    }
    magnetic = int(((body.moment**2).sum(axis=1) > 0.0).sum())
    if magnetic:
        content |= {"magnetic_grains": magnetic, "net_moment": [float(v) for v in body.moment.sum(axis=0)]}
    return content


def _rows(content: dict[str, Any]) -> report.Rows:
    from ..basics.units import format_quantity

    low, high = content["radius"]
    size = format_quantity(low, "m") if low == high else f"{format_quantity(low, 'm')} to {format_quantity(high, 'm')}"
    dimension, error = content["fractal_dimension"], content["fractal_dimension_error"]
    rows = [
        ("grains", f"{content['grains']} of {', '.join(content['materials'])}, radius {size}"),
        ("radius of gyration", format_quantity(content["radius_of_gyration"], "m")),
        ("fractal dimension", "too few grains" if dimension is None else f"{dimension:.2f} ± {error or 0.0:.2f}"),
        ("contacts", f"{content['contacts']}, {content['mean_coordination']:.2f} per grain"),
    ]
    if "magnetic_grains" in content:
        net = sum(v * v for v in content["net_moment"]) ** 0.5
        rows.append(("moments", f"{content['magnetic_grains']} grains, net moment {net:.3g} A m^2"))
    return [*rows, ("seed", str(content["seed"])), ("file", content["file"])]
