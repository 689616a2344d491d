"""What the code generator has to know of the processor: whether gathers are slow and 512-bit vectors are fast."""

from __future__ import annotations

from llvmlite.binding import get_host_cpu_name  # type: ignore[import-untyped]
from numba.core import config
from numba.core.codegen import get_host_cpu_features

__all__ = ["FAST_512_BIT", "SLOW_GATHER", "target"]


def target() -> tuple[str, str]:
    """Name and features ("+avx2,-avx512f,…") of the target processor.

    These are `NUMBA_CPU_NAME` and `NUMBA_CPU_FEATURES` if set, else those of this machine.
    """
    name = get_host_cpu_name() if config.CPU_NAME is None else config.CPU_NAME
    return name, get_host_cpu_features() if config.CPU_FEATURES is None else config.CPU_FEATURES


AVX512FP16_CPUS = {"sapphirerapids", "emeraldrapids", "graniterapids", "graniterapids-d", "diamondrapids"}
"""LLVM names of processors with avx512fp16, for feature lists that do not mention it."""


def fast_512_bit(name: str, features: str) -> bool:
    """Whether the processor executes 512-bit instructions without lowering its clock rate.

    The last mention in the feature list decides, else the name of the processor.
    """
    listed = [word[0] == "+" for word in features.split(",") if word[1:] == "avx512fp16"]
    return listed[-1] if listed else name in AVX512FP16_CPUS


SLOW_GATHER = target()[0].startswith("znver")
"""AMD Zen: scalar loads are faster than gather instructions (measured on Zen 4)."""

FAST_512_BIT = fast_512_bit(*target())
"""Whether this processor is fast at 512 bits (Intel since Sapphire Rapids), although LLVM uses 256 bits by default."""
