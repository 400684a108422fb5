"""What the kernel says of a process: CPU time of all threads and of the main one, memory."""

from __future__ import annotations

from pathlib import Path

import psutil

_NS_PER_S = 1e9


def process_cpu_s(pid: int) -> float:
    """CPU seconds, user and system, of all threads so far, ended ones included (10 ms steps)."""
    times = psutil.Process(pid).cpu_times()
    return float(times.user + times.system)


def main_thread_cpu_s(pid: int) -> float:
    """CPU seconds of the main thread so far, to the nanosecond where the kernel tells.

    Source: the first number of ``/proc/<pid>/task/<tid>/schedstat`` is the time that the thread
    was on a core (Linux, Documentation/scheduler/sched-stats.rst).
    """
    task = Path(f"/proc/{pid}/task/{pid}/schedstat")
    if task.exists():
        return int(task.read_text().split()[0]) / _NS_PER_S
    threads = {thread.id: thread for thread in psutil.Process(pid).threads()}
    return float(threads[pid].user_time + threads[pid].system_time)


def resident_bytes(pid: int) -> int:
    """Resident memory, without pages of files: mapped pages of a log are the kernel's to drop."""
    memory = psutil.Process(pid).memory_info()
    return int(memory.rss - memory.shared)
