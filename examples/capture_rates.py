"""Rates at which bodies of growing boxes touch, over those of Eq. 14 at thermal speed with their actual moments.

Run it with:  python examples/capture_rates.py FOLDER...
Each FOLDER holds boxes of `sand grow` (such as those of examples/growth-in-gas.toml).  The table has a row for each
folder, range of S and kind of pair.  The mean of a pair's rate over Maxwell's distribution is

    ⟨σv⟩ = 3π (α/k_BT)^(2/3) √(k_BT/m̄) 2^(-1/6) Γ(4/3)/Γ(3/2),   α = 2kμμ'  (k = μ0/4π),

with T = 100 K, the temperature of the translation.  c is the number of touches over the sum of ⟨σv⟩/V of all pairs,
integrated over time from frame to frame; its error follows from the number of touches.  `sand scatter` predicts it for
two grains: examples/thermal_capture.py.
"""

import csv
import math
import sys
from collections import Counter

import numpy as np
from scipy.special import gamma

import sand
from sand.analysis.body_motion import body_motion, body_temperatures
from sand.analysis.clusters import aggregate_moments, cluster_labels, mean_cluster_size
from sand.constants import BOLTZMANN, MAGNETIC
from sand.experiments.growth import boxes_in

KT = BOLTZMANN * 100.0
RANGES = ((1.0, 2.0), (2.0, 4.0), (4.0, 8.0), (8.0, 16.0))
"""Ranges of S, in which touches are counted together."""
KINDS = ("grain, grain", "grain, cluster", "cluster, cluster")


def expected_rates(moment, mass, single, volume):
    """Sum of ⟨σv⟩/V [1/s] over the pairs of each kind, with c = 1."""
    i, j = np.triu_indices(len(mass), 1)
    reduced = mass[i] * mass[j] / (mass[i] + mass[j])
    alpha = 2.0 * MAGNETIC * moment[i] * moment[j]
    rate = 3.0 * math.pi * (alpha / KT) ** (2.0 / 3.0) * np.sqrt(KT / reduced)
    rate *= 2.0 ** (-1.0 / 6.0) * gamma(4.0 / 3.0) / gamma(1.5) / volume
    return np.bincount(2 - single[i] - single[j], rate, 3)


def touches(before, after):
    """Number of touches of each kind between two frames; of three bodies that become one, as if one after another."""
    found = np.zeros(3)
    for whole in range(after.max() + 1):
        sizes = sorted(Counter(before[after == whole].tolist()).values())
        while len(sizes) > 1:
            one, other = sizes.pop(0), sizes.pop(0)
            found[(one > 1) + (other > 1)] += 1
            sizes = sorted([*sizes, one + other])
    return found


def read(folder):
    """Touches and expected touches by range of S and kind of pair, (2, R, 3); temperatures [K] by range, (R, 3, 3).

    The rows of temperatures are those of all bodies, of single grains and of clusters.
    """
    run = sand.open(folder)
    counted, heat, looks = np.zeros((2, len(RANGES), 3)), np.zeros((len(RANGES), 3, 3)), np.zeros((len(RANGES), 3, 1))
    before = None
    for frame in run.frames:
        labels = cluster_labels(len(frame), frame.pair)
        size = mean_cluster_size(labels)
        number = next((k for k, (low, high) in enumerate(RANGES) if low <= size < high), None)
        if before is not None and before[3] is not None:
            old, rates, time, of = before
            counted[:, of] += touches(old, labels), rates * (frame.time - time)
        motion = body_motion(frame, frame.pair, frame.box)
        moment = np.linalg.norm(aggregate_moments(frame.moment, labels)[0], axis=1)
        single = (motion.grains == 1).astype(int)
        volume = math.prod(frame.box.lengths)
        before = labels, expected_rates(moment, motion.mass, single, volume), frame.time, number
        if number is not None and frame.time > 0.0:
            kinds = (single >= 0, single == 1, single == 0)
            now = np.array([body_temperatures(motion, chosen) for chosen in kinds])
            known = ~np.isnan(now).any(axis=1, keepdims=True)
            heat[number], looks[number] = heat[number] + np.where(known, now, 0.0), looks[number] + known
    return counted, heat, looks


def main(folders):
    """Print the table."""
    table = csv.writer(sys.stdout, lineterminator="\n")
    kinds = ("bodies", "grains", "clusters")
    told = [f"{kind}: {name} [K]" for kind in kinds for name in ("translation", "rotation", "rotation, median")]
    table.writerow(("boxes", "S", "pairs", "touches", "c", "error", *told))
    for folder in folders:
        boxes = [read(one) for one in boxes_in(folder)]
        counted, heat, looks = (sum(parts) for parts in zip(*boxes, strict=True))
        for k, (low, high) in enumerate((*RANGES, (RANGES[0][0], RANGES[-1][1]))):
            chosen = slice(None) if k == len(RANGES) else slice(k, k + 1)
            seen, expected = counted[:, chosen].sum(axis=1)
            with np.errstate(invalid="ignore"):
                temperatures = heat[chosen].sum(axis=0) / looks[chosen].sum(axis=0)
            for name, n, rate in zip(("all", *KINDS), (seen.sum(), *seen), (expected.sum(), *expected), strict=True):
                if n:
                    row = (f"{len(boxes)} {folder}", f"{low:g}-{high:g}", name, int(n))
                    numbers = (f"{n / rate:.3f}", f"{math.sqrt(n) / rate:.3f}")
                    told = (f"{value:.4g}" for value in temperatures.ravel()) if name == "all" else ()
                    table.writerow((*row, *numbers, *told))
        sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1:])
