"""Physical constants, CODATA 2018 (SI)."""

import math

LIGHT = 299792458.0
"""Speed of light c [m/s], exact."""

BOLTZMANN = 1.380649e-23
"""Boltzmann constant k_B [J/K], exact."""

MAGNETIC = 1.25663706212e-6 / (4.0 * math.pi)
"""Magnetic constant μ0/4π [T m/A]; 1e-7 to ten digits."""

COULOMB = 1.0 / (4.0 * math.pi * 8.8541878128e-12)
"""Coulomb constant 1/(4πε₀) [N m²/C²]."""

GRAVITATION = 6.67430e-11
"""Gravitational constant G [N m²/kg²]."""
