"""Bodies in a volume, of which pairs are drawn in proportion to K̂."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from .dilute_body import Body
from .dilute_majorant import Majorant, Sizes

SPARE_COLUMNS = 64
"""Columns by which the arrays are enlarged when all belong to bodies."""


class Population:
    """Bodies in a volume V, each of which stands for all of its kind.

    Parameters
    ----------
    bodies : sequence of Body
        At least two.
    volume : float
        V [m³].
    majorant : Majorant
        K̂ of two bodies.
    sums : ndarray or None, optional
        Σ_j K̂_ij of each body, of a checkpoint.

    Attributes
    ----------
    start : int
        Number of bodies at the start; when half of it is left, all are copied (`double`).
    doublings : int
        How often.
    """

    def __init__(
        self, bodies: Sequence[Body], volume: float, majorant: Majorant, sums: np.ndarray | None = None, start: int = 0
    ):
        self.bodies, self.volume, self.majorant, self.doublings = list(bodies), volume, majorant, 0
        self.start = start or len(self.bodies)
        self._table = np.array([sizes_of(body) for body in self.bodies]).T
        self._grains = np.array([len(body) for body in self.bodies], float)
        self._rotation = np.array([body.rotation for body in self.bodies])
        self._sums = self._new_sums() if sums is None else sums.copy()

    @property
    def sizes(self) -> Sizes:
        """Sizes of all bodies (N,)."""
        return Sizes(*self._table[:, : len(self.bodies)])

    @property
    def sums(self) -> np.ndarray:
        """Σ_j K̂_ij of each body (N,) [m³/s]; changed in O(N) by an encounter."""
        return self._sums[: len(self.bodies)]

    @property
    def rate(self) -> float:
        """Λ = Σ_{i<j} K̂_ij/V [1/s]."""
        return float(self.sums.sum()) / (2.0 * self.volume)

    @property
    def grains(self) -> np.ndarray:
        """Numbers of grains (N,)."""
        return self._grains[: len(self.bodies)]

    @property
    def temperatures(self) -> tuple[float, float]:
        """Mean energies of motion ½mV² and of rotation of the bodies [k_BT]; 0 if they keep none."""
        sizes, heat = self.sizes, self.majorant.heat
        motion = 0.5 * sizes.mass * (sizes.vx**2 + sizes.vy**2 + sizes.vz**2)
        return float(motion.mean()) / heat, float(self._rotation[: len(self.bodies)].mean()) / heat

    @property
    def mean_size(self) -> float:
        """S = Σ N²/Σ N, the mean number of grains of the body of a grain."""
        grains = self.grains
        return float((grains**2).sum() / grains.sum())

    def row(self, i: int) -> np.ndarray:
        """K̂ of body i with all (N,); 0 with itself."""
        found = self.kernel_with(sizes_of(self.bodies[i]))
        found[i] = 0.0
        return found

    def kernel_with(self, sizes: Sizes) -> np.ndarray:
        """K̂ of a body with all (N,)."""
        return np.asarray(self.majorant.kernel(sizes, self.sizes))

    def draw(self, first: float, second: float) -> tuple[int, int, float]:
        """A pair in proportion to K̂, from two uniform deviates; and its K̂ [m³/s]."""
        count = len(self.bodies)
        along = np.cumsum(self.sums)
        i = min(int(np.searchsorted(along, first * along[-1])), count - 1)
        row = self.row(i)
        along = np.cumsum(row)
        j = min(int(np.searchsorted(along, second * along[-1])), count - 1)
        return i, j, float(row[j])

    def replace(self, i: int, j: int, new: Sequence[Body]) -> None:
        """Bodies i and j become the bodies `new`."""
        for k in sorted((i, j), reverse=True):
            self._sums[: len(self.bodies)] -= self.row(k)
            last = len(self.bodies) - 1  # the last one fills the gap
            self.bodies[k] = self.bodies[last]
            for table in (self._table, self._grains, self._rotation, self._sums):
                table[..., k] = table[..., last]
            self.bodies.pop()
        for body in new:
            count = len(self.bodies)
            if count == self._sums.size:
                more = (0, SPARE_COLUMNS)
                self._table = np.pad(self._table, ((0, 0), more))
                self._grains, self._sums = np.pad(self._grains, more), np.pad(self._sums, more)
                self._rotation = np.pad(self._rotation, more)
            row = self.kernel_with(sizes_of(body))
            self._sums[:count] += row
            self._sums[count], self._table[:, count], self._grains[count] = row.sum(), sizes_of(body), len(body)
            self._rotation[count] = body.rotation
            self.bodies.append(body)

    def double(self, turn: Callable[[Body, int], Body] | None = None) -> None:
        """Append a copy of each body, and double the volume (Liffman 1992): the number density stays.

        Copies are correlated with their originals, of which `Body.copy` and `Body.number` tell.  `turn` gives a copy
        another motion; its second argument is the place of the body.
        """
        own = np.asarray(self.majorant.kernel(self.sizes, self.sizes))  # of each body with its copy
        sums = np.tile(2.0 * self.sums + own, 2)
        self._table, self._grains = np.tile(self._table[:, : len(own)], 2), np.tile(self.grains, 2)
        self._rotation = np.tile(self._rotation[: len(own)], 2)
        self.doublings += 1
        self.bodies += [dataclasses.replace(body, copy=self.doublings) for body in self.bodies]
        self.volume *= 2.0
        if turn is not None:
            self.bodies[len(own) :] = [turn(body, k) for k, body in enumerate(self.bodies[len(own) :])]
            self._table = np.array([sizes_of(body) for body in self.bodies]).T
            sums = self._new_sums()
        self._sums = sums

    def _new_sums(self) -> np.ndarray:
        """Σ_j K̂_ij of each body, anew."""
        return np.array([self.row(k).sum() for k in range(len(self.bodies))])


def sizes_of(body: Body) -> Sizes:
    """Sizes of one body."""
    velocity = () if body.motion is None else body.motion.velocity
    return Sizes(body.mass, body.moment_sum, body.extent, *body.charges, *velocity)
