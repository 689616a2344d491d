"""Mean capture rate of two magnetic iron grains whose translation and rotation have different temperatures, as a table.

Run it with:  python examples/thermal_capture.py [RELATIVE_ERROR] [T:E ...]
Each T:E is a temperature of translation [K] and a mean energy of rotation of each grain [k_B times 1 K]: 100:50 is
k_B T/2 at 100 K, the spin of Dominik & Nübold (2002); 100:150 is equipartition.  RELATIVE_ERROR of each cross-section
is 0.02 by default.
"""

import csv
import math
import sys
import warnings

import numpy as np
from scipy.special import gamma, roots_genlaguerre

import sand
from sand import theory
from sand.basics.constants import BOLTZMANN
from sand.experiments.scattering import cross_section

GRAIN = {"radius": "10 nm", "material": sand.IRON, "moment": "200 A m^2/kg"}
MASS = sand.IRON.density * 4.0 / 3.0 * math.pi * 1e-24
REDUCED = theory.reduced_mass(MASS)
NODES = 6
"""Speeds of each mean."""
DEFAULT = ("100:50", "100:150", "100:250", "100:500", "100:1000", "100:2000", "100:3700")


def mean_rate(temperature, energy, relative_error):
    """Return ⟨σv⟩ [m³/s], its error, and c at each speed, as rows (speed in √(k_B T/m), c, error).

    ⟨σv⟩ over Maxwell's distribution, x = m̄v²/2k_BT: (2/√π) ∫ σ v √x e^(-x) dx. With σ = c 3π (α/m̄v²)^(2/3) the
    integrand is c x^(1/3) e^(-x) times constants, for which Gauss-Laguerre nodes of the weight x^(1/3) e^(-x) are best.
    """
    x, weight = roots_genlaguerre(NODES, 1.0 / 3.0)
    spread = math.sqrt(BOLTZMANN * temperature / REDUCED)
    rows = []
    for node in x:
        speed = spread * math.sqrt(2.0 * node)
        # equipartition at T has 3/2 k_B T of rotation
        spin = {"temperature": energy / 1.5, "spin": "equipartition"}
        found = cross_section(**GRAIN, **spin, speed=speed, relative_error=relative_error, seed=1)
        rows.append((speed / math.sqrt(BOLTZMANN * temperature / MASS), found.c, found.c_error))
    share = weight / weight.sum()
    c = float(share @ [row[1] for row in rows])
    error = math.sqrt(float(share**2 @ np.square([row[2] for row in rows])))
    analytic = theory.capture_cross_section(200.0 * MASS, REDUCED, spread) * spread
    analytic *= 2.0 ** (-1.0 / 6.0) * gamma(4.0 / 3.0) / gamma(1.5)
    return c, error, c * analytic, rows


def main(relative_error, pairs):
    """Print one row for each pair of temperatures: c, its error, ⟨σv⟩, and c at each speed."""
    warnings.simplefilter("ignore")
    table = csv.writer(sys.stdout, lineterminator="\n")
    table.writerow(("T translation [K]", "rotation [K k_B]", "c", "error", "mean rate [m3/s]", "c at v/v_th"))
    for pair in pairs:
        temperature, energy = map(float, pair.split(":"))
        c, error, rate, rows = mean_rate(temperature, energy, relative_error)
        at = " ".join(f"{value:.3f} at {speed:.2f};" for speed, value, _ in rows)
        table.writerow((f"{temperature:g}", f"{energy:g}", f"{c:.4f}", f"{error:.4f}", f"{rate:.4g}", at.rstrip(";")))
        sys.stdout.flush()


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 0.02, sys.argv[2:] or DEFAULT)
