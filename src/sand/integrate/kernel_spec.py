"""What the compiled driver is made of and what it is told: all that does not change during a run."""

from collections.abc import Callable
from enum import IntEnum
from typing import Any, NamedTuple

from ..forces.external.formulas import nothing
from ..forces.pair.loops import NO_FAR_FORCE, FarSums


class Stop(IntEnum):
    """Why the driver came back."""

    STEPS_DONE = 0
    TIME_REACHED = 1
    CONTACTS_FULL = 2
    PAIRS_FULL = 3
    NOT_FINITE = 4
    NO_STEP = 5
    FLEW_TOO_FAR = 6
    CRUSHED = 7
    SPUN_TOO_FAR = 8
    LIST_FULL = 9


class Plan(NamedTuple):
    """What a driver is compiled from; each combination is compiled once."""

    outside: Callable = nothing  # per-grain forces, composed
    far: FarSums = NO_FAR_FORCE  # long-range forces, composed
    split: bool = False  # pairs in contact feel their far force in every step
    impulse: bool = False  # far loads as impulses at both ends of a cycle, but for a held part
    foretell: bool = False  # far loads by Taylor series inside a cycle
    gas: bool = False  # drag and Brownian kicks
    adaptive: bool = False  # Runge–Kutta steps while nothing touches
    crew: bool = False  # large loops in blocks, for threads to share
    keep: bool = True  # the compiled code on disk, if all of it is ours
    magnetic: bool = True  # some grain has a moment
    wide: bool = False  # so many grains that loops are made of the longest vectors

    @property
    def bare(self) -> bool:
        """True where contacts are the only forces."""
        return self.outside is nothing and self.far is NO_FAR_FORCE


class ContactRules(NamedTuple):
    """The contact law's run-time numbers."""

    on: bool  # False: grains pass through each other
    pairings: Any  # (10, M, M) table: what two materials make together
    release: bool  # displacement beyond its limit: False clamp, True release
    follow: bool  # stiffnesses: False frozen at a₀, True following the contact radius
    damped: bool  # is there any damping
    per_period: float  # steps per fastest period
    alike: bool = False  # as in World: one set of constants for all contacts


class Beat(NamedTuple):
    """How often far loads are summed while grains are in contact."""

    most: int  # k_max, steps from one summation to the next; 1: every step
    literal: bool  # Taylor series with each grain's own v and ω, ringing or not


class Books(NamedTuple):
    """Energies that the outside forces leave to the driver."""

    timed: bool  # their energy depends on time
    moored: bool  # their energy depends on position, which periodic boundaries make jump


class Stirring(NamedTuple):
    """When and how the gas acts."""

    period: float  # shortest time between two kicks [s]
    seed: int
    gas: Any  # forces.gas.loops.GasRules


class Rules(NamedTuple):
    """All numbers that do not change during a run."""

    span: Any
    contact: ContactRules
    far: Any
    outside: Any
    search: Any
    beat: Beat
    books: Books
    gas: Any
    control: Any
    precision: Any = ()  # adaptive.Precision, where there are Runge–Kutta steps
    crew: Any = ()  # crew.Crew, where the plan has one
