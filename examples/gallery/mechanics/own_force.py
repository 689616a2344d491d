"""
A force of your own
===================

A formula with a decorator is a force: eight grains swing in a harmonic trap and repel each other. Both forces are
compiled, and their energies are columns of the ledger.
"""

import math

import matplotlib.pyplot as plt

import sand


@sand.external_force(stiffness="N/m")
def trap(grain, p):
    """U = ½ k x², F = −k x."""
    x, y, z = grain.position
    return (-p.stiffness * x, -p.stiffness * y, -p.stiffness * z), 0.5 * p.stiffness * (x * x + y * y + z * z)


@sand.pair_force(strength="J", length="m")
def soft_repulsion(apart, a, b, p):
    """U = ε exp(−r²/2l²), F = U r/l²."""
    x, y, z = apart
    energy = p.strength * math.exp(-0.5 * (x * x + y * y + z * z) / p.length**2)
    force = energy / p.length**2
    return (force * x, force * y, force * z), energy


corners = [(x, y, z) for x in (-2e-6, 2e-6) for y in (-2.2e-6, 2.2e-6) for z in (-2.4e-6, 2.4e-6)]
grains = sand.Grains(corners, "0.5 um", "silica")
own = [trap(stiffness="200 nN/m"), soft_repulsion(strength="100 aJ", length="0.5 um")]
sim = sand.Simulation(grains, [sand.Contact(damping="critical"), *own])
print(sim.run(until="0.5 ms"))

for name in ("translation", "trap", "soft_repulsion", "total"):
    plt.plot(1e3 * sim.ledger["time"], 1e18 * sim.ledger[name], label=name.replace("_", " "))
plt.xlabel("time [ms]")
plt.ylabel("energy [aJ]")
plt.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4)

# %%
# Two grains that touch would have a repulsive energy of 100 aJ :math:`e^{-2}` = 14 aJ, more than all eight have in
# the trap at the start: they cannot touch. With a hundredth of the strength they stick.

# %%
# What to change
# --------------
#
# * The formulas: force and energy must fit together, or the total energy drifts.
# * `strength`, `length`, `stiffness`: new values compile nothing.
# * A force that depends on time: the formula takes `(time, grain, p)`.
