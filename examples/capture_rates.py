"""Rates at which bodies of growing boxes touch, over those of Eq. 14 at thermal speed with their actual moments.

Run it with:  python examples/capture_rates.py TABLE FOLDER...
TABLE is that of examples/thermal_capture.py.  Each FOLDER holds boxes of `sand grow`, such as those of
examples/growth-in-gas.toml.  rates.csv has a row for each folder, range of S and kind of pair; temperatures.csv for
each kind of body.  Of the rate of a pair the mean over Maxwell's distribution is c times

    ⟨σv⟩ = 3π (α/k_BT)^(2/3) √(k_BT/m̄) 2^(-1/6) Γ(4/3)/Γ(3/2),   α = 2kμμ'  (k = μ0/4π, moments of the bodies),

with T = 100 K.  The measured c is the number of touches over the sum of ⟨σv⟩/V of all pairs, integrated over time from
frame to frame; its error follows from the number of touches.  The c of two grains is that of the TABLE for the mean
energies of rotation of the two kinds of bodies in the same frames; for unequal kinds, for the mean of both.
"""

import csv
import math
import sys
from collections import Counter
from pathlib import Path

import numpy as np
from scipy.special import gamma

import sand
from sand.analysis.body_motion import body_motion, body_temperatures
from sand.analysis.clusters import aggregate_moments, cluster_labels, mean_cluster_size
from sand.basics.constants import BOLTZMANN, MAGNETIC
from sand.experiments.growth import boxes_in

KT = BOLTZMANN * 100.0
RANGES = ((1.0, 2.0), (2.0, 4.0), (4.0, 8.0), (8.0, 16.0))
"""Ranges of S, in which touches are counted together."""
PAIRS = ("grain, grain", "grain, cluster", "cluster, cluster")
BODIES = {"all": lambda grains: grains > 0, "grains": lambda grains: grains == 1, "clusters": lambda grains: grains > 1}


def expected_rates(moment, mass, single, volume):
    """Sum of ⟨σv⟩/V [1/s] over the pairs of each kind, with c = 1."""
    i, j = np.triu_indices(len(mass), 1)
    reduced = mass[i] * mass[j] / (mass[i] + mass[j])
    alpha = 2.0 * MAGNETIC * moment[i] * moment[j]
    rate = 3.0 * math.pi * (alpha / KT) ** (2.0 / 3.0) * np.sqrt(KT / reduced)
    rate *= 2.0 ** (-1.0 / 6.0) * gamma(4.0 / 3.0) / gamma(1.5) / volume
    return np.bincount(2 - single[i].astype(int) - single[j], rate, 3)


def grain_pairs(table, motion):
    """Return c of two grains with the energies of rotation of the kinds of bodies in a frame, for each kind of pair."""
    energies = [motion.rotation[BODIES[kind](motion.grains)] / BOLTZMANN for kind in ("grains", "clusters")]
    grain, cluster = (energy.mean() if len(energy) else 0.0 for energy in energies)
    pairs = np.array([grain, 0.5 * (grain + cluster), cluster])
    return np.exp(np.interp(np.log(np.maximum(pairs, 1.0)), *np.log(table)))


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


def read(folder, table):
    """Touches, and those expected with c = 1 and with c of two grains (3, ranges, kinds); temperatures [K].

    Temperatures are means over the frames of a range of S, (ranges, kinds of bodies, 3), NaN without such frames.
    """
    counted = np.zeros((3, len(RANGES), 3))
    heat = [[[] for _ in BODIES] for _ in RANGES]
    before = None
    for frame in sand.open(folder).frames:
        labels = cluster_labels(len(frame), frame.pair)
        size = mean_cluster_size(labels)
        number = next((k for k, (low, high) in enumerate(RANGES) if low <= size < high), None)
        if before is not None and before[0] is not None:
            of, old, rates, c, time = before
            dt = frame.time - time
            counted[:, of] += touches(old, labels), rates * dt, c * rates * dt
        motion = body_motion(frame, frame.pair, frame.box)
        moment = np.linalg.norm(aggregate_moments(frame.moment, labels)[0], axis=1)
        rates = expected_rates(moment, motion.mass, motion.grains == 1, math.prod(frame.box.lengths))
        before = number, labels, rates, grain_pairs(table, motion), frame.time
        if number is not None and frame.time > 0.0:
            for kind, chosen in enumerate(BODIES.values()):
                if chosen(motion.grains).any():
                    heat[number][kind].append(body_temperatures(motion, chosen(motion.grains)))
    means = [[np.mean(rows, axis=0) if rows else np.full(3, np.nan) for rows in kinds] for kinds in heat]
    return counted, np.array(means)


def rates_of(folder, counted):
    """Rows of rates.csv."""
    for k, (low, high) in enumerate((*RANGES, (RANGES[0][0], RANGES[-1][1]))):
        chosen = slice(None) if k == len(RANGES) else slice(k, k + 1)
        seen, whole, grains = counted[:, chosen].sum(axis=1)
        for name, kinds in (*((name, [kind]) for kind, name in enumerate(PAIRS)), ("all", [0, 1, 2])):
            n, one, two = (part[kinds].sum() for part in (seen, whole, grains))
            if n:
                c = (f"{n / one:.3f}", f"{math.sqrt(n) / one:.3f}", f"{two / one:.3f}")
                yield (folder, f"{low:g} to {high:g}", name, int(n), *c)


def temperatures_of(folder, heat):
    """Rows of temperatures.csv: means over the boxes and their standard errors."""
    for k, (low, high) in enumerate(RANGES):
        for kind, name in enumerate(BODIES):
            of_boxes = heat[:, k, kind][~np.isnan(heat[:, k, kind]).any(axis=1)]
            if len(of_boxes) > 1:
                means, errors = of_boxes.mean(axis=0), of_boxes.std(axis=0, ddof=1) / math.sqrt(len(of_boxes))
                told = (f"{mean:.4g} ± {error:.2g}" for mean, error in zip(means, errors, strict=True))
                yield (folder, f"{low:g} to {high:g}", name, len(of_boxes), *told)


def main(table, folders):
    """Write rates.csv and temperatures.csv."""
    with Path(table).open(encoding="utf-8", newline="") as file:
        rows = [(float(row["rotation [K k_B]"]), float(row["c"])) for row in csv.DictReader(file)]
    heads = {
        "rates.csv": ("folder", "S", "pairs", "touches", "c measured", "error", "c of two grains"),
        "temperatures.csv": ("folder", "S", "bodies", "boxes", "translation [K]", "rotation [K]", "median [K]"),
    }
    found = {name: [] for name in heads}
    for folder in folders:
        boxes = [read(one, np.array(sorted(rows)).T) for one in boxes_in(folder)]
        found["rates.csv"] += rates_of(Path(folder).name, sum(counted for counted, _ in boxes))
        found["temperatures.csv"] += temperatures_of(Path(folder).name, np.array([heat for _, heat in boxes]))
    for name, head in heads.items():
        with Path(name).open("w", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([head, *found[name]])
        print(f"wrote {name}")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
