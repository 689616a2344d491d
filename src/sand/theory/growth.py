"""Power laws of the growth of magnetic aggregates: sections 3.2 and 3.3 of the paper (Eqs. 15–25)."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..basics.arguments import checked
from ..basics.errors import BadInput, did_you_mean
from ..basics.units import si

REMANENCE = 0.63
"""γ of Eq. 16, from the paper's simulations of accretional remanence."""
READINGS = ("aligned", "paper", "mass")
"""Interpretations of section 3.3, see `growth_exponents`."""


@checked
def chain_moment(moment: Any, grains: int) -> float:
    """Moment of a chain with parallel moments, μ_chain = N μ [A m²] (Eq. 15).

    Parameters
    ----------
    moment : float or str
        Moment of one grain, μ [A m²] ≥ 0.
    grains : int
        N ≥ 1.

    Raises
    ------
    BadInput
        If a parameter is out of range.
    """
    return aggregate_moment(moment, grains, 1.0)


@checked
def aggregate_moment(moment: Any, grains: Any, exponent: float = REMANENCE) -> float:
    """Moment of an aggregate, μ_agg = μ N^γ [A m²] (Eq. 16).

    Parameters
    ----------
    moment : float or str
        Moment of one grain, μ [A m²] ≥ 0.
    grains : float
        N ≥ 1.
    exponent : float, optional
        γ from 0 to 1; 0.5 for random orientations, 0.63 in the paper, 1 for parallel moments.

    Raises
    ------
    BadInput
        If a parameter is out of range.
    """
    return si(moment, "A m^2", "moment", least=0.0) * si(grains, "1", "grains", least=1.0) ** si(
        exponent, "1", "exponent", least=0.0, most=1.0
    )


@checked
def mean_size(sizes: np.ndarray, numbers: np.ndarray | None = None) -> float:
    """Mean cluster size S = Σ s² n_s/Σ s n_s (Eq. 17): the mean, over all grains, of the size of their cluster.

    Parameters
    ----------
    sizes : ndarray
        s (K,) ≥ 1, grains per cluster.
    numbers : ndarray or None, optional
        n_s (K,) ≥ 0, number of clusters of each size; 1 by default.

    Raises
    ------
    BadInput
        If there are no clusters, or a size is below 1.
    """
    s = np.asarray(sizes, float)
    n = np.ones_like(s) if numbers is None else np.asarray(numbers, float)
    if s.ndim != 1 or s.shape != n.shape or not (s >= 1.0).all() or not (n >= 0.0).all() or not n.sum() > 0.0:
        raise BadInput("sizes must be at least 1; numbers must be at least 0, not all 0, and one for each size")
    if not (s * s * n).sum() < math.inf:
        raise BadInput("sizes and numbers must be finite")
    return float((s * s * n).sum() / (s * n).sum())


@checked
def dynamic_exponent(eta: float, nu: float) -> float:
    """Dynamic exponent z = 1/(1 − η − ν) (Eq. 20): S ∝ t^z if σ ∝ m^η and v ∝ m^ν.

    Parameters
    ----------
    eta, nu : float
        Exponents of cross-section and speed, η + ν < 1. For η + ν = 1 growth is exponential, above it S diverges at a
        finite time.

    Raises
    ------
    BadInput
        If η + ν ≥ 1.
    """
    first, second = si(eta, "1", "eta"), si(nu, "1", "nu")
    total = first + second
    rest = 1.0 - total
    # the floating-point sum 0.1 + 0.7 + 0.2 is slightly below 1
    if not rest > 4.0 * np.finfo(float).eps * (1.0 + abs(first) + abs(second)):
        raise BadInput(f"eta + nu = {total:g} must be below 1; otherwise growth is not a power of time")
    return 1.0 / rest


class Exponents(NamedTuple):
    """Exponents of cross-section, speed and mean size: σ ∝ m^η, v ∝ m^ν, S ∝ t^z."""

    eta: float
    nu: float
    z: float


@checked
def growth_exponents(exponent: float = REMANENCE, reading: str = "paper", *, rounded: bool = False) -> Exponents:
    """Exponents η, ν and z of magnetic growth (Eqs. 20–25).

    With μ ∝ m^γ, v ∝ μ/√m and σ ∝ μ^(4/3): ν = γ − 1/2 = 0.13 and η = 4γ/3 = 0.84 (Eqs. 21, 22), hence z = 33. In the
    paper the relaxation time τ ∝ m^(1−γ) (Eq. 23) then weakens the interaction.

    Parameters
    ----------
    exponent : float, optional
        γ (Eq. 16).
    reading : str, optional
        Interpretation of the weakened interaction μ². "aligned": not weakened, μ². "paper": μ^(2−(1−γ)); an exponent
        of mass is subtracted from an exponent of moment (Eqs. 24, 25), which gives 0.0135, 0.685 and z = 3.31. "mass":
        m^(2γ−(1−γ)), both are exponents of mass; z = 2.17.
    rounded : bool, optional
        Round ν and η to two digits before computing z; z = 3.2 of the paper follows from 0.01 + 0.68.

    Returns
    -------
    Exponents
        η, ν and z.

    Raises
    ------
    BadInput
        If the reading is unknown, or η + ν ≥ 1.
    """
    square = squared_exponent(exponent, reading)
    eta, nu = 2.0 * square / 3.0, 0.5 * (square - 1.0)
    if rounded:
        eta, nu = round(eta, 2), round(nu, 2)
    return Exponents(eta, nu, dynamic_exponent(eta, nu))


@checked
def squared_exponent(exponent: float = REMANENCE, reading: str = "paper") -> float:
    """Exponent of mass of the effective μ² in section 3.3: 1.26 for "aligned", 1.03 for "paper", 0.89 for "mass".

    Parameters and exceptions as for `growth_exponents`.
    """
    if reading not in READINGS:
        raise BadInput(f"reading = {reading!r}; {did_you_mean(str(reading), READINGS)}")
    exponent = si(exponent, "1", "exponent")
    reduction = alignment_exponent(exponent)
    return {
        "aligned": 2.0 * exponent,
        "paper": (2.0 - reduction) * exponent,
        "mass": 2.0 * exponent - reduction,
    }[reading]


@checked
def alignment_exponent(exponent: float = REMANENCE) -> float:
    """Exponent 1 − γ of the relaxation time τ ∝ m^(1−γ) (Eq. 23): 0.37 for the γ of the paper."""
    return 1.0 - si(exponent, "1", "exponent")


@checked
def alignment_time(inertia: Any, moment: Any, flux_density: Any, angle: Any = 0.5 * math.pi) -> float:
    """Time τ = √(2φ I/(μB)) [s] to rotate by φ from rest under the largest torque μB; Eq. 23 omits the factor √2.

    Parameters
    ----------
    inertia : float or str
        Moment of inertia I [kg m²] > 0.
    moment : float or str
        μ [A m²] > 0.
    flux_density : float or str
        B [T] > 0.
    angle : float or str, optional
        φ > 0 [rad], or text with a unit, such as "90 deg".

    Raises
    ------
    BadInput
        If a parameter is out of range.
    """
    torque = si(moment, "A m^2", "moment", above=0.0) * si(flux_density, "T", "flux_density", above=0.0)
    return math.sqrt(2.0 * si(angle, "rad", "angle", above=0.0) * si(inertia, "kg m^2", "inertia", above=0.0) / torque)
