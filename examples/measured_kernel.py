"""Collision kernel from simulated cross-sections of chains of 1, 2 and 4 magnetic iron grains with thermal spin.

Run it with:  python examples/measured_kernel.py 0.1 kernel
The first argument is the relative error of each cross-section.  The second is the name of the output files, kernel.csv
(SI units) and kernel.txt (cgs units, for DustPy).
"""

from __future__ import annotations

import sys
from itertools import combinations_with_replacement

import numpy as np

import sand
from sand.experiments import kernel_table
from sand.experiments.scattering import cross_section
from sand.theory import kinetics

ERROR = float(sys.argv[1]) if len(sys.argv) > 1 else 0.1
NAME = sys.argv[2] if len(sys.argv) > 2 else "kernel"
SIZES = (1, 2, 4)


def body(grains: int) -> sand.Grains:
    """Return a straight chain with moments in head-to-tail alignment."""
    return sand.setup.chain(grains, radius="10 nm", material=sand.IRON, moment="200 A m^2/kg")


def main() -> None:
    """Compute the cross-section of each pair and compare with Eq. 14 for moments proportional to N and N^0.63.

    Each pair starts with the mean thermal speed of the lighter chain.
    """
    grain = body(1)
    mass, moment = float(grain.mass[0]), float(np.linalg.norm(grain.moment[0]))
    mean_speed = np.sqrt(8.0 / np.pi)  # mean of the Maxwell distribution, in units of the thermal speed
    rows = []
    print("  N1   N2   sigma [m2]        sigma v [m3/s]     /Eq. 14: N^1   N^0.63")
    for small, large in combinations_with_replacement(SIZES, 2):
        found = cross_section(
            temperature="100 K",
            speed=mean_speed,
            speed_unit="thermal",
            spin="kT/2",
            projectile=body(small),
            target=body(large),
            target_velocity="thermal",
            relative_error=ERROR,
            seed=1,
        )
        rows.append((small * mass, large * mass, found.sigma, found.speed))
        rate, ratios = found.sigma * found.speed, []
        for exponent in (1.0, 0.63):
            kernel = kinetics.capture(
                "10 nm", mass, moment, "100 K", exponent=exponent, reading="aligned", speed="thermal"
            )
            ratios.append(rate / float(kernel(small * mass, large * mass)))
        error = found.sigma_error / found.sigma
        print(
            f"{small:4} {large:4}   {found.sigma:.3g} ± {error:4.0%}   {rate:14.3g}   ",
            f"{ratios[0]:13.2f} {ratios[1]:8.2f}",
        )
    kernel = kernel_table.measured(rows)
    masses = mass * np.geomspace(SIZES[0], SIZES[-1], 5)
    kernel_table.write_csv(f"{NAME}.csv", kernel, masses)
    kernel_table.write_cgs(f"{NAME}.txt", kernel, masses)
    print(f"wrote {NAME}.csv and {NAME}.txt")


if __name__ == "__main__":
    main()
