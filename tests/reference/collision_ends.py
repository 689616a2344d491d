"""Outcomes of 200 collisions at their end, and after ten times as long: writes collision-ends.csv.

Speed, impact parameter, material, damping, kind and number of grains of both bodies are drawn at random.  Run it with:

    python -m tests.reference.collision_ends           # 10 minutes of one core
    python -m tests.reference.collision_ends 0 200 40  # every fortieth one; prints them, writes nothing
"""

from __future__ import annotations

import csv
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

import sand
from sand.analysis.clusters import cluster_labels
from sand.experiments.collision import collide
from sand.setup.aggregates import build
from sand.theory import contact

TABLE = Path(__file__).with_name("collision-ends.csv")
NUMBER, LONGER = 200, 10.0
RADIUS = "0.1 um"
DAMPING = {
    "none": {},
    "viscoelastic": {"damping": "viscoelastic", "viscous_time": "1.25e-11 s"},
    "critical": {"damping": "critical"},
}
SLOWEST, FASTEST = 0.02, 2.0
"""Speeds in units of 20 √(E_break/m), m of a grain."""
WIDEST = 0.6
"""Largest impact parameter in units of the sum of the outer radii; beyond, most bodies miss each other."""


def case(number: int) -> dict[str, Any]:
    """Settings of a collision, drawn with its number as the seed."""
    rng = np.random.default_rng([7, number])
    target = int(rng.integers(5, 46))
    settings = {
        "number": number,
        "material": str(rng.choice(["ice", "silica"])),
        "damping": str(rng.choice(list(DAMPING), p=[0.6, 0.2, 0.2])),
        "kind": str(rng.choice(["bpca", "bcca"])),
        "target": target,
        "projectile": int(rng.integers(1, min(target, 60 - target) + 1)),
    }
    numbers = contact(settings["material"], RADIUS)
    mass = float(sand.setup.grain(radius=RADIUS, material=settings["material"]).mass[0])
    share = SLOWEST * (FASTEST / SLOWEST) ** rng.random()
    settings["speed"] = float(f"{share * 20.0 * math.sqrt(numbers.break_energy / mass):.4g}")
    settings["b"] = float(f"{WIDEST * math.sqrt(rng.random()):.4f}")
    return settings


def fragments(simulation: sand.Simulation) -> str:
    """Numbers of grains of the bodies, largest first: '12 3 1x4' has four single grains."""
    labels = cluster_labels(len(simulation.grains), simulation.contacts["pair"])
    sizes, numbers = np.unique(np.bincount(labels), return_counts=True)
    return " ".join(f"{s}x{n}" if n > 1 else f"{s}" for s, n in zip(sizes[::-1], numbers[::-1], strict=True))


def measured(number: int) -> dict[str, Any]:
    """One row of the table: settings, and what there is at the end and after ten times as long."""
    row = case(number)
    bodies = [
        build(row["kind"] if n > 1 else "grain", n, radius=RADIUS, material=row["material"], seed=2 * number + k)
        for k, n in enumerate((row["target"], row["projectile"]))
    ]
    forces = [sand.Contact(**DAMPING[row["damping"]])]
    given = {"speed": row["speed"], "impact_parameter": f"{row['b']} b", "seed": number, "frames": 1}
    found, simulation = collide(*bodies, **given, forces=forces)
    row |= {"end [us]": round(1e6 * found.time, 4), "outcome": found.outcome, "decided": int(found.quiet)}
    row |= {"fragments": fragments(simulation), "contacts": found.contacts_after}
    simulation.frame_every = simulation.row_every = LONGER * found.time
    simulation.run(until=LONGER * found.time)
    row |= {"fragments later": fragments(simulation), "contacts later": len(simulation.contacts["pair"])}
    return row


def main(first: int = 0, last: int = NUMBER, every: int = 1) -> None:
    """Measure collisions; all of them are written."""
    rows = []
    for number in range(first, last, every):
        rows.append(measured(number))
        print(*rows[-1].values(), sep=",", flush=True)
    if len(rows) == NUMBER:
        with TABLE.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
