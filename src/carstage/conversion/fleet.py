"""Converting all of an attempt: what the ego recorded, and what each agent beside it did.

Each agent gets a folder of its own, laid out as an episode is; see ``docs/formats/dataset.md``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from types import MappingProxyType
from typing import Any

from carstage.conversion.episode import Converted, EpisodeConversion
from carstage.rawlog.format import LEDGER, WORLD
from carstage.spec import EpisodeSpec, agent_of
from carstage.storage.attempt_files import AttemptFiles, FilesBelow
from carstage.storage.names import agent_folder

_AGENT = "agent"


class FleetConversion:
    """One :class:`EpisodeConversion` for the ego and each agent; the methods are that one's.

    Args:
        spec: the episode.
        raw_folder: folder of the attempt's raw log.
        attempt_files: receives the files.
        pool: where the work is done.
        codecs: name of the codec by sensor id, where it is not the default of the sensor's kind;
            an id stands for the sensors of that id of the ego and of every agent.
        progress: called whenever some work is done, well or not; from any thread.
        left_s: seconds for which work that is to be dropped may be waited for.
    """

    def __init__(
        self,
        spec: EpisodeSpec,
        raw_folder: Path,
        attempt_files: AttemptFiles,
        pool: Executor,
        *,
        codecs: Mapping[str, str] = MappingProxyType({}),
        progress: Callable[[], None] = lambda: None,
        left_s: Callable[[], float] = lambda: math.inf,
    ) -> None:
        self._parts: dict[str | None, EpisodeConversion] = {}
        for name in (None, *(agent.name for agent in spec.agents)):
            seen = spec if name is None else spec.seen_by(name)
            own = {sensor.id for sensor in seen.written_sensors}
            others = {s.id for a in spec.agents for s in a.sensors} if name is None else set(codecs)
            files = attempt_files if name is None else FilesBelow(attempt_files, agent_folder(name))
            self._parts[name] = EpisodeConversion(
                raw_folder,
                files,
                pool,
                # What names no sensor at all is left to the ego's, which refuses it.
                codecs={k: codec for k, codec in codecs.items() if k in own or k not in others},
                progress=progress,
                left_s=left_s,
                agent=name,
            )

    @property
    def frames_done(self) -> int:
        """Number of saved frames that are converted, on average over ego and agents."""
        return sum(part.frames_done for part in self._parts.values()) // len(self._parts)

    def segment_sealed(self, stream: str, segment: int) -> None:
        """Take note of a sealed segment of the raw log and hand out the work; cheap."""
        sensor, number = agent_of(stream)
        parts = list(self._parts.values())
        for part in parts if stream in (WORLD, LEDGER) else parts[number : number + 1]:
            part.segment_sealed(sensor, segment)

    def use(self, pool: Executor) -> None:
        """Hand further work to another pool, as the first one broke."""
        for part in self._parts.values():
            part.use(pool)

    def scan(self) -> None:
        """Pick up every segment that is sealed already."""
        for part in self._parts.values():
            part.scan()

    def converted(self) -> list[dict[str, Any]]:
        """What is done, as plain values of JSON."""
        return [
            entry if name is None else {**entry, _AGENT: name}
            for name, part in self._parts.items()
            for entry in part.converted()
        ]

    def go_on(self, converted: Sequence[Mapping[str, Any]]) -> None:
        """Take over what an earlier conversion into the same folder has done."""
        for name, part in self._parts.items():
            part.go_on([entry for entry in converted if entry.get(_AGENT) == name])

    def raise_if_failed(self) -> None:
        """Raise the first error of the work done so far."""
        for part in self._parts.values():
            part.raise_if_failed()

    def remove_converted(self) -> None:
        """Remove raw segments of sensors that no work will read any more."""
        for part in self._parts.values():
            part.remove_converted()

    def is_written(self) -> bool:
        """Whether nothing is left to do but to :meth:`finish`; one part's work after another's."""
        return all(part.is_written() for part in self._parts.values())

    def finish(self) -> Converted:
        """Wait for all work, that on what belongs to the whole episode included."""
        done = [part.finish() for part in self._parts.values()]
        files = tuple(file for one in done for file in one.files)
        return Converted(done[0].frames, files, done[0].opendrive, done[0].vector_map)

    def remove_parts(self) -> None:
        """Remove what lies beside the raw log for the conversion alone."""
        for part in self._parts.values():
            part.remove_parts()

    def stop(self) -> None:
        """Hand out no more work, and drop what is not begun."""
        for part in self._parts.values():
            part.stop()

    def cancel(self) -> None:
        """Drop what is not done and remove the attempt's files; the ego's last, which are all."""
        for part in reversed(self._parts.values()):
            part.cancel()
