"""
From sticking to fragmentation
==============================

Collisions of two ballistic aggregates of ice at several speeds and for three seeds. The growth efficiency is the share
of the projectile by which the target grows: 1 if all sticks, below 0 if the target loses mass.

All impacts are central. At 80 m/s SAND warns that some grains overlap by more than a tenth of their radius, at which
solids yield: there the model, which has no plastic deformation, gives estimates.
"""

import matplotlib.pyplot as plt
import numpy as np

import sand
from sand.experiments.collision import collide_many


def bodies(seed: int) -> tuple[sand.Grains, sand.Grains]:
    """Target and projectile of a seed."""
    kind = {"radius": "0.1 um", "material": "ice (Wada et al. 2013)"}
    return sand.setup.bpca(30, seed=seed, **kind), sand.setup.bpca(15, seed=100 + seed, **kind)


speeds, means = np.geomspace(5, 80, 6), []
for speed in speeds:
    found = collide_many(bodies, [1, 2, 3], speed=float(speed))
    efficiency = [(max(each.fragments) - 30) / 15 for each in found]
    means.append(np.mean(efficiency))
    plt.semilogx([speed] * 3, efficiency, "o", color="C0")
plt.semilogx(speeds, means, "_", color="C1", markersize=20, label="mean of three collisions")
plt.legend()
plt.axhline(0, color="grey", linewidth=0.5)
plt.minorticks_off()
plt.xticks([5, 10, 20, 40, 80], ["5", "10", "20", "40", "80"])
plt.xlabel("impact speed [m/s]")
plt.ylabel("growth efficiency")

# %%
# What to change
# --------------
#
# * `impact_parameter="0.5 b"` in `collide_many`; means over impact parameters need hundreds of collisions.
# * `executor=`: a `concurrent.futures` executor computes the collisions in parallel processes.
# * `sand sweep` does the same from a file, with one table for all runs.
