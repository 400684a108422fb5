"""Kernels of numba: compiled at their first call, and kept on disk from then on.

The rule is that of ``carstage_sim.kernels``, and so is the code of the hash and the decorator, as
neither package imports the other. Every kernel runs without the interpreter lock, divides as NumPy
does and is never compiled with ``fastmath``. It only calls what lies in its **kernel package**, the
folder directly below this package. Its machine code is kept in the cache folder under a hash over
all sources of that package, numba's version and the CPU, since numba itself would not notice an
edited callee in another file. Where nothing can be written, each process compiles for itself.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numba

# Numba imports this with the first kernel of a process, which registers a type; a thread that looks
# for the type of its own argument at that moment would fail.
import numba.experimental.function_type

from carstage.cache import cache_folder

_ROOT = Path(__file__).parent


@cache
def kernel_cache(package: Path) -> Path:
    """Where machine code of the kernels in exactly this state of a package is kept."""
    digest = hashlib.sha256()
    for source in (Path(__file__), *sorted(package.rglob("*.py"))):
        digest.update(source.name.encode())
        digest.update(source.read_bytes())
    cpu = f"{llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"
    digest.update(f"{numba.__version__} {cpu}".encode())
    return cache_folder() / "kernels" / f"{package.name}-{digest.hexdigest()[:16]}"


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile at the first call; numba reads the cache folder when it decorates a function."""
    source = Path(function.__code__.co_filename)
    folder = kernel_cache(_ROOT / source.relative_to(_ROOT).parts[0])
    keeps = _is_writable(folder)
    with contextlib.suppress(OSError):
        os.utime(folder)  # what nobody used for a month is removed
    config: Any = numba.config  # whose names are made at run time
    before, config.CACHE_DIR = config.CACHE_DIR, str(folder)
    try:
        kept: Callable[..., Any] = numba.njit(cache=keeps, nogil=True, error_model="numpy")(
            function
        )
    finally:
        config.CACHE_DIR = before
    return kept


def _is_writable(folder: Path) -> bool:
    """Numba would else keep code beside the source, without a look at callees."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)
