"""
Grains lose their adhesion
==========================

A ramp lowers the surface energy of a shaken aggregate to a hundredth: contacts break, and the aggregate falls apart.
"""

import matplotlib.pyplot as plt

import sand

body = sand.setup.bpca(30, radius="0.1 um", material="silica", seed=1)
contact = sand.Contact(surface_energy_factor=sand.Ramp(["1", "0.01"], ["10 ns", "60 ns"]))
sim = sand.Simulation(body, [contact], frame_every="1 ns", out="lost-adhesion")
with sim.change() as change:
    change.velocity += 0.03 * body.position / 1e-7  # each layer of grains moves faster than the one inside it
sim.run(until="100 ns")

plt.plot(1e9 * sim.ledger["time"], sim.ledger["clusters"], label="clusters")
plt.plot(1e9 * sim.ledger["time"], sim.ledger["contacts"], label="contacts")
plt.xlabel("time [ns]")
plt.legend()

# %%

picture = sand.open("lost-adhesion").picture(size=(1200, 640))
picture.savefig("lost-adhesion/end.png")

# %%
# What to change
# --------------
#
# * The end of the ramp: at which surface energy does the aggregate survive?
# * Other parameters that may be ramps: fields, the temperature of a gas, damping, stiffness.
