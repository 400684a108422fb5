"""What numba is spared when it compiles kernels changes no machine code, and nothing else."""

from __future__ import annotations

import gc
import itertools
import re
from typing import Any

import numba
import numpy as np
import pytest
from numba.core.bytecode import FunctionIdentity
from numba.core.compiler import CompilerBase
from numba.core.errors import NumbaError
from numba.extending import overload

from carstage_sim import kernel_compiler
from carstage_sim.kernel_compiler import KernelCompiler

OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "_nrt": False}
FEW, MANY = np.arange(5, dtype=np.float32), np.arange(40.0).reshape(8, 5)


def blend(values, other, n):  # type: ignore[no-untyped-def]
    """Operators, built-in functions and branches, of several types."""
    total = np.float32(0)
    for i in range(n):
        a, b = values[i], other[i, i]
        total += min(a, np.float32(3)) * a - abs(np.float32(b)) / (a + np.float32(1))
        if i & 1 or b > 2:
            total = max(total, np.float32(int(a) // 2 % 3))
    return total


def code_of(compiler: type[CompilerBase]) -> str:
    """Assembly of :func:`blend`, without the numbers that numba gives functions.

    They are part of names, and with their digits grows what is written down as a name's length.
    """
    compiled: Any = numba.njit(pipeline_class=compiler, **OPTIONS)(blend)
    compiled(FEW, MANY, 5)
    (code,) = compiled.inspect_asm().values()
    return re.sub(r"B\d+v\d+|v\d+B|::\d+|\d{6,}|(?m:\.size\t\"\.const\..*$)", "", code)


def test_kernels_have_the_machine_code_that_numba_makes_by_itself(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # The second's number has a digit more: so it happens to functions 9 and 10, 99 and 100.
    monkeypatch.setattr(FunctionIdentity, "_unique_ids", itertools.count(99_999))
    assert code_of(KernelCompiler) == code_of(numba.core.compiler.Compiler)


def test_numba_is_asked_once_for_each_operator_and_types(monkeypatch: pytest.MonkeyPatch) -> None:
    known: dict[Any, Any] = {}
    asked: list[Any] = []
    monkeypatch.setattr(kernel_compiler._RememberingTypes, "_signatures", known)
    is_builtin = kernel_compiler._is_builtin

    def noted(function: Any, signature: Any) -> bool:
        asked.append((function, signature.args))
        return is_builtin(function, signature)

    monkeypatch.setattr(kernel_compiler, "_is_builtin", noted)

    def thrice(a, b):  # type: ignore[no-untyped-def]
        return a * b + (a + b) * (a * b * a)

    numba.njit(pipeline_class=KernelCompiler)(thrice)(1.5, 2.5)

    assert len(asked) == len(known) == 2  # one product and one sum


def test_what_numba_compiles_for_each_caller_is_not_remembered(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    known: dict[Any, Any] = {}
    monkeypatch.setattr(kernel_compiler._RememberingTypes, "_signatures", known)

    def halved(a):  # type: ignore[no-untyped-def]
        return 0.5 * a

    overload(halved)(lambda a: lambda a: 0.5 * a)

    def twice(a):  # type: ignore[no-untyped-def]
        return halved(a) * a

    assert numba.njit(pipeline_class=KernelCompiler)(twice)(3.0) == 4.5

    assert [key[1].typing_key.__name__ for key in known] == ["mul"]


@pytest.mark.parametrize("fails", [False, True])
def test_garbage_is_looked_for_as_before_when_a_kernel_is_compiled(fails: bool) -> None:
    before = gc.get_threshold()
    met: list[int] = []

    class Watched(KernelCompiler):
        def define_pipelines(self) -> list[Any]:
            met.append(gc.get_threshold()[0])
            return super().define_pipelines()

    def added(a):  # type: ignore[no-untyped-def]
        return a + ("text" if fails else 1)

    compiled: Any = numba.njit(pipeline_class=Watched)(added)
    if fails:
        with pytest.raises(NumbaError):
            compiled(1)
    else:
        assert compiled(1) == 2

    assert met == [kernel_compiler._ALLOCATIONS]
    assert gc.get_threshold() == before
