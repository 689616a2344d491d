"""Stage of rigid clusters in a box that is deformed: the drift of the box, and the work of its boundaries.

A body of mass M, with momentum P = M U relative to the flow at its centre of mass, moves by

    dX/dt = U + A X,    dP/dt = F − A P,    dL/dt = T

and does not strain: with the vectors s from its centre, its grains have u_i = U + ω×s_i − A s_i.  The forces F_i of
long range then change the energy of motion and these forces by

    d(P²/2M + ½ ω·J ω + U)/dt = −Σ A_a W_aa,    W_aa = P_a²/M + Σ_pairs r_a F_a − Σ_i s_ia F_ia

The kinetic energy ½ Σ m u_i² of its grains is larger than that of the body by D = Σ A_a Σ m s_a (½ A_a s_a − (ω×s)_a);
the work on D is its change.  The part of P is exact, W of forces is that of the trapezoidal rule.  The contact steps of
awake clusters book their own work (`deformation_stage`), with that of the pairs of their part.
"""

from ..basics.state import BODIES
from ..compiler.jit import loop
from ..compiler.stage import stage
from ..integrate.hooks import Hook, HookStages
from ..integrate.parts import DT
from ..integrate.rigid.rigid_body import spin_of
from ..numerics.quaternion import turned
from ..numerics.vec import cross, load, load4, scale, sub
from .deformation_stage import (
    RATE,
    DeformationNumbers,
    add_work,
    advance_box,
    limit_strain,
    set_rates,
    sum_far_virial,
)

BEFORE, AFTER = Hook.BEFORE_BODIES.value, Hook.AFTER_BODIES.value


@loop
def sums_of_bodies(grains, bodies, cell, count):
    """Of bodies at rest, along each axis: Σ P_a²/M, Σ s_a F_a, D_a of the present rates, and D_a of the grains [J]."""
    kinetic = inner = strained = own = (0.0, 0.0, 0.0)
    rate = cell.span[RATE], cell.span[RATE + 1], cell.span[RATE + 2]
    for b in range(count[BODIES]):
        first = bodies.member[bodies.start[b]]
        if bodies.asleep[first] == 0:
            continue
        p, inverse = load(bodies.momentum, first), 1.0 / bodies.mass[first]
        kinetic = kinetic[0] + inverse * p[0] ** 2, kinetic[1] + inverse * p[1] ** 2, kinetic[2] + inverse * p[2] ** 2
        q, spin = load4(bodies.orientation, first), spin_of(bodies, first)
        for k in range(bodies.start[b], bodies.start[b + 1]):
            i = bodies.member[k]
            s, f, m = turned(q, load(bodies.offset, i)), load(grains.force, i), grains.mass[i]
            v, u = cross(spin, s), load(grains.velocity, i)
            inner = inner[0] + s[0] * f[0], inner[1] + s[1] * f[1], inner[2] + s[2] * f[2]
            strained = (
                strained[0] + rate[0] * m * s[0] * (0.5 * rate[0] * s[0] - v[0]),
                strained[1] + rate[1] * m * s[1] * (0.5 * rate[1] * s[1] - v[1]),
                strained[2] + rate[2] * m * s[2] * (0.5 * rate[2] * s[2] - v[2]),
            )
            own = (
                own[0] + 0.5 * m * (u[0] ** 2 - v[0] ** 2),
                own[1] + 0.5 * m * (u[1] ** 2 - v[1] ** 2),
                own[2] + 0.5 * m * (u[2] ** 2 - v[2] ** 2),
            )
    return kinetic, inner, strained, sub(own, scale(0.5, kinetic))


@stage("the work of the box on rigid bodies")
def deform_with_bodies(grains, long_range, bodies, cell, count, scratch, parameters, block):
    """Begin a step of bodies, deform the box after their drift, or add the work and set the rates of the next step."""
    far, dt = cell.far_virial, scratch[DT]
    if block == AFTER:
        kinetic, _, _, _ = sums_of_bodies(grains, bodies, cell, count)
        for a in range(3):
            advance_box(cell, a, dt, kinetic[a])
        return 0
    if block == BEFORE:
        _, inner, _, own = sums_of_bodies(grains, bodies, cell, count)
        for k in range(cell.span.size):
            cell.begun[k] = cell.span[k]
        for a in range(3):
            cell.virial[a], cell.inner[a] = far[a] - inner[a], own[a]
        return 0
    if parameters.long_range:
        sum_far_virial(long_range, cell)
    _, inner, _, _ = sums_of_bodies(grains, bodies, cell, count)
    add_work(cell, (far[0] - inner[0], far[1] - inner[1], far[2] - inner[2], 0.0))
    set_rates(cell, parameters.law)
    _, _, strained, _ = sums_of_bodies(grains, bodies, cell, count)
    for a in range(3):
        cell.work[a] += strained[a] - cell.inner[a] if dt > 0.0 else 0.0
    return 0


def stages_with_bodies(numbers: DeformationNumbers) -> HookStages:
    """All stages of a deformation in the driver of bodies."""
    hooks = Hook.BEFORE_BODIES, Hook.AFTER_BODIES, Hook.KICKED_BODIES
    return {Hook.LIMIT_STEP: [(limit_strain, numbers)]} | {hook: [(deform_with_bodies, numbers)] for hook in hooks}
