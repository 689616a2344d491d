"""Stages: compiled functions that are called by address, with the state of a simulation in a table of addresses.

A stage is an ordinary loop whose arguments are *parts* of the state by name, such as `grains`, `contacts` or `clock`.
It is compiled and cached alone, for the types of these parts only.  A stage that calls others takes all parts that they
need as one argument `s`, with `s.grains` and so on.  The compiled form of a stage takes three numbers:

    stage(table, parameters, block) → int64

`table` is the address of a row of addresses, one for each part (`table.Table`); `parameters` is the address of the
stage's own parameters, such as those of one force; `block` is the number of a block of its loop.  The driver of a
simulation is compiled once for all forces and calls stages by address (`program.Program`), and so do worker threads.
Without the compiler a stage is called as a Python function with the parts themselves.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from operator import is_
from types import FunctionType
from typing import Any

import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.extending import lower_builtin, type_callable

from .entries import machine_code
from .jit import COMPILED, caller, in_cache, kernel, loop, rare, separate
from .native_calls import call_from_python
from .processor import FAST_512_BIT, SLOW_GATHER, target
from .progress import making_code
from .table import (
    ALL_PARTS,
    ANY_TABLE,
    BLOCK_NUMBER,
    PARAMETERS,
    SPECIAL,
    Address,
    Parts,
    Table,
    address_of,
    kind_of,
    open_parts,
    structure_of,
    words_of,
)
from .user_code import code_digest

__all__ = ["PythonStage", "Stage", "stage"]

MOST_CALLS = 256
"""Calls of stages with parameters that a table keeps."""
Place = Callable[[str], tuple[int, Any]]
"""Index in the table and structure of a part, by its name."""


def is_not_inlined() -> None:
    """First line of a function that is not inlined."""


def arrays_do_not_overlap() -> None:
    """First line of a function that is not inlined, and whose arrays do not overlap, so that its loops vectorise."""


def long_arrays_do_not_overlap() -> None:
    """As `arrays_do_not_overlap`, for loops of about 64 iterations and more."""


def _set_attributes(mark: Callable, no_overlap: bool, long_vectors: bool) -> None:
    """Make a call of `mark` set the attributes of the compiled function that contains it."""

    @type_callable(mark)
    def type_of_mark(typing_context: Any) -> Any:
        return lambda: types.none

    @lower_builtin(mark)
    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        function = builder.function
        function.attributes.add("noinline")
        for argument in function.args if no_overlap else ():
            if isinstance(argument.type, ir.PointerType) and "noalias" not in argument.attributes:
                argument.add_attribute("noalias")
        # llvmlite has no attributes with values, but prints the members of the set verbatim
        if SLOW_GATHER:
            features = f"{target()[1]},+prefer-no-gather".lstrip(",")
            set.add(function.attributes, f'"target-features"="{features}"')
        if long_vectors and FAST_512_BIT:
            set.add(function.attributes, '"prefer-vector-width"="512"')
        return context.get_dummy_value()


_set_attributes(is_not_inlined, no_overlap=False, long_vectors=False)
_set_attributes(arrays_do_not_overlap, no_overlap=True, long_vectors=False)
_set_attributes(long_arrays_do_not_overlap, no_overlap=True, long_vectors=True)


def _renamed(function: Any, name: str) -> Any:
    """A copy of a function with a name of its own, under which its compiled code is cached."""
    copy = FunctionType(function.__code__, function.__globals__, function.__name__, None, function.__closure__)
    copy.__qualname__, copy.__module__ = name, function.__module__
    return copy


class Stage:
    """A function of parts of the state that is compiled alone and called by address.

    Attributes
    ----------
    function : callable
        The function; its arguments are names of parts, `s`, `block` or `parameters`.  One that calls other stages takes
        `s`, whose attributes are the parts.
    needs : tuple of str
        Names of its arguments.
    parts : tuple of str
        Names of the parts for whose types it is compiled: arguments, and attributes of `s`.
    purpose : str
        What it computes.
    is_cached : bool
        Whether its machine code is cached on the disk.
    seconds : float
        Rough wall time [s] of its compilation.
    """

    def __init__(
        self, function: Callable, purpose: str, long_vectors: bool, cached: bool, parts: tuple[str, ...], seconds: float
    ):
        self.function, self.purpose, self._long_vectors, self.is_cached = function, purpose, long_vectors, cached
        self.seconds = seconds
        self.needs = tuple(inspect.signature(function).parameters)
        self.parts = *(name for name in self.needs if name not in SPECIAL), *parts
        self._compiled, self._compiler = dict[Any, Any](), None

    def __deepcopy__(self, memo: dict[int, Any]) -> Stage:
        """The stage itself, which holds no data of a simulation."""
        return self

    def address(self, table: Table, parameters: Any) -> int:
        """Address of the compiled function for the types of these parts; compiles it, or loads it from the disk."""
        key = self.key(table, parameters)
        if key not in self._compiled:
            dispatcher, signature = self.to_compile(table.place, structure_of(parameters))
            with making_code:  # also of uncached code
                dispatcher.compile(signature)
            found = dispatcher.overloads[signature.args]
            self._compiled[key] = found, machine_code(found).get_pointer_to_function(found.fndesc.llvm_func_name)
        return int(self._compiled[key][1])

    def key(self, table: Table, parameters: Any) -> Any:
        """What identifies the types of these parts."""
        return structure_of(parameters), *map(table.key, self.parts)

    def to_compile(self, place: Place, own: Any) -> tuple[Any, Any]:
        """Numba's dispatcher, and the signature for parts at these places and parameters of this structure."""
        parts = tuple(self._part(name, place, own) for name in self.needs)
        self._compiler = self._compiler or self._dispatcher()
        return self._compiler, types.int64(Address(parts), ANY_TABLE, types.int64)

    def is_compiled(self, table: Table, parameters: Any = ()) -> bool:
        """Whether the machine code for these parts exists, in this process or on the disk; nothing is compiled."""
        if not COMPILED or self.key(table, parameters) in self._compiled:
            return True
        return in_cache(*self.to_compile(table.place, structure_of(parameters)))

    def in_python(self, table: Table, parameters: Any, block: int) -> Any:
        """Call the function without the compiler."""
        special = {ALL_PARTS: table, BLOCK_NUMBER: block, PARAMETERS: parameters}
        return self.function(*(special[name] if name in special else table[name] for name in self.needs))

    def prepare(self, table: Table, parameters: Any = (), block: int = 0) -> Callable[[], int]:
        """Compile the stage for the present parts of a table; returns a function that calls it once.

        The call keeps the present arrays alive, whatever parts the table has afterwards.
        """
        if not COMPILED:
            return lambda: int(self.in_python(table, parameters, block))
        self.address(table, parameters)
        present = table.snapshot()
        return lambda: self.run(present, parameters, block)

    def __call__(self, *parts: Any) -> int:
        """Call the stage from Python with its arguments in order; returns the integer that the function returns."""
        if not COMPILED:
            return int(self.function(*parts))
        given = dict(zip(self.needs, parts, strict=True))
        parameters, block, table = given.pop(PARAMETERS, ()), given.pop(BLOCK_NUMBER, 0), Table(tuple(given))
        for name, value in given.items():
            table.set(name, value)
        return self.run(table, parameters, block)

    def run(self, table: Table, parameters: Any = (), block: int = 0) -> int:
        """Call the stage from Python; returns the integer that the function returns."""
        if not COMPILED:
            return int(self.in_python(table, parameters, block))
        if isinstance(parameters, tuple) and not parameters:
            address = table.stages.get(self) or table.stages.setdefault(self, self.address(table, parameters))
            return int(call_from_python(address, table.address, table.address, block))
        call = table.calls.get((self, id(parameters[0])))
        if call is None or not _has_same_members(parameters, call[0]):
            if len(table.calls) >= MOST_CALLS:
                table.calls.clear()
            row = np.array([*words_of(parameters), 0], np.int64)
            call = parameters, row, self.address(table, parameters), address_of(row)
            table.calls[self, id(parameters[0])] = call
        return int(call_from_python(call[2], table.address, call[3], block))

    def _part(self, name: str, place: Place, own: Any) -> tuple[Any, Any]:
        """Index in the table, or name, and type of one argument; `own` is the structure of the parameters."""
        if name == PARAMETERS:
            return name, kind_of(own)
        if name == BLOCK_NUMBER:
            return name, types.int64
        if name == ALL_PARTS:
            places = ((part, *place(part)) for part in self.parts)
            return name, Parts(tuple((part, index, kind_of(structure)) for part, index, structure in places))
        index, structure = place(name)
        return index, kind_of(structure)

    def _dispatcher(self) -> Any:
        """What numba makes of the function, for any types."""
        # stages that this one calls may change its arrays
        calls_stages = ALL_PARTS in self.needs
        wide = self._long_vectors and FAST_512_BIT
        keep = long_arrays_do_not_overlap if wide else arrays_do_not_overlap
        keep, body = (is_not_inlined, caller(self.function)) if calls_stages else (keep, loop(self.function))

        def separated(*parts):
            keep()
            return body(*parts)

        separated = (rare if calls_stages else separate)(separated)

        def entry(table, parameters, block):
            return separated(*open_parts(table, parameters, block))

        # symbols of machine code that several processes have compiled must differ
        words = self.function.__qualname__, "wide" if wide else "", code_digest(self.function) or ""
        entry = _renamed(entry, "_".join(word for word in words if word))
        return kernel(entry, cached=self.is_cached, nogil=True, wrapper=False, purpose=self.purpose)


def _has_same_members(one: Any, other: Any) -> bool:
    """Whether two values are tuples of one type and of the same objects."""
    is_tuple = isinstance(one, tuple) and type(one) is type(other) and len(one) == len(other)
    return is_tuple and all(map(is_, one, other))


class PythonStage:
    """An ordinary Python function of parts of the state, which a program calls by address like a compiled stage.

    It holds the GIL, so that it suits few calls of library functions, such as Fourier transforms; a call costs a few
    microseconds.

    Attributes
    ----------
    function : callable
        The function; its arguments are names of parts, `block` or `parameters`. It returns an integer.
    needs : tuple of str
        Names of its arguments.
    """

    def __init__(self, function: Callable):
        self.function = function
        self.needs = tuple(inspect.signature(function).parameters)

    def __deepcopy__(self, memo: dict[int, Any]) -> PythonStage:
        """The stage itself, which holds no data of a simulation."""
        return self

    def in_python(self, table: Table, parameters: Any, block: int) -> Any:
        """Call the function."""
        special = {ALL_PARTS: table, BLOCK_NUMBER: block, PARAMETERS: parameters}
        return self.function(*(special[name] if name in special else table[name] for name in self.needs))

    def run(self, table: Table, parameters: Any = (), block: int = 0) -> int:
        """Call the function; returns its integer."""
        return int(self.in_python(table, parameters, block))


def stage(
    purpose: str,
    *,
    long_vectors: bool = False,
    cached: bool = True,
    parts: tuple[str, ...] = (),
    seconds: float = 0.5,
) -> Callable[[Callable], Stage]:
    """Decorator that makes a `Stage` of a function whose arguments are names of parts.

    Parameters
    ----------
    purpose : str
        What it computes, for the note shown while it is compiled.
    long_vectors : bool, optional
        True for loops of about 64 iterations and more, which profit from the longest SIMD vectors.
    cached : bool, optional
        False to compile it in each process.  Otherwise it is cached on disk, code with formulas of the user by their
        source; code with other objects of the user is never cached.
    parts : tuple of str, optional
        Of a stage with the argument `s`: names of its attributes.
    seconds : float, optional
        Rough wall time [s] of its compilation, until it is measured; stages that take longest are compiled first.
    """
    return lambda function: Stage(function, purpose, long_vectors, cached, parts, seconds)
