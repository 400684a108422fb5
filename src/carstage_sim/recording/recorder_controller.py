"""The server's one recorder and one replayer, and what clients ask of them.

As in CARLA, starting one ends the other, and a new episode ends both.
"""

from __future__ import annotations

import logging
import math
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from carstage_sim.recording import queries
from carstage_sim.recording.errors import NotALogError, RecordingError
from carstage_sim.recording.folder import RecordingsFolder, check_writable
from carstage_sim.recording.log import RecordingLog
from carstage_sim.recording.recorder import Recorder
from carstage_sim.recording.replay_actors import ReplayOptions
from carstage_sim.recording.replayer import Replayer
from carstage_sim.world.snapshot import Snapshot
from carstage_sim.world.world import World

logger = logging.getLogger(__name__)

_FASTEST = 1000.0


class RecorderController:
    """Records and replays for a server.

    Args:
        folder: where all logs lie.

    Attributes:
        time_factor: recorded seconds per simulated second.
        ignore_hero, ignore_spectator: what the next replay leaves out.
    """

    def __init__(self, folder: RecordingsFolder | None = None) -> None:
        self._folder = RecordingsFolder() if folder is None else folder
        self._recorder: Recorder | None = None
        self._replayer: Replayer | None = None
        self.time_factor = 1.0
        self.ignore_hero = False
        self.ignore_spectator = True

    @property
    def replaying(self) -> bool:
        """Whether a replay runs."""
        return self._replayer is not None and self._replayer.running

    # Recording -----------------------------------------------------------------------------------

    def start(self, name: str, world: World, *, additional_data: bool) -> str:
        """Begin a recording; the path of its file.

        Raises:
            RecordingError: a name that is refused, or a file that cannot be written.
        """
        path = self._folder.log(name)
        check_writable(path)
        self.end_replay(keep_actors=True)
        self.stop()
        self._recorder = Recorder(path, world, additional_data=additional_data)
        return str(path)

    def stop(self) -> None:
        """End the recording, if one runs.

        Raises:
            RecordingError: its end could not be written.
        """
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            recorder.close()

    # Replaying -----------------------------------------------------------------------------------

    def map_of(self, name: str) -> str:
        """Name of the map that a log was made on.

        Raises:
            RecordingError: no such file, or no log.
        """
        with self._open(name) as log:
            return log.info.map_name

    def replay(self, name: str, world: World, options: ReplayOptions) -> str:
        """Begin a replay, which ends a recording; what CARLA says about it.

        Raises:
            RecordingError: no such file, or no log.
        """
        self.stop()  # before the file is read: it may be the one to replay
        log = self._open(name)
        options = replace(
            options, ignore_hero=self.ignore_hero, ignore_spectator=self.ignore_spectator
        )
        self.end_replay(keep_actors=False)
        try:
            with _decoding():
                self._replayer = Replayer(log, world, options, self.time_factor)
        except RecordingError:
            log.close()
            raise
        start_s, end_s = options.span_s(log.duration_s)
        total = f"{log.duration_s:g}"
        lines = [
            f"Total time recorded: {total}",
            f"Replaying from {start_s:g} s - {end_s:g} s ({total} s) at {self.time_factor:.1f}x",
        ]
        lines += ["Ignoring Hero vehicle"] * self.ignore_hero
        lines += ["Ignoring Spectator camera"] * self.ignore_spectator
        return "\n".join([*lines, ""])

    def end_replay(self, *, keep_actors: bool) -> None:
        """End the replay, if one runs."""
        replayer, self._replayer = self._replayer, None
        if replayer is not None:
            replayer.stop(keep_actors=keep_actors)

    def set_time_factor(self, factor: float) -> None:
        """Play faster or slower from now on.

        Raises:
            RecordingError: a factor that is no number from 0 to 1000.
        """
        if not (math.isfinite(factor) and 0.0 <= factor <= _FASTEST):
            raise RecordingError(f"the time factor must be 0 to {_FASTEST:g}, got {factor}")
        self.time_factor = factor

    # Texts ---------------------------------------------------------------------------------------

    def path(self, name: str) -> Path:
        """The file that a name stands for."""
        return self._folder.log(name)

    def file_info(self, name: str, *, show_all: bool) -> str:
        """What is in a log."""
        with self._open(name) as log, _decoding():
            return queries.file_info(log, show_all=show_all)

    def collisions(self, name: str, first: str, second: str) -> str:
        """Who collided in a log; categories are letters of ``o v w t h a``."""
        with self._open(name) as log, _decoding():
            return queries.collisions(log, first, second)

    def actors_blocked(self, name: str, min_time_s: float, min_distance_cm: float) -> str:
        """Who stood still in a log."""
        with self._open(name) as log, _decoding():
            return queries.actors_blocked(log, min_time_s, min_distance_cm)

    def _open(self, name: str) -> RecordingLog:
        recorder, path = self._recorder, self._folder.log(name)
        if recorder is not None and recorder.path == path:
            recorder.flush()
        return RecordingLog(path)

    # The tick ------------------------------------------------------------------------------------

    def before_tick(self, delta_s: float) -> None:
        """Bring a replayed world to its next recorded moment."""
        if self._replayer is None:
            return
        try:
            self._replayer.advance(delta_s * self.time_factor)
        except (struct.error, ValueError, OSError):
            logger.exception("the replay ends: its log is damaged")
            self.end_replay(keep_actors=True)

    def after_tick(self, snapshot: Snapshot) -> None:
        """Record the frame; end a replay that has shown its last one."""
        if self._replayer is not None:
            self._replayer.finish_if_over()
        if self._recorder is None:
            return
        try:
            self._recorder.record(snapshot)
        except RecordingError:
            logger.exception("the recording ends")
            self._give_up()

    def end_episode(self) -> None:
        """The world is about to be replaced, whatever becomes of the files: end what runs in it."""
        self._give_up()
        self.end_replay(keep_actors=True)

    def _give_up(self) -> None:
        """End the recording, also when its end cannot be written."""
        try:
            self.stop()
        except RecordingError:
            logger.exception("a recording has lost its end")


@contextmanager
def _decoding() -> Iterator[None]:
    """A packet that cannot be decoded is the file's fault.

    Raises:
        NotALogError: one could not.
    """
    try:
        yield
    except (struct.error, ValueError) as error:
        raise NotALogError from error
