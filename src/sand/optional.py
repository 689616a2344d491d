"""Packages that only some functions need, and that are not installed with this one."""

from __future__ import annotations

import importlib
from typing import Any

from .errors import BadInput


def optional(package: str, purpose: str) -> Any:
    """The module of an optional package.

    Parameters
    ----------
    purpose : str
        the function that needs it, for the message.

    Raises
    ------
    BadInput
        it is not installed.
    """
    try:
        return importlib.import_module(package)
    except ImportError:
        raise BadInput(f"{purpose} needs {package}, which is not installed: pip install {package}") from None
