"""Arrays at addresses, for loops over arrays whose number and types are data: numbers of eight, four and one bytes."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import from_dtype, types
from numba.extending import intrinsic

from .groups import array_of
from .jit import COMPILED

__all__ = ["bytes_at", "half_words_at", "words_at"]


def _array_at(dtype: Any) -> Callable[[int, int], Any]:
    """A function (address, size) → array, for compiled code, or without the compiler."""
    kind, number = types.Array(from_dtype(np.dtype(dtype)), 1, "C"), np.dtype(dtype)

    def array_at(address: int, size: int) -> Any:
        return np.frombuffer((ctypes.c_char * (int(size) * number.itemsize)).from_address(int(address)), number)

    @intrinsic
    def opened(typing_context: Any, address: Any, size: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            pointer = builder.inttoptr(given[0], context.get_value_type(types.CPointer(kind.dtype)))
            return array_of(context, builder, kind.dtype, pointer, [given[1]])

        return kind(types.int64, types.int64), generate

    # a function that is compiled cannot return an array, an intrinsic can
    return opened if COMPILED else array_at


words_at, half_words_at, bytes_at = map(_array_at, (np.int64, np.uint32, np.uint8))
