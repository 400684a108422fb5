"""Where trials play: one synchronous world, cameras that look once, and cleaning up."""

from __future__ import annotations

import math
from queue import Empty, Queue
from typing import TYPE_CHECKING, Any

import carla

from carstage.collector.internals.dialect import is_listening
from client_api.picture import Picture
from client_api.surface import has

if TYPE_CHECKING:
    from collections.abc import Callable

    from benchmarks.simulator.session import Session

CAR_LABEL = (
    carla.CityObjectLabel.Car if has("CityObjectLabel.Car") else carla.CityObjectLabel.Vehicles
)
"""What cars are labelled as: CARLA 0.9.13 told no kinds of vehicles apart."""

_ANSWER_S = 20.0
_NEAR_M = 7.0


def expect(condition: bool, text: str) -> None:
    """Raise with ``text`` unless the condition holds: an ``assert`` that ``python -O`` keeps."""
    if not condition:
        raise AssertionError(text)


class TrialScene:
    """What a trial may use.

    Args:
        session: synchronous mode, a Traffic Manager, seeded choices.
        port: the server's.

    Attributes:
        client, world, traffic_manager: of the session.
        map: the town's.
        library: its blueprints.
    """

    def __init__(self, session: Session, port: int) -> None:
        self.session = session
        self._port = port
        self.client: carla.Client = session.client
        self.world: carla.World = session.world
        self.traffic_manager: carla.TrafficManager = session.traffic_manager
        self.map: carla.Map = session.world.get_map()
        self.library: carla.BlueprintLibrary = session.world.get_blueprint_library()
        self._spawned: list[Any] = []
        self._next_place = 0

    # Time ----------------------------------------------------------------------------------------

    def ticks(self, count: int = 1) -> int:
        """Tick; the last frame's number."""
        frame = 0
        for _ in range(count):
            frame = self.session.clock.tick()
        return frame

    def apply_settings(self, settings: carla.WorldSettings) -> None:
        """Use other settings of the world, which some clients tick once for."""
        self.session.clock.apply_settings(settings)

    def until(self, happened: Callable[[], bool], what: str, at_most: int = 200) -> None:
        """Tick until something has happened.

        Raises:
            AssertionError: it has not after ``at_most`` ticks.
        """
        for _ in range(at_most):
            if happened():
                return
            self.ticks()
        raise AssertionError(f"not within {at_most} ticks: {what}")

    def seen_anew(self) -> carla.World:
        """The world as a client sees it that comes now."""
        client = carla.Client("127.0.0.1", self._port)
        client.set_timeout(_ANSWER_S)
        return client.get_world()

    # Actors --------------------------------------------------------------------------------------

    def place(self) -> carla.Transform:
        """A spawn point that no trial before has used, as long as there are such."""
        points = self.map.get_spawn_points()
        self._next_place += 1
        return points[(self._next_place * 7) % len(points)]

    def spawn(
        self,
        type_id: str,
        transform: carla.Transform | None = None,
        parent: Any = None,
        **attributes: str,
    ) -> Any:
        """An actor that :meth:`sweep` destroys after the trial; it is in the newest frame."""
        blueprint = self.library.find(type_id)
        for name, value in attributes.items():
            blueprint.set_attribute(name, value)
        where = transform or self.place()
        if parent is None:
            actor = self.world.spawn_actor(blueprint, where)
        else:
            actor = self.world.spawn_actor(blueprint, where, parent)
        self.keep(actor)
        self.ticks()
        return actor

    def car(self, type_id: str = "vehicle.tesla.model3", **attributes: str) -> Any:
        """A car at a free spawn point, standing on the road."""
        car = self.spawn(type_id, None, None, **attributes)
        self.ticks(5)
        return car

    def keep(self, actor: Any) -> None:
        """Let :meth:`sweep` destroy an actor after the trial."""
        self._spawned.append(actor)

    def sweep(self) -> None:
        """Destroy what the trial spawned, the latest first."""
        spawned, self._spawned = self._spawned, []
        for actor in reversed(spawned):
            if not actor.is_alive:
                continue
            if isinstance(actor, carla.Sensor) and is_listening(actor):
                actor.stop()
            actor.destroy()
        if spawned:
            self.ticks()

    # Sensors -------------------------------------------------------------------------------------

    def measure(self, sensor: Any, make: Callable[[], None] | None = None, tries: int = 40) -> Any:
        """The first measurement of a sensor from the next ticks on; the sensor stops then.

        Args:
            sensor: not listening.
            make: done before each tick.
            tries: ticks to wait for it.
        """
        inbox: Queue[Any] = Queue(maxsize=1000)
        sensor.listen(inbox.put)
        try:
            for attempt in range(tries):
                if make is not None:
                    make()
                self.ticks()
                try:
                    return inbox.get(timeout=_ANSWER_S if attempt == tries - 1 else 0.25)
                except Empty:
                    continue
            raise AssertionError(f"{sensor.type_id} sent nothing in {tries} ticks")
        finally:
            if is_listening(sensor):
                sensor.stop()

    def picture(
        self,
        where: carla.Transform,
        kind: str = "rgb",
        size: tuple[int, int] = (120, 90),
        fov: float = 70.0,
    ) -> Picture:
        """The picture of a camera that is placed for one look; ``size`` is (W, H)."""
        blueprint = self.library.find(f"sensor.camera.{kind}")
        blueprint.set_attribute("image_size_x", str(size[0]))
        blueprint.set_attribute("image_size_y", str(size[1]))
        blueprint.set_attribute("fov", str(fov))
        camera = self.world.spawn_actor(blueprint, where)
        try:
            image = self.measure(camera)
        finally:
            camera.destroy()
        return Picture(bytes(image.raw_data))

    def brightness(self, where: carla.Transform) -> float:
        """Mean of a picture, 0 to 255."""
        return self.picture(where, size=(60, 45)).mean()


def look_at(
    target: carla.Location, distance_m: float = _NEAR_M, yaw_deg: float = 0.0, pitch_deg: float = 15
) -> carla.Transform:
    """A camera pose that has a place in the middle of its picture, looking down a little.

    Args:
        target: what to look at.
        distance_m: from where.
        yaw_deg: direction that the camera looks in.
        pitch_deg: how far it looks down.
    """
    yaw, pitch = math.radians(yaw_deg), math.radians(pitch_deg)
    return carla.Transform(
        carla.Location(
            target.x - distance_m * math.cos(yaw) * math.cos(pitch),
            target.y - distance_m * math.sin(yaw) * math.cos(pitch),
            target.z + distance_m * math.sin(pitch),
        ),
        carla.Rotation(pitch=-pitch_deg, yaw=yaw_deg),
    )
