"""A chain of silica grains is pulled apart between two walls: it breaks at the pull-off force of two grains, 3πγR.

Run it with:  python examples/chain_between_walls.py [FOLDER]
"""

import math
import sys

import sand

RADIUS, SPEED = 0.5e-6, 1e-3  # m, m/s; at a tenth of the speed the force is 0.1 % nearer


def main(folder: str | None = None) -> float:
    """The greatest force on the fixed wall over 3πγR with R = r/2; it differs from 1 by less than 1 %."""
    chain = sand.setup.chain(6, radius=RADIUS, material="silica")
    rest = sand.theory.contact("silica", RADIUS, other_radius=1.0).rest_overlap  # a plane, in effect
    end = chain.position[:, 0].max() + RADIUS - rest
    walls = [
        sand.Wall([-end, 0, 0], [1, 0, 0], "silica", name="fixed"),
        sand.Wall([end, 0, 0], [-1, 0, 0], "silica", velocity=[SPEED, 0, 0], name="moving"),
    ]
    sim = sand.Simulation(chain, [sand.Contact(damping="critical")], walls=walls, row_every="10 ns", out=folder)
    sim.run(until="60 us", stop="broken == 1")
    ratio = sim.ledger["fixed_force_x"].max() / (3.0 * math.pi * sand.SILICA.surface_energy * RADIUS / 2.0)
    print(f"greatest force on the wall: {ratio:.4f} of the pull-off force of two grains")
    return ratio


if __name__ == "__main__":
    main(*sys.argv[1:2])
