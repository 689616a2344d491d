"""``python -m benchmarks.net_loads RUN``: error of the net loads on clusters by the way in which dipoles are summed.

For frames of a run in a periodic box, the net force and torque on every cluster of at least two grains are computed
with the nearest image and automatic cut-off and with Ewald sums, and compared with an Ewald sum of accuracy 1e-8.  The
error is the root mean square over all clusters, relative to that of the exact loads.  Loads within a cluster cancel in
its net force, but not in the error of the cut-off.
"""

from __future__ import annotations

import sys
import warnings

import numpy as np

import sand
from sand.analysis.clusters import cluster_labels, unwrapped

WAYS = {
    "nearest image": {},
    "Ewald, 1e-3": {"periodic": "ewald", "accuracy": 1e-3},
    "Ewald, 1e-4": {"periodic": "ewald", "accuracy": 1e-4},
}
EXACT = {"periodic": "ewald", "accuracy": 1e-8}


def net_loads(frame: sand.Frame, **settings: object) -> tuple[np.ndarray, np.ndarray]:
    """Net force [N] and torque [N m] about the centre of mass, (K, 3), of each cluster of two grains or more."""
    grains = sand.Grains(frame.position, frame.radius, sand.IRON, moment=frame.moment)
    sim = sand.Simulation(grains, [sand.Dipoles(**settings)], box=frame.box)
    loads = sim.loads()
    labels = cluster_labels(len(grains), frame.pair)
    sizes = np.bincount(labels)
    whole = unwrapped(frame.position, frame.pair, frame.box)
    count = len(sizes)
    force, torque, centre = (np.zeros((count, 3)) for _ in range(3))
    np.add.at(centre, labels, grains.mass[:, None] * whole)
    centre /= np.bincount(labels, grains.mass)[:, None]
    np.add.at(force, labels, loads["force"])
    np.add.at(torque, labels, loads["torque"] + np.cross(whole - centre[labels], loads["force"]))
    return force[sizes > 1], torque[sizes > 1]


def main() -> None:
    """Print the table."""
    warnings.simplefilter("ignore")
    frames = sand.open(sys.argv[1]).frames
    times = [float(frame.time) for frame in frames]
    print(f"{'time':>8} {'clusters':>9}  " + "  ".join(f"{name:>17}" for name in WAYS) + "   (force, torque)")
    for wanted in (0.2e-6, 1e-6, 2e-6, 5e-6):
        frame = frames[int(np.argmin(np.abs(np.array(times) - wanted)))]
        exact = net_loads(frame, **EXACT)
        row = []
        for settings in WAYS.values():
            found = net_loads(frame, **settings)
            errors = [np.sqrt(((a - b) ** 2).sum() / (b**2).sum()) for a, b in zip(found, exact, strict=True)]
            row.append(f"{errors[0]:8.2g} {errors[1]:8.2g}")
        print(f"{frame.time * 1e6:5.2f} us {len(exact[0]):9d}  " + "  ".join(row), flush=True)


if __name__ == "__main__":
    main()
