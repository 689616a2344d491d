"""A uniform magnetic field, constant or variable in time."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Set
from dataclasses import dataclass
from typing import Annotated, Any

from ..basics.arguments import checked
from ..basics.box import Box
from ..basics.errors import BadInput
from ..basics.grains import Grains
from ..basics.ramps import force_at, forces_at_points, rampable, ramps_of
from ..basics.settings import RAMP, AlongZ, Direction, For, Number, Reading, Settings, Word
from ..basics.units import si
from ..numerics.vec import across, add, cross, dot, norm, scale, sub
from .external_formulas import FieldInTime, UniformVector, field_in_time, flux_density_at, uniform_field

_WAVE = "oscillating", "rotating"
_ALONG_Z = "one value along z or three components, in T, such as '1 mT'"
STEPS_PER_PERIOD = 200
"""Least number of steps in a period of the field."""
STEPS_PER_RAMP = 100
"""Least number of steps in a ramp."""
MAX_COSINE = 1e-6
"""Largest cosine of the angle between amplitude and axis of a rotating field: allows for rounding only."""
_ANGLE = re.compile(r"°|rad|deg|turn|rev|rpm|cycle|rps", re.IGNORECASE)
_ZERO = (0.0, 0.0, 0.0)


def _frequency(value: Any, name: str) -> float:
    """Frequency [Hz]; units with an angle are refused, because pint converts 1 rad/s to 1 Hz and 60 rpm to 6.28 Hz."""
    unit = value if isinstance(value, str) else str(getattr(value, "units", ""))
    if _ANGLE.search(unit):
        raise BadInput(
            f"{name} = {value!r} has a unit of angle; give oscillations or rotations per second, such as '1 MHz'"
        )
    return si(value, "Hz", name, above=0.0)


@checked
@rampable
@dataclass(frozen=True)
class Field(Settings):
    """A uniform magnetic flux density: torque μ×B(t), energy −μ·B(t) (Eqs. 40, 41).

    With B0 = `flux_density` and B1 = `amplitude`:

        constant      B0
        oscillating   B0 + B1 cos(2πft + φ)
        rotating      B0 + B1 cos(2πft + φ) + n×B1 sin(2πft + φ),  n along `axis`, B1 across it
        ramp          B0 until `start`, then linear in time to `final` at `end`, constant afterwards

    Parameters
    ----------
    flux_density : float, str or sequence
        B0, three components [T], or one value along +z as in the paper: "1 mT". 0 for none. Or a `Ramp`, which is
        changed in steps, whereas `shape="ramp"` is exact at every step.
    shape : str, optional
        "constant", "oscillating", "rotating" (right-handed about `axis`) or "ramp".
    amplitude : float, str or sequence, optional
        B1 of "oscillating" and "rotating", three components [T], or one value along +z. For "rotating" it is the
        rotating component at phase 0, and must be perpendicular to the axis. Or a `Ramp`.
    frequency : float or str, optional
        f of "oscillating" and "rotating", oscillations or rotations per second [Hz] > 0.
    phase : float or str, optional
        φ of "oscillating" and "rotating" [rad], 0 by default; or text with a unit: "90 deg".
    axis : sequence, optional
        Direction of the axis of "rotating": three numbers, not all 0, of any magnitude.
    final : float, str or sequence, optional
        Flux density after a "ramp", three components [T], or one value along +z.
    start : float or str, optional
        Start of a "ramp" [s], 0 by default.
    end : float or str, optional
        End of a "ramp" [s], after its start.

    Raises
    ------
    BadInput
        If a value is invalid or out of range, or the shape requires or does not use a key; one line each.
    """

    flux_density: Annotated[Any, AlongZ("T"), RAMP]
    shape: Annotated[str, Word("constant", "oscillating", "rotating", "ramp")] = "constant"
    amplitude: Annotated[Any, AlongZ("T"), RAMP, For("shape", *_WAVE, needed=_ALONG_Z)] = None
    frequency: Annotated[
        Any,
        Reading(_frequency, unit="Hz"),
        For("shape", *_WAVE, needed="oscillations or rotations per second, in Hz, such as '1 MHz'"),
    ] = None
    phase: Annotated[Any, Number("rad"), For("shape", *_WAVE, default=0.0)] = None
    axis: Annotated[Any, Direction(), For("shape", "rotating", needed="three numbers, such as [0, 0, 1]")] = None
    final: Annotated[Any, AlongZ("T"), For("shape", "ramp", needed=_ALONG_Z)] = None
    start: Annotated[Any, Number("s"), For("shape", "ramp", default=0.0)] = None
    end: Annotated[Any, Number("s"), For("shape", "ramp", needed="a time in s, such as '5 us'")] = None

    name = "field"
    references = "Dominik & Nübold 2002, Eqs. 40, 41"

    def contradictions(self, wrong: Set[str]) -> Iterator[str]:
        """A ramp that ends before its start, and an amplitude along the axis."""
        if wrong:
            return
        if self.shape == "ramp" and not self.end > self.start:
            yield f"end = {self.end!r} must be after start = {self.start!r}, in s"
        if self.shape == "rotating":
            n, amplitude = self._normal(), self.amplitude
            if abs(dot(amplitude, n)) > MAX_COSINE * norm(amplitude):
                across_axis = ", ".join(f"{b:.9g}" for b in across(amplitude, n))
                yield (
                    f"amplitude = {list(amplitude)} must be perpendicular to axis = {list(self.axis)}; "
                    f"its component perpendicular to the axis is [{across_axis}] T"
                )

    def _normal(self) -> tuple[float, float, float]:
        """Unit vector along the axis."""
        return scale(1.0 / math.hypot(*self.axis), self.axis)

    @property
    def formula(self) -> Callable:
        """The formula in `forces/external_formulas.py`; constant fields have one without trigonometric functions."""
        return uniform_field if self.shape == "constant" else field_in_time

    @property
    def time_dependent(self) -> bool:
        """Whether B, and with it the energy −μ·B, depends explicitly on time: its change is work of the source."""
        return self.shape != "constant"

    def parameters(self) -> dict[str, Any]:
        """Settings of the shape in SI units, as in a case file; for a constant field its flux density alone."""
        return {k: v for k, v in super().parameters().items() if self.time_dependent or k != "shape"}

    def check(self, grains: Grains, box: Box) -> list[str]:
        """Warnings: no grain has a moment."""
        return [] if grains.moment.any() else ["a field is switched on but no grain has a magnetic moment"]

    def numbers(self) -> UniformVector | FieldInTime:
        """Parameters of `formula`."""
        b = self.flux_density
        if self.shape == "constant":
            return UniformVector(*b)
        if self.shape == "ramp":
            return FieldInTime(b, _ZERO, _ZERO, sub(self.final, b), 0.0, 0.0, self.start, 1.0 / (self.end - self.start))
        cosine, sine = self._quadratures()
        return FieldInTime(b, cosine, sine, _ZERO, 2.0 * math.pi * self.frequency, self.phase, 0.0, 0.0)

    def _quadratures(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Amplitudes [T] of the cosine and the sine."""
        if self.shape == "oscillating":
            return self.amplitude, _ZERO
        n = self._normal()
        first = across(self.amplitude, n)
        return first, cross(n, first)

    def flux_density_at(self, time: float) -> tuple[float, float, float]:
        """Flux density B [T] at a time [s]."""
        if ramps_of(self):
            x, y, z = force_at(self, time).flux_density_at(time)
            return x, y, z
        if self.shape == "constant":
            return self.flux_density
        x, y, z = flux_density_at(time, self.numbers())
        return x, y, z

    def flux_density_size(self) -> float:
        """Largest |B(t)| [T] over all times, whether the run reaches them or not."""
        if ramps_of(self):
            return max(one.flux_density_size() for one in forces_at_points(self))
        b = self.flux_density
        if self.shape == "ramp":
            return max(norm(b), norm(self.final))
        if self.shape == "oscillating":
            return max(norm(add(b, self.amplitude)), norm(sub(b, self.amplitude)))
        if self.shape == "rotating":
            n = self._normal()
            return math.hypot(dot(b, n), norm(across(b, n)) + norm(self.amplitude))
        return norm(b)

    def longest_step(self) -> float:
        """Largest step [s]: 1/200 of the period or 1/100 of the ramp; infinite for a constant field."""
        if self.shape == "constant":
            return math.inf
        if self.shape == "ramp":
            return (self.end - self.start) / STEPS_PER_RAMP
        return 1.0 / (STEPS_PER_PERIOD * self.frequency)
