"""
Magnetic grains form a chain
============================

A hundred magnetic iron grains, 20 nm in diameter, at 100 K attract each other and stick. The picture shows the
largest cluster after 5 µs, with the magnetic moment of each grain as an arrow.
"""

import sand

box = sand.Box.periodic("1.2 um")
grains = sand.setup.gas(100, box, radius="10 nm", material="iron", moment="200 A m^2/kg", temperature="100 K", seed=1)
contact = sand.Contact(damping="critical", damping_ratio=0.2, settling_time="5 ns")
sim = sand.Simulation(
    grains, [contact, sand.Dipoles(periodic="ewald")], box=box, stepping=sand.RigidClusters(), out="magnetic-chain"
)
print(sim.run(until="5 us"))
print(f"mean cluster size S = {sim.ledger['mean_cluster_size'][-1]:.1f}, {int(sim.ledger['contacts'][-1])} contacts")

# %%
# The picture is drawn without a browser; `sand view magnetic-chain` shows the same run as a moving 3-D page.

picture = sand.open("magnetic-chain").picture(cluster=1, perspective=True, size=(1200, 640))
picture.savefig("magnetic-chain/chain.png")

# %%
# What to change
# --------------
#
# * `temperature`: at 10 K grains of low speed are captured from farther away, at 1000 K only from nearby.
# * `moment="20 A m^2/kg"`: a tenth of the moment, and the attraction is a hundred times weaker.
# * `until="10 us"`: clusters meet and join.
# * `seed`: another gas, and another chain.
