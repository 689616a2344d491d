"""Atomic operations on integers shared by threads, for task queues (one of the few modules that import numba).

Memory order is sequentially consistent: what a thread wrote before an atomic write is visible to any thread that has
read the written value.  Without the compiler the functions do the same for a single thread.
"""

from __future__ import annotations

import sys
import time
from typing import Any

from llvmlite import binding, ir  # type: ignore[import-untyped]
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from .jit import compiled_form

__all__ = ["fetch_add", "read", "write", "yield_cpu"]


def fetch_add(array: Any, index: int, value: int) -> int:
    """Add `value` to array[index] atomically; returns the previous value."""
    before = int(array[index])
    array[index] += value
    return before


def read(array: Any, index: int) -> int:
    """Atomic read of array[index]."""
    return int(array[index])


def write(array: Any, index: int, value: int) -> None:
    """Atomic write of array[index]."""
    array[index] = value


def yield_cpu() -> None:
    """Let the operating system run another thread on this core."""
    time.sleep(0.0)


def _element_pointer(context: Any, builder: Any, array_type: Any, array: Any, index: Any) -> Any:
    """LLVM pointer to an array element."""
    return builder.gep(context.make_array(array_type)(context, builder, array).data, [index])


@intrinsic
def _fetch_add(context: Any, array: Any, index: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        pointer = _element_pointer(context, builder, signature.args[0], args[0], args[1])
        return builder.atomic_rmw("add", pointer, args[2], "seq_cst")

    return types.int64(array, types.intp, types.int64), generate


@intrinsic
def _read(context: Any, array: Any, index: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        pointer = _element_pointer(context, builder, signature.args[0], args[0], args[1])
        return builder.load_atomic(pointer, "seq_cst", 8)

    return types.int64(array, types.intp), generate


@intrinsic
def _write(context: Any, array: Any, index: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        pointer = _element_pointer(context, builder, signature.args[0], args[0], args[1])
        builder.store_atomic(args[2], pointer, "seq_cst", 8)
        return context.get_dummy_value()

    return types.void(array, types.intp, types.int64), generate


_WINDOWS = "windows", "win32", "mingw"
_POSIX = "linux", "darwin", "macosx", "freebsd", "netbsd", "openbsd", "dragonfly", "solaris", "aix"
_YIELDS = dict.fromkeys(_WINDOWS, "SwitchToThread") | dict.fromkeys(_POSIX, "sched_yield")
"""System function that lets other threads run, by target system: no arguments, returns a 32-bit integer."""


def yield_function(triple: str) -> str | None:
    """Name of the system function that lets other threads run, for a target triple such as "x86_64-pc-windows-msvc".

    Returns
    -------
    str or None
        None if no function is known for the system; waiting threads then poll without yielding.
    """
    return next((name for part in triple.split("-")[1:] for s, name in _YIELDS.items() if part.startswith(s)), None)


def call_yield(builder: Any) -> None:
    """Generate the call, if the target system of the module has such a function."""
    name = yield_function(builder.module.triple)
    if name is not None:
        function = cgutils.get_or_insert_function(builder.module, ir.FunctionType(ir.IntType(32), []), name)
        builder.call(function, [])


if sys.platform == "win32":  # LLVM may not find functions of kernel32, neither for new code nor for code from the cache
    import ctypes

    _address = ctypes.cast(ctypes.windll.kernel32.SwitchToThread, ctypes.c_void_p).value
    binding.add_symbol("SwitchToThread", _address)


@intrinsic
def _yield_cpu(context: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        call_yield(builder)
        return context.get_dummy_value()

    return types.void(), generate


# numba requires equal signatures, including annotations, which a lambda cannot have


@compiled_form(fetch_add)
def _compiled_fetch_add(array, index, value):
    return lambda array, index, value: _fetch_add(array, index, value)


@compiled_form(read)
def _compiled_read(array, index):
    return lambda array, index: _read(array, index)


@compiled_form(write)
def _compiled_write(array, index, value):
    return lambda array, index, value: _write(array, index, value)


@compiled_form(yield_cpu)
def _compiled_yield_cpu():
    return lambda: _yield_cpu()
