"""Case files that several tests run."""

COMPRESSION = """
[aggregate]
kind = "rbd"
grains = 12
radius = "0.1 um"
material = "ice"
[compression]
rate = "1 m/s"
to = 0.3
by = "walls"
seeds = [1, 2]
[forces.contact]
damping = "critical"
"""
"""Two packings of 12 grains of ice between walls, for `sand compress`."""
