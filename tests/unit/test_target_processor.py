"""The processor that code is compiled for: this machine's, or that of NUMBA_CPU_NAME and NUMBA_CPU_FEATURES."""

import json
import os
import platform
import subprocess
import sys

import numpy as np
import pytest

from sand.compiler.jit import COMPILED, kernel

if not COMPILED:
    pytest.skip("nothing is compiled", allow_module_level=True)
from sand.compiler import lowering

COMPILE = """
import json
from numba import float64, int64
from sand.compiler import jit

def doubled(x):
    for i in range(x.size):
        x[i] *= 2.0

def gathered(x, k):
    total = 0.0
    for i in range(k.size):
        total += x[k[i]]
    return total

found = {"hits": 0, "attributes": {}, "instructions": {}}
for name, function, types, wide in [
    ("loop", doubled, (float64[::1],), False),
    ("long loop", doubled, (float64[::1],), True),
    ("gathering", gathered, (float64[::1], int64[::1]), False),
]:
    code = jit.kernel(function, long_vectors=wide)
    code.compile(types)  # never run: this machine need not have these instructions
    found["hits"] += sum(code.stats.cache_hits.values())
    llvm, assembly = *code.inspect_llvm().values(), *code.inspect_asm().values()
    found["attributes"][name] = [w for w in ("+prefer-no-gather", '"prefer-vector-width"="512"') if w in llvm]
    found["instructions"][name] = [w for w in ("zmm", "vgatherq") if w in assembly]
print(json.dumps(found))
"""
"""Compiles three loops, as a user's process would; of two equal ones the second comes from the cache."""

NO_GATHER, WIDE = "+prefer-no-gather", '"prefer-vector-width"="512"'
EXPECTED = {
    "haswell": {"loop": [], "gathering": []},
    "znver4": {"loop": [NO_GATHER], "gathering": [NO_GATHER]},
    "sapphirerapids": {"loop": [], "long loop": [WIDE], "gathering": []},
}
"""Expected LLVM attributes per processor; without an entry for the long loop, those of the other one."""
INSTRUCTIONS = {
    "haswell": {"loop": [], "gathering": []},
    "znver4": {"gathering": ["zmm"]},
    "sapphirerapids": {"loop": [], "long loop": ["zmm"], "gathering": ["vgatherq"]},
}
"""Expected machine code: 512-bit registers, gather instructions (Zen has them, too)."""


def compiled_for(folder, name, features=""):
    script = folder / "loops.py"
    if not script.exists():
        script.write_text(COMPILE)
    env = os.environ | {"NUMBA_CPU_NAME": name, "NUMBA_CPU_FEATURES": features, "SAND_CACHE": str(folder / "cache")}
    done = subprocess.run([sys.executable, "-W", "ignore", script], env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.slow
@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="LLVM knows these names on x86 only")
def test_code_is_compiled_for_the_named_processor(tmp_path):
    """Zen gathers numbers one by one; Intel's since Sapphire Rapids use 512 bits in long loops only.

    All three share one cache, and a fourth process finds the code of the first: code of another processor is not used.
    """
    for name, expected in EXPECTED.items():
        found = compiled_for(tmp_path, name)
        assert found["hits"] == (0 if "long loop" in expected else 1), name  # otherwise the long loop is the other one
        for loop, attributes in expected.items():
            assert found["attributes"][loop] == attributes, (name, loop)
        for loop, instructions in INSTRUCTIONS[name].items():
            assert found["instructions"][loop] == instructions, (name, loop)
    assert compiled_for(tmp_path, "haswell")["hits"] == 3


@pytest.mark.parametrize(
    ("name", "features", "expected"),
    [
        ("sapphirerapids", "", True),
        ("sapphirerapids", "+avx2,-avx512fp16", False),
        ("graniterapids", "+avx2", True),
        ("skylake-avx512", "+avx512f", False),
        ("skylake-avx512", "+avx512f,+avx512fp16", True),
        ("generic", "", False),
        ("apple-m1", "+neon", False),
    ],
)
def test_named_features_override_the_processor_name(name, features, expected):
    """As in LLVM, which adds them to the features of the name."""
    assert lowering._fast_512_bit(name, features) is expected


@pytest.mark.compiled("small")
def test_vector_width_does_not_change_results():
    """A long loop with and without the longest vectors, on any processor."""

    def doubled(x):
        for i in range(x.size):
            x[i] *= 2.0

    for wide in (False, True):
        numbers = np.arange(100.0)
        kernel(doubled, cached=False, long_vectors=wide)(numbers)
        assert (numbers == 2.0 * np.arange(100)).all()
