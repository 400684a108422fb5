"""All sensors of a world: one capture per tick, one cast per camera pose."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from threading import Lock

import numpy as np

from carstage_sim.cache import cache_folder
from carstage_sim.maps.town import Town
from carstage_sim.mesh import TriangleMesh
from carstage_sim.render.cast import NOTHING
from carstage_sim.render.caster import RayCaster
from carstage_sim.render.gpu.camera import GpuCameras
from carstage_sim.render.gpu.caster import GpuCaster
from carstage_sim.render.gpu.device import Gpu
from carstage_sim.render.picture import PictureMaker
from carstage_sim.render.quality import Quality
from carstage_sim.render.scene import Frame, SceneStore
from carstage_sim.sensors import (  # noqa: F401 - they register themselves
    cameras,
    cosmos,
    dvs,
    events,
    flash_lidar,
    flow,
    gbuffers,
    lidar,
    navigation,
    obstacle,
    occupancy,
    radar,
    rcs_radar,
    sweeping_lidar,
    v2x,
)
from carstage_sim.sensors.actors import ActorModels, drift_of
from carstage_sim.sensors.known_sensors import KnownSensors
from carstage_sim.sensors.looping import Looping
from carstage_sim.sensors.measurements import SensorFrame, SensorRequest
from carstage_sim.sensors.sensor import Sensor
from carstage_sim.sensors.side_by_side import Piece, SideBySide
from carstage_sim.sensors.view import Camera, View
from carstage_sim.world.pose import Vector3
from carstage_sim.world.state import Weather, WorldState

_RANKS_OF_A_TICK = 1 << 20
"""What a tick's sensors ask of the rays comes behind that of earlier ticks."""


@dataclass(frozen=True, slots=True)
class FramesUnderWay:
    """Frames of a tick that are being made.

    Attributes:
        done: when all are delivered, with the first error.
        views: what sensors ask.
    """

    done: Future[None]
    views: tuple[View, ...]


class WorldSensors:
    """Captures what the listening sensors see of a town.

    One thread at a time may call it, but for :meth:`prepare`. Sensors that remember earlier ticks
    (the LiDAR's angle, the IMU's track) are kept by sensor id and forgotten when the frame number
    goes back.

    Args:
        town: the map.
        threads: threads that cast rays; default: all CPUs of this process.
        meshes: replaces the actors' meshes, for tests.
        loop: how each sensor repeats itself; None: it measures for ever.
        cache: folder of stored meshes and acceleration structures; default: the user's cache.
        quality: of colour pictures.
        gpu: the card that casts rays and makes pictures; None leaves it to the CPU.
    """

    def __init__(
        self,
        town: Town,
        *,
        threads: int | None = None,
        loop: Looping | None = None,
        meshes: Callable[[str], TriangleMesh] | None = None,
        cache: Path | None = None,
        quality: Quality = Quality.LOW,
        gpu: Gpu | None = None,
    ) -> None:
        self._caster = RayCaster(threads)
        self._cameras: GpuCameras | None = None
        if gpu is not None:
            caster = GpuCaster(gpu, threads)
            self._caster, self._cameras = caster, GpuCameras(caster, quality)
        folder = cache if cache is not None else cache_folder()
        self._models = ActorModels(town, meshes, cache=folder / "meshes")
        self._store = SceneStore(
            town.static_mesh, self._models.mesh, cache=folder / "trees", beside=self._models.beside
        )
        self._pictures = PictureMaker(self._caster, quality)
        self._side_by_side = SideBySide(self._caster.threads)
        self._known = KnownSensors(town, loop)
        self._making = Lock()
        self._prepared: tuple[WorldState, Frame] | None = None
        self._ticks_begun = 0
        self.instant = InstantSensors(KnownSensors(town, loop), self._view)
        """Those that another thread may ask."""
        self.last_cast_count = 0
        """Ray casts of the last capture; sensors of one pose and one set of intrinsics share."""
        self.last_ray_count = 0
        """Rays of these casts, and of pixels on edges; rays to the sun and the sky do not count."""

    def __enter__(self) -> WorldSensors:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the threads."""
        self._side_by_side.close()
        self._caster.close()

    def warm_up(self, await_rays: Callable[[], None] = lambda: None) -> None:
        """Compile, or load, the kernels of all rigs: no capture waits for the compiler then.

        Those of exact voxels follow with the first such sensor; see :meth:`expect`.

        Args:
            await_rays: called when all but the rays' kernels are done, to wait for who compiles
                those.
        """
        self._pictures.warm_up(self._store)
        lidar.warm_up(self._caster.in_parts)
        frame = self._store.frame([])
        await_rays()
        self._pictures.warm_up_rays(self._store)
        view = View(lambda: frame, self._caster, self._pictures, Weather(), 0.0)
        ahead = np.array([[1.0, 0.0, 0.0]], np.float32)
        view.camera(Camera(2, 1, 90.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0))
        hits = view.rays((0.0, 0.0, 0.0), ahead, high=1.0, owner_id=0)
        cameras.encode_depth(hits.t, view.in_parts)
        cameras.encode_instances(view.tags(hits), view.instance_ids(hits), view.in_parts)
        if self._cameras is not None:
            light = self._pictures.sky.lighting(Weather(), 0.0)
            self._cameras.warm_up(self._store.frame([]), light)

    def expect(self, type_id: str) -> None:
        """Do now what the first picture of a blueprint, or by one, would have to wait for.

        Args:
            type_id: of what has a shape, or of a sensor with kernels of its own.
        """
        with self._making:
            self._store.prepare(self._models.keys_of(type_id))
            frame = self._store.frame([]) if type_id == occupancy.TYPE_ID else None
        if frame is not None:
            occupancy.warm_up(frame)

    def expect_look(self, weather: Weather, *, light: bool) -> None:
        """Do now what the first look at the town would have to wait for.

        Args:
            weather: in which it will be.
            light: whether it is about colours.
        """
        with self._making:
            self._store.prepare(self._models.keys_of_lights)
        if light:
            self._pictures.sky.exposure(weather)

    def reset(self) -> None:
        """Forget all sensors: a new episode counts actor ids and frames anew."""
        self._known.reset()
        self.instant.reset()

    def capture(
        self, state: WorldState, requests: Sequence[SensorRequest]
    ) -> list[tuple[int, SensorFrame]]:
        """Frames of the sensors that are due, in the order of ``requests``.

        A sensor of events has as many as happened, none or several.

        Raises:
            KeyError: a request's blueprint id is not a known sensor.
            SensorAttributeError: an attribute of a new sensor has an impossible value.
        """
        made: list[tuple[int, SensorFrame]] = []
        rays_before = self._caster.ray_count
        frames = self.begin(state, self.due(state, requests), lambda *one: made.append(one))
        frames.done.result()
        self.last_cast_count = sum(view.cast_count for view in frames.views)
        self.last_ray_count = self._caster.ray_count - rays_before
        place = {request.sensor_id: number for number, request in enumerate(requests)}
        return sorted(made, key=lambda one: place[one[0]])

    def due(
        self, state: WorldState, requests: Sequence[SensorRequest]
    ) -> list[tuple[SensorRequest, Sensor]]:
        """The sensors whose turn it is, in the order of ``requests``; the others see the tick.

        Raises:
            KeyError, SensorAttributeError: as :meth:`capture`.
        """
        return self._known.due(state, requests, self._side_by_side.wait_for)

    @contextmanager
    def giving_way(self, state: WorldState, give_way: Callable[[], None]) -> Iterator[None]:
        """In the block, frames of a tick are made here in small pieces, with others in between.

        A card makes each frame in one go.

        Args:
            state: the tick.
            give_way: called between the pieces; frames of other ticks may be made in it, in one go
                or in a block of their own.
        """

        def between() -> None:
            with self._caster.in_pieces(None):
                give_way()
            if state.town_changes is not None:
                self._store.show(state.town_changes)

        with self._caster.in_pieces(between if self._cameras is None else None):
            yield

    def begin(
        self,
        state: WorldState,
        due: Sequence[tuple[SensorRequest, Sensor]],
        deliver: Callable[[int, SensorFrame], None],
        begun: Callable[[], None] = lambda: None,
        *,
        here: bool = False,
    ) -> FramesUnderWay:
        """Begin the frames of sensors whose turn it is in a tick, from :meth:`due`.

        Returns when threads are at work on all of them; those of earlier ticks may be under way
        still, and come first. Frames of one sensor are delivered in their order.

        Args:
            state: the tick.
            due: the sensors.
            deliver: called with the id of a sensor and a frame, in the thread that made it.
            begun: called when threads are at work on the first of them.
            here: have the calling thread make them.
        """
        if not self._store.shows(state.town_changes):
            self._side_by_side.wait_for_all()  # what is under way shows the town as it was
        view = self._view(state)
        views = {frozenset[int](): view}
        unseen = [_unseen(request, sensor, view) for request, sensor in due]
        for (request, sensor), ignored in zip(due, unseen, strict=True):
            if ignored not in views:
                views[ignored] = self._view(state, view, ignored)
            if self._cameras is not None:
                sensor.announce(state, request, views[ignored])
        self._ticks_begun += 1
        earlier = self._ticks_begun * _RANKS_OF_A_TICK

        def make(rank: int, request: SensorRequest, sensor: Sensor) -> None:
            last = 0 if sensor.many_steps else len(due)
            with self._caster.ranked(earlier + last + rank):
                reported = sensor.report(state, request, views[unseen[rank]])
            for frame in reported:
                deliver(request.sensor_id, frame)

        pieces = [
            Piece(
                partial(make, rank, request, sensor),
                request.sensor_id,
                0 if self._cameras is not None else sensor.pixels,
                beside=sensor.beside_others and not here,
            )
            for rank, (request, sensor) in enumerate(due)
        ]
        for one in views.values():
            one.take_announced()
        return FramesUnderWay(self._side_by_side.begin(pieces, begun), tuple(views.values()))

    def miss(self, state: WorldState, requests: Sequence[SensorRequest]) -> None:
        """Let the sensors see a tick of which there are no frames."""
        self._known.miss(state, requests, self._side_by_side.wait_for)

    def prepare(self, state: WorldState) -> None:
        """Make the scene of a coming tick while another is drawn; any thread may call it.

        Nothing is done if the town looks otherwise in that tick: what is drawn would show it.
        """
        with self._making:
            if self._store.shows(state.town_changes):
                self._prepared = state, self._frame_of(state)

    def frame_of(self, state: WorldState) -> Frame:
        """The scene that rays of a tick meet."""
        with self._making:
            prepared, self._prepared = self._prepared, None
            if prepared is None or prepared[0] is not state:
                return self._frame_of(state)
            if state.town_changes is not None:
                self._store.show(state.town_changes)
            return prepared[1]

    def _frame_of(self, state: WorldState) -> Frame:
        return self._store.frame(self._models.placements(state), state.town_changes)

    def segment_hits(
        self, state: WorldState, start: Vector3, end: Vector3, at_most: int = 256
    ) -> list[tuple[Vector3, int]]:
        """Surfaces that a segment meets, nearest first: place in the world and semantic label.

        Args:
            state: the world to look at, actors included.
            start, end: world metres.
            at_most: how many surfaces to find.
        """
        view = self._view(state)
        origin = np.asarray(start, np.float64)
        along = np.asarray(end, np.float64) - origin
        length = float(np.linalg.norm(along))
        found: list[tuple[Vector3, int]] = []
        if length == 0.0:
            return found
        direction = (along / length).astype(np.float32).reshape(1, 3)
        passed = 0.0
        while len(found) < at_most:
            # From the last surface on: the distances of a long ray are too coarse for thin ones.
            here = origin + passed * along / length
            hits = view.rays(tuple(here.tolist()), direction, high=length - passed, owner_id=0)
            if int(hits.row[0]) == NOTHING:
                break
            x, y, z = (here + float(hits.t[0]) * along / length).tolist()
            found.append(((x, y, z), int(view.tags(hits)[0])))
            passed += float(hits.t[0])
        return found

    def _view(
        self,
        state: WorldState,
        whole: View | None = None,
        ignored: frozenset[int] = frozenset(),
    ) -> View:
        """The view of a tick, or of its ``whole`` without some actors."""

        def frame() -> Frame:
            return self.frame_of(state) if whole is None else whole.frame.without(ignored)

        return View(
            frame,
            self._caster,
            self._pictures,
            state.weather,
            state.timestamp_s,
            state.debug_shapes,
            self._cameras,
            partial(drift_of, state),
        )


def _unseen(request: SensorRequest, sensor: Sensor, view: View) -> frozenset[int]:
    """Actors that a sensor does not see: within its carrier's box, rays pass its wheels, too."""
    if not sensor.casts_rays:
        return request.ignored
    frame, owner = view.frame, request.owner_id
    within = view.skipped_row(owner, request.location)
    has_parts = within >= 0 and np.count_nonzero(frame.actor_id == owner) > 1
    return request.ignored | {owner} if has_parts else request.ignored


class InstantSensors:
    """Captures what needs no look at the world: motion, places, collisions.

    Args:
        known: the sensors.
        view: gives the view of a tick, of which nothing is asked.
    """

    def __init__(self, known: KnownSensors, view: Callable[[WorldState], View]) -> None:
        self._known = known
        self._view = view

    def frames(
        self, state: WorldState, requests: Sequence[SensorRequest]
    ) -> Iterator[tuple[int, SensorFrame]]:
        """Sensor ids and frames of those that are due, each as soon as it is made.

        Raises:
            KeyError, SensorAttributeError: as :meth:`WorldSensors.capture`.
        """
        view = self._view(state)
        for request, sensor in self._known.due(state, requests):
            for frame in sensor.report(state, request, view):
                yield request.sensor_id, frame

    def reset(self) -> None:
        """Forget all sensors."""
        self._known.reset()
