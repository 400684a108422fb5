"""Shows objects among others, and isolated; a client that ``benchmarks.framework.labels`` starts.

It sets up scenes in a town and writes for each what labels are made from, as the collector does:
the world's state, a depth and an instance picture. Then it lifts the camera and one object after
the other high above the town, at the same place to each other, and writes which pixels the object
covers there: the truth about its pixels, were nothing in front of it. Some objects it also takes
away, and writes where the depth picture becomes another: the truth about visible pixels without any
instance picture; so too with parked vehicles and signs of the level. All this works with the calls
that any CARLA server has; hiding a town with its ground does not.

The plan: ``host``, ``port``, ``timeout_s``; ``town``, ``seed``, ``scenes``; ``vehicles`` and
``walkers`` per scene; ``taken_away``, the most actors and level objects of a scene that are each
taken away; ``size`` (px) and ``fov_deg`` of the camera; ``folder`` for the raw log.
"""

from __future__ import annotations

import json
import queue
import random
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import carla
import numpy as np

from benchmarks.framework.clients.scene_setup import (
    Placed,
    PlacedScene,
    SceneActors,
    ScenePlaces,
    is_before,
    lifted,
)
from benchmarks.framework.label_scenes import (
    DEPTH,
    INSTANCE,
    ISOLATED,
    LEVEL_KINDS,
    SCENES_FPS,
    TAKEN_AWAY,
    episode_header,
)
from carstage.collector.__main__ import EXIT_FAILED, EXIT_OK, parse_options, private_stdout
from carstage.collector.internals.errors import CollectorError
from carstage.collector.internals.events import EventStream
from carstage.collector.internals.level_objects import level_objects
from carstage.collector.internals.snapshots import WorldObserver
from carstage.collector.internals.stopping import StopRequest
from carstage.collector.maps import find_map
from carstage.collector.sensors import sensor_of
from carstage.rawlog.format import KIND_DATA, KIND_TABLE, WORLD
from carstage.rawlog.writing import StreamWriter, write_episode_file

_KINDS = {DEPTH: "depth", INSTANCE: "instance"}
_BLUEPRINTS = {
    DEPTH: "sensor.camera.depth",
    INSTANCE: "sensor.camera.instance_segmentation",
}


_MOST_WAITING = 1000
"""Pictures of ticks that nobody looks at; they are dropped with the next that is looked for."""


class Cameras:
    """The depth and the instance camera, always at one place.

    Args:
        world: ``carla.World``.
        plan: the client's plan.
    """

    def __init__(self, world: Any, plan: Mapping[str, Any]) -> None:
        self._timeout_s = float(plan["timeout_s"])
        self.actors: dict[str, Any] = {}
        self._queues: dict[str, queue.Queue[Any]] = {}
        width, height = plan["size"]
        for name, blueprint_id in _BLUEPRINTS.items():
            blueprint = world.get_blueprint_library().find(blueprint_id)
            values = {"image_size_x": width, "image_size_y": height, "fov": plan["fov_deg"]}
            for attribute, value in values.items():
                blueprint.set_attribute(attribute, str(value))
            self.actors[name] = world.spawn_actor(blueprint, carla.Transform())
            self._queues[name] = queue.Queue(_MOST_WAITING)
            self.actors[name].listen(self._queues[name].put)

    def place(self, transform: Any) -> None:
        """Move both."""
        for actor in self.actors.values():
            actor.set_transform(transform)

    def pictures(self, frame: int) -> dict[str, Any]:
        """Their data of a frame.

        Raises:
            CollectorError: one did not come in time.
        """
        return {name: self._picture(name, frame) for name in self._queues}

    def _picture(self, name: str, frame: int) -> Any:
        while True:
            try:
                data = self._queues[name].get(timeout=self._timeout_s)
            except queue.Empty:
                raise CollectorError(f"Frame {frame} never came from {name}.", "") from None
            if data.frame == frame:
                return data

    def stop(self) -> None:
        """Give both back."""
        for actor in self.actors.values():
            actor.stop()
            actor.destroy()


class Recording:
    """Writes scenes and isolated objects as streams of a raw log; a context manager.

    Args:
        folder: the raw log's.
        scenes: how many there will be.
        objects: upper bound of how many isolated objects there will be.
        taken_away: upper bound of how many objects will be taken away.
    """

    def __init__(self, folder: Path, scenes: int, objects: int, taken_away: int) -> None:
        self._stack = ExitStack()
        self._written = {ISOLATED: 0, TAKEN_AWAY: 0}
        lengths = {WORLD: scenes, DEPTH: scenes, INSTANCE: scenes, ISOLATED: max(1, objects)}
        lengths[TAKEN_AWAY] = max(1, taken_away)
        self._streams = {
            name: self._stack.enter_context(StreamWriter(str(folder), name, length))
            for name, length in lengths.items()
        }
        self._last = {name: length - 1 for name, length in lengths.items()}

    def add_scene(self, scene: int, snapshot: Any, moment: Any, pictures: Any) -> None:
        """Write what labels need of a scene."""
        at = (scene, snapshot.frame, snapshot.timestamp.elapsed_seconds)
        table = moment.table()
        if table is not None:
            self._streams[WORLD].append(KIND_TABLE, *at, table)
        meta, payload = moment.encode()
        self._streams[WORLD].append(KIND_DATA, *at, meta, payload)
        for name, data in pictures.items():
            meta, payload = sensor_of(_KINDS[name]).encode(data)
            self._streams[name].append(KIND_DATA, *at, meta, payload)

    def add_isolated(self, scene: int, actor_id: int, picture: Any) -> None:
        """Write which pixels an object covers when nothing else is there."""
        bgra = np.frombuffer(picture.raw_data, np.uint8).reshape(picture.height, picture.width, 4)
        mask = (bgra[..., 1] == actor_id & 0xFF) & (bgra[..., 0] == actor_id >> 8 & 0xFF)
        self._add_mask(ISOLATED, {"scene": scene, "actor": actor_id}, mask, picture)

    def add_taken_away(self, scene: int, track: dict[str, int], before: Any, after: Any) -> None:
        """Write where a depth picture becomes another when an object is taken away.

        Args:
            scene: the number of the scene.
            track: ``actor`` or ``object`` and its id.
            before: the depth picture with it.
            after: without it.
        """
        there, gone = (
            np.frombuffer(picture.raw_data, np.uint8).reshape(picture.height, picture.width, 4)
            for picture in (before, after)
        )
        mask = (there[..., :3] != gone[..., :3]).any(axis=2)
        self._add_mask(TAKEN_AWAY, {"scene": scene, **track}, mask, after)

    def _add_mask(self, stream: str, meta: dict[str, int], mask: Any, picture: Any) -> None:
        rows, columns = np.nonzero(mask.any(axis=1))[0], np.nonzero(mask.any(axis=0))[0]
        meta |= {"x0": 0, "y0": 0, "width": 0, "height": 0}
        crop = mask[:0, :0]
        if len(rows):
            crop = mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
            meta |= {"x0": int(columns[0]), "y0": int(rows[0])}
            meta |= {"width": crop.shape[1], "height": crop.shape[0]}
        self._streams[stream].append(
            KIND_DATA,
            self._written[stream],
            picture.frame,
            picture.timestamp,
            meta,
            crop.tobytes(),
        )
        self._written[stream] += 1

    def seal(self) -> None:
        """End the log: everything was recorded."""
        for name, stream in self._streams.items():
            stream.seal(self._last[name])

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()


def record(client: Any, plan: Mapping[str, Any], events: EventStream, stop: StopRequest) -> None:
    """Set up and record the scenes of a plan; events ``tick`` after each."""
    folder, scenes = Path(plan["folder"]), int(plan["scenes"])
    rng = random.Random(plan["seed"])
    with _own_clock(client, plan["town"]) as world, ExitStack() as stack:
        world.set_pedestrians_seed(plan["seed"])

        def tick() -> int:
            stop.check()
            return int(world.tick(float(plan["timeout_s"])))

        actors = SceneActors(world, rng)
        stack.callback(actors.leave, client)
        tick()
        places = ScenePlaces(world, actors, rng)
        cameras = Cameras(world, plan)
        stack.callback(cameras.stop)
        objects = scenes * (int(plan["vehicles"]) + int(plan["walkers"]))
        most = int(plan["taken_away"])
        recording = stack.enter_context(Recording(folder, scenes, objects, 2 * most * scenes))
        level = level_objects(world, LEVEL_KINDS)
        observer = WorldObserver(world, actors.ego, level)
        chance = random.Random(plan["seed"])
        for number in range(scenes):
            placed = places.scene(int(plan["vehicles"]), int(plan["walkers"]))
            _show(client, actors, cameras, placed)
            frame = tick()
            snapshot = world.get_snapshot()
            if snapshot.frame != frame:
                raise CollectorError(f"The world is in frame {snapshot.frame}, not {frame}.", "")
            pictures = cameras.pictures(frame)
            recording.add_scene(number, snapshot, observer.observe(snapshot, {}), pictures)
            if number == 0:
                header = episode_header(
                    plan,
                    server_version=client.get_server_version(),
                    ego_id=actors.ego.id,
                    camera_id=cameras.actors[DEPTH].id,
                    timestamp_s=snapshot.timestamp.elapsed_seconds,
                )
                write_episode_file(str(folder), header)
            without = Without(world, cameras, recording, number, pictures[DEPTH], tick)
            for one in chance.sample(placed.placed, min(most, len(placed.placed))):
                without.actor(client, actors, one)
            for row in _before_camera(placed.camera, level, most):
                without.level_object(row)
            _show_isolated(client, actors, cameras, placed, number, recording, tick)
            events.emit("tick", tick=number, frame=frame)
        recording.seal()


@contextmanager
def _own_clock(client: Any, town: str) -> Iterator[Any]:
    """A freshly loaded town that ticks on request only; gives the clock back."""
    world = client.get_world()
    original, settings = world.get_settings(), world.get_settings()
    settings.synchronous_mode = True
    settings.fixed_delta_seconds = 1.0 / SCENES_FPS
    world.apply_settings(settings)
    try:
        world = client.load_world(find_map(client, town), False)
        yield world
    finally:
        world.apply_settings(original)


def _show(client: Any, actors: SceneActors, cameras: Cameras, placed: PlacedScene) -> None:
    actors.put_away(client)
    cameras.place(placed.camera)
    client.apply_batch_sync(
        [carla.command.ApplyTransform(one.actor.id, one.transform) for one in placed.placed],
        False,
    )


class Without:
    """Takes objects of a scene away, one after the other, and puts each back.

    Args:
        world: ``carla.World``.
        cameras: that look at the scene.
        recording: where the difference goes.
        scene: the number of the scene.
        depth: the scene's depth picture.
        tick: makes a step.
    """

    def __init__(
        self, world: Any, cameras: Cameras, recording: Recording, scene: int, depth: Any, tick: Any
    ) -> None:
        self._world = world
        self._cameras = cameras
        self._recording = recording
        self._scene = scene
        self._depth = depth
        self._tick = tick

    def actor(self, client: Any, actors: SceneActors, one: Placed) -> None:
        """One of the scene's actors."""
        actors.put_away(client, [one.actor])
        self._compare({"actor": one.actor.id})
        command = carla.command.ApplyTransform(one.actor.id, one.transform)
        client.apply_batch_sync([command], False)

    def level_object(self, row: Mapping[str, Any]) -> None:
        """A piece of the level."""
        self._world.enable_environment_objects({row["id"]}, False)
        self._compare({"object": row["id"]})
        self._world.enable_environment_objects({row["id"]}, True)

    def _compare(self, track: dict[str, int]) -> None:
        after = self._cameras.pictures(self._tick())[DEPTH]
        self._recording.add_taken_away(self._scene, track, self._depth, after)


def _before_camera(
    camera: Any, level: Sequence[Mapping[str, Any]], most: int
) -> list[Mapping[str, Any]]:
    """The nearest level objects before a camera that a server can take away.

    Lights cannot be: they are actors whose heads and masts only count as pieces of the level.
    """
    near = []
    for row in level:
        at = carla.Location(*row["box"]["location"])
        if not row["light"] and is_before(camera, at):
            near.append((at.distance(camera.location), row["id"], row))
    near.sort(key=lambda entry: entry[:2])
    return [row for _, _, row in near[:most]]


def _show_isolated(
    client: Any,
    actors: SceneActors,
    cameras: Cameras,
    placed: PlacedScene,
    scene: int,
    recording: Recording,
    tick: Any,
) -> None:
    actors.put_away(client)
    cameras.place(lifted(placed.camera))
    for one in placed.placed:
        one.actor.set_transform(lifted(one.transform))
        frame = tick()
        recording.add_isolated(scene, one.actor.id, cameras.pictures(frame)[INSTANCE])
        actors.put_away(client, [one.actor])


def main(arguments: list[str] | None = None) -> int:
    """Record every scene of a plan; the exit codes are the collector's."""
    given = parse_options(arguments)
    stop = StopRequest()
    stop.on_signals()
    if given.exit_with_input:
        stop.on_closed_input(sys.stdin.fileno())
    events = EventStream(private_stdout(), stop)
    plan = json.loads(Path(given.plan).read_text("utf-8"))
    client = carla.Client(plan["host"], plan["port"])
    client.set_timeout(plan["timeout_s"])
    try:
        record(client, plan, events, stop)
    except (CollectorError, RuntimeError) as error:
        events.emit("error", kind="client", message=str(error), hint="")
        return EXIT_FAILED
    events.emit("episode_recorded")
    return EXIT_OK


if __name__ == "__main__":
    sys.exit(main())
