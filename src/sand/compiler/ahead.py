"""Compilation of all stages that a program lacks, side by side in several processes, before it runs.

This process and its helpers (`helper`) compile the stages of one list into the cache.  A stage that another process
has begun is left to it: the locks of the cache say which ones have begun, so that any number of programs that start at
once share the work.  A stage without a recipe, such as one with a formula of the user, is compiled by this
process alone.  If there are no locks, or too little is missing, stages are compiled when they are first called.
"""

from __future__ import annotations

import contextlib
import json
import math
import multiprocessing
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from multiprocessing import spawn
from pathlib import Path
from typing import Any, NamedTuple

from .jit import COMPILE_TIMES, COMPILED, cache_folder, compile_if_free, in_cache
from .memory import free_memory
from .program import before_first_calls
from .progress import LONGEST_WAIT, Timeout, compile_times, free_lock, making_code, shown_line
from .recipes import NoRecipe, made_from, recipe_of
from .stage import PythonStage, Stage
from .table import Table, structure_of

__all__ = ["compile_ahead", "compile_free", "expected_seconds", "kernel_from", "number_of_helpers", "share_compilation"]

WORTH_HELPERS = 6.0
"""Expected time [s] of compilation from which on a helper saves 2 s: it needs 0.5 s to start, and 1 s more for its
first stage (measured), and what a run may never call is compiled, too."""
HELPER_BYTES = 5e8
"""Memory that a helper needs (measured)."""
LOOK = 0.05
"""Wall time [s] between two looks whether other processes have compiled the last stages."""
PACKAGE = Path(__file__).parents[2]
"""Folder that contains SAND."""
COMMAND = "import sys; sys.path[:] = sys.argv[1:]; from sand.compiler.helper import main; main()"


class Task(NamedTuple):
    """A stage that is not compiled."""

    kernel: tuple[Any, Any]  # numba's dispatcher, and the signature
    seconds: float  # expected time of compilation
    recipe: Any  # from which another process makes the kernel; None: only this process can


_looked_at = set[Any]()
"""Stages and types of parts that `compile_ahead` has seen in this process."""
_is_one_of_several = [multiprocessing.parent_process() is not None]


def share_compilation() -> None:
    """Start no helpers in this process, one of several that share the cores and compile the same stages."""
    _is_one_of_several[0] = True


def compile_ahead(stages: Iterable[tuple[Table, Stage | PythonStage, Any]], processes: int) -> None:
    """Compile what is missing of the stages of a program, if that takes long enough for several processes.

    Parameters
    ----------
    stages : iterable of (Table, Stage, parameters)
        The stages that a run may call.
    processes : int
        Most processes at work, this one included.

    Raises
    ------
    KeyboardInterrupt
        After Ctrl-C; all helpers have ended then.
    """
    tasks = _missing(stages) if COMPILED else []
    total = sum(each.seconds for each in tasks)
    if not tasks or total < WORTH_HELPERS:
        return
    alone, wanted = not _is_one_of_several[0], number_of_helpers(processes, total, max(each.seconds for each in tasks))
    if alone and not wanted:
        return
    try:
        lock = free_lock(cache_folder() / "helpers.lock")
        if lock is None:  # other processes cannot tell what this one compiles
            return
    except Timeout:  # a process that started at the same time has helpers
        lock, wanted = None, 0
    helpers, began = wanted if alone else 0, time.perf_counter()

    def progress() -> str:
        """What is done, and for how long; no time that is left, which depends on what else the machine computes."""
        ready = sum(in_cache(*each.kernel) for each in tasks)
        spent = time.perf_counter() - began
        return f"compiling, once for runs of this kind: {ready} of {len(tasks)} stages after {spent:.0f} s"

    try:
        with making_code, _helpers([each.recipe for each in tasks if each.recipe], helpers), shown_line(progress):
            left = compile_free(each.kernel for each in tasks)
            while left and time.perf_counter() - began < LONGEST_WAIT:
                time.sleep(LOOK)
                left = compile_free(left)
    except BaseException:  # Ctrl-C: what is left is missing when the program is run again
        _looked_at.clear()
        raise
    finally:
        if lock is not None:
            lock.release()


def compile_free(kernels: Iterable[tuple[Any, Any]]) -> list[tuple[Any, Any]]:
    """Compile kernels into the cache; returns the kernels that other processes compile now."""
    taken = []
    for each in kernels:
        for check in before_first_calls:
            check()
        if not compile_if_free(*each):
            taken.append(each)
    return taken


def _missing(stages: Iterable[tuple[Table, Stage | PythonStage, Any]]) -> list[Task]:
    """Stages that are not compiled: first the ones that only this process can compile, then the longest."""
    known, found = compile_times(COMPILE_TIMES), list[Task]()
    for table, each, parameters in stages:
        if not isinstance(each, Stage) or (key := (each, each.key(table, parameters))) in _looked_at:
            continue
        _looked_at.add(key)
        if each.is_cached and not each.is_compiled(table, parameters):
            kernel = each.to_compile(table.place, structure_of(parameters))
            found.append(Task(kernel, expected_seconds(each, known), _recipe(each, table, parameters)))
    return sorted(found, key=lambda task: (task.recipe is not None, -task.seconds))


def expected_seconds(each: Stage, known: Mapping[str, float]) -> float:
    """Time [s] that the compilation of a stage is expected to take: that of the last one on this machine, if known.

    Parameters
    ----------
    known : mapping of str to float
        Last durations by what stages compute, see `compile_times`.
    """
    return known.get(each.purpose, each.seconds)


def _recipe(each: Stage, table: Table, parameters: Any) -> Any:
    """What another process makes the kernel of a stage from; None if it cannot."""
    try:
        places = {name: recipe_of(table.place(name)) for name in each.parts}
        return {"stage": recipe_of(each), "places": places, "parameters": recipe_of(structure_of(parameters))}
    except NoRecipe:
        return None


def kernel_from(recipe: Any) -> tuple[Any, Any]:
    """Numba's dispatcher and the signature of a stage, from the recipes of the stage and of the types of its parts."""
    places = {name: made_from(place) for name, place in recipe["places"].items()}
    return made_from(recipe["stage"]).to_compile(places.__getitem__, made_from(recipe["parameters"]))


def number_of_helpers(processes: int, total: float, longest: float) -> int:
    """How many helpers shorten a compilation of so many seconds, `longest` of them for one stage.

    With this process no more than `processes`, and no more than fit into the memory.
    """
    free, useful = free_memory(), min(processes, math.ceil(total / longest)) - 1
    return max(useful if free is None else min(useful, int(free / HELPER_BYTES)), 0)


@contextmanager
def _helpers(recipes: list[Any], number: int) -> Iterator[None]:
    """Helper processes in the block, which compile kernels; they end with it, and with this process."""
    started = list[subprocess.Popen]()
    text = json.dumps(recipes).encode() + b"\n"
    try:
        with contextlib.suppress(OSError):  # no further process can be started
            for _ in range(number if recipes else 0):
                started.append(_start())
                threading.Thread(target=_send, args=(started[-1].stdin, text), daemon=True).start()
        yield
    finally:
        for each in started:
            each.kill()
        for each in started:
            each.wait()
            with contextlib.suppress(OSError):  # it has not read all
                each.stdin.close()  # type: ignore[union-attr]


def _start() -> subprocess.Popen:
    """Start a helper: a new interpreter that imports no file of the user, out of reach of Ctrl-C."""
    script = getattr(sys.modules.get("__main__"), "__file__", None)
    of_user = {"", os.getcwd(), os.path.dirname(os.path.abspath(script)) if script else ""}
    path = [str(PACKAGE), *(each for each in sys.path if each not in of_user)]
    flags = subprocess._args_from_interpreter_flags()  # type: ignore[attr-defined]
    group: dict[str, Any] = {"process_group": 0}
    if sys.platform == "win32":
        group = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
    return subprocess.Popen(
        [os.fsdecode(spawn.get_executable() or sys.executable), *flags, "-P", "-c", COMMAND, *path],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=os.environ | {"SAND_CACHE": str(cache_folder().parent)},
        **group,
    )


def _send(pipe: Any, text: bytes) -> None:
    """Send the recipes; the pipe stays open, for its end tells a helper that this process has ended."""
    with contextlib.suppress(OSError, ValueError):  # the helper has ended, or the pipe is closed after Ctrl-C
        pipe.write(text)
        pipe.flush()
