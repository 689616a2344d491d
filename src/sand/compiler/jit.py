"""Decorators for compiled functions.  Only the modules of this package import numba.

`formula`   Scalar physics on floats and 3-tuples; inlined; remains an ordinary Python function.
`rare`      Like `formula`, but not inlined: for code that is seldom executed.
`loop`      A loop over arrays, inlined into a larger loop.  No array may be passed twice, and it calls no stage.
`caller`    A function that calls stages, which may change its arrays; inlined.
`separate`  A loop over arrays that is not inlined.  No array may be passed twice.
`kernel`    A compiled entry point, called from Python.  No array may be passed twice.
`stage`     A loop over parts of the state of a simulation, called by address: see the module of this name.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core import event
from numba.extending import overload, register_jitable

from .cache import cache_folders
from .entries import CodeCache, Entries
from .progress import CompilationListener, making_code
from .uninterrupted import uninterrupted
from .user_code import code_digest

__all__ = ["COMPILED", "COMPILE_TIMES", "cache_folder", "caller", "compile_error", "compile_if_free", "compiled_form"]
__all__ += ["formula", "in_cache", "kernel", "loop", "rare", "separate"]

# As fast as fastmath=True, but NaN and infinity are preserved, so that checks can detect them.
_FAST = {"reassoc", "contract", "nsz", "arcp", "afn"}
_COMMON: dict[str, Any] = {"_nrt": False, "fastmath": _FAST, "error_model": "numpy"}


def _no_alias_option() -> dict[str, Any]:
    """The option `noalias`, which numba has but does not list; without it code is correct, but slower."""
    try:
        from numba.core.cpu import CPUTargetOptions
        from numba.core.options import _mapping

        CPUTargetOptions.noalias = _mapping("noalias")
    except (ImportError, AttributeError):
        return {}
    return {"noalias": True}


_NO_ALIASES = _no_alias_option()


TESTED_NUMBA = (0, 62), (0, 68)
"""First and last version of numba with which `lowering` is tested; with other versions compiling takes longer."""


def _pipeline_options() -> tuple[dict[str, Any], dict[str, Any]]:
    """Options for kernels and for the functions that they call; empty for an untested numba."""
    if TESTED_NUMBA[0] <= numba.version_info.short <= TESTED_NUMBA[1]:
        try:
            from .lowering import FunctionCompiler, KernelCompiler
        except (ImportError, AttributeError):
            pass  # numba's internals differ from those of the tested versions
        else:
            return {"pipeline_class": KernelCompiler}, {"pipeline_class": FunctionCompiler}
    return {}, {}


# inner functions are never called from Python in compiled form: without wrappers compiling is faster
_KERNEL, _FUNCTION = _pipeline_options()
_INNER: dict[str, Any] = _COMMON | {"no_cpython_wrapper": True, "no_cfunc_wrapper": True} | _FUNCTION

COMPILED = not numba.config.DISABLE_JIT
"""False if NUMBA_DISABLE_JIT is set, so that all functions run in Python."""


def _compile_once_per_type(function: Callable) -> None:
    """Make numba compile a registered function once per set of argument types.

    By default numba compiles it again for every set of options among its callers, which changes nothing here, and
    spends much time on comparing the options.
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
    """Decorator for functions that kernels may call and that remain ordinary Python functions."""

    def register(function: Callable) -> Callable:
        own = function.__module__.partition(".")[0] == "sand"
        # user functions may need numba's own environment, for print and the like
        register_jitable(**(options if own else {k: v for k, v in options.items() if k != "pipeline_class"}))(function)
        _compile_once_per_type(function)
        return function

    return register


# options that are not given would be inherited from the caller: all are given
_ALIASES = dict.fromkeys(_NO_ALIASES, False)
formula = _registered(**_INNER, **_ALIASES, forceinline=True)
caller = formula
rare = _registered(**_INNER, **_ALIASES, forceinline=False)
loop = _registered(**_INNER, **_NO_ALIASES, forceinline=True)
separate = _registered(**_INNER, **_NO_ALIASES, forceinline=False)


def compiled_form(function: Callable) -> Callable:
    """Decorator: makes what compiled code calls in place of `function`, which remains an ordinary Python function."""
    return overload(function, jit_options=_INNER | _ALIASES | {"forceinline": True})


_COMPILED = (
    "analysis/projection.py", "basics/alignment.py", "basics/arrays.py", "basics/box.py", "basics/grains.py",
    "basics/state.py", "compiler", "components", "contact", "experiments/scattering", "forces", "integrate",
    "neighbours", "numerics", "setup/_kernels",
)  # fmt: skip
"""Packages and files with compiled functions, or with named tuples that compiled functions take."""


def _digest() -> str:
    """Digest of all sources that affect compiled code, and of the version of numba.

    Numba detects edits only in the file of the kernel.  Without the digest, an edited formula in another file would be
    ignored.  Edits of other files, such as those of commands, recompile nothing.
    """
    digest = hashlib.sha256(f"{numba.__version__} {sorted(_KERNEL)}".encode())
    package = Path(__file__).parents[1]
    for part in _COMPILED:
        for path in sorted((package / part).rglob("*.py")) if not part.endswith(".py") else [package / part]:
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


@cache
def _entries() -> Entries:
    """Files of compiled code, in folders named after the digest of sources and compiler."""
    return Entries(*cache_folders(_digest()))


def cache_folder() -> Path:
    """Folder to which compiled code is written; see `cache.cache_folders`."""
    return _entries().own


COMPILE_TIMES = cache_folder().parent / "compile-times.json"
"""Record of the last duration of each compilation."""


def _use_cache(compiled: Any, function: Callable, digest: str) -> None:
    """Make numba's dispatcher load compiled code from the disk, and let only one of several processes compile it."""
    code = compiled._cache = CodeCache(_entries(), function, digest, _PURPOSES[id(compiled)])
    compile_or_load = compiled.compile

    def compile_with_lock(signature: Any) -> Any:
        try:
            with making_code:
                return compile_or_load(signature)
        finally:
            code.release()

    compiled.compile = compile_with_lock


def in_cache(compiled: Any, signature: Any) -> bool:
    """Whether the code of a kernel for this signature is on the disk; nothing is compiled."""
    code = compiled._cache
    return isinstance(code, CodeCache) and code.holds(signature, compiled.targetctx.codegen())


def compile_if_free(compiled: Any, signature: Any) -> bool:
    """Compile a kernel for a signature into the cache, unless it is there; False if another process does so now."""
    code, codegen = compiled._cache, compiled.targetctx.codegen()
    if isinstance(code, CodeCache):
        if code.holds(signature, codegen):
            return True
        if not code.take(signature, codegen):
            return False
    compiled.compile(signature)
    return True


_PURPOSES: dict[int, str] = {}
"""What each kernel computes, by the id of its dispatcher; kernels are never deleted."""
if COMPILED:
    event.register("numba:compile", CompilationListener(_PURPOSES, COMPILE_TIMES))


def kernel(
    function: Callable, *, cached: bool = True, nogil: bool = False, wrapper: bool = True, purpose: str = ""
) -> Callable:
    """Compile `function` on its first call and cache the result in SAND's cache folder.

    Parameters
    ----------
    function : callable
        The function.
    cached : bool, optional
        False to compile it in each process, as is done with code of unknown objects of the user.
    nogil : bool, optional
        True for code during which other Python threads may run.
    wrapper : bool, optional
        False for code that is not called from Python.
    purpose : str, optional
        What is computed, for the note shown while it is compiled; by default from the name of the function.

    Returns
    -------
    callable
        The compiled function.
    """
    options = _KERNEL | _COMMON | _NO_ALIASES | {"no_cpython_wrapper": not wrapper, "no_cfunc_wrapper": True}
    compiled = numba.njit(nogil=nogil, **options)(function)
    if COMPILED:
        compiled._compiler.compile = uninterrupted()(compiled._compiler.compile)
    _PURPOSES[id(compiled)] = purpose or f"'{function.__name__.replace('_', ' ')}'"
    if cached and COMPILED and (digest := code_digest(function)) is not None:
        _use_cache(compiled, function, f"{digest} {nogil} {wrapper}")
    return compiled


def compile_error(function: Callable, arguments: Iterable[Any]) -> str:
    """Why numba cannot compile a formula for such arguments, in one line; "" if it can, or without the compiler."""
    if not COMPILED:
        return ""
    try:
        uninterrupted()(numba.njit(error_model="numpy")(function).compile)(tuple(map(numba.typeof, arguments)))
    except numba.core.errors.NumbaError as error:
        text = re.sub(r"\x1b\[[0-9;]*m", "", str(error))
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        reason = next((line for line in lines if not line.startswith(_HEADINGS)), lines[0])
        place = re.findall(r'File "([^"]+)", line (\d+)', text)
        return reason + (f" (line {place[-1][1]} of {Path(place[-1][0]).name})" if place else "")
    return ""


_HEADINGS = ("Failed in nopython mode pipeline", "During:", "File ", "Use of unsupported")
"""Beginnings of lines of numba's messages that say nothing of the reason."""
