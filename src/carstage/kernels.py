"""Kernels of numba: compiled at their first call, and kept on disk from then on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a kernel at its first call, and keep the machine code where that can be done.

    Numba keeps it beside the kernel's file or else in the user's cache. Where neither can be
    written, as in a container that is read-only, each process compiles for itself. A kernel calls
    none of another file, whose changes numba would not notice. Divisions are NumPy's; other
    threads go on meanwhile.
    """
    try:
        kept: Callable[..., Any] = numba.njit(cache=True, error_model="numpy", nogil=True)(function)
    except RuntimeError:
        kept = numba.njit(error_model="numpy", nogil=True)(function)
    return kept
