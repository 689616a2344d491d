"""Wall times as text."""

from __future__ import annotations

YEAR = 365.25 * 86400.0
"""A year [s]."""
LONG = 360_000.0
"""Wall time [s] from which on it is given in days."""


def format_wall_time(seconds: float) -> str:
    """Wall time for people: '5.6 s', '12 min 05 s', '3 h 07 min', '12.5 days', '3e+03 years'."""
    if seconds < 60.0:
        return f"{seconds:.3g} s"
    if seconds >= LONG:
        return f"{seconds / YEAR:.3g} years" if seconds >= YEAR else f"{seconds / 86400.0:.3g} days"
    whole = round(seconds)
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"
