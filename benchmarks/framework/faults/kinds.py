"""The faults: when each may strike, and what it does."""

from __future__ import annotations

import os
import random
import signal
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import ClassVar, TypeVar

import psutil

from benchmarks.framework.faults.command import Moment, RunCommand
from benchmarks.framework.faults.disks import (
    empty_disk,
    fill_disk,
    limit_files,
    slow_writes,
    small_disk,
)
from benchmarks.framework.faults.streams import (
    Cut,
    Disturbance,
    DisturbedStreams,
    Doubled,
    Late,
    Silent,
    Swapped,
)

STEPS = 10
"""Ticks of an episode of the campaign."""

HANG_S = 8.0
"""The campaign's ``supervision.hang_s``."""

_SENSOR_STREAMS = 5
_SMALL_DISK_BYTES = 24_000_000
_LONGEST_AFTER_S = 0.3

FAULTS: dict[str, type[Fault]] = {}
"""By name, in the order of the tables."""

_Kind = TypeVar("_Kind", bound="type[Fault]")


def _fault(name: str) -> Callable[[_Kind], _Kind]:
    def register(kind: _Kind) -> _Kind:
        kind.name = name
        FAULTS[name] = kind
        return kind

    return register


class Fault(ABC):
    """One fault of one trial; all that is random in it is drawn from ``rng`` when it is made.

    Attributes:
        own_server: whether the run starts a server, or uses the campaign's.
        episodes: how many the run records.
        settings: further ``key=value`` of the run.
        environment: added to the run's.
        host: address of the campaign's server that the run is given.
        moment: when it strikes.
        detail: what was drawn, in words.
        prefix: words before the run's command.
        run_id: name of the run's folder; None: a new one.
    """

    name: ClassVar[str]
    ends_supervisor: ClassVar[bool] = False
    sweeps: ClassVar[bool] = False
    """Whether the next run may have to remove what one that completed could not."""

    def __init__(self, rng: random.Random) -> None:
        self.own_server = False
        self.episodes = 1
        self.settings: list[str] = []
        self.environment: Mapping[str, str] = {}
        self.host = "127.0.0.1"
        self.moment = _any_moment(rng)
        self.detail = ""
        self.prefix: list[str] = []
        self.run_id: str | None = None

    def prepare(self, stack: ExitStack, folder: Path, ports: tuple[int, int]) -> Path:
        """Set the places; returns the dataset's folder.

        Args:
            stack: gives back at the trial's end.
            folder: the trial's.
            ports: RPC and streaming port of the campaign's server.
        """
        del stack, ports
        return folder / "dataset"

    @abstractmethod
    def strike(self, run: RunCommand) -> bool:
        """Do it; returns whether there was anything to do it to."""

    def has_struck(self) -> bool:
        """Whether it has struck by itself, which ``strike`` could not see."""
        return False

    def wrong(self) -> list[str]:
        """What the run did wrong that only this fault can see."""
        return []

    def lift(self) -> None:  # noqa: B027 - most faults are over by themselves
        """Take away what would hit the second run, too."""


def _any_moment(rng: random.Random) -> Moment:
    """A moment while a collector is at work."""
    event, most = rng.choice(
        [
            ("collector_started", 1),
            ("connected", 1),
            ("actors_spawned", 1),
            *[("tick", STEPS - 2)] * 4,
            ("segment_sealed", 7),
        ]
    )
    return Moment(event, rng.randint(1, most), rng.uniform(0.0, _LONGEST_AFTER_S))


def _kill(run: RunCommand, word: str, number: signal.Signals, rng: random.Random) -> bool:
    """Send a signal to one of the run's processes with that word in its command."""
    found = run.children(word)
    if not found:
        return False
    with suppress(psutil.NoSuchProcess):
        rng.choice(found).send_signal(number)
        return True
    return False


@_fault("kill_collector")
class KillCollector(Fault):
    """SIGKILL of the collector."""

    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        self._rng = rng
        self.own_server = rng.random() < 0.25

    def strike(self, run: RunCommand) -> bool:
        """See ``Fault``."""
        return _kill(run, "carstage.collector", signal.SIGKILL, self._rng)


@_fault("kill_converter")
class KillConverter(Fault):
    """SIGKILL of one of the processes that convert."""

    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        self._rng = rng
        self.settings = ["conversion.workers=2"] if rng.random() < 0.5 else []
        if rng.random() < 0.4:
            event = rng.choice(["episode_recorded", "collector_finished", "server_started"])
            self.moment = Moment(event, 1, rng.uniform(0.0, _LONGEST_AFTER_S))

    def strike(self, run: RunCommand) -> bool:
        """See ``Fault``."""
        return _kill(run, "carstage.conversion", signal.SIGKILL, self._rng)


@_fault("kill_server")
class KillServer(Fault):
    """SIGKILL of the server, one time in five while it starts."""

    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        self._rng = rng
        self.own_server = True
        if rng.random() < 0.2:
            self.moment = Moment("run_started", 1, rng.uniform(0.2, 3.0))

    def strike(self, run: RunCommand) -> bool:
        """See ``Fault``."""
        return _kill(run, "carstage_sim", signal.SIGKILL, self._rng)


@_fault("kill_supervisor")
class KillSupervisor(Fault):
    """SIGKILL of the run itself; one time in six its server is held still before."""

    ends_supervisor = True

    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        self._rng = rng
        self.own_server = rng.random() < 0.33
        self.leaves_orphan = self.own_server and rng.random() < 0.5
        if self.leaves_orphan:
            self.detail = "server held still"
        elif rng.random() < 0.3:
            event = rng.choice(["run_started", "attempt_reserved", "episode_recorded"])
            self.moment = Moment(event, 1, rng.uniform(0.0, 1.0))

    def strike(self, run: RunCommand) -> bool:
        """See ``Fault``."""
        if self.leaves_orphan:
            _kill(run, "carstage_sim", signal.SIGSTOP, self._rng)
        run.process.send_signal(signal.SIGKILL)
        return True


@_fault("stop_server")
class StopServer(Fault):
    """SIGSTOP of the server: it hangs as a whole."""

    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        self._rng = rng
        self.own_server = True

    def strike(self, run: RunCommand) -> bool:
        """See ``Fault``."""
        return _kill(run, "carstage_sim", signal.SIGSTOP, self._rng)


@_fault("truncated_log")
class TruncatedLog(Fault):
    """A file of the raw log loses its end before it is converted."""

    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        self._rng = rng
        self.episodes = 2
        self.settings = ["conversion.mode=deferred"]
        self.moment = Moment("attempt_reserved", 2, rng.uniform(0.0, _LONGEST_AFTER_S))

    def strike(self, run: RunCommand) -> bool:
        """See ``Fault``."""
        reserved = run.events("attempt_reserved")[0]
        folder = run.run_folder
        assert folder is not None
        raw = folder / "raw" / reserved["episode_id"] / reserved["attempt"]
        files = sorted(path for path in raw.rglob("*") if path.is_file())
        if not files:
            return False
        path = self._rng.choice(files)
        size = path.stat().st_size
        left = self._rng.randrange(max(1, size))
        os.truncate(path, left)
        self.detail = f"{path.relative_to(raw)}: {left} of {size} bytes left"
        return True


@_fault("full_disk")
class FullDisk(Fault):
    """The disk is full: a small one in memory, or a limit of file sizes where none can be made."""

    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        self._leave_bytes = rng.choice([0, 0, 8_192, 40_960, 131_072])
        self._limit_bytes = rng.choice([256, 4_096, 20_000])
        self._disk: Path | None = None
        if rng.random() < 0.3:
            event = rng.choice(["run_started", "episode_recorded", "collector_finished"])
            self.moment = Moment(event, 1, rng.uniform(0.0, _LONGEST_AFTER_S))

    def prepare(self, stack: ExitStack, folder: Path, ports: tuple[int, int]) -> Path:
        """See ``Fault``."""
        disk = folder / "disk"
        if stack.enter_context(small_disk(disk, _SMALL_DISK_BYTES)):
            self._disk = disk
            self.detail = f"tmpfs, {self._leave_bytes} bytes left"
        else:
            self.detail = f"RLIMIT_FSIZE of {self._limit_bytes} bytes"
        return disk / "dataset"

    def strike(self, run: RunCommand) -> bool:
        """See ``Fault``."""
        if self._disk is None:
            limit_files(run.process.pid, self._limit_bytes)
        else:
            fill_disk(self._disk, self._leave_bytes)
        return True

    def lift(self) -> None:
        """See ``Fault``."""
        if self._disk is not None:
            empty_disk(self._disk)


@_fault("slow_disk")
class SlowDisk(Fault):
    """Every write to the raw log takes long."""

    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        self._delay_s = rng.uniform(0.02, 0.3)
        self.moment = Moment("collector_started")
        self.detail = f"{self._delay_s:.2f} s per write"

    def prepare(self, stack: ExitStack, folder: Path, ports: tuple[int, int]) -> Path:
        """See ``Fault``."""
        self.environment = slow_writes(folder / "slow", self._delay_s)
        return super().prepare(stack, folder, ports)

    def strike(self, run: RunCommand) -> bool:
        """It has struck already."""
        del run
        return True


class StreamFault(Fault):
    """A fault on the way of the sensors' data."""

    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        self.host = "127.0.0.2"
        self.moment = Moment("tick", 1)
        self._victim = rng.randrange(_SENSOR_STREAMS)
        self._nth = rng.randint(2, STEPS)  # the first ones are of the warm-up
        self._rng = rng
        self._streams: DisturbedStreams | None = None

    def prepare(self, stack: ExitStack, folder: Path, ports: tuple[int, int]) -> Path:
        """See ``Fault``."""
        self._streams = stack.enter_context(DisturbedStreams(self.host, *ports, self.disturb))
        return super().prepare(stack, folder, ports)

    @abstractmethod
    def disturb(self, stream: int) -> Disturbance | None:
        """The disturbance of the n-th stream that a collector has opened."""

    def strike(self, run: RunCommand) -> bool:
        """It strikes by itself."""
        del run
        return self._streams is not None and self._streams.disturbed > 0


@_fault("lost_stream")
class LostStream(StreamFault):
    """A sensor falls silent, or its connection breaks off."""

    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        kinds: list[type[Silent] | type[Cut]] = [Silent, Cut]
        self._kind = rng.choice(kinds)
        self.detail = f"{self._kind.__name__.lower()} from message {self._nth} on"

    def disturb(self, stream: int) -> Disturbance | None:
        """See ``StreamFault``."""
        return self._kind(self._nth) if stream == self._victim else None


@_fault("late_data")
class LateData(StreamFault):
    """A sensor's message comes late: in time to be waited for, or not."""

    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        in_time = rng.random() < 0.5
        self._delay_s = rng.uniform(0.3, 3.0) if in_time else HANG_S * rng.uniform(1.3, 1.8)
        self.detail = f"message {self._nth} by {self._delay_s:.1f} s"

    def disturb(self, stream: int) -> Disturbance | None:
        """See ``StreamFault``."""
        return Late(self._nth, self._delay_s) if stream == self._victim else None


@_fault("duplicated_data")
class DuplicatedData(StreamFault):
    """Messages come twice, on every stream."""

    def disturb(self, stream: int) -> Disturbance | None:
        """See ``StreamFault``."""
        del stream
        return Doubled(self._rng, 0.5)


@_fault("reordered_data")
class ReorderedData(StreamFault):
    """Messages overtake one another, on every stream."""

    def disturb(self, stream: int) -> Disturbance | None:
        """See ``StreamFault``."""
        del stream
        return Swapped(self._rng, 0.3)
