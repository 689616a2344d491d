"""Two bodies collide: what becomes of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import checked
from ..config.build import resume
from ..contact.model import Contact
from ..errors import BadInput
from ..forces.base import Force
from ..grains import Grains
from ..integrate.adaptive import Adaptive
from ..integrate.verlet import Verlet
from ..io.run_folder import TRAJECTORY
from ..io.trajectory import Frames
from ..setup.encounters import encounter, turned_at_random
from ..simulation.serialise import case_of
from ..simulation.simulation import Simulation
from ..units import si
from .collision_outcome import Approach, Collision, classify_collision

QUIET = 3
"""A collision is over after this many looks in a row without a contact made, moved or broken."""
LOOKS = 400
"""It is stopped after this many looks at the latest."""


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
    stepping: Verlet | Adaptive | None = None,
    out: str | Path | None = None,
    overwrite: bool = False,
    observers: Sequence[Any] = (),
) -> tuple[Collision, Simulation]:
    """Let a projectile hit a target in open space and wait until nothing happens any more.

    Parameters
    ----------
    target, projectile : Grains
        bodies at rest, from `sand.setup` or of one's own.
    speed, impact_parameter, along
        see `sand.setup.encounter`.
    seed : int or None, optional
        turn both bodies at random first; None leaves them as they are.
    forces : Sequence[Force] or None, optional
        `[sand.Contact()]` by default.
    stepping, out, overwrite, observers : optional
        as for `sand.Simulation`.

    Returns
    -------
    tuple[Collision, Simulation]
        The outcome, and the simulation as it ended.

    Raises
    ------
    BadInput
        see `encounter` and `Simulation`.
    """
    start = approach(target, projectile, speed=speed, impact_parameter=impact_parameter, along=along, seed=seed)
    simulation = prepare(start, forces, stepping, out=out, overwrite=overwrite, observers=observers)
    return run_to_end(start, simulation), simulation


def approach(
    target: Grains, projectile: Grains, *, speed: Any, impact_parameter: Any, along: Any, seed: int | None
) -> Approach:
    """The bodies of a collision before they meet; the arguments are those of `collide`.  Raises BadInput."""
    v = si(speed, "m/s", "speed", above=0.0)
    if seed is not None:
        rng = np.random.default_rng(seed)
        target, projectile = turned_at_random(target, rng), turned_at_random(projectile, rng)
    met = encounter(target, projectile, speed=v, impact_parameter=impact_parameter, along=along)
    return Approach(target, projectile, met.grains, met.flight, v, seed)


def prepare(
    start: Approach, forces: Sequence[Force] | None = None, stepping: Verlet | Adaptive | None = None, **options: Any
) -> Simulation:
    """The simulation of a collision at its start; options are passed on to `Simulation`.  Raises BadInput."""
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
    stepping: Verlet | Adaptive | None = None,
    **options: Any,
) -> Simulation:
    """The simulation of a collision that was interrupted, from the newest checkpoint in its folder.

    Raises
    ------
    BadInput
        as `config.build.resume`; or the folder holds another collision than the one asked for.
    """
    simulation = resume(folder, **options)
    asked, begun = (case_of(one, math.inf, math.inf) for one in (prepare(start, forces, stepping), simulation))
    changed = [name for name in asked if name != "run" and asked[name] != begun[name]]
    first = _first_frame(Path(folder) / TRAJECTORY)
    for name in ("position", "velocity") if first is not None else ():
        ours, theirs = getattr(start.grains, name), getattr(first, name)
        # a trajectory holds single precision
        if ours.shape != theirs.shape or not np.allclose(ours, theirs, rtol=0.0, atol=1e-6 * float(np.abs(ours).max())):
            changed.append(name)
    if changed:
        raise BadInput(
            f"{folder} holds a collision with other {changed[0]}, and a collision cannot change on its way; "
            "put its case back, or begin a new one in another folder"
        )
    return simulation


def _first_frame(path: Path) -> Any:
    """Of a trajectory; None for one that is missing or damaged, which the run that goes on mends or begins anew."""
    try:
        frames = Frames(path)
    except BadInput:
        return None
    try:
        return frames[0]
    except BadInput:
        return None
    finally:
        frames.close()


def run_to_end(start: Approach, simulation: Simulation) -> Collision:
    """Run a collision on to its end, from wherever it stands, and judge it.

    Raises
    ------
    BadInput
        the physics stopped it.
    Interrupted
        Ctrl-C; `resume_collision` goes on.
    """
    before = len(simulation.contacts["pair"]) if simulation.steps == 0 else int(simulation.ledger.rows[0]["contacts"])
    record = simulation.record
    if record is not None:
        record.draws = False  # not at each look, but once, when all is over
    quiet = _until_quiet(simulation, start)
    if record is not None:
        record.draw(simulation)
    return classify_collision(simulation, start, before, quiet)


def _until_quiet(simulation: Simulation, start: Approach) -> bool:
    """Run on until contacts neither form, move nor break for a while; False if that never comes.

    Looks that were taken before an interruption stand in the ledger: each is its first row at or after its time.
    """
    across = float(np.ptp(start.grains.position, axis=0).max())
    until, calm, last = start.flight, 0, (-1, -1, -1)
    for look in range(1 + LOOKS):  # the first is when they can touch
        row = next((row for row in simulation.ledger.rows if row["time"] >= until), None)
        if row is None:
            result = simulation.run(until=until)
            if result.outcome.is_physics:
                raise BadInput(f"the collision cannot be computed: {result}")
            row = simulation.ledger.rows[-1]
        until = row["time"] + 10.0 * start.check_every
        if look == 0:
            continue
        now = (int(row["made"]), int(row["moved"]), int(row["broken"]))
        calm = calm + 1 if now == last else 0
        last = now
        met = now[0] > 0 or row["time"] > start.flight + across / start.speed
        if met and calm >= QUIET:
            return True
    return False


@checked
def collide_many(
    build: Callable[[int], tuple[Grains, Grains]],
    seeds: Sequence[int],
    executor: Executor | None = None,
    **options: Any,
) -> list[Collision]:
    """The same collision for many seeds: other aggregates, other orientations.

    Parameters
    ----------
    build : Callable[[int], tuple[Grains, Grains]]
        makes target and projectile for a seed; a module-level function if processes are to run it.
    seeds : Sequence[int]
        one collision each; results come in their order, whatever the executor.
    executor : Executor or None, optional
        any `concurrent.futures.Executor`; None: one after the other here.
    options
        passed on to `collide`.
    """
    if executor is None:
        return [_one(build, seed, options) for seed in seeds]
    waiting = [executor.submit(_one, build, seed, options) for seed in seeds]
    return [future.result() for future in waiting]


def _one(build: Callable[[int], tuple[Grains, Grains]], seed: int, options: dict[str, Any]) -> Collision:
    target, projectile = build(seed)
    return collide(target, projectile, seed=seed, **options)[0]
