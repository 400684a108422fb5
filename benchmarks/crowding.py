"""How much of a core a busy process gets now."""

from __future__ import annotations

import time

from carstage.bench.calibration import calibration_kernel


def crowding() -> float:
    """Wall time of the calibration kernel over its CPU time.

    1 on an idle machine; 3 where programs that run now leave it a third of a core.
    """
    wall_began = time.perf_counter()
    cpu_began = time.process_time()
    calibration_kernel()
    return max((time.perf_counter() - wall_began) / (time.process_time() - cpu_began), 1.0)
