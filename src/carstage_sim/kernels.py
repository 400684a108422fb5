"""How kernels are compiled, and where their machine code is kept between runs.

Every kernel runs without the interpreter lock and without a threading layer of numba's own: the
renderer hands bands of rays to its own few threads, so no kernel may be ``parallel=True``. None is
compiled with ``fastmath``: the same input gives the same bits.

Numba looks only at the file of the outermost function when it decides whether cached code is stale;
an edited callee or constant in another file would go unnoticed. So code is kept in a folder whose
name is a hash over all sources of the kernel's room, the folder directly below this package, and a
kernel only calls what lies in its own room: an edit there compiles its kernels anew, and no others.
"""

from __future__ import annotations

import hashlib
import importlib
import sys
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numba

from carstage_sim.cache import cache_folder, mark_used


@cache
def kernel_cache_key(package: Path) -> str:
    """Hash over the sources below a folder, this module, numba's version and the CPU."""
    digest = hashlib.sha256()
    for source in (Path(__file__), *sorted(package.rglob("*.py"))):
        digest.update(source.name.encode())
        digest.update(source.read_bytes())
    cpu = f"{llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"
    digest.update(f"{numba.__version__} {cpu}".encode())
    return digest.hexdigest()[:16]


def kernel_cache(package: Path) -> Path:
    """Where machine code of the kernels in exactly this state of a folder is kept."""
    return cache_folder() / "kernels" / f"{package.name}-{kernel_cache_key(package)}"


def do_without_scipy() -> None:
    """Let numba find no linear algebra of SciPy: to be called before a process's first kernel.

    Numba looks once, and imports all of it where it is installed, for kernels that multiply no
    matrices.
    """
    name = "scipy.linalg"
    if name in sys.modules:
        return
    modules: dict[str, Any] = sys.modules
    modules[name] = None
    try:
        importlib.import_module("numba.np.arraymath")
    finally:
        del modules[name]


Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]

_PACKAGE = Path(__file__).parent
_FAST: dict[str, Any] = {"nogil": True, "error_model": "numpy"}


def _room(source: Path) -> Path:
    """The folder directly below this package that holds a source file."""
    return _PACKAGE / source.relative_to(_PACKAGE).parts[0]


def _cached(function: Callable[..., Any], **options: Any) -> Callable[..., Any]:
    """Numba reads where to keep machine code when it decorates a function."""
    config: Any = numba.config  # whose names are made at run time
    before = config.CACHE_DIR
    folder = kernel_cache(_room(Path(function.__code__.co_filename)))
    config.CACHE_DIR = str(folder)
    mark_used(folder)
    try:
        compiled: Callable[..., Any] = numba.njit(cache=True, **_FAST, **options)(function)
    finally:
        config.CACHE_DIR = before
    return compiled


builder: Decorator = _cached
"""Decorator of functions that make arrays and that Python calls."""

kernel: Decorator = partial(_cached, _nrt=False)
"""Decorator of functions that Python calls and that only use arrays they are given.

Without numba's run time they count no references: in code that touches a dozen arrays for every
ray, the atomic counters would cost as much as the ray.
"""

device: Decorator = partial(
    numba.njit, _nrt=False, no_cpython_wrapper=True, no_cfunc_wrapper=True, **_FAST
)
"""Decorator of functions that only kernels call; compiled into each kernel that uses them.

Without a wrapper for Python's calls, which for tuples of arrays takes longer to compile than the
function.
"""
