"""Stages of a box that is deformed: its drift with the grains, the work of its boundaries, the step that it allows.

With the rates of strain A_a = dL_a/dt / L_a and velocities u relative to the flow A x,

    dx/dt = u + A x,    m du/dt = F − m A u,

which is Newton's law for the velocities u + A x of the laboratory where L is linear in time; m x d²L/dt² / L is left
out otherwise.  L is linear within a step.  The drift F = 1 + A dt of positions and lengths, with u ← F⁻¹ u and
A ← A F⁻¹, is the exact flight between two kicks.  The boundaries do the work

    d(K + U)/dt = −Σ A_a W_aa,    W_aa = Σ_grains m u_a² + Σ_contacts l_a f_a + Σ_pairs r_a F_a

on the grains, with the virial of all images in Ewald sums (`forces.pair.ewald_virial`): the part of K,
½ Σ m u_a² (1 − F_a²) after the drift, is exact.  Simple shear moves images of a box whose
matrix H = ((L_x, 0, T), (0, L_y, 0), (0, 0, L_z)) has a tilt T: then A and F have the element xz, too, and its work is
−∫ A_xz W_zx dt with W_zx = Σ m u_z u_x + Σ l_z f_x.  W of contacts and long-range forces is summed every STEPS_OF_WORK
steps, a sixth of the fastest contact period, and its integral is that of the trapezoidal rule, whose sum over periods
has no error for the first harmonics of an oscillation.
"""

from typing import NamedTuple

import numpy as np

from ..basics.state import CONTACTS, STEPS, TILT
from ..compiler.jit import loop
from ..compiler.stage import stage
from ..contact.virial import contact_virial
from ..integrate.hooks import Hook, HookStages
from ..integrate.parts import DT, LIMIT, Stop
from ..integrate.step_control import quantise_step

INVERSE, RATE, SHEAR = 3, 6, 10
"""First words of 1/L and A in `CellArrays.span`, and A_xz."""
STEPS_OF_WORK = 4
"""Steps between two sums of the virial of contacts, each of which takes as long as a tenth of a step."""
LARGEST_STRAIN = 1e-3
"""Largest strain of an axis in one step; contacts and grains that approach see the flow as velocity."""
LAWS = EXPONENTIAL, LINEAR, PRESSURE = "exponential", "linear", "pressure"
"""What the rates are: constant, those of the length at the start, or the largest ones."""


class DeformationNumbers(NamedTuple):
    """Numbers of a deformation."""

    law: int  # index in LAWS
    time: float  # of the running mean of the pressure [s]
    shortest: float  # least length of an axis [m], so that no two grains touch through two images
    long_range: bool  # whether long-range forces act
    sheared: bool  # whether the box is tilted, or is ever sheared


@stage("the time step of a box that is deformed")
def limit_strain(cell, scratch, criteria, parameters):
    """Lower `scratch[LIMIT]` to a power of two of a second.

    Returns `Stop.STRAINED_TOO_FAST` where a fixed step would have to be lowered, `Stop.BOX_TOO_SMALL` where a side is
    too short, or may become so in a step of this length.
    """
    fastest = abs(cell.span[SHEAR])
    for a in range(3):
        fastest = max(fastest, abs(cell.span[RATE + a]))
    if fastest * scratch[LIMIT] > LARGEST_STRAIN:
        if criteria.fixed > 0.0:
            return Stop.STRAINED_TOO_FAST.value
        scratch[LIMIT] = quantise_step(1.0, LARGEST_STRAIN / fastest, True)
    for a in range(3):
        if cell.span[a] * (1.0 + min(cell.span[RATE + a], 0.0) * scratch[LIMIT]) < parameters.shortest:
            return Stop.BOX_TOO_SMALL.value
    return Stop.NONE.value


@loop
def twice_kinetic_energy(grains, a):
    """Σ m u_a² [J] along one axis."""
    total = 0.0
    for i in range(grains.mass.size):
        total += grains.mass[i] * grains.velocity[a, i] * grains.velocity[a, i]
    return total


@loop
def wrap_tilt(grains, pair_list, long_range, cell, side):
    """Bring a tilt beyond half a side along x [m] within it: the same images, of which some are counted otherwise."""
    turns = np.rint(cell.span[TILT] / side)
    if turns != 0.0:
        cell.span[TILT] -= turns * side
        pair_list.built[3] -= turns * pair_list.built[0]
        long_range.built[3] -= turns * long_range.built[0]
        for i in range(grains.mass.size):
            grains.image[0, i] += np.int32(turns) * grains.image[2, i]


@stage("the shear of the box")
def shear(grains, pair_list, long_range, cell, scratch):
    """Shear the box as the drift has moved its grains; the work on their motion.  Before `deform` has changed rates."""
    dt, rate, strained, flux, upwards = scratch[DT], cell.span[SHEAR], 1.0 + scratch[DT] * cell.span[RATE], 0.0, 0.0
    for i in range(grains.mass.size):
        momentum = grains.mass[i] * grains.velocity[2, i]
        flux += momentum * grains.velocity[0, i]
        upwards += momentum * grains.velocity[2, i]
    cell.work[3] -= dt * rate * (strained * flux + 0.5 * dt * rate * upwards)
    cell.span[TILT] = strained * cell.span[TILT] + dt * rate * cell.span[2]
    cell.span[SHEAR] /= strained * (1.0 + dt * cell.span[RATE + 2])
    cell.strain[3] += 0.5 * dt * (rate + cell.span[SHEAR])
    cell.shear[0] += 0.5 * dt * (rate + cell.span[SHEAR])
    wrap_tilt(grains, pair_list, long_range, cell, strained * cell.span[0])
    return 0


@loop
def advance_box(cell, a, dt, twice_kinetic):
    """Deform the box along an axis for dt [s]; the work on the motion, whose Σ m u_a² [J] then is `twice_kinetic`."""
    rate = cell.span[RATE + a]
    cell.work[a] -= dt * rate * (1.0 + 0.5 * dt * rate) * twice_kinetic
    cell.span[a] *= 1.0 + dt * rate
    cell.span[INVERSE + a] /= 1.0 + dt * rate
    cell.span[RATE + a] /= 1.0 + dt * rate
    cell.strain[a] += 0.5 * dt * (rate + cell.span[RATE + a])


@stage("the deformation of the box")
def deform(grains, cell, scratch):
    """Deform the box as the drift has moved its grains; the work on their motion."""
    for a in range(3):
        advance_box(cell, a, scratch[DT], twice_kinetic_energy(grains, a))
    cell.elapsed[0] += scratch[DT]
    return 0


@loop
def set_rates(cell, law):
    """Set A to that of the next step; one that follows a pressure stays."""
    for a in range(3):
        if law != 2:
            cell.span[RATE + a] = cell.rate[a] * (cell.start[a] / cell.span[a] if law == 1 else 1.0)
    if law != 1:  # otherwise dH/dt is that of the start, as `shear` leaves it
        cell.span[SHEAR] = cell.rate[3]


@loop
def follow_pressure(grains, cell, dt, time):
    """Set A = rate × (P̄ − P)/|P|, within ± rate, for the running mean P̄ of the pressure over a time [s].

    With three equal rates P̄ is the mean of the axes, otherwise that of each axis.  It begins with the first pressure.
    """
    volume, own = cell.span[0] * cell.span[1] * cell.span[2], 0.0
    for a in range(3):
        present = (cell.virial[a] + twice_kinetic_energy(grains, a)) / volume
        cell.pressure[a] += (dt / (dt + time) if cell.measured[0] == 1.0 else 1.0) * (present - cell.pressure[a])
        own += cell.pressure[a] / 3.0
    cell.measured[0] = 1.0
    uniform = cell.rate[0] == cell.rate[1] == cell.rate[2]
    for a in range(3):
        excess = (own if uniform else cell.pressure[a]) / abs(cell.goal[0]) - (1.0 if cell.goal[0] > 0.0 else -1.0)
        cell.span[RATE + a] = cell.rate[a] * min(1.0, max(-1.0, excess))


@loop
def add_work(cell, virial):
    """Add the work during the strain since the last sum, by the mean of its virial and the present one [J]."""
    for a in range(4):
        cell.work[a] -= 0.5 * cell.strain[a] * (cell.virial[a] + virial[a])
        cell.virial[a], cell.strain[a] = virial[a], 0.0


@loop
def sum_far_virial(long_range, cell):
    """Add up the shares in the virial of long-range forces."""
    x = y = z = 0.0
    for i in range(long_range.virial.shape[1]):
        x += long_range.virial[0, i]
        y += long_range.virial[1, i]
        z += long_range.virial[2, i]
    cell.far_virial[0], cell.far_virial[1], cell.far_virial[2] = x, y, z


@stage("the work of the box")
def work_of_box(grains, contacts, long_range, cell, count, scratch, span, parameters):
    """The work since it was last added up, in few steps, and the rates of the next step."""
    due, far = count[STEPS] % STEPS_OF_WORK == 0 or scratch[DT] == 0.0, cell.far_virial
    if parameters.long_range:
        sum_far_virial(long_range, cell)
    if due:
        found = contact_virial(grains, contacts.pair, contacts.force, count[CONTACTS], span)
        add_work(cell, (found[0] + far[0], found[4] + far[1], found[8] + far[2], found[6]))
    set_rates(cell, parameters.law)
    if due:
        if parameters.law == 2:
            follow_pressure(grains, cell, cell.elapsed[0], parameters.time)
        cell.elapsed[0] = 0.0
    return 0


def stages_of_part(long_range: bool) -> HookStages:
    """Stages of awake clusters in a step of rigid bodies, in which the box changes linearly."""
    work = work_of_box, DeformationNumbers(LAWS.index(LINEAR), 0.0, 0.0, long_range, False)
    return {Hook.AFTER_DRIFT: [(deform, ())], Hook.AFTER_KICK: [work], Hook.END_OF_BODIES: [work]}


def deformation_stages(numbers: DeformationNumbers) -> HookStages:
    """All stages of a deformation."""
    return {
        Hook.LIMIT_STEP: [(limit_strain, numbers)],
        Hook.AFTER_DRIFT: [(shear, ())] * numbers.sheared + [(deform, ())],
        Hook.AFTER_KICK: [(work_of_box, numbers)],
    }
