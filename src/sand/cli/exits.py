"""Exit codes of the `sand` command."""

DONE, FAILED, BAD_INPUT, PHYSICS, INTERRUPTED = 0, 1, 2, 3, 130
"""Exit codes: success, an internal error, an error of the user, a run stopped by physics, Ctrl-C."""
