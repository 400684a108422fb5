"""Bakes in the background of a server: one process at a time that leaves a town in the cache.

A bake takes seconds to minutes, and the thread that would do it owns the world: every client would
wait. What the process does is in :mod:`carstage_sim.maps.bake_process`. It is ended when it takes
too long or too much memory, and when nobody waits for it any more. Nothing here waits for a process
but the end of all.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import logging
import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from carstage_sim.maps.checking import MapSamplingError, check_opendrive
from carstage_sim.maps.loading import TownSource, is_baked

logger = logging.getLogger(__name__)

MOST_WAITING = 8
"""Bakes that are not finished; each keeps a text, and clients send as many as they like."""
BAKING_LOG = "carstage_sim.maps.baking"
READ_AT_ONCE = 1 << 20
"""Characters of a map that are looked through before a process starts; a longer one is read there,
as the world would wait."""
_END_TIMEOUT_S = 3.0
_WEIGHED_EVERY_S = 0.2
_BYTES_PER_MB = 10**6
_NO_MEMORY = re.compile("MemoryError|bad_alloc")
"""In the last words of what a process could not get at once."""
_COMMAND = (sys.executable, "-m", "carstage_sim.maps.bake_process")


@dataclass(frozen=True, slots=True)
class BakeLimits:
    """What one bake may take before it is given up.

    Attributes:
        seconds: by the clock, while it runs; time in the queue does not count.
        memory_mb: MB (10^6 bytes) that it holds, the process that reads the lanes included.
    """

    seconds: float = 1800.0
    memory_mb: int = 6000


class Bake:
    """One bake: wait until it is ``finished``, then ask for the ``result``.

    Args:
        source: what is baked.
        finished: whether nothing needs to be done.

    Attributes:
        source: as given.
        askers: how many wait for it.
    """

    def __init__(self, source: TownSource, *, finished: bool = False) -> None:
        self.source = source
        self.askers = 1
        self._refusal: str | None = None
        self._finished = finished

    @property
    def finished(self) -> bool:
        """Whether nothing remains to be done."""
        return self._finished

    def result(self) -> None:
        """Return if the town is in the cache now.

        Raises:
            MapSamplingError: nothing can be made of the source.
        """
        if self._refusal is not None:
            raise MapSamplingError(self._refusal)

    def end(self, refusal: str | None = None) -> None:
        """Note the outcome: what is wrong, or None."""
        self._refusal = refusal
        self._finished = True


class BackgroundBakes:
    """Runs bakes one after the other; a context manager that ends the process under way.

    Args:
        cache_folder: where baked towns are kept; by default in the user's cache folder.
        limits: what each of them may take.
    """

    def __init__(self, cache_folder: Path | None = None, limits: BakeLimits | None = None) -> None:
        self._cache_folder = cache_folder
        self._limits = limits or BakeLimits()
        self._waiting: list[Bake] = []
        self._begun_s = self._weighed_s = 0.0
        self._told_to_end_s: float | None = None
        self._reason: str | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    def __enter__(self) -> BackgroundBakes:
        return self

    def __exit__(
        self,
        _type: type[BaseException] | None,
        _value: BaseException | None,
        _traceback: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """End what runs; what waits is never baked."""
        self._waiting.clear()
        if self._process is not None:
            self._tell_to_end("the server ends")
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(_END_TIMEOUT_S)
            self._signal(signal.SIGKILL)
            self._process.wait()
        self._tidy()

    def _tell_to_end(self, reason: str) -> None:
        """Let the bake under way clear its files away and end; :meth:`advance` sees to it."""
        if self._told_to_end_s is None:
            self._told_to_end_s, self._reason = time.monotonic(), reason
            self._signal(signal.SIGTERM)

    def _signal(self, number: signal.Signals) -> None:
        # The process that reads the lanes is a child of the bake: both are one group.
        assert self._process is not None
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, number)

    @property
    def process_id(self) -> int | None:
        """Of the bake under way, None if there is none."""
        return self._process.pid if self._process is not None else None

    def begin(self, source: TownSource) -> Bake:
        """The bake of a source: a finished one if there is nothing to do, else one that may be
        under way already.

        Raises:
            MapSamplingError: the text is no usable OpenDRIVE, or too many bakes wait.
        """
        self.advance()
        for bake in self._waiting:
            if bake.source == source and not self._is_ending(bake):
                bake.askers += 1
                return bake
        if is_baked(source, cache_folder=self._cache_folder):
            return Bake(source, finished=True)
        try:
            if len(source.opendrive) <= READ_AT_ONCE:
                check_opendrive(source.name, source.opendrive)
        except MapSamplingError as error:
            text = f"{source.origin}: {error}" if source.origin else str(error)
            raise MapSamplingError(text) from error
        if len(self._waiting) >= MOST_WAITING:
            raise MapSamplingError(
                f"map {source.name}: {MOST_WAITING} others are being baked; wait for one of them"
            )
        bake = Bake(source)
        self._waiting.append(bake)
        self.advance()
        return bake

    def leave(self, bake: Bake) -> None:
        """One who asked for a bake is gone; what nobody waits for is not begun, or ends soon."""
        bake.askers -= 1
        if bake.askers > 0 or bake not in self._waiting:
            return
        logger.info("nobody waits for %s any more: it is not baked", bake.source.name)
        if self._is_under_way(bake):
            self._tell_to_end("nobody waits for it any more")
        else:
            self._waiting.remove(bake)

    def _is_under_way(self, bake: Bake) -> bool:
        return self._process is not None and bake is self._waiting[0]

    def _is_ending(self, bake: Bake) -> bool:
        return self._is_under_way(bake) and self._told_to_end_s is not None

    def advance(self) -> None:
        """Note what has finished, end what took too long, and start what is next; to be called now
        and then."""
        if self._process is not None and self._process.poll() is None:
            self._bound()
        elif self._process is not None:
            refusal = self._refusal(self._process.returncode, self._waiting[0].source)
            self._tidy()
            self._waiting.pop(0).end(refusal)
        while self._process is None and self._waiting:
            source = self._waiting[0].source
            try:
                self._start(source)
            except OSError as error:
                self._tidy()
                logger.warning("map %s: its bake could not begin: %s", source.name, error)
                self._waiting.pop(0).end(f"map {source.name}: its bake could not begin: {error}")

    def _bound(self) -> None:
        """End the bake under way if it is above a limit, by force if it does not end when told."""
        now_s, limit_s, limit_mb = time.monotonic(), self._limits.seconds, self._limits.memory_mb
        if self._told_to_end_s is not None:
            if now_s - self._told_to_end_s > _END_TIMEOUT_S:
                self._signal(signal.SIGKILL)
        elif now_s - self._begun_s > limit_s:
            self._tell_to_end(
                f"it took longer than {limit_s:g} s; cut the map into pieces, or let the server "
                "bake longer with --bake-seconds"
            )
        elif now_s - self._weighed_s > _WEIGHED_EVERY_S:
            self._weighed_s = now_s
            assert self._process is not None
            if _resident_mb(self._process.pid) > limit_mb:
                self._tell_to_end(_too_much_memory(limit_mb))

    def _start(self, source: TownSource) -> None:
        self._folder = tempfile.TemporaryDirectory(
            prefix="carstage-bake-", ignore_cleanup_errors=True
        )
        job, answer = Path(self._folder.name) / "job.json", Path(self._folder.name) / "answer.json"
        level = logging.getLogger(BAKING_LOG).getEffectiveLevel()
        folder = str(self._cache_folder) if self._cache_folder is not None else None
        record = {
            "source": dataclasses.asdict(source),
            "cache_folder": folder,
            "level": level,
            "most_bytes": self._limits.memory_mb * _BYTES_PER_MB,
        }
        job.write_text(json.dumps(record), encoding="utf-8")
        self._process = subprocess.Popen(
            [*_COMMAND, str(job), str(answer)],
            stdin=subprocess.PIPE,  # which ends with this process, also when that is killed
            stdout=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is for the server, which ends this process in order
        )
        self._begun_s = time.monotonic()

    def _refusal(self, status: int, source: TownSource) -> str | None:
        """What is wrong with the source, as the process says or as its silence does."""
        assert self._folder is not None
        if self._reason is not None:
            logger.warning("map %s: its bake was ended: %s", source.name, self._reason)
            return f"map {source.name}: its bake was ended: {self._reason}"
        try:
            text = (Path(self._folder.name) / "answer.json").read_text(encoding="utf-8")
            answer: str | None = json.loads(text)
        except (OSError, ValueError):
            # There is none, or a kill or a full disk has cut it off.
            return (
                f"map {source.name}: the process that baked it ended with status {status}; its "
                "last words are in the server's log"
            )
        if answer is not None and _NO_MEMORY.search(answer):
            return f"map {source.name}: {_too_much_memory(self._limits.memory_mb)}"
        return answer

    def _tidy(self) -> None:
        if self._process is not None and self._process.stdin is not None:
            self._process.stdin.close()
        self._process = self._told_to_end_s = self._reason = None
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None


def _too_much_memory(limit_mb: int) -> str:
    """What a client is told whose map needs more memory than a bake may take."""
    return (
        f"it takes more than the {limit_mb} MB of memory that it may; cut the map into pieces, or "
        "let the server bake with more by --bake-memory"
    )


def _resident_mb(process_id: int) -> float:
    """What a process and its children hold; 0 for one that has ended."""
    folder = Path(f"/proc/{process_id}")
    try:
        pages = int((folder / "statm").read_text().split()[1])
        children = (folder / "task" / str(process_id) / "children").read_text().split()
    except (OSError, IndexError):
        return 0.0
    own_mb = pages * resource.getpagesize() / _BYTES_PER_MB
    return own_mb + sum(_resident_mb(int(child)) for child in children)
