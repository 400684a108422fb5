"""How kernels are compiled, and where their machine code is kept between runs.

Every kernel runs without the interpreter lock and without a threading layer of numba's own: the
renderer hands bands of rays to its own few threads, so no kernel may be ``parallel=True``.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numba

from carstage_sim.cache import cache_folder


def kernel_cache_key() -> str:
    """Hash over this package's sources, numba's version and the CPU.

    numba looks only at the file of the outermost function when it decides whether cached code is
    stale; an edited callee in another file would go unnoticed without this key.
    """
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.name.encode())
        digest.update(source.read_bytes())
    cpu = f"{llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"
    digest.update(f"{numba.__version__} {cpu}".encode())
    return digest.hexdigest()[:16]


def use_kernel_cache() -> Path:
    """Point numba's cache at a folder of this exact renderer; called before kernels are defined."""
    folder = cache_folder() / "kernels" / kernel_cache_key()
    os.environ["NUMBA_CACHE_DIR"] = str(folder)
    numba.config.reload_config()  # type: ignore[no-untyped-call]
    return folder


use_kernel_cache()

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]

_FAST: dict[str, Any] = {"nogil": True, "error_model": "numpy"}

builder: Decorator = partial(numba.njit, cache=True, **_FAST)
"""Decorator of functions that make arrays and that Python calls."""

kernel: Decorator = partial(numba.njit, cache=True, _nrt=False, **_FAST)
"""Decorator of functions that Python calls and that only use arrays they are given.

Without numba's run time they count no references: in code that touches a dozen arrays for every
ray, the atomic counters would cost as much as the ray.
"""

device: Decorator = partial(numba.njit, _nrt=False, **_FAST)
"""Decorator of functions that only kernels call; compiled into each kernel that uses them."""
