r"""
Chains in a magnetic field
==========================

Magnetic grains in a field of 20 mT along z: moments turn into the field, and chains grow along it. The diagram
compares the order of the moments with and without the field.
"""

import matplotlib.pyplot as plt
import numpy as np

import sand

box = sand.Box.periodic("0.8 um")
contact = sand.Contact(damping="critical", damping_ratio=0.2, settling_time="5 ns")


def grown(flux_density: str, folder: str) -> sand.Simulation:
    """Sixty grains after 1 µs in a field along z."""
    grains = sand.setup.gas(
        60, box, radius="10 nm", material="iron", moment="200 A m^2/kg", temperature="100 K", seed=3
    )
    forces = [contact, sand.Dipoles(periodic="ewald"), sand.Field(flux_density)]
    sim = sand.Simulation(grains, forces, box=box, stepping=sand.RigidClusters(), out=folder, frame_every="20 ns")
    sim.run(until="1 us")
    return sim


for flux_density in ("0 T", "20 mT"):
    folder = f"field-{flux_density.split()[0]}"
    grown(flux_density, folder)
    frames = sand.open(folder).frames
    cosine = [(frame.moment[:, 2] / np.linalg.norm(frame.moment, axis=1)).mean() for frame in frames]
    plt.plot([1e6 * frame.time for frame in frames], cosine, label=flux_density)
plt.xlabel("time [µs]")
plt.ylabel("mean cosine between moment and z")
plt.legend(title="flux density")

# %%
# The chains of the run with the field, coloured by the angle between moment and field:

picture = sand.open("field-20").picture(colour="field_alignment", view="front", size=(1200, 750))
picture.savefig("field-20/chains.png")

# %%
# What to change
# --------------
#
# * The field: `sand.Field(["0 T", "10 mT", "0 T"])` along y; an oscillating one has `shape="oscillating"`.
# * A field that is switched off: `sand.Field(sand.Ramp(["20 mT", "0 T"], ["0.5 us", "0.5 us"]))`.
# * `temperature`: the order follows the ratio of the energies :math:`\mu B/k_BT`.
