"""The processor that code is compiled for: this machine's, or that of NUMBA_CPU_NAME and NUMBA_CPU_FEATURES."""

import json
import os
import platform
import subprocess
import sys

import numpy as np
import pytest

from sand.compiler.jit import COMPILED
from sand.compiler.processor import fast_512_bit
from sand.compiler.stage import stage

if not COMPILED:
    pytest.skip("nothing is compiled", allow_module_level=True)

COMPILE = """
import json
import sys
import numpy as np
from sand.compiler.stage import stage
from sand.compiler.table import Table

def doubled(x):
    for i in range(x.size):
        x[i] *= 2.0
    return 0

def gathered(x, k):
    total = 0.0
    for i in range(k.size):
        total += x[k[i]]
    x[0] = total
    return 0

table = Table(("x", "k"))
table.set("x", np.zeros(100))
table.set("k", np.zeros(100, np.int64))
found = {"hits": 0, "attributes": {}, "instructions": {}}
sys.modules["sand.of_a_test"] = sys.modules["__main__"]
doubled.__module__ = gathered.__module__ = "sand.of_a_test"  # compiled as functions of SAND are
for name, function, wide in [("loop", doubled, False), ("long loop", doubled, True), ("gathering", gathered, False)]:
    one = stage("a test", long_vectors=wide)(function)
    dispatchers, make = [], one._dispatcher
    one._dispatcher = lambda: dispatchers.append(make()) or dispatchers[-1]
    one.address(table, ())  # never run: this machine need not have these instructions
    (code,) = dispatchers
    found["hits"] += sum(code.stats.cache_hits.values())
    llvm, assembly = *code.inspect_llvm().values(), *code.inspect_asm().values()
    found["attributes"][name] = [w for w in ("+prefer-no-gather", '"prefer-vector-width"="512"') if w in llvm]
    found["instructions"][name] = [w for w in ("zmm", "vgatherq") if w in assembly]
print(json.dumps(found))
"""
"""Compiles three stages, as a user's process would; of two equal ones the second comes from the cache."""

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


@pytest.mark.validate
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
    assert fast_512_bit(name, features) is expected


@pytest.mark.compiled("small")
def test_vector_width_does_not_change_results():
    """A long loop with and without the longest vectors, on any processor."""

    def doubled(x):
        for i in range(x.size):
            x[i] *= 2.0
        return 0

    for wide in (False, True):
        numbers = np.arange(100.0)
        stage("a test", cached=False, long_vectors=wide)(doubled)(numbers)
        assert (numbers == 2.0 * np.arange(100)).all()
