"""One run of one program: started, watched, its files looked at and removed."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import resource
import secrets
import selectors
import shutil
import signal
import struct
import subprocess
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil

from carstage.bench.comparison.contents import contents_of
from carstage.bench.comparison.presets import Preset
from carstage.bench.comparison.programs import PROGRAMS
from carstage.bench.comparison.trials import Trial, TrialResult
from carstage.bench.episodes import client_plan
from carstage.bench.process_figures import process_cpu_s, resident_bytes
from carstage.config import check_config
from carstage.errors import CollectorError
from carstage.plan import ServerFacts, plan_episodes
from carstage.server import Endpoint

_SAMPLE_EVERY_S = 0.25
_LONGEST_S = 6 * 3600.0
_TAIL_BYTES = 2000
_EVENTS = "events.txt"
# Of Linux: ioctl_iflags(2).
_GET_FLAGS, _SET_FLAGS, _TOP_OF_HIERARCHY = 0x80086601, 0x40086602, 0x20000


@dataclass(frozen=True, slots=True)
class Workplace:
    """Where programs run.

    Attributes:
        endpoint: the server.
        facts: what it offers.
        python: interpreter with its client.
        preset: how much is measured.
        scratch: where runs write, on the disk that is measured.
    """

    endpoint: Endpoint
    facts: ServerFacts
    python: str
    preset: Preset
    scratch: Path

    def run(self, trial: Trial, *, look: bool) -> TrialResult:
        """Let a program record, and remove what it wrote.

        Args:
            trial: what is run.
            look: take note of its first pictures and labels, to be compared with others'.

        Raises:
            CollectorError: it failed.
        """
        trials = self.scratch / "trials"
        shutil.rmtree(trials, ignore_errors=True)  # of a campaign that was killed
        trials.mkdir(parents=True)
        _spread(trials)
        folder = trials / secrets.token_hex(8)
        folder.mkdir()
        try:
            return self._measured(trial, folder, look=look)
        finally:
            shutil.rmtree(trials, ignore_errors=True)

    def _measured(self, trial: Trial, folder: Path, *, look: bool) -> TrialResult:
        command = self._command(trial, folder)
        server = self.endpoint.pid
        server_before = process_cpu_s(server) if server else float("nan")
        cpu_before, began = _cpu_of_children(), time.monotonic()
        peak_bytes = _run(command, folder)
        subprocess.run(["sync", "--file-system", str(folder)], check=True)
        wall_s, ended_at_s = time.monotonic() - began, time.time()
        cpu_s = _cpu_of_children() - cpu_before
        server_cpu_s = process_cpu_s(server) - server_before if server else float("nan")
        kept = _dataset_files(folder) if PROGRAMS[trial.program].keeps else []
        reported = _reported(folder)
        document = trial.document(self.preset)
        return TrialResult(
            wall_s=wall_s,
            recorded_s=ended_at_s - reported.first_tick_at_s,
            cpu_s=cpu_s,
            server_cpu_s=server_cpu_s,
            peak_mb=peak_bytes / 1e6,
            files=len(kept),
            mb=sum(path.stat().st_size for path in kept) / 1e6,
            spawned=reported.spawned,
            found=reported.found,
            contents=contents_of(folder, document) if look else {},
        )

    def _command(self, trial: Trial, folder: Path) -> list[str]:
        program = PROGRAMS[trial.program]
        document = trial.document(self.preset)
        document["server"] = {
            "kind": "remote",
            "host": self.endpoint.host,
            "port": self.endpoint.port,
            "client_python": self.python,
            "self_test": "off",
        }
        if program.module is None:
            if program.codec is not None:
                sensors = document["rig"]["sensors"]
                names = [sensor["id"] for sensor in sensors if sensor["kind"] == "rgb"]
                document["conversion"] = {"codecs": dict.fromkeys(names, program.codec)}
            return program.own_command(document, folder)
        (spec,) = plan_episodes(check_config(document), self.facts)
        plan = client_plan(spec, self.endpoint, folder / "files", sensor_warmup_ticks=None)
        (folder / "plan.json").write_text(json.dumps(plan), "utf-8")
        return program.command(folder / "plan.json", self.python, trial.labels)


def _spread(folder: Path) -> None:
    """Have an ext4 file system put each folder that is made in this one in a place of its own.

    Without a journal it looks, for every new file, through those that were deleted nearby within
    the last minutes: programs of short runs would pay for one another, a millisecond per file
    after some thousand. Other file systems have no such flag, and need none.
    """
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        flags = bytearray(8)
        fcntl.ioctl(descriptor, _GET_FLAGS, flags)
        (now,) = struct.unpack("=q", flags)
        fcntl.ioctl(descriptor, _SET_FLAGS, struct.pack("=q", now | _TOP_OF_HIERARCHY))
    except OSError as error:
        if error.errno not in (errno.ENOTTY, errno.EOPNOTSUPP, errno.EINVAL, errno.EPERM):
            raise
    finally:
        os.close(descriptor)


def _run(command: Sequence[str], folder: Path) -> int:
    """Run a command to its end; the most resident bytes of it and all that it started."""
    with (
        (folder / _EVENTS).open("wb") as events,
        (folder / "program.log").open("wb") as log,
        subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=events,
            stderr=log,
            start_new_session=True,
        ) as process,
    ):
        deadline_s = time.monotonic() + _LONGEST_S
        peak = 0
        ended = os.pidfd_open(process.pid)
        try:
            with selectors.DefaultSelector() as selector:
                selector.register(ended, selectors.EVENT_READ)
                while not selector.select(_SAMPLE_EVERY_S):
                    peak = max(peak, _family_bytes(process.pid))
                    if time.monotonic() > deadline_s:
                        raise subprocess.TimeoutExpired(command, _LONGEST_S)
            code = process.wait()
        finally:
            os.close(ended)
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    if code != 0:
        raise CollectorError(
            f"{' '.join(command[:4])} … ended with {code}.",
            _tail(folder / _EVENTS) + _tail(folder / "program.log"),
        )
    return peak


def _tail(path: Path) -> str:
    return path.read_bytes()[-_TAIL_BYTES:].decode("utf-8", "replace")


def _family_bytes(pid: int) -> int:
    total = 0
    with suppress(psutil.NoSuchProcess):
        root = psutil.Process(pid)
        for one in (root, *root.children(recursive=True)):
            with suppress(psutil.NoSuchProcess, psutil.ZombieProcess):
                total += resident_bytes(one.pid)
    return total


def _cpu_of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _dataset_files(folder: Path) -> list[Path]:
    """What a user would keep: a client's files, or the episodes of a dataset."""
    places = [folder / "files", folder / "dataset" / "episodes"]
    return [path for place in places for path in place.rglob("*") if path.is_file()]


@dataclass(frozen=True, slots=True)
class _Reported:
    """What a program counted, how many actors found a place, and when its first tick was made."""

    found: Mapping[str, float]
    spawned: int
    first_tick_at_s: float


def _reported(folder: Path) -> _Reported:
    found: dict[str, float] = {}
    spawned, first_tick_at_s = 0, float("nan")
    own = [*folder.glob("dataset/**/events.jsonl")]
    for path in own or [folder / _EVENTS]:
        for event in _events(path):
            spawned = max(spawned, _actors(event))
            if event.get("event") == "tick" and event["tick"] == 0:
                first_tick_at_s = float(event["time"])
            for name in ("lost", "torn", "incomplete"):
                if name in event:
                    found[name] = float(event[name])
            if "queued_bytes" in event:
                found["queue_mb"] = max(found.get("queue_mb", 0.0), event["queued_bytes"] / 1e6)
    return _Reported(found, spawned, first_tick_at_s)


def _events(path: Path) -> list[Mapping[str, Any]]:
    lines = path.read_text("utf-8").splitlines()
    return [event for line in lines if isinstance(event := json.loads(line), dict)]


def _actors(event: Mapping[str, Any]) -> int:
    spawned = event.get("spawned", {})
    return sum(int(spawned.get(group, 0)) for group in ("vehicles", "pedestrians"))
