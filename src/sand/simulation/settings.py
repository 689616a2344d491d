"""Settings of a simulation in groups, checks of its arguments, and protection against assigning them later."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any, ClassVar

from ..basics.arguments import objects_with
from ..basics.errors import BadInput, NoSuchAttribute, did_you_mean, shown
from ..basics.schema import CHANGEABLE, FIELDS
from ..forces.base import Force
from ..forces.registry import FORCES
from .cadence import read_cadence
from .observers import Observer
from .updater import read_updaters

ARGUMENTS = (
    *("grains", "forces", "box", "stepping", "neighbours", "seed", "walls", "contacts", "driven", "deformation"),
    *("stress", "out"),
)
"""Arguments of a simulation that are fixed once it is built."""
RESULT_ATTRIBUTES = (
    *("time", "steps", "state", "start", "temperature", "ledger", "writer", "choices", "is_sound"),
    *("wall_seconds", "wall_times"),
)
"""Attributes of a simulation that follow from the run."""
QUANTITIES = tuple(field.name for field in FIELDS)
"""Quantities of grains."""

CHANGES = {
    "forces": "change.replace(sand.Field('1 mT')) for each force that differs, or change.forces = (…)",
    "box": "change.box = '3 um', or change.scale_box(0.9)",
    "deformation": "change.deformation = sand.Deformation('-1e4 1/s')",
    "grains": "change.velocity[…] = …, change.add(grains), change.remove([0])",
    **{name: f"change.{name}[…] = …" for name in CHANGEABLE},
}
"""What `Simulation.change` can change, and how, by the attribute that one would assign."""


def _refusal(name: str) -> str:
    """Why an attribute of a simulation cannot be assigned, and what to write instead; "" if it may be assigned."""
    if name in CHANGES:
        return f"{name} of a simulation cannot be assigned; write: with sim.change() as change: {CHANGES[name]}"
    if name == "contact":
        other = "sim.start, [sand.Contact(…), …]"
        return f"the contact model of a simulation cannot change; build a new one: sand.Simulation({other})"
    if name in FORCES:
        code = f"change.replace(sand.{FORCES[name].__name__}(…))"
        return f"{name} of a simulation cannot be assigned; write: with sim.change() as change: {code}"
    if name in ARGUMENTS:
        return (
            f"{name} of a simulation cannot change once it is built; build a new one: "
            f"sand.Simulation(sim.grains, sim.forces, {name}=…)"
        )
    if name in RESULT_ATTRIBUTES:
        return f"{name} of a simulation follows from its run and cannot be assigned"
    if name in QUANTITIES:
        return f"{name} of the grains of a simulation cannot be assigned; build a new one from sand.Grains(…, {name}=…)"
    return ""


def read_setting(name: str, *, wall_time: bool = False) -> Callable[[Any], float | str | None]:
    """Converter of a cadence of output to its setting in SI; None stays None."""
    return lambda value: None if value is None else read_cadence(value, name, wall_time=wall_time).setting


def read_observers(value: Any) -> list[Observer]:
    """Check a list of observers.  Raises BadInput."""
    return objects_with(value, "observers", "sand.Observer", ("see", "tick", "close"))


def read_forces(value: Any) -> tuple[Force, ...]:
    """Check forces given as a list, a single force or None.  Raises BadInput."""
    if isinstance(value, (type, Force)):
        value = [value]
    if isinstance(value, (str, bytes, dict)) or not isinstance(value, Iterable | None):
        raise BadInput(f"forces = {shown(value)}; give a list such as [sand.Contact()]")
    try:
        forces = tuple(() if value is None else value)
    except TypeError:  # a scalar array or quantity, which has the method but no entries
        raise BadInput(f"forces = {shown(value)}; give a list such as [sand.Contact()]") from None
    problems = []
    for force in forces:
        if isinstance(force, type):
            problems.append(f"forces: {shown(force)} is a class; write {shown(force)}() to make a force")
        elif not isinstance(force, Force) or not isinstance(force.name, str):
            problems.append(f"forces: {shown(force)} is not a force; give sand.Contact(), sand.Dipoles(), …")
    names = [force.name for force in forces if not isinstance(force, type) and isinstance(force, Force)]
    repeated = sorted({name for name in names if names.count(name) > 1})
    problems += [f"forces: '{name}' is given more than once; keep one" for name in repeated]
    if problems:
        raise BadInput(problems)
    return forces


@dataclass
class Output:
    """Who takes part in a run, and when files are written; everything can be assigned, and is checked then."""

    observers: Any
    frame_every: Any
    updaters: Any
    row_every: Any
    checkpoint_every: Any

    CONVERTERS: ClassVar[dict[str, Callable[[Any], Any]]] = {
        "observers": read_observers,
        "updaters": read_updaters,
        "frame_every": read_setting("frame_every"),
        "row_every": read_setting("row_every"),
        "checkpoint_every": read_setting("checkpoint_every", wall_time=True),
    }

    def __setattr__(self, name: str, value: Any) -> None:
        """Assign a setting.  Raises BadInput if it is invalid."""
        object.__setattr__(self, name, Output.CONVERTERS[name](value))


@dataclass
class Origin:
    """Where a simulation comes from, and where it was to end.

    Attributes
    ----------
    recipe : dict or None
        The [grains] table of the case file that described the grains.
    origin : str
        Description of the file that the grains come from.
    title : str
        What a figure says instead of the numbers of grains.
    planned : tuple
        Planned end of a resumed run: time [s], step and condition.
    temperature : float
        Kinetic temperature at the start [K].
    choices : dict
        Automatic choices of a resumed run, from its checkpoint.
    """

    temperature: float
    recipe: dict[str, Any] | None = None
    origin: str = ""
    title: str = ""
    planned: tuple[float, float, str | None] = (math.inf, math.inf, None)
    choices: dict[str, str] = field(default_factory=dict)


def held_by(group: str, name: str, text: str) -> Any:
    """Make an attribute of a simulation that a group of its settings holds, with its description."""

    def assign(simulation: Any, value: Any) -> None:
        setattr(getattr(simulation, group), name, value)

    return property(attrgetter(f"{group}.{name}"), assign, doc=text)


class ReadOnlySettings:
    """Base of `Simulation`: refuses assignments that would have no effect, and misspelt names.

    The settings of `Output` can be assigned at any time; subclasses of `Simulation` may add attributes.
    """

    _built = False

    INTERNAL = ("recipe", "origin", "planned", "title")
    """Attributes that SAND itself assigns later."""

    def __setattr__(self, name: str, value: Any) -> None:
        """Assign an attribute that may change.  Raises BadInput, which says what to write instead."""
        changeable = (*Output.CONVERTERS, *ReadOnlySettings.INTERNAL)
        if self._built and not name.startswith("_") and name not in changeable:
            # a subclass may use any name that a simulation does not have
            own = type(self).__module__.startswith("sand.")
            if (own or name in ARGUMENTS or name in RESULT_ATTRIBUTES) and (refusal := _refusal(name)):
                raise NoSuchAttribute(refusal)
            if own:
                raise NoSuchAttribute(
                    f"a simulation has no '{name}'; {did_you_mean(name, (*Output.CONVERTERS, *ARGUMENTS))}"
                )
        object.__setattr__(self, name, value)

    def __getattr__(self, name: str) -> Any:
        """Refuse unknown names with a suggestion; Python calls it only for those."""
        if name.startswith("_") or hasattr(type(self), name):
            return object.__getattribute__(self, name)  # raises the original error
        public = {own for own in (*vars(self), *dir(type(self))) if not own.startswith("_")}
        raise NoSuchAttribute(f"a simulation has no '{name}'; {did_you_mean(name, sorted(public))}")
