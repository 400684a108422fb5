"""Functions that only kernels call are compiled as parts of kernels."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba.core.errors import NumbaError

from carstage_sim.cache import CACHE_VARIABLE
from carstage_sim.kernels import device, inlined, kernel


def test_functions_are_compiled_into_a_kernel_once_for_all_constants(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))

    @device
    def scaled(value, factor, doubled):  # type: ignore[no-untyped-def]
        return value * factor * (2 if doubled else 1)

    @inlined
    def shifted(value, by):  # type: ignore[no-untyped-def]
        return scaled(value, 3, False) + by

    @kernel
    def both(values):  # type: ignore[no-untyped-def]
        for i in range(len(values)):
            values[i] = shifted(values[i], 5.0) + scaled(values[i], 7, True)

    values = np.array([1.0, -2.5])
    both(values)
    assert values.tolist() == [1 * 3 + 5 + 1 * 7 * 2, -2.5 * 3 + 5 - 2.5 * 7 * 2]
    functions: list[object] = [scaled, shifted]
    assert [len(one.overloads) for one in functions] == [1, 1]  # type: ignore[attr-defined]
    with pytest.raises(TypeError, match="at most 1 argument"):
        scaled(1.0, 2, False)


def test_code_that_several_functions_call_is_gathered_for_the_kernel_alone() -> None:
    @device
    def lowest(value):  # type: ignore[no-untyped-def]
        return value * value + 1.0

    @device
    def left(value):  # type: ignore[no-untyped-def]
        return lowest(value) - 3.0

    @device
    def right(value):  # type: ignore[no-untyped-def]
        return left(value) / lowest(value + 1.0)

    @kernel
    def both(value):  # type: ignore[no-untyped-def]
        return left(value) + right(value)

    assert both(2.0) == 2.0 + 2.0 / 10.0
    libraries = [next(iter(one.overloads.values())).library for one in (lowest, left, right)]  # type: ignore[attr-defined]
    assert [library._whole is None for library in libraries] == [True, False, False]


def comprehension(values, n):  # type: ignore[no-untyped-def]
    return sum([values[i] for i in range(n)])


def inner_function(values, n):  # type: ignore[no-untyped-def]
    def one(i):  # type: ignore[no-untyped-def]
        return values[i] + n

    return one(0)  # type: ignore[no-untyped-call]


def whole_arrays(values, n):  # type: ignore[no-untyped-def]
    return (values + values * n)[0]


@pytest.mark.parametrize("part", [comprehension, inner_function, whole_arrays])
def test_what_linked_functions_may_not_have_is_refused(part: Callable[..., Any]) -> None:
    called = device(part)

    @kernel
    def calls_it(values, n):  # type: ignore[no-untyped-def]
        return called(values, n)

    with pytest.raises(NumbaError):
        calls_it(np.ones(3), 2)
