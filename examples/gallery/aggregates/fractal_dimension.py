"""
Fractal dimension of aggregates
===============================

Number of grains over radius of gyration, for three kinds of growth. The slope of each line is the fractal dimension.

Single grains that fly straight make the most compact bodies (``bpca``), with a dimension of 3 for large ones. Single
grains that diffuse stick to the outer branches (``dla``): about 2.5. Clusters that join others of their size (``bcca``)
stay open: about 1.9. Slopes over bodies of at most 512 grains are below these limits.
"""

import matplotlib.pyplot as plt
import numpy as np

import sand
from sand.analysis import shape

sizes = [16, 32, 64, 128, 256, 512]
for build in (sand.setup.bpca, sand.setup.dla, sand.setup.bcca):
    radii = [
        np.mean(
            [
                shape.gyration_radius(build(n, radius="0.1 um", material="silica", seed=seed).position)
                for seed in range(4)
            ]
        )
        for n in sizes
    ]
    slope = np.polyfit(np.log(radii), np.log(sizes), 1)[0]
    plt.loglog(np.array(radii) / 1e-7, sizes, "o-", label=f"{build.__name__}: D = {slope:.2f}")
plt.minorticks_off()
plt.xticks([4, 8, 16, 32], ["4", "8", "16", "32"])
plt.yticks(sizes, [str(n) for n in sizes])
plt.xlabel("radius of gyration / grain radius")
plt.ylabel("grains")
plt.legend()

# %%
# What to change
# --------------
#
# * More seeds make the slope more precise; larger bodies bring it nearer to its limit.
# * `sand.analysis.fractal.correlation_dimension(body.position)` finds the dimension of a single aggregate.
# * `sand.analysis.fractal.ensemble_dimension` has a confidence interval.
