"""The largest numbers that may be asked for."""

MOST_GRAINS = 10**8
"""Of one simulation; the state of so many takes about 100 GB."""
MOST_STEPS = 2**62
"""Steps are counted in 64 bits."""
MOST_SEED = 2**63 - 1
"""The largest seed that the kernels take."""
MOST_PROCESSES = 1024
"""Processes or threads that share the work."""
