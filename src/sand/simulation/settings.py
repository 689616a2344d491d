"""What of a simulation can be changed once it is built."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, ClassVar

from ..errors import BadInput, NoSuchAttribute, did_you_mean, shown
from ..forces.base import Force
from .observers import Observer
from .stop import duration

ADVICE = {
    "grains": "sand.Simulation(grains, …)",
    "forces": "sand.Simulation(sim.grains, forces=[…])",
    "box": "sand.Simulation(sim.grains, sim.forces, box=…)",
    "stepping": "sand.Simulation(sim.grains, sim.forces, stepping=…)",
    "neighbours": "sand.Simulation(sim.grains, sim.forces, neighbours=…)",
    "seed": "sand.Simulation(sim.grains, sim.forces, seed=…)",
    "contacts": "sand.Simulation(sim.grains, sim.forces, contacts=…)",
    "out": "sand.Simulation(sim.grains, sim.forces, out=…)",
}
"""Arguments of a simulation that hold for all of its life, and how one with others is built."""
RESULTS = ("time", "steps", "state", "start", "temperature", "ledger", "writer", "choices", "is_sound")
"""What follows from the run."""


def time_between_frames(value: Any) -> float | None:
    """[s] > 0, or None to leave it to the first `run`.  Raises BadInput."""
    return None if value is None else duration(value, "frame_every")


def observers_given(value: Any) -> list[Observer]:
    """A list of observers.  Raises BadInput."""
    try:
        given = list(value)
    except TypeError:
        raise BadInput(f"observers = {shown(value)}; give a list of sand.Observer objects") from None
    problems = []
    for one in given:
        if isinstance(one, type):
            problems.append(f"observers: {shown(one)} is a class; write {shown(one)}()")
        elif not all(callable(getattr(one, name, None)) for name in ("see", "tick", "close")):
            problems.append(f"observers: {shown(one)} is not a sand.Observer: it lacks see, tick or close")
    if problems:
        raise BadInput(problems)
    return given


class FixedList(tuple):
    """A list that cannot be changed; says so when one tries."""

    def __getattr__(self, name: str) -> Any:
        """Methods that would change it are refused."""
        if hasattr(list, name):
            raise NoSuchAttribute(f"the forces of a simulation cannot change; build a new one: {ADVICE['forces']}")
        raise AttributeError(f"'{type(self).__name__}' object has no attribute '{name}'")

    def __setitem__(self, *_: Any) -> None:
        raise NoSuchAttribute(f"the forces of a simulation cannot change; build a new one: {ADVICE['forces']}")


def forces_given(value: Any) -> FixedList:
    """Forces from a list, a single one or None.  Raises BadInput."""
    if isinstance(value, type):
        raise BadInput(f"forces: {shown(value)} is a class; write {shown(value)}() to make a force")
    if isinstance(value, Force):
        return FixedList([value])
    if isinstance(value, (str, bytes, dict)) or not isinstance(value, Iterable | None):
        raise BadInput(f"forces = {shown(value)}; give a list such as [sand.Contact()]")
    forces = FixedList(() if value is None else value)
    problems = []
    for force in forces:
        if isinstance(force, type):
            problems.append(f"forces: {shown(force)} is a class; write {shown(force)}() to make a force")
        elif not isinstance(force, Force) or not isinstance(force.name, str):
            problems.append(f"forces: {shown(force)} is not a force; give sand.Contact(), sand.Dipoles(), …")
    names = [force.name for force in forces if not isinstance(force, type) and isinstance(force, Force)]
    doubles = sorted({name for name in names if names.count(name) > 1})
    problems += [f"forces: '{name}' is given more than once; keep one" for name in doubles]
    if problems:
        raise BadInput(problems)
    return forces


class ReadOnlySettings:
    """Base of `Simulation`: refuses assignments that the running code would not see, and misspelt names.

    `frame_every` and `observers` may be assigned at any time; classes derived from `Simulation` may add attributes.
    """

    _built = False

    READERS: ClassVar[dict[str, Callable[[Any], Any]]] = {
        "frame_every": time_between_frames,
        "observers": observers_given,
    }
    KEPT = ("recipe", "origin", "planned", "wall_seconds")
    """What the package itself assigns later."""

    def __setattr__(self, name: str, value: Any) -> None:
        """Assign what may change.  Raises BadInput."""
        if name in ReadOnlySettings.READERS:
            value = ReadOnlySettings.READERS[name](value)
        elif self._built and not name.startswith("_") and name not in ReadOnlySettings.KEPT:
            if name in ADVICE:
                what = f"{name} of a simulation cannot change once it is built"
                raise NoSuchAttribute(f"{what}; build a new one: {ADVICE[name]}")
            if name in RESULTS:
                raise NoSuchAttribute(f"{name} of a simulation follows from its run and cannot be assigned")
            if type(self).__module__.startswith("sand."):
                advice = did_you_mean(name, (*ReadOnlySettings.READERS, *ADVICE))
                raise NoSuchAttribute(f"a simulation has no '{name}'; {advice}")
        object.__setattr__(self, name, value)

    def __getattr__(self, name: str) -> Any:
        """Only asked for what is not there."""
        if name.startswith("_") or hasattr(type(self), name):
            return object.__getattribute__(self, name)  # raises what it raised before
        public = [
            own for own in {**vars(self), **vars(ReadOnlySettings), **vars(type(self))} if not own.startswith("_")
        ]
        raise NoSuchAttribute(f"a simulation has no '{name}'; {did_you_mean(name, sorted(public))}")
