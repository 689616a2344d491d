"""Expected cost of a run: touches, numbers of steps, and wall time."""
