"""Solution of the coagulation equation: the size distribution as a function of time, and its growth law."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..basics.errors import BadInput
from ..basics.units import si
from .exponents import ExponentFit, Outputs, exponent_fit

COMPLETED, SIZE_REACHED, MASS_LOST = (
    "all times are reached",
    "the requested mean size is reached",
    "mass leaves the grid at the largest size: use larger sizes; the kernel may lead to gelation",
)
"""Values of `SizeDistribution.outcome`."""


@dataclass(frozen=True)
class SizeDistribution:
    """A size distribution as a function of time, on the grid of sizes.

    Attributes
    ----------
    times : ndarray
        t (T,) [s], the requested outputs that were reached.
    sizes : ndarray
        x (K,), grains per cluster.
    numbers : ndarray
        n (T, K) [1/m³].
    mean_size : ndarray
        S (T,), Eq. 17, of the mass on the grid.
    rate : ndarray
        dS/dt (T,) [1/s], from the equation itself.
    mass : ndarray
        ρ (T,) [kg/m³] on the grid.
    lost : ndarray
        (T,) [kg/m³], mass that left the grid at the largest size; mass + lost is constant to rounding.
    loss_rate : ndarray
        (T,) [kg/(m³ s)], d lost/dt.
    outcome : str
        `COMPLETED`; or `SIZE_REACHED` or `MASS_LOST`, with fewer times than requested.
    solve_tighter : Callable[[ndarray], SizeDistribution] or None
        Solves the equation again for the given times [s], with a tenth of the tolerance.
    """

    times: np.ndarray
    sizes: np.ndarray
    numbers: np.ndarray
    mean_size: np.ndarray
    rate: np.ndarray
    mass: np.ndarray
    lost: np.ndarray
    loss_rate: np.ndarray
    outcome: str
    solve_tighter: Callable[[np.ndarray], SizeDistribution] | None = field(default=None, repr=False, compare=False)

    def __getstate__(self) -> dict[str, Any]:
        """State for pickling, without the kernel, whose functions cannot be pickled."""
        return self.__dict__ | {"solve_tighter": None}

    @cached_property
    def _tighter(self) -> SizeDistribution:
        """The solution at the same times with a tenth of the tolerance."""
        if self.solve_tighter is None:
            raise BadInput("a copy has no kernel to solve the equation again; call exponent() on the original first")
        return self.solve_tighter(self.times)

    @property
    def slope(self) -> np.ndarray:
        """Logarithmic slope d ln S/d ln t (T,), the local z of Eq. 18; converges slowly, as z t/(t + τ)."""
        return self.times * self.rate / self.mean_size

    @property
    def local_degree(self) -> np.ndarray:
        """Local degree λ(S) = d ln(dS/dt)/d ln S (T,), from differences between outputs; at least three with S rising.

        It tends to the degree of a homogeneous kernel, independent of the origin of time.

        Raises
        ------
        BadInput
            If there are fewer than three outputs, or S does not rise between them.
        """
        if len(self.times) < 3 or not (np.diff(self.mean_size) > 0.0).all() or not (self.rate > 0.0).all():
            raise BadInput("a local degree needs at least three outputs between which S rises")
        return np.gradient(np.log(self.rate), np.log(self.mean_size))

    def exponent(self, decades: float = 1.0) -> float:
        """Dynamic exponent z of S ∝ (t − t0)^z over the last decades of S, from dS/dt ∝ S^(1 − 1/z) (Eq. 20).

        Independent of t0, hence it converges much faster than `slope`. `exponent_fit` also gives its error.

        Parameters
        ----------
        decades : float, optional
            Fitted range of S in decades, > 0.

        Raises
        ------
        BadInput
            If the range has fewer than three outputs, or S grows faster than any power within the error of the slope.
        """
        fit = self.exponent_fit(decades)
        if not np.isfinite(fit.high):
            raise BadInput(
                f"dS/dt grows as S^({fit.degree:.3f} ± {fit.half_width:.1g}): "
                "within its error faster than any power of time"
            )
        return fit.exponent

    def exponent_fit(self, decades: float = 1.0) -> ExponentFit:
        """Dynamic exponent z with its 95 % interval, which is unbounded if S may grow faster than any power.

        The first call solves the equation again with a tenth of the tolerance.

        Parameters
        ----------
        decades : float, optional
            Fitted range of S in decades, > 0.

        Raises
        ------
        BadInput
            If the range has fewer than three outputs, or S hardly changes between them.
        """
        size = np.log10(self.mean_size)
        first = size.max(initial=0.0) - si(decades, "1", "decades", above=0.0)
        late = (self.rate > 0.0) & (size >= first - 1e-9)  # include outputs at the limit in spite of rounding
        if late.sum() < 3:
            raise BadInput(
                f"{late.sum()} outputs in the last {decades:g} decades of S, at least 3 are needed; "
                "use more times, or more decades"
            )
        tighter = Outputs(self._tighter.mean_size[late], self._tighter.rate[late])
        complete = Outputs(*(values[late] for values in self._with_lost_mass()))
        return exponent_fit(Outputs(self.mean_size[late], self.rate[late]), (tighter, complete), len(self.sizes))

    def _with_lost_mass(self) -> tuple[np.ndarray, np.ndarray]:
        """S and dS/dt [1/s] with the mass that left the grid counted as clusters of the largest size."""
        largest, total = self.sizes[-1], self.mass + self.lost
        total_rate = self.rate * self.mass + (largest - self.mean_size) * self.loss_rate
        return (self.mean_size * self.mass + largest * self.lost) / total, total_rate / total
