"""What the kernel reports of a process, besides ``carstage.bench.process_figures``."""

from __future__ import annotations

from pathlib import Path

import psutil

_NS_PER_S = 1e9


def main_thread_cpu_s(pid: int) -> float:
    """CPU seconds of the main thread so far, to the nanosecond where the kernel has it.

    Source: the first number of ``/proc/<pid>/task/<tid>/schedstat`` is the time that the thread
    was on a core (Linux, Documentation/scheduler/sched-stats.rst).
    """
    task = Path(f"/proc/{pid}/task/{pid}/schedstat")
    if task.exists():
        return int(task.read_text().split()[0]) / _NS_PER_S
    threads_of = {thread.id: thread for thread in psutil.Process(pid).threads()}
    return float(threads_of[pid].user_time + threads_of[pid].system_time)


def rss_mb(pid: int) -> float:
    """Resident memory in MB of 10^6 bytes.

    Not the proportional set: that changes whenever another process with the same libraries starts
    or ends.
    """
    status = Path(f"/proc/{pid}/status").read_text()
    (line,) = (line for line in status.splitlines() if line.startswith("VmRSS:"))
    return int(line.split()[1]) * 1024 / 1e6


def open_files(pid: int) -> int:
    """Descriptors that a process has open."""
    return sum(1 for _ in Path(f"/proc/{pid}/fd").iterdir())


def threads(pid: int) -> int:
    """Threads of a process."""
    return sum(1 for _ in Path(f"/proc/{pid}/task").iterdir())
