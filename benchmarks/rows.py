"""The rows of the table: each is a function that measures one thing."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from . import scattering, worlds
from .timing import best, wall


def row(name: str, ours: float, unit: str, target: float, peer: float | None = None, of: str = "") -> dict[str, Any]:
    """One line; `met` compares ours with the target (less is better)."""
    return {
        "name": name,
        "ours": ours,
        "peer": peer,
        "peer_name": of,
        "unit": unit,
        "ratio": None if peer is None else peer / ours,
        "target": target,
        "met": bool(ours <= target),
    }


def steps(sim: Any, count: int) -> float:
    """Seconds per step of a simulation."""
    sim.run(steps=10)
    return best(lambda: sim._engine.advance(np.inf, count)) / count


def contact_step(quick: bool) -> dict[str, Any]:
    """Everything a step of touching grains needs, ledger and list checks included, per contact."""
    side = 10 if quick else 22
    sim = worlds.lattice(side)
    seconds = steps(sim, 300 if quick else 60)
    contacts = len(sim.contacts["pair"])
    return row(f"contact step, {side**3} grains", 1e9 * seconds / contacts, "ns per contact", 30.0)


def dipole_pair(quick: bool) -> dict[str, Any]:
    """All pairs of 1000 dipoles in a whole step, against NumPy in the same run."""
    count = 300 if quick else 1000
    sim = worlds.cloud(count)
    pairs = count * (count - 1) / 2
    seconds = steps(sim, 20)
    position, moment = sim.grains.position.copy(), sim.grains.moment.copy()
    numpy = best(lambda: worlds.dipoles_in_numpy(position, moment), 3)
    return row(
        f"dipole step, {count} grains",
        1e9 * seconds / pairs,
        "ns per pair",
        2.3,
        1e9 * numpy / pairs,
        "NumPy",
    )


def gas_step(quick: bool, count: int, target: float) -> dict[str, Any]:
    """Whole steps of a magnetic gas after its first contact."""
    sim = worlds.gas(count)
    while len(sim.contacts["pair"]) == 0 and sim.time < 2e-7:
        sim.run(steps=2000)
    seconds = steps(sim, 2000 if quick else 20000)
    return row(f"gas with contacts, {count} grains", 1e6 * seconds, "us per step", target)


def help_page(quick: bool) -> dict[str, Any]:
    """`sand --help`, wall time."""
    command = [sys.executable, "-m", "sand.cli.main", "--help"]
    return row("sand --help", wall(lambda: subprocess.run(command, capture_output=True, check=True)), "s", 0.3)


def start_up(quick: bool) -> list[dict[str, Any]]:
    """First compile in an empty cache, and a warm start, of a tiny case run by the command line."""
    with tempfile.TemporaryDirectory() as place:
        case = Path(place) / "tiny.toml"
        case.write_text(
            '[run]\nuntil = "1 ps"\n[box]\nperiodic = "1.2 um"\n[grains]\nnumber = 100\nradius = "10 nm"\n'
            'moment = "200 A m^2/kg"\ntemperature = "100 K"\n[forces.contact]\n[forces.dipoles]\n'
        )
        program = (
            "import sys, time; t = time.perf_counter()\n"
            "from sand.run.case import read_case; from sand.run.build import simulation_of\n"
            "import warnings; warnings.simplefilter('ignore')\n"
            "s = simulation_of(read_case(sys.argv[1]), None); s.run(steps=1)\n"
            "print(time.perf_counter() - t)"
        )
        env = os.environ | {"SAND_CACHE": str(Path(place) / "cache")}

        def begin() -> float:
            done = subprocess.run(
                [sys.executable, "-c", program, str(case)],
                env=env,
                capture_output=True,
                text=True,
                check=True,
            )
            return float(done.stdout)

        first, warm = begin(), min(begin() for _ in range(3))
        shutil.rmtree(Path(place) / "cache", ignore_errors=True)
    return [row("first compile and step", first, "s", 15.0), row("warm start to first step", warm, "s", 1.0)]


def scattering_flights(quick: bool) -> list[dict[str, Any]]:
    """Single flights of two magnetic grains, cold and with thermal spin."""
    return [
        row(name, ours, "ms per flight", target, peer, "SciPy DOP853, NumPy" if peer else "")
        for name, ours, target, peer in scattering.flights(quick)
    ]


def all_rows(quick: bool) -> list[dict[str, Any]]:
    """Measure everything."""
    return [
        contact_step(quick),
        dipole_pair(quick),
        gas_step(quick, 20, 2.5),
        gas_step(quick, 100, 25.0),
        help_page(quick),
        *start_up(quick),
        *scattering_flights(quick),
    ]
