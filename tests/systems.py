"""Differences between operating systems: names that may be missing, and marks for tests that some cannot run."""

import os
import signal

import pytest

KILL = getattr(signal, "SIGKILL", signal.SIGTERM)
"""Ends a process at once; on Windows `Popen.send_signal` does so for SIGTERM."""
IS_ROOT = getattr(os, "geteuid", lambda: -1)() == 0

stops_others = pytest.mark.skipif(os.name == "nt", reason="Windows sends no SIGINT or SIGTERM to another process")
keeps_modes = pytest.mark.skipif(os.name == "nt", reason="Windows has no permission bits of group and others")
needs_terminals = pytest.mark.skipif(os.name == "nt", reason="Windows has no pseudo-terminals")
