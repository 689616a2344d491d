"""Parts for other systems: compiled code, the number of cores, other versions of numba."""

import os
import subprocess
import sys

import pytest
from llvmlite import binding, ir

from sand.basics import threads
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
import numpy as np
import sand
from sand.compiler import jit
from sand.compiler.stage import stage
print(bool(jit._KERNEL), "sand.compiler.lowering" in __import__("sys").modules)

@stage("sums", cached=False)
def add_up(x, parameters):
    for i in range(x.size):
        parameters[0][0] += x[i]
    return x.size

total = np.zeros(1)
print(add_up(np.arange(10.0), (total,)), total[0])
"""
"""Whether the compilation is the reduced one of `lowering`, and the result of a stage."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("version", "jit"),
    [
        ((0, 99), True),
        *(pytest.param((0, number), True, marks=pytest.mark.validate) for number in (61, 68)),
        ((0, 99), False),
    ],
)
def test_untested_numba_compiles_with_its_own_passes(version, jit, tmp_path):
    """Only a tested version is used with `lowering`; all versions give the same result, without a message."""
    env = os.environ | {"SAND_CACHE": str(tmp_path / "cache"), "NUMBA_DISABLE_JIT": "0" if jit else "1"}
    done = subprocess.run(
        [sys.executable, "-c", OTHER_NUMBA.format(*version, *version)], env=env, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    tested = version == (0, 68)
    assert done.stdout.splitlines() == [f"{tested} {tested}", "10 45.0"]
    assert done.stderr == ""
