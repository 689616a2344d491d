"""What frames, rows of the ledger, checkpoints and the guard cost beside the steps."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import sand
from sand.basics.threads import set_threads

from .long_range import PER_VOLUME, dimers, seconds_per_step

FRAMES = 200
"""Frames of a run by default."""


OUTPUTS = 200
"""Outputs in a run that measures what one costs."""
LIMITS = {100: 0.5e-3, 1000: 2e-3}
"""Largest CPU time [s] of an output by number of grains."""


def output_seconds(count: int) -> float:
    """CPU time [s] of an output of so many grains: the step to its time, row, frame and file.

    A run with `OUTPUTS` outputs less one of the same steps, in a folder too, without any between its start and its end;
    with one thread, as waiting threads take CPU time; the least of three pairs.
    """
    start = dimers(count, PER_VOLUME)
    found = []
    set_threads(1)
    for _ in range(3):
        with tempfile.TemporaryDirectory() as place:
            taken = []
            for every in ("0.1 ns", "1 s"):
                out = Path(place) / every
                sim = sand.Simulation(start.grains, start.forces, box=start.box, out=out, frame_every=every)
                sim.writer.draws = False
                sim.run(until="1 ns")  # loads code
                began = time.process_time()
                sim.run(until=1e-9 + OUTPUTS * 1e-10)
                taken.append(time.process_time() - began)
            found.append((taken[0] - taken[1]) / (OUTPUTS - 1))
    set_threads(None)
    return min(found)


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
        outputs = {str(number): output_seconds(number) for number in LIMITS}
        return {
            "outputs": outputs,
            "grains": count,
            "step": seconds_per_step(sim),
            **told,
            "checkpoint_bytes": sizes[".npz"],
        }


def share(cost: dict[str, Any], steps: float) -> float:
    """Part of the time of a run of so many steps that goes into output: 200 frames, checkpoints, the guard's looks."""
    stepping = cost["step"] * steps
    looks = FRAMES * (cost["row"] + cost["frame"]) + steps / 1e4 * cost["row"]
    checkpoints = min(stepping / 60.0 * cost["checkpoint"] + FRAMES * cost["checkpoint"], 0.01 * stepping)
    return (looks + checkpoints) / (stepping + looks + checkpoints)


def tell(cost: dict[str, Any]) -> None:
    """Print it."""
    for number, most in LIMITS.items():
        seconds = cost["outputs"][str(number)]
        missed = "" if seconds <= most else "  MISSED"
        print(f"an output of {number} grains {1e3 * seconds:6.2f} ms of CPU time, at most {1e3 * most:g}{missed}")
    for name in ("step", "row", "frame", "checkpoint"):
        print(f"{name:12} {1e3 * cost[name]:10.3f} ms")
    print(f"checkpoint   {cost['checkpoint_bytes'] / cost['grains']:10.0f} bytes per grain")
    for steps in (1e5, 1e6, 1e7):
        print(f"a run of {steps:.0e} steps, {steps * cost['step'] / 60:8.1f} min: {share(cost, steps):.2%} for output")


def _seconds(call: Any) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start
