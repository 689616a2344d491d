"""The door to the compiler: only `lowering`, `convention`, `atomics` and this name numba (CUDA apart).

`formula`  scalar physics on floats and 3-tuples.  It stays an ordinary Python function.
`rare`     like `formula`, but not pasted into the caller: for code that seldom runs.
`loop`     a loop over arrays that is pasted into a larger loop.  No array may be passed twice.
`noinline` a loop that stays a function of its own, so that all who call it get the same bits.  No array twice.
`kernel`   a compiled entry point, called from Python.  No array may be passed twice.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any

import numba
from numba.core import event
from numba.extending import register_jitable

from ..errors import warn
from .cache import private_folder

_NAMES = "HAS_NOINLINE COMPILED LONG_VECTORS cache_folder compiling formula kernel loop noinline rare"
__all__ = _NAMES.split()

# As fast as fastmath=True, but NaN and infinity stay what they are, so that guards can see them.
_FAST = {"reassoc", "contract", "nsz", "arcp", "afn"}
_COMMON: dict[str, Any] = {"_nrt": False, "fastmath": _FAST, "error_model": "numpy"}


def _promise_no_aliases() -> dict[str, Any]:
    """The option `noalias`, which numba has but does not list; without it code is slower, never wrong."""
    try:
        from numba.core.cpu import CPUTargetOptions
        from numba.core.options import _mapping

        CPUTargetOptions.noalias = _mapping("noalias")
    except (ImportError, AttributeError):
        return {}
    return {"noalias": True}


_NO_ALIASES = _promise_no_aliases()


TESTED_NUMBA = (0, 62), (0, 68)
"""First and last version of numba whose inside `lowering` fits; others compile three times as long, without threads."""


def _own_compilers() -> list[dict[str, Any]]:
    """Options for kernels, those with long loops, inner functions and those kept apart; none for another numba."""
    if TESTED_NUMBA[0] <= numba.version_info.short <= TESTED_NUMBA[1]:
        try:
            from .lowering import FAST_WHEN_WIDE, ApartCompiler, InnerCompiler, KernelCompiler, WideCompiler
        except (ImportError, AttributeError):
            pass  # numba's inside is not what it was in the versions that were tried
        else:
            wide = WideCompiler if FAST_WHEN_WIDE else KernelCompiler
            return [{"pipeline_class": each} for each in (KernelCompiler, wide, InnerCompiler, ApartCompiler)]
    if not numba.config.DISABLE_JIT:
        first, last = (".".join(map(str, version)) for version in TESTED_NUMBA)
        warn(
            f"SAND does not know numba {numba.__version__} (tried: {first} to {last}): results are right, but "
            "compiling takes about three times as long and every simulation uses one thread only"
        )
    return [{}, {}, {}, {}]


# nobody calls these from Python once compiled: without their wrappers the first compile is shorter
_KERNEL, _WIDE, _LOWERED, _APART = _own_compilers()
_BARE: dict[str, Any] = _COMMON | {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
_INNER = _BARE | _LOWERED

COMPILED = not numba.config.DISABLE_JIT
"""False where numba is told to leave everything to Python."""
LONG_VECTORS = _WIDE != _KERNEL
"""Are there kernels with vectors of 512 bits, on processors that LLVM would use half of?"""
HAS_NOINLINE = bool(_APART)
"""Can `noinline` loops be kept apart, so that all threads get the same bits from them?"""


def _once_for_each_type(function: Callable) -> None:
    """Let numba compile a registered function once for each set of argument types.

    It would do so once more for every set of options among its callers, which changes nothing in ours, and spend
    much of its time on comparing them.
    """
    try:
        from numba.core.typing.templates import builtin_registry

        template = next(t for f, t in reversed(builtin_registry.globals) if f is function).templates[0]
        build = template._build_impl
    except (ImportError, AttributeError, StopIteration, IndexError):
        return
    known: dict[Any, Any] = {}

    def implementation(self: Any, args: Any, kws: Any) -> Any:
        key = tuple(a._code for a in args), tuple(kws.items())
        if key not in known:
            known[key] = build(self, key, args, kws)
        return known[key]

    template._get_impl = implementation


def _registered(**options: Any) -> Callable[[Callable], Callable]:
    """A decorator for functions that kernels may call and that stay ordinary Python."""

    def register(function: Callable) -> Callable:
        ours = function.__module__.partition(".")[0] == "sand"
        # others may do what needs numba's own environment, such as print
        register_jitable(**(options if ours else {k: v for k, v in options.items() if k != "pipeline_class"}))(function)
        _once_for_each_type(function)
        return function

    return register


# options that are not given are those of the caller: all are given
_ALIASES = dict.fromkeys(_NO_ALIASES, False)
formula = _registered(**_INNER, **_ALIASES, forceinline=True)
rare = _registered(**_INNER, **_ALIASES, forceinline=False)
loop = _registered(**_INNER, **_NO_ALIASES, forceinline=True)
noinline = _registered(**_BARE, **_APART, **_NO_ALIASES, forceinline=False)


_COMPILED = (
    "analysis/projection.py", "box.py", "compiler", "contact", "experiments/scattering", "forces", "integrate",
    "neighbours", "numerics", "setup/_kernels", "state",
)  # fmt: skip
"""Packages and files with compiled functions."""


def _digest() -> str:
    """Fingerprint of every source that reaches compiled code, and of the compiler.

    Numba looks for edits in the file of the kernel only; without this, a formula changed next door
    would go on being computed the old way.  Editing a command recompiles nothing.
    """
    digest = hashlib.sha256(numba.__version__.encode())
    package = Path(__file__).parents[1]
    for part in _COMPILED:
        for path in sorted((package / part).rglob("*.py")) if not part.endswith(".py") else [package / part]:
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


@cache
def cache_folder() -> Path:
    """Where compiled code is kept: a folder named after our sources and the compiler, see `cache.private_folder`."""
    return private_folder(_digest())


_FOLDER = cache_folder()


def _load_alone(compiled: Any) -> None:
    """Let what is kept be loaded without all that numba knows to compile, an eighth of a second of a start."""
    try:
        from numba.core.runtime import rtsys

        cache = compiled._cache
        guard, load = cache._guard_against_spurious_io_errors, cache._load_overload
    except (ImportError, AttributeError):
        return

    def load_overload(signature: Any, target: Any) -> Any:
        rtsys.initialize(target)  # machine code may name its functions
        with guard():
            return load(signature, target)

    cache.load_overload = load_overload


def kernel(function: Callable, *, cached: bool = True, nogil: bool = False, long_vectors: bool = False) -> Callable:
    """Compile `function` on its first call and keep the result in our own cache folder.

    numba's global cache folder is put back at once: a user's own kernels go where the user wants.

    Parameters
    ----------
    cached : bool, optional
        False for code that reaches formulas from outside SAND, whose edits our digest does not see.
    nogil : bool, optional
        True for code that other Python threads may run beside.
    long_vectors : bool, optional
        True for loops that are long enough for the longest vectors of the processor, some 64 times and more.
    """
    if long_vectors and LONG_VECTORS:  # what is kept is found by its name; where both are the same, it is compiled once
        name = f"{function.__qualname__}_wide"
        function = FunctionType(function.__code__, function.__globals__, function.__name__, None, function.__closure__)
        function.__qualname__ = name
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(_FOLDER)
    try:
        options = (_WIDE if long_vectors else _KERNEL) | _COMMON | _NO_ALIASES
        compiled = numba.njit(cache=cached, nogil=nogil, no_cfunc_wrapper=True, **options)(function)
    finally:
        numba.config.CACHE_DIR = before
    if cached:
        _load_alone(compiled)
    return compiled


class _Listener(event.Listener):
    def __init__(self, tell: Callable[[], None]):
        self._tell: Callable[[], None] | None = tell

    def on_start(self, _event: Any) -> None:
        if self._tell is not None:
            tell, self._tell = self._tell, None
            tell()

    def on_end(self, _event: Any) -> None:
        pass


@contextmanager
def compiling(tell: Callable[[], None]) -> Iterator[None]:
    """Call `tell` once if anything has to be compiled inside the block (not when the cache serves)."""
    with event.install_listener("numba:compile", _Listener(tell)):
        yield
