"""One ego's life in a world that somebody else ticks, from attaching the rig to sealed segments."""

from __future__ import annotations

import logging
import os
import threading
import time
from collections import deque
from contextlib import ExitStack
from dataclasses import replace
from typing import Any, Deque, Dict, Iterator, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import carla

from carstage.collector.client import answers, is_known_gone
from carstage.collector.internals.background import give_way
from carstage.collector.internals.dialect import weather_values
from carstage.collector.internals.errors import RecordingError
from carstage.collector.internals.events import EventStream
from carstage.collector.internals.level_objects import level_objects
from carstage.collector.internals.matching import ExpectedFrame, FrameMatcher
from carstage.collector.internals.plan import ServerPlan
from carstage.collector.internals.snapshots import WEATHER_PARAMETERS, WorldObserver
from carstage.collector.internals.stopping import StopRequest
from carstage.collector.internals.writing import LogWriters, expected_segments, writer_threads
from carstage.collector.maps import geo_reference
from carstage.collector.paths import prepare_folder
from carstage.collector.processing import POLL_S, ByteBudget, Pipeline
from carstage.collector.sensors import sensor_of
from carstage.collector.sensors.rig import Rig
from carstage.collector.timing import Tick, skipped_ticks, ticks_per_segment
from carstage.rawlog.format import ACTOR_RECORD, FORMAT_VERSION, WORLD
from carstage.rawlog.writing import write_episode_file, write_map_file
from carstage.releases import gnss_convention
from carstage.sensor_kinds import sensor_kind
from carstage.spec import EpisodeSpec
from carstage.spec.timing import SavedFrames

MOST_WAITING_FRAMES = 1000
"""World states that may wait to be noted; the oldest are lost for further ones."""
PATIENCE_S = 10.0
"""How long a sensor's data of a frame are waited for."""
LOOK_S = 1.0
"""How often a silent world is asked whether it is still the same."""
EXPECTED_ACTORS = 200
BATCH_S = 0.05
"""Frames are noted so far apart, all that came since: a world at full speed goes on meanwhile."""
SEGMENT_S = 5.0
"""Simulated seconds of a segment: sealing one waits for the disk, which a fast world feels."""
STEP_TOLERANCE_S = 1e-6

_log = logging.getLogger(__name__)


class Followed(NamedTuple):
    """What came of an ego.

    Attributes:
        ticks: how many are recorded.
        incomplete: ticks with a sensor that is not ok.
        server_gone: it did not end well: the server was gone before the ego.
    """

    ticks: int
    incomplete: int
    server_gone: bool = False


class _Seen(NamedTuple):
    """A frame of the world; ``states`` is None where the ego is not in it."""

    snapshot: Any
    states: Optional[Dict[str, Any]]
    tick_s: float


class FrameQueue:
    """The frames of a world, in their order, from the client's thread; bounded.

    Args:
        world: ``carla.World``.
        observer: reads what only the newest frame tells.
        ego_id: the ego's.
    """

    def __init__(self, world: Any, observer: WorldObserver, ego_id: int) -> None:
        self._world = world
        self._observer = observer
        self._knows_lights = False
        self._ego_id = ego_id
        self._frames: Deque[_Seen] = deque(maxlen=MOST_WAITING_FRAMES)
        self._changed = threading.Condition()
        self._last_s = time.perf_counter()
        self._told_s = 0.0
        self._is_batch = False

    def on_tick(self, snapshot: Any) -> None:
        """For ``World.on_tick``: no later frame is known to the client until this returns."""
        now_s = time.perf_counter()
        tick_s, self._last_s = now_s - self._last_s, now_s
        states = None
        if snapshot.find(self._ego_id) is not None:
            try:
                if not self._knows_lights:  # a client knows of nobody before the first frame
                    lights = self._world.get_actors().filter("traffic.traffic_light")
                    self._observer.watch_lights(lights)
                    self._knows_lights = True
                states = self._observer.states()
            except RuntimeError as error:
                _log.info("frame %d: the ego tells nothing any more: %s", snapshot.frame, error)
        with self._changed:
            self._frames.append(_Seen(snapshot, states, tick_s))
            if now_s - self._told_s >= BATCH_S:
                self._told_s = now_s
                self._is_batch = True
                self._changed.notify_all()

    @property
    def lags(self) -> bool:
        """Whether further frames wait."""
        return bool(self._frames)

    def take(self, timeout_s: float) -> Optional[_Seen]:
        """The next frame, after waiting at most so long for one; None when there is none.

        A batch of frames is there every :data:`BATCH_S` at most; those of an unfinished one come
        when the wait is over.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._is_batch, timeout_s)
            seen = self._frames.popleft() if self._frames else None
            self._is_batch = bool(self._frames)
            return seen


class _Attached:
    """What a rig needs of a session, in a world that is not ours."""

    def __init__(self, client: Any, world: Any) -> None:
        self.client = client
        self.world = world
        self._actors: List[Any] = []

    def destroy_on_exit(self, what: str, actor: Any) -> None:
        """Have an actor destroyed by ``give_back``."""
        del what
        self._actors.append(actor)

    def give_back(self, timeout_s: float) -> None:
        """Destroy the sensors; those that went with the ego are gone already."""
        commands = [carla.command.DestroyActor(actor.id) for actor in reversed(self._actors)]
        self._actors.clear()
        if commands and answers(self.client, timeout_s):
            self.client.apply_batch_sync(commands, False)


class FollowedEpisode:
    """Records one ego until it is gone.

    Args:
        client: ``carla.Client``.
        world: the ego's ``carla.World``.
        ego: its ``carla.Vehicle``.
        spec: sensors and labels; its number of steps is not known yet.
        folder: of the raw log.
        server: for its timeout.
        queue_bytes: sensor data that may wait for the disk.
    """

    def __init__(
        self,
        client: Any,
        world: Any,
        ego: Any,
        spec: EpisodeSpec,
        folder: str,
        server: ServerPlan,
        queue_bytes: int,
    ) -> None:
        self._client = client
        self._world = world
        self._ego = ego
        self._spec = spec
        self._folder = folder
        self._server = server
        self._budget = ByteBudget(queue_bytes)
        self._server_gone = False

    def record(self, versions: Tuple[str, str], events: EventStream, stop: StopRequest) -> Followed:
        """Attach the rig, follow, and leave the world as it was.

        Raises:
            CollectorError: the rig does not fit, or the log cannot be written.
            InterruptedByRequestError: somebody asked to end before the first frame.
        """
        stop.check()
        folder = prepare_folder(self._folder)
        spec, world = self._spec, self._world
        observer = WorldObserver(world, self._ego)
        with ExitStack() as stack:
            attached = _Attached(self._client, world)
            stack.callback(attached.give_back, self._server.timeout_s)
            try:
                rig = Rig(attached, spec, self._ego)  # type: ignore[arg-type]
            except RuntimeError as error:
                if "not found" not in str(error) and self._is_there():
                    raise
                _log.info("the ego went before it had its sensors: %s", error)
                return Followed(0, 0, self._server_gone)
            segment_ticks, writers, pipeline = self._pipeline(stack, rig)
            frames = FrameQueue(world, observer, int(self._ego.id))
            stack.callback(self._stop_listening, rig, world.on_tick(frames.on_tick))
            rig.listen({one.id: pipeline.callback_within_budget(one.id) for one in spec.sensors})
            events.emit("following", sensors=len(rig.actors), ego=int(self._ego.id))
            # Only now: each frame that is made before the sensors are there is lost.
            town = world.get_map()
            map_crc32 = write_map_file(folder, town.to_opendrive())
            first: List[Tick] = []
            ticks = self._follow(pipeline, frames, observer, first, events, stop)
            if ticks:
                ticks = self._finish(pipeline, writers, ticks)
            if not ticks:
                return Followed(0, 0, self._server_gone)
            header = self._header(versions, rig, segment_ticks, first[0], ticks, town)
            write_episode_file(folder, {**header, "map_crc32": map_crc32})
            return Followed(ticks, pipeline.incomplete_ticks, self._server_gone)

    def _stop_listening(self, rig: Rig, on_tick: int) -> None:
        self._world.remove_on_tick(on_tick)
        if not self._server_gone:
            rig.stop()

    def _pipeline(self, stack: ExitStack, rig: Rig) -> Tuple[int, LogWriters, Pipeline]:
        spec = self._spec
        bytes_per_tick = dict(rig.expected_bytes)
        bytes_per_tick[WORLD] = ACTOR_RECORD.size * EXPECTED_ACTORS
        segment_ticks = ticks_per_segment(SEGMENT_S * spec.fps, bytes_per_tick.values())
        failures: List[BaseException] = []
        writers = stack.enter_context(
            LogWriters(
                self._folder,
                expected_segments(bytes_per_tick, segment_ticks, spec.saved),
                segment_ticks,
                writer_threads(list(bytes_per_tick.values())),
                self._budget.give_back,
                lambda sealed: None,
                failures.append,
                durable=True,
                on_start=give_way,
            )
        )
        pipeline = Pipeline(
            {sensor.id: sensor_of(sensor.kind) for sensor in spec.sensors},
            writers,
            FrameMatcher(
                [sensor.id for sensor in spec.sensors],
                PATIENCE_S,
                gather=True,
                sparse=[s.id for s in spec.sensors if sensor_kind(s.kind).is_sparse],
            ),
            self._budget,
            None,
            segment_ticks,
            strict=False,
            failures=failures,
            pause_s=BATCH_S,
            on_start=give_way,
        )
        return segment_ticks, writers, stack.enter_context(pipeline)

    def _follow(
        self,
        pipeline: Pipeline,
        frames: FrameQueue,
        observer: WorldObserver,
        first: List[Tick],
        events: EventStream,
        stop: StopRequest,
    ) -> int:
        """Note frame by frame; return how many there are."""
        begun_after = self._first_data(pipeline, stop)
        if begun_after is None:
            return 0
        saved, ticks, name = SavedFrames(self._spec.saved), 0, os.path.basename(self._folder)
        last: Optional[Tick] = None
        weather: Optional[Mapping[str, float]] = None
        for seen in self._frames(frames, pipeline, stop, begun_after):
            stamp = seen.snapshot.timestamp
            step = Tick(stamp.frame, stamp.elapsed_seconds, seen.tick_s, seen.snapshot)
            try:
                if last is None:
                    observer.show_level(self._level())
                # Each question is a round trip, which a fast world does not leave the time for.
                if weather is None or not frames.lags:
                    weather = weather_values(self._world.get_weather(), WEATHER_PARAMETERS)
                    lights = observer.vehicle_lights()
                moment = observer.observe_past(seen.snapshot, weather, seen.states or {}, lights)
            except RuntimeError as error:
                if self._answers(error):
                    raise
                return ticks  # what is known of this frame is not enough
            if not first:
                first.append(step)
            for skipped in skipped_ticks(last, step):
                _expect(pipeline, ticks, skipped, None, None)
                ticks += 1
            k = saved.index(ticks)
            _expect(pipeline, ticks, step, k, moment)
            events.tick(
                name,
                False,
                tick=ticks,
                k=k,
                frame=step.frame,
                queued_bytes=pipeline.queued_bytes,
                waited_s=0.0,
            )
            ticks += 1
            last = step
        return ticks

    def _first_data(self, pipeline: Pipeline, stop: StopRequest) -> Optional[int]:
        """Wait until every sensor's stream is up; return the last frame before the recorded ones.

        None: the ego went before.
        The other program may not tick for long, so there is no deadline while its world is there.
        """
        while pipeline.wait_delivered(0, POLL_S):
            stop.check()
            pipeline.check()
            if not self._is_there():
                _log.info("the ego went before every sensor had measured")
                return None
        begun_after = pipeline.begin_with_all(self._server.timeout_s)
        if begun_after is None:
            raise RecordingError("The recorder is too busy to begin.", "Use fewer sensors.")
        return begun_after

    def _frames(
        self,
        frames: FrameQueue,
        pipeline: Pipeline,
        stop: StopRequest,
        begun_after: int,
    ) -> Iterator[_Seen]:
        """Frames with the ego; a request to end is obeyed after the frames that came before it."""
        silent_since_s = time.monotonic()
        while True:
            pipeline.check()
            seen = frames.take(0.0 if stop.requested else POLL_S)
            now_s = time.monotonic()
            if seen is None:
                if stop.requested:
                    return
                if now_s - silent_since_s > LOOK_S:
                    silent_since_s = now_s
                    pipeline.hold(True)  # a server that is gone sent a part of its last frame
                    if not self._is_there():
                        return
                    pipeline.hold(False)
                continue
            silent_since_s = now_s
            if seen.states is None:
                return
            if seen.snapshot.frame > begun_after:
                if not self._keeps_step(seen.snapshot):
                    return
                yield seen

    def _keeps_step(self, snapshot: Any) -> bool:
        """Whether a frame is as long as the world's step was when the ego was found.

        Programs let the world run freely again before they destroy their ego.
        """
        step_s = snapshot.timestamp.delta_seconds
        if abs(step_s - self._spec.step_s) <= STEP_TOLERANCE_S:
            return True
        _log.info("frame %d lasts %.6f s: the program has left its step", snapshot.frame, step_s)
        return False

    def _is_there(self) -> bool:
        """Whether the server has the ego still."""
        try:
            self._client.get_server_version()  # the rest is known without asking the server
            world = self._client.get_world()
            return world.id == self._world.id and not is_known_gone(world, self._ego)
        except RuntimeError as error:
            return self._answers(error)

    def _answers(self, error: RuntimeError) -> bool:
        """Whether the server answers, though a call to it failed; notes where it does not."""
        _log.info("the world does not answer: %s", error)
        self._server_gone = not answers(self._client, self._server.timeout_s)
        return not self._server_gone

    def _level(self) -> Sequence[Mapping[str, Any]]:
        return level_objects(self._world, self._spec.labels.level_objects)

    def _finish(self, pipeline: Pipeline, writers: LogWriters, ticks: int) -> int:
        """Wait until every tick is booked and every segment sealed; return how many ticks.

        A server that is gone may have sent a part of its last frames: those are left out.
        """
        if self._server_gone:
            ticks = pipeline.end_with_whole()
        else:
            pipeline.end(ticks)
        if not ticks:
            return 0
        while not pipeline.wait_booked(ticks, POLL_S):
            pass
        while not writers.wait_sealed(ticks - 1, POLL_S):
            pipeline.check()
        return ticks

    def _header(
        self,
        versions: Tuple[str, str],
        rig: Rig,
        segment_ticks: int,
        first: Tick,
        ticks: int,
        town: Any,
    ) -> Mapping[str, Any]:
        spec = replace(self._spec, steps=ticks)
        return {
            "format_version": FORMAT_VERSION,
            "episode_id": "",
            "attempt": "",
            "spec": spec.to_json(),
            "ticks_per_segment": segment_ticks,
            "ticks": ticks,
            "client_version": versions[0],
            "server_version": versions[1],
            "map": town.name,
            "geo_reference": geo_reference(town, gnss_convention(versions[1])),
            "ego_id": self._ego.id,
            "sensor_actor_ids": {name: actor.id for name, actor in rig.actors.items()},
            "sensor_carrier_ids": rig.carrier_ids,
            "sensor_attributes": {
                name: dict(actor.attributes) for name, actor in rig.actors.items()
            },
            "first_frame": first.frame,
            "first_timestamp_s": first.timestamp_s,
            # Nobody was asked for, and nobody spawned, by us.
            "requested": {"vehicles": 0, "pedestrians": 0},
            "spawned": {"vehicles": 0, "pedestrians": 0},
        }


def _expect(
    pipeline: Pipeline, number: int, step: Tick, k: Optional[int], moment: Optional[Any]
) -> None:
    seen = step.snapshot is not None
    pipeline.expect(
        ExpectedFrame(number, step.frame, step.timestamp_s, k, step.tick_s, moment, seen)
    )
