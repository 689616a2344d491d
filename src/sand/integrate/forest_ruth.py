"""Symplectic integrator of fourth order for grains without contacts; velocity Verlet during contacts.

Omelyan, I. P., Mryglod, I. M. & Folk, R. 2002, Comput. Phys. Commun. 146, 188: position-extended Forest–Ruth-like
scheme.  One step of h seconds has five drifts and four kicks, with torques, spins and orientations as with forces,
velocities and positions, and each kick at the time that the drifts before it have reached:

    x += ξhv,  v += (1−2λ)hF/2m,  x += χhv,  v += λhF/m,  x += (1−2(χ+ξ))hv,  v += λhF/m,  x += χhv,
    v += (1−2λ)hF/2m,  x += ξhv

A drift turns a grain by the angle ω dt about its spin.  For spheres this is the exact motion without loads, so the
scheme is symplectic: with equal steps the energy error is bounded.  λ and χ are negative, but all kicks are at times
between the two ends of the step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..basics.arguments import checked
from ..basics.box import nearest_image
from ..basics.grains import Grains
from ..basics.state import (
    FLIGHT,
    LONG_RANGE_SUMS,
    NEEDED,
    REJECTED,
    STEPS,
    TIME,
)
from ..compiler.jit import caller, loop, rare
from ..compiler.program import call_stage, has_stage
from ..compiler.stage import Stage, stage
from ..errors import FORBID_EXTRA
from ..forces.external.formulas import stiffness_of_field
from ..numerics.quaternion import turn, turned
from ..numerics.vec import axpy, dot, load, load4, norm, put, put4, scale, sub
from .adaptive_driver import MAX_ATTEMPTS, STRIDE_FRACTION, refresh_verlet_list
from .event_location import NEVER, first_contact_time
from .flight import FlightSettings, finish_flight_step
from .force_calls import sum_external
from .force_stages import ENERGY, POWER
from .integrator import register
from .motion import kick
from .parts import DRIVER_PARTS, Stop
from .runge_kutta import STAGES, V, X, rows3, set_stage, store_start, sum_loads
from .stages import StageNumber
from .step_control import StepCriteria, is_close, is_past, quantise_step
from .step_parts import MAX_TURN
from .verlet import Verlet

XI, LAMBDA, CHI = 0.1786178958448091, -0.2123418310626054, -0.06626458266981849
DRIFTS = np.array([XI, CHI, 1.0 - 2.0 * (CHI + XI), CHI, XI])
"""Lengths of the drifts, in units of the step."""
KICKS = np.array([0.5 - LAMBDA, LAMBDA, LAMBDA, 0.5 - LAMBDA])
"""Lengths of the kicks, in units of the step."""
TIMES = np.cumsum(DRIFTS)
"""Times at the ends of the drifts, in units of the step; between 0 and 1."""
ERROR = 0.05
"""Relative energy error of a step as long as the time scale of the motion, extrapolated from short steps (h⁴)."""
HOLD = 30.0
"""Time without need of the present step before it is doubled, in shortest time scales: more than the period of a bound
pair, 9 in a circular orbit and 15 with an eccentricity of 0.28."""


class FlightLimits(NamedTuple):
    """Limits of a step without contacts."""

    fixed: float  # step of the user [s]; 0: automatic
    part: float  # largest step in units of the shortest time scale of the motion
    stride: float  # largest displacement of a grain in one step [m]


@loop
def turning_rate_of(grains, criteria, i):
    """Square of the rate [1/s²] at which the loads of grain i change by its rotation: ω² + M/I + μB/I; 0 for none."""
    moment, torque, w = load(grains.moment, i), load(grains.torque, i), load(grains.spin, i)
    size, inertia = norm(moment), grains.inertia[i]
    if size == 0.0 and dot(torque, torque) == 0.0:
        return 0.0
    by_field = stiffness_of_field(moment, load(grains.field, i), inertia) + size * criteria.outer_field / inertia
    return dot(w, w) + norm(torque) / inertia + by_field


@loop
def approach_rate(grains, span, i, j):
    """Square of the rate [1/s²] at which the force between grains i and j changes: (v/d)² + a/d.

    v is their relative velocity, a their relative acceleration and d the distance of their centres.
    """
    apart = norm(nearest_image(sub(load(grains.position, i), load(grains.position, j)), span))
    v = norm(sub(load(grains.velocity, i), load(grains.velocity, j)))
    a = norm(
        sub(scale(1.0 / grains.mass[i], load(grains.force, i)), scale(1.0 / grains.mass[j], load(grains.force, j)))
    )
    return (v / apart) ** 2 + a / apart


@loop
def fastest_approach(grains, long_range, span, search):
    """Largest `approach_rate` [1/s²] over all pairs, or over those of the Verlet list."""
    listed = search.listed
    largest = 0.0
    for k in range(grains.mass.size):
        begin, end = (long_range.start[k], long_range.start[k + 1]) if listed else (np.uint32(0), np.uint32(k))
        i = long_range.order[k] if listed else np.uint32(k)
        for m in range(begin, end):
            j = long_range.order[long_range.neighbour[m]] if listed else np.uint32(m)
            if j < i:
                largest = max(largest, approach_rate(grains, span, i, j))
    return largest


@loop
def longest_free_step(s):
    """Longest step [s] that the motion allows; 0 if the state is not finite.

    Positions, spins and loads change on the time scale τ = 1/√(largest rate of any pair or grain), of which the part
    `flight_limits.part` is allowed.  Such rates follow from loads and velocities alone, whatever the force.
    """
    rate = fastest = fastest_spin = 0.0
    finite = True
    for i in range(s.grains.mass.size):
        v, w = load(s.grains.velocity, i), load(s.grains.spin, i)
        finite = finite and dot(v, v) < math.inf and dot(w, w) < math.inf
        fastest, fastest_spin = max(fastest, dot(v, v)), max(fastest_spin, dot(w, w))
        rate = max(rate, turning_rate_of(s.grains, s.criteria, i))
    if s.forces.pair > 0:
        rate = max(rate, fastest_approach(s.grains, s.long_range, s.span, s.search))
    if not finite or not rate < math.inf:
        return 0.0
    step = s.criteria.longest
    step = min(step, s.flight_limits.part / math.sqrt(rate)) if rate > 0.0 else step
    step = min(step, MAX_TURN / math.sqrt(fastest_spin)) if fastest_spin > 0.0 else step
    return min(step, STRIDE_FRACTION * s.flight_limits.stride / math.sqrt(fastest)) if fastest > 0.0 else step


@loop
def choose_free_step(s):
    """The next step [s], a power of two of a second, or that of the user; 0 if the state is not finite.

    A change of the step changes the energy, so a step that a periodic motion needs once per period is kept.
    """
    wanted, level = longest_free_step(s), s.clock[FLIGHT]
    if not wanted > 0.0 or s.flight_limits.fixed > 0.0:
        return s.flight_limits.fixed if wanted > 0.0 else 0.0
    if wanted < 2.0 * level:
        s.count[NEEDED] = s.count[STEPS]
    held = (s.count[STEPS] - s.count[NEEDED]) * s.flight_limits.part
    return quantise_step(level, wanted, level == 0.0 or held >= HOLD)


@rare
def drift_all(grains, runge_kutta, dt):
    """x += v dt; orientations and moments turned by ω dt.  Returns the largest squared displacement in a step [m²]."""
    largest = 0.0
    for i in range(grains.mass.size):
        x = axpy(dt, load(grains.velocity, i), load(grains.position, i))
        q = turn(load4(grains.orientation, i), scale(dt, load(grains.spin, i)))
        put(grains.position, i, x)
        put4(grains.orientation, i, q)
        put(grains.moment, i, turned(q, load(grains.body_moment, i)))
        moved = sub(x, rows3(runge_kutta.start, X, i))
        # written so that a displacement that is not a number counts as infinite
        largest = largest if dot(moved, moved) <= largest else dot(moved, moved)
        largest = largest if largest < math.inf else math.inf
    return largest


@caller
def try_free_step(s, begin, dt, stride):
    """Drifts and kicks of one step; returns whether no grain moved farther than `stride`, and the work on grains [J].

    The work of time-dependent external forces in a kick of τ seconds is τ (F·v + M·ω), with the mean of v and ω before
    and after it: the exact change of the kinetic energy by these forces.
    """
    work = 0.0
    for k in range(KICKS.size):
        if not drift_all(s.grains, s.runge_kutta, DRIFTS[k] * dt) <= stride * stride:
            return False, 0.0
        time = begin + TIMES[k] * dt
        sum_loads(s, time)
        power = 0.0
        if s.external_work.time_dependent:
            power += sum_external(s, time, POWER)
        kick(s.grains, KICKS[k] * dt)
        if s.external_work.time_dependent:
            power += sum_external(s, time, POWER)
        work += 0.5 * KICKS[k] * dt * power
    return drift_all(s.grains, s.runge_kutta, DRIFTS[KICKS.size] * dt) <= stride * stride, work


@loop
def store_paths(grains, runge_kutta, dt):
    """Store velocities and accelerations at both ends of the step, from which `first_contact_time` interpolates.

    The accelerations are those of the polynomial of degree 3 through the positions and velocities at both ends, whose
    error is of fourth order in the step, like that of the step: the polynomial of degree 5 is then the same.
    """
    first, last = runge_kutta.rate[0], runge_kutta.rate[STAGES - 1]
    for i in range(grains.mass.size):
        for row in range(3):
            v0, v1 = runge_kutta.start[V + row, i], grains.velocity[row, i]
            mean = (grains.position[row, i] - runge_kutta.start[X + row, i]) / dt
            first[X + row, i], last[X + row, i] = v0, v1
            first[V + row, i] = (6.0 * mean - 4.0 * v0 - 2.0 * v1) / dt
            last[V + row, i] = (2.0 * v0 + 4.0 * v1 - 6.0 * mean) / dt


@caller
def step_to_contact(s):
    """Take one step; returns its length [s], whether it ends at a contact, the work on grains [J], and a Stop.

    A step in which a grain moves too far is repeated with half its length, a step in which two grains touch from its
    start up to the first contact.  Pairs that are not listed cannot touch, because at no kick, and so nowhere in the
    step, a grain is farther than the stride from its start (see `first_contact_time`).
    """
    begin, dt, stride = s.clock[TIME], s.clock[FLIGHT], s.flight_limits.stride
    store_start(s.grains, s.runge_kutta)
    attempts = 0
    while True:
        if attempts == 0 and begin + dt == begin:
            sum_loads(s, begin)
            return 0.0, False, 0.0, Stop.NO_STEP
        possible, work = try_free_step(s, begin, dt, stride)
        contact_time = NEVER
        if possible and s.settings.on:
            store_paths(s.grains, s.runge_kutta, dt)
            contact_time = first_contact_time(s.grains, s.long_range, s.runge_kutta, s.span, s.search, dt)
        if possible and (contact_time >= 1.0 or attempts == MAX_ATTEMPTS):
            return dt, contact_time <= 1.0, work, Stop.NONE
        set_stage(s.grains, s.runge_kutta, 0, 0.0)
        if possible:
            dt *= contact_time
            attempts += 1
        else:
            s.count[REJECTED] += 1
            dt *= 0.5
            attempts = 0


@stage(
    "the steps of fourth order",
    parts=(*DRIVER_PARTS, "contacts", "runge_kutta", "settings", "flight_limits"),
)
def symplectic_flight(s):
    """Take one step and log the work of external forces; returns a `Stop`."""
    stop = refresh_verlet_list(s)
    if stop != Stop.NONE.value:
        return stop
    if not s.clock[FLIGHT] > 0.0:
        s.clock[FLIGHT] = choose_free_step(s)
    if not s.clock[FLIGHT] > 0.0:
        return Stop.NOT_FINITE.value
    if is_past(s.clock[TIME] + s.clock[FLIGHT], s.until):
        if not s.shorten:
            return Stop.TIME_REACHED.value
        s.clock[FLIGHT] = s.until - s.clock[TIME]
    before = 0.0
    if s.external_work.time_dependent:
        before = sum_external(s, s.clock[TIME], ENERGY)
    dt, in_contact, work, reason = step_to_contact(s)
    if reason != Stop.NONE:
        call_stage(s, StageNumber.EXPLAIN, reason.value)
        return reason.value
    finish_flight_step(s, dt, in_contact, before, work)
    if in_contact:
        return Stop.NONE.value
    # with the loads of the last kick, so that the steps do not depend on output
    s.clock[FLIGHT] = choose_free_step(s)
    if not s.clock[FLIGHT] > 0.0:
        return Stop.NOT_FINITE.value
    if s.clock[TIME] >= s.until or is_close(s.clock[TIME], s.until) or s.count[STEPS] >= s.last:
        # output needs loads at the present positions; steps do not
        sums = s.count[LONG_RANGE_SUMS]
        sum_loads(s, s.clock[TIME])
        s.count[LONG_RANGE_SUMS] = sums
    if has_stage(s, StageNumber.GAS_KICK):
        call_stage(s, StageNumber.GAS_KICK)
    return Stop.NONE.value


@register
@checked
@dataclass(frozen=True)
class ForestRuth(FlightSettings):
    """Symplectic scheme of fourth order while there are no contacts, velocity Verlet otherwise.

    The position-extended Forest–Ruth-like scheme of Omelyan, Mryglod & Folk (2002): four sums of the forces per step;
    momentum and angular momentum are conserved to rounding, the energy error is bounded as long as steps are equal. A
    step ends at the first contact of two grains.

    Parameters
    ----------
    accuracy : float, optional
        Allowed relative error of the interaction energy in a step, above 0, below 1. The step is (accuracy/C)^(1/4) τ,
        C a constant of the scheme and 1/τ² the largest of (v/d)² + a/d of all pairs, with relative velocity v,
        relative acceleration a and distance d, and of ω² + M/I + μB/I of all grains. Steps are powers of two of a
        second.
    step : float or str, optional
        A fixed step without contacts [s], or "auto". It is divided by powers of two where a grain would move farther
        than neighbour lists allow.
    contact_stepping : Verlet, optional
        Integrator while grains are in contact; in a case file a table of its keys.

    Raises
    ------
    BadInput
        If a parameter is out of range.
    """

    accuracy: Any = 1e-8
    step: Any = "auto"
    contact_stepping: Verlet = field(default_factory=Verlet)

    __pydantic_config__ = FORBID_EXTRA
    name: ClassVar[str] = "forest-ruth"
    UNITS: ClassVar[dict[str, str]] = {"accuracy": "1", "step": "s"}
    flight: ClassVar[Stage | None] = symplectic_flight

    def resolved(self, grains: Grains, criteria: StepCriteria) -> ForestRuth:
        """These settings: the driver chooses the automatic step."""
        return self

    def flight_limits(self, longest_displacement: float) -> FlightLimits:
        """Limits for the driver, with the largest displacement in one step [m]."""
        fixed = 0.0 if self.step == "auto" else self.step
        return FlightLimits(fixed, (self.accuracy / ERROR) ** 0.25, longest_displacement)
