r"""
Compression of a porous aggregate
=================================

The periodic box of a fluffy aggregate of ice shrinks: pressure over filling factor, with two laws of the literature.

Kataoka et al. (2013) have :math:`P=(E_\mathrm{roll}/r^3)\,\phi^3` for fluffy bodies, :math:`\phi` below about 0.1;
the law of Tatsuuma et al. (2023, its form from memory) rises without bound towards the closest packing.
"""

import matplotlib.pyplot as plt
import numpy as np

import sand
from sand.experiments.laboratory import Loading, load
from sand.theory.compression import kataoka_pressure, tatsuuma_pressure

body = sand.setup.bcca(128, radius="0.1 um", material="ice (Wada et al. 2013)", seed=1)
contact = sand.Contact(damping="constant", damping_constant="2.2e-10 kg/s")
loaded = load(body, Loading("compress", rate="1e-4 /t_c", to=0.45), forces=[contact])

filling = np.array([row["filling"] for row in loaded.table[1:]])
pressure = [row["stress"] for row in loaded.table[1:]]
slow = np.array([row["rate_ratio"] for row in loaded.table[1:]]) < 1
plt.loglog(filling, pressure, "o", fillstyle="none", label="the box moves too fast")
plt.loglog(filling[slow], np.array(pressure)[slow], "o", color="C0", label="slow enough")
plt.loglog(filling, kataoka_pressure(filling, loaded.plan.scales.pressure), label="Kataoka et al. (2013)")
plt.loglog(filling, tatsuuma_pressure(filling, loaded.plan.scales.pressure), label="Tatsuuma et al. (2023)")
plt.minorticks_off()
plt.xticks([0.02, 0.05, 0.1, 0.2, 0.4], ["0.02", "0.05", "0.1", "0.2", "0.4"])
plt.xlabel("filling factor")
plt.ylabel("pressure [Pa]")
plt.legend(fontsize="small")
print(f"{loaded.table[-1]['coordination']:.1f} contacts of a grain at the end")

# %%
# What to change
# --------------
#
# * `rate="3e-5 /t_c"`: slow enough from a lower filling factor on. More grains and seeds: the points scatter less.
# * `sand compress`, `sand stretch` and `sand shear` do this from a file, with a figure and errors over seeds.
# * `by="walls"`: a lid presses the packing onto a floor.
