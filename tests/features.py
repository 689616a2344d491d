"""Which features of a simulation work together: a table for the docs, made by building a simulation of each pair.

``python -m tests.features`` writes the table into docs/reference/together.md.
"""

from __future__ import annotations

import itertools
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np

import sand

PAGE = Path(__file__).parents[1] / "docs" / "reference" / "together.md"
MARKS = "<!-- features -->\n", "<!-- end of features -->\n"

FEATURES: dict[str, dict[str, Any]] = {
    "walls": {"walls": [sand.Wall([0, 0, "-0.5 um"], [0, 0, 1], "silica")]},
    "driven grains": {"driven": [sand.Driven([0])]},
    "deformation": {"deformation": sand.Deformation("-1e4 1/s"), "box": "4 um"},
    "gas": {"forces": {"gas": sand.Gas("300 K", pressure="1 mbar")}},
    "bath": {"contact": {"damping": "critical", "bath_temperature": "300 K"}},
    "settling": {"contact": {"damping": "critical", "settling_time": "5 ns"}},
    "following cut-off": {"forces": {"dipoles": sand.Dipoles()}},
    "Ewald sums": {"forces": {"dipoles": sand.Dipoles()}, "box": "4 um"},
    "ramp of a field": {"forces": {"field": sand.Field(sand.Ramp([[0, 0, 0], [0, 0, 1e-3]], [0, "1 us"]))}},
    "ramp of the contacts": {"contact": {"surface_energy_factor": sand.Ramp([1, 0.5], [0, "1 us"])}},
    "following stiffness": {"contact": {"stiffness": "dt97"}},
    "Taylor scheme": {"stepping": {"far": "taylor"}, "forces": {"dipoles": sand.Dipoles(cutoff="0.5 um")}},
    "order along a curve": {"neighbours": sand.Neighbours(order="curve")},
    "rigid clusters": {"rigid": True, "contact": {"damping": "critical", "settling_time": "5 ns"}},
}
"""Features, and what each adds to the arguments of a simulation; `contact` are those of `sand.Contact`."""


def simulation(*features: str) -> sand.Simulation:
    """Four pairs of magnetic silica grains in contact, in a box that is open along z, with some features.

    Raises BadInput if they do not work together.
    """
    position = np.array([[x * 4e-7 + touch * 1.998e-7, 0.0, 0.0] for x in range(-2, 2) for touch in (0, 1)])
    grains = sand.Grains(position, "0.1 um", "silica", moment="1e-17 A m^2", velocity=[0.0, 0.01, 0.0])
    given = [FEATURES[name] for name in features]
    contact, stepping, forces, more = {}, {}, {}, {"box": sand.Box.periodic("4 um", "4 um", "open")}
    for each in given:
        contact |= each.get("contact", {})
        stepping |= each.get("stepping", {})
        forces |= each.get("forces", {})
        own = ("walls", "driven", "deformation", "box", "neighbours")
        more |= {name: value for name, value in each.items() if name in own}
    verlet = sand.Verlet(**stepping)
    bodies = any(each.get("rigid") for each in given)
    how = sand.RigidClusters(contact_stepping=verlet) if bodies else verlet
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return sand.Simulation(grains, [sand.Contact(**contact), *forces.values()], stepping=how, seed=1, **more)


def refusal(*features: str) -> str:
    """Why features do not work together, or nothing."""
    try:
        simulation(*features)
    except sand.BadInput as error:
        return "; ".join(error.problems)
    return ""


def table() -> str:
    """The table as Markdown: the pairs that are refused, with the reason; all other pairs work."""
    rows = [f"| {one} | {other} | {reason} |" for (one, other), reason in refused().items()]
    names = ", ".join(FEATURES)
    return "\n".join([f"Features: {names}.", "", "| | with | message |", "|---|---|---|", *rows, ""])


def refused() -> dict[tuple[str, str], str]:
    """The pairs of features that are refused, and why."""
    found = {pair: refusal(*pair) for pair in itertools.combinations(FEATURES, 2)}
    return {pair: reason for pair, reason in found.items() if reason}


def written() -> str:
    """The page with the table as it is now."""
    begin, end = map(re.escape, MARKS)
    return re.sub(f"(?<={begin}).*?(?={end})", lambda _: table(), PAGE.read_text("utf-8"), flags=re.DOTALL)


if __name__ == "__main__":
    PAGE.write_text(written(), "utf-8")
