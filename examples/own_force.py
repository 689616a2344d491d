"""Two forces of your own: grains in a harmonic trap that repel each other when they come close.

Run it with:  python examples/own_force.py [FOLDER]
Continue it with:  sand resume FOLDER --until "0.4 ms" --import examples/own_force.py
"""

import math
import sys

import sand


@sand.external_force(stiffness="N/m")
def trap(grain, p):
    """U = ½ k x², F = −k x."""
    x, y, z = grain.position
    return (-p.stiffness * x, -p.stiffness * y, -p.stiffness * z), 0.5 * p.stiffness * (x * x + y * y + z * z)


@sand.pair_force(strength="J", length="m")
def soft_repulsion(apart, a, b, p):
    """U = ε exp(−r²/2l²), F = U r/l²."""
    x, y, z = apart
    energy = p.strength * math.exp(-0.5 * (x * x + y * y + z * z) / p.length**2)
    force = energy / p.length**2
    return (force * x, force * y, force * z), energy


def main(folder: str | None = None) -> None:
    """Eight grains of silica fall towards the centre of the trap."""
    corners = [(x, y, z) for x in (-2e-6, 2e-6) for y in (-2.2e-6, 2.2e-6) for z in (-2.4e-6, 2.4e-6)]
    grains = sand.Grains(corners, "0.5 um", sand.SILICA)
    forces = [sand.Contact(), trap(stiffness="200 nN/m"), soft_repulsion(strength="1 aJ", length="0.5 um")]
    sim = sand.Simulation(grains, forces, out=folder)
    print(sim.run(until="0.2 ms"))
    print(f"trap {sim.ledger['trap'][-1]:.3g} J, repulsion {sim.ledger['soft_repulsion'][-1]:.3g} J")


if __name__ == "__main__":
    main(*sys.argv[1:2])
