"""Functions of kernels that are compiled as parts of kernels alone.

Numba makes each function fit to be called from Python: it links in all that the function calls,
optimises the whole, and makes machine code of it. Of a function that only kernels call, none of
that is used; and as each level holds those below it, it took most of a large kernel's compilation.
Here such a function ends as code to be linked: a kernel gathers and optimises all of it, once.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
from numba.core import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import InlineOverloads, NativeLowering, NopythonRewrites
from numba.core.untyped_passes import (
    FindLiterallyCalls,
    InlineClosureLikes,
    InlineInlinables,
    LiteralPropagationSubPipelinePass,
    LiteralUnroll,
    MakeFunctionToJitFunction,
    RewriteDynamicRaises,
    WithLifting,
)

from carstage_sim.kernel_compiler import KernelCompiler

_UNUSED_PASSES = (
    WithLifting,
    InlineClosureLikes,
    RewriteDynamicRaises,
    MakeFunctionToJitFunction,
    InlineInlinables,
    FindLiterallyCalls,
    LiteralUnroll,
    LiteralPropagationSubPipelinePass,
    InlineOverloads,
    NopythonRewrites,
)
"""Numba's passes for closures, ``with``, raised values, ``literally`` and sums of whole arrays.

A linked function has none of these: numba would refuse it. Each pass looks at all of its code.
"""


class _LinkedLibrary(JITCodeLibrary):
    """Code that waits for the kernel that it is linked into."""

    _whole: Any = None

    def finalize(self) -> None:
        """Nothing is linked in, optimised or made machine code of."""
        if hasattr(self, "_reload_init"):  # not in numba 0.61
            for library in self._linking_libraries:
                self._reload_init.update(library._reload_init)
        self._finalized = True

    def _get_module_for_linking(self) -> Any:
        """Its code with that of all that it calls, which a kernel asks for."""
        if self._whole is None:
            self._whole = self._own_module().clone()
            for library in self._called({}):
                if isinstance(library, _LinkedLibrary):
                    part = library._own_module()
                else:
                    part = library._get_module_for_linking()
                self._whole.link_in(part, preserve=True)
        return self._whole

    def _own_module(self) -> Any:
        return super()._get_module_for_linking()

    def _called(self, known: dict[JITCodeLibrary, None]) -> dict[JITCodeLibrary, None]:
        """Those that are known, and all that it calls: each before those that it calls in turn."""
        for library in self._linking_libraries:
            if library not in known:
                known[library] = None
                if isinstance(library, _LinkedLibrary):
                    library._called(known)
        return known


@register_pass(mutates_CFG=True, analysis_only=False)
class _LinkedLowering(NativeLowering):
    """Makes a linked library of a function."""

    _name = "linked_lowering"

    def run_pass(self, state: Any) -> bool:
        state.library = _LinkedLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        state.flags.no_compile = True
        super().run_pass(state)
        # Numba knows functions by an object of their own, which has to be a built-in method, and
        # which it calls when Python does: this one refuses what it is given.
        key = dict[str, object]().update
        state.targetctx.insert_user_function(key, state.cr.fndesc, [state.library])
        state["cr"] = state.cr._replace(cfunc=key)
        return True


class _LinkedCompiler(KernelCompiler):
    """Numba's own passes, but for those without use and the last step to machine code."""

    def define_pipelines(self) -> list[Any]:
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.passes = [
            (_LinkedLowering if kind is NativeLowering else kind, text)
            for kind, text in passes.passes
            if kind not in _UNUSED_PASSES
        ]
        passes.finalize()
        return [passes]


def linked(function: Callable[..., Any], **options: Any) -> Callable[..., Any]:
    """Compile a function for each kernel that calls it, once for types that differ.

    Python cannot call it; its source is ``py_func``.

    Args:
        function: what kernels call.
        options: of ``numba.njit``.
    """
    compile_lazily: Any = numba.njit
    dispatcher = compile_lazily(
        pipeline_class=_LinkedCompiler, no_cpython_wrapper=True, no_cfunc_wrapper=True, **options
    )(function)
    template = dispatcher.get_call_template

    def of_plain_types(args: Any, names: dict[str, Any]) -> Any:
        # Each constant has a type of its own, and would get a function of its own.
        plain = {name: types.unliteral(kind) for name, kind in names.items()}
        return template(tuple(types.unliteral(kind) for kind in args), plain)

    dispatcher.get_call_template = of_plain_types
    compiled: Callable[..., Any] = dispatcher
    return compiled
