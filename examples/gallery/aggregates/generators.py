"""
Aggregates from generators
==========================

Six ways to build an aggregate of 125 to 150 grains without a simulation, from compact to open. Titles state the radius
of gyration in grain radii and the mean number of contacts of a grain.
"""

import matplotlib.pyplot as plt
import numpy as np

import sand
from sand.analysis import shape

radius = 1e-7
kind = {"radius": radius, "material": "silica"}
bodies = {
    "hexagonal": sand.setup.hexagonal(5, **kind),
    "rbd": sand.setup.rbd(150, **kind, seed=1),
    "bpca": sand.setup.bpca(150, **kind, seed=1),
    "dla": sand.setup.dla(150, **kind, seed=1),
    "bcca": sand.setup.bcca(150, **kind, seed=1),
    "fractal, D = 1.6": sand.setup.fractal(150, dimension=1.6, prefactor=1.4, **kind, seed=1),
}
figure, axes = plt.subplots(2, 3, figsize=(10, 6.4))
for ax, (name, body) in zip(axes.flat, bodies.items(), strict=True):
    sim = sand.Simulation(body, [sand.Contact()], out=name)
    sim.run(steps=1)
    image = sand.open(name).picture(0, colour="coordination", size=(900, 700)).grains_only
    rows, columns = np.nonzero(image[..., 3])
    ax.imshow(image[rows.min() : rows.max(), columns.min() : columns.max()])
    ax.axis("off")
    neighbours = 2 * len(sim.contacts["pair"]) / len(body)
    ax.set_title(f"{name}\n$r_g$ = {shape.gyration_radius(body.position) / radius:.1f} r, Z = {neighbours:.1f}")

# %%
# What to change
# --------------
#
# * The number of grains, up to 100 000; the seed.
# * `radius="lognormal(0.1 um, 0.3)"`, `material={"silica": 0.7, "iron": 0.3}`: mixtures.
# * `moment="material", moments="relaxed"`: magnetic grains in a minimum of their energy.
# * `sand build bpca --grains 1000 --out ball.xyz` does this in a shell.
