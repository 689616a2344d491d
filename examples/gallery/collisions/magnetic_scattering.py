"""
Two magnetic grains pass each other
===================================

Paths of an iron grain that passes another one, for several impact parameters. The grain flies in along x, slowly,
with both moments along the line between the grains. Attraction bends the path; below a limit, the capture radius, the
grains collide.
"""

import matplotlib.pyplot as plt

from sand.experiments.scattering import flight, trajectory

setup = flight(
    radius="10 nm",
    material="iron",
    moment="200 A m^2/kg",
    temperature="100 K",
    speed=1 / 16,
    speed_unit="thermal",
    orientation="aligned",
)
limit = setup.scales.capture
for b in ("0.9 b_max", "0.95 b_max", "1.0 b_max", "1.05 b_max", "1.2 b_max"):
    path = trajectory(setup, b)
    relative = (path.projectile - path.target) / limit
    plt.plot(relative[:, 0], relative[:, 1], label=f"{b.replace('b_max', '$b_{max}$')}: {path.end}")
plt.plot(0, 0, "ko")
plt.xlabel("x / $b_{max}$")
plt.ylabel("y / $b_{max}$")
plt.axis([-2, 2, -1.5, 1.5])
plt.gca().set_aspect("equal")
plt.legend(fontsize="small")

# %%
# What to change
# --------------
#
# * `speed`: the capture radius falls as :math:`v^{-2/3}`, and moments have less time to follow the direction of the
#   other grain.
# * `spin="kT/2"`: grains that spin average the field of each other, and are captured less often.
# * `orientation="random"` and other seeds, as a cross-section takes them.
# * Two aggregates: `projectile=` and `target=` instead of radius, material and moment.
