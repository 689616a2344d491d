"""Random numbers of the events of a Monte Carlo method: functions of (seed, event), as those of flights."""

from ...numerics.random import random_words, uniform

EVENT_STREAM = 32
"""First stream of the random words of events, beside those of `initial_conditions`."""


def event_uniforms(seed: int, event: int, block: int = 0) -> tuple[float, ...]:
    """Eight independent uniform deviates, 0 < u < 1, of an event and a block of its numbers."""
    words = (random_words(seed, event, 0, EVENT_STREAM + 2 * block + k) for k in range(2))
    return tuple(uniform(word) for four in words for word in four)
