"""
The force of a contact
======================

The normal force of two grains in contact over their overlap, in JKR theory. Grains that approach have no force until
they touch, at zero overlap. Grains that part stay in contact down to a negative overlap, where each curve ends on the
left.

The largest pull on the way is the pull-off force. In reduced units all materials have the same curve. The contact
radius of the small iron grains, 0.53 reduced radii at rest, is beyond the 0.3 that the theory assumes: their curve is
an estimate.
"""

import matplotlib.pyplot as plt
import numpy as np

import sand
from sand.contact import jkr

for name, radius in (("ice", "0.1 um"), ("silica", "0.1 um"), ("iron", "10 nm")):
    numbers = sand.theory.contact(name, radius)
    overlap = numbers.pull_off_overlap * np.linspace(-0.999, 3, 300)
    force = [
        jkr.force_at(jkr.root(jkr.stretch(d, 1 / numbers.pull_off_overlap)), numbers.pull_off_force) for d in overlap
    ]
    plt.plot(
        1e9 * overlap,
        1e9 * np.array(force),
        label=f"{name}, {radius}: pull-off force {1e9 * numbers.pull_off_force:.1f} nN",
    )
plt.axhline(0, color="grey", linewidth=0.5)
plt.axvline(0, color="grey", linewidth=0.5)
plt.xlabel("overlap [nm]")
plt.ylabel("normal force [nN], push positive")
plt.legend(fontsize="small")

# %%
# All characteristic values of a contact in closed form:

numbers = sand.theory.contact("silica", "0.1 um")
print(f"energy to break {numbers.break_energy:.2e} J, to roll by 90° {numbers.roll_energy_clamped:.2e} J")
print(f"period of the vibration {numbers.normal_period:.2e} s, sticking speed {numbers.sticking_speed:.2f} m/s")

# %%
# What to change
# --------------
#
# * `sand.theory.contact("ice", "0.1 um", other_radius="1 um")`: unequal grains; two materials are possible, too.
# * `sand.ICE.but(surface_energy="0.05 J/m^2")`: a material of your own.
