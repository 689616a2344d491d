"""Exit codes of the `sand` command."""

DONE, FAILED, BAD_INPUT, PHYSICS, WALL_TIME, INTERRUPTED = 0, 1, 2, 3, 4, 130
"""Exit codes: success, an internal error, an error of the user or of files, a run stopped by physics, the wall time
allowed is used up, Ctrl-C or another signal."""
