"""Stages: compiled functions that are called by address, with the state of a simulation in a table of addresses.

A stage is an ordinary loop whose arguments are *parts* of the state by name, such as `grains`, `contacts` or `clock`.
It is compiled and cached alone, for the types of these parts only.  Its compiled form takes three numbers:

    stage(table, parameters, block) → int64

`table` is the address of a row of addresses, one for each part; `parameters` is the address of the stage's own
parameters, such as those of one force; `block` is the number of a block of its loop.  The driver of a simulation is
compiled once for all forces and calls stages by address, and so do worker threads.

NamedTuples of arrays become `Group`s, of one pointer per array and the lengths: numba's own tuples of arrays make
functions with hundreds of arguments, which take half as long again to compile.  Without the compiler a stage is called
as a Python function with the parts themselves.
"""

from __future__ import annotations

import ctypes
import inspect
import weakref
from collections.abc import Callable, Mapping
from functools import cache
from types import FunctionType
from typing import Any

import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba import from_dtype, types
from numba.core import cgutils
from numba.core.datamodel import models
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    infer_getattr,
    intrinsic,
    lower_builtin,
    lower_getattr_generic,
    overload,
    register_model,
    type_callable,
)

from .jit import COMPILED, caller, kernel, loop, rare, separate
from .processor import FAST_512_BIT, SLOW_GATHER, target
from .user_code import user_code_digest

__all__ = ["Program", "Stage", "Table", "call_stage", "has_stage", "stage", "stage_fails"]

WORD = ir.IntType(64)
ROW = ir.IntType(64).as_pointer()


class Group(types.Type):
    """Type of a NamedTuple of arrays in compiled code: pointers to the arrays, and to the row with their lengths.

    Parameters
    ----------
    fields : tuple
        (name, dtype, number of axes) of each array.
    """

    def __init__(self, fields: tuple[tuple[str, Any, int], ...]):
        self.fields = fields
        super().__init__(name=f"Group({', '.join(f'{name}: {dtype} {axes}' for name, dtype, axes in fields)})")


@register_model(Group)
class _GroupModel(models.StructModel):
    def __init__(self, manager: Any, group: Group):
        pointers = [(name, types.CPointer(dtype)) for name, dtype, _ in group.fields]
        super().__init__(manager, group, [*pointers, ("row", types.CPointer(types.int64))])


@infer_getattr
class _GroupAttribute(AttributeTemplate):
    key = Group

    def generic_resolve(self, group: Group, name: str) -> Any:
        """The type of one array."""
        return next((types.Array(dtype, axes, "C") for n, dtype, axes in group.fields if n == name), None)


@lower_getattr_generic(Group)
def _array_of_group(context: Any, builder: Any, group: Group, value: Any, name: str) -> Any:
    number = [n for n, _, _ in group.fields].index(name)
    _, dtype, axes = group.fields[number]
    first = len(group.fields) + sum(axes for _, _, axes in group.fields[:number])
    row = builder.extract_value(value, len(group.fields))
    shape = [_constant_word(builder, row, first + axis) for axis in range(axes)]
    return _array(context, builder, dtype, builder.extract_value(value, number), shape)


def _constant_word(builder: Any, row: Any, index: int) -> Any:
    """A word of a row, which does not change during a call of a stage, so that loops need not read it again."""
    word = builder.load(builder.gep(row, [ir.Constant(WORD, index)]))
    word.set_metadata("invariant.load", builder.module.add_metadata([]))
    return word


def _array(context: Any, builder: Any, dtype: Any, data: Any, shape: list[Any]) -> Any:
    """A contiguous array of numba from a pointer and lengths."""
    kind = types.Array(dtype, len(shape), "C")
    model = context.data_model_manager[kind]
    found = ir.Constant(model.get_value_type(), None)  # zeros, for the owner of the memory
    size = ir.Constant(WORD, 1 if dtype == types.boolean else dtype.bitwidth // 8)
    strides, step = list[Any](), size
    for k, length in enumerate(reversed(shape)):
        strides.insert(0, step)
        step = builder.mul(step, length) if k + 1 < len(shape) else step
    for name, value in (("itemsize", size), ("data", data)):
        found = builder.insert_value(found, value, model.get_field_position(name))
    for name, values in (("shape", shape), ("strides", strides)):
        for axis, value in enumerate(values):
            found = builder.insert_value(found, value, [model.get_field_position(name), axis])
    total = shape[0]
    for length in shape[1:]:
        total = builder.mul(total, length)
    return builder.insert_value(found, total, model.get_field_position("nitems"))


class Address(types.Opaque):
    """Type of the address of a row; `parts` are (index in the table, type), or the type of the only part itself."""

    def __init__(self, parts: Any):
        self.parts = parts
        super().__init__(name=f"Address({_described(parts)})")


def _described(kind: Any) -> str:
    """Name of a type that identifies it; numba's names of named tuples lack those of their members."""
    if isinstance(kind, types.BaseNamedTuple):
        name = f"{kind.instance_class.__module__}.{kind.instance_class.__qualname__}"
        return f"{name}({', '.join(f'{n}: {_described(t)}' for n, t in zip(kind.fields, kind.types, strict=True))})"
    if isinstance(kind, (types.BaseTuple, tuple)):
        return f"({', '.join(map(_described, kind.types if isinstance(kind, types.BaseTuple) else kind))})"
    return str(kind)


register_model(Address)(models.OpaqueModel)


class _Row:
    """Reader of one row of 64-bit words."""

    def __init__(self, context: Any, builder: Any, pointer: Any):
        self.context, self.builder, self.pointer, self.at = context, builder, pointer, 0

    def word(self) -> Any:
        """The next word, as an integer."""
        self.at += 1
        return self.builder.load(self.builder.gep(self.pointer, [ir.Constant(WORD, self.at - 1)]))

    def value(self, kind: Any) -> Any:
        """The next value of a numba type."""
        context, builder = self.context, self.builder
        if isinstance(kind, Group):
            found, start = ir.Constant(context.get_value_type(kind), ir.Undefined), self.at
            for k, (_, dtype, _) in enumerate(kind.fields):
                found = builder.insert_value(found, self._pointer(dtype), k)
            self.at += sum(axes for _, _, axes in kind.fields)
            return builder.insert_value(found, builder.gep(self.pointer, [ir.Constant(WORD, start)]), len(kind.fields))
        if isinstance(kind, types.Array):
            data = self._pointer(kind.dtype)
            return _array(context, builder, kind.dtype, data, [self.word() for _ in range(kind.ndim)])
        if isinstance(kind, types.BaseTuple):
            return context.make_tuple(builder, kind, [self.value(each) for each in kind.types])
        if kind == types.float64:
            return builder.bitcast(self.word(), ir.DoubleType())
        return builder.trunc(self.word(), context.get_value_type(kind)) if kind == types.boolean else self.word()

    def _pointer(self, dtype: Any) -> Any:
        return self.builder.inttoptr(self.word(), self.context.get_value_type(types.CPointer(dtype)))


TABLE, BLOCK = "table", "block"
"""Arguments of a stage that are not parts: the table itself, to be passed to `call_stage`, and the block."""
PARAMETERS = "parameters"
"""Argument of a stage that is opened from its own parameters."""
SPECIAL = TABLE, BLOCK, PARAMETERS
ANY_TABLE = Address("any")


@intrinsic
def _open(typing_context: Any, table: Any, parameters: Any, block: Any) -> Any:
    """All arguments of a stage, as a tuple."""
    kinds = types.Tuple.from_types([kind for _, kind in table.parts])

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        row = builder.bitcast(given[0], ROW)
        found = []
        for index, kind in table.parts:
            if index == TABLE:
                found.append(given[0])
            elif index == BLOCK:
                found.append(given[2])
            elif index == PARAMETERS:
                found.append(_Row(context, builder, builder.bitcast(given[1], ROW)).value(kind))
            else:
                address = builder.load(builder.gep(row, [ir.Constant(WORD, index)]))
                found.append(_Row(context, builder, builder.inttoptr(address, ROW)).value(kind))
        return context.make_tuple(builder, kinds, found)

    return kinds(table, parameters, block), generate


def keep_separate() -> None:
    """First line of a function that is not inlined."""


def keep_arrays_apart() -> None:
    """First line of a function that is not inlined, and whose arrays do not overlap, so that its loops vectorise."""


def keep_arrays_apart_with_long_vectors() -> None:
    """As `keep_arrays_apart`, for loops of about 64 iterations and more."""


def _set_attributes(mark: Callable, arrays_apart: bool, long_vectors: bool) -> None:
    """Make a call of `mark` set the attributes of the compiled function that contains it."""

    @type_callable(mark)
    def type_of_mark(typing_context: Any) -> Any:
        return lambda: types.none

    @lower_builtin(mark)
    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        function = builder.function
        function.attributes.add("noinline")
        for argument in function.args if arrays_apart else ():
            if isinstance(argument.type, ir.PointerType) and "noalias" not in argument.attributes:
                argument.add_attribute("noalias")
        # llvmlite has no attributes with values, but prints the members of the set verbatim
        if SLOW_GATHER:
            features = f"{target()[1]},+prefer-no-gather".lstrip(",")
            set.add(function.attributes, f'"target-features"="{features}"')
        if long_vectors and FAST_512_BIT:
            set.add(function.attributes, '"prefer-vector-width"="512"')
        return context.get_dummy_value()


_set_attributes(keep_separate, arrays_apart=False, long_vectors=False)
_set_attributes(keep_arrays_apart, arrays_apart=True, long_vectors=False)
_set_attributes(keep_arrays_apart_with_long_vectors, arrays_apart=True, long_vectors=True)


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
        The function; its arguments are names of parts, `table`, `block` or `parameters`.  One that calls other stages
        takes the `table`.
    needs : tuple of str
        Names of its arguments.
    """

    def __init__(self, function: Callable, purpose: str, long_vectors: bool, cached: bool):
        self.function, self._purpose, self._long_vectors, self._cached = function, purpose, long_vectors, cached
        self.needs = tuple(inspect.signature(function).parameters)
        self._compiled, self._compiler = dict[Any, Any](), None

    def address(self, table: Table, parameters: Any) -> int:
        """Address of the compiled function for the types of these parts; compiles it, or loads it from the disk."""
        own = structure_of(parameters)
        key = own, *(table.key(name) for name in self.needs if name not in SPECIAL)
        if key not in self._compiled:
            signature = types.int64(
                Address(tuple(self._part(name, table, own) for name in self.needs)), ANY_TABLE, types.int64
            )
            dispatcher = self._compiler = self._compiler or self._dispatcher()
            dispatcher.compile(signature)
            found = dispatcher.overloads[signature.args]
            self._compiled[key] = found, found.library.get_pointer_to_function(found.fndesc.llvm_func_name)
        return int(self._compiled[key][1])

    def in_python(self, table: Table, parameters: Any, block: int) -> Any:
        """Call the function without the compiler."""
        special = {TABLE: table, BLOCK: block, PARAMETERS: parameters}
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
        parameters, block, table = given.pop(PARAMETERS, ()), given.pop(BLOCK, 0), Table(tuple(given))
        for name, value in given.items():
            table.set(name, value)
        return self.run(table, parameters, block)

    def run(self, table: Table, parameters: Any = (), block: int = 0) -> int:
        """Call the stage from Python; returns the integer that the function returns."""
        if not COMPILED:
            return int(self.in_python(table, parameters, block))
        row = np.array([*words_of(parameters), 0], np.int64)
        return int(_call_from_python(self.address(table, parameters), table.address, _address_of(row), block))

    @staticmethod
    def _part(name: str, table: Table, own: Any) -> tuple[Any, Any]:
        """Index in the table, or name, and type of one argument; `own` is the structure of the parameters."""
        if name == PARAMETERS:
            return name, kind_of(own)
        if name in SPECIAL:
            return name, ANY_TABLE if name == TABLE else types.int64
        index, structure = table.place(name)
        return index, kind_of(structure)

    def _dispatcher(self) -> Any:
        """What numba makes of the function, for any types."""
        # stages that this one calls may change its arrays: nothing can be said of them
        calls_stages = TABLE in self.needs
        wide = self._long_vectors and FAST_512_BIT
        keep = keep_arrays_apart_with_long_vectors if wide else keep_arrays_apart
        keep, body = (keep_separate, caller(self.function)) if calls_stages else (keep, loop(self.function))

        def separated(*parts):
            keep()
            return body(*parts)

        separated = (rare if calls_stages else separate)(separated)

        def entry(table, parameters, block):
            return separated(*_open(table, parameters, block))

        digest = user_code_digest(self.function)
        words = self.function.__qualname__, "wide" if wide else "", digest or ""
        entry = _renamed(entry, "_".join(word for word in words if word))
        return kernel(
            entry, cached=self._cached and digest is not None, nogil=True, wrapper=False, purpose=self._purpose
        )


def stage(purpose: str, *, long_vectors: bool = False, cached: bool = True) -> Callable[[Callable], Stage]:
    """Decorator that makes a `Stage` of a function whose arguments are names of parts.

    Parameters
    ----------
    purpose : str
        What it computes, for the note shown while it is compiled.
    long_vectors : bool, optional
        True for loops of about 64 iterations and more, which profit from the longest SIMD vectors.
    cached : bool, optional
        False to compile it in each process.  Otherwise it is cached on disk, formulas of the user by their source; code
        with objects of the user that cannot be told apart by their source is never cached.
    """
    return lambda function: Stage(function, purpose, long_vectors, cached)


def structure_of(value: Any) -> Any:
    """What the type of a part in compiled code depends on, as a hashable value."""
    if isinstance(value, tuple):
        return type(value), tuple(map(structure_of, value))
    if isinstance(value, np.ndarray):
        return value.dtype, value.ndim
    if isinstance(value, Program):
        return structure_of(value.entries)
    if not isinstance(value, (bool, np.bool_, int, float, np.number)):
        raise TypeError(f"a stage takes numbers, arrays and tuples of these, not {type(value).__name__}")
    return bool if isinstance(value, (bool, np.bool_)) else int if isinstance(value, (int, np.integer)) else float


_places: dict[Any, int] = {}


def _number_of(place: Any) -> int:
    """A number for each place of a part, in this process."""
    return _places.setdefault(place, len(_places))


NUMBERS = {bool: types.boolean, int: types.int64, float: types.float64}


@cache
def kind_of(structure: Any) -> Any:
    """Type in compiled code of a part with a structure: numbers, arrays, tuples, and `Group` for tuples of arrays."""
    if structure in NUMBERS:
        return NUMBERS[structure]
    if isinstance(structure[0], np.dtype):
        return types.Array(from_dtype(structure[0]), structure[1], "C")
    python_type, members = structure
    names = getattr(python_type, "_fields", None)
    if names and all(isinstance(each, tuple) and isinstance(each[0], np.dtype) for each in members):
        return Group(tuple((name, from_dtype(dtype), axes) for name, (dtype, axes) in zip(names, members, strict=True)))
    return types.BaseTuple.from_types([kind_of(each) for each in members], python_type if names else None)


def words_of(value: Any) -> list[int]:
    """The 64-bit words of a value, in the order in which `_Row.value` reads them."""
    if isinstance(value, Program):
        value = value.entries
    if isinstance(value, np.ndarray):
        return [_address_of(value), *value.shape]
    if isinstance(value, tuple):
        if isinstance(kind_of(structure_of(value)), Group):
            return [*map(_address_of, value), *(length for each in value for length in each.shape)]
        return [word for each in value for word in words_of(each)]
    if isinstance(value, (bool, np.bool_, int, np.integer)):
        return [int(value)]
    return [int(np.float64(value).view(np.int64))]


def _address_of(array: np.ndarray) -> int:
    if not array.flags.c_contiguous:
        raise ValueError("arrays given to a stage must be contiguous")
    return int(array.__array_interface__["data"][0])


class Table:
    """The parts of the state that stages take, each with the row of words from which compiled code reads it.

    Parameters
    ----------
    names : tuple of str
        Names of all parts, in the order of the table; the same in all simulations, so that stages can be shared.
    """

    def __init__(self, names: tuple[str, ...]):
        self._names = {name: index for index, name in enumerate(names)}
        self._parts, self._rows = dict[str, Any](), dict[str, np.ndarray]()
        self._structures, self._keys = dict[str, Any](), dict[str, int]()
        self._addresses = np.zeros(len(names), np.int64)

    def set(self, name: str, value: Any) -> None:
        """Set a part; nothing is done if it is the same object as before."""
        if name in self._parts and self._parts[name] is value:
            return
        self._parts[name] = value
        if COMPILED and value is not None:
            self._rows[name], self._structures[name] = np.array(words_of(value), np.int64), structure_of(value)
            self._keys[name] = _number_of(self.place(name))
            self._addresses[self.index(name)] = _address_of(self._rows[name])

    def snapshot(self) -> Table:
        """A copy that keeps its parts when those of this table are replaced; the arrays are the same."""
        other = Table(tuple(self._names))
        other._parts, other._rows = dict(self._parts), dict(self._rows)
        other._structures, other._keys = dict(self._structures), dict(self._keys)
        other._addresses[:] = self._addresses
        return other

    def __getitem__(self, name: str) -> Any:
        return self._parts[name]

    def index(self, name: str) -> int:
        """Index of a part in the table."""
        return self._names[name]

    def place(self, name: str) -> tuple[int, Any]:
        """Index of a part in the table, and its structure."""
        return self.index(name), self._structures[name]

    def key(self, name: str) -> int:
        """A number that is the same for equal places: long tuples are slow to compare."""
        return self._keys[name]

    @property
    def address(self) -> int:
        """Address of the table."""
        return _address_of(self._addresses)


_NATIVE = ctypes.CFUNCTYPE(ctypes.c_int32, *[ctypes.c_void_p] * 4, ctypes.c_int64)
"""Numba's calling convention of a stage: status, pointers to result and exception, table, parameters, block."""


def _first_call(
    stage: Stage, parameters: Any, table: weakref.ref[Table], entry: np.ndarray, failures: list[BaseException]
) -> Any:
    """A function in place of a compiled stage, which compiles it, or loads it from the disk, and calls it."""

    @_NATIVE
    def compile_and_call(*arguments: Any) -> int:
        try:
            address = stage.address(table(), parameters)  # type: ignore[arg-type]
            status = int(_NATIVE(address)(*arguments))
            entry[0] = address
        except BaseException as error:  # Ctrl-C, an error in a formula: passed on by `Program.run`
            failures.append(error)
            return FAILED
        entry[2] = READY  # from here on the status that is returned is valid
        return status

    return compile_and_call


FAILED = -1
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
    stages : dict[int, tuple[Stage, Any]]
        Stage and parameters by number; other numbers have no stage.
    size : int
        Number of entries.
    """

    def __init__(self, table: Table, stages: Mapping[int, tuple[Stage, Any]], size: int):
        self.stages, self.entries, self._failures = dict(stages), np.zeros((size, 3), np.int64), list[BaseException]()
        self._rows, self._first_calls = list[np.ndarray](), list[Any]()
        if COMPILED:
            for number, (stage, parameters) in self.stages.items():
                entry, row = self.entries[number], np.array([*words_of(parameters), 0], np.int64)
                first_call = _first_call(stage, parameters, weakref.ref(table), entry, self._failures)
                entry[:] = ctypes.cast(first_call, ctypes.c_void_p).value, row.ctypes.data, NOT_READY
                self._rows.append(row)
                self._first_calls.append(first_call)

    def run(self, stage: Stage, table: Table) -> int:
        """Call a stage that calls the stages of this program.  Raises what the compilation of one of them raised."""
        self._failures.clear()
        try:
            return stage.run(table)
        except SystemError:  # a signal may interrupt a first call before it can record the exception
            raise (self._failures[0] if self._failures else KeyboardInterrupt()) from None


def has_stage(program: Any, number: int) -> bool:
    """Whether a program has a stage of this number."""
    return number in program.stages


def call_stage(program: Any, number: int, table: Any, block: int) -> int:
    """Call a stage of a program; returns its integer.  An exception in it is passed on."""
    stage, parameters = program.stages[number]
    return int(stage.in_python(table, parameters, block))


def _status_and_result(
    context: Any, builder: Any, function: Any, table: Any, parameters: Any, block: Any
) -> tuple[Any, Any]:
    """Call a compiled stage at an address (int64), with numba's own calling convention."""
    convention, arguments = context.call_conv, (ANY_TABLE, ANY_TABLE, types.int64)
    pointer = builder.inttoptr(function, convention.get_function_type(types.int64, arguments).as_pointer())
    opaque = context.get_value_type(ANY_TABLE)
    given = [v if v.type == opaque else builder.inttoptr(v, opaque) for v in (table, parameters)]
    return convention.call_function(builder, pointer, types.int64, arguments, [*given, block])


def _entry_call(context: Any, builder: Any, signature: Any, given: Any) -> tuple[Any, Any, Any]:
    """Call a stage of a program; whether the entry is ready afterwards, status, and result."""
    program, number, table, block = given
    entries = context.make_array(signature.args[0])(context, builder, program).data
    first = builder.mul(number, ir.Constant(WORD, 3))

    def word(k: int) -> Any:
        return builder.load(builder.gep(entries, [builder.add(first, ir.Constant(WORD, k))]))

    status, result = _status_and_result(context, builder, word(0), table, word(1), block)
    return builder.icmp_signed("==", word(2), ir.Constant(WORD, READY)), status, result


@intrinsic
def _call_entry(typing_context: Any, program: Any, number: Any, table: Any, block: Any) -> Any:
    """Call a stage of a program; an exception is passed on."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        ready, status, result = _entry_call(context, builder, signature, given)
        with cgutils.if_unlikely(builder, builder.not_(ready)):
            context.call_conv.return_exc(builder)
        with cgutils.if_unlikely(builder, status.is_error):
            context.call_conv.return_status_propagate(builder, status)
        return result

    return types.int64(program, types.int64, table, types.int64), generate


@intrinsic
def _entry_fails(typing_context: Any, program: Any, number: Any, table: Any, block: Any) -> Any:
    """Call a stage of a program; whether it raised an exception."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        ready, status, _ = _entry_call(context, builder, signature, given)
        return builder.or_(builder.not_(ready), status.is_error)

    return types.boolean(program, types.int64, table, types.int64), generate


@intrinsic
def _call_address(typing_context: Any, function: Any, table: Any, parameters: Any, block: Any) -> Any:
    """Call a compiled stage; an exception is passed on."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        status, result = _status_and_result(context, builder, *given)
        with cgutils.if_unlikely(builder, status.is_error):
            context.call_conv.return_status_propagate(builder, status)
        return result

    return types.int64(types.int64, table, types.int64, types.int64), generate


def _call_from_python(function, table, parameters, block):
    return _call_address(function, table, parameters, block)


_call_from_python = kernel(_call_from_python, nogil=True, purpose="the call of stages")


def stage_fails(program: Any, number: int, table: Any, block: int) -> bool:
    """Call a stage of a program; returns whether it raised an exception, which is not passed on."""
    call_stage(program, number, table, block)  # without the compiler there is one thread, which may raise it
    return False


@overload(stage_fails)
def _compiled_stage_fails(program, number, table, block):
    def call(program, number, table, block):
        return _entry_fails(program, number, table, block)

    return call


@overload(has_stage)
def _compiled_has_stage(program, number):
    return lambda program, number: program[number, 0] != 0


@overload(call_stage)
def _compiled_call_stage(program, number, table, block):
    def call(program, number, table, block):
        return _call_entry(program, number, table, block)

    return call
