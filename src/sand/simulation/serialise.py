"""The case of a simulation: the content of its case.toml."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from ..engine.component import in_use
from ..forces.base import LongRangeForce
from .cadence import SHORTEST_DURATION


def changed_tables(one: Any, other: Any) -> list[str]:
    """Names of the tables in which the cases of two simulations differ, [run] excepted."""
    first, second = (case_of(each, math.inf, math.inf) for each in (one, other))
    return [name for name in first if name != "run" and first[name] != second[name]]


def case_of(simulation: Any, until: float, last_step: float, stop: str | None = None) -> dict[str, Any]:
    """Build the case of a simulation, all defaults filled in, SI units; `sand resume` reads it back.

    Parameters
    ----------
    until : float
        Planned end [s], or infinity.
    last_step : float
        Planned last step, or infinity.
    stop : str, optional
        Condition that ends the run.
    """
    of_grains = simulation.grains.materials  # first, in the order of their indices
    extra, box = in_use(simulation._system.given), simulation._system.box
    materials = list({m.name: m for m in (*of_grains, *(m for each in extra for m in each.materials()))}.values())
    recipe = simulation.recipe or {"kind": "given", "number": len(simulation.grains)}
    if recipe["kind"] != "gas":  # a gas names the materials from which it is drawn
        names = [m.name for m in of_grains]
        recipe = {**recipe, "material": names[0] if len(names) == 1 else names}
    run = {
        "until": max(until, SHORTEST_DURATION),  # a run to time 0 can also be resumed
        "steps": last_step if last_step == float("inf") else int(last_step),
        "stop": stop,
        "frame_every": simulation.frame_every,
        "row_every": simulation.row_every,
        "checkpoint_every": simulation.checkpoint_every,
        "stress": simulation.ledger.stress or None,
        "seed": int(simulation.seed or 0),
    }
    forces = {}
    for force in simulation.forces:
        long_range = isinstance(force, LongRangeForce)
        forces[force.name] = dict(force.resolved(simulation.start, box) if long_range else force.parameters())
    lengths = ["open" if v is None else v for v in box.lengths]
    return {
        "run": {k: v for k, v in run.items() if v is not None and v != float("inf")},
        "box": {} if box.is_open else {"periodic": lengths} | ({"tilt": box.tilt} if box.tilt else {}),
        "grains": recipe,
        "materials": {
            m.name: {k: v for k, v in dataclasses.asdict(m).items() if k != "name" and v is not None} for m in materials
        },
        "forces": forces,
        "stepping": simulation.stepping.parameters(),
        "neighbours": simulation.neighbours.parameters(),  # as resolved at the start
        **{each.name: each.parameters() for each in extra},
    }
