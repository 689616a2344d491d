"""Capture cross-sections of two iron grains for different initial conditions, as a table.

The three values in the paper cannot come from one set of initial conditions; the table covers the possible ones.

Run it with:  python examples/cross_sections.py [RELATIVE_ERROR]
RELATIVE_ERROR is 0.01 by default.  The rows are explained in docs/physics/cross-sections.md.
"""

import csv
import math
import sys
import warnings

import numpy as np

import sand
from sand.experiments.scattering import cross_section

IRON = {"radius": "10 nm", "material": sand.IRON, "moment": "200 A m^2/kg", "temperature": "100 K"}
THERMAL = IRON | {"speed": 1, "speed_unit": "thermal"}
PINNING = 0.01
"""Flux density [T] that fixes the moments: a thousand times the field of a grain at the distance b_max."""


def starts():
    """Yield names and options for grains without spin, starting on planes and spheres at several distances."""
    for shape in ("plane", "sphere"):
        for start in ("1 R_m", "2 b_max", "4 b_max", "10 b_max", "20 b_max", "40 b_max"):
            yield f"no spin, {shape}, {start}", THERMAL | {"start": start, "start_shape": shape}
    yield "no spin, aligned at the start, plane, 10 b_max", THERMAL | {"orientation": "aligned"}
    yield "no spin, sticks, plane, 10 b_max", THERMAL | {"outcome": "stick"}


def spins():
    """Yield names and options for grains with thermal spins and for speeds around the thermal speed."""
    for spin in ("kT/2", "equipartition"):
        for start in ("1 R_m", "4 b_max", "10 b_max", "20 b_max"):
            yield f"spin {spin}, plane, {start}", THERMAL | {"spin": spin, "start": start}
    for spin in ("none", "kT/2"):
        for speed in (0.3, 0.5, 2, 3):
            yield f"spin {spin}, plane, 10 b_max, {speed} v_th", THERMAL | {"spin": spin, "speed": speed}
    yield "spin kT/2, 80 K, plane, 10 b_max", THERMAL | {"spin": "kT/2", "temperature": "80 K"}


def pinned():
    """Yield names and options for moments fixed by an external field at angles to the velocity, at 80 K.

    The angles are Gauss-Legendre points of the isotropic mean.
    """
    nodes, weights = np.polynomial.legendre.leggauss(5)
    for cosine, weight in zip(0.5 * (nodes + 1.0), 0.5 * weights, strict=True):
        axis = np.array([cosine, math.sqrt(1.0 - cosine**2), 0.0])
        mass = sand.IRON.density * 4.0 / 3.0 * math.pi * 1e-24
        grain = sand.Grains([[0, 0, 0]], 1e-8, sand.IRON, moment=[200.0 * mass * axis])
        options = {
            "projectile": grain,
            "temperature": "80 K",
            "speed": 1,
            "speed_unit": "thermal",
            "orientation": "given",
            "field": (PINNING * axis).tolist(),
            "start": "10 b_max",
        }
        yield f"pinned by a field at {math.degrees(math.acos(cosine)):.0f} deg, 80 K, weight {weight:.4f}", options


def main(relative_error: float) -> None:
    """Print one row per set of initial conditions, and the mean over the fixed directions."""
    warnings.simplefilter("ignore")
    table = csv.writer(sys.stdout, lineterminator="\n")
    table.writerow(("set-up", "enhancement", "error", "c", "c_error", "flights", "bound", "failed"))
    mean = error = 0.0
    for name, options in (*starts(), *spins(), *pinned()):
        found = cross_section(**options, relative_error=relative_error, seed=1)
        numbers = (found.enhancement, found.enhancement_error, found.c, found.c_error)
        table.writerow((name, *(f"{x:.4g}" for x in numbers), found.flights, found.bound, found.failed))
        sys.stdout.flush()
        if "weight" in name:
            weight = float(name.rsplit(" ", 1)[1])
            mean += weight * found.enhancement
            error += (weight * found.enhancement_error) ** 2
    table.writerow(
        ("pinned by a field in any direction, 80 K", f"{mean:.4g}", f"{math.sqrt(error):.4g}", "", "", "", "", "")
    )


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 0.01)
