"""What frames, rows of the ledger, checkpoints and the guard cost beside the steps."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import sand

from .long_range import PER_VOLUME, dimers, seconds_per_step

FRAMES = 200
"""Frames of a run by default."""


def costs(count: int = 10_000) -> dict[str, Any]:
    """Seconds of wall time for a step, a row, a frame and a checkpoint, in one run of so many grains."""
    with tempfile.TemporaryDirectory() as place:
        start = dimers(count, PER_VOLUME)
        sim = sand.Simulation(
            start.grains,
            start.forces,
            box=start.box,
            out=Path(place) / "run",
            frame_every="1 s",
        )
        sim.run(steps=100)
        record, spent = sim.writer, {"row": [], "frame": [], "checkpoint": []}
        for _ in range(5):
            sim.run(steps=20)
            row = sim.ledger.rows[-1]
            spent["row"].append(_seconds(sim._log_row))
            spent["frame"].append(_seconds(lambda row=row: (record.write(sim, row), record._trajectory.flush(True))))
            spent["checkpoint"].append(_seconds(lambda: record.save(sim)))
        sizes = {path.suffix: path.stat().st_size for path in (Path(place) / "run").iterdir()}
        told = {name: sorted(times)[2] for name, times in spent.items()}
        return {"grains": count, "step": seconds_per_step(sim), **told, "checkpoint_bytes": sizes[".npz"]}


def share(cost: dict[str, Any], steps: float) -> float:
    """Part of the time of a run of so many steps that goes into output: 200 frames, checkpoints, the guard's looks."""
    stepping = cost["step"] * steps
    looks = FRAMES * (cost["row"] + cost["frame"]) + steps / 1e4 * cost["row"]
    checkpoints = min(stepping / 60.0 * cost["checkpoint"] + FRAMES * cost["checkpoint"], 0.01 * stepping)
    return (looks + checkpoints) / (stepping + looks + checkpoints)


def tell(cost: dict[str, Any]) -> None:
    """Print it."""
    for name in ("step", "row", "frame", "checkpoint"):
        print(f"{name:12} {1e3 * cost[name]:10.3f} ms")
    print(f"checkpoint   {cost['checkpoint_bytes'] / cost['grains']:10.0f} bytes per grain")
    for steps in (1e5, 1e6, 1e7):
        print(f"a run of {steps:.0e} steps, {steps * cost['step'] / 60:8.1f} min: {share(cost, steps):.2%} for output")


def _seconds(call: Any) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start
