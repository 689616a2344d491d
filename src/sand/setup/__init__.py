"""How simulations begin."""

from .gas import gas

__all__ = ["gas"]
