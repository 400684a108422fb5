"""Both packages compile kernels by one rule: same options, no call out of a kernel package."""

from __future__ import annotations

import importlib
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import FunctionType
from typing import Any

import pytest
from numba.core.dispatcher import Dispatcher

SOURCES = Path(__file__).parents[1] / "src"
KEEPS_THE_LOCK = "carstage_sim.world"
"""Its kernels take microseconds."""


def kernels_of(package: str) -> Iterator[Dispatcher]:
    """All compiled functions of a package."""
    for path in sorted((SOURCES / package).rglob("*.py")):
        if f"{package}.kernels import" in path.read_text():
            name = ".".join(path.relative_to(SOURCES).with_suffix("").parts)
            for value in vars(importlib.import_module(name)).values():
                if isinstance(value, Dispatcher) and value.py_func.__module__ == name:
                    yield value


def kernel_package(kernel: Dispatcher) -> str:
    """The folder directly below the package."""
    return ".".join(kernel.py_func.__module__.split(".")[:2])


def callees(function: FunctionType) -> list[Dispatcher]:
    """Compiled functions that a function names."""
    named: list[Any] = [function.__globals__.get(name) for name in function.__code__.co_names]
    return [value for value in named if isinstance(value, Dispatcher)]


@pytest.mark.parametrize("package", ["carstage", "carstage_sim"])
def test_kernels_only_call_what_lies_in_their_kernel_package(package: str) -> None:
    calls = [(k, callee) for k in kernels_of(package) for callee in callees(k.py_func)]
    assert calls
    for kernel, callee in calls:
        assert kernel_package(callee) == kernel_package(kernel), (kernel, callee)


@pytest.mark.parametrize("package", ["carstage", "carstage_sim"])
def test_kernels_are_compiled_with_the_same_options(package: str) -> None:
    for kernel in kernels_of(package):
        options = kernel.targetoptions
        assert options["nogil"] or kernel_package(kernel) == KEEPS_THE_LOCK, kernel
        assert options["error_model"] == "numpy", kernel
        assert not options.get("fastmath"), kernel
        assert not options.get("parallel"), kernel


@pytest.mark.parametrize("package", ["carstage", "carstage_sim"])
def test_a_first_kernel_registers_no_types_with_numba(package: str) -> None:
    code = (
        f"import {package}.kernels, numba\n"
        "from numba.core.typing.typeof import typeof_impl\n"
        "before = set(typeof_impl.registry)\n"
        "assert numba.njit(lambda x: x + 1)(1) == 2\n"
        "assert set(typeof_impl.registry) == before, set(typeof_impl.registry) - before\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
