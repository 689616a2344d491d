"""Closed forms: what one can know without running anything."""

from .contact import ContactNumbers, contact

__all__ = ["ContactNumbers", "contact"]
