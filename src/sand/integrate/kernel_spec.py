"""What the compiled driver is made of and what it is told: all that does not change during a run."""

from collections.abc import Callable
from enum import IntEnum
from typing import Any, NamedTuple

from ..forces.external.formulas import nothing
from ..forces.pair.loops import NO_LONG_RANGE_FORCE, LongRangeSums


class Stop(IntEnum):
    """Why the driver came back."""

    STEPS_DONE = 0
    TIME_REACHED = 1
    CONTACTS_FULL = 2
    PAIRS_FULL = 3
    NOT_FINITE = 4
    NO_STEP = 5
    TOO_FAST = 6
    OVERCOMPRESSED = 7
    SPINS_TOO_FAST = 8
    LIST_FULL = 9


class KernelSpec(NamedTuple):
    """What a driver is compiled from; each combination is compiled once."""

    external: Callable = nothing  # per-grain forces, composed
    long_range: LongRangeSums = NO_LONG_RANGE_FORCE  # long-range forces, composed
    split: bool = False  # pairs in contact feel their far force in every step
    impulse: bool = False  # far loads as impulses at both ends of a cycle, but for a held part
    taylor: bool = False  # far loads by Taylor series inside a cycle
    gas: bool = False  # drag and Brownian kicks
    adaptive: bool = False  # Runge–Kutta steps while nothing touches
    queue: bool = False  # large loops in blocks, for threads to share
    keep: bool = True  # the compiled code on disk, if all of it is ours
    magnetic: bool = True  # some grain has a moment
    wide: bool = False  # so many grains that loops are made of the longest vectors

    @property
    def contacts_only(self) -> bool:
        """True where contacts are the only forces."""
        return self.external is nothing and self.long_range is NO_LONG_RANGE_FORCE


class ContactParameters(NamedTuple):
    """The contact law's run-time numbers."""

    on: bool  # False: grains pass through each other
    pairings: Any  # (10, M, M) table: what two materials make together
    release: bool  # displacement beyond its limit: False clamp, True release
    follow: bool  # stiffnesses: False frozen at a₀, True following the contact radius
    damped: bool  # is there any damping
    per_period: float  # steps per fastest period
    uniform_contacts: bool = False  # as in World: one set of constants for all contacts


class RespaSettings(NamedTuple):
    """How often far loads are summed while grains are in contact."""

    most: int  # k_max, steps from one summation to the next; 1: every step
    literal: bool  # Taylor series with each grain's own v and ω, ringing or not


class ExternalWork(NamedTuple):
    """Energies that the outside forces leave to the driver."""

    time_dependent: bool  # their energy depends on time
    position_dependent: bool  # their energy depends on position, which periodic boundaries make jump


class GasSettings(NamedTuple):
    """When and how the gas acts."""

    period: float  # shortest time between two kicks [s]
    seed: int
    gas: Any  # forces.gas.loops.GasParameters


class StepParameters(NamedTuple):
    """All numbers that do not change during a run."""

    span: Any
    contact: ContactParameters
    long_range: Any
    external: Any
    search: Any
    respa: RespaSettings
    external_work: ExternalWork
    gas: Any
    criteria: Any
    error_limits: Any = ()  # adaptive.ErrorLimits, where there are Runge–Kutta steps
    queue: Any = ()  # crew.Crew, where the plan has one
