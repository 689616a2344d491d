"""
Growth in dilute dust
=====================

In a thin nebula no more than two bodies meet at a time. A population of 200 magnetic grains grows by such encounters,
one after the other; the cost does not depend on the density. The picture shows the largest aggregate.
"""

import numpy as np

import sand
from sand.experiments import dilute_growth

grains = sand.Grains(np.zeros((200, 3)), "10 nm", "iron", moment="200 A m^2/kg")  # positions do not matter
contact = sand.Contact(damping="critical", damping_ratio=0.2, settling_time="5 ns")
grown = dilute_growth.grow(
    grains,
    [contact, sand.Dipoles()],
    number_density="3e8 /m^3",
    temperature="100 K",
    stop="mean_cluster_size >= 4",
    seed=1,
    out="dilute",
)
print(f"{grown.ledger['time'][-1] / 86400:.1f} days, largest aggregate {grown.aggregates['grains'].max():.0f} grains")

# %%

picture = sand.open("dilute").picture(cluster=1, size=(1200, 640))
picture.savefig("dilute/largest.png")

# %%
# What to change
# --------------
#
# * `number_density`: only the time changes, as long as encounters stay binary.
# * `temperature`: warm grains fly faster, and are captured only from nearby.
# * `hits="stick"`: bodies join at the first touch, without contacts that roll.
# * A thousand grains and `stop="mean_cluster_size >= 30"`, as in `examples/dilute-growth.toml`.
