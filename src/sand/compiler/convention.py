"""Calling convention of SAND's compiled functions: numba's with less code per call.

There are two differences.  The status of a call is checked only where the callee may raise an exception.  And named
tuples of arrays, some 400 scalars in all, are passed as LLVM aggregates; numba flattens them into scalars for each
call, and rebuilds them in each function.  Kernels and noinline functions have flattened arguments, because only
arguments can be declared not to overlap (LLVM's `noalias`), not parts of an aggregate.

All of this depends on numba's internals, as `lowering` does, which is the only module that imports this one.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

from llvmlite import ir  # type: ignore[import-untyped]
from llvmlite.ir.instructions import InsertValue  # type: ignore[import-untyped]
from numba.core.callconv import CPUCallConv
from numba.core.cgutils import get_or_insert_function
from numba.core.cpu import CPUContext
from numba.core.datamodel.packer import ArgPacker
from numba.core.types.containers import BaseNamedTuple, BaseTuple
from numba.core.types.npytypes import Array

__all__ = ["Builder", "Context", "flatten_arguments", "takes_aggregates"]

_FALSE = ir.Constant(ir.IntType(1), 0)
_ANALYSED = "_ZN4sand", "_ZN5numba7cpython8builtins", "_ZN5numba7cpython7numbers"
"""Name prefixes of functions for which exceptions are tracked: SAND's own, and max, min, int, powers of integers."""
_ZERO_STEP = ("range() arg 3 must not be zero",)
_may_raise: set[str] = set()
"""Names of functions that may raise exceptions, by checks of array bounds for instance, or through a callee."""
_lowered: set[str] = set()
"""Names of functions lowered in this process; of others, such as kernels from the disk cache, nothing is known."""


class Builder(ir.IRBuilder):
    """LLVM instruction builder that omits redundant instructions."""

    def extract_value(self, agg: Any, idx: Any, name: str = "") -> Any:
        """Return the value that was inserted into an aggregate instead of extracting it."""
        path = list(idx) if isinstance(idx, (list, tuple)) else [idx]
        while path and isinstance(agg, InsertValue):
            inner = list(agg.indices)
            if path[: len(inner)] == inner:
                agg, path = agg.value, path[len(inner) :]
            elif inner[: len(path)] == path:
                break
            else:
                agg = agg.aggregate
        return super().extract_value(agg, path, name) if path else agg

    @contextmanager
    def if_then(self, pred: Any, likely: bool | None = None) -> Iterator[Any]:
        """Generate no branch for a condition that is always false."""
        if pred is _FALSE:
            with self.goto_block(ir.Block(self.function)):
                yield None
        else:
            with super().if_then(pred, likely) as end:
                yield end


def mark_lowered(name: str) -> None:
    """Record that a function was lowered here, so that `_may_raise` tells whether it raises exceptions."""
    _lowered.add(name)


_flattened_functions: set[str] = set()
"""Names of functions whose arguments are flattened."""


def flatten_arguments(name: str) -> None:
    """Use numba's flattened arguments for a function; must be called before the function is declared."""
    _flattened_functions.add(name)


_aggregate_functions: set[str] = set()
"""Names of functions with an argument that is passed as an aggregate."""


def takes_aggregates(name: str) -> bool:
    """Whether a function has aggregate arguments, so that only functions compiled by `lowering` can call it."""
    return name in _aggregate_functions


def _has_arrays(value_type: Any) -> bool:
    """Whether a type is an array or a tuple that contains arrays."""
    if isinstance(value_type, Array):
        return True
    return isinstance(value_type, BaseTuple) and any(_has_arrays(each) for each in value_type.types)


def _is_aggregate(value_type: Any) -> bool:
    """Whether values of a type are passed as aggregates: named tuples of SAND that contain arrays."""
    own = isinstance(value_type, BaseNamedTuple) and value_type.instance_class.__module__.startswith("sand.")
    return own and _has_arrays(value_type)


class _AggregateModel:
    """Data model of an argument that is passed as an aggregate."""

    def __init__(self, model: Any):
        self.get_argument_type = model.get_value_type

    def as_argument(self, builder: Any, value: Any) -> Any:
        """The value itself."""
        return value

    from_argument = as_argument


class _ArgumentModels:
    """Data models by argument type."""

    def __init__(self, models: Any):
        self._models = models

    def lookup(self, value_type: Any) -> Any:
        """Data model of one type."""
        model = self._models.lookup(value_type)
        return _AggregateModel(model) if _is_aggregate(value_type) else model


class _Packer(ArgPacker):
    def assign_names(self, args: Any, names: Any) -> None:
        """Do nothing: names of LLVM values are not needed."""


class _CallConvention(CPUCallConv):
    """Calls with aggregate arguments, without status checks where the callee cannot raise."""

    aggregates = False

    def select(self, name: str) -> _CallConvention:
        """The convention for a function of this name."""
        self.aggregates = name.startswith(_ANALYSED[0]) and name not in _flattened_functions
        return self

    def _get_arg_packer(self, argtypes: Any) -> Any:
        return self.context.packer_for(argtypes, self.aggregates)

    def decorate_function(self, fn: Any, *args: Any, **options: Any) -> None:
        """As in numba, for the convention of this function."""
        self.select(fn.name)
        super().decorate_function(fn, *args, **options)

    def decode_arguments(self, builder: Any, argtypes: Any, func: Any) -> Any:
        """As in numba, for the convention of this function."""
        self.select(func.name)
        return super().decode_arguments(builder, argtypes, func)

    def call_function(self, builder: Any, callee: Any, *args: Any, **options: Any) -> Any:
        """As in numba, but with a constant status if the callee cannot raise."""
        self.select(callee.name)
        status, result = super().call_function(builder, callee, *args, **options)
        analysed = callee.name in _lowered or callee.name.startswith(_ANALYSED[1:])
        if analysed and callee.name not in _may_raise:
            return status._replace(is_error=_FALSE), result
        _may_raise.add(builder.function.name)
        return status, result

    def return_user_exc(self, builder: Any, exc: Any, exc_args: Any = None, *rest: Any, **options: Any) -> None:
        """Raise an exception, and mark the function as raising.

        Two exceptions do not count, since SAND never causes them: a `range` with step 0 and a negative power of 0.
        """
        if exc_args != _ZERO_STEP and not builder.function.name.startswith(_ANALYSED[1:]):
            _may_raise.add(builder.function.name)
        super().return_user_exc(builder, exc, exc_args, *rest, **options)

    def return_status_propagate(self, builder: Any, status: Any) -> None:
        """Propagate an exception of a callee."""
        if status.is_error is not _FALSE:
            super().return_status_propagate(builder, status)


class Context(CPUContext):
    """Target context with the calling convention."""

    call_conv = property(_CallConvention)
    packers: ClassVar[dict[Any, Any]] = {}

    def packer_for(self, argtypes: Any, aggregates: bool) -> Any:
        """Argument packer for a set of types and a convention, created once."""
        key = tuple(t._code for t in argtypes), aggregates
        if key not in self.packers:
            models = self.data_model_manager
            self.packers[key] = _Packer(_ArgumentModels(models) if aggregates else models, argtypes)
        return self.packers[key]

    def declare_function(self, module: Any, fndesc: Any) -> Any:
        """Declare a function with the arguments of its convention."""
        convention = self.call_conv.select(fndesc.mangled_name)
        function_type = convention.get_function_type(fndesc.restype, fndesc.argtypes)
        get_or_insert_function(module, function_type, fndesc.mangled_name)
        if convention.aggregates and any(map(_is_aggregate, fndesc.argtypes)):
            _aggregate_functions.add(fndesc.mangled_name)
        return super().declare_function(module, fndesc)
