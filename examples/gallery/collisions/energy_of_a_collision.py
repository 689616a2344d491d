"""
Where the energy of a collision goes
====================================

Two fluffy aggregates of ice collide at 30 m/s and break into a few pieces. The diagram shows how much of the impact
energy each mechanism has dissipated: contacts that form, break, slide, roll and twist, and the damping of their
vibration.

A contact that forms jumps to a finite radius; the energy of adhesion that this frees is dissipated, as in JKR theory.
"""

import matplotlib.pyplot as plt

import sand
from sand.experiments.collision import collide

bodies = [sand.setup.bcca(48, radius="0.1 um", material="ice (Wada et al. 2013)", seed=seed) for seed in (1, 2)]
contact = sand.Contact(damping="viscoelastic", viscous_time="1e-12 s")
result, sim = collide(*bodies, speed="30 m/s", impact_parameter="0.2 b", seed=3, forces=[contact], out="impact")
print(
    f"{result.outcome}: fragments of {result.fragments} grains, {result.made} contacts formed, {result.broken} broken"
)

names = ["forming", "breaking", "sliding", "rolling", "twisting", "damping_normal"]
shares = [sim.ledger["lost_" + name] / result.impact_energy for name in names]
plt.stackplot(1e9 * sim.ledger["time"], shares, labels=[name.replace("_", ", ") for name in names])
plt.xlabel("time [ns]")
plt.ylabel("dissipated / impact energy")
plt.ylim(0, 1)
plt.legend(loc="upper center", ncols=3, fontsize="small")

# %%
# The rest is the motion of the pieces. The bodies at the end:

picture = sand.open("impact").picture(size=(1200, 640))
picture.savefig("impact/end.png")

# %%
# What to change
# --------------
#
# * `speed`: at 10 m/s these bodies stick, at 50 m/s they break into many pieces. At 3 m/s the sum exceeds 1, because
#   contacts that form free energy of adhesion, which is not part of the impact energy.
# * `impact_parameter="0.9 b"`: a grazing impact.
# * `radius`, `material`: another surface energy moves all thresholds.
# * `damping="none"`: contacts vibrate for ever, and only slip and breaking dissipate.
