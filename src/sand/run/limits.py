"""The largest numbers that may be asked for."""

from ..core.units import MOST_GRAINS

__all__ = ["MOST_GRAINS", "MOST_PROCESSES", "MOST_SEED", "MOST_STEPS"]

MOST_STEPS = 2**62
"""Steps are counted in 64 bits."""
MOST_SEED = 2**63 - 1
"""The largest seed that the kernels take."""
MOST_PROCESSES = 1024
"""Processes or threads that share the work."""
