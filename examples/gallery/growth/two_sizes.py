"""
A mixture of two sizes
======================

Ten magnetic grains of iron in a gas of fifty smaller grains of silica without moments. The iron grains find each other
by their attraction; the silica grains stick where they happen to touch. Colours show the material.
"""

import numpy as np

import sand

box = sand.Box.periodic("0.5 um")
grains = sand.setup.gas(
    60,
    box,
    temperature="300 K",
    seed=2,
    classes=[
        {"number": 10, "radius": "20 nm", "material": "iron", "moment": "material"},
        {"number": 50, "radius": "12 nm", "material": "silica"},
    ],
)
contact = sand.Contact(damping="critical", damping_ratio=0.2, settling_time="5 ns")
sim = sand.Simulation(
    grains, [contact, sand.Dipoles(periodic="ewald")], box=box, stepping=sand.RigidClusters(), out="two-sizes"
)
print(sim.run(until="0.6 us"))

iron = np.array([grains.materials[k].name == "iron" for k in grains.material])
kinds = iron[sim.contacts["pair"]].sum(axis=1)
print(f"contacts iron-iron {np.sum(kinds == 2)}, iron-silica {np.sum(kinds == 1)}, silica-silica {np.sum(kinds == 0)}")

# %%
# Without a moment all pairs would touch equally often, apart from their sizes.

picture = sand.open("two-sizes").picture(colour="material", size=(1200, 750))
picture.savefig("two-sizes/mixture.png")

# %%
# What to change
# --------------
#
# * `"radius": "lognormal(12 nm, 0.2)"` or `"power law(-3.5, 5 nm, 25 nm)"`: a distribution of sizes.
# * `"material": {"silica": 0.5, "ice": 0.5}`: a class of two materials.
# * `"charge": "1.6e-19 C"` in a class, and `sand.Charges()` among the forces.
