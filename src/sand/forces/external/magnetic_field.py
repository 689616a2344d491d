"""A uniform magnetic field, constant or changing in time."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

from ...arguments import checked
from ...box import Box
from ...errors import FORBID_EXTRA, BadInput, did_you_mean
from ...grains import Grains
from ...numerics.vec import across, add, cross, dot, norm, scale, sub
from ...units import si
from ..vectors import along_z, three
from .formulas import FieldInTime, UniformField, field_in_time, flux_density_at, uniform_field

SHAPES: dict[str, tuple[str, ...]] = {
    "constant": (),
    "oscillating": ("amplitude", "frequency", "phase"),
    "rotating": ("amplitude", "frequency", "phase", "axis"),
    "ramp": ("final", "start", "end"),
}
"""How B changes in time, and the keys that say so, besides `flux_density`."""
USUAL = {"phase": 0.0, "start": 0.0}
"""Keys that may be left out."""
WANTED = {
    "flux_density": "one size along z or three components, in T, such as '1 mT', or 0",
    "amplitude": "one size along z or three components, in T, such as '1 mT'",
    "frequency": "swings or turns per second, in Hz, such as '1 MHz'",
    "axis": "three numbers, such as [0, 0, 1]",
    "final": "one size along z or three components, in T, such as '1 mT'",
    "end": "a time in s, such as '5 us'",
}
"""What a missing key would hold."""
PERIOD_PARTS = 200
"""Least number of steps in a period of the field."""
RAMP_PARTS = 100
"""Least number of steps in a ramp."""
TILT = 1e-6
"""Largest cosine of the angle between amplitude and axis of a rotating field; more than rounding is a mistake."""
_ANGLE = re.compile(r"°|rad|deg|turn|rev|rpm|cycle|rps", re.IGNORECASE)
_ZERO = (0.0, 0.0, 0.0)


def _frequency(value: Any, name: str) -> float:
    """[Hz]; units with an angle are refused, because pint takes 1 rad/s for 1 Hz and 60 rpm for 6.28 Hz."""
    unit = value if isinstance(value, str) else str(getattr(value, "units", ""))
    if _ANGLE.search(unit):
        raise BadInput(f"{name} = {value!r} counts angles; give swings or turns per second, such as '1 MHz'")
    return si(value, "Hz", name, above=0.0)


def _axis(value: Any, name: str) -> tuple[float, float, float]:
    """Three numbers, not all 0; stored as they were given."""
    axis = three(value, "1", name)
    if axis == _ZERO:
        raise BadInput(f"{name} = {value!r} has no direction; give three numbers, not all 0, such as [0, 0, 1]")
    return axis


READERS: dict[str, Callable[[Any, str], Any]] = {
    "flux_density": lambda value, name: along_z(value, "T", name),
    "amplitude": lambda value, name: along_z(value, "T", name),
    "frequency": _frequency,
    "phase": lambda value, name: si(value, "rad", name),
    "axis": _axis,
    "final": lambda value, name: along_z(value, "T", name),
    "start": lambda value, name: si(value, "s", name),
    "end": lambda value, name: si(value, "s", name),
}
"""How each key is read."""


@checked
@dataclass(frozen=True)
class Field:
    """A magnetic flux density that is the same everywhere: torque μ×B(t), energy −μ·B(t) (Eqs. 40, 41).

    With B0 = `flux_density` and B1 = `amplitude`:

        constant      B0
        oscillating   B0 + B1 cos(2πft + φ)
        rotating      B0 + B1 cos(2πft + φ) + n×B1 sin(2πft + φ),  n along `axis`, B1 across it
        ramp          B0 until `start`, then linear in time, `final` from `end` on

    Parameters
    ----------
    flux_density
        B0, three components [T], or one size along +z as in the paper: "1 mT". 0 for none.
    shape : str, optional
        "constant", "oscillating", "rotating" (right-handed about `axis`) or "ramp".
    amplitude : optional
        B1 of "oscillating" and "rotating", three components [T], or one size along +z. When rotating it
        is where the turning part points at the phase 0, and must be perpendicular to the axis.
    frequency : optional
        f of "oscillating" and "rotating", swings or turns per second [Hz] > 0.
    phase : optional
        φ of "oscillating" and "rotating" [rad]; 0 unless given. Text may say "90 deg".
    axis : optional
        direction of the axis of "rotating", three numbers of any size.
    final : optional
        flux density after a "ramp", three components [T], or one size along +z.
    start : optional
        when a "ramp" begins [s]; 0 unless given.
    end : optional
        when a "ramp" ends [s], after its start.

    Raises
    ------
    BadInput
        numbers that are wrong or out of range, keys that the shape lacks or does not use; one line each.
    """

    flux_density: Any
    shape: str = "constant"
    amplitude: Any = None
    frequency: Any = None
    phase: Any = None
    axis: Any = None
    final: Any = None
    start: Any = None
    end: Any = None

    __pydantic_config__ = FORBID_EXTRA
    name = "field"
    references = "Dominik & Nübold 2002, Eqs. 40, 41"

    def __post_init__(self) -> None:
        shapes = list(SHAPES)
        problems = []
        used = tuple(READERS)  # the shape is unknown: all may be meant
        if self.shape in shapes:
            used = ("flux_density", *SHAPES[self.shape])
        else:
            problems.append(f"field: shape = {self.shape!r}; {did_you_mean(str(self.shape), shapes)}")
        for key, read in READERS.items():
            given = getattr(self, key)
            if given is None and self.shape in shapes and key in used:
                given = USUAL.get(key)
                if given is None:
                    problems.append(f"field: {key} is missing: shape = '{self.shape}' needs {WANTED[key]}")
            elif given is not None and key not in used:
                problems.append(self._unused(key))
                continue
            try:
                object.__setattr__(self, key, None if given is None else read(given, f"field: {key}"))
            except BadInput as error:
                problems += error.problems
        if problems := problems or self._wrong_together():
            raise BadInput(problems)

    def _unused(self, key: str) -> str:
        """The complaint about a key that is for other shapes."""
        others = " or ".join(f"'{shape}'" for shape, keys in SHAPES.items() if key in keys)
        return (
            f"field: {key} = {getattr(self, key)!r} is not used by shape = '{self.shape}'; leave it out, "
            f"or give shape = {others}"
        )

    def _wrong_together(self) -> list[str]:
        """Complaints about keys that are right one by one."""
        if self.shape == "ramp" and not self.end > self.start:
            return [f"field: end = {self.end!r} must be after start = {self.start!r}, in s"]
        if self.shape == "rotating":
            n, amplitude = self._normal(), self.amplitude
            if abs(dot(amplitude, n)) > TILT * norm(amplitude):
                part = ", ".join(f"{b:.9g}" for b in across(amplitude, n))
                return [
                    f"field: amplitude = {list(amplitude)} must be perpendicular to axis = {list(self.axis)}; "
                    f"its part across the axis is [{part}] T"
                ]
        return []

    def _normal(self) -> tuple[float, float, float]:
        """The unit vector along the axis."""
        return scale(1.0 / math.hypot(*self.axis), self.axis)

    @property
    def formula(self) -> Callable:
        """That of forces/external/formulas.py; the one of a constant field has no sine to work out."""
        return uniform_field if self.shape == "constant" else field_in_time

    @property
    def time_dependent(self) -> bool:
        """True if B changes in time: then −μ·B does so too, which is work of what makes the field."""
        return self.shape != "constant"

    def parameters(self) -> dict[str, Any]:
        """What the shape uses, in SI; a constant field is its flux density alone."""
        given = {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(self).items() if v is not None}
        return given if self.time_dependent else {"flux_density": given["flux_density"]}

    def check(self, grains: Grains, box: Box) -> list[str]:
        """Warns when no grain has a moment."""
        return [] if grains.moment.any() else ["a field is switched on but no grain has a magnetic moment"]

    def numbers(self) -> UniformField | FieldInTime:
        """What `formula` takes."""
        b = self.flux_density
        if self.shape == "constant":
            return UniformField(*b)
        if self.shape == "ramp":
            return FieldInTime(b, _ZERO, _ZERO, sub(self.final, b), 0.0, 0.0, self.start, 1.0 / (self.end - self.start))
        cosine, sine = self._swinging()
        return FieldInTime(b, cosine, sine, _ZERO, 2.0 * math.pi * self.frequency, self.phase, 0.0, 0.0)

    def _swinging(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """The vectors [T] that go with cos and sin."""
        if self.shape == "oscillating":
            return self.amplitude, _ZERO
        n = self._normal()
        first = across(self.amplitude, n)
        return first, cross(n, first)

    def flux_density_at(self, time: float) -> tuple[float, float, float]:
        """B [T] at a time [s]."""
        if self.shape == "constant":
            return self.flux_density
        x, y, z = flux_density_at(time, self.numbers())
        return x, y, z

    def flux_density_size(self) -> float:
        """The largest |B(t)| [T] of all times, reached or not."""
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
        """A two-hundredth of the period or a hundredth of the ramp [s]; infinite for a constant field."""
        if self.shape == "constant":
            return math.inf
        if self.shape == "ramp":
            return (self.end - self.start) / RAMP_PARTS
        return 1.0 / (PERIOD_PARTS * self.frequency)
