"""Collision kernels K(m1, m2) [m³/s] of the coagulation equation.

Clusters of masses m1, m2 and number densities n1, n2 [1/m³] collide at the rate K n1 n2 [1/(m³ s)].  Kernels of
clusters of equal grains depend on N = m/m_grain, which need not be an integer.  `smoluchowski.coagulate` accepts any
function of two arrays; the kernels of this module also have their degree λ, K(am1, am2) = a^λ K(m1, m2).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..basics.arguments import checked
from ..basics.constants import BOLTZMANN
from ..basics.errors import BadInput, did_you_mean
from ..basics.units import si, si_array
from . import growth, magnetic

SPEEDS = ("impact", "thermal")
KernelFunction = Callable[[np.ndarray, np.ndarray], Any]
"""K [m³/s] of two arrays of masses [kg] of the same shape."""


@dataclass(frozen=True)
class CollisionKernel:
    """A collision kernel K(m1, m2) [m³/s] with a name.

    Attributes
    ----------
    name : str
        Description in one line.
    function : KernelFunction
        Symmetric function of two arrays of masses [kg] > 0.
    degree : float or None
        λ; None if the kernel is not homogeneous or λ is unknown.
    """

    name: str
    function: KernelFunction
    degree: float | None = None

    def __call__(self, mass1: Any, mass2: Any) -> Any:
        """Evaluate K.

        Parameters
        ----------
        mass1, mass2 : float or ndarray
            Masses [kg] > 0, broadcast to a common shape.

        Returns
        -------
        float or ndarray
            K [m³/s], of the common shape.

        Raises
        ------
        BadInput
            If a mass is not a number above 0.
        """
        first, second = (si_array(mass, "kg", "mass") for mass in (mass1, mass2))
        if not (first > 0.0).all() or not (second > 0.0).all():
            raise BadInput("masses must be above 0 kg")
        found = self.function(*np.broadcast_arrays(first, second))
        return float(found) if np.ndim(found) == 0 else found


@checked
def constant(rate: Any) -> CollisionKernel:
    """Constant kernel K = `rate` [m³/s] > 0, λ = 0.

    Raises
    ------
    BadInput
        If a parameter is out of range.
    """
    value = si(rate, "m^3/s", "rate", above=0.0)
    return CollisionKernel("constant", lambda m1, m2: np.full(np.shape(m1), value), 0.0)


@checked
def additive(rate: Any, mass: Any) -> CollisionKernel:
    """Additive kernel K = rate (N1 + N2), λ = 1: exponential growth (Golovin 1963).

    Parameters and exceptions as for `product`.
    """
    value, grain = _scale(rate, mass)
    return CollisionKernel("additive", lambda m1, m2: value * (m1 / grain + m2 / grain), 1.0)


@checked
def product(rate: Any, mass: Any) -> CollisionKernel:
    """Product kernel K = rate N1 N2, λ = 2: gelation, an infinite cluster, at the time 1/(n rate).

    Parameters
    ----------
    rate : float or str
        K of two grains [m³/s] > 0.
    mass : float or str
        Mass of a grain [kg] > 0, N = m/mass.

    Raises
    ------
    BadInput
        If a parameter is out of range.
    """
    value, grain = _scale(rate, mass)
    return CollisionKernel("product", lambda m1, m2: value * (m1 / grain) * (m2 / grain), 2.0)


@checked
def power(rate: Any, mass: Any, eta: Any, nu: Any) -> CollisionKernel:
    """Kernel K = rate [(N1^(η/2) + N2^(η/2))/2]² [2N1N2/(N1 + N2)]^ν, λ = η + ν: σ ∝ m^η, v ∝ m^ν of Eq. 20.

    The cross-section is that of radii proportional to m^(η/2), the speed depends on the reduced mass.

    Parameters
    ----------
    rate : float or str
        K of two grains [m³/s] > 0.
    mass : float or str
        Mass of a grain [kg] > 0.
    eta, nu : float
        η and ν, any finite numbers.

    Raises
    ------
    BadInput
        If a parameter is out of range.
    """
    value, grain = _scale(rate, mass)
    half, speed = 0.5 * si(eta, "1", "eta"), si(nu, "1", "nu")

    def function(m1: np.ndarray, m2: np.ndarray) -> np.ndarray:
        n1, n2 = m1 / grain, m2 / grain
        return value * (0.5 * (n1**half + n2**half)) ** 2 * _twice_reduced(n1, n2) ** speed

    return CollisionKernel(f"power, eta = {2 * half:g}, nu = {speed:g}", function, 2.0 * half + speed)


@checked
def mean_speed(mass: Any, temperature: Any) -> float:
    """Mean speed ⟨v⟩ = √(8 k_B T/(π m)) [m/s] of a Maxwell distribution; for relative motion m is the reduced mass.

    Parameters and exceptions as for `magnetic.thermal_speed`.
    """
    return math.sqrt(8.0 / math.pi) * magnetic.thermal_speed(mass, temperature)


@checked
def brownian(radius: Any, mass: Any, temperature: Any, fractal_dimension: Any = 2.0) -> CollisionKernel:
    """Ballistic kernel K = π r² (N1^(1/D) + N2^(1/D))² √(8k_B T/(π m̄)) of thermal clusters of radius r N^(1/D).

    η = 2/D and ν = −1/2 of Eq. 20: z = 2 for D = 2, 6/5 for compact clusters. For D < 2 it is an upper limit, since
    such clusters are more transparent than their enclosing spheres.

    Parameters
    ----------
    radius : float or str
        Radius r of a grain [m] > 0.
    mass : float or str
        Mass of a grain [kg] > 0.
    temperature : float or str
        T [K] > 0.
    fractal_dimension : float, optional
        D, 1 … 3.

    Raises
    ------
    BadInput
        If a parameter is out of range.
    """
    dimension = si(fractal_dimension, "1", "fractal_dimension", least=1.0)
    if dimension > 3.0:
        raise BadInput(f"fractal_dimension = {fractal_dimension!r} must lie in 1 … 3")
    heat = si(temperature, "K", "temperature", above=0.0)
    area = magnetic.geometric_cross_section(si(radius, "m", "radius", above=0.0))
    rate = area * mean_speed(magnetic.reduced_mass(mass), heat)
    kernel = power(rate, mass, 2.0 / dimension, -0.5)
    return CollisionKernel(f"Brownian, D = {dimension:g}", kernel.function, kernel.degree)


@checked
def capture(
    radius: Any,
    mass: Any,
    moment: Any,
    temperature: Any,
    *,
    exponent: Any = growth.REMANENCE,
    reading: str = "paper",
    speed: str = "impact",
    c: Any = 1.0,
) -> CollisionKernel:
    """Kernel K = σ v of magnetic clusters, with σ of Eq. 14 and moments μ = μ1 N^γ (Eq. 16).

    σ = c 3π (α/(k_B T))^(2/3), since the relative motion has m̄v∞² = k_B T for any masses (Eq. 22).

    "impact" uses the speed of the paper (Eq. 21), that of two dipoles at contact, v = √(2α/(m̄ d³)) with d = 2r for any
    N because chains collide with their end grains; λ = η + ν of `growth_exponents`.

    A collision rate, however, is σ(v∞) v∞ with the speed before the attraction. "thermal" is its mean over a Maxwell
    distribution, ⟨σv⟩ = σ(s) s 2^(−1/6) Γ(4/3)/Γ(3/2), s = √(k_B T/m̄); λ = η − 1/2, z = 1.52 for aligned moments.

    Parameters
    ----------
    radius : float or str
        Radius r of a grain [m] > 0.
    mass : float or str
        Mass of a grain [kg] > 0.
    moment : float or str
        Moment μ1 of a grain [A m²] > 0.
    temperature : float or str
        T [K] > 0.
    exponent : float, optional
        γ.
    reading : str, optional
        Interpretation of the weaker interaction of clusters that align slowly, see `growth_exponents`: "aligned",
        "paper", "mass".
    speed : str, optional
        "impact" or "thermal".
    c : float, optional
        Factor of Eq. 27, > 0.

    Raises
    ------
    BadInput
        If a parameter is out of range, or `reading` or `speed` is unknown.
    """
    if speed not in SPEEDS:
        raise BadInput(f"speed = {speed!r}; {did_you_mean(str(speed), SPEEDS)}")
    heat = BOLTZMANN * si(temperature, "K", "temperature", above=0.0)
    grain = si(mass, "kg", "mass", above=0.0)
    contact_distance = 2.0 * si(radius, "m", "radius", above=0.0)
    reduced, factor = magnetic.reduced_mass(grain), si(c, "1", "c", above=0.0)
    alpha = magnetic.potential_parameter(si(moment, "A m^2", "moment", above=0.0))
    thermal = math.sqrt(heat / reduced)
    area = magnetic.capture_cross_section(moment, reduced, thermal, c=factor)
    # α ∝ (N1 N2)^alpha_exponent
    alpha_exponent = 0.5 * growth.squared_exponent(exponent, reading)
    if speed == "impact":
        rate, products = area * math.sqrt(2.0 * alpha / (reduced * contact_distance**3)), 7.0 * alpha_exponent / 6.0
    else:
        average = 2.0 ** (-1.0 / 6.0) * math.gamma(4.0 / 3.0) / math.gamma(1.5)
        rate, products = area * thermal * average, 2.0 * alpha_exponent / 3.0

    def function(m1: np.ndarray, m2: np.ndarray) -> np.ndarray:
        n1, n2 = m1 / grain, m2 / grain
        return rate * (n1**products * n2**products) / np.sqrt(_twice_reduced(n1, n2))

    return CollisionKernel(f"magnetic, {reading}, {speed} speed", function, 2.0 * products - 0.5)


def _twice_reduced(n1: np.ndarray, n2: np.ndarray) -> np.ndarray:
    """2 N1 N2/(N1 + N2), equal to N for N1 = N2 = N; symmetric to the last bit."""
    return 2.0 / (1.0 / n1 + 1.0 / n2)


def _scale(rate: Any, mass: Any) -> tuple[float, float]:
    return si(rate, "m^3/s", "rate", above=0.0), si(mass, "kg", "mass", above=0.0)
