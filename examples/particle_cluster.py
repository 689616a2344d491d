"""Particle–cluster and cluster–cluster growth of the same magnetic grains, one encounter after the other.

Asked: how do aggregates that grow by single grains differ from aggregates that grow by collisions of equal clusters?
The paper (introduction) expects D_f = 3 of particle–cluster aggregation, chains of very low dimension of magnetic
aggregation (section 3.2), and moments μ ∝ N^0.63 (Eq. 16).  Found: see docs/physics/mixed-populations.md.

Both bodies of an encounter are thermal: a random orientation, rotational energy 3/2 k_B T, and relative speeds and
impact parameters with the frequencies of a dilute gas.  They fly as rigid bodies until their first contact
(`scattering.grains_at_contact`); then every grain is simulated, with contacts and dipoles, until contacts no longer
change.  A body that misses is replaced by a new one.

Run it with:  python examples/particle_cluster.py --grains 64 --repetitions 10 --out particle-cluster
It writes particle-cluster.csv (means over the repetitions with standard errors) and particle-cluster.png.
"""

from __future__ import annotations

import argparse
import math
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

import sand
from sand.analysis.clusters import cluster_labels
from sand.analysis.fits import PowerLawFit, power_law
from sand.analysis.shape import gyration_radius
from sand.basics.constants import BOLTZMANN
from sand.experiments import scattering
from sand.io.table import write_table
from sand.plotting.run_figure import save
from sand.plotting.style import BLUE, RED, legend_above, panel_letter, plot_style
from sand.theory import magnetic

RADIUS = 1e-8
TEMPERATURE = 100.0
MOMENT = "200 A m^2/kg"
INTERVAL = 1e-9
"""Time [s] between two checks of the contacts after a hit."""
QUIET = 3
"""Number of intervals without contacts formed, slipped or broken after which a collision has ended."""
SIZES = (2, 4, 8, 16, 32, 64)
"""Numbers of grains at which aggregates are compared."""
LEAST = 8
"""Smallest aggregate of the fits: from it on, straight chains have the dimension 1.00 by the same fit."""


class Encounters(NamedTuple):
    """What happened in a number of encounters."""

    flights: int  # all, hits included
    within: int  # of these, with an impact parameter below b_max (Eq. 13) of the net moments
    missed: int  # of those within, without a hit
    beyond: int  # hits with an impact parameter above it
    undecided: int  # flights with neither a hit nor a miss after the largest number of steps
    unstuck: int  # hits after which the bodies separated
    slipped: int  # contacts that slid, rolled or twisted beyond their limit
    closed: int  # contacts formed in collisions beyond the one that connects the bodies


class Sample(NamedTuple):
    """One aggregate."""

    repetition: int
    size: int  # N
    gyration: float  # radius of gyration of the centres of the grains [m]
    moment: float  # net moment |Σμ| [A m²]


def net_moment(body: sand.Grains) -> float:
    """Size of the sum of the moments [A m²]."""
    return float(np.linalg.norm(body.moment.sum(axis=0)))


def drawn_encounter(touch: float, moments: tuple[float, float], mass: float, rng: np.random.Generator):
    """Relative speed [m/s] and impact parameter [m] of two bodies of a thermal gas.

    Encounters with impact parameters up to b̂(v) happen at the rate v f(v) π b̂², f the Maxwell distribution of the
    relative speed with the reduced mass m̄.  b̂² = b_s² + R², where R = `touch` is the sum of the outer radii and b_s the
    capture radius (Eq. 13) if all moments of each body, whose sizes have the sums `moments`, were parallel; b_s² ∝
    v^(−4/3).  So x = m̄v²/2k_BT is a Gamma variable, of order 4/3 for the first part of b̂² and 2 for the second.
    """
    thermal = math.sqrt(2.0 * BOLTZMANN * TEMPERATURE / mass)
    capture = magnetic.capture_radius(moments[0], mass, thermal, moments[1])
    parts = np.array([capture**2 * math.gamma(4.0 / 3.0), touch**2])
    order = 4.0 / 3.0 if rng.random() * parts.sum() < parts[0] else 2.0
    x = rng.gamma(order)
    reach = capture**2 * x ** (-2.0 / 3.0) + touch**2
    return thermal * math.sqrt(x), math.sqrt(reach * rng.random())


def collided(grains: sand.Grains, first: int) -> tuple[sand.Grains | None, int, int]:
    """Simulate from the first contact of two bodies, the first of so many grains, until contacts no longer change.

    Returns the aggregate, None if the bodies separate, and the numbers of slips and of additional contacts.
    """
    contact = sand.Contact(damping="critical", damping_ratio=0.2)
    forces = [contact, sand.Dipoles(cutoff=None)] if grains.moment.any() else [contact]
    simulation = sand.Simulation(grains, forces, frame_every=INTERVAL)
    last, unchanged = None, 0
    while unchanged < QUIET:
        simulation.run(until=simulation.time + INTERVAL)
        row = simulation.ledger.rows[-1]
        now = row["made"], row["moved"], row["broken"]
        last, unchanged = now, unchanged + 1 if now == last else 0
    pairs = simulation.contacts["pair"]
    whole = cluster_labels(len(grains), pairs).max() == 0
    between = ((pairs < first).sum(axis=1) == 1).sum()
    return simulation.grains.copy() if whole else None, int(now[1]), int(between) - 1


def joined(one: sand.Grains, two: sand.Grains, rng: np.random.Generator) -> tuple[sand.Grains, np.ndarray]:
    """Let two bodies meet until they stick; returns the aggregate and the counts of `Encounters`."""
    masses = float(one.mass.sum()), float(two.mass.sum())
    mass = magnetic.reduced_mass(*masses)
    strong = tuple(float(np.linalg.norm(body.moment, axis=1).sum()) for body in (one, two))
    net = net_moment(one), net_moment(two)
    counts = np.zeros(len(Encounters._fields), int)
    while True:
        touch = sum(outer_radius(body) for body in (one, two))
        speed, b = drawn_encounter(touch, strong, mass, rng)
        setup = scattering.flight(
            projectile=one, target=two, temperature=TEMPERATURE, speed=speed, spin="equipartition"
        )
        within = b < magnetic.capture_radius(net[0], mass, speed, net[1])
        end, grains = scattering.grains_at_contact(setup, b, seed=int(rng.integers(2**62)))
        aggregate, slipped, closed = (None, 0, 0) if grains is None else collided(grains, len(one))
        hit = end == "hit"
        stuck = aggregate is not None
        undecided = end not in ("hit", "miss")
        counts += (1, within, within and not hit, hit and not within, undecided, hit and not stuck, slipped, closed)
        if aggregate is not None:
            return aggregate, counts


def outer_radius(body: sand.Grains) -> float:
    """Largest distance of a surface from the centre of mass [m]."""
    middle = np.average(body.position, axis=0, weights=body.mass)
    return float((np.linalg.norm(body.position - middle, axis=1) + body.radius).max())


def measured(body: sand.Grains, repetition: int) -> Sample:
    """Size, radius of gyration and net moment of an aggregate."""
    return Sample(repetition, len(body), gyration_radius(body.position), net_moment(body))


Growth = Callable[[int, sand.Grains, int], tuple[list[Sample], np.ndarray, sand.Grains]]


def by_grains(grains: int, grain: sand.Grains, seed: int) -> tuple[list[Sample], np.ndarray, sand.Grains]:
    """Particle–cluster growth: samples, counts and the last aggregate."""
    rng, body, samples, total = np.random.default_rng([1, seed]), grain, [], 0
    while len(body) < grains:
        body, counts = joined(grain, body, rng)
        total = total + counts
        if len(body) in SIZES:
            samples.append(measured(body, seed))
    return samples, total, body


def by_clusters(grains: int, grain: sand.Grains, seed: int) -> tuple[list[Sample], np.ndarray, sand.Grains]:
    """Cluster–cluster growth, 1 + 1, 2 + 2, …: samples, counts and the last aggregate."""
    rng, bodies, samples, total = np.random.default_rng([2, seed]), [grain] * grains, [], 0
    while len(bodies) > 1:
        merged = [joined(one, two, rng) for one, two in zip(bodies[::2], bodies[1::2], strict=True)]
        bodies, total = [body for body, _ in merged], total + sum(counts for _, counts in merged)
        samples += [measured(body, seed) for body in bodies]
    return samples, total, bodies[0]


WAYS: dict[str, Growth] = {"particle-cluster": by_grains, "cluster-cluster": by_clusters}
MOMENTS: dict[str, str | float] = {"magnetic": MOMENT, "without moment": 0.0}


class Ensemble(NamedTuple):
    """Aggregates of independent repetitions of one way of growth."""

    size: np.ndarray  # N of the columns (K,)
    gyration: np.ndarray  # (repetitions, K) geometric means of r_g [m]
    moment: np.ndarray  # (repetitions, K) geometric means of |Σμ| [A m²]
    encounters: Encounters
    picture: sand.Grains  # the last aggregate of the first repetition


def ensemble(grow: Growth, grains: int, grain: sand.Grains, repetitions: int) -> Ensemble:
    """Grow aggregates, and average those of equal size in each repetition."""
    results = [grow(grains, grain, seed) for seed in range(1, repetitions + 1)]
    sizes = np.unique([sample.size for sample in results[0][0]])

    def means(name: str) -> np.ndarray:
        with np.errstate(divide="ignore"):
            logs = [
                [np.log([getattr(s, name) for s in made if s.size == n]).mean() for n in sizes] for made, *_ in results
            ]
        return np.exp(logs)

    counts = Encounters(*(int(n) for n in sum(r[1] for r in results)))
    return Ensemble(sizes, means("gyration"), means("moment"), counts, results[0][2])


def exponent(size: np.ndarray, values: np.ndarray) -> PowerLawFit:
    """Fit values (repetitions, K) ∝ N^exponent from `LEAST` grains on, with a jackknife over the repetitions."""
    used = size >= min(LEAST, size[-2])
    x = np.tile(size[used], len(values)).astype(float)
    return power_law(x, values[:, used].ravel(), np.repeat(np.arange(len(values)), used.sum()))


def spread(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means over the repetitions and their standard errors."""
    return values.mean(axis=0), values.std(axis=0, ddof=1) / math.sqrt(len(values))


def figure(found: dict[tuple[str, str], Ensemble], single: float):
    """Figure of r_g and of the net moment against N, and of one magnetic aggregate of each way."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle

    colours, lines = dict(zip(WAYS, (BLUE, RED), strict=True)), dict(zip(MOMENTS, ("o-", "s:"), strict=True))
    with plot_style():
        drawn = Figure(figsize=(9.6, 3.2), layout="constrained")
        left, middle, right = drawn.subplots(1, 3)
        for (way, kind), one in found.items():
            value, error = spread(one.gyration / RADIUS)
            label = f"{way}, {kind}"
            left.errorbar(one.size, value, error, fmt=lines[kind], color=colours[way], ms=3, lw=0.8, label=label)
            if kind == "magnetic":
                value, error = spread(one.moment / single)
                middle.errorbar(one.size, value, error, fmt="o-", color=colours[way], ms=3, lw=0.8, label=way)
        size = next(iter(found.values())).size
        middle.plot(size, size**0.63, color="0.4", ls="--", lw=0.8, label=r"$N^{0.63}$ (paper)")
        for axes, ylabel, ticks in ((left, "$r_g/r$", (1, 3, 10, 30)), (middle, r"$\mu/\mu_1$", (2, 5, 10, 20, 50))):
            axes.set(xscale="log", yscale="log", xlabel="$N$", ylabel=ylabel)
            axes.set_xticks(size, size)
            axes.set_yticks(ticks, ticks)
            axes.minorticks_off()
        for way, shift in zip(WAYS, (0.0, -1.0), strict=True):
            body = found[way, "magnetic"].picture
            x = body.position - body.position.mean(axis=0)
            x = x @ np.linalg.svd(x, full_matrices=False)[2].T / RADIUS  # longest extent along the first axis
            rows = x + np.array([0.0, 30.0 * shift, 0.0])
            for one, two, _ in rows[np.argsort(x[:, 2])]:
                right.add_patch(Circle((one, two), 1.0, fc=colours[way], ec="white", lw=0.3))
        right.autoscale_view()
        right.set(aspect="equal", xlabel="$x/r$", yticks=[])
        legend_above(left)
        legend_above(middle)
        for axes, letter in zip((left, middle, right), "abc", strict=True):
            panel_letter(axes, letter, -0.12)
    return drawn


def main() -> None:
    """Grow the aggregates, write table and figure, and print exponents and counts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--grains", type=int, default=64, choices=SIZES[1:], help="grains of the largest aggregates")
    parser.add_argument("--repetitions", type=int, default=10)
    parser.add_argument("--out", default="particle-cluster", help="name of the table and the figure")
    options = parser.parse_args()
    warnings.filterwarnings("ignore", message="contacts of iron")
    found, rows, single = {}, [], 0.0
    for kind, moment in MOMENTS.items():
        grain = sand.setup.grain(radius=RADIUS, material=sand.IRON, moment=moment)
        single = max(single, net_moment(grain))
        for way, grow in WAYS.items():
            one = found[way, kind] = ensemble(grow, options.grains, grain, options.repetitions)
            columns = zip(one.size, *spread(one.gyration / RADIUS), *spread(one.moment / single), strict=True)
            for size, gyration, gyration_error, net, net_error in columns:
                row = {"growth": way, "grains": kind, "N": str(size), "r_g/r": f"{gyration:.4g}"}
                row |= {"r_g/r_error": f"{gyration_error:.2g}", "moment/moment_1": f"{net:.4g}"}
                rows.append(row | {"moment/moment_1_error": f"{net_error:.2g}"})
            fit = exponent(one.size, one.gyration)
            print(f"{way}, {kind}: {options.repetitions} times {options.grains} grains")
            print(f"  D_f {1.0 / fit.exponent:.2f} (95 % {1.0 / fit.high:.2f} to {1.0 / fit.low:.2f})")
            if kind == "magnetic":
                law = exponent(one.size, one.moment)
                print(f"  gamma {law.exponent:.2f} (95 % {law.low:.2f} to {law.high:.2f})")
            print("  " + ", ".join(f"{name} {n}" for name, n in one.encounters._asdict().items()), flush=True)
    write_table(Path(f"{options.out}.csv"), rows)
    save(figure(found, single), Path(f"{options.out}.png"))


if __name__ == "__main__":
    main()
