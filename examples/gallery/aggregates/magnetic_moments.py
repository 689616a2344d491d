"""
Magnetic moments of an aggregate
================================

The same aggregate of iron with moments in random directions, all parallel, and relaxed to a minimum of their energy.
The energy of relaxed moments, which follow each other head to tail, is the lowest by far; titles state it, and the net
moment as a share of the sum of all moments.
"""

import matplotlib.pyplot as plt
import numpy as np

import sand
from sand.io.bodies import write_body
from sand.io.file_frames import open_frames
from sand.plotting.render.still import still_picture

names = ("random", "aligned", "relaxed")
figure, axes = plt.subplots(1, 3, figsize=(12, 4.2), layout="constrained")
for ax, moments in zip(axes, names, strict=True):
    body = sand.setup.bcca(40, radius="10 nm", material="iron", moment="200 A m^2/kg", moments=moments, seed=5)
    write_body(f"{moments}.gsd", body, overwrite=True)
    image = still_picture(open_frames(f"{moments}.gsd")[0], colour="alignment", size=(600, 470)).grains_only
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
