"""Collision kernels K(m1, m2) [m³/s]: how many pairs of two masses meet, per volume, second and both densities.

Two clusters of masses m1, m2 and densities n1, n2 [1/m³] meet K n1 n2 times in a cubic metre and second.  Kernels of
clusters made of equal grains count them, N = m/m_grain; N need not be whole.  `smoluchowski.coagulate` takes any
function of two arrays; those made here also know their degree λ, K(am1, am2) = a^λ K(m1, m2).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arguments import checked
from ..constants import BOLTZMANN
from ..errors import BadInput, did_you_mean
from ..units import si
from . import growth, magnetic

SPEEDS = ("impact", "thermal")
Rate = Callable[[np.ndarray, np.ndarray], Any]
"""K [m³/s] of two arrays of masses [kg] of the same shape."""


@dataclass(frozen=True)
class CollisionKernel:
    """A function K(m1, m2) [m³/s] with a name.

    Attributes
    ----------
    name : str
        one line for people.
    function : Rate
        of two arrays of masses [kg] > 0, symmetric.
    degree : float or None
        λ; None if the kernel is not homogeneous, or it is not known.
    """

    name: str
    function: Rate
    degree: float | None = None

    def __call__(self, mass1: Any, mass2: Any) -> Any:
        """K [m³/s], of the shape that the masses [kg] have together.  Raises BadInput for masses not above 0."""
        try:
            first, second = np.asarray(mass1, float), np.asarray(mass2, float)
        except (TypeError, ValueError):
            raise BadInput("masses must be numbers, in kg") from None
        if not (first > 0.0).all() or not (second > 0.0).all():
            raise BadInput("masses must be above 0 kg")
        found = self.function(*np.broadcast_arrays(first, second))
        return float(found) if np.ndim(found) == 0 else found


@checked
def constant(rate: Any) -> CollisionKernel:
    """K = `rate` [m³/s] > 0, λ = 0.  Raises BadInput."""
    value = si(rate, "m^3/s", "rate", above=0.0)
    return CollisionKernel("constant", lambda m1, m2: np.full(np.shape(m1), value), 0.0)


@checked
def additive(rate: Any, mass: Any) -> CollisionKernel:
    """K = rate (N1 + N2), λ = 1: the size grows exponentially (Golovin 1963).  Arguments as for `product`."""
    value, grain = _scale(rate, mass)
    return CollisionKernel("additive", lambda m1, m2: value * (m1 / grain + m2 / grain), 1.0)


@checked
def product(rate: Any, mass: Any) -> CollisionKernel:
    """K = rate N1 N2, λ = 2: a gel, one cluster of all, after 1/(n rate).

    Parameters
    ----------
    rate
        [m³/s] > 0.
    mass
        of a grain [kg] > 0, N = m/mass.

    Raises
    ------
    BadInput
        out of range.
    """
    value, grain = _scale(rate, mass)
    return CollisionKernel("product", lambda m1, m2: value * (m1 / grain) * (m2 / grain), 2.0)


@checked
def power(rate: Any, mass: Any, eta: Any, nu: Any) -> CollisionKernel:
    """K = rate [(N1^(η/2) + N2^(η/2))/2]² [2N1N2/(N1 + N2)]^ν: σ ∝ m^η and v ∝ m^ν of Eq. 20; λ = η + ν.

    Radii that go as m^(η/2) add up in σ, and v follows the reduced mass.

    Parameters
    ----------
    rate
        K of two grains [m³/s] > 0.
    mass
        of a grain [kg] > 0.
    eta, nu
        any numbers.

    Raises
    ------
    BadInput
        out of range.
    """
    value, grain = _scale(rate, mass)
    half, speed = 0.5 * si(eta, "1", "eta"), si(nu, "1", "nu")

    def function(m1: np.ndarray, m2: np.ndarray) -> np.ndarray:
        n1, n2 = m1 / grain, m2 / grain
        return value * (0.5 * (n1**half + n2**half)) ** 2 * _twice_reduced(n1, n2) ** speed

    return CollisionKernel(f"power, eta = {2 * half:g}, nu = {speed:g}", function, 2.0 * half + speed)


@checked
def mean_speed(mass: Any, temperature: Any) -> float:
    """⟨v⟩ = √(8 k_B T/(π m)) [m/s], Maxwell's; with the reduced mass, that of two bodies' relative motion.

    Arguments and errors as for `magnetic.thermal_speed`.
    """
    return math.sqrt(8.0 / math.pi) * magnetic.thermal_speed(mass, temperature)


@checked
def brownian(radius: Any, mass: Any, temperature: Any, fractal_dimension: Any = 2.0) -> CollisionKernel:
    """K = π r² (N1^(1/D) + N2^(1/D))² √(8k_B T/(π m̄)): clusters of radius r N^(1/D) in free molecular flow.

    η = 2/D and ν = −1/2 of Eq. 20: z = 2 for D = 2, 6/5 for compact ones.  Below D = 2 it is an upper bound: the
    clusters are more transparent than the spheres around them.

    Parameters
    ----------
    radius
        r of a grain [m] > 0.
    mass
        of a grain [kg] > 0.
    temperature
        T [K] > 0.
    fractal_dimension : optional
        D, 1 … 3.

    Raises
    ------
    BadInput
        out of range.
    """
    dimension = si(fractal_dimension, "1", "fractal_dimension", least=1.0)
    if dimension > 3.0:
        raise BadInput(f"fractal_dimension = {fractal_dimension!r} must lie in 1 … 3")
    heat = si(temperature, "K", "temperature", above=0.0)
    area = magnetic.geometric_cross_section(si(radius, "m", "radius", above=0.0))
    rate = area * mean_speed(magnetic.reduced_mass(mass), heat)
    made = power(rate, mass, 2.0 / dimension, -0.5)
    return CollisionKernel(f"Brownian, D = {dimension:g}", made.function, made.degree)


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
    """σ v of magnetic clusters, σ of Eq. 14 and μ = μ1 N^γ (Eq. 16).

    σ = c 3π (α/(k_B T))^(2/3): the relative motion has the energy m̄v∞² = k_B T, whatever the masses (Eq. 22).
    "impact" takes for v what the paper does (Eq. 21), the speed of two dipoles that touch, √(2α/(m̄ d³)), d = 2r for
    any N since chains touch with their end grains: λ = η + ν of `growth_exponents`.  A rate of collisions is
    σ(v∞) v∞, with the speed before the attraction, though: "thermal" is that, averaged over Maxwell's distribution,
    ⟨σv⟩ = σ(s) s 2^(−1/6) Γ(4/3)/Γ(3/2), s = √(k_B T/m̄): λ = η − 1/2, z = 1.52 with aligned moments.

    Parameters
    ----------
    radius
        r of a grain [m] > 0.
    mass
        of a grain [kg] > 0.
    moment
        μ1 of a grain [A m²] > 0.
    temperature
        T [K] > 0.
    exponent : optional
        γ.
    reading : str, optional
        what becomes of μ1μ2 as clusters align more slowly, see `growth_exponents`: "aligned", "paper", "mass".
    speed : str, optional
        "impact" or "thermal".
    c : optional
        of Eq. 27, > 0.

    Raises
    ------
    BadInput
        out of range, an unknown word.
    """
    if speed not in SPEEDS:
        raise BadInput(f"speed = {speed!r}; {did_you_mean(str(speed), SPEEDS)}")
    heat = BOLTZMANN * si(temperature, "K", "temperature", above=0.0)
    grain = si(mass, "kg", "mass", above=0.0)
    touch = 2.0 * si(radius, "m", "radius", above=0.0)
    reduced, factor = magnetic.reduced_mass(grain), si(c, "1", "c", above=0.0)
    alpha = magnetic.potential_parameter(si(moment, "A m^2", "moment", above=0.0))
    thermal = math.sqrt(heat / reduced)
    area = magnetic.capture_cross_section(moment, reduced, thermal, c=factor)
    # α ∝ (N1 N2)^each
    each = 0.5 * growth.squared_exponent(exponent, reading)
    if speed == "impact":
        rate, products = area * math.sqrt(2.0 * alpha / (reduced * touch**3)), 7.0 * each / 6.0
    else:
        average = 2.0 ** (-1.0 / 6.0) * math.gamma(4.0 / 3.0) / math.gamma(1.5)
        rate, products = area * thermal * average, 2.0 * each / 3.0

    def function(m1: np.ndarray, m2: np.ndarray) -> np.ndarray:
        n1, n2 = m1 / grain, m2 / grain
        return rate * (n1**products * n2**products) / np.sqrt(_twice_reduced(n1, n2))

    return CollisionKernel(f"magnetic, {reading}, {speed} speed", function, 2.0 * products - 0.5)


def _twice_reduced(n1: np.ndarray, n2: np.ndarray) -> np.ndarray:
    """2 N1 N2/(N1 + N2), which is N for N1 = N2 = N; the same to the last bit in either order."""
    return 2.0 / (1.0 / n1 + 1.0 / n2)


def _scale(rate: Any, mass: Any) -> tuple[float, float]:
    return si(rate, "m^3/s", "rate", above=0.0), si(mass, "kg", "mass", above=0.0)
