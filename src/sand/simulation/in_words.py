"""Grains and forces of a simulation in words, as `sand info` and summary.json have them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from ..basics.constants import BOLTZMANN
from ..basics.descriptions import as_text, changed_arguments
from ..basics.units import MELTED, format_quantity


def grains_in_words(grains: Any, temperature: float) -> str:
    """Number, materials, radii, moments of `Grains` or of a frame, and motion by its kinetic temperature [K]."""

    def span(values: Any, text: Callable[[float], str]) -> str:
        least, most = text(float(values.min())), text(float(values.max()))
        return least if least == most else f"{least} to {most}"

    parts = [
        f"{len(grains)} of {', '.join(getattr(m, 'name', m) for m in grains.materials)}",
        f"radius {span(grains.radius, lambda v: format_quantity(v, 'm'))}",
    ]
    if grains.moment.any():
        size = (grains.moment.astype(float) ** 2).sum(axis=1) ** 0.5
        parts.append(f"moment {span(size, lambda v: f'{v:.4g} A m^2')}")
    motion = f"kinetic temperature {format_quantity(temperature, 'K')}" if temperature > 0.0 else "no relative motion"
    if temperature > MELTED:  # bodies that fly, not thermal motion; in the frame of the centre of mass
        square = 3.0 * max(len(grains) - 1, 1) * BOLTZMANN * temperature / float(grains.mass.sum())
        motion = f"rms speed {format_quantity(square**0.5, 'm/s')} about the centre of mass"
    return ", ".join([*parts, motion])


def forces_in_words(forces: Iterable[Any]) -> str:
    """Names and settings that are not the default; case.toml lists all settings."""
    return ", ".join(map(_force, forces)) or "none: grains move on straight lines"


def _force(force: Any) -> str:
    changed = changed_arguments(force).items()
    texts = [f"{key} = {'none' if value is None else as_text(value)}" for key, value in changed]
    return f"{force.name} ({', '.join(texts)})" if texts else force.name
