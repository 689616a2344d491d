r"""
A chain in a rotating field and a gas
=====================================

A chain of six magnetic grains in a gas and a rotating field. The diagram shows how many turns the chain makes: at 1
MHz it follows the field, swinging about its direction; at 20 MHz it does not.

In a field at rest the chain would swing with the frequency :math:`\sqrt{N\mu B/I}/2\pi`, here 4.7 MHz, with the
moment of inertia :math:`I` of the chain. A field of a higher frequency has turned on before the chain can follow: the
torque changes its sign again and again. It pushes the chain once, when the field is switched on; then the gas brings
the chain to rest.
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
    sim.run(until="3 us")
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
# * `amplitude`: a stronger field holds the chain at higher frequencies; four times the field at twice the frequency.
# * `pressure`: drag grows with it; the gas must stay rarefied, its mean free path above ten radii.
# * `brownian=True` adds thermal kicks; more grains make a longer, slower chain.
