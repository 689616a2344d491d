"""All integrators of SAND, registered by their import here: one line for each."""

from __future__ import annotations

from typing import Any

from ..errors import BadInput, shown
from . import adaptive as adaptive
from . import forest_ruth as forest_ruth
from . import verlet as verlet
from .base import INTEGRATORS, Integrator


def checked_integrator(value: Any) -> Integrator:
    """The value, if it is settings of an integrator.  Raises BadInput with what to give instead."""
    if isinstance(value, type) and value in INTEGRATORS.values():
        raise BadInput(f"stepping = {shown(value)} is a class; write {shown(value)}(…) to make one")
    if isinstance(value, type) or not isinstance(value, Integrator):
        choices = " or ".join(f"{shown(each)}(…)" for each in INTEGRATORS.values())
        raise BadInput(f"stepping = {shown(value)}; give {choices}")
    return value
