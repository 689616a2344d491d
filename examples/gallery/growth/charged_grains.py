"""
Charged grains
==============

A gas of grains with charges of both signs, and the same gas without charges. Opposite charges attract each other, so
that charged grains stick sooner: the diagram shows the number of contacts over time.
"""

import matplotlib.pyplot as plt
import numpy as np

import sand

box = sand.Box.periodic("1 um")
elementary = 1.602176634e-19
charges = elementary * np.where(np.arange(60) % 2, 3.0, -3.0)
contact = sand.Contact(damping="critical", damping_ratio=0.2, settling_time="5 ns")

for name, charge in (("± 3 e", charges), ("none", 0.0)):
    grains = sand.setup.gas(60, box, radius="15 nm", material="silica", temperature="100 K", charge=charge, seed=4)
    forces = [contact, sand.Charges()]
    sim = sand.Simulation(grains, forces, box=box, stepping=sand.RigidClusters())
    sim.run(until="2 us")
    plt.plot(1e6 * sim.ledger["time"], sim.ledger["contacts"], label=name)
plt.xlabel("time [µs]")
plt.ylabel("contacts")
plt.legend(title="charges")

# %%
# What to change
# --------------
#
# * Equal signs repel each other: `charge="4.8e-19 C"` for all grains.
# * Grains in a plasma: `sand.ScreenedCharges(screening_length="0.3 um")` instead of `sand.Charges()`.
# * `sand.ElectricField("1 kV/m")` accelerates charges along z.
