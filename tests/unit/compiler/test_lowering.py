"""The reduced compilation of SAND's functions (`compiler/lowering.py`) must not swallow exceptions."""

import gc
import json
import os
import subprocess
import sys

import numba
import numpy as np
import pytest
from numba.core import event

import sand
from sand.compiler.jit import COMPILED, formula, kernel
from sand.compiler.progress import CompilationListener, compilation_notes
from sand.integrate.motion import kicked

BEYOND = """
import numpy as np
import sand
from sand.compiler.jit import kernel
from sand.integrate.motion import kicked
grains = sand.Grains(np.zeros((3, 3)) + np.arange(3)[:, None], 0.1, sand.SILICA).arrays
def kick_one(grains, i):
    return kicked(grains, i, 1.0)[0][0]
kick_one = kernel(kick_one, cached=False)
assert kick_one(grains, 2) == 0.0
try:
    kick_one(grains, 99)
except IndexError as error:
    print("told", error)
"""
"""A SAND kernel that calls a SAND function that reads beyond the end of an array."""

CACHED = """
import importlib.util, sys
import numpy as np
from sand.compiler.jit import kernel
spec = importlib.util.spec_from_file_location("sand.inner_of_a_test", sys.argv[1])
module = importlib.util.module_from_spec(spec)
sys.modules[spec.name] = module
spec.loader.exec_module(module)
inner = module.inner
assert inner(1.0) == 1.0
print("from the cache" if sum(inner.stats.cache_hits.values()) else "compiled")
def outer(x):
    return inner(x)
outer.__module__ = "sand.outer_of_a_test"
try:
    kernel(outer, cached=False)(-1.0)
except ValueError as error:
    print("raised", error)
"""
INNER = """
from sand.compiler.jit import kernel
@kernel
def inner(x):
    if x < 0.0:
        raise ValueError("below 0")
    return x
"""
"""A kernel that calls a kernel, which the second process loads from the disk cache."""


TOGETHER = """
import importlib.util, pathlib, sys, time
here, number = pathlib.Path(sys.argv[1]), sys.argv[2]
spec = importlib.util.spec_from_file_location("sand.inner_of_a_test", here / "inner.py")
module = importlib.util.module_from_spec(spec)
sys.modules[spec.name] = module
spec.loader.exec_module(module)
(here / f"ready-{number}").touch()
while len(list(here.glob("ready-*"))) < 3:
    time.sleep(0.001)
module.inner(1.0)
print(sum(module.inner.stats.cache_misses.values()))
"""
"""Three processes that want the same code at the same time: the number of compilations of each."""


@formula
def positive(x):
    if x < 0.0:
        raise ValueError("below 0")
    return x


@formula
def root_of(x):
    return positive(x) ** 0.5


@pytest.mark.compiled("small")
def test_an_error_in_an_inner_function_reaches_python():
    """Raised two calls below a kernel; results without an error are right."""

    def roots(values):
        total = 0.0
        for k in range(values.size):
            total += root_of(values[k])
        return total

    roots = kernel(roots, cached=False)
    assert roots(np.array([4.0, 9.0])) == pytest.approx(5.0, rel=1e-15, abs=0.0)
    with pytest.raises(ValueError, match="below 0"):
        roots(np.array([4.0, -9.0]))


@pytest.mark.slow
@pytest.mark.skipif(not COMPILED, reason="Python checks bounds by itself")
def test_bounds_checks_raise_index_errors(tmp_path):
    """With NUMBA_BOUNDSCHECK=1 a wrong index in SAND's functions raises IndexError."""
    env = os.environ | {"NUMBA_BOUNDSCHECK": "1", "SAND_CACHE": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", BEYOND], env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("told")


@pytest.mark.slow
@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_an_error_in_a_kernel_from_the_disk_cache_reaches_its_caller(tmp_path):
    """The exception of an inner kernel is raised in the process that compiles it and in one that loads it."""
    (tmp_path / "inner.py").write_text(INNER)
    env = os.environ | {"SAND_CACHE": str(tmp_path / "cache")}
    words = [sys.executable, "-c", CACHED, str(tmp_path / "inner.py")]
    for origin in ("compiled", "from the cache"):
        done = subprocess.run(words, env=env, capture_output=True, text=True)
        assert done.stdout.splitlines() == [origin, "raised below 0"], done.stderr


@pytest.mark.compiled("small")
@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_plain_numba_code_may_call_functions_of_sand():
    """A user's `numba.njit` code and a kernel of SAND get the same number from a function of a tuple of arrays."""

    def speed(grains, i):
        return kicked(grains, i, 1.0)[0][1]

    velocity = np.arange(9.0).reshape(3, 3)
    for compiled in (kernel(speed, cached=False), numba.njit(speed)):
        grains = sand.Grains(np.zeros((3, 3)), 0.1, sand.SILICA, velocity=velocity).arrays
        grains.force[1, 2] = 2.0 * grains.mass[2]
        assert compiled(grains, 2) == 7.0 + 2.0
        assert grains.velocity[:, 2].tolist() == [6.0, 9.0, 8.0]


@pytest.mark.compiled("small")
@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_garbage_collection_is_restored_after_compiling():
    """On or off as before the first call."""
    gc.unfreeze()  # compilation freezes objects where none is frozen; in tests many are
    for wanted in (True, False):
        try:
            (gc.enable if wanted else gc.disable)()
            kernel(lambda x: root_of(x), cached=False)(4.0)
            assert gc.isenabled() is wanted and gc.get_freeze_count() == 0
        finally:
            gc.enable()


@pytest.mark.slow
@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_several_processes_compile_the_same_code_once(tmp_path):
    """Of three processes that start to compile at the same time, one compiles, and the others load its code."""
    (tmp_path / "inner.py").write_text(INNER)
    env = os.environ | {"SAND_CACHE": str(tmp_path / "cache")}
    words = [[sys.executable, "-c", TOGETHER, str(tmp_path), str(k)] for k in range(3)]
    running = [subprocess.Popen(each, env=env, stdout=subprocess.PIPE, text=True) for each in words]
    assert sorted(each.communicate()[0].strip() for each in running) == ["0", "0", "1"]


@pytest.mark.compiled("small")
@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_a_compilation_is_noted_with_its_last_duration(tmp_path, monkeypatch):
    """The first note has no time, the second the recorded one; short compilations and a block without notes are silent.

    Functions compiled within a kernel have no note of their own.  An unreadable record counts as empty.
    """
    listener = next(each for each in event._registered["numba:compile"] if isinstance(each, CompilationListener))
    monkeypatch.setattr(listener, "_record", tmp_path / "times.json")
    noted = []

    def compile_anew():
        def roots(x):
            return root_of(x)

        kernel(roots, cached=False, purpose="square roots")(4.0)

    with compilation_notes(noted.append):
        compile_anew()
        assert list(json.loads((tmp_path / "times.json").read_text())) == ["square roots"]
        compile_anew()  # took less than a second: no note
        (tmp_path / "times.json").write_text('{"square roots": 12.3}')
        compile_anew()
        (tmp_path / "times.json").write_text("[]")
        compile_anew()
        with pytest.raises(numba.core.errors.TypingError):
            kernel(lambda x: x.missing, cached=False, purpose="nonsense")(4.0)
        assert "nonsense" not in (tmp_path / "times.json").read_text()
        del noted[-1]
        with compilation_notes(None):
            (tmp_path / "times.json").unlink()
            compile_anew()
    first, again = "compiling square roots …", "compiling square roots (last time 12 s) …"
    assert noted == [first, again, first]
