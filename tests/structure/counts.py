"""Counts that say how interwoven the source is, with the most that each may be.

``python -m tests.structure.counts`` prints the table.  A limit is lowered when a change makes its count smaller, until
the goal is reached.  Code lines may also grow by what new capabilities need, which `CAPABILITIES` lists.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable
from typing import NamedTuple

from .layers import SOURCE
from .sources import SOURCES, UNIT_TESTS, identifiers, nodes_of, text_of

CAPABILITIES = {
    "rigid clusters with walls, driven grains and ramps, settling with driven grains": 242,
    "loops over contacts by what they did in the last step, with displacements that these keep; sums of dense packings "
    "side by side; cells of neighbour lists that are shifted across a periodic wall as a whole": 273,
    "end of a collision when its outcome is decided, kinds of outcomes, averages over impact parameters": 445,
    "sweeps over keys of any case (sand sweep): designs, table, figure, resume by several processes": 1274,
    "presets of papers, the text of methods, files for optics and for codes of dust growth": 890,
    "awake clusters copied to and from their part, kicked and searched for rest by compiled loops": 199,
    "packings that are compressed, stretched, sheared (sand compress, stretch, shear): laws, runs, tables": 925,
    "undecided collisions and unfit ends, maps of outcomes, what a folder holds in words, all runs of an unfinished "
    "sweep, values given twice": 267,
    "signals that wait while code is compiled, linked or loaded": 28,
    "a periodic box that is deformed: rates, ramps and pressures that it follows, work of its boundaries, dipoles of "
    "all images in it": 484,
    "figures of papers, sequential collisions, impact parameters in characteristic radii": 681,
    "stress of contacts, walls, pair forces, Ewald sums and rigid clusters; tables of contacts with walls, shares of "
    "grains in frames, pictures and page": 491,
    "Ewald sums of dipoles and charges, forces with cut-offs, and rigid clusters in a box that is deformed at any "
    "rates": 471,
    "frames of all seeds and last box of a packing read before its first run, scales with the factor of the surface "
    "energy, folders of several runs named by view": 21,
    "figures of papers on packings that are compressed and stretched, tables that runs of a sweep have of their own, "
    "plot of packings, stress in exports and in the figure of a run, tables described by info": 358,
    "simple shear of a periodic box, and tilted boxes: images, lists, work, files, page, sand shear by the box": 200,
    "cakes, that is ballistic deposits in a periodic column; a lid with a given load, forces on walls that are ramps; "
    "figure of a cake between walls": 298,
    "elastic moduli and sound of packings at rest (sand elastic): strains, waves, case, job, figure": 732,
    "growth in dilute dust: flights in few steps, bound and draws of encounters, contact phases in engines that are "
    "filled again, populations as runs, charges, a field, kernel": 2006,
    "figures in the width and style of a journal, several runs in one figure, s² n_s, stills as outlines, percolating "
    "packings inside the box, shares of each value of a sweep, materials of files in methods": 759,
    "bodies of dilute dust that keep momentum and spin between encounters": 278,
    "populations of dilute dust in sweeps, their template, and the kernel of several with the fit of Eq. 14": 285,
    "films of runs by the page in a browser without a window or by the renderer of figures (sand view --movie)": 354,
    "case of a magnetic gas of two sizes, with tables of lists in cases of sand new; what a quantity of a wrong unit "
    "is, tables of lists in messages as a file has them; radii of few sizes in titles, expected compilation": 84,
    "still pictures of tilted boxes as parallelepipeds with the grains in them; a colour of its own for a loss": 12,
    "differences of SciPy's implicit integrator, which are not initialised there": 3,
    "advice in messages on quotation marks, units and objects with grains, materials in any case; fields and "
    "directions in the figure of a run, units in figures of sweeps; grains and forces of folders in words": 187,
    "bridges of bodies and strengths of contacts from arrays, in looks whether a collision has ended": 26,
    "cells of neighbour lists that share places, for grains in clumps far apart": 24,
    "fixed steps that come to strain a box too much": 5,
    "verdicts on slopes and without intervals, degrees with a free start, reach of hash grids": 5,
    "words on each loss, axes and ranges of colours of the page as in figures, without outliers": 30,
    "the rigid motion of clusters, in one place (less)": -35,
    "charged bodies of dilute dust: bound of their attraction, groups of charges, starts where net charges act, bound "
    "orbits": 181,
    "paths and attraction of fragments by loops over their pairs, observers of populations at each thousandth draw, "
    "a colour for each of ten curves": 58,
}
"""Code lines of capabilities that the source has gained since its count was 35,381."""
MOST_PARAMETERS = 8
"""Positional parameters that a function may have."""
WALL = re.compile(r"(^|_)walls?(_|$)|Wall(?!Clock|Time)")
NO_WALL = re.compile(r"wall_(time|clock|seconds|limit)|(time|clock)_wall", re.IGNORECASE)
DRIVEN = re.compile(r"(^|_)driven(_|$)|Driven")
RIGID = re.compile(r"RigidClusters|rigid_(clusters|driver|engine|loads)")


def parameters() -> dict[str, int]:
    """Number of positional parameters of each function that has more than `MOST_PARAMETERS`, without `self`."""
    found = {}
    for path in SOURCES:
        for node in nodes_of(path):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                names = [one.arg for one in (*node.args.posonlyargs, *node.args.args) if one.arg not in ("self", "cls")]
                if len(names) > MOST_PARAMETERS:
                    found[f"{path.relative_to(SOURCE)}:{node.name}"] = len(names)
    return found


def attributes_of_simulation() -> int:
    """Number of attributes that the constructor of `Simulation` sets."""
    nodes = nodes_of(SOURCE / "simulation" / "simulation.py")
    made = next(node for node in nodes if isinstance(node, ast.FunctionDef) and node.name == "__init__")
    stores = (node for node in ast.walk(made) if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store))
    return len({node.attr for node in stores if isinstance(node.value, ast.Name) and node.value.id == "self"})


def pairs_of_folders() -> int:
    """Number of pairs of folders, or modules at the top, of which one imports the other."""
    found = set()
    for path in SOURCES:
        own = path.relative_to(SOURCE).parent.parts or (path.stem,)
        for node in nodes_of(path):
            if isinstance(node, ast.ImportFrom) and node.level:
                base = path.relative_to(SOURCE).parts[: -node.level]
                for name in node.names:
                    parts = *base, *(node.module or "").split("."), name.name
                    other = _folder_of(tuple(part for part in parts if part))
                    if other and other != own:
                        found.add(frozenset((own, other)))
    return len(found)


def _folder_of(parts: tuple[str, ...]) -> tuple[str, ...] | None:
    """The folder of a module, or the module at the top, of a dotted name; None for the package itself."""
    for end in range(len(parts), 0, -1):
        path = SOURCE.joinpath(*parts[:end])
        if path.is_dir():
            return parts[:end]
        if path.with_suffix(".py").exists():
            return parts[: end - 1] or parts[:end]
    return None


def files_that_name(what: re.Pattern[str], folder: str = "") -> list[str]:
    """Source files with an identifier of a feature; those that it has for itself have it in their name, or a folder."""
    found = []
    for path in SOURCES:
        folders = path.relative_to(SOURCE).parts[:-1]
        own = folder in folders or any(what.search(name) for name in (path.stem, *folders))
        if not own and any(what.search(name) and not NO_WALL.search(name) for name in identifiers(path)):
            found.append(str(path.relative_to(SOURCE)))
    return found


def code_lines() -> int:
    """Lines of the source without docstrings, comments and blank lines."""
    total = 0
    for path in SOURCES:
        left_out = set()
        for node in nodes_of(path):
            if (
                isinstance(node, ast.Expr)
                and isinstance(node.value, ast.Constant)
                and isinstance(node.value.value, str)
            ):
                left_out |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
        lines = enumerate(text_of(path).splitlines(), 1)
        total += sum(1 for k, line in lines if k not in left_out and line.strip() and not line.strip().startswith("#"))
    return total


PUBLIC = {"_replace", "_asdict", "_fields", "_repr_png_"}
"""Names with an underscore that are documented: of NamedTuples, and of displays in notebooks."""


def private_accesses_of_tests() -> int:
    """Attributes with a leading underscore that unit tests read of objects that are not their own."""
    number = 0
    for path in UNIT_TESTS:
        for node in nodes_of(path):
            if isinstance(node, ast.Attribute) and re.match(r"_[a-z]", node.attr) and node.attr not in PUBLIC:
                number += not (isinstance(node.value, ast.Name) and node.value.id in ("self", "cls"))
    return number


class Count(NamedTuple):
    """One count: what, its present value, the most that it may be, and the goal."""

    what: str
    now: Callable[[], int]
    most: int
    goal: int


COUNTS = (
    Count("functions with more than 8 positional parameters", lambda: len(parameters()), 0, 8),
    Count("most positional parameters", lambda: max(parameters().values(), default=0), 8, 10),
    Count("attributes that Simulation sets", attributes_of_simulation, 14, 15),
    Count("pairs of folders of which one imports the other", pairs_of_folders, 196, 200),
    Count("files that name rigid clusters outside their own", lambda: len(files_that_name(RIGID, "rigid")), 3, 3),
    Count("files that name walls outside their own", lambda: len(files_that_name(WALL, "components")), 3, 3),
    Count("files that name driven grains outside their own", lambda: len(files_that_name(DRIVEN, "components")), 3, 3),
    Count("code lines", code_lines, 35381 + sum(CAPABILITIES.values()), 32850),
    Count("private accesses of unit tests", private_accesses_of_tests, 27, 30),
)


if __name__ == "__main__":
    for count in COUNTS:
        print(f"{count.what:55} {count.now():6}  at most {count.most:6}  goal {count.goal:6}")
    print(
        *(f"  {number:3} {name}" for name, number in sorted(parameters().items(), key=lambda item: -item[1])), sep="\n"
    )
