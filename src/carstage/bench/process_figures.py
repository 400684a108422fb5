"""What the kernel reports of a process: CPU time and memory."""

from __future__ import annotations

import psutil


def process_cpu_s(pid: int) -> float:
    """CPU seconds, user and system, of all threads so far, ended ones included (10 ms steps)."""
    times = psutil.Process(pid).cpu_times()
    return float(times.user + times.system)


def resident_bytes(pid: int) -> int:
    """Resident memory, without pages of files: mapped pages of a log are the kernel's to drop."""
    memory = psutil.Process(pid).memory_info()
    return int(memory.rss - memory.shared)
