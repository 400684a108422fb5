"""How fast this machine is now, against the machine that the targets were written for."""

from __future__ import annotations

import time
import zlib

import numpy as np

REFERENCE_CPU_S = 0.28
"""CPU seconds of the kernel on the reference machine (2 cores, Xeon of the 2.5 GHz class)."""


def slowness() -> float:
    """CPU seconds of a fixed kernel, relative to the reference machine; 2.0 = half as fast.

    The kernel mixes what the pipeline spends its time on: floating-point arrays that miss the
    cache, interpreted Python, and deflate. The fastest of three counts.
    """
    return min(calibration_kernel() for _ in range(3)) / REFERENCE_CPU_S


def calibration_kernel() -> float:
    """CPU seconds of the kernel, once."""
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
