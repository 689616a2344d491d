"""Digest of the user's formulas in a compiled function, under which its machine code is cached on disk.

Code with SAND's own formulas is cached by the digest of SAND's sources (`jit`).  A formula of the user is identified by
its bytecode, its constants and the values of all globals and closure variables that it refers to, in turn.  If one of
them is another object, whose compiled value does not follow from its source, the code is not cached.
"""

from __future__ import annotations

import builtins
import dis
import hashlib
import sys
from collections.abc import Callable, Iterator
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

__all__ = ["user_code_digest"]

NUMBERS = (bool, int, float, complex, str, bytes, type(None), np.generic)


class _UnknownCodeError(Exception):
    """An object whose compiled value does not follow from its source."""


def user_code_digest(function: Callable) -> str | None:
    """Digest of all code of the user that a function refers to; "" if there is none, None if it must not be cached.

    Parameters
    ----------
    function : callable
        A function of SAND, in whose closure there may be formulas of the user, or such a formula itself.
    """
    try:
        words = list(_words(function, set()))
    except _UnknownCodeError:
        return None
    return hashlib.sha256("\n".join(words).encode()).hexdigest()[:16] if words else ""


def _words(value: Any, seen: set[int], user: bool = False) -> Iterator[str]:
    """Words that identify the user's code in a value; of numbers only if code of the `user` refers to them."""
    value = getattr(value, "py_func", value)  # functions compiled by numba.njit
    if isinstance(value, FunctionType):
        if id(value) not in seen:
            seen.add(id(value))
            yield from _words_of_function(value, seen)
    elif isinstance(value, type):
        if not _is_of_a_package(value.__module__):
            yield f"{value.__qualname__} {getattr(value, '_fields', '')}"
    elif isinstance(value, tuple):
        yield from _words(type(value), seen)
        for each in value:
            yield from _words(each, seen, user)
    elif isinstance(value, NUMBERS):
        yield from [repr(value)] if user else []
    elif not (isinstance(value, (ModuleType, BuiltinFunctionType, np.ufunc)) or value is Ellipsis):
        raise _UnknownCodeError


def _words_of_function(function: FunctionType, seen: set[int]) -> Iterator[str]:
    user = not _is_of_a_package(function.__module__)
    if user:
        yield f"{function.__qualname__} {function.__defaults__} {function.__kwdefaults__}"
        yield from _words_of_code(function.__code__)
        for name in _global_names(function.__code__):
            value = function.__globals__.get(name, getattr(builtins, name, None))
            if isinstance(value, ModuleType) and not _is_of_a_package(value.__name__):
                raise _UnknownCodeError
            yield name
            yield from _words(value, seen, user)
    elif function.__globals__ is not vars(sys.modules.get(function.__module__, builtins)):  # made by exec
        for name in _global_names(function.__code__):
            yield from _words(function.__globals__.get(name, getattr(builtins, name, None)), seen)
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        yield from [name] if user else []
        yield from _words(cell.cell_contents, seen, user)


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
