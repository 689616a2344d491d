"""Functions with other code in each kind of box, the type of their last argument: `Span`, `MovingSpan`, `TiltedSpan`.

So a box that keeps its shape, or is not sheared, does not compile what others need.
"""

import functools
from collections.abc import Callable
from typing import Any

from ..basics.box import MovingSpan, Span, TiltedSpan
from ..compiler.jit import compiled_form


def _by_kind(still: Callable, moving: Callable, tilted: Callable) -> Callable:
    """The function that is one of three, in Python and in compiled code."""
    forms: dict[type, Callable] = {Span: still, MovingSpan: moving, TiltedSpan: tilted}

    @functools.wraps(tilted)
    def either(*given: Any) -> Any:
        return forms[type(given[-1])](*given)

    @functools.wraps(tilted)
    def form(*types: Any) -> Callable:
        return forms[types[-1].instance_class]

    compiled_form(either)(form)
    return either


def unless_still(still: Callable) -> Callable[[Callable], Callable]:
    """Decorator of a function whose last argument is a box that moves; `still` replaces it where the box does not."""
    return lambda moving: _by_kind(still, moving, moving)


def unless_straight(straight: Callable) -> Callable[[Callable], Callable]:
    """Decorator of a function whose last argument is a tilted box; `straight` replaces it in all other boxes."""
    return lambda tilted: _by_kind(straight, straight, tilted)
