"""
A chain in a rotating field and a gas
=====================================

A chain of six magnetic grains in a gas and a rotating field. At 1 MHz the chain turns with the field; at 20 MHz the
drag of the gas lets it fall behind. The diagram shows how many turns the chain makes.
"""

import matplotlib.pyplot as plt
import numpy as np

import sand

chain = sand.setup.chain(6, radius="10 nm", material="iron", moment="200 A m^2/kg", moments="aligned")
gas = sand.Gas("300 K", pressure="0.5 bar", cross_section="2e-19 m^2", brownian=False)
contact = sand.Contact(damping="critical", damping_ratio=0.2, settling_time="5 ns")

for frequency in ("1 MHz", "20 MHz"):
    field = sand.Field(0, shape="rotating", amplitude=["5 mT", 0, 0], frequency=frequency, axis=[0, 0, 1])
    sim = sand.Simulation(
        chain, [contact, sand.Dipoles(), field, gas], stepping=sand.RigidClusters(), frame_every="10 ns", out=frequency
    )
    sim.run(until="1 us")
    frames = sand.open(frequency).frames
    along = np.array([frame.position[-1] - frame.position[0] for frame in frames])
    angle = np.unwrap(np.arctan2(along[:, 1], along[:, 0]))
    plt.plot([1e6 * frame.time for frame in frames], angle / (2 * np.pi), label=frequency)
plt.xlabel("time [µs]")
plt.ylabel("turns of the chain")
plt.legend(title="frequency of the field")

# %%
# What to change
# --------------
#
# * `amplitude`: a stronger field holds the chain at higher frequencies.
# * `pressure`: drag grows with it; the gas must stay rarefied, its mean free path above ten radii.
# * `brownian=True` adds thermal kicks; more grains make a longer, slower chain.
