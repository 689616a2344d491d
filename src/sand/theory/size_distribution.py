"""A size distribution over time, as `smoluchowski.coagulate` finds it, and the law that its growth follows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..errors import BadInput
from ..units import si
from .exponents import ExponentFit, Outputs, exponent_fit

FULL, LARGE, LEFT = (
    "all times are reached",
    "the mean size that was asked for is reached",
    "mass leaves through the top of the grid: give larger sizes, or the kernel makes a gel",
)
"""What can become of `coagulate`, `SizeDistribution.outcome`."""


@dataclass(frozen=True)
class SizeDistribution:
    """A size distribution over time, as far as the grid holds it.

    Attributes
    ----------
    times : ndarray
        t (T,) [s], those of the given ones that were reached.
    sizes : ndarray
        x (K,), grains per cluster.
    numbers : ndarray
        n (T, K) [1/m³].
    mean_size : ndarray
        S (T,), Eq. 17, of what is on the grid.
    rate : ndarray
        dS/dt (T,) [1/s], from the equation itself.
    mass : ndarray
        ρ (T,) [kg/m³] on the grid.
    lost : ndarray
        (T,) [kg/m³] gone through the top of the grid; mass + lost is constant to rounding.
    loss_rate : ndarray
        (T,) [kg/(m³ s)], d lost/dt.
    outcome : str
        one of `FULL`, `LARGE`, `LEFT`; but for `FULL` there are fewer times than asked for.
    solve_tighter : Callable[[ndarray], SizeDistribution] or None
        solves the equation once more up to the given times [s], with a tenth of the tolerance.
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
        """For copies in other processes, where the functions that kernels are made of cannot go."""
        return self.__dict__ | {"solve_tighter": None}

    @cached_property
    def _tighter(self) -> SizeDistribution:
        """The same outputs of a solution with a tenth of the tolerance."""
        if self.solve_tighter is None:
            raise BadInput("a copy has no kernel to solve with once more; ask the original for its exponent first")
        return self.solve_tighter(self.times)

    @property
    def slope(self) -> np.ndarray:
        """d ln S/d ln t (T,), the local z of Eq. 18; it comes to z late, as z t/(t + τ) does."""
        return self.times * self.rate / self.mean_size

    def exponent(self, decades: float = 1.0) -> float:
        """z of S ∝ (t − t0)^z over the last decades of S: 1 − 1/z is the slope of ln(dS/dt) over ln S (Eq. 20).

        No t0 has to be known, so that this comes to z much sooner than `slope` does.  `exponent_fit` tells its error.

        Parameters
        ----------
        decades : float, optional
            how much of S, > 0.

        Raises
        ------
        BadInput
            fewer than three outputs there, or S grows faster than any power, as far as the error of the
            slope can tell.
        """
        fit = self.exponent_fit(decades)
        if not np.isfinite(fit.high):
            raise BadInput(
                f"dS/dt grows as S^({fit.degree:.3f} ± {fit.reach:.1g}): faster than any power of time, "
                "or not to be told from it"
            )
        return fit.exponent

    def exponent_fit(self, decades: float = 1.0) -> ExponentFit:
        """z as by `exponent`, with its 95 % interval, which is open where S may grow faster than any power.

        The equation is solved once more, ten times more exactly, when this is first called.

        Parameters
        ----------
        decades : float, optional
            how much of S, > 0.

        Raises
        ------
        BadInput
            fewer than three outputs there, or outputs that S hardly differs between.
        """
        size = np.log10(self.mean_size)
        first = size.max(initial=0.0) - si(decades, "1", "decades", above=0.0)
        late = (self.rate > 0.0) & (size >= first - 1e-9)  # an output at the edge counts, whatever its last digits
        if late.sum() < 3:
            raise BadInput(
                f"{late.sum()} outputs in the last {decades:g} decades of S; give more times, or more decades"
            )
        tighter = Outputs(self._tighter.mean_size[late], self._tighter.rate[late])
        whole = Outputs(*(values[late] for values in self._whole()))
        return exponent_fit(Outputs(self.mean_size[late], self.rate[late]), (tighter, whole), len(self.sizes))

    def _whole(self) -> tuple[np.ndarray, np.ndarray]:
        """S and dS/dt [1/s] if what left the grid were still there, in clusters of the largest size."""
        largest, total = self.sizes[-1], self.mass + self.lost
        gained = self.rate * self.mass + (largest - self.mean_size) * self.loss_rate
        return (self.mean_size * self.mass + largest * self.lost) / total, gained / total
