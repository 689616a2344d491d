"""Calls of compiled stages by address, with numba's own calling convention."""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from .jit import kernel
from .table import ANY_TABLE

__all__ = ["call_from_python", "status_and_result"]


def status_and_result(
    context: Any, builder: Any, function: Any, table: Any, parameters: Any, block: Any
) -> tuple[Any, Any]:
    """Call a compiled stage at an address (int64), with numba's own calling convention."""
    convention, arguments = context.call_conv, (ANY_TABLE, ANY_TABLE, types.int64)
    pointer = builder.inttoptr(function, convention.get_function_type(types.int64, arguments).as_pointer())
    opaque = context.get_value_type(ANY_TABLE)
    given = [v if v.type == opaque else builder.inttoptr(v, opaque) for v in (table, parameters)]
    return convention.call_function(builder, pointer, types.int64, arguments, [*given, block])


@intrinsic
def _call_address(typing_context: Any, function: Any, table: Any, parameters: Any, block: Any) -> Any:
    """Call a compiled stage; an exception is passed on."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        status, result = status_and_result(context, builder, *given)
        with cgutils.if_unlikely(builder, status.is_error):
            context.call_conv.return_status_propagate(builder, status)
        return result

    return types.int64(types.int64, table, types.int64, types.int64), generate


def call_from_python(function, table, parameters, block):
    """Call a compiled stage: addresses of its function, of the table and of its parameters, and a block."""
    return _call_address(function, table, parameters, block)


call_from_python = kernel(call_from_python, nogil=True, purpose="the call of stages")
