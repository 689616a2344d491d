"""Bodies in extended XYZ: one line per grain, columns named in the second line, lengths in ångström."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from ..basics.grains import Grains
from ..basics.own_quantities import OwnQuantities

ANGSTROM = 1e-10
SYMBOLS = {"iron": "Fe", "silica": "Si", "ice": "O", "graphite": "C", "forsterite": "Mg", "magnetite": "Fe"}
"""Chemical symbols that distinguish materials; X for others."""


def own_columns(own: OwnQuantities) -> tuple[str, str]:
    """Names of the columns of own quantities in `Properties=`, and the entry with their units."""
    units = ";".join(f"{name}={unit}" for name, unit in own.units.items())
    return "".join(f":{name}:R:1" for name in own), f' own="{units}"' if own else ""


def listed(names: Sequence[str]) -> str:
    """Names of materials for `materials="…"`, separated by semicolons.

    Characters that would end a name, the list or the line are written as in a URL: "%3B" for a semicolon.
    """

    def escaped(found: re.Match[str]) -> str:
        return "".join(f"%{byte:02X}" for byte in found[0].encode())

    return ";".join(re.sub(r"[^\S ]|[;\"'%\\\x00-\x1f\x7f]", escaped, name) for name in names)


def unlisted(text: str) -> list[str]:
    """Names of `listed`."""

    def unescaped(found: re.Match[str]) -> str:
        return bytes.fromhex(found[0].replace("%", "")).decode(errors="replace")

    return [re.sub("(%[0-9A-Fa-f]{2})+", unescaped, name) for name in text.split(";")]


def symbol_of(name: str) -> str:
    """Chemical symbol by which other programs draw grains of a material, "X" for materials of the user."""
    return SYMBOLS.get(name, "X")


def row_form(columns: Sequence[np.ndarray]) -> str:
    """Format of a row of the columns (N,) or (N, k), with the digits that restore their numbers exactly."""
    forms = ("%d" if c.dtype.kind in "iu" else "%.9g" if c.dtype == np.float32 else "%.17g" for c in columns)
    return " ".join(" ".join([form] * (c.size // max(len(c), 1))) for form, c in zip(forms, columns, strict=True))


def format_rows(columns: Sequence[np.ndarray], form: str) -> list[str]:
    """Format the rows of the columns (N,) or (N, k)."""
    return [form % tuple(row) for row in np.column_stack(columns).tolist()]


def xyz_frame(names: Sequence[str], material: np.ndarray, head: str, columns: Sequence[np.ndarray]) -> str:
    """Format a frame: number of grains, `head`, and per grain the chemical symbol of its material and the columns."""
    symbols, form = [symbol_of(names[k]) for k in material], row_form(columns)
    rows = [f"{symbol} {row}" for symbol, row in zip(symbols, format_rows(columns, form), strict=True)]
    return "\n".join([str(len(rows)), head, *rows]) + "\n"


def xyz_text(grains: Grains) -> str:
    """Format grains as extended XYZ: position, radius [Å], velocity, spin, moment, charge, mass, own quantities.

    Numbers are in full precision, all but lengths in SI. The last column, material, is an index; names of materials,
    and units of own quantities, are in the second line. There are masses only if they are not those of spheres of the
    materials.
    """
    names, (own, units) = [m.name for m in grains.materials], own_columns(grains.own)
    density = np.array([m.density for m in grains.materials])[grains.material]
    masses = [grains.mass] * bool((grains.mass != density * (4.0 / 3.0) * np.pi * grains.radius**3).any())
    head = (
        "Properties=species:S:1:pos:R:3:radius:R:1:velo:R:3:spin:R:3:moment:R:3:charge:R:1"
        f"{':mass:R:1' * len(masses)}{own}:material:I:1 "
        f'materials="{listed(names)}" pbc="F F F" length_unit=angstrom other_units=SI{units}'
    )
    columns = [grains.position / ANGSTROM, grains.radius / ANGSTROM, grains.velocity, grains.spin, grains.moment]
    columns += [grains.charge, *masses, *grains.own.values(), grains.material]
    return xyz_frame(names, grains.material, head, columns)
