"""Exit codes of the `sand` command."""

DONE = 0
FAILED = 1  # a fault of SAND itself
MISTAKE = 2  # in what was asked for
PHYSICS = 3  # the physics stopped the run
INTERRUPTED = 130
