"""Figure 4 of the paper: a fast grain strikes a straight chain, which becomes T-shaped; hit-and-stick gives no T.

Run it with:  python examples/figure4.py [figure4.png]
The script prints the final shape of the chain and draws maps of impact speed and position with the final shape
(T, straight, bent or broken).
"""

import sys
import warnings
from pathlib import Path

import numpy as np

import sand
from sand.experiments import chain_impact
from sand.plotting.chain_map import Map, Picture, chain_figure
from sand.plotting.run_figure import save

warnings.filterwarnings("ignore", message="contacts of iron")

POSITIONS = np.linspace(-1.1, 0.3, 29)
RESET = sand.Contact(slip="reset")  # as in the paper: displacements beyond the critical value are reset to zero
DAMPED = sand.Contact(damping="viscoelastic", viscous_time="1.25e-11 s")
CASES = (
    ("20 nm iron, reset", sand.IRON, "10 nm", RESET, range(100, 320, 20), 100),
    ("20 nm iron, clamp", sand.IRON, "10 nm", sand.Contact(), range(100, 320, 20), 100),
    ("0.2 um silica, damped", sand.SILICA, "0.1 um", DAMPED, (8, 16, 24, 32), 25),
    ("0.2 um ice, clamp", sand.ICE, "0.1 um", sand.Contact(), (5, 8, 10, 12, 14, 16, 20, 25), 25),
)


def main(out: str = "figure4.png") -> None:
    """Simulate one impact, compute the maps, and draw the figure."""
    speed, position = 240.0, -0.6
    hit = chain_impact.strike(sand.IRON, "10 nm", speed=speed, place=position, contact=RESET)
    shape = chain_impact.shape_of(hit)
    stuck = chain_impact.stick_at_first_touch(sand.IRON, 1e-8, position)
    print(
        f"iron, {speed:g} m/s at {position:g} r: {shape.name}, crossbar at {shape.crossbar:.0f} degrees to the chain,"
    )
    print(f"the struck end grain rolled by {shape.rolled:.0f} degrees; hit-and-stick gives: {stuck.name}")
    maps = []
    for title, material, radius, contact, speeds, steps in CASES:
        fine = sand.Verlet(steps_per_period=steps)
        names = chain_impact.shape_map(material, radius, speeds, POSITIONS, contact=contact, stepping=fine)
        maps.append(Map(title, list(speeds), POSITIONS, names))
        print(f"{title}: T in {np.mean(names == 'T'):.1%} of the map")
    pictures = [
        Picture("before", hit.start.position, 1e-8),
        Picture(f"after, {speed:g} m/s: {shape.name}", hit.grains.position, 1e-8),
        Picture("hit-and-stick", chain_impact.first_touch(sand.IRON, 1e-8, position)[0], 1e-8),
    ]
    save(chain_figure(pictures, maps), Path(out))
    print(f"figure: {out}")


if __name__ == "__main__":
    main(*sys.argv[1:2])
