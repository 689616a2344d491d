"""Case files: validation, and the simulation that a case describes."""
