"""Collision of two bodies, simulated until contacts no longer change."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..basics.arguments import checked
from ..basics.errors import BadInput
from ..basics.grains import Grains
from ..basics.paths import user_path
from ..basics.units import seed_given, si
from ..config.build import resume
from ..contact.model import Contact
from ..forces.base import Force
from ..integrate.integrator import Integrator
from ..io.run_folder import TRAJECTORY
from ..io.trajectory import Frames
from ..setup.encounters import encounter, turned_at_random
from ..simulation.serialise import changed_tables
from ..simulation.simulation import Simulation
from .collision_outcome import Approach, Collision, classify_collision, collision_title
from .parting import cannot_touch

QUIET = 3
"""Number of consecutive intervals without contacts formed, slipped or broken that end a collision."""
MOST_CHECKS = 400
"""Largest number of intervals."""
INTERVAL = 10.0
"""Length of an interval, in units of `Approach.check_every`."""
USUAL_CHECKS = 60
"""Intervals that two aggregates of silica take to come to rest (`examples/collision.toml`: 75 to 130)."""


@checked
def collide(
    target: Grains,
    projectile: Grains,
    *,
    speed: Any,
    impact_parameter: Any = 0.0,
    along: Any = "x",
    seed: int | None = None,
    forces: Sequence[Force] | None = None,
    stepping: Integrator | None = None,
    out: str | Path | None = None,
    overwrite: bool = False,
    observers: Sequence[Any] = (),
) -> tuple[Collision, Simulation]:
    """Simulate the collision of a projectile with a target in open space until contacts no longer change.

    Parameters
    ----------
    target, projectile : Grains
        Bodies at rest.
    speed, impact_parameter, along
        See `sand.setup.encounter`.
    seed : int or None, optional
        Seed of random rotations of both bodies; None keeps their orientations.
    forces : sequence of Force or None, optional
        `[sand.Contact()]` by default.
    stepping, out, overwrite, observers : optional
        As for `sand.Simulation`.

    Returns
    -------
    Collision
        The outcome.
    Simulation
        The simulation at its end.

    Raises
    ------
    BadInput
        As `sand.setup.encounter` and `sand.Simulation`.
    """
    start = approach(target, projectile, speed=speed, impact_parameter=impact_parameter, along=along, seed=seed)
    simulation = prepare(start, forces, stepping, out=out, overwrite=overwrite, observers=observers)
    return run_to_end(start, simulation), simulation


def approach(
    target: Grains, projectile: Grains, *, speed: Any, impact_parameter: Any, along: Any, seed: int | None
) -> Approach:
    """Bodies of a collision before contact, with the arguments of `collide`. Raises BadInput."""
    v = si(speed, "m/s", "speed", above=0.0)
    if seed is not None:
        rng = np.random.default_rng(seed_given(seed))
        target, projectile = turned_at_random(target, rng), turned_at_random(projectile, rng)
    pair = encounter(target, projectile, speed=v, impact_parameter=impact_parameter, along=along)
    return Approach(target, projectile, pair.grains, pair.flight, v, seed)


def prepare(
    start: Approach, forces: Sequence[Force] | None = None, stepping: Integrator | None = None, **options: Any
) -> Simulation:
    """Set up the simulation of a collision; options are those of `Simulation`. Raises BadInput."""
    return Simulation(
        start.grains,
        [Contact()] if forces is None else forces,
        stepping=stepping,
        seed=start.seed,
        frame_every=start.check_every,
        **options,
    )


def resume_collision(
    start: Approach,
    folder: str | Path,
    forces: Sequence[Force] | None = None,
    stepping: Integrator | None = None,
    **options: Any,
) -> Simulation:
    """Resume the simulation of an interrupted collision from its newest checkpoint.

    Raises
    ------
    BadInput
        As `config.build.resume`; or if the folder contains a different collision.
    """
    simulation = resume(folder, **options)
    changed = changed_tables(prepare(start, forces, stepping), simulation)
    try:
        with closing(Frames(user_path(folder, "folder") / TRAJECTORY)) as frames:
            first = frames[0]
    except BadInput:  # missing or damaged; the resumed run repairs it
        first = None
    for name in ("position", "velocity") if first is not None else ():
        ours, theirs = getattr(start.grains, name), getattr(first, name)
        # trajectories are stored in single precision
        if ours.shape != theirs.shape or not np.allclose(ours, theirs, rtol=0.0, atol=1e-6 * float(np.abs(ours).max())):
            changed.append(name)
    if changed:
        raise BadInput(
            f"{folder} contains a collision with different {changed[0]}; restore its case, or start a new collision in "
            "another folder"
        )
    return simulation


def run_to_end(start: Approach, simulation: Simulation) -> Collision:
    """Run a collision to its end and classify the outcome.

    Raises
    ------
    BadInput
        If the simulation stopped for physical reasons.
    Interrupted
        By Ctrl-C; `resume_collision` resumes.
    """
    before = len(simulation.contacts["pair"]) if simulation.steps == 0 else int(simulation.ledger.rows[0]["contacts"])
    record = simulation.writer
    if record is not None:
        record.draws = False  # the figure is drawn once at the end, not after each interval
    end = _until_quiet(simulation, start)
    found = classify_collision(simulation, start, before, end)
    simulation.title = collision_title([asdict(found)], start.bodies())
    if record is not None:
        record.draw(simulation)
    return found


def expected_end(start: Approach) -> float:
    """Time [s] at which a collision with contacts usually ends; it takes `MOST_CHECKS` intervals at most."""
    return start.flight + USUAL_CHECKS * INTERVAL * start.check_every


def _until_quiet(simulation: Simulation, start: Approach) -> str:
    """Run until contacts neither form, slip nor break for `QUIET` intervals, or bodies that miss cannot touch any more.

    Checks made before an interruption are repeated with the ledger: each uses the row of its time.

    Returns
    -------
    str
        Why it ended; "" after `MOST_CHECKS` intervals.
    """
    across = float(np.ptp(start.grains.position, axis=0).max())
    until, unchanged, last = start.flight, 0, (-1, -1, -1)
    for check in range(1 + MOST_CHECKS):  # the first one is at the earliest contact
        row = next((row for row in simulation.ledger.rows if row["time"] >= until), None)
        if row is None:
            result = simulation.run(until=until)
            if result.outcome.is_physics:
                raise BadInput(f"the collision cannot be computed: {result}")
            row = simulation.ledger.rows[-1]
        until = row["time"] + INTERVAL * start.check_every
        now = (int(row["made"]), int(row["moved"]), int(row["broken"]))
        # had it been so at an earlier row, the collision would have ended there
        if not any(now) and row["time"] >= simulation.time:
            parted = cannot_touch(simulation, len(start.target))
            if parted:
                return parted
        if check == 0:
            continue
        unchanged = unchanged + 1 if now == last else 0
        last = now
        contact = now[0] > 0 or row["time"] > start.flight + across / start.speed
        if contact and unchanged >= QUIET:
            return "contacts no longer change"
    return ""


@checked
def collide_many(
    build: Callable[[int], tuple[Grains, Grains]],
    seeds: Sequence[int],
    executor: Executor | None = None,
    **options: Any,
) -> list[Collision]:
    """Simulate the same collision for many seeds, with different aggregates and orientations.

    Parameters
    ----------
    build : callable
        Returns target and projectile for a seed; a module-level function if an executor runs it in other processes.
    seeds : sequence of int
        One collision each; results have this order.
    executor : Executor or None, optional
        Any `concurrent.futures.Executor`; None computes in this process.
    **options
        Options of `collide`.
    """
    return list((map if executor is None else executor.map)(partial(_one, build, options), seeds))


def _one(build: Callable[[int], tuple[Grains, Grains]], options: dict[str, Any], seed: int) -> Collision:
    return collide(*build(seed), seed=seed, **options)[0]
