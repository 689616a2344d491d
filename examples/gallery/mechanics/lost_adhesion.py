"""
Grains lose their adhesion
==========================

An aggregate whose grains move outwards, too slowly to part, loses its adhesion: a ramp lowers the surface energy to a
hundredth from 10 to 60 ns, contacts break, and the grains fly apart.
"""

import matplotlib.pyplot as plt

import sand

body = sand.setup.bpca(30, radius="0.1 um", material="silica", seed=1)
contact = sand.Contact(surface_energy_factor=sand.Ramp(["1", "0.01"], ["10 ns", "60 ns"]))
sim = sand.Simulation(body, [contact], frame_every="1 ns", out="lost-adhesion")
with sim.change() as change:
    change.velocity += 0.03 * body.position / 1e-7  # [m/s], outwards, in proportion to the position
sim.run(until="100 ns")

plt.plot(1e9 * sim.ledger["time"], sim.ledger["clusters"], label="clusters")
plt.plot(1e9 * sim.ledger["time"], sim.ledger["contacts"], label="contacts")
plt.xlabel("time [ns]")
plt.ylabel("number")
plt.legend()

# %%

picture = sand.open("lost-adhesion").picture(size=(1200, 640))
picture.savefig("lost-adhesion/end.png")

# %%
# What to change
# --------------
#
# * The end of the ramp: at which surface energy does the aggregate survive? At 0.3 of the first one it is still whole.
# * Other parameters that may be ramps: fields, the temperature of a gas, damping, stiffness.
