"""Parts for other systems: compiled code, the number of cores, other versions of numba."""

import os
import subprocess
import sys

import pytest
from llvmlite import binding, ir

from sand import threads
from sand.compiler import atomics

SYSTEMS = {
    "x86_64-unknown-linux-gnu": "sched_yield",
    "aarch64-unknown-linux-gnu": "sched_yield",
    "x86_64-unknown-linux-musl": "sched_yield",
    "arm64-apple-darwin24.1.0": "sched_yield",
    "x86_64-apple-macosx13.0.0": "sched_yield",
    "x86_64-unknown-freebsd14.1": "sched_yield",
    "x86_64-pc-windows-msvc": "SwitchToThread",
    "aarch64-pc-windows-msvc": "SwitchToThread",
    "x86_64-w64-windows-gnu": "SwitchToThread",
    "x86_64-w64-mingw32": "SwitchToThread",
    "wasm32-unknown-emscripten": None,
    "x86_64-unknown-none": None,
}


@pytest.mark.parametrize(("triple", "name"), SYSTEMS.items())
def test_waiting_threads_yield_the_cpu(triple, name):
    """The code calls the system's yield function without arguments; without one it only spins."""
    module = ir.Module("waiting")
    module.triple = triple
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), []), "wait")
    builder = ir.IRBuilder(function.append_basic_block())
    atomics.call_yield(builder)
    atomics.call_yield(builder)  # declared once
    builder.ret_void()
    code = str(module)
    binding.parse_assembly(code).verify()
    assert {f.name for f in module.functions} - {"wait"} == ({name} if name else set())
    assert code.count("call i32") == (2 if name else 0)
    if name:
        assert f'declare i32 @"{name}"()' in code


def test_the_yield_function_exists_on_this_machine():
    """LLVM finds it in this process, as when code is loaded from the cache; compiled code calls it."""
    name = atomics.yield_function(binding.get_process_triple())
    assert name is None or binding.address_of_symbol(name)


def test_cores_are_counted_everywhere(monkeypatch):
    """Without CPU affinity the cores of the machine count, and one if the number is unknown."""
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    assert threads.cores() == os.cpu_count()
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert threads.cores() == 1


OTHER_NUMBA = """
import numba
numba.version_info = numba.version_info._replace(short=({}, {}))
numba.__version__ = "{}.{}.0"
from sand.compiler import jit
import sand.compiler.jit
print(jit.HAS_NOINLINE, jit.LONG_VECTORS)
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("version", "jit", "number"),
    [((0, 99), True, True), ((0, 61), True, True), ((0, 68), True, False), ((0, 99), False, False)],
)
def test_untested_numba_warns_once(version, jit, number, tmp_path):
    """One line with the consequences and the tested versions; nothing if there are no consequences."""
    env = os.environ | {"SAND_CACHE": str(tmp_path / "cache"), "NUMBA_DISABLE_JIT": "0" if jit else "1"}
    done = subprocess.run(
        [sys.executable, "-c", OTHER_NUMBA.format(*version, *version)], env=env, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split()[0] == str(version == (0, 68))
    lines = done.stderr.splitlines()
    assert len(lines) == number
    for words in [
        f"numba {version[0]}.{version[1]}.0",
        "0.62 to 0.68",
        "three times as long",
        "one thread",
    ] * number:
        assert words in lines[0]
