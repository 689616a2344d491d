"""What lists and multiple time steps save (appendix A.7, A.8 of the paper), and how the cost grows with N."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

import sand

from .worlds import rest_distance

PER_VOLUME = 100 / 1.2e-6**3
"""Grains per m³ of the main job."""
WAYS = {
    "naive": ("all pairs", "every step"),
    "lists": ("cells", "every step"),
    "lists + cycles": ("cells", "impulse"),
}


def dimers(count: int, density: float, search: str = "auto", far: str = "impulse") -> sand.Simulation:
    """A thermal gas (100 K) of 20 nm iron grains stuck in twos, on jittered sites, numbered at random."""
    rng = np.random.default_rng(1)
    side = (count / density) ** (1.0 / 3.0)
    pairs = count // 2
    sites = math.ceil(pairs ** (1.0 / 3.0) - 1e-9)
    grid = np.stack(np.meshgrid(*[np.arange(sites)] * 3, indexing="ij"), -1).reshape(-1, 3)
    spacing = side / sites
    room = max(spacing - 5e-8, 0.0)
    centre = (rng.permutation(grid)[:pairs] + 0.5) * spacing - side / 2 + room * (rng.random((pairs, 3)) - 0.5)
    axis = rng.normal(size=(pairs, 3))
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    half = 0.5 * rest_distance(sand.IRON, 1e-8) * axis
    mass = sand.Grains([[0, 0, 0]], 1e-8, sand.IRON).mass[0]
    thermal = math.sqrt(1.380649e-23 * 100.0 / mass)
    speed = np.repeat(thermal * rng.normal(size=(pairs, 3)), 2, axis=0)
    position = np.stack([centre - half, centre + half], axis=1).reshape(-1, 3)
    moment = 200.0 * mass * np.repeat(axis, 2, axis=0)
    grains = sand.Grains(position, 1e-8, sand.IRON, velocity=speed, moment=moment)
    return sand.Simulation(
        grains,
        [sand.Contact(), sand.Dipoles()],
        box=sand.Box.periodic(side),
        stepping=sand.Verlet(far=far),
        neighbours=sand.Neighbours(search),
    )


def seconds_per_step(sim: sand.Simulation, budget: float = 4.0) -> float:
    """Wall time of one step, over as many steps as fit into about `budget` seconds, the best of three pieces."""
    sim.run(steps=1)
    rough = _timed(sim, 2)
    steps = int(min(max(budget / 3.0 / rough, 2), 20_000))
    return min(_timed(sim, steps) for _ in range(3))


def _timed(sim: sand.Simulation, steps: int) -> float:
    first = sim.state.steps
    start = time.thread_time()
    sim._engine.advance(np.inf, steps)
    return (time.thread_time() - start) / (sim.state.steps - first)


def savings(counts: tuple[int, ...] = (100, 1000, 10_000)) -> list[dict[str, Any]]:
    """Naive program (all pairs, every step) against lists, and lists with cycles, at two densities."""
    rows = []
    for name, density in (("main job", PER_VOLUME), ("a hundredth of it", PER_VOLUME / 100)):
        for count in counts:
            row: dict[str, Any] = {"density": name, "grains": count}
            for way, (search, far) in WAYS.items():
                sim = dimers(count, density, search, far)
                row[way] = 1e6 * seconds_per_step(sim)
                if way == "lists":
                    row["listed"] = sim._engine.parameters.search.listed
            row["lists save"] = row["naive"] / row["lists"]
            row["cycles save"] = row["lists"] / row["lists + cycles"]
            rows.append(row)
    return rows


def growth(counts: tuple[int, ...] = (1000, 3000, 10_000, 30_000, 100_000)) -> dict[str, Any]:
    """Cost of a step against N at the main job's density, and the exponent of a power law through it."""
    out: dict[str, Any] = {"grains": list(counts)}
    for way in ("lists", "lists + cycles"):
        cost = [seconds_per_step(dimers(n, PER_VOLUME, *WAYS[way])) for n in counts]
        slope = np.polyfit(np.log(counts), np.log(cost), 1)[0]
        out[way] = {"us per step": [1e6 * c for c in cost], "exponent": float(slope)}
    return out


def tell(rows: list[dict[str, Any]], grown: dict[str, Any]) -> None:
    """Print both tables."""
    print(f"{'density':20}{'N':>7}{'naive':>12}{'lists':>12}{'+ cycles':>12}  us per step   lists save   cycles save")
    for r in rows:
        mark = "" if r["listed"] else "  (box too small for cells: all pairs)"
        print(
            f"{r['density']:20}{r['grains']:7d}{r['naive']:12.4g}{r['lists']:12.4g}{r['lists + cycles']:12.4g}"
            f"{r['lists save']:25.3g}{r['cycles save']:14.3g}{mark}"
        )
    for way in ("lists", "lists + cycles"):
        cost = ", ".join(f"{n}: {c:.4g}" for n, c in zip(grown["grains"], grown[way]["us per step"], strict=True))
        print(f"{way}: us per step at N = {cost}; exponent {grown[way]['exponent']:.3f}")
