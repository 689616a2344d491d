"""Faster compilation: numba's pipeline without the steps that SAND's functions do not need.

Numba generates machine code for every function before inlining it into its caller, where the work is repeated.  Here a
function that only kernels call stays in LLVM's intermediate representation and is linked with each kernel once.  No
code in SAND uses reference counting, and garbage collection is suspended during compilation.  `convention` contains the
calling convention.

All of this depends on numba's internals.  If they have changed, the import fails, and `jit` uses numba's own pipeline.
"""

from __future__ import annotations

import gc
from collections import Counter
from typing import Any

from llvmlite.binding import get_host_cpu_name  # type: ignore[import-untyped]
from llvmlite.binding.newpassmanagers import create_new_function_pass_manager  # type: ignore[import-untyped]
from llvmlite.ir.instructions import (  # type: ignore[import-untyped]
    CompareInstr,
    ExtractValue,
    InsertValue,
    LoadInstr,
    PhiInstr,
    SelectInstr,
)
from numba.core import config
from numba.core import typed_passes as typed
from numba.core import untyped_passes as untyped
from numba.core.codegen import JITCodeLibrary, get_host_cpu_features
from numba.core.compiler import CompilerBase
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.ir import Arg, Assign
from numba.core.lowering import Lower

from .convention import Builder, Context, flatten_arguments, mark_lowered, takes_aggregates

__all__ = ["FAST_512_BIT", "FunctionCompiler", "KernelCompiler", "LongVectorCompiler", "NoinlineCompiler"]


def _transitive_callees(library: Any) -> list[Any]:
    """Libraries called by a library, directly or through a `FunctionLibrary`, each once."""
    libraries: dict[Any, None] = {}
    pending = list(library._linking_libraries)
    while pending:
        called = pending.pop(0)
        if called not in libraries:
            libraries[called] = None
            pending += called._linking_libraries if isinstance(called, FunctionLibrary) else []
    return list(libraries)


class KernelLibrary(JITCodeLibrary):
    """LLVM code of a kernel and of all functions that it calls."""

    long_vectors = False

    def _optimize_functions(self, ll_module: Any) -> None:
        """Reduce the code size only: the kernel is optimised as a whole later."""
        ll_module.data_layout = self._codegen._data_layout
        options, passes = self._codegen._pass_builder(), create_new_function_pass_manager()
        passes.add_sroa_pass()
        passes.add_simplify_cfg_pass()
        passes.add_instruction_combine_pass()
        for function in ll_module.functions:
            if not function.is_declaration:
                passes.run(function, options)

    def finalize(self) -> None:
        """Link, optimise and generate machine code."""
        called = _transitive_callees(self)
        for library in called:
            if isinstance(library, FunctionLibrary):
                self._final_module.link_in(library.own_module(), preserve=True)
        self._linking_libraries = [library for library in called if not isinstance(library, FunctionLibrary)]
        super().finalize()


class LongVectorKernelLibrary(KernelLibrary):
    """Kernel whose loops are long enough for the longest SIMD vectors."""

    long_vectors = True


class FunctionLibrary(KernelLibrary):
    """Function to be linked with kernels; neither optimised by itself nor compiled to machine code."""

    def finalize(self) -> None:
        """Finish without linking: callees are linked with the kernel."""
        self._finalize_dynamic_globals()
        self._finalized = True

    def own_module(self) -> Any:
        """LLVM module of this function without its callees."""
        return super()._get_module_for_linking()

    def _get_module_for_linking(self) -> Any:
        """LLVM module of this function and its callees, for callers compiled by numba's own pipeline."""
        module = self.own_module().clone()
        if any(takes_aggregates(function.name) and not function.is_declaration for function in module.functions):
            raise TypeError(f"{self.name} takes arrays of a state: compile its callers with sand.compiler.jit.kernel")
        for library in _transitive_callees(self):
            own = isinstance(library, FunctionLibrary)
            module.link_in(library.own_module() if own else library._get_module_for_linking(), True)
        return module

    def get_pointer_to_function(self, name: str) -> int:
        """Null pointer, since there is no machine code."""
        self._ensure_finalized()
        return 0

    codegen = property(lambda self: self)

    def set_env(self, name: str, env: Any) -> None:
        """Do nothing: no function reads an environment."""


class NoinlineLibrary(FunctionLibrary):
    """Function that must not be inlined; used only for large loops."""

    long_vectors = True


_PURE = ExtractValue, InsertValue, LoadInstr, CompareInstr, SelectInstr


def _remove_unused_instructions(function: Any) -> None:
    """Remove instructions without side effects whose results are not used."""
    each = [i for block in function.blocks for i in block.instructions]
    uses: Counter[int] = Counter()
    for i in each:
        uses.update(id(v) for v in ([v for v, _ in i.incomings] if isinstance(i, PhiInstr) else i.operands))
    pending, removed = each, set()
    while pending:
        i = pending.pop()
        pure = isinstance(i, _PURE) or getattr(i, "opname", "") in ("or", "xor")
        if pure and not uses[id(i)] and id(i) not in removed:
            removed.add(id(i))
            uses.subtract(map(id, i.operands))
            pending += i.operands
    for block in function.blocks:
        block.instructions[:] = [i for i in block.instructions if id(i) not in removed]


def _target() -> tuple[str, str]:
    """Name and features ("+avx2,-avx512f,…") of the target processor.

    These are `NUMBA_CPU_NAME` and `NUMBA_CPU_FEATURES` if set, else those of this machine.
    """
    name = get_host_cpu_name() if config.CPU_NAME is None else config.CPU_NAME
    return name, get_host_cpu_features() if config.CPU_FEATURES is None else config.CPU_FEATURES


_AVX512FP16_CPUS = {"sapphirerapids", "emeraldrapids", "graniterapids", "graniterapids-d", "diamondrapids"}
"""LLVM names of processors with avx512fp16, for feature lists that do not mention it."""


def _fast_512_bit(name: str, features: str) -> bool:
    """Whether the processor executes 512-bit instructions without lowering its clock rate.

    The last mention in the feature list decides, else the name of the processor.
    """
    listed = [word[0] == "+" for word in features.split(",") if word[1:] == "avx512fp16"]
    return listed[-1] if listed else name in _AVX512FP16_CPUS


_SLOW_GATHER = _target()[0].startswith("znver")
"""AMD Zen: scalar loads are faster than gather instructions (measured on Zen 4)."""

FAST_512_BIT = _fast_512_bit(*_target())
"""Whether this processor is fast at 512 bits (Intel since Sapphire Rapids), although LLVM uses 256 bits by default."""


class _Lower(Lower):
    """Translation of numba's intermediate representation to LLVM's."""

    def __init__(self, context: Any, library: Any, *args: Any, **options: Any):
        super().__init__(context, library, *args, **options)
        self._inner, self._noinline = type(library) is FunctionLibrary, isinstance(library, NoinlineLibrary)
        self._long_vectors = library.long_vectors and FAST_512_BIT

    def setup_function(self, fndesc: Any) -> None:
        """Declare the function with its attributes."""
        if not self._inner:
            flatten_arguments(fndesc.mangled_name)
        super().setup_function(fndesc)
        if self._noinline:
            self.function.attributes.add("noinline")
        if _SLOW_GATHER:  # llvmlite has no attributes with values, but prints the members of the set verbatim
            features = f"{self.context.codegen()._tm_features},+prefer-no-gather".lstrip(",")
            set.add(self.function.attributes, f'"target-features"="{features}"')
        if self._long_vectors:
            set.add(self.function.attributes, '"prefer-vector-width"="512"')
        self.builder = Builder(self.entry_block)
        self.call_helper = self.call_conv.init_call_helper(self.builder)

    def _find_singly_assigned_variable(self) -> None:
        """Treat arguments that are never reassigned as values, instead of storing them in memory."""
        super()._find_singly_assigned_variable()
        times = Counter(a.target.name for b in self.blocks.values() for a in b.find_insts(Assign))
        for a in self.blocks[self.firstblk].find_insts(Assign):
            if isinstance(a.value, Arg) and times[a.target.name] == 1:
                self._singly_assigned_vars.add(a.target.name)

    def delvar(self, name: str) -> None:
        """Do nothing: there is no reference counting."""

    def lower_normal_function(self, fndesc: Any) -> None:
        """Lower the function, and remove unused instructions."""
        super().lower_normal_function(fndesc)
        mark_lowered(fndesc.mangled_name)
        _remove_unused_instructions(self.function)


@register_pass(mutates_CFG=True, analysis_only=False)
class _Lowering(typed.NativeLowering):
    _name = "sand_lowering"
    lowering_class = _Lower


class KernelCompiler(CompilerBase):
    """Compiler for kernels: numba's passes, except passes that have no effect on SAND's code."""

    code_library_class: Any = KernelLibrary
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
        """Compile without garbage collection, which would examine millions of objects and free few."""
        enabled = gc.isenabled()
        gc.disable()
        try:
            return super().compile_extra(func)
        finally:
            if enabled:
                gc.enable()

    def define_pipelines(self) -> list[Any]:
        """Set up library and passes."""
        self.state.targetctx.__class__ = Context  # the context is a copy made for this function
        library = self.code_library_class(self.state.targetctx.codegen(), self.state.func_id.func_qualname)
        library.enable_object_caching()
        self.state["library"] = library
        manager = PassManager("sand")
        for each in self.passes:
            manager.add_pass(each, each.__name__)
        manager.finalize()
        return [manager]


class LongVectorCompiler(KernelCompiler):
    """Compiler for kernels with long loops."""

    code_library_class = LongVectorKernelLibrary


class FunctionCompiler(KernelCompiler):
    """Compiler for functions that only kernels call."""

    code_library_class = FunctionLibrary


class NoinlineCompiler(KernelCompiler):
    """Compiler for functions that must not be inlined."""

    code_library_class = NoinlineLibrary
