"""An integrator of your own: a symplectic scheme of fourth order for grains without contacts.

In a script:          from forest_ruth import ForestRuth
                      sim = sand.Simulation(grains, forces, stepping=ForestRuth(accuracy=1e-6))
In a case file:       [stepping]
                      method = "forest-ruth"
for the command:      sand run CASE.toml --import examples/plugins/forest_ruth.py
The orbit of `main`:  python examples/plugins/forest_ruth.py

The scheme is the position-extended Forest–Ruth-like one of Omelyan, I. P., Mryglod, I. M. & Folk, R. 2002, Comput.
Phys. Commun. 146, 188.  One step of h seconds has five drifts and four kicks, with torques, spins and orientations as
with forces, velocities and positions, and each kick at the time that the drifts before it have reached:

    x += ξhv,  v += (1−2λ)hF/2m,  x += χhv,  v += λhF/m,  x += (1−2(χ+ξ))hv,  v += λhF/m,  x += χhv,
    v += (1−2λ)hF/2m,  x += ξhv

A drift turns a grain by the angle ω dt about its spin.  For spheres this is the exact motion without loads, so the
scheme is symplectic: with equal steps the energy error is bounded.  λ and χ are negative, but all kicks are at times
between the two ends of the step.

A step ends at the first contact of two grains; during contacts SAND takes steps of velocity Verlet.
"""

import math
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np

import sand
from sand.basics.arguments import checked
from sand.basics.settings import Number, Table
from sand.basics.state import FLIGHT, LONG_RANGE_SUMS, NEEDED, REJECTED, STEPS, TIME
from sand.compiler.jit import caller, formula, loop, rare
from sand.compiler.program import call_stage
from sand.compiler.stage import stage
from sand.forces.external_formulas import stiffness_of_field
from sand.integrate.flight import finish_flight_step, refresh_verlet_list, sum_free_loads
from sand.integrate.force_calls import sum_external
from sand.integrate.force_stages import ENERGY, POWER
from sand.integrate.hooks import Hook, call_hook
from sand.integrate.integrator import IntegratorSettings, register
from sand.integrate.motion import kick
from sand.integrate.parts import DRIVER_PARTS, Stop
from sand.integrate.stages import StageNumber
from sand.integrate.step_control import is_close, is_past, quantise_step
from sand.integrate.step_parts import MAX_TURN
from sand.numerics.quaternion import turn, turned
from sand.numerics.vec import add, axpy, dot, load, load4, nearest_image, norm, put, put4, scale, sub

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
STRIDE_FRACTION = 0.9
"""Displacement aimed at by a step, in units of the largest allowed one."""
MAX_ATTEMPTS = 30
"""Largest number of attempts to end a step at a contact; each squares the error of the previous one."""
OVERLAP_TOLERANCE = 1e-12
"""Largest overlap at first contact, in units of r1 + r2; a step that ends with less is accepted."""
ROUNDING = 1e-15
"""The same in units of the largest coordinate, where rounding errors dominate."""
SAMPLES = 16
"""Intervals of a step, each assumed to contain at most one minimum of the distance of a pair."""
BISECTIONS = 60
"""Bisections of an interval; they locate a root to rounding."""
NEVER = 2.0
"""Contact time returned if there is no contact within the step."""


class Start(NamedTuple):
    """The grains at the start of a step: arrays of N columns."""

    position: np.ndarray
    velocity: np.ndarray
    orientation: np.ndarray
    spin: np.ndarray
    moment: np.ndarray


class FlightLimits(NamedTuple):
    """Limits of a step without contacts, and memory for it: the part `flight_limits` of the stage."""

    fixed: float  # step of the user [s]; 0: automatic
    part: float  # largest step in units of the shortest time scale of the motion
    stride: float  # largest displacement of a grain in one step [m]
    start: Start


# --- the length of a step -----------------------------------------------------------------------------------------
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


# --- the motion in a step -----------------------------------------------------------------------------------------
@loop
def store_start(grains, start):
    """Store the grains at the start of a step."""
    for i in range(grains.mass.size):
        put(start.position, i, load(grains.position, i))
        put(start.velocity, i, load(grains.velocity, i))
        put4(start.orientation, i, load4(grains.orientation, i))
        put(start.spin, i, load(grains.spin, i))
        put(start.moment, i, load(grains.moment, i))


@rare
def return_to_start(grains, start):
    """Set the grains to the start of the step."""
    for i in range(grains.mass.size):
        put(grains.position, i, load(start.position, i))
        put(grains.velocity, i, load(start.velocity, i))
        put4(grains.orientation, i, load4(start.orientation, i))
        put(grains.spin, i, load(start.spin, i))
        put(grains.moment, i, load(start.moment, i))


@rare
def drift_all(grains, start, dt):
    """x += v dt; orientations and moments turned by ω dt.  Returns the largest squared displacement in a step [m²]."""
    largest = 0.0
    for i in range(grains.mass.size):
        x = axpy(dt, load(grains.velocity, i), load(grains.position, i))
        q = turn(load4(grains.orientation, i), scale(dt, load(grains.spin, i)))
        put(grains.position, i, x)
        put4(grains.orientation, i, q)
        put(grains.moment, i, turned(q, load(grains.body_moment, i)))
        moved = sub(x, load(start.position, i))
        # written so that a displacement that is not a number counts as infinite
        largest = largest if dot(moved, moved) <= largest else dot(moved, moved)
        largest = largest if largest < math.inf else math.inf
    return largest


@caller
def try_free_step(s, begin, dt):
    """Drifts and kicks of one step; returns whether no grain moved farther than the stride, and the work on grains [J].

    The work of time-dependent external forces in a kick of τ seconds is τ (F·v + M·ω), with the mean of v and ω before
    and after it: the exact change of the kinetic energy by these forces.
    """
    work, start, farthest = 0.0, s.flight_limits.start, s.flight_limits.stride**2
    for k in range(KICKS.size):
        if not drift_all(s.grains, start, DRIFTS[k] * dt) <= farthest:
            return False, 0.0
        time = begin + TIMES[k] * dt
        sum_free_loads(s, time)
        power = 0.0
        if s.external_work.time_dependent:
            power += sum_external(s, time, POWER)
        kick(s.grains, KICKS[k] * dt)
        if s.external_work.time_dependent:
            power += sum_external(s, time, POWER)
        work += 0.5 * KICKS[k] * dt * power
    return drift_all(s.grains, start, DRIFTS[KICKS.size] * dt) <= farthest, work


# --- the first contact of two grains in a step --------------------------------------------------------------------
# The separation of a pair is interpolated by the polynomial of degree 3 that matches positions and velocities at both
# ends of the step; its error is of fourth order, like that of the step.  Its four control points P_k make it a Bézier
# curve, which lies within their convex hull: this excludes most pairs without a search.
@formula
def between(a, b, part):
    """Linear interpolation a + part (b − a)."""
    return axpy(part, sub(b, a), a)


@formula
def curve_at(points, part):
    """Point and derivative of the Bézier curve of four control points at 0 ≤ part ≤ 1 (de Casteljau's algorithm)."""
    a, b, c, d = points
    a, b, c = between(a, b, part), between(b, c, part), between(c, d, part)
    a, b = between(a, b, part), between(b, c, part)
    return between(a, b, part), scale(3.0, sub(b, a))


@loop
def separation_curve(grains, start, span, i, j, dt):
    """Control points [m] of the separation x_i − x_j over the step."""
    first = nearest_image(sub(load(start.position, i), load(start.position, j)), span)
    moved_i = sub(load(grains.position, i), load(start.position, i))
    moved_j = sub(load(grains.position, j), load(start.position, j))
    last = add(first, sub(moved_i, moved_j))
    v0 = scale(dt / 3.0, sub(load(start.velocity, i), load(start.velocity, j)))
    v1 = scale(dt / 3.0, sub(load(grains.velocity, i), load(grains.velocity, j)))
    return first, add(first, v0), sub(last, v1), last


@formula
def stays_away(points, limit):
    """Whether the curve stays farther than `limit` from the origin, by a bound from its control points."""
    largest = 0.0
    for k in range(1, 4):
        offset = sub(points[k], points[0])
        largest = max(largest, dot(offset, offset))
    return norm(points[0]) - math.sqrt(largest) > limit


@rare
def first_crossing(points, limit):
    """First parameter 0 … 1 at which the curve comes closer to the origin than `limit` [m], or NEVER."""
    before = 0.0
    _, slope = curve_at(points, 0.0)
    was_approaching = dot(points[0], slope) < 0.0
    for k in range(1, SAMPLES + 1):
        after = k / SAMPLES
        point, slope = curve_at(points, after)
        approaching = dot(point, slope) < 0.0
        high = after
        if was_approaching and not approaching:  # a minimum in between
            low = before
            for _ in range(BISECTIONS):
                middle = 0.5 * (low + high)
                point, slope = curve_at(points, middle)
                if dot(point, slope) < 0.0:
                    low = middle
                else:
                    high = middle
            point, _ = curve_at(points, high)
        if dot(point, point) <= limit * limit:
            low = before
            for _ in range(BISECTIONS):
                middle = 0.5 * (low + high)
                point, _ = curve_at(points, middle)
                if dot(point, point) <= limit * limit:
                    high = middle
                else:
                    low = middle
            return high
        before, was_approaching = after, approaching
    return NEVER


@loop
def contact_time_of_pair(grains, start, span, i, j, dt):
    """Time of first contact of grains i and j in units of the step; 1 for contact at its end, NEVER for none."""
    reach = grains.radius[i] + grains.radius[j]
    points = separation_curve(grains, start, span, i, j, dt)
    if stays_away(points, reach):
        return NEVER
    largest = max(norm(load(grains.position, i)), norm(load(grains.position, j)))
    allowed = OVERLAP_TOLERANCE * reach + ROUNDING * largest
    overlap = reach - norm(points[3])
    if 0.0 <= overlap <= allowed and dot(points[3], sub(points[3], points[2])) < 0.0:
        return 1.0
    return first_crossing(points, reach - 0.5 * allowed)


@loop
def first_contact_time(grains, long_range, start, span, search, dt):
    """Time of the first contact of any pair in units of the step; NEVER if there is none.

    With a Verlet list only listed pairs can touch: pairs that are not listed were farther apart than the reach, at
    least r1 + r2 plus the margin Δr, and a grain moves by at most Δr/4 between the construction of the list and the
    start of a step (`refresh_verlet_list`), and by at most Δr/4, the stride, in the step.
    """
    listed = search.listed
    first = NEVER
    for k in range(grains.mass.size):
        begin, end = (long_range.start[k], long_range.start[k + 1]) if listed else (np.uint32(0), np.uint32(k))
        i = long_range.order[k] if listed else np.uint32(k)
        for m in range(begin, end):
            j = long_range.order[long_range.neighbour[m]] if listed else np.uint32(m)
            if j < i:
                first = min(first, contact_time_of_pair(grains, start, span, i, j, dt))
    return first


# --- the stage that takes one step --------------------------------------------------------------------------------
@caller
def step_to_contact(s):
    """Take one step; returns its length [s], whether it ends at a contact, the work on grains [J], and a Stop.

    A step in which a grain moves too far is repeated with half its length, a step in which two grains touch from its
    start up to the first contact.  Pairs that are not listed cannot touch, because at no kick, and so nowhere in the
    step, a grain is farther than the stride from its start (see `first_contact_time`).
    """
    begin, dt, start = s.clock[TIME], s.clock[FLIGHT], s.flight_limits.start
    store_start(s.grains, start)
    attempts = 0
    while True:
        if attempts == 0 and begin + dt == begin:
            sum_free_loads(s, begin)
            return 0.0, False, 0.0, Stop.NO_STEP
        possible, work = try_free_step(s, begin, dt)
        contact_time = NEVER
        if possible and s.settings.on:
            contact_time = first_contact_time(s.grains, s.long_range, start, s.span, s.search, dt)
        if possible and (contact_time >= 1.0 or attempts == MAX_ATTEMPTS):
            return dt, contact_time <= 1.0, work, Stop.NONE
        return_to_start(s.grains, start)
        if possible:
            dt *= contact_time
            attempts += 1
        else:
            s.count[REJECTED] += 1
            dt *= 0.5
            attempts = 0


@stage("the steps of fourth order", parts=(*DRIVER_PARTS, "settings", "flight_limits"))
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
        sum_free_loads(s, s.clock[TIME])
        s.count[LONG_RANGE_SUMS] = sums
    call_hook(s, Hook.BETWEEN_CYCLES)
    return Stop.NONE.value


# --- the settings -------------------------------------------------------------------------------------------------
@register
@checked
@dataclass(frozen=True)
class ForestRuth(IntegratorSettings):
    """Symplectic scheme of fourth order while there are no contacts, velocity Verlet otherwise.

    Four sums of the forces per step; momentum and angular momentum are conserved to rounding, the energy error is
    bounded as long as steps are equal. A step ends at the first contact of two grains.

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

    accuracy: Annotated[Any, Number(above=0.0, below=1.0)] = 1e-8
    step: Annotated[Any, Number("s", above=0.0, auto=True)] = "auto"
    contact_stepping: Annotated[sand.Verlet, Table(sand.Verlet)] = field(default_factory=sand.Verlet)

    name: ClassVar[str] = "forest-ruth"
    flight: ClassVar[Any] = symplectic_flight

    def resolved(self, grains: sand.Grains, criteria: Any) -> "ForestRuth":
        """These settings: the stage chooses the automatic step."""
        return self

    def flight_limits(self, grains: sand.Grains, longest_displacement: float) -> FlightLimits:
        """Limits for the stage, with the largest displacement in one step [m], and its memory."""
        fixed = 0.0 if self.step == "auto" else self.step
        start = Start(*(np.zeros((rows, len(grains))) for rows in (3, 3, 4, 3, 3)))
        return FlightLimits(fixed, (self.accuracy / ERROR) ** 0.25, longest_displacement, start)


def main() -> None:
    """Two charged grains on an elliptical orbit: the energy error in the first and the last of 40 periods."""
    mass = sand.Grains([[0, 0, 0]], "10 nm", sand.IRON).mass[0]
    distance, charge = 80e-9, 20 * 1.602e-19
    strength = 8.988e9 * charge**2  # of the attraction, q²/4πε₀ [J m]
    speed = 0.85 * math.sqrt(strength / distance / (2 * mass))
    grains = sand.Grains(
        [[-distance / 2, 0, 0], [distance / 2, 0, 0]], "10 nm", sand.IRON, charge=[charge, -charge],
        velocity=[[0, speed, 0], [0, -speed, 0]],
    )  # fmt: skip
    period = 2 * math.pi * math.sqrt((distance / (2 - 0.85**2)) ** 3 * mass / (2 * strength))
    print("                     force sums   energy error in the first quarter   in the last quarter")
    for stepping in (ForestRuth(step=period / 50), sand.Verlet(step=period / 200)):
        sim = sand.Simulation(grains, [sand.Charges()], stepping=stepping, frame_every=period / 7.3)
        sim.run(until=40 * period)
        error = np.abs(sim.ledger["total"] / sim.ledger["total"][0] - 1.0)[1:]
        first, *_, last = (part.max() for part in np.array_split(error, 4))
        print(f"{stepping.name:20s} {sim.state.count[LONG_RANGE_SUMS]:10d} {first:35.1e} {last:21.1e}")


if __name__ == "__main__":
    main()
