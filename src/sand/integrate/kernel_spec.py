"""What a compiled driver is built from (`KernelSpec`), and its run-time parameters (`StepParameters`)."""

from collections.abc import Callable
from enum import IntEnum
from typing import Any, NamedTuple

from ..contact.jkr import LAW as JKR
from ..contact.law import ContactLaw
from ..forces.external.formulas import nothing
from ..forces.pair.loops import NO_LONG_RANGE_FORCE, LongRangeSums


class Stop(IntEnum):
    """Why the driver returned to Python."""

    NONE = 0  # no reason to stop early: continue, or all steps asked for are done
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
    """The code that a driver is composed of; each combination is compiled once."""

    law: ContactLaw = JKR
    external: Callable = nothing  # formula of the external forces, composed
    long_range: LongRangeSums = NO_LONG_RANGE_FORCE  # loops of the long-range forces, composed
    split: bool = False  # long-range forces between grains in contact are evaluated in every step
    impulse: bool = False  # r-RESPA: long-range forces, less a constant part, as impulses at both ends of a cycle
    taylor: bool = False  # long-range forces extrapolated within a cycle by their first-order Taylor series
    gas: bool = False  # drag and Brownian kicks
    flight_loop: Callable | None = None  # steps while there are no contacts (base.Integrator); None: velocity Verlet
    queue: bool = False  # large loops in blocks that worker threads share
    keep: bool = True  # cache the compiled code on disk; False with formulas from outside SAND
    magnetic: bool = True  # some grain has a moment
    wide: bool = False  # enough grains for the longest SIMD vectors

    @property
    def contacts_only(self) -> bool:
        """Whether contact forces are the only forces."""
        return self.external is nothing and self.long_range is NO_LONG_RANGE_FORCE


class ContactParameters(NamedTuple):
    """Run-time parameters of the contact model."""

    on: bool  # False: grains overlap without interaction
    pairings: Any  # (10, M, M) contact.law.Pairing of each pair of materials
    reset: bool  # slip: False clamps the displacement at its limit, True resets it
    follow: bool  # stiffnesses: False for the equilibrium radius a₀, True for the instantaneous contact radius
    damped: bool  # whether normal motion is damped
    per_period: float  # steps per fastest contact period
    uniform_contacts: bool = False  # one set of constants for all contacts, as in State


class RespaSettings(NamedTuple):
    """Multiple time stepping: how often the long-range forces are summed while grains are in contact."""

    max_steps: int  # k_max, largest number of steps in a cycle; 1: summed in every step
    instantaneous_rates: bool  # Taylor series from the instantaneous v and ω of all grains, not from mean rates


class ExternalWork(NamedTuple):
    """Energy changes of the external forces that the driver has to log as work of their sources."""

    time_dependent: bool  # the energy depends explicitly on time
    position_dependent: bool  # the energy depends on position and jumps when a grain crosses a periodic boundary


class GasSettings(NamedTuple):
    """When and how drag and Brownian kicks are applied."""

    period: float  # target interval between two kicks [s]
    seed: int
    gas: Any  # forces.gas.loops.GasParameters


class StepParameters(NamedTuple):
    """All run-time parameters of a driver; constant during a run."""

    span: Any  # box.Span, side lengths of the box
    contact: ContactParameters
    long_range: Any  # nested parameters of the long-range forces
    external: Any  # nested parameters of the external forces
    search: Any  # neighbours.cell_list.Search
    respa: RespaSettings
    external_work: ExternalWork
    gas: GasSettings
    criteria: Any  # step_control.StepCriteria
    flight_limits: Any = ()  # of `KernelSpec.flight_loop`, such as adaptive.ErrorLimits
    queue: Any = ()  # task_queue.TaskQueue, if `KernelSpec.queue`
