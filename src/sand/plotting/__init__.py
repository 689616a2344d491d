"""Figures of runs and experiments, and rendered images of grains."""

from __future__ import annotations

import contextlib
import os
import sys


def _import_matplotlib() -> None:
    """Import matplotlib whatever backend `MPLBACKEND` names.

    Figures are files, which need none.  For windows the backend is used if there is one of this name; matplotlib itself
    could not be imported for that of a notebook in another environment.
    """
    if "matplotlib" in sys.modules:
        return
    named = os.environ.pop("MPLBACKEND", "")
    try:
        import matplotlib
    finally:
        if named:
            os.environ["MPLBACKEND"] = named
    if named:
        with contextlib.suppress(ValueError):
            matplotlib.rcParams["backend"] = named


_import_matplotlib()
