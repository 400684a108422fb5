"""One episode from a loaded map to sealed segments."""

from __future__ import annotations

import time
from contextlib import ExitStack
from typing import Any, Dict, Iterator, List, Mapping, NamedTuple, Optional, Tuple

from carstage.collector.drivers.base import Driver
from carstage.collector.drivers.driving import AtPage, make_driver
from carstage.collector.internals.errors import InterruptedByRequestError
from carstage.collector.internals.events import EventStream
from carstage.collector.internals.level_objects import level_objects
from carstage.collector.internals.matching import ExpectedFrame, FrameMatcher
from carstage.collector.internals.plan import EpisodePlan, Plan
from carstage.collector.internals.resting import resting_sensors
from carstage.collector.internals.scene import Scene, build_scene
from carstage.collector.internals.snapshots import WorldMoment, WorldObserver
from carstage.collector.internals.stopping import StopRequest
from carstage.collector.internals.warmup import warm_up
from carstage.collector.internals.writing import (
    LARGE_BYTES,
    LogWriters,
    expected_segments,
    writer_threads,
)
from carstage.collector.maps import geo_reference
from carstage.collector.patches import patch_entries
from carstage.collector.paths import prepare_folder
from carstage.collector.processing import POLL_S, ByteBudget, Pipeline
from carstage.collector.sensors import sensor_of
from carstage.collector.sensors.rig import Rig
from carstage.collector.timing import (
    Tick,
    patience_s,
    skipped_ticks,
    ticks_per_segment,
)
from carstage.collector.world import WorldSession
from carstage.rawlog.format import ACTOR_RECORD, FORMAT_VERSION, WORLD, SealedSegment
from carstage.rawlog.writing import BLOCKS, CHUNKLOG, write_episode_file, write_map_file
from carstage.releases import gnss_convention
from carstage.sensor_kinds import sensor_kind
from carstage.spec import EpisodeSpec
from carstage.spec.timing import SavedFrames

EXPECTED_ACTORS = 200


class Versions(NamedTuple):
    """CARLA versions of both ends of the connection."""

    client: str
    server: str


class Recorded(NamedTuple):
    """A recorded episode; ``incomplete`` counts ticks with a sensor that is neither ok nor off."""

    ticks: int
    incomplete: int


class EpisodeRecorder:
    """Records episodes over one connection.

    Args:
        client: ``carla.Client``, connected.
        versions: of both ends.
        plan: the whole plan.
        events: gets what happens.
        stop: asked between ticks.
    """

    def __init__(
        self, client: Any, versions: Versions, plan: Plan, events: EventStream, stop: StopRequest
    ) -> None:
        self._client = client
        self._versions = versions
        self._plan = plan
        self._events = events
        self._stop = stop

    def record(self, episode: EpisodePlan) -> Recorded:
        """Record one episode; whatever happens, the server gets everything back.

        Raises:
            CollectorError: what went wrong; the attempt's log stays as far as it came.
            RuntimeError: the server stopped answering.
        """
        self._stop.check()
        drivers = self._drivers(episode.spec)  # before the server does anything
        folder = prepare_folder(episode.folder)
        self._events.emit(
            "episode_started",
            episode_id=episode.episode_id,
            attempt=episode.attempt,
            ticks=episode.spec.steps,
        )
        server, spec = self._plan.server, episode.spec
        resting = resting_sensors(spec, server.exact_sensor_tick, self._plan.sensor_warmup_ticks)
        with ExitStack() as stack:
            session = stack.enter_context(
                WorldSession(self._client, episode.spec, server.timeout_s, server.load_timeout_s)
            )
            scene = build_scene(
                self._client,
                session,
                spec=episode.spec,
                server=server,
                check=self._stop.check,
                drivers=drivers,
                program=self._plan.program,
                resting=resting,
            )
            self._events.emit(
                "actors_spawned",
                episode_id=episode.episode_id,
                requested=scene.requested,
                spawned=scene.spawned,
            )
            return self._record_scene(stack, session, scene, episode, folder)

    def _drivers(self, spec: EpisodeSpec) -> Dict[str, Driver]:
        """Who drives, by the agent's name, "" the ego's; not the Traffic Manager."""
        planned = {"": spec.ego.driver, **{agent.name: agent.ego.driver for agent in spec.agents}}
        return {
            name: make_driver(
                driver,
                self._plan.driver_folders,
                spec.step_s,
                AtPage(self._plan.inputs_file, self._stop.pause),
            )
            for name, driver in planned.items()
            if driver is not None
        }

    def _record_scene(
        self,
        stack: ExitStack,
        session: WorldSession,
        scene: Scene,
        episode: EpisodePlan,
        folder: str,
    ) -> Recorded:
        spec = episode.spec
        of_sensors = scene.expected_bytes
        bytes_per_tick = dict(of_sensors)
        bytes_per_tick[WORLD] = ACTOR_RECORD.size * EXPECTED_ACTORS
        segment_ticks = ticks_per_segment(spec.fps, bytes_per_tick.values())
        budget = ByteBudget(self._plan.queue_bytes, sum(of_sensors.values()))
        failures: List[BaseException] = []
        patience = patience_s(spec.timing, self._plan.server.timeout_s)
        writers = stack.enter_context(
            LogWriters(
                folder,
                expected_segments(bytes_per_tick, segment_ticks, spec.saved),
                segment_ticks,
                writer_threads(list(bytes_per_tick.values())),
                budget.give_back,
                lambda sealed: self._announce(episode, sealed),
                failures.append,
                self._stores(spec, of_sensors),
                self._plan.durable,
            )
        )
        pipeline = stack.enter_context(
            Pipeline(
                {stream: sensor_of(sensor.kind) for stream, sensor in spec.streams.items()},
                writers,
                FrameMatcher(
                    list(spec.streams),
                    patience,
                    not spec.timing.demands_all,
                    not spec.timing.sensor_sync,
                    sparse=_sparse(spec),
                    resting=scene.resting.streams,
                ),
                budget,
                spec.steps,
                segment_ticks,
                strict=spec.timing.demands_all,
                failures=failures,
                on_expected=lambda expected: self._tell_tick(episode, expected, pipeline),
            )
        )
        stack.callback(scene.stop_listening)
        # Before the server's clock counts: texts of large towns have many megabytes.
        map_crc32 = write_map_file(folder, session.map.to_opendrive())
        listening_ticks = self._plan.sensor_warmup_ticks
        warm_up(scene, pipeline, episode, listening_ticks, self._events, self._stop, patience)
        observer = _observer(session, scene, spec)
        saved = SavedFrames(spec.saved)
        for tick, step in self._ticks(scene, pipeline, spec.steps):
            if tick == 0:
                header = self._header(episode, session, scene, segment_ticks, step)
                write_episode_file(folder, {**header, "map_crc32": map_crc32})
            seen = step.snapshot is not None
            k = saved.index(tick) if seen else None
            moment: Optional[WorldMoment] = None
            if seen:
                moment = _moment(observer, step, session, scene)
            pipeline.expect(
                ExpectedFrame(tick, step.frame, step.timestamp_s, k, step.tick_s, moment, seen)
            )
        self._finish(pipeline, writers, spec)
        return Recorded(spec.steps, pipeline.incomplete_ticks)

    def _stores(self, spec: EpisodeSpec, bytes_per_tick: Mapping[str, int]) -> Dict[str, str]:
        """Where payloads go that are not in their records; by stream."""
        stores = {}
        for stream, sensor in spec.streams.items():
            if sensor_of(sensor.kind).one_size and self._plan.raw_store != CHUNKLOG:
                stores[stream] = self._plan.raw_store
            elif not self._plan.durable and bytes_per_tick[stream] >= LARGE_BYTES:
                stores[stream] = BLOCKS  # segments are removed as they are read
        return stores

    def _ticks(self, scene: Scene, pipeline: Pipeline, steps: int) -> Iterator[Tuple[int, Tick]]:
        """The ticks to record; a request to end is obeyed after the frame at hand is booked.

        A server that runs on its own may have gone on by more than one frame: those in between
        are ticks, too, of which nothing is known.
        """
        tick = 0
        last: Optional[Tick] = None
        while tick < steps:
            try:
                self._stop.check()
                pipeline.wait_for_room(self._stop)
            except InterruptedByRequestError:
                deadline_s = time.monotonic() + 2.0 * self._plan.server.timeout_s
                while not pipeline.wait_booked(tick, POLL_S) and time.monotonic() < deadline_s:
                    pass
                raise
            step = scene.step(tick)
            for skipped in skipped_ticks(last, step):
                yield tick, skipped
                tick += 1
                if tick == steps:
                    return
            yield tick, step
            tick += 1
            last = step

    def _finish(self, pipeline: Pipeline, writers: LogWriters, spec: EpisodeSpec) -> None:
        """Wait until every tick is booked and every segment sealed."""
        while not pipeline.wait_booked(spec.steps, POLL_S):
            self._stop.check()
        while not writers.wait_sealed(spec.steps - 1, POLL_S):
            pipeline.check()

    def _tell_tick(self, episode: EpisodePlan, made: ExpectedFrame, pipeline: Pipeline) -> None:
        """Print a tick; not from the thread that ticks, as whoever reads is woken by that."""
        self._events.tick(
            episode.episode_id,
            made.tick == episode.spec.steps - 1,
            tick=made.tick,
            k=made.k,
            frame=made.frame,
            queued_bytes=pipeline.queued_bytes,
            waited_s=pipeline.waited_s,
        )

    def _announce(self, episode: EpisodePlan, sealed: SealedSegment) -> None:
        self._events.emit("segment_sealed", episode_id=episode.episode_id, **sealed._asdict())

    def _header(
        self,
        episode: EpisodePlan,
        session: WorldSession,
        scene: Scene,
        segment_ticks: int,
        first: Tick,
    ) -> Mapping[str, Any]:
        return {
            "format_version": FORMAT_VERSION,
            "episode_id": episode.episode_id,
            "attempt": episode.attempt,
            "spec": episode.spec.to_json(),
            "ticks_per_segment": segment_ticks,
            "ticks": episode.spec.steps,
            "client_version": self._versions.client,
            "server_version": self._versions.server,
            "map": session.map.name,
            "geo_reference": geo_reference(
                session.map,
                self._plan.server.gnss or gnss_convention(self._versions.server),
            ),
            **_rig_entries(scene.ego, scene.rig),
            **patch_entries(scene.patches),
            **(
                {"agents": {one.name: _rig_entries(one.actor, one.rig) for one in scene.agents}}
                if scene.agents
                else {}
            ),
            "first_frame": first.frame,
            "first_timestamp_s": first.timestamp_s,
            "requested": scene.requested,
            "spawned": scene.spawned,
        }


def _sparse(spec: EpisodeSpec) -> List[str]:
    """The streams that may have nothing in a tick."""
    return [name for name, sensor in spec.streams.items() if sensor_kind(sensor.kind).is_sparse]


def _observer(session: WorldSession, scene: Scene, spec: EpisodeSpec) -> WorldObserver:
    """What reads the world after each tick."""
    return WorldObserver(
        session.world,
        scene.ego,
        level_objects(session.world, spec.labels.level_objects),
        {agent.name: agent.actor for agent in scene.agents if agent.is_vehicle},
    )


def _moment(
    observer: WorldObserver, step: Tick, session: WorldSession, scene: Scene
) -> WorldMoment:
    """The truth of a tick."""
    return observer.observe(
        step.snapshot,
        session.weather.values,
        scene.event_states(),
        scene.command(),
        {agent.name: agent.noted for agent in scene.agents},
    )


def _rig_entries(actor: Any, rig: Rig) -> Dict[str, Any]:
    """What the header says of the ego, or of an agent, and of its sensors."""
    return {
        "ego_id": actor.id,
        "sensor_actor_ids": {name: sensor.id for name, sensor in rig.actors.items()},
        "sensor_carrier_ids": rig.carrier_ids,
        "sensor_attributes": {name: dict(one.attributes) for name, one in rig.actors.items()},
    }
