"""Digest of a compiled function, under which its machine code is cached on disk.

All functions of SAND are identified by the digest of SAND's sources (`jit`), and one of them by its bytecode and the
values in its closure.  A formula of the user is identified by its bytecode, its constants and the values of all globals
and closure variables that it refers to, in turn.  If one of them is another object, whose compiled value does not
follow from its source, the code is not cached.
"""

from __future__ import annotations

import builtins
import dis
import hashlib
import sys
from collections.abc import Callable, Iterator
from enum import Enum
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

__all__ = ["code_digest"]

NUMBERS = (bool, int, float, complex, str, bytes, type(None), np.generic)


class _UnknownCodeError(Exception):
    """An object whose compiled value does not follow from its source."""


def code_digest(function: Callable) -> str | None:
    """Digest of a function and of the formulas in its closure; None if its compiled code must not be cached.

    Functions that a factory makes of different formulas have the same name and different digests.  There are no paths
    in the digest, so that a copy of the same sources in another folder has the same.  Sources of SAND to which the
    function refers by global names are not part of it.

    Parameters
    ----------
    function : callable
        A function of SAND, in whose closure there may be formulas of the user, or such a formula itself.
    """
    try:
        words = list(_words(function, {}))
    except _UnknownCodeError:
        return None
    return hashlib.sha256("\n".join(words).encode()).hexdigest()[:16]


def _words(value: Any, seen: dict[int, int]) -> Iterator[str]:
    """Words that identify a value; `seen` are the numbers of the functions so far by their id."""
    value = getattr(value, "py_func", value)  # functions compiled by numba.njit
    if isinstance(value, FunctionType):
        if id(value) in seen:
            yield f"function {seen[id(value)]}"
        else:
            seen[id(value)] = len(seen)
            yield from _words_of_function(value, seen)
    elif isinstance(value, type):
        yield f"{value.__module__}.{value.__qualname__} {getattr(value, '_fields', '')}"
        if issubclass(value, Enum) and not _is_of_a_package(value.__module__):
            yield repr({name: member.value for name, member in value.__members__.items()})
    elif isinstance(value, tuple):
        yield f"{len(value)} members"
        yield from _words(type(value), seen)
        for each in value:
            yield from _words(each, seen)
    elif isinstance(value, NUMBERS):
        yield repr(value)
    elif isinstance(value, (ModuleType, BuiltinFunctionType, np.ufunc)):
        yield value.__name__
    elif isinstance(value, np.ndarray) and not value.dtype.hasobject:  # constant in compiled code
        yield f"{value.dtype} {value.shape} {hashlib.sha256(value.tobytes()).hexdigest()}"
    elif value is Ellipsis:
        yield "..."
    else:
        raise _UnknownCodeError


def _words_of_function(function: FunctionType, seen: dict[int, int]) -> Iterator[str]:
    yield f"{function.__qualname__} {function.__defaults__} {function.__kwdefaults__}"
    yield from _words_of_code(function.__code__)
    user = not _is_of_a_package(function.__module__)
    made_by_exec = function.__globals__ is not vars(sys.modules.get(function.__module__, builtins))
    for name in _global_names(function.__code__) if user or made_by_exec else ():
        value = function.__globals__.get(name, getattr(builtins, name, None))
        if user and isinstance(value, ModuleType) and not _is_of_a_package(value.__name__):
            raise _UnknownCodeError
        yield name
        yield from _words(value, seen)
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        yield name
        yield from _words(cell.cell_contents, seen)


def _words_of_code(code: CodeType) -> Iterator[str]:
    yield code.co_code.hex()
    yield " ".join((*code.co_names, *code.co_varnames, *code.co_freevars))
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _words_of_code(constant)
        else:
            yield repr(constant)


def _global_names(code: CodeType) -> list[str]:
    """Names of globals that a code object reads, those of nested functions included."""
    names = {each.argval for each in dis.get_instructions(code) if each.opname == "LOAD_GLOBAL"}
    nested = (_global_names(constant) for constant in code.co_consts if isinstance(constant, CodeType))
    return sorted(names.union(*nested))


def _is_of_a_package(module: str | None) -> bool:
    """Whether a module belongs to SAND, Python, NumPy or numba, whose versions identify their code."""
    top = (module or "").partition(".")[0]
    return top in {"sand", "numpy", "numba", "builtins"} or top in sys.stdlib_module_names - {"__main__"}
