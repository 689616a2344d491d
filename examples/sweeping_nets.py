"""A magnetic net in a gas of non-magnetic grains: how fast it collects them, and the area of a sphere of equal mass.

Asked: do loose aggregates of magnetic grains collect the others as fast as their area suggests?  The paper
(introduction) expects that networks of magnetic grains "may eventually provide a large fraction of the available
collisional cross-section", so that non-magnetic grains would mainly collide with them.  Found: see
docs/physics/mixed-populations.md.

The net is an aggregate with the fractal dimension of the boxes on docs/physics/growth.md, with moments at a minimum of
their energy.  Kinetic theory: dN/dt = n <σ v>, where σ is the projected area of the target with all radii enlarged by
that of a gas grain, averaged over directions, and n v is the sum of the speeds of the single gas grains per volume.

Run it with:  python examples/sweeping_nets.py --seeds 12 --until "0.12 us" --out sweeping
It writes sweeping.csv (means over the boxes with standard errors) and sweeping.png.
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path
from typing import NamedTuple

import numpy as np

import sand
from sand.analysis.clusters import cluster_labels, unwrapped
from sand.analysis.shape import projected_area
from sand.basics.units import si
from sand.io.table import write_table
from sand.plotting.run_figure import save
from sand.plotting.style import BLUE, RED, legend_above, panel_letter, plot_style
from sand.setup.encounters import combined

RADIUS = 1e-8
DIMENSION = 1.54
BOX = 0.5e-6
TEMPERATURE = "100 K"
GAP = 0.1 * RADIUS
"""Smallest gap [m] between the target and a gas grain at the start."""
ROWS = 12
"""Number of times at which a box is measured."""


class Sample(NamedTuple):
    """State of one box at one time."""

    collected: float  # gas grains that the target has collected
    single: float  # of these, grains that arrived one at a time
    expected: float  # the same by kinetic theory, for the single gas grains and the target present at each time
    area: float  # σ [m²]
    paired: float  # gas grains that have collided with another gas grain and not with the target


def net(grains: int, seed: int) -> sand.Grains:
    """Loose aggregate of magnetic iron grains."""
    kind = {"radius": RADIUS, "material": sand.IRON, "moment": "200 A m^2/kg", "moments": "relaxed"}
    return sand.setup.fractal(grains, dimension=DIMENSION, **kind, seed=seed)


def area_of_sphere(grains: int) -> float:
    """Cross-section [m²] of one solid sphere with the mass of so many grains, for a gas grain: π(N^(1/3) r + r)²."""
    return float(np.pi * (grains ** (1.0 / 3.0) * RADIUS + RADIUS) ** 2)


def target_in_gas(target: sand.Grains, number: int, seed: int) -> sand.Grains:
    """The target at rest in a thermal gas of grains without moments; grains that would touch it are left out."""
    gas = sand.setup.gas(number, BOX, radius=RADIUS, material=sand.IRON, temperature=TEMPERATURE, seed=seed)
    apart = sand.Box((BOX,) * 3).nearest(gas.position[:, None] - target.position[None])
    free = (np.linalg.norm(apart, axis=2) > RADIUS + target.radius + GAP).all(axis=1)
    kept = sand.Grains(gas.position[free], RADIUS, sand.IRON, velocity=gas.velocity[free], spin=gas.spin[free])
    return combined([target, kept], [np.zeros(3)] * 2, [np.zeros(3)] * 2)


def simulate(target: sand.Grains, number: int, until: float, seed: int) -> np.ndarray:
    """Samples (ROWS + 1, 5) of one box."""
    warnings.filterwarnings("ignore", message="contacts of iron")
    forces = [sand.Contact(damping="critical", damping_ratio=0.2), sand.Dipoles(periodic="ewald", accuracy=1e-3)]
    simulation = sand.Simulation(target_in_gas(target, number, seed), forces, box=BOX)
    own = len(target)
    is_gas = np.arange(len(simulation.grains)) >= own
    rows, expected, arrived, single, rate = [], 0.0, np.zeros(len(is_gas), bool), np.ones(len(is_gas), bool), 0.0
    one_by_one = 0
    for time in np.linspace(0.0, until, ROWS + 1):
        if time > 0.0:
            simulation.run(until=time)
        grains, pairs = simulation.grains, simulation.contacts["pair"]
        labels = cluster_labels(len(grains), pairs)
        now = is_gas & (labels == labels[0])
        one_by_one += int((now & ~arrived & single).sum())
        arrived = now
        single = is_gas & (np.bincount(labels)[labels] == 1)
        whole = unwrapped(grains.position, pairs, simulation.box)[labels == labels[0]]
        area, _ = projected_area(whole, grains.radius[labels == labels[0]] + RADIUS)
        drift = np.average(grains.velocity[labels == labels[0]], axis=0, weights=grains.mass[labels == labels[0]])
        before, rate = rate, area * np.linalg.norm(grains.velocity[single] - drift, axis=1).sum() / BOX**3
        expected += 0.5 * (before + rate) * until / ROWS if time > 0.0 else 0.0
        paired = (is_gas & ~single & ~now).sum()
        rows.append(Sample(now.sum(), one_by_one, expected, area, paired))
    return np.array(rows, dtype=float)


def figure(time: np.ndarray, samples: np.ndarray, picture: sand.Grains):
    """Figure of a net beside a sphere of equal mass, as seen along z, and of the collected grains over time."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle

    mean, error = samples.mean(axis=0), samples.std(axis=0, ddof=1) / np.sqrt(len(samples))
    sphere = area_of_sphere(len(picture)) / mean[0, 3]
    with plot_style():
        drawn = Figure(figsize=(7.2, 3.0), layout="constrained")
        left, right = drawn.subplots(1, 2)
        for x, y, _ in picture.position[np.argsort(picture.position[:, 2])] * 1e9:
            left.add_patch(Circle((x, y), RADIUS * 1e9, fc=RED, ec="white", lw=0.4))
        left.add_patch(Circle((-160, 150), len(picture) ** (1 / 3) * RADIUS * 1e9, fc=BLUE, ec="white", lw=0.4))
        left.set(aspect="equal", xlim=(-240, 240), ylim=(-240, 240), xlabel="x [nm]", ylabel="y [nm]")
        right.errorbar(time * 1e6, mean[:, 1], error[:, 1], color=RED, fmt="o", ms=2.5, lw=0.8, label="net, simulated")
        right.plot(time * 1e6, mean[:, 2], color=RED, label=r"net, kinetic theory $n\langle\sigma v\rangle$")
        right.plot(time * 1e6, sphere * mean[:, 2], color=BLUE, label="sphere of equal mass, kinetic theory")
        right.set(xlabel="time [µs]", ylabel="single grains collected per box")
        legend_above(right)
        panel_letter(left, "a", -0.2)
        panel_letter(right, "b", -0.12)
    return drawn


def main() -> None:
    """Simulate the boxes, write table and figure, and print counts and cross-sections."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--grains", type=int, default=64, help="grains of the net")
    parser.add_argument("--gas", type=int, default=500, help="grains of the gas")
    parser.add_argument("--seeds", type=int, default=12, help="number of boxes")
    parser.add_argument("--until", default="0.12 us")
    parser.add_argument("--out", default="sweeping", help="name of the table and the figure")
    options = parser.parse_args()
    if options.seeds < 2:
        parser.error("--seeds must be at least 2: errors follow from the scatter between boxes")
    until = si(options.until, "s", "until", above=0.0)
    time, seeds = np.linspace(0.0, until, ROWS + 1), range(1, options.seeds + 1)
    samples = np.array([simulate(net(options.grains, seed), options.gas, until, seed) for seed in seeds])
    mean, error = samples.mean(axis=0), samples.std(axis=0, ddof=1) / np.sqrt(len(samples))
    rows = []
    for t, values, errors in zip(time, mean, error, strict=True):
        row = {"time": f"{t:.4g}"}
        for column, value, spread in zip(Sample._fields, values, errors, strict=True):
            row |= {column: f"{value:.4g}", f"{column}_error": f"{spread:.2g}"}
        rows.append(row)
    write_table(Path(f"{options.out}.csv"), rows)
    save(figure(time, samples, net(options.grains, 1)), Path(f"{options.out}.png"))
    total = Sample(*samples[:, -1].sum(axis=0))
    ratio, spread = total.single / total.expected, np.sqrt(total.single) / total.expected
    print(f"{len(samples)} nets of {options.grains} grains until {options.until}:")
    print(f"collected {total.collected:.0f}, {total.single:.0f} one at a time; kinetic theory {total.expected:.1f}")
    print(f"simulated over kinetic theory {ratio:.2f} ± {spread:.2f} (Poisson)")
    print(f"gas grains in clusters without the net: {total.paired:.0f}")
    sphere = area_of_sphere(options.grains)
    print(f"sigma of the net {mean[0, 3]:.3g} ± {error[0, 3]:.1g} m^2, {mean[0, 3] / sphere:.2f} times the sphere's")


if __name__ == "__main__":
    main()
