"""The reduced compilation of SAND's functions (`compiler/lowering.py`) must not swallow exceptions."""

import gc
import os
import subprocess
import sys

import numba
import numpy as np
import pytest

import sand
from sand.compiler.jit import COMPILED, formula, kernel
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
    assert roots(np.array([4.0, 9.0])) == pytest.approx(5.0, rel=1e-15)
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


@pytest.mark.compiled("small")
@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_incompatible_calling_conventions_raise():
    """Plain numba functions unpack named tuples, SAND's do not: a call across raises instead of reading garbage."""

    def speed(grains):
        return kicked(grains, 0, 1.0)[0][0]

    grains = sand.Grains(np.zeros((1, 3)), 0.1, sand.SILICA, velocity=[[3.0, 0.0, 0.0]]).arrays
    assert kernel(speed, cached=False)(grains) == 3.0
    with pytest.raises(TypeError, match=r"sand\.compiler\.jit\.kernel"):
        numba.njit(speed)(grains)


@pytest.mark.compiled("small")
@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_garbage_collection_is_restored_after_compiling():
    """On or off as before the first call."""
    for wanted in (True, False):
        try:
            (gc.enable if wanted else gc.disable)()
            kernel(lambda x: root_of(x), cached=False)(4.0)
            assert gc.isenabled() is wanted
        finally:
            gc.enable()
