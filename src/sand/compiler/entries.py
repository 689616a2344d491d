"""Machine code on the disk: a file for each function and set of argument types.

A file begins with a check sum of its key and its content.  Code whose file is damaged, cut off, of something else, or
cannot be read is compiled anew, and so is code that could not be written: the cache never keeps a run from starting.
"""

from __future__ import annotations

import hashlib
import os
import re
import stat
import sys
import tempfile
from collections.abc import Sequence
from operator import attrgetter
from pathlib import Path
from typing import Any

from numba import types
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.runtime import rtsys
from numba.core.serialize import dumps, loads

from ..basics.errors import warn
from .cache import WRITABLE_BY_OTHERS, remade
from .progress import Timeout, acquire_lock, free_lock
from .uninterrupted import uninterrupted

__all__ = ["CodeCache", "Entries", "described", "machine_code"]

machine_code = attrgetter("library")
"""Machine code of a compilation result of numba."""

_SUM_SIZE = hashlib.sha256().digest_size


def described(kind: Any) -> str:
    """Name of a type that identifies it; numba's names of named tuples lack those of their members."""
    if isinstance(kind, types.BaseNamedTuple):
        name = f"{kind.instance_class.__module__}.{kind.instance_class.__qualname__}"
        return f"{name}({', '.join(f'{n}: {described(t)}' for n, t in zip(kind.fields, kind.types, strict=True))})"
    if isinstance(kind, (types.BaseTuple, tuple)):
        return f"({', '.join(map(described, kind.types if isinstance(kind, types.BaseTuple) else kind))})"
    return str(kind)


class _Damaged(Exception):
    """The content of a file is not what was written."""


class Entries:
    """Files of the folders of the cache.

    Parameters
    ----------
    own : Path
        Folder that is written and read.
    read_only : Path or None, optional
        A further folder that is read.
    """

    def __init__(self, own: Path, read_only: Path | None = None):
        self.own, self._folders = own, [own, *([] if read_only is None else [read_only])]
        self._warned = set[str]()

    def read(self, name: str, key: str) -> bytes | None:
        """Content of a file that was written with this key; None if there is none, with a warning if it is damaged."""
        for folder in self._folders:
            try:
                return _checked_content(folder / name, key)
            except FileNotFoundError:
                continue
            except (_Damaged, OSError) as error:
                self.warn_damaged(folder / name, str(getattr(error, "strerror", None) or error))
        return None

    def write(self, name: str, key: str, content: bytes) -> None:
        """Write a file; a warning if that fails."""
        path = self.own / name
        try:
            remade(self.own)
            descriptor, draft = tempfile.mkstemp(prefix=".", dir=self.own)
            try:
                with open(descriptor, "wb") as file:
                    file.write(_check_sum(key, content) + content)
                os.chmod(draft, self.own.stat().st_mode & 0o644)
                os.replace(draft, path)
            except BaseException:
                os.unlink(draft)
                raise
        except OSError as error:
            if not path.exists():  # on Windows a file that another process reads cannot be replaced
                reason = f"compiled code cannot be kept in {self.own}: {error.strerror or error}"
                self._warn_once("write", f"{reason}; it is compiled again at every start")

    def warn_damaged(self, path: Path, reason: str) -> None:
        """Warn of a file that cannot be used; only of the first one."""
        self._warn_once("read", f"compiled code in the cache is compiled anew, because {path} cannot be used: {reason}")

    def _warn_once(self, kind: str, text: str) -> None:
        if kind not in self._warned:
            self._warned.add(kind)
            warn(text)


def _check_sum(key: str, content: bytes) -> bytes:
    return hashlib.sha256(key.encode() + b"\0" + content).digest()


def _checked_content(path: Path, key: str) -> bytes:
    """Content of a file.

    Raises
    ------
    _Damaged
        If it is not what was written with this key, or somebody else may have written it.
    OSError
        If it cannot be read.
    """
    status = os.lstat(path)
    if not stat.S_ISREG(status.st_mode):
        raise _Damaged("it is not a file")
    if hasattr(os, "getuid"):
        if status.st_uid not in (0, os.getuid(), path.parent.stat().st_uid):
            raise _Damaged(f"it belongs to another user (uid {status.st_uid})")
        if status.st_mode & WRITABLE_BY_OTHERS:
            raise _Damaged("other users can write it")
    data = path.read_bytes()
    if data[:_SUM_SIZE] != _check_sum(key, data[_SUM_SIZE:]):
        raise _Damaged("it is cut off" if len(data) < _SUM_SIZE else "its check sum is wrong")
    return data[_SUM_SIZE:]


class CodeCache(NullCache):
    """What the dispatcher of numba asks for the compiled code of one function.

    A process that finds no code takes the lock of this code, looks again, and holds the lock until it has compiled;
    where there are no locks, it compiles without one.  Loading code does not start numba's compiler.

    Parameters
    ----------
    entries : Entries
        The files.
    function : callable
        The function; its name is part of the name of the file.
    digest : str
        Digest of its code.
    purpose : str
        What it computes, for the note of another process that waits for it.
    """

    def __init__(self, entries: Entries, function: Any, digest: str, purpose: str):
        self._entries, self._purpose, self._locks = entries, purpose, list[Any]()
        self._name = re.sub(r"[^\w.]", "", function.__qualname__.replace(".<locals>", ""))[-80:]
        python = f"{sys.implementation.cache_tag}{getattr(sys, 'abiflags', '')}"
        self._of_function = [python, f"{function.__module__}.{function.__qualname__}", digest]

    def _place(self, signature: Any, codegen: Any) -> tuple[str, str]:
        """Name and key of the file for the types of a signature, and for the processor."""
        arguments: Sequence[Any] = getattr(signature, "args", signature)
        kinds = [*map(described, arguments), str(getattr(signature, "return_type", None))]
        key = "\n".join([*self._of_function, *kinds, *map(str, codegen.magic_tuple())])
        return f"{self._name}-{hashlib.sha256(key.encode()).hexdigest()[:20]}.nbc", key

    def holds(self, signature: Any, codegen: Any) -> bool:
        """Whether there is code for these types; nothing is loaded."""
        return self._entries.read(*self._place(signature, codegen)) is not None

    def take(self, signature: Any, codegen: Any) -> bool:
        """Take the lock of the code for these types, if there are locks; False if another process has it."""
        name, _ = self._place(signature, codegen)
        try:
            self._locks += filter(None, [free_lock(self._entries.own / Path(name).with_suffix(".lock"))])
        except Timeout:
            return False
        return True

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Compiled code from the disk; None if there is none, while this process holds the lock of its file."""
        place = self._place(signature, target.codegen())
        found = self._load(place, target)
        if found is None and not self._locks:
            lock = acquire_lock(self._entries.own / Path(place[0]).with_suffix(".lock"), self._purpose)
            if lock is not None:
                self._locks.append(lock)
                found = self._load(place, target)
        return found

    @uninterrupted()
    def _load(self, place: tuple[str, str], target: Any) -> Any:
        content = self._entries.read(*place)
        if content is None:
            return None
        try:
            rtsys.initialize(target)  # machine code may refer to its functions
            return CompileResult._rebuild(target, *loads(content))
        except MemoryError:
            raise
        except Exception as error:  # written by a numba that differs in spite of its version
            self._entries.warn_damaged(self._entries.own / place[0], f"{type(error).__name__}: {error}")
            return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Write compiled code, unless it contains addresses of this process."""
        if not (machine_code(result).has_dynamic_globals or result.lifted):
            self._entries.write(*self._place(signature, result.codegen), dumps(result._reduce()))

    def release(self) -> None:
        """Release the lock of the code that was asked for last."""
        while self._locks:
            self._locks.pop().release()
