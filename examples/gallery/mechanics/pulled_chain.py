r"""
A chain is pulled apart
=======================

The first grain of a chain is held, the last one is pulled. The force rises to the pull-off force of two grains; there
the contacts are no longer stable, and one of them parts.

The pull-off force is :math:`3\pi\gamma R` with the surface energy :math:`\gamma` and the reduced radius :math:`R`.
"""

import matplotlib.pyplot as plt

import sand

theory = sand.theory.contact("silica", "0.1 um")
chain = sand.setup.chain(5, radius="0.1 um", material="silica")
driven = [sand.Driven([0]), sand.Driven([4], velocity=["1 cm/s", 0, 0])]
sim = sand.Simulation(chain, [sand.Contact(damping="critical")], driven=driven)
times, forces = [], []
while sim.time < 1e-6 and not (sim.ledger.rows and sim.ledger["broken"][-1]):
    sim.run(sim.time + 2e-9)
    times.append(1e9 * sim.time)
    forces.append(-1e9 * sim.loads()["force"][4, 0])
plt.plot(times, forces)
plt.axhline(1e9 * theory.pull_off_force, linestyle="--", color="grey", label="pull-off force")
plt.xlabel("time [ns]")
plt.ylabel("force on the driven grain [nN]")
plt.legend()
print(f"largest force {max(forces):.3f} nN, pull-off force {1e9 * theory.pull_off_force:.3f} nN")

# %%
# What to change
# --------------
#
# * `velocity`: pulled faster, the chain vibrates, and the largest force at its end is no longer the pull-off force.
# * Velocity along y: the chain bends, and contacts roll.
# * Walls instead of driven grains: `examples/chain_between_walls.py`.
