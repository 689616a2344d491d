"""Collision of two bodies, simulated until its outcome is decided."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from ..analysis.clusters import cluster_labels
from ..basics.arguments import MOST_STEPS, checked
from ..basics.errors import BadInput, warn
from ..basics.grains import Grains
from ..basics.paths import user_path
from ..basics.settings import Reading, Settings, Whole
from ..basics.state import BROKEN, CHANGED, MADE, SLID, SLIPPED
from ..basics.units import format_quantity, is_word, seed_given, si
from ..basics.wall_time import format_wall_time
from ..config.build import resume
from ..contact.model import Contact
from ..forces.base import Force
from ..integrate.integrator import Integrator
from ..io.run_folder import TRAJECTORY
from ..io.trajectory import Frames
from ..setup.encounters import encounter, turned_at_random
from ..simulation.cadence import FRAMES, duration
from ..simulation.condition import GIVEN, OwnCondition
from ..simulation.serialise import changed_tables
from ..simulation.simulation import Simulation
from .collision_outcome import Approach, Collision, classify_collision, collision_title
from .parting import cannot_touch, forces_at_distance, has_bound
from .settled import are_settled

QUIET = 30.0
"""Time in which no contact forms, slips or breaks after which all are at rest, in units of `Approach.unit_of_time`."""
LONGEST = 4000.0
"""Longest time of a collision after the earliest contact, in the same units."""
USUAL = 600.0
"""Time after the earliest contact at which a collision usually ends, in the same units."""
LOOK_EVERY = 1000
"""Regular steps between two looks whether a collision has ended; with rigid clusters one."""
ENDS = ("outcome", "rest")
"""Words for the end of a collision."""


def _end(value: Any, name: str) -> Any:
    """Read the end of a collision: a word of `ENDS`, or a time [s].  Raises BadInput."""
    if any(is_word(value, word) for word in ENDS):
        return value
    try:
        return duration(value, name)
    except BadInput as error:
        raise BadInput([f"{line}; or give 'outcome' or 'rest'" for line in error.problems]) from None


@dataclass(frozen=True)
class Ending(Settings):
    """When a collision ends, and how often it is recorded.

    Parameters
    ----------
    end : str or float, optional
        "outcome": when no two fragments can touch again and none is expected to break; "rest": when contacts no longer
        change; or a time [s].
    frames : int, optional
        Number of frames, and of rows of the ledger, until the time at which a collision usually ends, or until `end`
        if that is a time; each further doubling of the time adds half as many.
    """

    end: Annotated[Any, Reading(_end)] = "outcome"
    frames: Annotated[int, Whole(1, MOST_STEPS)] = FRAMES


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
    end: Any = "outcome",
    frames: Any = FRAMES,
    out: str | Path | None = None,
    overwrite: bool = False,
    observers: Sequence[Any] = (),
) -> tuple[Collision, Simulation]:
    """Simulate the collision of a projectile with a target in open space until its outcome is decided.

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
    end, frames : optional
        See `Ending`.
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
    ending = Ending(end, frames)
    start = approach(target, projectile, speed=speed, impact_parameter=impact_parameter, along=along, seed=seed)
    simulation = prepare(start, forces, stepping, ending, out=out, overwrite=overwrite, observers=observers)
    return run_to_end(start, simulation, ending), simulation


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
    start: Approach,
    forces: Sequence[Force] | None = None,
    stepping: Integrator | None = None,
    ending: Ending | None = None,
    **options: Any,
) -> Simulation:
    """Set up the simulation of a collision; options are those of `Simulation`. Raises BadInput.

    Warns if it ends, by `ending`, before the outcome can be decided, or long after that.
    """
    given = [Contact()] if forces is None else forces
    simulation = Simulation(start.grains, given, stepping=stepping, seed=start.seed, **options)
    if ending is not None and (text := _unfit_end(start, simulation, ending)):
        warn(text)
    return simulation


def _unfit_end(start: Approach, simulation: Simulation, ending: Ending) -> str:
    """Why a time at which a collision ends is too early or too late; "" if it is neither, or no time."""
    latest, usual = latest_end(start), expected_end(start)
    if ending.end in ENDS or start.flight <= ending.end <= latest:
        return ""
    end, contact, decided, last = (format_quantity(t, "s") for t in (ending.end, start.flight, usual, latest))
    if ending.end < start.flight:
        return f"end = {end} is before the earliest possible contact, at {contact}: the outcome will be undecided"
    cost, enough = (simulation.expected_cost(time) for time in (ending.end, usual))
    takes, less = (
        f"about {each.steps:.2g} steps and {format_wall_time(float(f'{each.seconds:.2g}'))}" for each in (cost, enough)
    )
    return (
        f"end = {end} takes {takes}; outcomes are usually decided at {decided}, after {less}, and end = 'outcome' ends "
        f"the collision then, at {last} at the latest"
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


def run_to_end(start: Approach, simulation: Simulation, ending: Ending = Ending()) -> Collision:
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
        record.draws = False  # the figure is drawn once at the end, not after each part
    end = _run(simulation, start, ending)
    found = classify_collision(simulation, start, before, end)
    simulation.title = collision_title([asdict(found)], start.bodies())
    if record is not None:
        record.draw(simulation)
    return found


def expected_end(start: Approach, ending: Ending = Ending()) -> float:
    """Time [s] at which a collision with contacts usually ends; see `latest_end`."""
    return start.flight + USUAL * start.unit_of_time if ending.end in ENDS else ending.end


def latest_end(start: Approach, ending: Ending = Ending()) -> float:
    """Time [s] at which a collision ends at the latest."""
    return start.flight + LONGEST * start.unit_of_time if ending.end in ENDS else ending.end


def _run(simulation: Simulation, start: Approach, ending: Ending) -> str:
    """Run a collision to its end; returns why it ended, "" if it was stopped before the outcome was decided.

    The end depends on regular states alone, at regular steps, and so neither on output nor on interruptions. The
    interval of frames is that of `Ending.frames` up to the expected end, and doubles whenever the time has doubled.
    """
    looks = OwnCondition(lambda now: bool(why_ended(now, start, ending)), LOOK_EVERY)
    condition = looks if ending.end in ENDS else None
    part, last = expected_end(start, ending), latest_end(start, ending)
    every = part / ending.frames
    while simulation.met_condition != GIVEN and simulation.time < last:
        until = min(part, last)
        if simulation.time < until:
            simulation.frame_every = every
            result = simulation.run(until=until, stop=condition)
            if result.outcome.is_physics:
                raise BadInput(f"the collision cannot be computed: {result}")
        part, every = 2.0 * part, 2.0 * every
    return why_ended(simulation, start, ending)


def why_ended(simulation: Simulation, start: Approach, ending: Ending = Ending()) -> str:
    """Why a collision has ended; "" if it goes on."""
    state, time = simulation.regular_state, simulation.time
    if time < start.flight:  # the earliest contact
        return ""
    made, changed = state.count[MADE], state.count[[MADE, BROKEN, SLIPPED]].any()
    across = float(np.ptp(start.grains.position, axis=0).max())
    last = float(max(state.clock[CHANGED], state.clock[SLID])) if made else start.flight + across / start.speed
    is_at_rest, is_bounded = time - last >= QUIET * start.unit_of_time, has_bound(simulation)
    if made and (ending.end == "rest" or not is_bounded):
        return "contacts no longer change" if is_at_rest else ""
    if not is_bounded:
        parted = is_at_rest and start.has_parted(simulation.grains)
        return "the bodies recede, and are farther apart than at the start" if parted else ""
    labels = cluster_labels(len(start.grains), simulation.contacts["pair"])
    apart = cannot_touch(simulation, labels)
    if not (apart and changed):
        return apart
    holds = is_at_rest if forces_at_distance(simulation) else are_settled(simulation, labels)
    text = "the fragments are apart and hold together" if labels.any() else "one body is left and holds together"
    return text if holds else ""


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
