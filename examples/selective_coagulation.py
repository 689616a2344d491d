"""Selective coagulation: magnetic iron grains among equal grains without a moment, in one periodic box.

Asked: do magnetic grains coagulate among themselves and leave the others?  The paper (section 3.2) expects "selective
coagulation of magnetized dust particles with their kin", because their capture cross-section is larger.  Found:
see docs/physics/mixed-populations.md.

Run it with:  python examples/selective_coagulation.py --seeds 6 --until "3 us" --out selective
It writes selective.csv (means over the boxes with standard errors) and selective.png.
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path
from typing import NamedTuple

import numpy as np

import sand
from sand.analysis.clusters import cluster_labels
from sand.basics.units import si
from sand.io.table import write_table
from sand.plotting.run_figure import save
from sand.plotting.style import BLUE, GREEN, RED, legend_above, panel_letter, plot_style
from sand.theory import kinetics

MAGNETIC_DENSITY = 125 / 1.293e-6**3
"""Number density of the magnetic grains [1/m³], that of growth.toml; as many grains without a moment are added."""
IRON = {"radius": "10 nm", "material": sand.IRON}
TEMPERATURE = "100 K"
SPECIFIC_MOMENT = 200.0
ROWS = 20
"""Number of times at which a box is measured."""


class Sample(NamedTuple):
    """State of one box at one time."""

    size_magnetic: float  # mean size of the cluster of a magnetic grain, S of Eq. 17 for this population
    size_plain: float  # mean size of the cluster of a grain without a moment
    share_magnetic: float  # share of the magnetic grains that are in a cluster of at least two
    share_plain: float
    share_swept: float  # share of the grains without a moment that are in a cluster with a magnetic grain
    contacts_magnetic: float  # number of contacts between two magnetic grains
    contacts_mixed: float
    contacts_plain: float
    purity: float  # magnetic grains of clusters with at least two of them, over all grains of these clusters


def measure(magnetic: np.ndarray, pairs: np.ndarray) -> Sample:
    """Measure both populations; `magnetic` (N,) is True for grains with a moment, `pairs` (C, 2) are the contacts."""
    labels = cluster_labels(len(magnetic), pairs)
    size, count = np.bincount(labels), np.bincount(labels, magnetic)
    own, plain = size[labels[magnetic]], size[labels[~magnetic]]
    ends = magnetic[pairs].sum(axis=1)
    grown = count >= 2
    return Sample(
        own.mean(),
        plain.mean(),
        (own > 1).mean(),
        (plain > 1).mean(),
        (count[labels[~magnetic]] > 0).mean(),
        *(float((ends == k).sum()) for k in (2, 1, 0)),
        count[grown].sum() / size[grown].sum() if grown.any() else np.nan,
    )


def simulate(each: int, until: float, seed: int) -> np.ndarray:
    """Samples (ROWS + 1, 9) of a box of `each` grains with and as many without a moment."""
    warnings.filterwarnings("ignore", message="contacts of iron")
    side = (each / MAGNETIC_DENSITY) ** (1.0 / 3.0)
    magnetic = np.arange(2 * each) < each
    mass = sand.setup.grain(**IRON).mass[0]
    moments = np.where(magnetic, SPECIFIC_MOMENT * mass, 0.0)
    grains = sand.setup.gas(2 * each, side, **IRON, moment=moments, temperature=TEMPERATURE, seed=seed)
    forces = [sand.Contact(damping="critical", damping_ratio=0.2), sand.Dipoles(periodic="ewald", accuracy=1e-3)]
    simulation = sand.Simulation(grains, forces, box=side)
    rows = [measure(magnetic, simulation.contacts["pair"])]
    for time in np.linspace(0.0, until, ROWS + 1)[1:]:
        simulation.run(until=time)
        rows.append(measure(magnetic, simulation.contacts["pair"]))
    return np.array(rows)


def expected_contacts(each: int, time: np.ndarray) -> np.ndarray:
    """Contacts between single grains without moments from kinetic theory: ½ N n K t, K = 16 r² √(πkT/m)."""
    mass = float(sand.setup.grain(**IRON).mass[0])
    return 0.5 * each * MAGNETIC_DENSITY * kinetics.brownian("10 nm", mass, TEMPERATURE)(mass, mass) * time


def figure(time: np.ndarray, mean: Sample, error: Sample, expected: np.ndarray):
    """Figure of the share of grains in aggregates, S, and contacts of the three kinds over time."""
    from matplotlib.figure import Figure

    with plot_style():
        drawn = Figure(figsize=(9.6, 3.3), layout="constrained")
        panels = drawn.subplots(1, 3)
        curves = (
            (("share_magnetic", "magnetic", RED), ("share_plain", "without moment", BLUE)),
            (("size_magnetic", "of a magnetic grain", RED), ("size_plain", "of a grain without moment", BLUE)),
            (
                ("contacts_magnetic", "magnetic–magnetic", RED),
                ("contacts_mixed", "mixed", GREEN),
                ("contacts_plain", "without moments", BLUE),
            ),
        )
        labels = ("share of grains in aggregates", "mean cluster size $S$", "contacts per box")
        for axes, lines, ylabel, letter in zip(panels, curves, labels, "abc", strict=True):
            for name, label, colour in lines:
                value, spread = getattr(mean, name), getattr(error, name)
                axes.plot(time * 1e6, value, color=colour, label=label)
                axes.fill_between(time * 1e6, value - spread, value + spread, color=colour, alpha=0.2, lw=0)
            axes.set(xlabel="time [µs]", ylabel=ylabel)
            panel_letter(axes, letter, -0.12)
        panels[2].plot(time * 1e6, expected, color=BLUE, ls=":", label="kinetic theory, without moments")
        panels[2].plot(time * 1e6, 2.0 * expected, color=GREEN, ls=":", label="the same, mixed")
        for axes in panels:
            legend_above(axes)
    return drawn


def main() -> None:
    """Simulate the boxes, write table and figure, and print the state at the end."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--grains", type=int, default=40, help="grains of each population")
    parser.add_argument("--seeds", type=int, default=6, help="number of boxes")
    parser.add_argument("--until", default="3 us")
    parser.add_argument("--out", default="selective", help="name of the table and the figure")
    options = parser.parse_args()
    if options.seeds < 2:
        parser.error("--seeds must be at least 2: errors follow from the scatter between boxes")
    until = si(options.until, "s", "until", above=0.0)
    time = np.linspace(0.0, until, ROWS + 1)
    boxes = np.array([simulate(options.grains, until, seed) for seed in range(1, options.seeds + 1)])
    mean = Sample(*boxes.mean(axis=0).T)
    error = Sample(*(boxes.std(axis=0, ddof=1) / np.sqrt(len(boxes))).T)
    expected = expected_contacts(options.grains, time)
    rows = [
        {"time": f"{t:.4g}"}
        | {name: f"{value:.4g}" for name, value in zip(Sample._fields, values, strict=True)}
        | {f"{name}_error": f"{value:.2g}" for name, value in zip(Sample._fields, errors, strict=True)}
        for t, values, errors in zip(time, zip(*mean, strict=True), zip(*error, strict=True), strict=True)
    ]
    write_table(Path(f"{options.out}.csv"), rows)
    save(figure(time, mean, error, expected), Path(f"{options.out}.png"))
    print(f"{len(boxes)} boxes of {options.grains} + {options.grains} grains at {options.until}:")
    for name, value, spread in zip(Sample._fields, mean, error, strict=True):
        print(f"{name:18} {value[-1]:8.3f} ± {spread[-1]:.3f}")
    print(f"contacts of kinetic theory: {expected[-1]:.2f} without moments, {2.0 * expected[-1]:.2f} mixed")


if __name__ == "__main__":
    main()
