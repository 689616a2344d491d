"""
Magnetic moments of an aggregate
================================

The same aggregate of iron with moments in random directions, all parallel, and relaxed to a minimum of their energy.
Relaxed moments close in rings, so that little of the moment remains outside.
"""

import matplotlib.pyplot as plt
import numpy as np

import sand

names = ("random", "aligned", "relaxed")
figure, axes = plt.subplots(1, 3, figsize=(12, 4.2))
for ax, moments in zip(axes, names, strict=True):
    body = sand.setup.bcca(40, radius="10 nm", material="iron", moment="200 A m^2/kg", moments=moments, seed=5)
    sim = sand.Simulation(body, [sand.Contact(), sand.Dipoles()], out=moments)
    sim.run(steps=1)
    image = sand.open(moments).picture(0, colour="alignment", size=(900, 700)).grains_only
    rows, columns = np.nonzero(image[..., 3])
    ax.imshow(image[rows.min() : rows.max(), columns.min() : columns.max()])
    ax.axis("off")
    net = np.linalg.norm(body.moment.sum(axis=0)) / np.linalg.norm(body.moment, axis=1).sum()
    ax.set_title(f"{moments}: {sand.setup.magnetic_energy(body):.1e} J,\nnet moment {net:.2f} of the sum")

# %%
# What to change
# --------------
#
# * `sand.setup.chain`: relaxed moments of a chain are parallel to it, and none of the moment is lost.
# * `magnetic=0.5`: half of the grains have a moment.
