"""
Charged grains
==============

A gas of grains with charges of both signs, and the same gas without charges. The diagram shows the number of contacts
over time: opposite charges attract each other from far away, so that charged grains meet sooner.

Two touching grains with opposite charges of three elementary charges have the energy of attraction 7e-20 J, fifty times
:math:`k_BT`. The charges of the box sum up to zero; those of all its periodic images act, by an Ewald sum.
"""

import matplotlib.pyplot as plt
import numpy as np

import sand

box = sand.Box.periodic("1 um")
elementary = 1.602176634e-19
charges = elementary * np.where(np.arange(60) % 2, 3.0, -3.0)
contact = sand.Contact(damping="critical", damping_ratio=0.2, settling_time="5 ns")

for name, charge, forces in (("± 3 e", charges, [contact, sand.Charges(periodic="ewald")]), ("none", 0.0, [contact])):
    grains = sand.setup.gas(60, box, radius="15 nm", material="silica", temperature="100 K", charge=charge, seed=4)
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
# * Equal signs repel each other: `charge="4.8e-19 C"` for all grains. An Ewald sum adds a background of the other sign.
# * Grains in a plasma: `sand.ScreenedCharges(screening_length="0.1 um")` instead of `sand.Charges(…)`.
# * `sand.ElectricField("1 kV/m")` accelerates charges along z.
