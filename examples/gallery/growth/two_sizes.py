"""
A mixture of two sizes
======================

Twenty magnetic grains of iron in a gas of sixty smaller grains of silica without moments. The iron grains attract each
other and form chains; the silica grains stick where they happen to touch. Colours show the material.
"""

import numpy as np

import sand

box = sand.Box.periodic("0.8 um")
grains = sand.setup.gas(
    80,
    box,
    temperature="100 K",
    seed=2,
    classes=[
        {"number": 20, "radius": "11 nm", "material": "iron", "moment": "material"},
        {"number": 60, "radius": "8 nm", "material": "silica"},
    ],
)
contact = sand.Contact(damping="critical", damping_ratio=0.2, settling_time="5 ns")
sim = sand.Simulation(
    grains, [contact, sand.Dipoles(periodic="ewald")], box=box, stepping=sand.RigidClusters(), out="two-sizes"
)
print(sim.run(until="2 us"))

iron = np.array([grains.materials[k].name == "iron" for k in grains.material])
of_iron = iron[sim.contacts["pair"]].sum(axis=1)
for name, count, pairs in (("iron-iron", 2, 190), ("iron-silica", 1, 1200), ("silica-silica", 0, 1770)):
    found = np.sum(of_iron == count)
    print(f"{name:13s} {found:2d} contacts of {pairs} pairs: {found / pairs:.1%}")

# %%
# Without moments the shares would differ only as sizes and thermal speeds do.

picture = sand.open("two-sizes").picture(colour="material", size=(1200, 750))
picture.savefig("two-sizes/mixture.png")

# %%
# What to change
# --------------
#
# * `"radius": "lognormal(8 nm, 0.2)"` or `"power law(-3.5, 5 nm, 25 nm)"`: a distribution of sizes.
# * `"material": {"silica": 0.5, "ice": 0.5}`: a class of two materials.
# * `"charge": "1.6e-19 C"` in a class, and `sand.Charges()` among the forces.
