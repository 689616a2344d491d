"""The table of addresses from which stages read the parts of a simulation, and the types of these parts.

Each part has a row of 64-bit words: numbers, addresses and lengths of arrays.  The table holds the address of each row.
"""

from __future__ import annotations

from collections.abc import Collection
from functools import cache
from typing import Any

import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba import from_dtype, types
from numba.core.datamodel import models
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr_generic, register_model

from .entries import described
from .groups import WORD, Group, array_of, constant_word
from .jit import COMPILED

__all__ = ["ALL_PARTS", "BLOCK_NUMBER", "PARAMETERS", "SPECIAL", "Address", "Parts", "Table", "address_of", "kind_of"]
__all__ += ["open_parts", "structure_of", "words_of"]

ROW = WORD.as_pointer()


class Address(types.Opaque):
    """Type of the address of a row; `parts` are (index in the table, type), or the type of the only part itself."""

    def __init__(self, parts: Any):
        self.parts = parts
        super().__init__(name=f"Address({described(parts)})")


register_model(Address)(models.OpaqueModel)


class Parts(types.Opaque):
    """Type of the argument `s` of stages, the address of a table: its parts are attributes, read where they are used.

    Parameters
    ----------
    parts : tuple
        (name, index in the table, type) of each part that the stage names.
    """

    def __init__(self, parts: tuple[tuple[str, int, Any], ...]):
        self.parts = {name: (index, kind) for name, index, kind in parts}
        super().__init__(
            name=f"Parts({', '.join(f'{name}: {index} {described(kind)}' for name, index, kind in parts)})"
        )


register_model(Parts)(models.OpaqueModel)


@infer_getattr
class _PartsAttribute(AttributeTemplate):
    key = Parts

    def generic_resolve(self, s: Parts, name: str) -> Any:
        """The type of one part."""
        return s.parts[name][1] if name in s.parts else None


@lower_getattr_generic(Parts)
def _part_of_table(context: Any, builder: Any, s: Parts, value: Any, name: str) -> Any:
    index, kind = s.parts[name]
    return _row_of_part(context, builder, value, index).value(kind)


def _row_of_part(context: Any, builder: Any, table: Any, index: int) -> _Row:
    """The row of a part of a table."""
    address = constant_word(builder, builder.bitcast(table, ROW), index)
    return _Row(context, builder, builder.inttoptr(address, ROW))


class _Row:
    """Reader of one row of 64-bit words."""

    def __init__(self, context: Any, builder: Any, pointer: Any):
        self.context, self.builder, self.pointer, self.at = context, builder, pointer, 0

    def word(self) -> Any:
        """The next word, as an integer."""
        self.at += 1
        return constant_word(self.builder, self.pointer, self.at - 1)

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
            return array_of(context, builder, kind.dtype, data, [self.word() for _ in range(kind.ndim)])
        if isinstance(kind, types.BaseTuple):
            return context.make_tuple(builder, kind, [self.value(each) for each in kind.types])
        if kind == types.float64:
            return builder.bitcast(self.word(), ir.DoubleType())
        return builder.trunc(self.word(), context.get_value_type(kind)) if kind == types.boolean else self.word()

    def _pointer(self, dtype: Any) -> Any:
        return self.builder.inttoptr(self.word(), self.context.get_value_type(types.CPointer(dtype)))


ALL_PARTS, BLOCK_NUMBER = "s", "block"
"""Arguments of a stage that are not parts: the table, whose parts are attributes of `s`, and the block."""
PARAMETERS = "parameters"
"""Argument of a stage that is opened from its own parameters."""
SPECIAL = ALL_PARTS, BLOCK_NUMBER, PARAMETERS
ANY_TABLE = Address("any")
"""Type of a table in the signature of a stage."""


@intrinsic
def open_parts(typing_context: Any, table: Any, parameters: Any, block: Any) -> Any:
    """All arguments of a stage, as a tuple."""
    kinds = types.Tuple.from_types([kind for _, kind in table.parts])

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        found = []
        for index, kind in table.parts:
            if index == ALL_PARTS:
                found.append(given[0])
            elif index == BLOCK_NUMBER:
                found.append(given[2])
            elif index == PARAMETERS:
                found.append(_Row(context, builder, builder.bitcast(given[1], ROW)).value(kind))
            else:
                found.append(_row_of_part(context, builder, given[0], index).value(kind))
        return context.make_tuple(builder, kinds, found)

    return kinds(table, parameters, block), generate


def structure_of(value: Any) -> Any:
    """What the type of a part in compiled code depends on, as a hashable value."""
    value = getattr(value, "entries", value)  # of a program
    if isinstance(value, tuple):
        return type(value), tuple(map(structure_of, value))
    if isinstance(value, np.ndarray):
        return value.dtype, value.ndim
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
    value = getattr(value, "entries", value)  # of a program
    if isinstance(value, np.ndarray):
        return [address_of(value), *value.shape]
    if isinstance(value, tuple):
        if isinstance(kind_of(structure_of(value)), Group):
            return _group_words(value)
        return [word for each in value for word in words_of(each)]
    if isinstance(value, (bool, np.bool_, int, np.integer)):
        return [int(value)]
    return [int(np.float64(value).view(np.int64))]


def _group_words(value: tuple[np.ndarray, ...]) -> list[int]:
    """The words of a tuple of arrays."""
    return [*map(address_of, value), *(length for each in value for length in each.shape)]


def _is_group_like(value: Any, before: Any) -> bool:
    """Whether two values are tuples of arrays of the same types."""
    return (
        isinstance(value, tuple)
        and hasattr(value, "_fields")
        and type(value) is type(before)
        and all(
            isinstance(one, np.ndarray)
            and isinstance(other, np.ndarray)
            and one.dtype is other.dtype
            and one.ndim == other.ndim
            for one, other in zip(value, before, strict=True)
        )
    )


def address_of(array: np.ndarray) -> int:
    """Address of the first number of an array, which must be contiguous."""
    if not array.flags.c_contiguous:
        raise ValueError("arrays given to a stage must be contiguous")
    return int(array.__array_interface__["data"][0])


class Table:
    """The parts of the state that stages take, each with the row of words from which compiled code reads it.

    Parameters
    ----------
    names : tuple of str
        Names of all parts, in the order of the table; the same in all simulations, so that stages can be shared.

    Attributes
    ----------
    address : int
        Address of the table.
    stages : dict[Stage, int]
        Addresses of stages without parameters that were called, for the present structures of the parts.
    calls : dict[tuple[Stage, int], tuple]
        Of stages with parameters, by the identity of the first one: those of the last call, their row of words, and
        the addresses of stage and row.
    """

    def __init__(self, names: tuple[str, ...]):
        self._names = {name: index for index, name in enumerate(names)}
        self._parts, self._rows = dict[str, Any](), dict[str, np.ndarray]()
        self._structures, self._keys = dict[str, Any](), dict[str, int]()
        self._shared = dict[str, np.ndarray]()
        self._addresses = np.zeros(len(names), np.int64)
        self.address, self.stages = address_of(self._addresses), dict[Any, int]()
        self.calls = dict[Any, tuple[Any, ...]]()

    def set(self, name: str, value: Any) -> None:
        """Set a part; nothing is done if it is the same object, or the same number, as before."""
        before = self._parts.get(name)
        if before is value and name in self._parts:
            return
        is_number = type(value) in NUMBERS and type(before) is type(value)
        if is_number and value == before and (value or type(value) is not float):  # 0.0 and −0.0 differ
            return
        self._parts[name] = value
        if COMPILED and is_number:
            self._rows[name] = np.array([value], np.float64 if type(value) is float else np.int64)
            self._addresses[self._names[name]] = address_of(self._rows[name])
        elif COMPILED and _is_group_like(value, before):  # the same types: only addresses and lengths are new
            self._rows[name] = np.array(_group_words(value), np.int64)
            self._addresses[self._names[name]] = address_of(self._rows[name])
        elif COMPILED and value is not None:
            self._rows[name] = np.array(words_of(value), np.int64)
            if type(value) is not type(before) or type(value) not in NUMBERS:
                self._structures[name] = structure_of(value)
                key = _number_of(self.place(name))
                if self._keys.get(name) != key:
                    self._keys[name] = key
                    self.stages, self.calls = {}, {}
            self._addresses[self.index(name)] = address_of(self._rows[name])

    def share(self, name: str, memory: np.ndarray) -> None:
        """Let the numbers of a part, a tuple that is set, be the first of an array, which stages may change."""
        self._shared[name] = self._rows[name] = memory
        self._addresses[self.index(name)] = address_of(memory)

    def snapshot(self) -> Table:
        """A copy that keeps its parts when those of this table are replaced; the arrays are the same."""
        other = Table(tuple(self._names))
        other._parts, other._rows, other._shared = dict(self._parts), dict(self._rows), dict(self._shared)
        other._structures, other._keys = dict(self._structures), dict(self._keys)
        other._addresses[:] = self._addresses
        return other

    def follow(self, other: Table, but: Collection[str] = ()) -> None:
        """Take all parts of another table, whose arrays and addresses of stages are then the same.

        This table keeps its parts with the names `but`, of the same types as those of the other one.
        """
        parts = {name: self._parts[name] for name in but}
        rows = {name: self._rows[name] for name in but if name in self._rows}
        self._parts, self._rows, self._shared = other._parts | parts, other._rows | rows, dict(other._shared)
        self._structures, self._keys = dict(other._structures), dict(other._keys)
        own = [self._names[name] for name in but]
        kept = self._addresses[own]
        self._addresses[:], self.stages, self.calls = other._addresses, other.stages, other.calls
        self._addresses[own] = kept

    def __getitem__(self, name: str) -> Any:
        memory = self._shared.get(name)
        part = self._parts[name]
        return part if memory is None else type(part)(*memory[: len(part)].tolist())

    def __getattr__(self, name: str) -> Any:
        """A part, as in compiled code."""
        if name not in self.__dict__.get("_parts", ()):
            raise AttributeError(name)
        return self[name]

    def index(self, name: str) -> int:
        """Index of a part in the table."""
        return self._names[name]

    def place(self, name: str) -> tuple[int, Any]:
        """Index of a part in the table, and its structure."""
        return self.index(name), self._structures[name]

    def key(self, name: str) -> int:
        """A number that is the same for equal places: long tuples are slow to compare."""
        return self._keys[name]
