"""Growth with rigid clusters beside growth grain by grain: the main job with damping, paired seeds, and tests.

`python -m benchmarks --rigid-clusters` writes docs/physics/rigid-clusters.csv.  `python -m benchmarks.rigid_clusters`
with `thin` or `many` reports the CPU time of a gas of 1000 grains, a hundred times thinner than the main job, until the
mean cluster size is 20, or of 10⁴ grains for 5 µs.
"""

from __future__ import annotations

import json
import multiprocessing
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import mannwhitneyu, wilcoxon

import sand
from sand.analysis.clusters import aggregate_moments, cluster_labels, unwrapped
from sand.analysis.shape import gyration_radius
from sand.basics.state import BROKEN, CONTACT_STEPS, GRAINS_AWAKE, LATE, MADE, RESTED, SLIPPED, SOME_AWAKE, WOKEN
from sand.io.table import write_table

TABLE = Path(__file__).parents[1] / "docs" / "physics" / "rigid-clusters.csv"
BOX, TEMPERATURE = 1.2e-6, 100.0
TIMES = (1e-6, 2e-6, 3e-6, 4e-6, 5e-6)
SMALLEST = 3
"""Grains of the smallest clusters in the fit of the fractal dimension."""
VARIANTS: dict[str, Any] = {
    "grains": None,
    "rigid": {},
    "rigid, η/2, ε/2": {"vibration": 0.005, "step_fraction": 0.05},
}
"""Settings of `sand.RigidClusters`; None for `sand.Verlet`."""


def main_job(variant: str, seed: int, **dipoles: Any) -> sand.Simulation:
    """The main job of a seed: 100 iron grains with damped contacts."""
    iron = {"radius": "10 nm", "material": "iron", "moment": "200 A m^2/kg"}
    grains = sand.setup.gas(100, BOX, temperature=TEMPERATURE, seed=seed, **iron)
    contact = sand.Contact(damping="critical", damping_ratio=0.2, settling_time="5 ns")
    given = VARIANTS[variant]
    stepping = None if given is None else sand.RigidClusters(**given)
    return sand.Simulation(grains, [contact, sand.Dipoles(**dipoles)], box=BOX, stepping=stepping, frame_every=1.0)


def growth(given: tuple[str, int]) -> dict[str, Any]:
    """One run: mean sizes, numbers of contacts, alignment of moments and fractal dimension, and what it cost."""
    warnings.simplefilter("ignore")
    sand.set_threads(1)
    variant, seed = given
    sim = main_job(variant, seed)
    sim.run(until=1e-9)  # loads or compiles the code
    found: dict[str, Any] = {"variant": variant, "seed": seed, "size": [], "clusters": []}
    begun = time.process_time()
    for end in TIMES:
        sim.run(until=end)
        row = sim.ledger.rows[-1]
        found["size"].append(row["mean_cluster_size"])
        found["clusters"].append(row["clusters"])
    found["seconds"] = time.process_time() - begun
    count, clock = sim.regular_state.count, sim.regular_state.clock
    names = {"made": MADE, "broken": BROKEN, "slipped": SLIPPED, "late": LATE, "woken": WOKEN, "rested": RESTED}
    found |= {name: int(count[k]) for name, k in (names | {"contact_steps": CONTACT_STEPS}).items()}
    found |= {"steps": sim.steps, "awake": clock[SOME_AWAKE] / sim.time, "drift": sim.ledger.drift}
    found |= {"grains_awake": clock[GRAINS_AWAKE] / sim.time}
    found |= {"quieting": row["lost_quieting"], "settling": row["lost_settling"], "dissipated": sim.ledger.dissipated}
    pairs = sim.contacts["pair"]
    labels, position = cluster_labels(100, pairs), unwrapped(sim.grains.position, pairs, sim.box)
    found["alignment"] = float(aggregate_moments(sim.grains.moment, labels)[1][labels].mean())
    members = [np.flatnonzero(labels == k) for k in range(labels.max() + 1)]
    large = [own for own in members if len(own) >= SMALLEST]
    radii = [gyration_radius(position[own], sim.grains.mass[own], sim.grains.radius[own]) for own in large]
    found["dimension"] = float(np.polyfit(np.log(radii), np.log([len(own) for own in large]), 1)[0])
    return found


def runs(variants: list[str], seeds: int, out: Path, workers: int = 2) -> list[dict[str, Any]]:
    """Runs of all variants and seeds, each written to the file `out` when it is finished, and not repeated."""
    lines = [json.loads(line) for line in out.read_text("utf-8").splitlines()] if out.exists() else []
    there = {(line["variant"], line["seed"]) for line in lines}
    jobs = [(variant, seed) for seed in range(1, seeds + 1) for variant in variants if (variant, seed) not in there]
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        for found in pool.imap_unordered(growth, jobs):
            lines.append(found)
            with out.open("a", encoding="utf-8") as file:
                file.write(json.dumps(found) + "\n")
    return lines


def compared(lines: list[dict[str, Any]], reference: str = "grains") -> list[dict[str, str]]:
    """Rows of the table: means with standard errors, and p of two tests against the reference (unpaired, paired)."""
    rows = []
    quantities = [(f"S at {1e6 * t:g} µs", lambda line, k=k: line["size"][k]) for k, t in enumerate(TIMES)]
    quantities += [(f"clusters at {1e6 * TIMES[-1]:g} µs", lambda line: line["clusters"][-1])]
    labels = {"made": "contacts formed", "broken": "contacts broken", "slipped": "slips", "alignment": "alignment"}
    labels |= {"dimension": "D_f"}
    quantities += [(label, lambda line, name=name: line[name]) for name, label in labels.items()]
    by_variant = {
        name: {line["seed"]: line for line in lines if line["variant"] == name}
        for name in VARIANTS
        if any(line["variant"] == name for line in lines)
    }
    for label, value in quantities:
        row = {"quantity": label}
        base = by_variant[reference]
        for name, own in by_variant.items():
            values = np.array([value(line) for line in own.values()], float)
            row[name] = f"{values.mean():.3g} ± {values.std(ddof=1) / np.sqrt(len(values)):.2g}"
            if name == reference:
                continue
            both = sorted(set(own) & set(base))
            one, other = (np.array([value(side[seed]) for seed in both], float) for side in (base, own))
            if (one == other).all():
                row[f"p, {name}"] = "equal"
            else:
                paired = wilcoxon(one, other, zero_method="zsplit").pvalue
                row[f"p, {name}"] = f"{mannwhitneyu(one, other).pvalue:.2f}; {paired:.2f}"
        rows.append(row)
    return rows


def write(seeds: int = 96, out: Path = Path("rigid-clusters.jsonl"), table: Path = TABLE) -> Path:
    """Write the table of all variants."""
    write_table(table, compared(runs(list(VARIANTS), seeds, out)))
    return table


GASES: dict[str, tuple[int, float, float, float, dict[str, Any]]] = {
    "thin": (1000, 12e-6, 1e-2, 20.0, {}),
    "many": (10_000, BOX * 100.0 ** (1.0 / 3.0), 5e-6, np.inf, {"periodic": "ewald", "accuracy": 1e-3}),
}
"""Grains, box [m], end [s], mean cluster size at which to end, and settings of the dipoles of two larger gases."""


def report(name: str) -> None:
    """Run a larger gas on one thread and print what it costs, a line for each fiftieth of its time."""
    warnings.simplefilter("ignore")
    sand.set_threads(1)
    number, box, end, largest, dipoles = GASES[name]
    iron = {"radius": "10 nm", "material": "iron", "moment": "200 A m^2/kg"}
    grains = sand.setup.gas(number, box, temperature=TEMPERATURE, seed=1, **iron)
    contact = sand.Contact(damping="critical", damping_ratio=0.2, settling_time="5 ns")
    forces = [contact, sand.Dipoles(**dipoles)]
    sim = sand.Simulation(grains, forces, box=box, stepping=sand.RigidClusters(), frame_every=end)
    begun, size = time.process_time(), 1.0
    parts = 50 if largest == np.inf else 1000
    for k in range(1, parts + 1):
        if size >= largest:
            break
        sim.run(until=end * k / parts)
        count, clock = sim.regular_state.count, sim.regular_state.clock
        size = sim.ledger.rows[-1]["mean_cluster_size"]
        print(
            f"{1e6 * sim.time:8.2f} µs, {time.process_time() - begun:6.1f} s of CPU: mean size {size:.2f}, "
            f"{sim.steps} steps of bodies, {count[CONTACT_STEPS]} of contacts, {count[MADE]} contacts formed, "
            f"{count[BROKEN]} broken, {count[WOKEN]} woken, {count[LATE]} seen late, "
            f"{clock[GRAINS_AWAKE] / sim.time:.2%} of the grains awake, energy error {sim.ledger.drift:.1e}",
            flush=True,
        )


if __name__ == "__main__":
    report(sys.argv[1])
