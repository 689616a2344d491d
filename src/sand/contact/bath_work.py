"""Work of the dashpots and their noise in a half kick, where the noise makes it of the order of the step.

The dissipated energy is recorded with the velocity in the middle of a step, ½ dt f·U for each half kick dt/2
(`damping_losses`).  In a half kick at the acceleration A of the relative motion U, the work is f·(U ± ¼ dt A) ½ dt with
the mean velocity, so that at the end of a step, between the two half kicks with the loads f of this moment,

    W = ⅛ dt² (f·A + τ·Ω̇)

of the work is not recorded yet; the half kick of an equal next step takes it back.  For a force without noise it is of
order dt².  Noise has f² ~ 2 k_B T c/dt: W is of order dt, on average ½ ζ ω dt k_B T per mode.  With a bath, rows of the
ledger include W, and where the next step has another length dt′, ⅛ (dt² − dt′²) (f·A + τ·Ω̇) is recorded for good.
The sum of kicks is then exact: K changes by the recorded work of all forces, for any noise.
"""

from ..basics.state import CONTACTS
from ..compiler.jit import formula, loop
from ..numerics.vec import dot, load, nearest_image, scale, sub
from .damping import relative_motion, stored_load, surface_rotation
from .losses import DAMPING_ROW, add_damping_energies


@loop
def record_half_kick(contacts, lost, c, n, change, weight):
    """Record the work `weight` (f·A + τ·Ω̇) of contact c as negative losses of the four modes; `change` is A and Ω̇."""
    found = stored_load(contacts, c)
    normal = dot(found.force, n) * dot(change.velocity, n)
    twist = dot(found.torque, n) * dot(change.spin, n)
    slide, roll = dot(found.force, change.velocity) - normal, dot(found.torque, change.spin) - twist
    energies = -weight * normal, -weight * slide, -weight * roll, -weight * twist
    contacts.lost[DAMPING_ROW, c] += energies[0] + energies[1] + energies[2] + energies[3]
    add_damping_energies(lost, energies)


@loop
def accelerations(grains, i):
    """Acceleration [m/s²] and rate of the spin [1/s²] of grain i; 0 while it is held."""
    return scale(1.0 / grains.mass[i], load(grains.force, i)), scale(1.0 / grains.inertia[i], load(grains.torque, i))


@formula
def half_kick_weight(before, after):
    """⅛ (dt² − dt′²) [s²], for the steps dt before and dt′ after this moment [s]; dt′ = 0 if none follows."""
    return 0.125 * (before * before - after * after)


@loop
def record_half_kicks(grains, contacts, count, lost, span, weight):
    """Record the work of the half kicks in all contacts between grains; `weight` is ⅛ (dt² − dt′²) [s²]."""
    for c in range(count[CONTACTS]):
        i, j = contacts.pair[0, c], contacts.pair[1, c]
        apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
        first, turn1 = accelerations(grains, i)
        second, turn2 = accelerations(grains, j)
        rolling = surface_rotation(turn1, turn2, grains.radius[i] / (grains.radius[i] + grains.radius[j]))
        change = relative_motion(apart, sub(first, second), rolling, turn1, turn2)
        record_half_kick(contacts, lost, c, scale(1.0 / dot(apart, apart) ** 0.5, apart), change, weight)
