r"""
Chains in a magnetic field
==========================

Magnetic grains in a field of 20 mT along z, in which chains grow along the field. The diagram compares the mean cosine
between moments and z with and without the field.

A free grain with the moment :math:`\mu` swings through the direction of the field like a pendulum, as nothing takes the
energy of its swing; small ones have the period :math:`2\pi\sqrt{I/\mu B}`, with the moment of inertia :math:`I`: 20 ns.
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
    sim = sand.Simulation(grains, forces, box=box, stepping=sand.RigidClusters(), out=folder, frame_every="3 ns")
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
# All moments begin to swing at once, each with an amplitude and a period of its own, so that their mean soon settles,
# below the 0.99 that free grains have in thermal equilibrium: that would need a gas. Without the field it scatters
# about zero, by 0.07 for sixty free grains, and by more once the moments of a cluster turn as one. The chains of the
# run with the field, coloured by the angle between moment and field:

picture = sand.open("field-20").picture(colour="field_alignment", view="front", size=(1200, 750))
picture.savefig("field-20/chains.png")

# %%
# What to change
# --------------
#
# * The field: `sand.Field(["0 T", "10 mT", "0 T"])` along y; an oscillating one has `shape="oscillating"`.
# * A field that is switched off: `sand.Field(sand.Ramp(["20 mT", "0 T"], ["0.5 us", "0.5 us"]))`.
# * `sand.Gas("100 K", pressure="0.5 bar", cross_section="2e-19 m^2")` among the forces: swings are damped within a
#   microsecond, and the mean cosine rises to 0.9. That of free grains in equilibrium is :math:`\coth x-1/x` with
#   :math:`x=\mu B/k_BT`; bent chains and rings stay below it.
