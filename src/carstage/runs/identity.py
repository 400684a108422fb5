"""Which process a run is, and whether it certainly lives or is certainly gone.

A process id says little: another PID namespace (a container) has the same numbers for other
processes, another machine may have the same name, and numbers are used again. So a run writes down
the machine's boot, the PID namespace and the time at which its process began. Only a reader in the
same namespace of the same boot can look. Everybody else knows nothing, and must remove nothing.
"""

from __future__ import annotations

import hashlib
import os
import socket
import time
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, Literal

import psutil

Life = Literal["alive", "dead", "unknown"]
SILENCE_S = 900.0
"""Age of the heartbeat from which a run that cannot be seen is shown as dead; clocks may differ."""


def identify(pid: int | None = None) -> dict[str, Any]:
    """What tells a process of this PID namespace from every other one, as plain values.

    Args:
        pid: its id; default: this process.

    Returns:
        ``host``, ``machine`` (a hash of the machine's id; empty where there is none), ``boot_id``,
        ``pid_namespace``, ``pid``, ``pid_started`` (Unix time) and ``pid_start_ticks`` (since the
        boot, which setting the clock does not change).

    Raises:
        psutil.NoSuchProcess: it has ended, or waits to be reaped.
    """
    pid = os.getpid() if pid is None else pid
    ticks = _start_ticks(pid)
    if ticks is None:
        raise psutil.NoSuchProcess(pid)
    return {
        **_here(),
        "pid": pid,
        "pid_started": float(psutil.Process(pid).create_time()),
        "pid_start_ticks": ticks,
    }


def life_of(document: Mapping[str, Any]) -> Life:
    """Whether the process that a document identifies lives.

    ``dead`` is certain: this namespace has no such process, or the machine was started anew since
    the last heartbeat. ``unknown``: the process is elsewhere, or an older version wrote this.
    """
    here = _here()
    if document.get("boot_id") == here["boot_id"]:
        if document.get("pid_namespace") != here["pid_namespace"] or not _proc_is_ours():
            return "unknown"
        ticks = _start_ticks(document.get("pid"))
        return "alive" if ticks is not None and ticks == document.get("pid_start_ticks") else "dead"
    same_machine = here["machine"] and all(
        document.get(name) == here[name] for name in ("machine", "host")
    )
    last_seen_s = max(_number(document.get("heartbeat")), _number(document.get("pid_started")))
    return "dead" if same_machine and last_seen_s < psutil.boot_time() else "unknown"


def is_alive(document: Mapping[str, Any]) -> bool:
    """Whether a process lives, as far as can be told: one elsewhere by its heartbeat.

    For what is shown. What is removed asks :func:`life_of`.
    """
    life = life_of(document)
    if life == "unknown":
        return time.time() - _number(document.get("heartbeat")) < SILENCE_S
    return life == "alive"


def boot_id() -> str:
    """Which boot of the machine this is; empty where that is unknown."""
    return _here()["boot_id"]


@cache
def _here() -> dict[str, str]:
    """The machine, its boot and the PID namespace; it stays while this process lives."""
    boot_id = machine = namespace = ""
    with suppress(OSError):
        boot_id = Path("/proc/sys/kernel/random/boot_id").read_text("ascii").strip()
    with suppress(OSError):
        # Hashed, as systemd asks for: the id itself is nobody else's to know.
        text = Path("/etc/machine-id").read_text("ascii").strip()
        machine = hashlib.sha256(f"carstage {text}".encode()).hexdigest()[:16] if text else ""
    with suppress(OSError):
        namespace = str(Path("/proc/self/ns/pid").readlink())
    return {
        "host": socket.gethostname(),
        "machine": machine,
        "boot_id": boot_id,
        "pid_namespace": namespace,
    }


def _proc_is_ours() -> bool:
    """Whether ``/proc`` shows the processes of this namespace."""
    try:
        return int(str(Path("/proc/self").readlink())) == os.getpid()
    except (OSError, ValueError):
        return False


def _start_ticks(pid: Any) -> int | None:
    """Clock ticks from the boot to a process's start; None for one that is gone (proc(5), stat)."""
    if not isinstance(pid, int):
        return None
    try:
        # The name in brackets may have spaces and brackets of its own.
        state, *rest = Path(f"/proc/{pid}/stat").read_bytes().rpartition(b")")[2].split()
        return None if state in (b"Z", b"X", b"x") else int(rest[18])
    except (OSError, ValueError, IndexError):
        return None


def _number(value: Any) -> float:
    return float(value) if isinstance(value, int | float) else 0.0
