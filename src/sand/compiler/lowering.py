"""Faster compilation, optional: a function that only compiled code calls gets no machine code of its own.

Numba generates machine code for every function before inlining it into its caller, where the work is repeated.  Here a
function stays in LLVM's intermediate representation and is linked once with each kernel that needs it.  Of numba's
passes only those are run that have an effect on SAND's code, and garbage collection is suspended.

All of this depends on numba's internals.  Without this module everything works and vectorises, but compiling takes
longer; `jit` does without it where the import fails or the version of numba is untested.
"""

from __future__ import annotations

import gc
from typing import Any

from llvmlite.binding.newpassmanagers import create_new_function_pass_manager  # type: ignore[import-untyped]
from numba.core import typed_passes as typed
from numba.core import untyped_passes as untyped
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase
from numba.core.compiler_machinery import PassManager

__all__ = ["FunctionCompiler", "KernelCompiler"]


class KernelLibrary(JITCodeLibrary):
    """LLVM code of a kernel and of all functions that it calls."""

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
        # callees before their callers: LLVM inlines functions in this order, and keeps the promise that the arrays of a
        # function do not overlap only if these are read or written in the function itself, not in functions it calls
        called: dict[Any, None] = {}

        def collect(library: Any) -> None:
            if library not in called:
                for callee in library._linking_libraries if isinstance(library, FunctionLibrary) else ():  # type: ignore[has-type]
                    collect(callee)
                called[library] = None

        for library in self._linking_libraries:  # type: ignore[has-type]
            collect(library)
        own = {function.name for function in self._final_module.functions if not function.is_declaration}
        for library in called:
            if isinstance(library, FunctionLibrary):
                module = library.own_module().clone()
                for function in module.functions:
                    if not function.is_declaration:
                        function.linkage = "weak_odr"  # it is linked although its caller is not there yet
                self._final_module.link_in(module)
        for function in self._final_module.functions:
            if function.name not in own and not function.is_declaration:
                function.linkage = "internal"  # unused arguments and functions can be removed
        self._linking_libraries = [library for library in called if not isinstance(library, FunctionLibrary)]
        super().finalize()


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
        for library in self._linking_libraries:
            module.link_in(library._get_module_for_linking(), True)
        return module

    def get_pointer_to_function(self, name: str) -> int:
        """Null pointer, since there is no machine code."""
        self._ensure_finalized()
        return 0

    codegen = property(lambda self: self)

    def set_env(self, name: str, env: Any) -> None:
        """Do nothing: no function reads an environment."""


class KernelCompiler(CompilerBase):
    """Compiler for kernels: numba's passes, except passes that have no effect on SAND's code."""

    code_library: Any = KernelLibrary
    passes = (
        untyped.TranslateByteCode,
        untyped.FixupArgs,
        untyped.IRProcessing,
        untyped.GenericRewrites,
        untyped.ReconstructSSA,
        typed.NopythonTypeInference,
        typed.PreLowerStripPhis,
        typed.AnnotateTypes,
        typed.NativeLowering,
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
                if not gc.get_freeze_count():  # the new objects, most of them permanent, go to the oldest generation
                    gc.freeze()
                    gc.unfreeze()
                gc.enable()

    def define_pipelines(self) -> list[Any]:
        """Set up library and passes."""
        library = self.code_library(self.state.targetctx.codegen(), self.state.func_id.func_qualname)
        library.enable_object_caching()
        self.state["library"] = library
        manager = PassManager("sand")
        for each in self.passes:
            manager.add_pass(each, each.__name__)
        manager.finalize()
        return [manager]


class FunctionCompiler(KernelCompiler):
    """Compiler for functions that only kernels call."""

    code_library = FunctionLibrary
