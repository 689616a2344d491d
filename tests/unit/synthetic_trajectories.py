"""Synthetic trajectories for tests of their readers."""

import numpy as np

import sand
from sand.basics.box import Box
from sand.io.trajectory import TrajectoryWriter

MODES = ("stretch", "slide", "roll", "twist")


def contacts_of(pairs, seed=0):
    """A contact table of these pairs, by column, with loads of many magnitudes."""
    rng = np.random.default_rng(seed)
    pair = np.array(pairs, dtype=np.uint32).reshape(-1, 2)
    count = len(pair)
    return {
        "pair": pair,
        "overlap": 1e-10 * rng.random(count),
        "formed": 1e-9 * rng.random(count),
        "force": rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-15, -7, (count, 1)),
        "slide_vector": np.zeros((count, 3)),
        "roll_vector": np.zeros((count, 3)),
        "twist": np.zeros(count),
        **{f"{mode}_share": rng.random(count) for mode in MODES},
    }


def grains_of(count, seed=0):
    """Grains in a row with random offsets, velocities, spins and moments."""
    rng = np.random.default_rng(seed)
    positions = np.arange(count)[:, None] * [2e-8, 0.0, 0.0] + rng.normal(size=(count, 3)) * 1e-9
    vectors = {name: rng.normal(size=(count, 3)) for name in ("velocity", "spin", "moment")}
    vectors["moment"] *= 1e-18
    return sand.Grains(positions, rng.uniform(0.5e-8, 1e-8, count), sand.IRON, charge=1.6e-19, **vectors)


def append(writer, pairs_of_frames, count, first=0):
    """Append frames 1 ps and 10 steps apart, and flush."""
    for k, pairs in enumerate(pairs_of_frames, first):
        writer.write(10 * k, 1e-12 * k, grains_of(count, k), Box.periodic(1e-6), contacts_of(pairs, k))
    writer.flush()


def write_trajectory(path, pairs_of_frames, count):
    """A trajectory of this many grains with these contact pairs per frame."""
    writer = TrajectoryWriter(path)
    append(writer, pairs_of_frames, count)
    writer.close()
    return path
