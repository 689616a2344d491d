"""Integers that several threads read and change: what a crew of threads needs to share its work (one of
the few modules that name numba).

Memory is ordered as if all threads took turns: what one thread wrote before an atomic write, another sees after it has
read that.  Without the compiler the functions do the same for a single thread.
"""

from __future__ import annotations

import sys
import time
from typing import Any

from llvmlite import binding, ir  # type: ignore[import-untyped]
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload

__all__ = ["fetch_add", "read", "write", "yield_cpu"]


def fetch_add(board: Any, place: int, value: int) -> int:
    """Add to board[place]; what it was before."""
    before = int(board[place])
    board[place] += value
    return before


def read(board: Any, place: int) -> int:
    """board[place]"""
    return int(board[place])


def write(board: Any, place: int, value: int) -> None:
    """board[place] = value"""
    board[place] = value


def yield_cpu() -> None:
    """Let another thread run on this core."""
    time.sleep(0.0)


def _place(context: Any, builder: Any, kind: Any, board: Any, place: Any) -> Any:
    array = context.make_array(kind)(context, builder, board)
    return builder.gep(array.data, [place])


@intrinsic
def _fetch_add(context: Any, board: Any, place: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        where = _place(context, builder, signature.args[0], given[0], given[1])
        return builder.atomic_rmw("add", where, given[2], "seq_cst")

    return types.int64(board, types.intp, types.int64), generate


@intrinsic
def _read(context: Any, board: Any, place: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        where = _place(context, builder, signature.args[0], given[0], given[1])
        return builder.load_atomic(where, "seq_cst", 8)

    return types.int64(board, types.intp), generate


@intrinsic
def _write(context: Any, board: Any, place: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        where = _place(context, builder, signature.args[0], given[0], given[1])
        builder.store_atomic(given[2], where, "seq_cst", 8)
        return context.get_dummy_value()

    return types.void(board, types.intp, types.int64), generate


_WINDOWS = "windows", "win32", "mingw"
_POSIX = "linux", "darwin", "macosx", "freebsd", "netbsd", "openbsd", "dragonfly", "solaris", "aix"
_YIELDS = dict.fromkeys(_WINDOWS, "SwitchToThread") | dict.fromkeys(_POSIX, "sched_yield")
"""The system's function that lets other threads run: no arguments, returns a 32-bit integer."""


def yield_function(triple: str) -> str | None:
    """Name of the function by which a thread lets others run, for a target such as "x86_64-pc-windows-msvc".

    Returns
    -------
    str or None
        None for systems that we know no such function of: there a waiting thread goes on looking at the board.
    """
    return next((name for part in triple.split("-")[1:] for s, name in _YIELDS.items() if part.startswith(s)), None)


def call_yield(builder: Any) -> None:
    """Add the call to the code at hand, if the system that its module is for has such a function."""
    name = yield_function(builder.module.triple)
    if name is not None:
        function = cgutils.get_or_insert_function(builder.module, ir.FunctionType(ir.IntType(32), []), name)
        builder.call(function, [])


if sys.platform == "win32":  # LLVM need not find the functions of kernel32 by itself; code from the cache neither
    import ctypes

    _address = ctypes.cast(ctypes.windll.kernel32.SwitchToThread, ctypes.c_void_p).value
    binding.add_symbol("SwitchToThread", _address)


@intrinsic
def _give_way(context: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        call_yield(builder)
        return context.get_dummy_value()

    return types.void(), generate


# numba wants the same arguments here and below, annotations included; a lambda has none


@overload(fetch_add)
def _compiled_fetch_add(board, place, value):
    return lambda board, place, value: _fetch_add(board, place, value)


@overload(read)
def _compiled_read(board, place):
    return lambda board, place: _read(board, place)


@overload(write)
def _compiled_write(board, place, value):
    return lambda board, place, value: _write(board, place, value)


@overload(yield_cpu)
def _compiled_give_way():
    return lambda: _give_way()
