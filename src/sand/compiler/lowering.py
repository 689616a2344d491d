"""How our compiled code is made: numba's own way, without what ours does not need.

Numba makes machine code of every function before it pastes it into a caller, where all of that is done again; here a
function that only kernels call stays as it was lowered, and is linked with a kernel once.  Nothing of ours counts
references, and nothing is thrown away before all is done.  `convention` tells how functions call each other.

All of it leans on numba's inside.  Where that has changed, the import fails, and `jit` does without.
"""

from __future__ import annotations

import gc
from collections import Counter
from typing import Any

from llvmlite.binding import get_host_cpu_name  # type: ignore[import-untyped]
from llvmlite.binding.newpassmanagers import create_new_function_pass_manager  # type: ignore[import-untyped]
from llvmlite.ir import instructions as made  # type: ignore[import-untyped]
from numba.core import config
from numba.core import typed_passes as typed
from numba.core import untyped_passes as untyped
from numba.core.codegen import JITCodeLibrary, get_host_cpu_features
from numba.core.compiler import CompilerBase
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.ir import Arg, Assign
from numba.core.lowering import Lower

from .convention import Builder, Context, ours_alone, take_apart

__all__ = ["FAST_WHEN_WIDE", "ApartCompiler", "InnerCompiler", "KernelCompiler", "WideCompiler"]


def _below(library: Any) -> list[Any]:
    """The libraries that one calls, and those that the lowered among them call, each once."""
    found: dict[Any, None] = {}
    waiting = list(library._linking_libraries)
    while waiting:
        called = waiting.pop(0)
        if called not in found:
            found[called] = None
            waiting += called._linking_libraries if isinstance(called, Lowered) else []
    return list(found)


class Kernel(JITCodeLibrary):
    """A kernel and all that it calls."""

    wide = False

    def _optimize_functions(self, ll_module: Any) -> None:
        """Make the code small, for the kernel is optimised as a whole; numba does more, and again for each callee."""
        ll_module.data_layout = self._codegen._data_layout
        options, passes = self._codegen._pass_builder(), create_new_function_pass_manager()
        passes.add_sroa_pass()
        passes.add_simplify_cfg_pass()
        passes.add_instruction_combine_pass()
        for function in ll_module.functions:
            if not function.is_declaration:
                passes.run(function, options)

    def finalize(self) -> None:
        """Link, optimise, make machine code."""
        called = _below(self)
        for library in called:
            if isinstance(library, Lowered):
                self._final_module.link_in(library.alone(), preserve=True)
        self._linking_libraries = [library for library in called if not isinstance(library, Lowered)]
        super().finalize()


class WideKernel(Kernel):
    """One whose loops are long enough for the longest vectors."""

    wide = True


class Lowered(Kernel):
    """A function for kernels to be linked with, neither optimised as a whole nor turned into machine code."""

    def finalize(self) -> None:
        """What it calls is linked with the kernel."""
        self._finalize_dynamic_globals()
        self._finalized = True

    def alone(self) -> Any:
        """Its own code."""
        return super()._get_module_for_linking()

    def _get_module_for_linking(self) -> Any:
        """Its own code and that of all that it calls, for who is no kernel of ours."""
        whole = self.alone().clone()
        if any(ours_alone(function.name) and not function.is_declaration for function in whole.functions):
            raise TypeError(f"{self.name} takes arrays of a world: compile what calls it with sand.compiler.jit.kernel")
        for library in _below(self):
            whole.link_in(library.alone() if isinstance(library, Lowered) else library._get_module_for_linking(), True)
        return whole

    def get_pointer_to_function(self, name: str) -> int:
        """None."""
        self._ensure_finalized()
        return 0

    codegen = property(lambda self: self)

    def set_env(self, name: str, env: Any) -> None:
        """Nothing of ours reads an environment, and there is no machine code that could."""


class Apart(Lowered):
    """The same for a function that must not be pasted into its callers; only large loops are such."""

    wide = True


_PURE = made.ExtractValue, made.InsertValue, made.LoadInstr, made.CompareInstr, made.SelectInstr


def _drop_unused(function: Any) -> None:
    """Take out what is put together, read or compared, but not used."""
    each = [i for block in function.blocks for i in block.instructions]
    uses: Counter[int] = Counter()
    for i in each:
        uses.update(id(v) for v in ([v for v, _ in i.incomings] if isinstance(i, made.PhiInstr) else i.operands))
    waiting, gone = each, set()
    while waiting:
        i = waiting.pop()
        pure = isinstance(i, _PURE) or getattr(i, "opname", "") in ("or", "xor")
        if pure and not uses[id(i)] and id(i) not in gone:
            gone.add(id(i))
            uses.subtract(map(id, i.operands))
            waiting += i.operands
    for block in function.blocks:
        block.instructions[:] = [i for i in block.instructions if id(i) not in gone]


def _target() -> tuple[str, str]:
    """Name and features ("+avx2,-avx512f,…") of the processor that numba makes code for.

    These are `NUMBA_CPU_NAME` and `NUMBA_CPU_FEATURES` where they are set, else those of this machine.
    """
    name = get_host_cpu_name() if config.CPU_NAME is None else config.CPU_NAME
    return name, get_host_cpu_features() if config.CPU_FEATURES is None else config.CPU_FEATURES


_FP16 = {"sapphirerapids", "emeraldrapids", "graniterapids", "graniterapids-d", "diamondrapids"}
"""LLVM's names of processors that have avx512fp16, for features that do not name it."""


def _fast_when_wide(name: str, features: str) -> bool:
    """Does the processor compute with 512 bits without slowing down?  The last word on a feature counts."""
    said = [word[0] == "+" for word in features.split(",") if word[1:] == "avx512fp16"]
    return said[-1] if said else name in _FP16


_SLOW_TO_GATHER = _target()[0].startswith("znver")
"""AMD's Zen: takes numbers from many places faster one by one than by its instruction for it (measured on Zen 4)."""

FAST_WHEN_WIDE = _fast_when_wide(*_target())
"""Processors, Intel's since Sapphire Rapids, that do not slow down for 512 bits, of which LLVM uses half by itself."""


class _Lower(Lower):
    """From numba's own language to LLVM's."""

    def __init__(self, context: Any, place: Any, *given: Any, **options: Any):
        super().__init__(context, place, *given, **options)
        self._inner, self._apart = type(place) is Lowered, isinstance(place, Apart)
        self._wide = place.wide and FAST_WHEN_WIDE

    def setup_function(self, fndesc: Any) -> None:
        """Begin."""
        if not self._inner:
            take_apart(fndesc.mangled_name)
        super().setup_function(fndesc)
        if self._apart:
            self.function.attributes.add("noinline")
        if _SLOW_TO_GATHER:  # llvmlite knows no attributes with a value, but writes down what is in the set
            features = f"{self.context.codegen()._tm_features},+prefer-no-gather".lstrip(",")
            set.add(self.function.attributes, f'"target-features"="{features}"')
        if self._wide:
            set.add(self.function.attributes, '"prefer-vector-width"="512"')
        self.builder = Builder(self.entry_block)
        self.call_helper = self.call_conv.init_call_helper(self.builder)

    def _find_singly_assigned_variable(self) -> None:
        """Arguments stay what they are, too, instead of being written to memory and read again."""
        super()._find_singly_assigned_variable()
        times = Counter(a.target.name for b in self.blocks.values() for a in b.find_insts(Assign))
        for a in self.blocks[self.firstblk].find_insts(Assign):
            if isinstance(a.value, Arg) and times[a.target.name] == 1:
                self._singly_assigned_vars.add(a.target.name)

    def delvar(self, name: str) -> None:
        """Nothing of ours counts references."""

    def lower_normal_function(self, fndesc: Any) -> None:
        """All of a function."""
        super().lower_normal_function(fndesc)
        _drop_unused(self.function)


@register_pass(mutates_CFG=True, analysis_only=False)
class _Lowering(typed.NativeLowering):
    _name = "sand_lowering"
    lowering_class = _Lower


class KernelCompiler(CompilerBase):
    """The compiler for kernels: numba's passes, but for those that find nothing to do in our code."""

    kept: Any = Kernel
    passes = (
        untyped.TranslateByteCode,
        untyped.FixupArgs,
        untyped.IRProcessing,
        untyped.GenericRewrites,
        untyped.ReconstructSSA,
        typed.NopythonTypeInference,
        typed.PreLowerStripPhis,
        typed.AnnotateTypes,
        _Lowering,
        typed.NoPythonBackend,
    )

    def compile_extra(self, func: Any) -> Any:
        """As always, but nobody looks meanwhile for what could be thrown away: little can, among millions of things."""
        collects = gc.isenabled()
        gc.disable()
        try:
            return super().compile_extra(func)
        finally:
            if collects:
                gc.enable()

    def define_pipelines(self) -> list[Any]:
        """What is done, in this order."""
        self.state.targetctx.__class__ = Context  # a copy for this function
        place = self.kept(self.state.targetctx.codegen(), self.state.func_id.func_qualname)
        place.enable_object_caching()
        self.state["library"] = place
        manager = PassManager("sand")
        for each in self.passes:
            manager.add_pass(each, each.__name__)
        manager.finalize()
        return [manager]


class WideCompiler(KernelCompiler):
    """The same for those with long loops."""

    kept = WideKernel


class InnerCompiler(KernelCompiler):
    """The compiler for functions that only kernels call."""

    kept = Lowered


class ApartCompiler(KernelCompiler):
    """The same for those that must not be pasted into their callers."""

    kept = Apart
