"""User input of scattering experiments: conversion to checked numbers."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

from ...basics.arguments import checked
from ...basics.constants import BOLTZMANN
from ...basics.errors import BadInput, ErrorCollector, did_you_mean
from ...basics.grains import Grains
from ...basics.material import Material, as_material
from ...basics.units import dimensions, format_quantity, in_unit, is_word, si
from ...basics.vectors import three
from ...theory.magnetic import thermal_speed
from .encounters import Flight, Scales, scales_of
from .initial_conditions import ALIGNED, GIVEN, RANDOM

SPINS = {"none": 0.0, "kT/2": 0.5, "equipartition": 1.5}
"""Mean rotational energy of a grain in k_B T."""
ORIENTATIONS = {"random": RANDOM, "aligned": ALIGNED, "given": GIVEN}
ALLOWED: dict[str, Any] = {
    "speed_unit": ("m/s", "thermal"),
    "orientation": ORIENTATIONS,
    "start_shape": ("plane", "sphere"),
    "outcome": ("hit", "stick"),
}
"""Allowed words of the text arguments."""
AUTO_START = 10.0
"""Default distance of the start in units of b_max."""
LEAST_START = 5.0
"""Smallest default distance of the start in units of r1 + r2."""
REST = (0.0, 0.0, 0.0)
_OF_CAPTURE = re.compile(r"\s*(\S+)\s+(b_max|R_m)\s*")
FARTHEST = 1e9
"""Largest distance of the start in units of r1 + r2."""


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
    """Set up a scattering experiment.

    Parameters
    ----------
    radius : float or str, optional
        Radius of the grains [m] > 0.
    material : Material or str, optional
        Their material or the name of a preset.
    moment : float or str or array_like, optional
        Their magnetic moment, as for `Grains`.
    temperature : float or str, optional
        Temperature T [K] ≥ 0 of thermal speeds and spins.
    speed : float or str, optional
        Speed v∞ of the projectile > 0 [m/s], or in units of its v_th = √(k_B T/m) with `speed_unit="thermal"`.
    speed_unit : str, optional
        "m/s" or "thermal".
    spin : str or array_like, optional
        Mean rotational energy per body for random spins: "none", "kT/2" (U_rot of Dominik & Nübold 2002) or
        "equipartition" (3/2 k_B T); or a vector [rad/s] for both bodies; or two vectors, for projectile and target.
    start : float or str, optional
        Distance of the start from the target: "auto", the larger of 10 b_max and 5 (r1 + r2); a length [m]; or "20
        b_max", "1 R_m" (Eq. 2; needs a temperature).
    start_shape : str, optional
        Surface of the starting points: "plane" perpendicular to the flight, or "sphere" about the target.
    target, projectile : Grains or None, optional
        Grains or aggregates, instead of radius, material and moment. The target equals the projectile by default.
        Their own velocities and spins are ignored.
    orientation : str, optional
        "random"; "aligned", with the moments of single grains along the initial line of centres; or "given".
    target_velocity : str or array_like, optional
        Three components [m/s], or "thermal", random with standard deviation √(k_B T/m) each; None: at rest.
    field : array_like, optional
        External flux density, three components [T]; None: zero.
    escape : float or str, optional
        Distance [m] > r1 + r2 at which a receding body has escaped; "auto": that of its start.
    outcome : str, optional
        Definition of a hit: "hit", the surfaces touch; "stick", the simulated contact holds.
    tolerance : float, optional
        Error of a step over the scales, 1e-13 … 1e-3.

    Returns
    -------
    Flight
        The set-up.

    Raises
    ------
    BadInput
        If arguments are invalid; one line for each.
    """
    return _checked(dict(locals()))


def _checked(given: dict[str, Any]) -> Flight:
    """Check all arguments of `flight` and report their errors together."""
    errors = ErrorCollector()
    first, second = _bodies(errors, given)
    heat = errors.take(si, given["temperature"], "K", "temperature", least=0.0, instead=0.0)
    for name, allowed in ALLOWED.items():
        if given[name] not in allowed:
            errors.problems.append(f"{name} = {given[name]!r}; {did_you_mean(given[name], list(allowed))}")
    drift, spread = errors.take(_drift, given["target_velocity"], heat, second, instead=(REST, 0.0))
    spins, energy = errors.take(_spin, given["spin"], heat, instead=((REST, REST), 0.0))
    external = REST if given["field"] is None else errors.take(three, given["field"], "T", "field")
    tolerance = errors.take(si, given["tolerance"], "1", "tolerance", above=0.0, instead=1e-8)
    if not 1e-13 <= tolerance <= 1e-3:
        errors.problems.append(f"tolerance = {given['tolerance']!r} must lie in 1e-13 … 1e-3")
    escape = 0.0
    if not is_word(given["escape"], "auto"):
        escape = errors.take(si, given["escape"], "m", "escape", above=0.0)
    speed_si = errors.take(_speed, given["speed"], given["speed_unit"], heat, first)
    distance: Any = None
    if first is not None and second is not None and speed_si is not None:
        if given["orientation"] == "aligned" and not len(first) == len(second) == 1:
            errors.problems.append("orientation = 'aligned' is for single grains; use 'given' for aggregates")
        speed = math.dist((speed_si, 0.0, 0.0), drift)
        if speed < 1e-9 * speed_si:
            errors.problems.append("speed and target_velocity are equal: the bodies never collide")
        else:
            scales = scales_of(first, second, speed)
            distance, touch = errors.take(_distance, given["start"], scales, heat), scales.touch
            if escape and not escape > touch:
                errors.problems.append(
                    f"escape = {given['escape']!r} must exceed r1 + r2 = {format_quantity(touch, 'm')}"
                )
    errors.done()
    return Flight(
        first,
        second,
        speed_si,
        distance,
        sphere=given["start_shape"] == "sphere",
        escape=escape,
        drift=drift,
        drift_spread=spread,
        axes=ORIENTATIONS[given["orientation"]],
        spin=spins,
        spin_energy=(energy, energy),
        field=external,
        tolerance=tolerance,
        temperature=heat,
        contact=given["outcome"] == "stick",
    )


def _bodies(errors: ErrorCollector, given: dict[str, Any]) -> tuple[Any, Any]:
    """Projectile and target; None if invalid."""
    first = given["projectile"]
    if first is None:
        first = errors.take(_single_grain, given["radius"], given["material"], given["moment"])
    elif given["radius"] is not None or given["material"] is not None:
        errors.problems.append("radius and material follow from the projectile; leave them out")
    return first, first if given["target"] is None else given["target"]


def _single_grain(radius: Any, material: Material | str | None, moment: Any) -> Grains:
    """One grain at rest with its moment along +x; unlike `setup.grain`, it needs no surface energy."""
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
    """Mean velocity of the target, and the standard deviation of each component [m/s]."""
    if value is None or body is None:
        return REST, 0.0
    if is_word(value, "thermal"):
        return REST, thermal_speed(float(body.mass.sum()), heat)
    return three(value, "m/s", "target_velocity"), 0.0


def _spin(value: Any, heat: float) -> tuple[Any, float]:
    """Mean spins of both bodies [rad/s], and the mean energy of thermal spins [J]."""
    if isinstance(value, str):
        if value not in SPINS:
            raise BadInput(f"spin = {value!r}; {did_you_mean(value, list(SPINS))}, or three components in rad/s")
        if SPINS[value] > 0.0 and not heat > 0.0:
            raise BadInput(f"spin = {value!r} needs a temperature above 0 K")
        return (REST, REST), SPINS[value] * BOLTZMANN * heat
    parts = list(value) if isinstance(value, (list, tuple, np.ndarray)) and dimensions(value) else [value]
    if len(parts) == 2:
        return (three(parts[0], "rad/s", "spin of the projectile"), three(parts[1], "rad/s", "spin of the target")), 0.0
    both = three(value, "rad/s", "spin")
    return (both, both), 0.0


def _distance(start: Any, scales: Scales, heat: float) -> float:
    """Distance of the start [m]. Raises BadInput if the bodies touch there."""
    if is_word(start, "auto"):
        return max(AUTO_START * scales.capture, LEAST_START * scales.touch)
    multiple = _multiple(start, "start")
    if multiple is not None:
        times, unit = multiple
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
            f"start = {start!r}, {format_quantity(distance, 'm')}, is inside r1 + r2 = "
            f"{format_quantity(scales.touch, 'm')}; increase it"
        )
    if not distance < FARTHEST * scales.touch:
        raise BadInput(f"start = {start!r} must be at most {FARTHEST:.0e} times r1 + r2")
    return distance


def _multiple(value: Any, name: str) -> tuple[float, str] | None:
    """Number and unit of "10 b_max" or "1 R_m"; None for other values. Raises BadInput for an invalid number."""
    match = _OF_CAPTURE.fullmatch(value) if isinstance(value, str) else None
    if match is None:
        return None
    return si(match[1], "1", f"{name} in {match[2]}", least=0.0), match[2]


def impact_parameter(value: Any, setup: Flight, name: str = "impact_parameter") -> float:
    """Convert an impact parameter, a length or "0.95 b_max", to b [m] ≥ 0. Raises BadInput."""
    multiple = _multiple(value, name)
    if multiple is not None and multiple[1] == "b_max":
        b = multiple[0] * setup.scales.capture
        if setup.scales.capture == 0.0:
            raise BadInput(f"{name} = {value!r}: without moments b_max is 0; give a length")
    else:
        b = si(value, "m", name, least=0.0)
    if setup.sphere and b >= setup.distance:
        raise BadInput(
            f"{name} = {value!r} must be below the radius of the start, {format_quantity(setup.distance, 'm')}"
        )
    return b
