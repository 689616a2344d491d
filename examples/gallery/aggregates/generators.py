"""
Aggregates from generators
==========================

Six ways to build an aggregate of 125 to 150 grains without a simulation, from compact to open. Titles state the radius
of gyration in grain radii and the mean number of contacts of a grain; colours show the number of contacts.
"""

import matplotlib.pyplot as plt
import numpy as np

import sand
from sand.analysis import shape
from sand.io.bodies import write_body
from sand.io.file_frames import open_frames
from sand.plotting.render.still import still_picture


def frame_of(name: str, body: sand.Grains) -> object:
    """The body as a frame of a file, as which `sand view` and other programs read it."""
    write_body(f"{name}.gsd", body, overwrite=True)
    return open_frames(f"{name}.gsd")[0]


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
figure, axes = plt.subplots(2, 3, figsize=(10, 7), layout="constrained")
for ax, (name, body) in zip(axes.flat, bodies.items(), strict=True):
    frame = frame_of(name, body)
    image = still_picture(frame, colour="coordination", size=(500, 400)).grains_only
    rows, columns = np.nonzero(image[..., 3])
    ax.imshow(image[rows.min() : rows.max(), columns.min() : columns.max()])
    ax.axis("off")
    neighbours = 2 * len(frame.pair) / len(body)
    ax.set_title(f"{name}\n$r_g$ = {shape.gyration_radius(body.position) / radius:.1f} r, Z = {neighbours:.1f}")

# %%
# What to change
# --------------
#
# * The number of grains, up to 100 000; the seed.
# * `radius="lognormal(0.1 um, 0.3)"`, `material={"silica": 0.7, "iron": 0.3}`: mixtures.
# * `moment="material", moments="relaxed"`: magnetic grains in a minimum of their energy.
# * `sand build bpca --grains 1000 --out ball.xyz` does this in a shell.
