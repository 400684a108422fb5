"""The simulation: the current episode, its settings, and the sensors that look at it.

One thread owns the world. Pictures are drawn by another from what a frame was frozen to, so that
the world can go on meanwhile; nothing here knows sockets or bytes.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, wait
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from types import TracebackType
from typing import Protocol

from carstage_sim.maps import BackgroundBakes, Bake, MapCatalogue, Town
from carstage_sim.recording import RecorderController, RecordingsFolder
from carstage_sim.render.gpu.device import Choice, chosen_gpu
from carstage_sim.render.quality import Quality
from carstage_sim.sensors import SensorAttributeError, WorldSensors
from carstage_sim.sensors.actors import WHEELCHAIR
from carstage_sim.sensors.cameras import RgbCamera
from carstage_sim.sensors.gbuffers import GBUFFERS
from carstage_sim.sensors.gbuffers import SENT_AS as GBUFFER_MESSAGE
from carstage_sim.sensors.looping import Looping
from carstage_sim.sensors.measurements import SensorFrame, SensorRequest
from carstage_sim.sensors.occupancy import TYPE_ID as EXACT_VOXELS
from carstage_sim.sensors.projection import GeoProjection
from carstage_sim.sensors.sensor import Sensor, SensorRegistry
from carstage_sim.work_thread import Begun, WorkThread
from carstage_sim.world.actors import Actor
from carstage_sim.world.blueprints.walkers import uses_wheelchair
from carstage_sim.world.controls import EpisodeSettings
from carstage_sim.world.errors import SpawnError
from carstage_sim.world.kernel_warmup import warm_up_mechanics
from carstage_sim.world.pose import ZERO, Pose, Vector3
from carstage_sim.world.snapshot import Snapshot
from carstage_sim.world.state import ActorKind, Weather, WorldState
from carstage_sim.world.world import World

logger = logging.getLogger(__name__)

_SHORTEST_STEP_S = 0.001
_LONGEST_STEP_S = 0.1
_MOST_OWED_S = 1.0
"""Wall time that a late world makes up for by longer steps; what is beyond is lost."""
_STANDARD_GRAVITY = 9.81
_MOST_WAIT_S = 0.005
"""How long who measures leaves Python's lock to who begins to draw."""
_MOST_MISSED = 1024
"""Frames that sensors hear of later because pictures are drawn; older ones are forgotten."""


@dataclass(frozen=True, slots=True)
class CapturedFrame:
    """What one sensor saw: the actor, its pose in the world, and the data."""

    sensor: Actor
    pose: Pose
    frame: SensorFrame


@dataclass(frozen=True, slots=True)
class Scene:
    """A frame as sensors see it; nothing of it changes when the world goes on.

    Attributes:
        state: the frame.
        instant: the sensors that measure without a look at the world.
        looking: the others.
        watched: each one's actor and pose, by actor id.
        actors: what events may name, by actor id; those that were destroyed a while ago, too.
    """

    state: WorldState
    instant: Sequence[SensorRequest]
    looking: Sequence[SensorRequest]
    watched: Mapping[int, tuple[Actor, Pose]]
    actors: Mapping[int, Actor]


class LateTurn(Protocol):
    """The turn of data that may come after those of later frames."""

    @property
    def worth_making(self) -> bool:
        """Whether anybody may still take them."""

    def urgency(self) -> int:
        """Data of sensors with more come first; those of sensors with none wait for a tick."""

    def end(self) -> None:
        """They are published, or left out."""


class Simulation:
    """Runs one episode after another.

    One thread calls it. It alone touches the world, and while no picture is drawn the renderer,
    too; pictures of a :class:`Scene` are drawn by a thread of the simulation.

    Args:
        town_name: the map to begin with.
        maps: the maps that clients may load; by default the built-in ones.
        threads: threads of the numeric kernels, None for all cores.
        loop: how each sensor repeats itself; None: it measures for ever.
        projection: of GNSS sensors, which differs between CARLA's versions.
        quality: of colour pictures.
        device: what casts rays and makes pictures.
        recordings: the folder of the recorder's logs.
        wet_grip: whether water on the road takes grip of the tyres.

    Attributes:
        world: the current episode.
        settings: episode settings; they outlive an episode unless it is loaded with a reset.
        maps: the maps that clients may load.
        bakes: makes those that are not in the cache while the world runs on.
        imu_gravity: m/s^2, what clients set for IMU sensors of this episode.
        recordings: the recorder and the replayer.

    Raises:
        UnknownTownError: there is no map of that name.
        NoGpuError: a card was asked for, and there is none.
    """

    def __init__(
        self,
        town_name: str,
        *,
        maps: MapCatalogue | None = None,
        threads: int | None = None,
        loop: Looping | None = None,
        projection: GeoProjection = GeoProjection.TRANSVERSE_MERCATOR,
        quality: Quality = Quality.LOW,
        device: Choice = "cpu",
        recordings: RecordingsFolder | None = None,
        wet_grip: bool = True,
    ) -> None:
        self._gpu = chosen_gpu(device)
        # Threads that draw two frames at once wait for Python's lock longer than they gain: on 16
        # cores a tick of the demonstration took 8 % longer. A card has its own queue.
        self._begins_early = self._gpu is not None
        self.settings = EpisodeSettings()
        self.imu_gravity = _STANDARD_GRAVITY
        self.recordings = RecorderController(recordings)
        self.maps = maps or MapCatalogue()
        self.bakes = BackgroundBakes(self.maps.cache_folder, self.maps.bake_limits)
        self._threads = threads
        self._loop = loop
        self._projection = projection
        self._quality = quality
        self._wet_grip = wet_grip
        self._watched_before = False
        self._ahead: Snapshot | None = None
        self._changed_since = False
        self._drawing = WorkThread("drawing")
        self._measuring = WorkThread("measuring")
        self._missed: deque[Scene] = deque(maxlen=_MOST_MISSED)
        self._stepped_at_s = time.monotonic()
        self._source = self.maps.source(town_name)
        self._town = self.maps.load(town_name)
        # Side by side: the world's kernels are loaded while the renderer takes in the town.
        making = self._drawing.submit(self._new_sensors, self._town)
        with ExitStack() as unless_both:
            unless_both.callback(lambda: making.result().close())
            self.world = self._new_world(self._town, 1, None)
            unless_both.pop_all()
        self._sensors = making.result()

    def __enter__(self) -> Simulation:
        return self

    def __exit__(
        self,
        _type: type[BaseException] | None,
        _value: BaseException | None,
        _traceback: TracebackType | None,
    ) -> None:
        with ExitStack() as resources:
            resources.callback(lambda: self._sensors.close())
            resources.callback(self._measuring.close)
            resources.callback(self._drawing.close)
            resources.callback(self.recordings.end_episode)
            resources.callback(self.bakes.close)

    def warm_up(self, await_rays: Callable[[], None] = lambda: None) -> None:
        """Compile and run every kernel once, so that no client waits for a compiler.

        Args:
            await_rays: as for ``WorldSensors.warm_up``.
        """
        drawing = self._drawing.submit(lambda: self._sensors.warm_up(await_rays))
        warm_up_mechanics(self.world)
        drawing.result()

    def prepare(self, town_name: str) -> Bake:
        """Begin to bake a map, unless it can be loaded at once; the world may run on meanwhile.

        Raises:
            UnknownTownError: there is no map of that name.
            MapFileError: its file cannot be read.
            MapSamplingError: nothing can be made of it.
        """
        source = self.maps.source(town_name)
        return Bake(source, finished=True) if source == self._source else self.bakes.begin(source)

    def load(self, town_name: str, *, reset_settings: bool) -> None:
        """Replace the episode by a new one on a map, which may be the same.

        All that may fail comes before the first change: a map that is refused changes nothing.

        Raises:
            UnknownTownError: there is no map of that name.
            MapFileError: its file cannot be read.
            MapSamplingError: nothing can be made of it.
        """
        self._drawing.finish()
        self._measuring.finish()
        source = self.maps.source(town_name)
        number = self.world.episode_id + 1
        if source == self._source and town_name == self._town.name:
            world = self._new_world(self._town, number, self.world)
            self.recordings.end_episode()
            self._sensors.reset()
        else:
            town = self.maps.load(town_name)
            with ExitStack() as resources:
                sensors = self._new_sensors(town)
                resources.callback(sensors.close)
                sensors.warm_up()
                world = self._new_world(town, number, self.world)
                resources.pop_all()
            self.recordings.end_episode()
            self._sensors.close()
            self._town, self._source, self._sensors = town, source, sensors
        self.world = world
        self.imu_gravity = _STANDARD_GRAVITY
        self._ahead = None
        self._missed.clear()
        if reset_settings:
            self.settings = EpisodeSettings()
        logger.info("episode %d on %s", self.world.episode_id, self._town.name)

    def _new_sensors(self, town: Town) -> WorldSensors:
        return WorldSensors(
            town, threads=self._threads, loop=self._loop, quality=self._quality, gpu=self._gpu
        )

    def _new_world(self, town: Town, episode_id: int, before: World | None) -> World:
        return World(
            town,
            episode_id,
            previous=before,
            before_spawn=self._before_spawn,
            wet_grip=self._wet_grip,
        )

    def apply_settings(self, settings: EpisodeSettings) -> None:
        """Use other settings from the next tick on."""
        self.settings = settings
        self._stepped_at_s = time.monotonic()

    def tick(self) -> Snapshot:
        """One step: of the fixed duration, or of the wall time since the last step.

        After :meth:`step_ahead` it tells of that step.
        """
        ahead, self._ahead = self._ahead, None
        if ahead is None:
            return self._step()
        return self.world.freeze(ahead.state.delta_s) if self._changed_since else ahead

    def step_ahead(self) -> None:
        """Make the next tick's step now, and what its pictures need, while others are drawn."""
        if self._ahead is None:
            self._ahead, self._changed_since = self._step(), False
            try:
                self._sensors.prepare(self._ahead.state)
            except Exception:  # what draws it tries again
                logger.exception("frame %d cannot be prepared", self._ahead.state.frame)

    def may_have_changed(self) -> None:
        """Calls were served: what they changed since a step ahead is in the frame of its tick."""
        self._changed_since = True

    def _step(self) -> Snapshot:
        now_s = time.monotonic()
        delta_s = self.settings.fixed_delta_seconds
        if not delta_s:
            elapsed_s = now_s - self._stepped_at_s
            delta_s = min(max(elapsed_s, _SHORTEST_STEP_S), _LONGEST_STEP_S)
        owed_s = now_s - self._stepped_at_s - delta_s
        self._stepped_at_s = now_s - min(max(owed_s, 0.0), _MOST_OWED_S)
        self.recordings.before_tick(delta_s)
        physics = self.settings.physics(delta_s)
        snapshot = self.world.tick(delta_s, physics.substeps, moving_s=physics.duration_s)
        self.recordings.after_tick(snapshot)
        return snapshot

    def first_frame(self) -> Snapshot:
        """The frame that an episode begins with."""
        return self.world.freeze(self.settings.fixed_delta_seconds or 0.0)

    def segment_hits(
        self, start: Vector3, end: Vector3, at_most: int = 256
    ) -> Future[list[tuple[Vector3, int]]]:
        """Surfaces of town and actors that a segment meets now, nearest first, with their label.

        They are there at once unless pictures are drawn, which come first.
        """
        state = self.world.freeze(0.0).state
        return self._drawing.at_once_or_later(
            self._sensors.segment_hits, state, start, end, at_most
        )

    def scene(self, snapshot: Snapshot, is_watched: Callable[[int], bool]) -> Scene | None:
        """A frame for the sensors that somebody listens to, None if nobody does.

        Args:
            snapshot: the frame to look at.
            is_watched: tells by stream number whether anybody listens.
        """
        without_cameras = self.settings.no_rendering_mode
        instant: list[SensorRequest] = []
        looking: list[SensorRequest] = []
        watched: dict[int, tuple[Actor, Pose]] = {}
        for carrier in self.world.actors.of_kind(ActorKind.SENSOR):
            if without_cameras and carrier.type_id.startswith("sensor.camera."):
                continue
            for sensor, measured_as in (carrier, carrier.type_id), *_gbuffers(carrier):
                if not is_watched(sensor.stream_id):
                    continue
                pose = self.world.actors.pose(carrier.actor_id)
                watched[sensor.actor_id] = (sensor, pose)
                request = _request(sensor, measured_as, pose, self.imu_gravity, self._projection)
                (looking if SensorRegistry.looks(measured_as) else instant).append(request)
        if not watched and not self._watched_before:
            return None
        self._watched_before = bool(watched)  # one capture of nothing lets the sensors forget
        actors = self.world.known_actors() if watched else {}
        return Scene(snapshot.state, instant, looking, watched, actors)

    def capture(
        self,
        scene: Scene,
        publish: Callable[[CapturedFrame], None],
        late_turn: Callable[[Actor], LateTurn | None] | None,
    ) -> Begun | None:
        """Begin to draw what sensors see, and to measure what needs no look at the world.

        Args:
            scene: the frame.
            publish: called with the data of one sensor after the other, in the threads that draw
                and that measure; or here, if they have nothing to do and nothing is drawn.
            late_turn: gives, by sensor, a turn to data that may come after those of later
                frames, None to others. Without it the pictures of the whole frame are left out if
                others are still drawn.

        Returns:
            What is handed out when the next frame may begin, with a card as soon as that has all
            pictures of this one to make; done when all is published that is not late. None where
            nothing is drawn.
        """
        if self._drawing.busy and (late_turn is None or not scene.looking):
            self._measure(scene, publish, None)
            self._missed.append(scene)
            return None
        begun = threading.Event()
        measured = self._measure(scene, publish, begun if scene.looking else None)
        draw = self._drawer(scene, publish, late_turn, begun)

        def failed(drawing: Future[None]) -> None:
            if (error := drawing.exception()) is not None:
                logger.error("sensors of frame %d failed", scene.state.frame, exc_info=error)

        def drawn() -> Future[None]:
            try:
                drawing = draw()
            except Exception:
                logger.exception("sensors of frame %d failed", scene.state.frame)
                return measured
            drawing.add_done_callback(failed)
            wait([measured] if self._begins_early else [measured, drawing])
            return drawing

        if scene.looking:
            return self._drawing.begin(drawn)
        wait([drawn()])
        return None

    def _measure(
        self,
        scene: Scene,
        publish: Callable[[CapturedFrame], None],
        begun: threading.Event | None,
    ) -> Future[None]:
        """Publish the data of the sensors that need no look at the world and whose turn it is.

        Args:
            scene: the frame.
            publish: called with them.
            begun: set when what is drawn is with its threads; None if nothing is.
        """
        sensors = self._sensors.instant

        def measured() -> None:
            if begun is not None:
                # What is done here would take Python's lock from who hands pictures to threads.
                begun.wait(_MOST_WAIT_S)
            try:
                for sensor_id, frame in sensors.frames(scene.state, scene.instant):
                    publish(CapturedFrame(*scene.watched[sensor_id], frame))
            except Exception:
                logger.exception("sensors of frame %d failed", scene.state.frame)

        if begun is None:
            return self._measuring.at_once_or_later(measured)
        return self._measuring.submit(measured)

    def _drawer(
        self,
        scene: Scene,
        publish: Callable[[CapturedFrame], None],
        late_turn: Callable[[Actor], LateTurn | None] | None,
        begun: threading.Event,
    ) -> Callable[[], Future[None]]:
        """What begins to draw a frame, and sets an event when threads have the first pictures."""
        missed = tuple(self._missed)
        self._missed.clear()
        sensors = self._sensors
        waiting = {} if late_turn is None else _late_turns(scene, late_turn)

        def deliver(sensor_id: int, frame: SensorFrame) -> None:
            publish(CapturedFrame(*scene.watched[sensor_id], frame))

        def draw_late(one: tuple[SensorRequest, Sensor], turn: LateTurn) -> None:
            try:
                if turn.worth_making:
                    with sensors.giving_way(scene.state, self._drawing.give_way):
                        sensors.begin(scene.state, [one], deliver, here=True).done.result()
            finally:
                turn.end()

        def draw() -> Future[None]:
            prompt = []
            try:
                for one in missed:
                    sensors.miss(one.state, one.looking)
                for due in sensors.due(scene.state, scene.looking):
                    turn = waiting.pop(due[0].sensor_id, None)
                    if turn is None:
                        prompt.append(due)
                    else:
                        late = partial(draw_late, due, turn)
                        self._drawing.put_off(late, due[0].sensor_id, turn.urgency, turn.end)
                return sensors.begin(scene.state, prompt, deliver, begun.set).done
            finally:
                begun.set()
                for turn in waiting.values():
                    turn.end()

        return draw

    def hold_late_drawing(self, *, held: bool) -> None:
        """Whether no more late data are begun to be drawn for now; see :meth:`capture`."""
        self._drawing.hold(held=held)

    def finish_drawing(self) -> None:
        """Wait until what :meth:`capture` began is published; data that are late are left out."""
        self._drawing.finish_without_what_is_put_off()
        self._measuring.finish()

    def _before_spawn(self, type_id: str, attributes: Mapping[str, str]) -> None:
        """Refuse a sensor that could not be captured, before it is in the world.

        What can be seen gets its shape here, and exact voxels get their kernels: clients wait
        longer for a spawn than for a picture. What sensors see of any town is made meanwhile.

        Raises:
            SpawnError: an attribute has an impossible value.
        """
        if not type_id.startswith("sensor."):
            sits = WHEELCHAIR if uses_wheelchair(attributes) else ""
            self._drawing.at_once_or_later(self._expect, type_id + sits)
            return
        request = SensorRequest(0, type_id, attributes, ZERO, ZERO, 0)
        try:
            sensor = SensorRegistry.make(request, self._town)
        except SensorAttributeError as error:
            raise SpawnError(f"{type_id}: {error}") from error
        if type_id == EXACT_VOXELS:
            self._drawing.at_once_or_later(self._expect, type_id)
        if SensorRegistry.looks(type_id):
            # Not by who draws: while that is busy, asynchronous frames are left out.
            light = isinstance(sensor, RgbCamera)
            self._measuring.submit(self._expect_look, self.world.weather, light=light)

    def _expect(self, type_id: str) -> None:
        try:
            self._sensors.expect(type_id)
        except Exception:
            logger.exception("%s cannot be prepared", type_id)

    def _expect_look(self, weather: Weather, *, light: bool) -> None:
        try:
            self._sensors.expect_look(weather, light=light)
        except Exception:
            logger.exception("what sensors see of the town cannot be prepared")


def _late_turns(scene: Scene, turn_of: Callable[[Actor], LateTurn | None]) -> dict[int, LateTurn]:
    """The turns, by sensor id, of the sensors whose data of a frame may be late."""
    turns: dict[int, LateTurn] = {}
    for request in scene.looking:
        if SensorRegistry.may_be_late(request.type_id):
            turn = turn_of(scene.watched[request.sensor_id][0])
            if turn is not None:
                turns[request.sensor_id] = turn
    return turns


def _gbuffers(camera: Actor) -> Iterator[tuple[Actor, str]]:
    """Sensors for a camera's buffers that clients asked for, with what measures each.

    Their ids are below those of actors, which begin with 1.
    """
    for buffer, stream_id in camera.gbuffers.items():
        sensor = replace(camera, actor_id=-stream_id, type_id=GBUFFER_MESSAGE, stream_id=stream_id)
        yield sensor, GBUFFERS[buffer]


def _request(
    sensor: Actor, measured_as: str, pose: Pose, gravity: float, projection: GeoProjection
) -> SensorRequest:
    return SensorRequest(
        sensor_id=sensor.actor_id,
        type_id=measured_as,
        attributes=sensor.attributes,
        location=pose.location,
        rotation_deg=pose.rotation_deg,
        owner_id=sensor.parent_id,
        ignored=sensor.ignored,
        gravity=gravity,
        projection=projection,
    )
