"""Integers that several threads read and change: what a crew of threads needs to share its work (one of
the few modules that name numba).

Memory is ordered as if all threads took turns: what one thread wrote before an atomic write, another sees after it has
read that.  Without the compiler the functions do the same for a single thread.
"""

from __future__ import annotations

import time
from typing import Any

from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload

__all__ = ["fetch_add", "give_way", "read", "write"]


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


def give_way() -> None:
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


@intrinsic
def _give_way(context: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        function = cgutils.get_or_insert_function(builder.module, ir.FunctionType(ir.IntType(32), []), "sched_yield")
        builder.call(function, [])
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


@overload(give_way)
def _compiled_give_way():
    return lambda: _give_way()
