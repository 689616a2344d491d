"""How long clusters vibrate after they formed, in the main job with damping, grain by grain.

A cluster counts as calm when its vibrational energy, K − P²/2M − ½ Ω·J Ω, has been below a threshold for
max(1 ns, 0.6 ns (n/8)²), about half the period of the slowest bending of a chain, since its last contact formed or
broke, and no displacement exceeds half of its limit.  Thresholds are shares ε of ½ k q_c² of twisting, the smallest of
the three modes.  From then on it could move as a rigid body; its vibrational energy at this moment would be removed.
"""

from __future__ import annotations

import math
import multiprocessing
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

import sand
from sand.analysis.clusters import cluster_labels
from sand.basics.constants import BOLTZMANN
from sand.basics.state import BROKEN, MADE
from sand.contact.law import contact_constants
from sand.io.table import write_table

TABLE = Path(__file__).parents[1] / "docs" / "physics" / "vibrations.csv"
BOX, TEMPERATURE, UNTIL = 1.2e-6, 100.0, 5e-6
KT = BOLTZMANN * TEMPERATURE
SAMPLE_STEPS = 130
"""Steps between two samples, about 0.1 ns."""
THRESHOLDS = (1e-3, 1e-2, 1e-1)
SIZES = ((2, 2), (3, 4), (5, 8), (9, 16), (17, 40), (41, 100))
SHARE = 0.5
"""Largest displacement of a calm cluster, in units of its limit."""


class Variant(NamedTuple):
    """Damping of a run."""

    ratio: float
    settling_time: float | None


VARIANTS = (Variant(0.2, None), Variant(0.2, 5e-9))


class Cluster:
    """A cluster since its last event."""

    def __init__(self, time: float, size: int):
        self.since, self.size = time, size
        self.loud = [time] * len(THRESHOLDS)
        self.calm: list[float | None] = [None] * len(THRESHOLDS)  # time at which it became calm
        self.removed = [0.0] * len(THRESHOLDS)


def window(size: int) -> float:
    """Time [s] for which the vibrational energy has to stay low."""
    return max(1e-9, 0.6e-9 * (size / 8.0) ** 2)


def twisting_energy(contact: sand.Contact, grains: sand.Grains) -> float:
    """½ k q_c² [J] of twisting, the smallest of the three modes."""
    iron, radius = grains.materials[0], float(grains.radius[0])
    c = contact_constants(contact.contact_law)(contact.pairing(iron, iron), radius, radius, 1.0, 1.0)
    modes = ((c.slide_stiffness, c.slide_limit), (c.roll_stiffness, c.roll_limit), (c.twist_stiffness, c.twist_limit))
    return min(0.5 * k * q * q for k, q in modes)


def connected(position: np.ndarray, box: sand.Box, members: np.ndarray, pairs: np.ndarray) -> None:
    """Shift the members of a cluster by box lengths so that grains in contact are neighbours."""
    placed = {int(members[0])}
    left = [(int(a), int(b)) for a, b in pairs]
    while len(placed) < len(members):
        for a, b in left:
            if (a in placed) != (b in placed):
                here, there = (a, b) if a in placed else (b, a)
                position[there] = position[here] + box.nearest(position[there] - position[here])
                placed.add(there)


def vibrational_energies(grains: sand.Grains, position: np.ndarray, groups: list[np.ndarray]) -> Iterator[float]:
    """K − P²/2M − ½ Ω·J Ω [J] of each cluster; positions are continuous across the boundaries."""
    m, inertia = grains.mass[:, None], grains.inertia[:, None]
    for own in groups:
        v, w, mass = grains.velocity[own], grains.spin[own], m[own]
        total = mass.sum()
        s = position[own] - (mass * position[own]).sum(axis=0) / total
        u = v - (mass * v).sum(axis=0) / total
        angular = (mass * np.cross(s, u) + inertia[own] * w).sum(axis=0)
        square = (mass * s**2).sum() + inertia[own].sum()
        tensor = square * np.eye(3) - (mass * s).T @ s
        yield 0.5 * float(
            (mass * u**2).sum() + (inertia[own] * w**2).sum() - angular @ np.linalg.solve(tensor, angular)
        )


def follow(given: tuple[Variant, int, float]) -> list[tuple[int, int, float, float, float]]:
    """Run the main job of a seed; one row for each cluster, threshold and period between two events.

    A row is the number of the threshold, the number of grains, the duration [s] until it was calm (or until the next
    event, with removed energy −1), the removed energy [J], and the time [s] of the period.
    """
    variant, seed, until = given
    iron = {"radius": "10 nm", "material": "iron", "moment": "200 A m^2/kg"}
    grains = sand.setup.gas(100, BOX, temperature=TEMPERATURE, seed=seed, **iron)
    contact = sand.Contact(damping="critical", damping_ratio=variant.ratio, settling_time=variant.settling_time)
    sim = sand.Simulation(grains, [contact, sand.Dipoles()], box=BOX, frame_every=until)
    smallest = twisting_energy(contact, grains)
    here = sim.grains.position.copy()
    last, events, clusters = here.copy(), -1, dict[bytes, Cluster]()
    groups: list[np.ndarray] = []
    keys: list[bytes] = []  # members and contacts of each group
    rows: list[tuple[int, int, float, float, float]] = []

    def close(key: bytes) -> None:
        cluster = clusters.pop(key)
        for k, calm in enumerate(cluster.calm):
            end = sim.time if calm is None else calm
            rows.append(
                (k, cluster.size, end - cluster.since, -1.0 if calm is None else cluster.removed[k], cluster.since)
            )

    while sim.time < until:
        sim.run(steps=SAMPLE_STEPS)
        now = sim.grains.position
        here += sim.box.nearest(now - last)
        last = now.copy()
        count = int(sim.state.count[MADE] + sim.state.count[BROKEN])
        if count == 0 or (count == events and all(None not in cluster.calm for cluster in clusters.values())):
            continue
        table = sim.contacts
        pair, share = table["pair"], np.zeros(len(grains))
        for name in ("slide_share", "roll_share", "twist_share"):
            for side in range(2):
                np.maximum.at(share, pair[:, side], table[name])
        if count != events:
            labels = cluster_labels(len(grains), pair)
            order = np.argsort(labels, kind="stable")
            groups = [g for g in np.split(order, np.flatnonzero(np.diff(labels[order])) + 1) if len(g) > 1]
            bonds = [pair[np.isin(pair[:, 0], g)] for g in groups]
            keys = [
                g.tobytes() + np.unique(np.sort(own), axis=0).tobytes() for g, own in zip(groups, bonds, strict=True)
            ]
            for key in [key for key in clusters if key not in keys]:
                close(key)
            for key, g, own in zip(keys, groups, bonds, strict=True):
                if key not in clusters:
                    clusters[key] = Cluster(sim.time, len(g))
                    connected(here, sim.box, g, own)
            events = count
        for key, own, energy in zip(keys, groups, vibrational_energies(sim.grains, here, groups), strict=True):
            cluster, wait = clusters[key], window(len(own))
            for k, threshold in enumerate(THRESHOLDS):
                if energy > threshold * smallest:
                    cluster.loud[k] = sim.time
                low = sim.time - max(cluster.loud[k], cluster.since) > wait and share[own].max() < SHARE
                if cluster.calm[k] is None and low:
                    cluster.calm[k], cluster.removed[k] = sim.time, energy
    for key in list(clusters):
        close(key)
    return rows


def awake(rows: list[tuple[int, int, float, float, float]], threshold: int, until: float) -> tuple[float, float]:
    """Share of time in which any cluster is not calm, and share of the grains' time."""
    spans = sorted((since, since + duration) for k, _, duration, _, since in rows if k == threshold)
    covered, end = 0.0, 0.0
    for begin, stop in spans:
        covered += max(0.0, stop - max(begin, end))
        end = max(end, stop)
    of_grains = math.fsum(size * duration for k, size, duration, _, _ in rows if k == threshold)
    return covered / until, of_grains / (100 * until)


def write(seeds: int = 4, until: float = UNTIL, table: Path = TABLE) -> Path:
    """Write durations, shares of time and removed energies of all variants, thresholds and sizes."""
    jobs = [(variant, seed, until) for variant in VARIANTS for seed in range(1, seeds + 1)]
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        found = []
        for (variant, seed, _), rows in zip(jobs, pool.imap(follow, jobs), strict=True):
            found.append(rows)
            print(f"{variant}, seed {seed}: {len(rows)} rows", flush=True)
    lines = []
    for v, variant in enumerate(VARIANTS):
        runs = found[v * seeds : (v + 1) * seeds]
        for k, threshold in enumerate(THRESHOLDS):
            shares = np.array([awake(rows, k, until) for rows in runs])
            line = {
                "settling time [ns]": "none" if variant.settling_time is None else f"{variant.settling_time * 1e9:g}",
                "ε": f"{threshold:g}",
            }
            for low, high in SIZES:
                own = [row for rows in runs for row in rows if row[0] == k and low <= row[1] <= high]
                calm = sorted(row[2] for row in own if row[3] >= 0.0)
                text = f"{np.median(calm) * 1e9:.1f} ({calm[-1] * 1e9:.0f})" if calm else "–"
                line[f"n = {low}" if low == high else f"{low}–{high}"] = f"{text}, {len(own) - len(calm)}/{len(own)}"
            line["any awake"] = f"{shares[:, 0].mean():.1%} ({shares[:, 0].max():.1%})"
            line["grains awake"] = f"{shares[:, 1].mean():.2%} ({shares[:, 1].max():.2%})"
            removed = [math.fsum(row[3] for row in rows if row[0] == k and row[3] > 0.0) / KT for rows in runs]
            line["removed [kT per run]"] = f"{np.mean(removed):.3g}"
            lines.append(line)
    write_table(table, lines)
    return table
