"""How fast this machine is now, against the machine that the targets were written for.

The kernel is that of ``carstage.bench.calibration``:
neither package imports the other, so change both.
"""

from __future__ import annotations

import time
import zlib

import numpy as np

REFERENCE_CPU_S = 0.28
"""CPU seconds of the kernel on the reference machine (2 cores, Xeon of the 2.5 GHz class)."""


def slowness() -> float:
    """CPU seconds of a fixed kernel, relative to the reference machine; 2.0 = half as fast.

    The kernel mixes what a server spends its time on: arrays that miss the cache, interpreted
    Python, and C code over bytes. The fastest of three counts.
    """
    return min(_kernel() for _ in range(3)) / REFERENCE_CPU_S


def crowding() -> float:
    """Wall time of the kernel over its CPU time: how much of a core a busy process gets, inverted.

    1 on an idle machine; 3 where programs that run now leave it a third of a core.
    """
    began = time.perf_counter()
    cpu_began = time.process_time()
    _kernel()
    return max((time.perf_counter() - began) / (time.process_time() - cpu_began), 1.0)


def _kernel() -> float:
    generator = np.random.default_rng(0)
    values = generator.random(2_000_000)
    payload = (values[:400_000] * 255).astype(np.uint8).tobytes()
    started = time.process_time()
    for _ in range(10):
        values = np.sqrt(values * values + 1e-9)
    total = 0
    for number in range(2_000_000):
        total += number & 7
    for _ in range(20):
        zlib.compress(payload, 1)
    return time.process_time() - started
