"""Simulation box: open or periodic along each axis, centred on the origin."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from .arguments import checked
from .errors import BadInput, shown
from .units import dimensions, exact_quantity, format_quantity, is_word, si, si_array

ALL_PAIRS_UP_TO = 200
"""Number of points up to which `Box.close_pairs` examines all pairs."""


class Span(NamedTuple):
    """Box for kernels: lengths L [m] and 1/L per axis, both 0 on an open axis."""

    x: float
    y: float
    z: float
    inverse_x: float
    inverse_y: float
    inverse_z: float


class MovingSpan(NamedTuple):
    """As `Span`, of a box that is deformed, with its rates of strain dL/dt / L [1/s]: words of `State.cell.span`."""

    x: float
    y: float
    z: float
    inverse_x: float
    inverse_y: float
    inverse_z: float
    rate_x: float
    rate_y: float
    rate_z: float


class TiltedSpan(NamedTuple):
    """As `MovingSpan`, of a box that is tilted, with its tilt T [m] and rate of shear dv_x/dz [1/s]."""

    x: float
    y: float
    z: float
    inverse_x: float
    inverse_y: float
    inverse_z: float
    rate_x: float
    rate_y: float
    rate_z: float
    tilt: float
    rate_xz: float


def nearest_image(v, span):
    """Shortest periodic image of a separation v [m]; components along open axes are unchanged.

    np.rint vectorises.  A component of exactly L/2 may get either sign.
    """
    return (
        v[0] - span.x * np.rint(v[0] * span.inverse_x),
        v[1] - span.y * np.rint(v[1] * span.inverse_y),
        v[2] - span.z * np.rint(v[2] * span.inverse_z),
    )


def nearest_image_tilted(v, span):
    """As `nearest_image`, in a tilted box: the image with each component within half a side, whatever the tilt.

    A separation shorter than half of the shortest side has no other image of this kind.  Of positions, this is the
    image in the rectangular box.
    """
    crossed = np.rint(v[2] * span.inverse_z)
    along = v[0] - span.tilt * crossed
    return (
        along - span.x * np.rint(along * span.inverse_x),
        v[1] - span.y * np.rint(v[1] * span.inverse_y),
        v[2] - span.z * crossed,
    )


@checked
@dataclass(frozen=True, repr=False)
class Box:
    """Simulation box, created with `Box.open` or `Box.periodic`.

    Parameters
    ----------
    lengths : tuple of float or None, optional
        Length of each axis [m] > 0; None for an open axis.
    tilt : float, optional
        Displacement T [m] along x of the image that is one length beyond along z; 0 by default. It is brought within
        half of the length along x, which leaves the lattice of images as it is.

    Raises
    ------
    BadInput
        If a length is not positive and finite, or a box with an open axis is tilted.
    """

    lengths: tuple[float | None, float | None, float | None] = (None, None, None)
    tilt: float = 0.0

    def __post_init__(self) -> None:
        if not all(
            length is None
            or (isinstance(length, (int, float)) and not isinstance(length, bool) and 0.0 < length < float("inf"))
            for length in self.lengths
        ):
            raise BadInput(f"lengths = {shown(self.lengths)} must be lengths in m or None; see sand.Box.periodic")
        if self.tilt and (None in self.lengths or not math.isfinite(self.tilt)):
            raise BadInput(f"tilt = {self.tilt:g} m is for a box that is periodic along x, y and z; leave it out")
        if self.tilt:
            object.__setattr__(self, "tilt", self.tilt - self.span.x * float(np.rint(self.tilt * self.span.inverse_x)))

    def __repr__(self) -> str:
        given = [None if length is None else exact_quantity(float(length), "m") for length in self.lengths]
        texts = ", ".join(map(repr, given[:1] if len(set(given)) == 1 else given))
        texts += f", tilt={exact_quantity(self.tilt, 'm')!r}" if self.tilt else ""
        return "Box.open()" if self.is_open else f"Box.periodic({texts})"

    @classmethod
    def open(cls) -> Box:
        """Open box: free space."""
        return cls()

    @classmethod
    @checked
    def periodic(cls, x: Any, y: Any = "same", z: Any = "same", tilt: Any = 0.0) -> Box:
        """Periodic box.

        Parameters
        ----------
        x : float, str or None
            Length along x [m] > 0, None or "open" for an open axis; by default also along y and z.
        y, z : float, str or None, optional
            Lengths along y and z [m] > 0; None or "open" for an open axis.
        tilt : float or str, optional
            Displacement T [m] along x of the image one length beyond along z, as simple shear leaves it; 0 by default.

        Returns
        -------
        Box
            The box.

        Raises
        ------
        BadInput
            If a length is not positive or has a wrong unit, or a box with an open axis is tilted.
        """
        y = x if isinstance(y, str) and y == "same" else y
        z = x if isinstance(z, str) and z == "same" else z
        lengths = tuple(
            None if v is None or is_word(v, "open") else si(v, "m", f"box length {axis}", above=0.0)
            for v, axis in zip((x, y, z), "xyz", strict=True)
        )
        return cls(lengths, si(tilt, "m", "box tilt"))  # type: ignore[arg-type]

    @property
    def is_open(self) -> bool:
        """Whether all axes are open."""
        return all(v is None for v in self.lengths)

    @property
    def shortest(self) -> float:
        """Length of the shortest periodic axis [m]; infinite in an open box."""
        return min((v for v in self.lengths if v is not None), default=float("inf"))

    @property
    def volume(self) -> float:
        """Volume [m³]; infinite if any axis is open."""
        return float(np.prod([v if v is not None else np.inf for v in self.lengths]))

    @property
    def span(self) -> Span | TiltedSpan:
        """The box as a tuple for kernels."""
        words = Span(
            *(v if v is not None else 0.0 for v in self.lengths),
            *(1.0 / v if v is not None else 0.0 for v in self.lengths),
        )
        return TiltedSpan(*words, 0.0, 0.0, 0.0, self.tilt, 0.0) if self.tilt else words

    def moving_span(self, *, sheared: bool) -> MovingSpan | TiltedSpan:
        """The box as a tuple for kernels that may deform it, at rest; `sheared`: or shear it."""
        moving = MovingSpan(*self.span[:6], 0.0, 0.0, 0.0)
        return TiltedSpan(*moving, self.tilt, 0.0) if sheared or self.tilt else moving

    def nearest(self, separation: np.ndarray) -> np.ndarray:
        """Shortest periodic images of separations (…, 3) [m]."""
        separation = si_array(separation, "m", "separation")
        if not separation.ndim or separation.shape[-1] != 3:
            raise BadInput(f"separation has shape {separation.shape} but must be (…, 3), in m")
        nearest = nearest_image_tilted if self.tilt else nearest_image
        return np.stack(nearest(np.moveaxis(separation, -1, 0), self.span), axis=-1)

    def wrap(self, position: np.ndarray) -> np.ndarray:
        """Positions (…, 3) [m] wrapped into −L/2 … L/2 on periodic axes, also of a tilted box."""
        return self.nearest(position)

    def image(self, position: np.ndarray) -> np.ndarray:
        """Periodic image of each position (…, 3), int32: 1 where it is one length beyond the box, 0 on open axes."""
        x, inverse = np.asarray(position), np.array(self.span[3:6])
        if self.tilt:
            x = x - np.rint(x[..., 2:] * inverse[2]) * [self.tilt, 0.0, 0.0]
        return np.rint(x * inverse).astype(np.int32)

    def shift(self, image: Any) -> np.ndarray:
        """Vectors (…, 3) [m] from the box to its images (…, 3)."""
        image = np.asarray(image)
        return image * np.array(self.span[:3]) + image[..., 2:] * np.array([self.tilt, 0.0, 0.0])

    def close_pairs(self, position: np.ndarray, reach: float) -> np.ndarray:
        """All pairs of points that are at most `reach` apart, by nearest images on periodic axes.

        Parameters
        ----------
        position : ndarray
            (N, 3) points [m].
        reach : float
            Distance [m], below half the shortest periodic axis.

        Returns
        -------
        ndarray
            (P, 2) indices i < j, sorted.
        """
        if len(position) <= ALL_PAIRS_UP_TO:
            first, second = np.triu_indices(len(position), 1)
            separation = self.nearest(position[first] - position[second])
            return np.stack([first, second], axis=1)[(separation**2).sum(axis=1) <= reach**2]

        if self.tilt:
            return self._close_pairs_tilted(position, reach)
        pairs = self.tree(position).query_pairs(reach, output_type="ndarray")
        return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]

    def _close_pairs_tilted(self, position: np.ndarray, reach: float) -> np.ndarray:
        """As `close_pairs`: images of the points near the upper face are added below the lower one."""
        x = self.wrap(position)
        above = np.flatnonzero(x[:, 2] > 0.5 * self.span.z - reach)
        points, own = np.concatenate([x, x[above] - self.shift([0, 0, 1])]), np.append(np.arange(len(x)), above)
        pairs = Box((*self.lengths[:2], None)).tree(points).query_pairs(reach, output_type="ndarray")
        return np.unique(np.sort(own[pairs[(pairs < len(x)).any(axis=1)]], axis=1), axis=0)

    def tree(self, position: np.ndarray) -> Any:
        """`scipy.spatial.cKDTree` of points (N, 3) [m], wrapped into 0 … L on periodic axes of a box without tilt."""
        from scipy.spatial import cKDTree  # slow import

        lengths = np.array([0.0 if v is None else v for v in self.lengths])
        wrapped = np.where(lengths > 0.0, np.mod(position, np.where(lengths > 0.0, lengths, 1.0)), position)
        wrapped = np.where((lengths > 0.0) & (wrapped >= lengths), 0.0, wrapped)  # np.mod(−1e-300, L) is L
        return cKDTree(wrapped, boxsize=lengths)

    def describe(self) -> str:
        """Description in one line, for logs: 'periodic 1.2 um x 1.2 um x 1.2 um', 'open'."""
        if self.is_open:
            return "open"
        sides = " x ".join("open" if v is None else format_quantity(v, "m") for v in self.lengths)
        tilt = f", tilted by {format_quantity(float(f'{self.tilt:.6g}'), 'm')} along x" if self.tilt else ""
        return f"periodic {sides}{tilt}"


def box_of(lengths: np.ndarray, tilt: float = 0.0) -> Box:
    """The box with lengths [m] that are the first three numbers of an array, 0 on open axes."""
    return Box(tuple(length or None for length in lengths[:3].tolist()), float(tilt))  # type: ignore[arg-type]


def least_side(radius: np.ndarray) -> float:
    """Least side of a periodic box [m] in which no two grains of these radii touch through two images."""
    return 2.0 * (2.0 * float(radius.max()) + float(radius.min()))


def as_box(value: Any) -> Box:
    """Box from a Box, a length, three lengths, or None for an open box.

    Raises
    ------
    BadInput
        If the value is none of these.
    """
    if isinstance(value, Box):
        return value
    if value is None:
        return Box.open()
    if isinstance(value, (list, tuple)) or dimensions(value) == 1:
        if len(value) != 3:
            raise BadInput(f'box = {shown(value)} must be one length or three; for an open axis give None or "open"')
        return Box.periodic(*value)
    return Box.periodic(value)
