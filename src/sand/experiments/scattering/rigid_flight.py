"""Flights of two rigid aggregates until they are about to touch or part for good, in few steps.

One step is kick, drift, kick of separation, relative velocity, orientations and angular momenta with the symplectic
free rotor (`numerics.rotor`), so that spin costs no accuracy: bodies that turn a hundred times on their way need one
sum over pairs of grains in about two radians.  At a distance a body is a few dipoles, sums of those of neighbouring
grains, unless these cancel, and a few charges of either sign.  Flights of `flight_driver`, of high order, are more
accurate and ten times as expensive.

With the smallest gap g of two grains, D = g + 2 r_min, e = max(|x| + r) of both bodies, ω̂ = √(2 E_rot/I_min) ≥ |ω|,
and W = Σ 2k|μ||μ′|/d³ + max(|Σμ|, |Σμ′|) B, a step is

    h = min(η/max(√(4F/m̄D), √(max(T, W)/I_min), √(max(T′, W)/I′_min), u/D),  2 rad/(|ω| + |ω′|),  g/2c)
    c = u + ω̂ e + ω̂′ e′ + (F/m̄ + T e/I_min + T′ e′/I′_min) h

No gap closes faster than c in a step: free rotation keeps E_rot, and the kick before it adds at most T h/2√(2 I_min) to
its root.  So no step passes a touch.
"""

import functools
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...compiler.jit import formula, kernel, loop
from ...forces.pair.dipole_formulas import contact_energy, pair_load
from ...forces.pair.inverse_square import inverse_square
from ...numerics.quaternion import turned, turned_back
from ...numerics.rotor import LARGEST_PIECE, free_rotation, free_sphere
from ...numerics.simd import float_bits, float_from_bits
from ...numerics.vec import add, axpy, cross, dot, load, norm, put, scale, sub
from .flight_driver import BOUND, FLIGHT_FAILED, HIT, MISS
from .initial_conditions import R, U, draw_path, set_vector, vector_at
from .two_aggregates import (
    ANGULAR1,
    ANGULAR2,
    TURN1,
    TURN2,
    draw_rigid_pose,
    quaternion_at,
    set_quaternion,
)

STEP_FRACTION = 0.1
"""η, a step in units of the times in which forces, fields and velocities change."""
LARGEST_TURN = 2.0
"""Largest rotation of both bodies in a step [rad]."""
TOUCH = 1e-3
"""Gap of a hit, in units of the smallest radius."""
GROUP_SIZE = 0.25
"""Largest radius of a group times its Σ|μ|/|Σμ|, in units of the gap of the bounding spheres."""
CHARGE_GROUP_SIZE = 0.1
"""Largest radius of a group of charges, in units of the gap of the bounding spheres."""
MOST_TURN = 1000.0
"""Largest rotation of both bodies on an orbit beyond the end of a flight [rad]; more of it only mixes their phases."""
MOST_REVOLUTIONS = 100.0
"""Revolutions of the line of centres after which a pair is bound."""
RESULTS = (
    *("end", "impact_parameter", "time", "steps", "gap", "kinetic", "potential", "energy"),
    *("potential_start", "energy_start", "revolutions"),
)
"""Results of a flight: impact parameter and last gap [m], time [s]; energies [J] at the end: ½m̄u² of the relative
motion, of all pairs and of the external field, and both of these with the rotation; the last two at the start, too;
revolutions of the line of centres."""


class Groups(NamedTuple):
    """Grains of a body in its frame, then its groups, level by level."""

    point: np.ndarray  # (3, m) centres [m]
    moment: np.ndarray  # (3, m) [A m²]
    moment_sum: np.ndarray  # (m,) Σ|μ| [A m²]
    first: np.ndarray  # (levels + 1,) level l has the columns first[l] … first[l + 1] − 1
    reach: np.ndarray  # (levels,) largest radius of a group times its Σ|μ|/|Σμ| [m], ∞ if its moments cancel


class ChargeGroups(NamedTuple):
    """Charges of a body in its frame, then groups of charges of one sign, level by level."""

    point: np.ndarray  # (3, m) centres of charge [m]
    charge: np.ndarray  # (m,) [C]
    first: np.ndarray  # (levels + 1,) as of `Groups`
    reach: np.ndarray  # (levels,) largest radius of a group [m]


class Now(NamedTuple):
    """Work arrays of both bodies, (3, capacity): centres and moments of groups in the current orientations."""

    position1: np.ndarray
    moment1: np.ndarray
    position2: np.ndarray
    moment2: np.ndarray


class FlyingBody(NamedTuple):
    """One rigid aggregate."""

    groups: Groups
    charges: ChargeGroups
    radius: np.ndarray  # (n,) of the grains [m]
    inertia: tuple  # principal moments of inertia [kg m²], ascending
    pose: tuple  # as of `two_aggregates.Body`; without effect on orientations at random
    extent: float  # outer radius about the centre of mass [m]


class FlyingPair(NamedTuple):
    """Parameters of a flight."""

    first: FlyingBody
    second: FlyingBody
    k: float  # μ₀/4π [T m/A]
    coulomb: float  # 1/4πε₀ [N m²/C²]
    reduced: float  # m̄ [kg]
    smallest: float  # smallest radius [m]
    largest: float  # largest radius [m]
    # (C₁, C₂, C₃, R, α): −U ≤ C₁/r + C₂/r² + C₃/r³ of charges at r ≥ R, and α/c³ of moments at the gap c of the
    # bounding spheres [J m, J m², J m³, m, J m³]
    attraction: tuple
    field: tuple  # external flux density [T]
    # distance beyond which a receding body has escaped [m] unless net charges bring it back; 0: that of the start, or
    # less if no attraction can turn it around
    escape: float
    step_fraction: float  # η
    group_size: float  # `GROUP_SIZE`, or 0: all pairs of grains
    charge_group_size: float  # `CHARGE_GROUP_SIZE`, or 0: all pairs of charges
    most_steps: int


class Loads(NamedTuple):
    """Loads of two bodies on each other."""

    force: tuple  # on the first [N]
    torque1: tuple  # about the centres of mass [N m]
    torque2: tuple
    energy: float  # [J]
    field_energy: float  # W, largest energy of moments in the fields [J]
    gap: float  # smallest of two grains [m]; of the bounding spheres where groups act


@loop
def place(q, vectors, begin, end, out):
    """Vectors in the frame of a body, of the groups `begin` … `end` − 1, in the orientation q."""
    for i in range(begin, end):
        put(out, i, turned(q, load(vectors, i)))


@formula
def level_of(groups, clear, group_size):
    """The coarsest level whose groups are small beside the gap of the bounding spheres."""
    chosen = 0
    for level in range(1, groups.reach.size):
        if groups.reach[level] <= group_size * clear:
            chosen = level
    return chosen


@loop
def sum_dipoles(r, q1, q2, pair, now):
    """Loads of all pairs of groups of dipoles, and the gap."""
    one, two, gap = pair.first.groups, pair.second.groups, norm(r) - pair.first.extent - pair.second.extent
    level1, level2 = level_of(one, gap, pair.group_size), level_of(two, gap, pair.group_size)
    begin1, end1, begin2, end2 = one.first[level1], one.first[level1 + 1], two.first[level2], two.first[level2 + 1]
    place(q1, one.point, begin1, end1, now.position1)
    place(q1, one.moment, begin1, end1, now.moment1)
    place(q2, two.point, begin2, end2, now.position2)
    place(q2, two.moment, begin2, end2, now.moment2)
    pull = torque1 = torque2 = (0.0, 0.0, 0.0)
    energy = field_energy = 0.0
    if level1 + level2 == 0:
        gap = math.inf
    for i in range(begin1, end1):
        x1, moment1 = load(now.position1, i), load(now.moment1, i)
        at = add(r, x1)
        force_i = field_i = turning = (0.0, 0.0, 0.0)
        energy_i = field_energy_i = 0.0
        nearest = np.int64(0x7FE0000000000000)
        for j in range(begin2, end2):
            x2, moment2 = load(now.position2, j), load(now.moment2, j)
            apart = sub(at, x2)
            force, field1, field2, own = pair_load(apart, moment1, moment2, pair.k)
            distance = norm(apart)
            force_i, field_i = add(force_i, force), add(field_i, field1)
            turning = add(turning, sub(cross(moment2, field2), cross(x2, force)))
            energy_i += own
            field_energy_i += contact_energy(1.0, two.moment_sum[j], distance, pair.k)
            if level1 + level2 == 0:
                nearest = min(nearest, float_bits(distance + (pair.largest - pair.second.radius[j])))
        pull, torque2 = add(pull, force_i), add(torque2, turning)
        torque1 = add(torque1, add(cross(x1, force_i), cross(moment1, field_i)))
        energy += energy_i
        field_energy += one.moment_sum[i] * field_energy_i
        if level1 + level2 == 0:
            gap = min(gap, float_from_bits(nearest) - pair.largest - pair.first.radius[i])
    return Loads(pull, torque1, torque2, energy, field_energy, gap)


@loop
def with_charges(loads, r, q1, q2, pair, now):
    """Loads with those of all pairs of groups of charges."""
    one, two, clear = pair.first.charges, pair.second.charges, norm(r) - pair.first.extent - pair.second.extent
    level1, level2 = level_of(one, clear, pair.charge_group_size), level_of(two, clear, pair.charge_group_size)
    begin2, end2 = two.first[level2], two.first[level2 + 1]
    place(q2, two.point, begin2, end2, now.position2)
    pull = torque1 = torque2 = (0.0, 0.0, 0.0)
    energy = 0.0
    for i in range(one.first[level1], one.first[level1 + 1]):
        x1 = turned(q1, load(one.point, i))
        at, charge = add(r, x1), pair.coulomb * one.charge[i]
        force_i = (0.0, 0.0, 0.0)
        for j in range(begin2, end2):
            x2 = load(now.position2, j)
            force, own = inverse_square(sub(at, x2), charge * two.charge[j])
            force_i, torque2, energy = add(force_i, force), sub(torque2, cross(x2, force)), energy + own
        pull, torque1 = add(pull, force_i), add(torque1, cross(x1, force_i))
    return Loads(
        add(loads.force, pull),
        add(loads.torque1, torque1),
        add(loads.torque2, torque2),
        loads.energy + energy,
        loads.field_energy,
        loads.gap,
    )


@formula
def net_moment(groups):
    """Sum of all moments in the frame of the body: the last group [A m²]."""
    return load(groups.moment, groups.point.shape[1] - 1)


@formula
def rotational(angular, inertia):
    """Energy of rotation ½ Σ L_k²/I_k [J]."""
    a, b, c = angular
    return 0.5 * (a * a / inertia[0] + b * b / inertia[1] + c * c / inertia[2])


@formula
def spin_size(angular, inertia):
    """|ω| [rad/s]."""
    return norm((angular[0] / inertia[0], angular[1] / inertia[1], angular[2] / inertia[2]))


@loop
def rotate_freely(q, angular, body, h):
    """Free rotation of a body by h [s]."""
    if body.radius.size == 1:
        return free_sphere(q, angular, body.inertia[0], h), angular
    return free_rotation(q, angular, body.inertia, h, LARGEST_PIECE)


@formula
def longest_step(pair, loads, speed, angular1, angular2):
    """Step h [s] of the module's formula."""
    inertia1, inertia2, eta = pair.first.inertia, pair.second.inertia, pair.step_fraction
    pull, turn1, turn2 = norm(loads.force), norm(loads.torque1), norm(loads.torque2)
    width = loads.gap + 2.0 * pair.smallest
    square = max(4.0 * pull / (pair.reduced * width), speed * speed / (width * width))
    square = max(
        square, max(max(turn1, loads.field_energy) / inertia1[0], max(turn2, loads.field_energy) / inertia2[0])
    )
    h = eta / math.sqrt(square)
    spins = spin_size(angular1, inertia1) + spin_size(angular2, inertia2)
    if spins > 0.0:
        h = min(h, LARGEST_TURN / spins)
    most1 = math.sqrt(2.0 * rotational(angular1, inertia1) / inertia1[0]) + turn1 / inertia1[0] * h
    most2 = math.sqrt(2.0 * rotational(angular2, inertia2) / inertia2[0]) + turn2 / inertia2[0] * h
    closing = speed + pull / pair.reduced * h + most1 * pair.first.extent + most2 * pair.second.extent
    return min(h, 0.5 * loads.gap / closing)


@formula
def orbit_back(r, u, attraction):
    """r and u of a receding pair on a bound Kepler orbit when r is as large again, and the time and angle until then.

    With μ = `attraction` [m³/s²] 1/a = 2/r − u²/μ, e cos ψ = 1 − r/a and e sin ψ = r·u/√(μa), the time is
    2 √(a³/μ) (π − ψ + e sin ψ).  The angle is 2 (π − f), e cos f = l²/μr − 1, e sin f = l r·u/μr, with l = |r × u|.
    """
    distance = norm(r)
    outward = scale(1.0 / distance, r)
    radial = dot(u, outward)
    aside = axpy(-radial, outward, u)
    across = norm(aside)
    axis = 1.0 / (2.0 / distance - dot(u, u) / attraction)
    sine = radial * distance / math.sqrt(attraction * axis)
    anomaly = math.atan2(sine, 1.0 - distance / axis)
    time = 2.0 * math.sqrt(axis * axis * axis / attraction) * (math.pi - anomaly + sine)
    orbit = distance * across / attraction
    angle = 2.0 * (math.pi - math.atan2(orbit * radial, orbit * across - 1.0))
    if across == 0.0:
        return r, scale(-1.0, u), time, 0.0
    sideways = scale(1.0 / across, aside)
    outward_then = axpy(math.sin(angle), sideways, scale(math.cos(angle), outward))
    sideways_then = axpy(-math.sin(angle), outward, scale(math.cos(angle), sideways))
    return scale(distance, outward_then), axpy(-radial, outward_then, scale(across, sideways_then)), time, angle


@functools.cache
def flight_of(charged: bool = False) -> Callable:
    """Compile one flight from the state y (20,) of `two_aggregates` to its end; returns `RESULTS` but the second."""

    @loop
    def loads_at(r, q1, q2, pair, now):
        """Loads in a configuration, those of the field included."""
        found = sum_dipoles(r, q1, q2, pair, now)
        if charged:
            found = with_charges(found, r, q1, q2, pair, now)
        moment1, moment2 = turned(q1, net_moment(pair.first.groups)), turned(q2, net_moment(pair.second.groups))
        return Loads(
            found.force,
            add(found.torque1, cross(moment1, pair.field)),
            add(found.torque2, cross(moment2, pair.field)),
            found.energy - dot(add(moment1, moment2), pair.field),
            found.field_energy + max(norm(moment1), norm(moment2)) * norm(pair.field),
            found.gap,
        )

    @formula
    def escapes(radial, distance, pair):
        """Whether no attraction at this distance can turn the relative motion around."""
        c1, c2, c3, nearest, moments = pair.attraction
        clear = distance - pair.first.extent - pair.second.extent
        if clear <= 0.0 or distance < nearest:
            return False
        most = moments / (clear * clear * clear)
        if charged:
            most += ((c3 / distance + c2) / distance + c1) / distance
        return 0.5 * pair.reduced * radial * radial > most

    @loop
    def fly(y, pair, now):
        first, second = pair.first, pair.second
        r, u, q1, q2 = vector_at(y, R), vector_at(y, U), quaternion_at(y, TURN1), quaternion_at(y, TURN2)
        # angular momenta in the frames of the bodies
        angular1, angular2 = turned_back(q1, vector_at(y, ANGULAR1)), turned_back(q2, vector_at(y, ANGULAR2))
        escape = pair.escape if pair.escape > 0.0 else norm(r)
        time, steps, end, swept, potential, start, kinetic, energy = 0.0, 0, BOUND, 0.0, 0.0, 0.0, 0.0, 0.0
        loads = loads_at(r, q1, q2, pair, now)
        while True:
            kinetic = 0.5 * pair.reduced * dot(u, u)
            energy = kinetic + rotational(angular1, first.inertia) + rotational(angular2, second.inertia)
            energy += loads.energy
            if steps == 0:
                potential, start = loads.energy, energy
            distance = norm(r)
            radial = dot(r, u) / distance
            if not abs(energy) < math.inf:
                end = FLIGHT_FAILED
                break
            if loads.gap <= TOUCH * pair.smallest:
                end = HIT
                break
            is_far = distance >= escape
            if pair.escape == 0.0:  # what happens after an escape does not matter
                is_far = is_far or escapes(radial, distance, pair)
            is_back = charged and kinetic * distance < pair.attraction[0]
            if radial > 0.0 and is_far and not is_back:
                end = MISS
                break
            if steps >= pair.most_steps or swept >= 2.0 * math.pi * MOST_REVOLUTIONS:
                break
            if charged and radial > 0.0 and is_far:  # net charges bring it back
                r, u, h, angle = orbit_back(r, u, pair.attraction[0] / pair.reduced)
                spins = spin_size(angular1, first.inertia) + spin_size(angular2, second.inertia)
                turning = min(h, MOST_TURN / spins) if spins > 0.0 else h
                q1, angular1 = rotate_freely(q1, angular1, first, turning)
                q2, angular2 = rotate_freely(q2, angular2, second, turning)
                loads = loads_at(r, q1, q2, pair, now)
                time, steps, swept = time + h, steps + 1, swept + angle
                continue
            h = longest_step(pair, loads, norm(u), angular1, angular2)
            u = axpy(0.5 * h / pair.reduced, loads.force, u)
            angular1 = axpy(0.5 * h, turned_back(q1, loads.torque1), angular1)
            angular2 = axpy(0.5 * h, turned_back(q2, loads.torque2), angular2)
            swept += h * norm(cross(r, u)) / (distance * distance)
            r = axpy(h, u, r)
            q1, angular1 = rotate_freely(q1, angular1, first, h)
            q2, angular2 = rotate_freely(q2, angular2, second, h)
            loads = loads_at(r, q1, q2, pair, now)
            u = axpy(0.5 * h / pair.reduced, loads.force, u)
            angular1 = axpy(0.5 * h, turned_back(q1, loads.torque1), angular1)
            angular2 = axpy(0.5 * h, turned_back(q2, loads.torque2), angular2)
            time, steps = time + h, steps + 1
        set_vector(y, R, r)
        set_vector(y, U, u)
        set_quaternion(y, TURN1, q1)
        set_quaternion(y, TURN2, q2)
        set_vector(y, ANGULAR1, turned(q1, angular1))
        set_vector(y, ANGULAR2, turned(q2, angular2))
        return end, time, steps, loads.gap, kinetic, loads.energy, energy, potential, start, swept / (2.0 * math.pi)

    return fly


@functools.cache
def flights_of(charged: bool = False) -> Callable:
    """Compile flights, as `flight_driver.flights_of`: each is a function of (seed, stratum, number) alone.

    Its arguments are the seed, the `flight_driver.Flights`, the `InitialConditions`, the `FlyingPair` and `Now`.
    Without initial conditions of its own (`start.speed` = 0) a flight begins at the state in `Flights.ends`.
    """
    fly = flight_of(charged)

    def fly_all(seed, flights, start, pair, now):
        for flight in range(flights.numbers.size):
            y, b = flights.ends[flight], 0.0
            if start.speed > 0.0:
                flight_id = (seed, flights.strata[flight], flights.numbers[flight])
                b = draw_path(y, flight_id, flights.low[flight], flights.high[flight], start)
                draw_rigid_pose(y, flight_id, start, pair)
            end, time, steps, gap, kinetic, potential, energy, before, begun, swept = fly(y, pair, now)
            values = (float(end), b, time, float(steps), gap, kinetic, potential, energy, before, begun, swept)
            for column in range(len(values)):
                flights.results[flight, column] = values[column]

    return kernel(fly_all, purpose="flights of two rigid bodies")
