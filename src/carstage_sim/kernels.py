"""How kernels are compiled, and where their machine code is kept between runs.

The rule, which ``carstage.kernels`` follows too. Every kernel runs without the interpreter lock
(but those that take less time than to get it back), divides as NumPy does, and is never compiled
with ``fastmath``: the same input gives the same bits.
None is ``parallel=True``: threads belong to the caller, who hands each a band of the work.

Numba looks only at the file of the outermost function when it decides whether cached code is stale;
an edited callee or constant in another file would go unnoticed. So a kernel only calls what lies in
its **kernel package**, the folder directly below this package, at any depth. Its machine code is
kept in the cache folder under a hash over all sources of that package, numba's version and the CPU:
an edit there compiles its kernels anew, and no others. Where nothing can be written, each process
compiles for itself.

The hash and the decorator stand in both packages, as neither imports the other.
"""

from __future__ import annotations

import hashlib
import importlib
import os
import sys
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numba

# Numba imports this with the first kernel of a process, which registers a type; a thread that looks
# for the type of its own argument at that moment would fail.
import numba.experimental.function_type

from carstage_sim import kernel_compiler, linked_functions
from carstage_sim.cache import cache_folder, mark_used
from carstage_sim.kernel_compiler import KernelCompiler
from carstage_sim.linked_functions import linked

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]

_ROOT = Path(__file__).parent
_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}


def kernel_package(source: Path) -> Path:
    """The folder directly below this package that holds a source file; elsewhere its folder."""
    if not source.is_relative_to(_ROOT):
        return source.parent
    return _ROOT / source.relative_to(_ROOT).parts[0]


@cache
def kernel_cache_key(package: Path) -> str:
    """Hash over the sources of a kernel package, of how it is compiled, numba's version and CPU."""
    digest = hashlib.sha256()
    how = (__file__, kernel_compiler.__file__, linked_functions.__file__)
    for source in (*map(Path, how), *sorted(package.rglob("*.py"))):
        digest.update(source.name.encode())
        digest.update(source.read_bytes())
    cpu = f"{llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"
    digest.update(f"{numba.__version__} {cpu}".encode())
    return digest.hexdigest()[:16]


def kernel_cache(package: Path) -> Path:
    """Where machine code of the kernels in exactly this state of a package is kept."""
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


def _cached(function: Callable[..., Any], **options: Any) -> Callable[..., Any]:
    """Compile at the first call; numba reads the cache folder when it decorates a function."""
    folder = kernel_cache(kernel_package(Path(function.__code__.co_filename)))
    keeps = _is_writable(folder)
    mark_used(folder)
    config: Any = numba.config  # whose names are made at run time
    before, config.CACHE_DIR = config.CACHE_DIR, str(folder)
    try:
        how = {"pipeline_class": KernelCompiler, **_OPTIONS, **options}
        compiled: Callable[..., Any] = numba.njit(cache=keeps, **how)(function)
    finally:
        config.CACHE_DIR = before
    return compiled


def _is_writable(folder: Path) -> bool:
    """Numba would else keep code beside the source, without a look at callees."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)


builder: Decorator = _cached
"""Decorator of functions that make arrays and that Python calls."""

kernel: Decorator = partial(_cached, _nrt=False)
"""Decorator of functions that Python calls and that only use arrays they are given.

Without numba's run time they count no references: in code that touches a dozen arrays for every
ray, the atomic counters would cost as much as the ray.
"""

brief_kernel: Decorator = partial(_cached, _nrt=False, nogil=False)
"""As ``kernel``, for what takes some microseconds: it keeps the interpreter lock.

Beside threads that draw, who gives the lock away has it back up to a millisecond later. A step of
the world calls a dozen such kernels.
"""

device: Decorator = partial(linked, _nrt=False, **_OPTIONS)
"""Decorator of functions that only kernels call; compiled into each kernel that uses them."""

inlined: Decorator = partial(linked, _nrt=False, forceinline=True, **_OPTIONS)
"""As ``device``, without a call: for functions that get whole records, which a call would copy.

Numba hands this down: what such a function is the first to call is inlined, too, and all below it.
For colours and rays that is wanted: a colour picture takes a sixth less CPU time so. Their kernels
are larger for it, and all kernels together take a quarter more to compile.
"""
