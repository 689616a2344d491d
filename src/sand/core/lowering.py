"""How our compiled code is made: numba's own way, without what ours does not need.

Numba makes machine code of every function before it pastes it into a caller, where all of that is done again; here a
function that only kernels call stays as it was lowered, and is linked with a kernel once.  Nothing of ours counts
references, how a call ended is looked at only where something can be raised, and the tuples of arrays that go from
function to function are not put together to be taken apart.

All of it leans on numba's inside.  Where that has changed, the import fails, and `jit` does without.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

from llvmlite import ir  # type: ignore[import-untyped]
from llvmlite.binding import get_host_cpu_name  # type: ignore[import-untyped]
from llvmlite.binding.newpassmanagers import create_new_function_pass_manager  # type: ignore[import-untyped]
from llvmlite.ir import instructions as made  # type: ignore[import-untyped]
from numba.core import typed_passes as typed
from numba.core import untyped_passes as untyped
from numba.core.callconv import CPUCallConv
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.cpu import CPUContext
from numba.core.datamodel.packer import ArgPacker
from numba.core.ir import Arg, Assign
from numba.core.lowering import Lower

__all__ = ["ApartCompiler", "InnerCompiler", "KernelCompiler"]


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
    """The same for a function that must not be pasted into its callers."""


_NEVER = ir.Constant(ir.IntType(1), 0)
_KNOWN = "_ZN4sand", "_ZN5numba7cpython8builtins", "_ZN5numba7cpython7numbers"
"""How the names of functions begin that we can tell of: our own, and max, min, int, powers of integers."""
_STEP_OF_0 = ("range() arg 3 must not be zero",)
_loud: set[str] = set()
"""Names of those that may raise: with bounds that are checked, for instance, or because they call others."""


class _Builder(ir.IRBuilder):
    """Writes down less."""

    def extract_value(self, agg: Any, idx: Any, name: str = "") -> Any:
        """What was put into a tuple is taken from there, not out of the tuple."""
        place = list(idx) if isinstance(idx, (list, tuple)) else [idx]
        while place and isinstance(agg, made.InsertValue):
            there = list(agg.indices)
            if place[: len(there)] == there:
                agg, place = agg.value, place[len(there) :]
            elif there[: len(place)] == place:
                break
            else:
                agg = agg.aggregate
        return super().extract_value(agg, place, name) if place else agg

    @contextmanager
    def if_then(self, pred: Any, likely: bool | None = None) -> Iterator[Any]:
        """Nothing where it never happens."""
        if pred is _NEVER:
            with self.goto_block(ir.Block(self.function)):
                yield None
        else:
            with super().if_then(pred, likely) as end:
                yield end


class _Packer(ArgPacker):
    def assign_names(self, args: Any, names: Any) -> None:
        """They have names, if only numbers."""


class _Convention(CPUCallConv):
    """Calls of functions that do not raise: how they ended need not be looked at."""

    def call_function(self, builder: Any, callee: Any, *given: Any, **options: Any) -> Any:
        """As always, but for the look at how it ended."""
        status, result = super().call_function(builder, callee, *given, **options)
        if callee.name.startswith(_KNOWN) and callee.name not in _loud:
            return status._replace(is_error=_NEVER), result
        _loud.add(builder.function.name)
        return status, result

    def return_user_exc(self, builder: Any, exc: Any, exc_args: Any = None, *rest: Any, **options: Any) -> None:
        """Raise: callers must look, but for what ours never do, a `range` in steps of 0, a negative power of 0."""
        if exc_args != _STEP_OF_0 and not builder.function.name.startswith(_KNOWN[1:]):
            _loud.add(builder.function.name)
        super().return_user_exc(builder, exc, exc_args, *rest, **options)

    def return_status_propagate(self, builder: Any, status: Any) -> None:
        """Pass on what was raised."""
        if status.is_error is not _NEVER:
            super().return_status_propagate(builder, status)


class _Context(CPUContext):
    """What it takes to lower."""

    call_conv = property(_Convention)
    packers: ClassVar[dict[Any, Any]] = {}

    def get_arg_packer(self, fe_args: Any) -> Any:
        """One for each set of types."""
        key = tuple(t._code for t in fe_args)
        if key not in self.packers:
            self.packers[key] = _Packer(self.data_model_manager, fe_args)
        return self.packers[key]


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


_SLOW_TO_GATHER = get_host_cpu_name().startswith("znver")
"""Processors that take numbers from many places faster one by one than by their instruction for it: all of AMD's."""


class _Lower(Lower):
    """From numba's own language to LLVM's."""

    def setup_function(self, fndesc: Any) -> None:
        """Begin."""
        super().setup_function(fndesc)
        if isinstance(self.library, Apart):
            self.function.attributes.add("noinline")
        if _SLOW_TO_GATHER:  # llvmlite knows no attributes with a value, but writes down what is in the set
            features = f"{self.context.codegen()._tm_features},+prefer-no-gather".lstrip(",")
            set.add(self.function.attributes, f'"target-features"="{features}"')
        self.builder = _Builder(self.entry_block)
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
        typed.IRLegalization,
        typed.AnnotateTypes,
        _Lowering,
        typed.NoPythonBackend,
    )

    def define_pipelines(self) -> list[Any]:
        """What is done, in this order."""
        self.state.targetctx.__class__ = _Context  # a copy for this function
        place = self.kept(self.state.targetctx.codegen(), self.state.func_id.func_qualname)
        place.enable_object_caching()
        self.state["library"] = place
        manager = PassManager("sand")
        for each in self.passes:
            manager.add_pass(each, each.__name__)
        manager.finalize()
        return [manager]


class InnerCompiler(KernelCompiler):
    """The compiler for functions that only kernels call."""

    kept = Lowered


class ApartCompiler(KernelCompiler):
    """The same for those that must not be pasted into their callers."""

    kept = Apart
