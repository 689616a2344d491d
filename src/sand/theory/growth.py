"""How magnetic aggregates grow, by power laws: sections 3.2 and 3.3 of the paper (Eqs. 15–25)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..arguments import checked
from ..errors import BadInput, did_you_mean
from ..units import si

REMANENCE = 0.63
"""γ of Eq. 16: what the paper's simulations of accretional remanence gave."""
READINGS = ("aligned", "paper", "mass")


@checked
def chain_moment(moment: Any, grains: int) -> float:
    """μ_chain = N μ [A m²] (Eq. 15), all moments parallel.  μ ≥ 0, N ≥ 1; raises BadInput."""
    return aggregate_moment(moment, grains, 1.0)


@checked
def aggregate_moment(moment: Any, grains: Any, exponent: float = REMANENCE) -> float:
    """μ_agg = μ N^γ [A m²] (Eq. 16).

    Parameters
    ----------
    moment
        of one grain, μ [A m²] ≥ 0.
    grains
        N ≥ 1.
    exponent : float, optional
        γ; 0.5 for moments at random, 0.63 in the paper, 1 for all parallel.

    Raises
    ------
    BadInput
        out of range.
    """
    return si(moment, "A m^2", "moment", least=0.0) * si(grains, "1", "grains", least=1.0) ** si(
        exponent, "1", "exponent"
    )


@checked
def mean_size(sizes: Sequence[float] | np.ndarray, numbers: Sequence[float] | np.ndarray | None = None) -> float:
    """S = Σ s² n_s/Σ s n_s (Eq. 17), the size of the cluster that a grain picked at random is in.

    Parameters
    ----------
    sizes : Sequence[float] or ndarray
        s (K,) ≥ 1, grains per cluster.
    numbers : Sequence[float] or ndarray or None, optional
        n_s (K,) ≥ 0, how many clusters of each; one each by default.

    Raises
    ------
    BadInput
        none at all, or a size below 1.
    """
    try:
        s = np.asarray(sizes, float)
        n = np.ones_like(s) if numbers is None else np.asarray(numbers, float)
    except (TypeError, ValueError):
        raise BadInput("sizes and numbers must be numbers") from None
    if s.ndim != 1 or s.shape != n.shape or not (s >= 1.0).all() or not (n >= 0.0).all() or not n.sum() > 0.0:
        raise BadInput("sizes must be at least 1 and numbers at least 0, as many of these as of those, and not all 0")
    return float((s * s * n).sum() / (s * n).sum())


@checked
def dynamic_exponent(eta: float, nu: float) -> float:
    """z = 1/(1 − η − ν), from η + ν = (z − 1)/z (Eq. 20): S ∝ t^z if σ ∝ m^η and v ∝ m^ν.

    Parameters
    ----------
    eta, nu : float
        exponents of cross-section and speed, η + ν < 1 (from 1 on growth runs away in finite time).

    Raises
    ------
    BadInput
        η + ν ≥ 1.
    """
    first, second = si(eta, "1", "eta"), si(nu, "1", "nu")
    both = first + second
    rest = 1.0 - both
    # 0.1 + 0.7 + 0.2 is a little below 1 to a computer
    if not rest > 4.0 * np.finfo(float).eps * (1.0 + abs(first) + abs(second)):
        raise BadInput(f"eta + nu = {both:g} must be below 1: from there on growth is no power of time")
    return 1.0 / rest


class Exponents(NamedTuple):
    """σ ∝ m^η, v ∝ m^ν, S ∝ t^z."""

    eta: float
    nu: float
    z: float


@checked
def growth_exponents(exponent: float = REMANENCE, reading: str = "paper", *, rounded: bool = False) -> Exponents:
    """η, ν and z of magnetic growth (Eqs. 20–25).

    With μ ∝ m^γ, v ∝ μ/√m and σ ∝ μ^(4/3): ν = γ − 1/2, η = 4γ/3 (Eqs. 21, 22), 0.13 and 0.84, which makes z = 33.
    The paper then lets the relaxation time τ ∝ m^(1−γ) (Eq. 23) weaken the interaction.

    Parameters
    ----------
    exponent : float, optional
        γ (Eq. 16).
    reading : str, optional
        what becomes of μ². "aligned": nothing; "paper": μ^(2−(1−γ)), the exponent of a mass taken off that
        of a moment (Eqs. 24, 25): 0.0135, 0.685 and z = 3.31; "mass": m^(2γ−(1−γ)), both exponents of the mass:
        z = 2.17.
    rounded : bool, optional
        ν and η to two digits before z is formed; the paper's 3.2 comes from 0.01 + 0.68.

    Raises
    ------
    BadInput
        an unknown reading, or η + ν ≥ 1.
    """
    square = squared_exponent(exponent, reading)
    eta, nu = 2.0 * square / 3.0, 0.5 * (square - 1.0)
    if rounded:
        eta, nu = round(eta, 2), round(nu, 2)
    return Exponents(eta, nu, dynamic_exponent(eta, nu))


@checked
def squared_exponent(exponent: float = REMANENCE, reading: str = "paper") -> float:
    """The exponent of what acts as μ² ∝ m^… in each reading of section 3.3: 1.26 aligned, 1.03 paper, 0.89 mass.

    Arguments and errors as for `growth_exponents`.
    """
    if reading not in READINGS:
        raise BadInput(f"reading = {reading!r}; {did_you_mean(str(reading), READINGS)}")
    exponent = si(exponent, "1", "exponent")
    lost = alignment_exponent(exponent)
    return {
        "aligned": 2.0 * exponent,
        "paper": (2.0 - lost) * exponent,
        "mass": 2.0 * exponent - lost,
    }[reading]


@checked
def alignment_exponent(exponent: float = REMANENCE) -> float:
    """1 − γ, the exponent of τ ∝ m^(1−γ) (Eq. 23): 0.37."""
    return 1.0 - si(exponent, "1", "exponent")


@checked
def alignment_time(inertia: Any, moment: Any, flux_density: Any, angle: float = 0.5 * math.pi) -> float:
    """τ = √(2φ I/(μB)) [s], to turn through φ from rest at the greatest torque; Eq. 23 leaves out the √2.

    Parameters
    ----------
    inertia
        I [kg m²] > 0.
    moment
        μ [A m²] > 0.
    flux_density
        B [T] > 0.
    angle : float, optional
        φ [rad] > 0.

    Raises
    ------
    BadInput
        out of range.
    """
    torque = si(moment, "A m^2", "moment", above=0.0) * si(flux_density, "T", "flux_density", above=0.0)
    return math.sqrt(2.0 * si(angle, "1", "angle", above=0.0) * si(inertia, "kg m^2", "inertia", above=0.0) / torque)
