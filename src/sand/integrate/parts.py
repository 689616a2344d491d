"""The parts of a simulation that stages take by name (`PARTS`), and the types of its settings.

A stage (`compiler.stage`) is a function whose arguments are names of parts: arrays of the state such as `grains`,
`contacts` or `clock`, and settings such as `span` or `criteria`.  Drivers and flights take all parts as one argument
`s`: `s.grains`, `s.clock` and so on.
"""

import math
from enum import IntEnum
from typing import Any, NamedTuple

PARTS = (
    # arrays of the state
    *("grains", "contacts", "pair_list", "long_range", "clusters", "bodies", "clock", "count", "lost"),
    # settings, fields of StepParameters
    *("span", "settings", "search", "respa", "external_work", "gas", "criteria", "flight_limits", "forces"),
    # data of one call of the driver
    *("program", "queue", "scratch", "until", "last", "shorten"),
)
"""Names of the parts of a simulation, in the order of the table of addresses; the groups of its components follow."""
DRIVER_PARTS = (
    *("program", "grains", "pair_list", "long_range", "clock", "count", "lost", "scratch", "span", "search"),
    *("external_work", "criteria", "forces", "queue", "until", "last", "shorten"),
)
"""Parts that every driver and flight uses."""

# --- indices of the part `scratch` (float64): numbers that one stage of a step leaves for another ---------------------
DT = 0  # length of the step, or of the kick [s]
LOAD_TIME = 1  # time at which external forces are evaluated [s]
EXTERNAL = 2  # energy, power or work of external forces, summed over grains [J, W]
CYCLE_LENGTH = 3  # length of the cycle for which rates are computed [s]; 0 for a single step
SINCE = 4  # time since the last sum of the long-range forces [s]
LIMIT = 5  # longest step that components allow now [s]
SCRATCH = 6

HEAVY = 2.0**30
"""Factor of masses that count as infinite in contact events, whose impulses are read from the changes of velocity."""


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
    CLUSTERS_CHANGED = 10  # a contact has formed or broken: the cut-off may have to follow
    TABLES_FULL = 11  # a table of a component, such as contacts with walls
    HAS_TO_WAKE = 12  # bodies may touch within the next step, or the loads of their contacts may be near a limit
    AWAKE_STEPS = 13  # awake clusters have to take their contact steps
    AWAKE_LOADS = 14  # a step has ended: awake clusters need the loads of other bodies, and may fall asleep
    SUBSTEPS = 15  # some bodies have to take substeps within the step of all bodies
    BOX_TOO_SMALL = 16  # two grains could touch through two images
    STRAINED_TOO_FAST = 17  # a fixed step strains the box by more than deformation_stage.LARGEST_STRAIN


class ContactParameters(NamedTuple):
    """Run-time parameters of the contact model."""

    on: bool  # False: grains overlap without interaction
    pairings: Any  # (11, M, M) contact.law.Pairing of each pair of materials
    reset: bool  # slip: False clamps the displacement at its limit, True resets it
    follow: bool  # stiffnesses: False for the equilibrium radius a₀, True for the instantaneous contact radius
    damped: bool  # whether contacts have dashpots
    bath: float  # k_B T [J] of their thermal noise; 0: none
    seed: int  # of the noise
    per_period: float  # steps per fastest contact period
    settling_time: float = math.inf  # τ [s] of the motion relative to the rigid motion of a cluster; inf: undamped
    uniform_contacts: bool = False  # one set of constants for all contacts, as in State


class RespaSettings(NamedTuple):
    """Multiple time stepping: how often the long-range forces are summed while grains are in contact, and how."""

    max_steps: int  # k_max, largest number of steps in a cycle; 1: summed in every step
    instantaneous_rates: bool  # Taylor series from the instantaneous v and ω of all grains, not from mean rates
    impulse: bool = False  # r-RESPA: forces, less a constant part, as impulses; between grains in contact in every step
    taylor: bool = False  # extrapolated within a cycle by their first-order Taylor series


class ExternalWork(NamedTuple):
    """Energy changes of the external forces that the driver has to log as work of their sources."""

    time_dependent: bool  # the energy depends explicitly on time
    position_dependent: bool  # the energy depends on position and jumps when a grain crosses a periodic boundary


class GasSettings(NamedTuple):
    """When and how drag and Brownian kicks are applied."""

    period: float  # target interval between two kicks [s]
    seed: int
    gas: Any  # forces.gas_loops.GasParameters


class ForceNumbers(NamedTuple):
    """Numbers of forces in the program of a simulation."""

    pair: int
    external: int


class StepParameters(NamedTuple):
    """All settings of a simulation for its stages; constant during a run."""

    span: Any  # box.Span, side lengths of the box
    settings: ContactParameters
    search: Any  # neighbours.cell_list.Search
    respa: RespaSettings
    external_work: ExternalWork
    gas: GasSettings
    criteria: Any  # step_control.StepCriteria
    flight_limits: Any  # of the integrator, such as rigid_clusters.RigidLimits
    forces: ForceNumbers
