"""Components: features of a simulation that are no formula, such as walls.  They are listed in `sand.components`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from ..basics.box import Box, MovingSpan, Span, TiltedSpan
from ..basics.grains import Grains
from ..basics.material import Material
from ..basics.state import State
from ..contact.law import ContactLaw
from ..forces.base import Force
from ..integrate.hooks import HookStages
from ..integrate.integrator import Integrator
from ..integrate.parts import ContactParameters
from ..neighbours.search import Neighbours
from .engine import Engine
from .step_parameters import ForcesByType

NO_PAIRS = np.zeros((0, 2), np.int64)


class Setup(NamedTuple):
    """What the components of a simulation have to fit to."""

    grains: Grains
    forces: ForcesByType
    box: Box
    stepping: Integrator
    neighbours: Neighbours
    fresh: bool  # whether this is a new start; a resumed run may be in the middle of an impact
    saved: Mapping[str, np.ndarray] = MappingProxyType({})  # arrays of the checkpoint from which a run continues
    components: Sequence[Any] = ()  # all components
    touching: np.ndarray = NO_PAIRS  # (C, 2) pairs in contact at a new start


class Component:
    """A feature of a simulation that is no formula; what a class does not define is nothing.

    At the assembly of an engine (`assemble.build_engine`) its methods are called in this order: `problems`, `prepare`,
    `at_start`, `stages` and `heavy`, `add_arrays`, `begin`.  While the engine runs it calls `update`, `next_time` and
    `contacts_changed`, between regular steps.  The ledger has `columns` and `losses` of the components that the user
    gave, and asks `row` for the values of both (energies stored in its contacts are added to those of all contacts by a
    stage of `Hook.ENERGIES`).  A change asks `problems_of_motion` and `problems_of_arrays`, continues with what is
    `kept`, and calls `saved_for_change` and `changed`; case.toml has `parameters` and `materials`.  The stress asks for
    `virials` and `volume`.

    Attributes
    ----------
    name : str
        Its keyword of `sand.Simulation`, and its table in case files.
    noun : str
        What it adds, in sentences: "walls cannot be used together with …".
    keeps_order : bool
        Whether grains keep the order in which they were given.
    every_step : bool
        Whether long-range forces are summed in each step, instead of once in a cycle of r-RESPA.
    holds : bool
        Whether it may hold grains, so that loads on their clusters do not move these as rigid bodies.
    own_columns : bool
        Whether each contact needs its own constants, also between equal grains.
    watches_contacts : bool
        Whether `contacts_changed` is called; the driver then returns after each step in which a contact formed or
        broke.
    moves_box : bool
        Whether it deforms the box, whose `span` is then that of the component, in `State.cell`.
    in_parts : bool
        Whether it also acts on grains of awake clusters within a step of rigid bodies.
    last_action : int or None
        Entry of the clock with the time of its last action, which is the present one when a change adds it.
    own_stages : HookStages
        Its stages, if they are the same in all simulations.
    groups : Mapping[str, type]
        Groups of its arrays (`basics.array_groups`) by name: parts of a simulation that stages take by this name,
        `State.of_components`, and its arrays in a checkpoint.
    items : Sequence
        What the user gave, such as `sand.Wall` objects.
    """

    name: ClassVar[str]
    noun: ClassVar[str] = ""
    keeps_order: ClassVar[bool] = False
    every_step: ClassVar[bool] = False
    own_columns: ClassVar[bool] = False
    holds: ClassVar[bool] = False
    watches_contacts: ClassVar[bool] = False
    moves_box: bool = False
    in_parts: ClassVar[bool] = False
    last_action: ClassVar[int | None] = None
    own_stages: ClassVar[HookStages] = {}
    groups: ClassVar[Mapping[str, type]] = {}

    def __init__(self, items: Sequence[Any]):
        self.items = tuple(items)

    @classmethod
    def of(cls, forces: Sequence[Force], grains: Grains, box: Box) -> Self:
        """What there is of it for these forces, grains and box."""
        return cls([force for force in forces if cls.follows_from(force)])

    @staticmethod
    def follows_from(force: Force) -> bool:
        """Whether there is such a component because of this force."""
        return False

    def problems(self, setup: Setup) -> list[str]:
        """Why it does not fit to the other parts of a simulation, a sentence each."""
        return []

    def prepare(self, grains: Grains) -> None:
        """Give the grains of a start what it prescribes."""

    def at_start(self, forces: ForcesByType, setup: Setup) -> ForcesByType:
        """The forces as they act at first."""
        return forces

    def span(self, box: Box) -> Span | MovingSpan | TiltedSpan:
        """The box as a tuple for kernels, if the component moves it."""
        return box.span

    def stages(self, setup: Setup, law: ContactLaw, settings: ContactParameters) -> HookStages:
        """Stages that the driver calls at each place of a step, with their parameters: by default, `own_stages`."""
        return self.own_stages

    def heavy(self) -> list[int]:
        """Grains whose mass counts as infinite in contacts."""
        return []

    def add_arrays(self, state: State, law: ContactLaw, settings: ContactParameters) -> None:
        """Give a new state the arrays of `groups`; a class whose shapes name sizes of its own has to do it itself."""
        state.add_groups(self.groups, {})

    def next_time(self, engine: Engine) -> float:
        """Time [s] up to which steps may be taken without an `update`."""
        return math.inf

    def update(self, engine: Engine) -> None:
        """Bring the engine up to date with the time of its regular state."""

    def contacts_changed(self, engine: Engine) -> None:
        """Called after steps in which contacts formed or broke, if it `watches_contacts`."""

    def begin(self, engine: Engine) -> None:
        """Called when an engine is built, before contacts are added, and when a saved or changed state was loaded."""

    def choices(self) -> dict[str, str]:
        """Automatic choices at the start, with their reasons."""
        return {}

    def present_choices(self, state: State) -> dict[str, str]:
        """Automatic choices of the run so far."""
        return {}

    def notes(self, state: State) -> list[str]:
        """What the run so far says about its set-up, a text each."""
        return []

    def kept(self, kept: np.ndarray) -> Component:
        """What is left of it after a change; `kept` (K,) are the earlier indices of grains 0 … K − 1."""
        return self

    def saved_for_change(self, state: State, box: Box) -> dict[str, np.ndarray]:
        """What a change, after which the box is this one, takes from the state before as `Setup.saved`."""
        return {}

    def changed(self, arrays: dict[str, np.ndarray], *, regroups: bool) -> None:
        """Adapt the arrays, as of `State.to_arrays`, with which a change continues.

        `regroups`: there are other grains, or contacts have other numbers.
        """

    def problems_of_motion(self, grains: Grains) -> list[str]:
        """Why it does not allow a change of the motion of grains to that of these."""
        return []

    def problems_of_arrays(self) -> list[str]:
        """Why it does not allow a change after which there are other grains, another box, or other arrays."""
        return []

    def columns(self) -> list[str]:
        """Columns of the ledger besides energies."""
        return []

    def whole(self) -> list[str]:
        """Those of its columns that have whole numbers."""
        return []

    def losses(self) -> list[str]:
        """Columns of the ledger with energies [J] that are part of the total."""
        return []

    def row(self, state: State) -> dict[str, float]:
        """Values of all its columns."""
        return {}

    def means(self, state: State, before: Mapping[str, float] | None, now: Mapping[str, float]) -> dict[str, float]:
        """Those of its columns that are means since the row before, which the first row does not have."""
        return {}

    def virials(self, state: State) -> np.ndarray | None:
        """Virial (N, 3, 3) [J] by its forces on each grain, Σ r_a F_b with r from where they act; None for none."""
        return None

    def volume(self, state: State) -> float | None:
        """Volume [m³] that it bounds; None for none."""
        return None

    def materials(self) -> list[Material]:
        """Materials that a case file has to define."""
        return []

    def parameters(self) -> Any:
        """Its table in a case file, or a list of its tables, SI."""
        return [each.parameters() for each in self.items]


def in_use(components: Mapping[str, Component]) -> list[Component]:
    """The components that a simulation has."""
    return [each for each in components.values() if each.items]
