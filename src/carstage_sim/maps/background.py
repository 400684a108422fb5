"""Bakes beside a server: one process at a time that leaves a town in the cache.

A bake takes seconds to minutes, and the thread that would do it owns the world: every client would
wait. ``python -m carstage_sim.maps.background JOB ANSWER`` is the process.
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
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType

from carstage_sim.maps.baking import BakeOptions
from carstage_sim.maps.checking import MapSamplingError, check_opendrive
from carstage_sim.maps.loading import TownSource, is_baked, town_of

logger = logging.getLogger(__name__)

MOST_WAITING = 8
"""Bakes that are not finished; each keeps a text, and clients send as many as they like."""
_BAKING_LOG = "carstage_sim.maps.baking"


class Bake:
    """One bake: wait until it is ``finished``, then ask for the ``result``.

    Args:
        source: what is baked.
        finished: whether nothing needs to be done.
    """

    def __init__(self, source: TownSource, *, finished: bool = False) -> None:
        self.source = source
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
        if self._process is not None:
            # The process that reads the lanes is a child of the bake: both are one group.
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()

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

    def advance(self) -> None:
        """Note what has finished, and start what is next; to be called now and then."""
        if self._process is not None and self._process.poll() is not None:
            bake = self._waiting.pop(0)
            bake.end(self._refusal(self._process.returncode, bake.source))
            self._tidy()
        if self._process is None and self._waiting:
            self._start(self._waiting[0].source)

    def _start(self, source: TownSource) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="carstage-bake-")
        job, answer = Path(self._folder.name) / "job.json", Path(self._folder.name) / "answer.json"
        level = logging.getLogger(_BAKING_LOG).getEffectiveLevel()
        folder = str(self._cache_folder) if self._cache_folder is not None else None
        record = {"source": dataclasses.asdict(source), "cache_folder": folder, "level": level}
        job.write_text(json.dumps(record), encoding="utf-8")
        self._process = subprocess.Popen(
            [sys.executable, "-m", __name__, str(job), str(answer)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is for the server, which ends this process in order
        )

    def _refusal(self, status: int, source: TownSource) -> str | None:
        assert self._folder is not None
        try:
            text = (Path(self._folder.name) / "answer.json").read_text(encoding="utf-8")
        except FileNotFoundError:
            return (
                f"map {source.name}: the process that baked it ended with status {status}; its "
                "last words are in the server's log"
            )
        answer: str | None = json.loads(text)
        return answer

    def _tidy(self) -> None:
        self._process = None
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None


def main(arguments: Sequence[str]) -> int:
    """The process: bakes what the job file says and writes what is wrong, or null."""
    job, answer = (Path(argument) for argument in arguments)
    record = json.loads(job.read_text(encoding="utf-8"))
    logging.basicConfig(format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    logging.getLogger(_BAKING_LOG).setLevel(record["level"])
    options = BakeOptions(**record["source"].pop("options"))
    refusal = None
    try:
        folder = Path(record["cache_folder"]) if record["cache_folder"] else None
        town_of(TownSource(**record["source"], options=options), cache_folder=folder)
    except MapSamplingError as error:
        refusal = str(error)
    answer.write_text(json.dumps(refusal), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
