"""Where near pairs keep the numbers of their kind: one place for all where all grains are equal."""

from ..compiler.jit import loop
from ..state.state import PAIRS


@loop
def kind_at(near, p):
    """The place of the numbers of pair p."""
    return p if near.step.size > 1 else 0


@loop
def kinds(near, count):
    """How many places are in use."""
    return min(count[PAIRS], near.step.size)
