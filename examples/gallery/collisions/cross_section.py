r"""
Capture cross-section of magnetic grains
========================================

How large a target are two magnetic grains for each other? Cross-sections from over a thousand encounters at each speed.

They are in units of the geometric one, :math:`\pi(2R)^2`. The line is the largest one that a centrifugal barrier lets
pass, which falls as :math:`v^{-4/3}`.
"""

import matplotlib.pyplot as plt
import numpy as np

import sand
from sand.experiments.scattering import cross_section

kind = {"radius": "10 nm", "material": "iron", "moment": "200 A m^2/kg", "temperature": "100 K"}
speeds = [0.25, 1, 4, 16]
found = [cross_section(**kind, speed=v, speed_unit="thermal", relative_error=0.08, seed=1) for v in speeds]
plt.errorbar(
    speeds,
    [one.enhancement for one in found],
    yerr=[one.enhancement_error for one in found],
    fmt="o",
    label="encounters",
)

mass = sand.IRON.density * 4 / 3 * np.pi * 1e-8**3
thermal = sand.theory.thermal_speed(mass, "100 K")
expected = [sand.theory.capture_cross_section(200 * mass, sand.theory.reduced_mass(mass), v * thermal) for v in speeds]
plt.loglog(speeds, np.array(expected) / sand.theory.geometric_cross_section("10 nm"), label="largest possible")
plt.xlabel("speed / thermal speed")
plt.ylabel("cross-section / geometric cross-section")
plt.legend()

# %%
# What to change
# --------------
#
# * `relative_error=0.01`: more encounters; their number is in `found[0].flights`.
# * `spin="kT/2"`, `moment`, `temperature`, or unequal grains.
# * `sand scatter examples/figure3.toml` computes a whole figure with parallel processes.
