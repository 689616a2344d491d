"""Expected number of flights of a scattering job, and their wall time."""

from __future__ import annotations

from collections.abc import Sequence

from .encounters import Flight
from .scatter_case import ScatterCase

PER_FLIGHT = 2e-3
"""Rough wall time [s] of the flight of two magnetic grains; of aggregates, of each pair of their grains."""
PER_CROSS_SECTION = 1.0
"""Flights of a cross-section, times the square of its relative error."""
START = 3.0
"""Wall time [s] of start and figure."""


def expected_flights(case: ScatterCase, flights: Sequence[Flight]) -> tuple[float, float, str]:
    """Expected number of flights of a job, their wall time [s] by one worker, and what that is known from."""
    settings = case.measure
    each = {
        "map": float(settings.cells * settings.per_cell),
        "trajectories": float(len(settings.impact_parameters)),
        "cross-section": max(PER_CROSS_SECTION / settings.relative_error**2, 100.0),
    }[settings.job]
    pairs = sum(len(one.projectile) * len(one.target) for one in flights)
    return each * len(flights), START + each * pairs * PER_FLIGHT, "rough estimate"
