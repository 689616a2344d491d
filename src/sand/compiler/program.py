"""The program of a simulation: its stages by number, as compiled code calls them."""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from .groups import WORD
from .jit import COMPILED, compiled_form
from .native_calls import status_and_result
from .stage import PythonStage, Stage
from .table import Table, words_of

__all__ = ["Program", "before_first_calls", "call_stage", "has_stage", "range_of", "stage_fails"]

NO_LISTS: Mapping[Any, list[Any]] = MappingProxyType({})
_NATIVE = ctypes.CFUNCTYPE(ctypes.c_int32, *[ctypes.c_void_p] * 4, ctypes.c_int64)
"""Numba's calling convention of a stage: status, pointers to result and exception, table, parameters, block."""


def _first_call(
    stage: Stage, parameters: Any, tables: list[weakref.ref[Table]], entry: np.ndarray, failures: list[BaseException]
) -> Any:
    """A function in place of a compiled stage, which compiles it, or loads it from the disk, and calls it."""

    @_NATIVE
    def compile_and_call(*arguments: Any) -> int:
        try:
            for check in before_first_calls:
                check()
            address = stage.address(tables[0](), parameters)  # type: ignore[arg-type]
            status = int(_NATIVE(address)(*arguments))
            entry[0] = address
        except BaseException as error:  # Ctrl-C, an error in a formula: passed on by `Program.run`
            failures.append(error)
            return STAGE_FAILED
        entry[2] = READY  # from here on the status that is returned is valid
        return status

    return compile_and_call


def _python_call(
    stage: PythonStage, parameters: Any, tables: list[weakref.ref[Table]], failures: list[BaseException]
) -> Any:
    """A function in place of a compiled stage, which calls a Python function with the parts of the present table."""

    @_NATIVE
    def call(result: int, _exception: Any, _table: Any, _parameters: Any, block: int) -> int:
        try:
            ctypes.c_int64.from_address(result).value = stage.in_python(tables[0](), parameters, block)  # type: ignore[arg-type]
        except BaseException as error:  # passed on by `Program.run`
            failures.append(error)
            return STAGE_FAILED
        return 0

    return call


before_first_calls: list[Callable[[], None]] = []
"""Functions called before a stage is compiled, and while a job waits for its tasks; an exception of theirs, such as
KeyboardInterrupt, prevents that."""
STAGE_FAILED = -1
"""Numba's status of a function that has raised a Python exception."""
NOT_READY, READY = 0, 1
"""Last number of an entry.  While it is NOT_READY, a Python function is called, whose status may be undefined: a signal
may raise an exception before its first line, which only the caller of the driver can pass on."""


class Program:
    """The stages of a simulation by number, with the parameters of each, as compiled code calls them.

    A stage is compiled, or loaded from the disk, when it is called for the first time.

    Parameters
    ----------
    table : Table
        The parts of the state.
    stages : dict[int, tuple[Stage | PythonStage, Any]]
        Stage and parameters by number; other numbers have no stage.
    size : int
        Number of entries besides those of lists.
    lists : dict[int, list[tuple[Stage, Any]]], optional
        Stages, at least one, with parameters by a number that stands for all of them; they get the numbers from `size`
        on.
    """

    def __init__(self, table: Table, stages: Mapping[int, Any], size: int, lists: Mapping[Any, list[Any]] = NO_LISTS):
        self.stages, self._failures = dict(stages), list[BaseException]()
        self.entries = np.zeros((size + sum(map(len, lists.values())), 3), np.int64)
        for number, own in lists.items():
            self.entries[number] = size, size + len(own), NOT_READY
            self.stages |= zip(range(size, size + len(own)), own, strict=True)
            size += len(own)
        self._rows, self._calls = list[np.ndarray](), list[Any]()
        self._tables = [weakref.ref(table)]  # the table of the present call
        if COMPILED:
            for number, (stage, parameters) in self.stages.items():
                entry, row = self.entries[number], np.array([*words_of(parameters), 0], np.int64)
                if isinstance(stage, PythonStage):
                    call = _python_call(stage, parameters, self._tables, self._failures)
                else:
                    call = _first_call(stage, parameters, self._tables, entry, self._failures)
                ready = READY if isinstance(stage, PythonStage) else NOT_READY
                entry[:] = ctypes.cast(call, ctypes.c_void_p).value, row.ctypes.data, ready
                self._rows.append(row)
                self._calls.append(call)

    def run(self, stage: Stage, table: Table) -> int:
        """Call a stage that calls the stages of this program.  Raises what the compilation of one of them raised."""
        self._failures.clear()
        self._tables[0] = weakref.ref(table)
        try:
            return stage.run(table)
        except SystemError as error:
            if self._failures:
                raise self._failures[0] from None
            # a signal has interrupted a first call before that could record the exception
            raise KeyboardInterrupt from error


def has_stage(s: Any, number: int) -> bool:
    """Whether the program among the parts `s` has a stage, or several, of this number."""
    return number in s.program.stages or bool(s.program.entries[number, 0])


def range_of(s: Any, number: int) -> tuple[int, int]:
    """First number of the stages for which a number stands, and that after the last one."""
    return int(s.program.entries[number, 0]), int(s.program.entries[number, 1])


def call_stage(s: Any, number: int, block: int = 0) -> int:
    """Call a stage of the program among the parts `s`; returns its integer.  An exception in it is passed on."""
    stage, parameters = s.program.stages[number]
    return int(stage.in_python(s, parameters, block))


def _entry_call(context: Any, builder: Any, signature: Any, given: Any) -> tuple[Any, Any, Any]:
    """Call a stage of a program; whether the entry is ready afterwards, status, and result."""
    program, number, s, block = given
    entries = context.make_array(signature.args[0])(context, builder, program).data
    first = builder.mul(number, ir.Constant(WORD, 3))

    def word(k: int) -> Any:
        return builder.load(builder.gep(entries, [builder.add(first, ir.Constant(WORD, k))]))

    status, result = status_and_result(context, builder, word(0), s, word(1), block)
    return builder.icmp_signed("==", word(2), ir.Constant(WORD, READY)), status, result


@intrinsic
def _call_entry(typing_context: Any, program: Any, number: Any, s: Any, block: Any) -> Any:
    """Call a stage of a program; an exception is passed on."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        ready, status, result = _entry_call(context, builder, signature, given)
        with cgutils.if_unlikely(builder, builder.not_(ready)):
            context.call_conv.return_exc(builder)
        with cgutils.if_unlikely(builder, status.is_error):
            context.call_conv.return_status_propagate(builder, status)
        return result

    return types.int64(program, types.int64, s, types.int64), generate


@intrinsic
def _entry_fails(typing_context: Any, program: Any, number: Any, s: Any, block: Any) -> Any:
    """Call a stage of a program; whether it raised an exception."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        ready, status, _ = _entry_call(context, builder, signature, given)
        return builder.or_(builder.not_(ready), status.is_error)

    return types.boolean(program, types.int64, s, types.int64), generate


def stage_fails(s: Any, number: int, block: int) -> bool:
    """Call a stage as `call_stage` does; returns whether it raised an exception, which is not passed on."""
    call_stage(s, number, block)  # without the compiler there is one thread, which may raise it
    return False


@compiled_form(stage_fails)
def _compiled_stage_fails(s, number, block):
    def call(s, number, block):
        return _entry_fails(s.program, number, s, block)

    return call


@compiled_form(has_stage)
def _compiled_has_stage(s, number):
    if isinstance(number, types.IntEnumMember):
        return lambda s, number: s.program[number.value, 0] != 0
    return lambda s, number: s.program[number, 0] != 0


@compiled_form(range_of)
def _compiled_range_of(s, number):
    return lambda s, number: (s.program[number, 0], s.program[number, 1])


@compiled_form(call_stage)
def _compiled_call_stage(s, number, block=0):
    def call(s, number, block=0):
        return _call_entry(s.program, number, s, block)

    return call
