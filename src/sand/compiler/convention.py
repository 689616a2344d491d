"""How our compiled functions call each other: numba's own way, with less to write down.

Two things are different.  How a call ended is looked at only where something can be raised.  And the tuples of arrays
that go from function to function, some 400 numbers, are passed as they are: numba takes them apart for each call, and
puts them together again in each function.  Kernels and functions that are kept apart take them apart, because only of
arguments of their own can LLVM be told that no two arrays overlap.

All of it leans on numba's inside, as `lowering` does; nobody else imports this.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

from llvmlite import ir  # type: ignore[import-untyped]
from llvmlite.ir import instructions as made  # type: ignore[import-untyped]
from numba.core.callconv import CPUCallConv
from numba.core.cgutils import get_or_insert_function
from numba.core.cpu import CPUContext
from numba.core.datamodel.packer import ArgPacker
from numba.core.types.containers import BaseNamedTuple, BaseTuple
from numba.core.types.npytypes import Array

__all__ = ["Builder", "Context", "ours_alone", "take_apart"]

_NEVER = ir.Constant(ir.IntType(1), 0)
_KNOWN = "_ZN4sand", "_ZN5numba7cpython8builtins", "_ZN5numba7cpython7numbers"
"""How the names of functions begin that we can tell of: our own, and max, min, int, powers of integers."""
_STEP_OF_0 = ("range() arg 3 must not be zero",)
_loud: set[str] = set()
"""Names of those that may raise: with bounds that are checked, for instance, or because they call others."""


class Builder(ir.IRBuilder):
    """Writes down less."""

    def extract_value(self, agg: Any, idx: Any, name: str = "") -> Any:
        """What was put into a tuple is taken from there, not out of the tuple."""
        place = list(idx) if isinstance(idx, (list, tuple)) else [idx]
        while place and isinstance(agg, made.InsertValue):
            there = list(agg.indices)
            if place[: len(there)] == there:
                agg, place = agg.value, place[len(there) :]
            elif there[: len(place)] == place:
                break
            else:
                agg = agg.aggregate
        return super().extract_value(agg, place, name) if place else agg

    @contextmanager
    def if_then(self, pred: Any, likely: bool | None = None) -> Iterator[Any]:
        """Nothing where it never happens."""
        if pred is _NEVER:
            with self.goto_block(ir.Block(self.function)):
                yield None
        else:
            with super().if_then(pred, likely) as end:
                yield end


_apart: set[str] = set()
"""Names of functions whose arguments are taken apart."""


def take_apart(name: str) -> None:
    """Let a function of ours have its arguments as numba passes them; to be said before it is declared."""
    _apart.add(name)


_whole: set[str] = set()
"""Names of functions with an argument that is passed as it is."""


def ours_alone(name: str) -> bool:
    """True for a function that only ours may call: others would pass its arguments in another way."""
    return name in _whole


def _has_arrays(kind: Any) -> bool:
    if isinstance(kind, Array):
        return True
    return isinstance(kind, BaseTuple) and any(_has_arrays(each) for each in kind.types)


def _passed_whole(kind: Any) -> bool:
    """True for our own named tuples with arrays in them."""
    ours = isinstance(kind, BaseNamedTuple) and kind.instance_class.__module__.startswith("sand.")
    return ours and _has_arrays(kind)


class _Whole:
    """How a value is passed that stays as it is."""

    def __init__(self, model: Any):
        self.get_argument_type = model.get_value_type

    def as_argument(self, builder: Any, value: Any) -> Any:
        """As it is."""
        return value

    from_argument = as_argument


class _Models:
    """How values of each type are passed."""

    def __init__(self, models: Any):
        self._models = models

    def lookup(self, kind: Any) -> Any:
        """For one type."""
        model = self._models.lookup(kind)
        return _Whole(model) if _passed_whole(kind) else model


class _Packer(ArgPacker):
    def assign_names(self, args: Any, names: Any) -> None:
        """They have names, if only numbers."""


class _Convention(CPUCallConv):
    """Arguments that are passed whole; calls of functions that do not raise, where how they ended is not looked at."""

    whole = False

    def of(self, name: str) -> _Convention:
        """The same for a function of this name."""
        self.whole = name.startswith(_KNOWN[0]) and name not in _apart
        return self

    def _get_arg_packer(self, argtypes: Any) -> Any:
        return self.context.packer_for(argtypes, self.whole)

    def decorate_function(self, fn: Any, *given: Any, **options: Any) -> None:
        """As always."""
        self.of(fn.name)
        super().decorate_function(fn, *given, **options)

    def decode_arguments(self, builder: Any, argtypes: Any, func: Any) -> Any:
        """As always."""
        self.of(func.name)
        return super().decode_arguments(builder, argtypes, func)

    def call_function(self, builder: Any, callee: Any, *given: Any, **options: Any) -> Any:
        """As always, but for the look at how it ended."""
        self.of(callee.name)
        status, result = super().call_function(builder, callee, *given, **options)
        if callee.name.startswith(_KNOWN) and callee.name not in _loud:
            return status._replace(is_error=_NEVER), result
        _loud.add(builder.function.name)
        return status, result

    def return_user_exc(self, builder: Any, exc: Any, exc_args: Any = None, *rest: Any, **options: Any) -> None:
        """Raise: callers must look, but for what ours never do, a `range` in steps of 0, a negative power of 0."""
        if exc_args != _STEP_OF_0 and not builder.function.name.startswith(_KNOWN[1:]):
            _loud.add(builder.function.name)
        super().return_user_exc(builder, exc, exc_args, *rest, **options)

    def return_status_propagate(self, builder: Any, status: Any) -> None:
        """Pass on what was raised."""
        if status.is_error is not _NEVER:
            super().return_status_propagate(builder, status)


class Context(CPUContext):
    """What it takes to lower."""

    call_conv = property(_Convention)
    packers: ClassVar[dict[Any, Any]] = {}

    def packer_for(self, argtypes: Any, whole: bool) -> Any:
        """One for each set of types and way to pass them."""
        key = tuple(t._code for t in argtypes), whole
        if key not in self.packers:
            models = self.data_model_manager
            self.packers[key] = _Packer(_Models(models) if whole else models, argtypes)
        return self.packers[key]

    def declare_function(self, module: Any, fndesc: Any) -> Any:
        """As always, once it is there with the arguments that it has."""
        convention = self.call_conv.of(fndesc.mangled_name)
        kind = convention.get_function_type(fndesc.restype, fndesc.argtypes)
        get_or_insert_function(module, kind, fndesc.mangled_name)
        if convention.whole and any(map(_passed_whole, fndesc.argtypes)):
            _whole.add(fndesc.mangled_name)
        return super().declare_function(module, fndesc)
