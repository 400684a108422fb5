"""Bakes in the background of a server: one process at a time that leaves a town in the cache.

A bake takes seconds to minutes, and the thread that would do it owns the world: every client would
wait. What the process does is in :mod:`carstage_sim.maps.bake_process`.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import logging
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from types import TracebackType

from carstage_sim.maps.checking import MapSamplingError, check_opendrive
from carstage_sim.maps.loading import TownSource, is_baked

logger = logging.getLogger(__name__)

MOST_WAITING = 8
"""Bakes that are not finished; each keeps a text, and clients send as many as they like."""
BAKING_LOG = "carstage_sim.maps.baking"
_END_TIMEOUT_S = 3.0
_COMMAND = (sys.executable, "-m", "carstage_sim.maps.bake_process")


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
    """

    def __init__(self, cache_folder: Path | None = None) -> None:
        self._cache_folder = cache_folder
        self._waiting: list[Bake] = []
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
        self.kill()
        self._tidy()

    def kill(self) -> None:
        """End the bake under way; :meth:`advance` will call it a failure."""
        if self._process is None:
            return
        # It clears its files away, if it can do so soon.
        self._signal(signal.SIGTERM)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_END_TIMEOUT_S)
        self._signal(signal.SIGKILL)
        self._process.wait()

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
            if bake.source == source:
                bake.askers += 1
                return bake
        if is_baked(source, cache_folder=self._cache_folder):
            return Bake(source, finished=True)
        try:
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
        """One who asked for a bake is gone; what nobody waits for is not begun."""
        bake.askers -= 1
        under_way = self._process is not None and bake is self._waiting[0]
        if bake.askers <= 0 and bake in self._waiting and not under_way:
            logger.info("nobody waits for %s any more: it is not baked", bake.source.name)
            self._waiting.remove(bake)

    def advance(self) -> None:
        """Note what has finished, and start what is next; to be called now and then."""
        if self._process is not None and self._process.poll() is not None:
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

    def _start(self, source: TownSource) -> None:
        self._folder = tempfile.TemporaryDirectory(
            prefix="carstage-bake-", ignore_cleanup_errors=True
        )
        job, answer = Path(self._folder.name) / "job.json", Path(self._folder.name) / "answer.json"
        level = logging.getLogger(BAKING_LOG).getEffectiveLevel()
        folder = str(self._cache_folder) if self._cache_folder is not None else None
        record = {"source": dataclasses.asdict(source), "cache_folder": folder, "level": level}
        job.write_text(json.dumps(record), encoding="utf-8")
        self._process = subprocess.Popen(
            [*_COMMAND, str(job), str(answer)],
            stdin=subprocess.PIPE,  # which ends with this process, also when that is killed
            stdout=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is for the server, which ends this process in order
        )

    def _refusal(self, status: int, source: TownSource) -> str | None:
        """What is wrong with the source, as the process says or as its silence does."""
        assert self._folder is not None
        try:
            text = (Path(self._folder.name) / "answer.json").read_text(encoding="utf-8")
            answer: str | None = json.loads(text)
        except (OSError, ValueError):
            # There is none, or a kill or a full disk has cut it off.
            return (
                f"map {source.name}: the process that baked it ended with status {status}; its "
                "last words are in the server's log"
            )
        return answer

    def _tidy(self) -> None:
        if self._process is not None and self._process.stdin is not None:
            self._process.stdin.close()
        self._process = None
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None
