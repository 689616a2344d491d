"""How much physical time an hour buys, and what it is worth: beside a run with a tenth of the step."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np

import sand
from sand.config.build import simulation_of
from sand.config.case import read_case

from .start_up import MAIN_JOB
from .timing import thread

FINER = 10
"""How many times shorter the steps of the run are that stands for the truth; its dipoles are summed in every step."""
GRAIN = {"radius": "10 nm", "material": sand.IRON, "moment": "200 A m^2/kg"}


class Regime(NamedTuple):
    """A start, and how long it is looked at."""

    name: str
    grains: sand.Grains
    box: sand.Box
    time: float  # [s]


def before_contact(quick: bool) -> Regime:
    """The main job's gas, until shortly before anything touches."""
    sim = simulation_of(read_case(MAIN_JOB), None)
    while len(sim.contacts["pair"]) == 0:
        sim.run(steps=100)
    return Regime("gas before contact", sim.start, sim.box, (0.3 if quick else 0.9) * sim.time)


def quiet(quick: bool) -> Regime:
    """A compact aggregate whose moments lie as they like, left to itself."""
    body = sand.setup.bpca(100, moments="relaxed", seed=1, **GRAIN)
    return Regime("quiet aggregate of 100", body, sand.Box.open(), 2e-9 if quick else 2e-8)


def busy(quick: bool) -> Regime:
    """Two such aggregates that hit each other at 5 m/s."""
    two = [sand.setup.bpca(100, moments="relaxed", seed=seed, **GRAIN) for seed in (1, 2)]
    start = sand.setup.encounter(*two, speed=5.0, impact_parameter="0.3 b")
    time = start.flight + (1e-9 if quick else 4e-9)
    return Regime("collision of two of 100, 5 m/s", start.grains, sand.Box.open(), time)


def fly(one: Regime, stepping: sand.Verlet) -> tuple[sand.Simulation, float]:
    """The run from the start, and its thread time [s]."""
    sim = sand.Simulation(one.grains, [sand.Contact(), sand.Dipoles()], box=one.box, stepping=stepping)
    sim.run(steps=1)
    return sim, thread(lambda: sim.run(until=one.time))


def measured(one: Regime) -> dict[str, Any]:
    """One row: cost, drift, and differences from the finer run."""
    ours, seconds = fly(one, sand.Verlet())
    step = one.time / ours.state.steps / FINER
    truth, longer = fly(one, sand.Verlet(step=step, far="every step"))
    # both end with the first step after the time asked for: go back along the last velocities
    there = [s.grains.position - s.grains.velocity * (s.time - one.time) for s in (ours, truth)]
    apart = np.linalg.norm(one.box.nearest(there[0] - there[1]), axis=1) / ours.grains.radius
    energy = [s.ledger.rows[-1]["translation"] + s.ledger.rows[-1]["rotation"] for s in (ours, truth)]
    lost = [s.ledger.dissipated for s in (ours, truth)]
    return {
        "regime": one.name,
        "time": one.time,
        "steps": ours.state.steps,
        "time per hour": 3600.0 * one.time / seconds,
        "drift": ours.ledger.drift,
        "finer: step": step,
        "finer: drift": truth.ledger.drift,
        "finer: time per hour": 3600.0 * one.time / longer,
        "position": float(apart.max()),
        "median position": float(np.median(apart)),
        "kinetic energy": energy[0] / energy[1] - 1.0,
        "dissipated energy": lost[0] / lost[1] - 1.0 if lost[1] > 0.0 else 0.0,
    }


def rows(quick: bool) -> Iterator[dict[str, Any]]:
    """One for each regime."""
    for start in (before_contact, quiet, busy):
        yield measured(start(quick))


def tell(told: Iterable[dict[str, Any]]) -> None:
    """Print them as they come."""
    print(f"{'':62} | beside {FINER}× shorter steps")
    print(
        f"{'':32} {'time':>9} {'time/hour':>10} {'drift':>8} | {'time/hour':>10} {'drift':>8} {'largest':>8}"
        f" {'median':>8} {'kinetic':>8} {'lost':>8}"
    )
    for one in told:
        print(
            f"{one['regime']:32} {one['time']:9.3g} {one['time per hour']:10.3g} {one['drift']:8.2g} |"
            f" {one['finer: time per hour']:10.3g} {one['finer: drift']:8.2g} {one['position']:8.2g}"
            f" {one['median position']:8.2g} {one['kinetic energy']:8.2g} {one['dissipated energy']:8.2g}",
            flush=True,
        )
    print(
        "times in s (physical); largest and median difference of positions in radii of a grain; relative differences\n"
        "of the kinetic energy, which rings, and of the energy lost in contacts, forming included"
    )
