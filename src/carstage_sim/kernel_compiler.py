"""Numba's compiler, spared of work that gives a kernel nothing.

Half of what it takes to compile the kernels of pictures is Python code of numba's own. What is
spared here changes no machine code.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

from numba.core import types
from numba.core.compiler import CompilerBase, DefaultPassBuilder

_ALLOCATIONS = 100_000
"""Objects made between two looks for garbage while numba compiles, instead of some hundred."""


@contextmanager
def _rare_collections() -> Iterator[None]:
    """In the block, Python looks for garbage rarely: numba makes millions of objects that stay."""
    before = gc.get_threshold()
    gc.set_threshold(_ALLOCATIONS, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)


class _RememberingTypes:
    """Numba's typing context, which remembers what operators and built-in functions return.

    Numba asks up to twenty rules in turn what the product of two numbers is, for each product.
    Of ten thousand such questions of the shading, three hundred differ.
    """

    _signatures: ClassVar[dict[tuple[Any, ...], Any]] = {}

    def __init__(self, context: Any) -> None:
        self._context = context

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def resolve_function_type(self, function: Any, args: Any, names: Any) -> Any:
        """The signature of a call; numba's name for it."""
        if type(function) is not types.Function:
            return self._context.resolve_function_type(function, args, names)
        # The function's type notes which rule applied, and is kept with the signature.
        key = (self._context, function, tuple(args), tuple(names.items()))
        signature = self._signatures.get(key)
        if signature is None:
            signature = self._context.resolve_function_type(function, args, names)
            if _is_builtin(function, signature):
                self._signatures[key] = signature
        return signature


def _is_builtin(function: Any, signature: Any) -> bool:
    """Whether numba's own code does it, not a function that it compiles with the caller's options.

    The latter would be compiled for each caller.
    """
    return signature is not None and function.get_impl_key(signature) == function.typing_key


class KernelCompiler(CompilerBase):
    """Numba's compiler with a memory for types, and without frequent looks for garbage."""

    def __init__(self, typing_context: Any, *args: Any) -> None:
        super().__init__(typing_context, *args)
        self.state.typingctx = _RememberingTypes(typing_context)

    def compile_extra(self, function: Any) -> Any:
        """Compile a function, and first those that it calls; numba holds a lock meanwhile."""
        with _rare_collections():
            return super().compile_extra(function)

    def define_pipelines(self) -> list[Any]:
        """The passes, which numba asks for: its own."""
        return [DefaultPassBuilder.define_nopython_pipeline(self.state)]
