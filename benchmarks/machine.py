"""What one core of this machine can do at most, measured: fused multiply-adds, and bytes to and from memory."""

from __future__ import annotations

import functools
import platform
from pathlib import Path
from typing import Any

import numpy as np

from sand.compiler.stage import stage

from .timing import as_own, best

TERMS = 16
"""Multiply-adds per number in `horner`: more would leave less chains in flight, less would show loads and stores."""
NUMBERS = 1024
"""Numbers that `horner` works on: 16 kB in two arrays, which stay in the first cache."""
SIZES = {"L1": 24e3, "L2": 6e5, "L3": 8e6, "DRAM": 1.2e8}
"""Bytes of three arrays together that the table of bandwidths is measured with."""
TRAFFIC = 4e8
"""Bytes per timed piece."""


@stage("a polynomial", long_vectors=True, cached=False)
@as_own
def horner(x, y, parameters):
    """y = a polynomial of degree TERMS in each x, `times` over: one chain for each number, many in flight."""
    a, b, c, d, times = parameters
    for _ in range(times):
        for i in range(x.size):
            v = x[i]
            s = (((a * v + b) * v + c) * v + d) * v + a
            s = (((s * v + b) * v + c) * v + d) * v + a
            s = (((s * v + b) * v + c) * v + d) * v + a
            s = (((s * v + b) * v + c) * v + d) * v + a
            y[i] = s
        a += 1e-9
    return 0


@stage("a sum of arrays", long_vectors=True, cached=False)
@as_own
def triad(a, b, c, parameters):
    """a = b + scale × c, `times` over."""
    scale, times = parameters
    for _ in range(times):
        for i in range(a.size):
            a[i] = b[i] + scale * c[i]
        scale += 1e-9
    return 0


@functools.cache
def flops() -> float:
    """Most floating-point operations per second of one core, a multiply-add counted as two."""
    times = 8000
    x, y = np.linspace(0.0, 0.5, NUMBERS), np.zeros(NUMBERS)
    return 2.0 * TERMS * NUMBERS * times / best(lambda: horner(x, y, (0.1, 0.2, 0.3, 0.4, times)), 9)


@functools.cache
def bandwidth(size: float) -> float:
    """Bytes per second that three arrays of `size` bytes together are read (two) and written (one) with."""
    number = max(int(size / 24), 64)
    a, b, c = np.zeros(number), np.ones(number), np.ones(number)
    times = max(int(TRAFFIC / (24 * number)), 1)
    return 24.0 * number * times / best(lambda: triad(a, b, c, (0.5, times)), 5)


def share_of_flops(operations: float, seconds: float) -> dict[str, Any]:
    """The part of the limit that so many operations in so many seconds are, as keywords for a row."""
    return {"share": operations / seconds / flops(), "limit": "FMA"}


def share_of_bandwidth(moved: float, size: float, seconds: float) -> dict[str, Any]:
    """The same for bytes moved to and from arrays of `size` bytes."""
    return {"share": moved / seconds / bandwidth(float(f"{size:.1g}")), "limit": "bandwidth"}


def limits() -> dict[str, float]:
    """Gflop/s, and GB/s by cache."""
    return {"Gflop/s": 1e-9 * flops()} | {f"{name} GB/s": 1e-9 * bandwidth(size) for name, size in SIZES.items()}


def processor() -> str:
    """What the machine calls its processor."""
    told = Path("/proc/cpuinfo")
    if told.exists():
        for line in told.read_text("utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()
