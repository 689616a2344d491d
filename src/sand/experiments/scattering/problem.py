"""From what a user says of a scattering experiment to checked numbers."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np

from ...arguments import checked
from ...constants import BOLTZMANN
from ...errors import BadInput, did_you_mean, shown
from ...forces.vectors import three
from ...grains import Grains
from ...material import Material, as_material
from ...theory.magnetic import thermal_speed
from ...units import format_quantity, in_unit, si
from .encounters import Flight, scales_of
from .initial_conditions import ALIGNED, GIVEN, RANDOM

SPEED_UNITS = ("m/s", "thermal")
SPINS = {"none": 0.0, "kT/2": 0.5, "equipartition": 1.5}
"""Mean rotational energy of a grain in k_B T."""
ORIENTATIONS = {"random": RANDOM, "aligned": ALIGNED, "given": GIVEN}
SHAPES = ("plane", "sphere")
OUTCOMES = ("hit", "stick")
WORDS: dict[str, Any] = {
    "speed_unit": SPEED_UNITS,
    "orientation": ORIENTATIONS,
    "start_shape": SHAPES,
    "outcome": OUTCOMES,
}
"""What may be said."""
AUTO_START = 10.0
"""Distance of the start in b_max; at least `LEAST_START` radii of contact."""
LEAST_START = 5.0
_OF_CAPTURE = re.compile(r"\s*(\S+)\s+(b_max|R_m)\s*")
FARTHEST = 1e9
"""Largest start in sums of the radii."""


class ErrorCollector:
    """Collects what is wrong, so that all of it is told at once."""

    def __init__(self) -> None:
        self.problems: list[str] = []

    def take(self, make: Callable[[], Any], instead: Any = None) -> Any:
        """`make()`, or `instead` if that is a mistake."""
        try:
            return make()
        except BadInput as error:
            self.problems += error.problems
            return instead

    def done(self) -> None:
        """Raises BadInput if anything was wrong."""
        if self.problems:
            raise BadInput(self.problems)


@checked
def flight(
    radius: Any = None,
    material: Material | str | None = None,
    moment: Any = 0.0,
    temperature: Any = 0.0,
    speed: Any = None,
    *,
    speed_unit: str = "m/s",
    spin: Any = "none",
    start: Any = "auto",
    start_shape: str = "plane",
    target: Grains | None = None,
    projectile: Grains | None = None,
    orientation: str = "random",
    target_velocity: Any = None,
    field: Any = None,
    escape: Any = "auto",
    outcome: str = "hit",
    tolerance: Any = 1e-8,
) -> Flight:
    """A scattering experiment from what a user says.

    Parameters
    ----------
    radius : optional
        of the grains [m] > 0; material: their `Material` or its name; moment: as `Grains` takes one.
    temperature : optional
        T [K] ≥ 0, of thermal speeds and spins.
    speed : optional
        v∞ of the projectile > 0 [m/s], or in v_th = √(k_B T/m) of the projectile with `speed_unit="thermal"`.
    spin : optional
        mean rotational energy per body: "none", "kT/2" (the paper's U_rot), "equipartition" (3/2 k_B T), all
        by chance; or a vector [rad/s] for both; or two of them, of projectile and target.
    start : optional
        distance before the target: "auto", the larger of 10 b_max and 5 (r1 + r2); a length [m]; or
        "20 b_max", "1 R_m" (Eq. 2; needs a temperature).
    start_shape : str, optional
        of all starts together, "plane" across the flight, or "sphere" about the target.
    target, projectile : Grains or None, optional
        grains, or aggregates, instead of radius, material and moment; the target is like the
        projectile by default. Their own velocities and spins do not count.
    orientation : str, optional
        "random"; "aligned", single grains' moments along the line of centres at the start; "given".
    target_velocity : optional
        three components [m/s], or "thermal", √(k_B T/m) for each; None: at rest.
    field : optional
        external flux density, three components [T]; None: none.
    escape : optional
        distance [m] > r1 + r2 at which a body on its way out is gone; "auto": that of its start.
    outcome : str, optional
        "hit", surfaces touch; "stick": those that hold, each followed through its real contact.
    tolerance : optional
        error of a step over the scales, 1e-13 … 1e-3.

    Raises
    ------
    BadInput
        one line for each mistake.
    """
    return _checked(dict(locals()))


def _checked(given: dict[str, Any]) -> Flight:
    """All of what was given, checked, so that every mistake is told at once."""
    ask = ErrorCollector()
    first, second = _bodies(ask, given)
    heat = ask.take(lambda: si(given["temperature"], "K", "temperature", least=0.0), 0.0)
    for name, allowed in WORDS.items():
        if not isinstance(given[name], str) or given[name] not in allowed:
            ask.problems.append(f"{name} = {given[name]!r}; {did_you_mean(str(given[name]), list(allowed))}")
    rest = (0.0, 0.0, 0.0)
    drift, spread = ask.take(lambda: _drift(given["target_velocity"], heat, second), (rest, 0.0))
    whirl, energy = ask.take(lambda: _spin(given["spin"], heat), ((rest, rest), 0.0))
    outer = ask.take(lambda: rest if given["field"] is None else three(given["field"], "T", "field"))
    exact = ask.take(lambda: si(given["tolerance"], "1", "tolerance", above=0.0), 1e-8)
    if not 1e-13 <= exact <= 1e-3:
        ask.problems.append(f"tolerance = {given['tolerance']!r} must lie in 1e-13 … 1e-3")
    gone = ask.take(lambda: 0.0 if given["escape"] == "auto" else si(given["escape"], "m", "escape", above=0.0))
    fast = ask.take(lambda: _speed(given["speed"], given["speed_unit"], heat, first))
    away: Any = None
    if first is not None and second is not None and fast is not None:
        if given["orientation"] == "aligned" and not len(first) == len(second) == 1:
            ask.problems.append("orientation = 'aligned' is for single grains; give aggregates as they lie, 'given'")
        speed = math.dist((fast, 0.0, 0.0), drift)
        if speed < 1e-9 * fast:
            ask.problems.append("speed and target_velocity are the same: the bodies never meet")
        else:
            away = ask.take(lambda: _distance(given["start"], first, second, speed, heat))
            touch = scales_of(first, second, speed).touch
            if gone and not gone > touch:
                ask.problems.append(
                    f"escape = {given['escape']!r} must lie beyond the contact, {format_quantity(touch, 'm')}"
                )
    ask.done()
    return Flight(
        first,
        second,
        fast,
        away,
        sphere=given["start_shape"] == "sphere",
        escape=gone,
        drift=drift,
        drift_spread=spread,
        axes=ORIENTATIONS[given["orientation"]],
        spin=whirl,
        spin_energy=(energy, energy),
        field=outer,
        tolerance=exact,
        temperature=heat,
        contact=given["outcome"] == "stick",
    )


def _bodies(ask: ErrorCollector, given: dict[str, Any]) -> tuple[Any, Any]:
    """Projectile and target; None for what could not be made."""
    for name in ("projectile", "target"):
        if given[name] is not None and not isinstance(given[name], Grains):
            ask.problems.append(f"{name} = {shown(given[name])} must be grains, such as sand.setup.grain(...)")
            return None, None
    first = given["projectile"]
    if first is None:
        first = ask.take(lambda: _made(given["radius"], given["material"], given["moment"]))
    elif given["radius"] is not None or given["material"] is not None:
        ask.problems.append("radius and material are those of the projectile already; leave them out")
    return first, first if given["target"] is None else given["target"]


def _made(radius: Any, material: Material | str | None, moment: Any) -> Grains:
    """One grain at rest, its moment along +x; other than `setup.grain` it needs no surface energy."""
    missing = [name for name, value in (("radius", radius), ("material", material)) if value is None]
    if missing:
        raise BadInput(f"{name} is missing; give radius and material, or a projectile" for name in missing)
    known = as_material(material)
    r = si(radius, "m", "radius", above=0.0)
    size = float(np.linalg.norm(Grains([[0.0, 0.0, 0.0]], r, known, moment=moment).moment))
    return Grains([[0.0, 0.0, 0.0]], r, known, moment=[[size, 0.0, 0.0]])


def _speed(speed: Any, unit: str, heat: float, body: Grains | None) -> float | None:
    if speed is None:
        raise BadInput("speed is missing; give it in m/s, or in thermal speeds with speed_unit='thermal'")
    if unit != "thermal":
        return si(speed, "m/s", "speed", above=0.0)
    times = si(speed, "1", "speed", above=0.0)
    if not heat > 0.0:
        raise BadInput("speed_unit = 'thermal' needs a temperature above 0 K")
    return None if body is None else si(times * thermal_speed(float(body.mass.sum()), heat), "m/s", "speed")


def _drift(value: Any, heat: float, body: Grains | None) -> tuple[Any, float]:
    """Mean velocity of the target and the standard deviation of each component [m/s]."""
    rest = (0.0, 0.0, 0.0)
    if value is None or body is None:
        return rest, 0.0
    if isinstance(value, str) and value == "thermal":
        return rest, thermal_speed(float(body.mass.sum()), heat)
    return three(value, "m/s", "target_velocity"), 0.0


def _spin(value: Any, heat: float) -> tuple[Any, float]:
    """Given spins of both [rad/s], and the mean energy of thermal ones [J]."""
    rest = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    if isinstance(value, str):
        if value not in SPINS:
            raise BadInput(f"spin = {value!r}; {did_you_mean(value, list(SPINS))}, or three components in rad/s")
        if SPINS[value] > 0.0 and not heat > 0.0:
            raise BadInput(f"spin = {value!r} needs a temperature above 0 K")
        return rest, SPINS[value] * BOLTZMANN * heat
    parts = list(value) if isinstance(value, (list, tuple, np.ndarray)) else [value]
    if len(parts) == 2:
        return (three(parts[0], "rad/s", "spin of the projectile"), three(parts[1], "rad/s", "spin of the target")), 0.0
    both = three(value, "rad/s", "spin")
    return (both, both), 0.0


def _distance(start: Any, first: Grains, second: Grains, speed: float, heat: float) -> float:
    """Distance of the start [m].  Raises BadInput where it lies inside the contact."""
    scales = scales_of(first, second, speed)
    if isinstance(start, str) and start == "auto":
        return max(AUTO_START * scales.capture, LEAST_START * scales.touch)
    told = _multiple(start, "start")
    if told is not None:
        times, unit = told
        if scales.capture == 0.0:
            raise BadInput(f"start = {start!r}: without moments b_max and R_m are 0; give a length")
        if unit == "R_m" and not heat > 0.0:
            raise BadInput(f"start = {start!r} needs a temperature above 0 K")
        # R_m = (4 α/(k_B T))^(1/3): Eq. 2 for two moments
        size = scales.capture if unit == "b_max" else (4.0 * scales.alpha / (BOLTZMANN * heat)) ** (1.0 / 3.0)
        distance = times * size
    elif in_unit(start, "m") is None:
        raise BadInput(f"start = {start!r} must be 'auto', a length such as '2 um', or '10 b_max', '1 R_m'")
    else:
        distance = si(start, "m", "start", above=0.0)
    if not distance > scales.touch:
        raise BadInput(
            f"start = {start!r}, {format_quantity(distance, 'm')}, lies inside the contact: the bodies reach to "
            f"{format_quantity(scales.touch, 'm')}; start farther out"
        )
    if not distance < FARTHEST * scales.touch:
        raise BadInput(f"start = {start!r} is out of all range: at most {FARTHEST:.0e} times r1 + r2")
    return distance


def _multiple(value: Any, name: str) -> tuple[float, str] | None:
    """Number and unit of "10 b_max" or "1 R_m"; None for anything else.  Raises BadInput for a number that is none."""
    match = _OF_CAPTURE.fullmatch(value) if isinstance(value, str) else None
    if match is None:
        return None
    return si(match[1], "1", f"{name} in {match[2]}", least=0.0), match[2]


def impact_parameter(value: Any, setup: Flight, name: str = "impact_parameter") -> float:
    """b [m] ≥ 0 from a length or "0.95 b_max".  Raises BadInput."""
    told = _multiple(value, name)
    if told is not None and told[1] == "b_max":
        b = told[0] * setup.scales.capture
        if setup.scales.capture == 0.0:
            raise BadInput(f"{name} = {value!r}: without moments b_max is 0; give a length")
    else:
        b = si(value, "m", name)
    if b < 0.0:
        raise BadInput(f"{name} = {value!r} must be at least 0 m")
    if setup.sphere and b >= setup.distance:
        raise BadInput(
            f"{name} = {value!r} must be below the radius of the start, {format_quantity(setup.distance, 'm')}"
        )
    return b
