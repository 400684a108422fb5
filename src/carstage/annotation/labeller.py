"""Labels of one episode: world snapshots and sensor data in, rows of the label tables out.

What only objects and cameras need is imported where they need it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage.annotation.boxes import MEASURED_TWO_WHEELERS, MeasuredBox, label_box
from carstage.annotation.classes import RIDER_TAG, WALKER_CLASSES, object_class
from carstage.annotation.decoding import decode_instance_bgra
from carstage.annotation.ego_row import EpisodeFacts, ego_row
from carstage.annotation.level import Level
from carstage.annotation.point_counts import count_points
from carstage.annotation.pose_rows import pose_rows
from carstage.annotation.rig import LabelledCamera, Mount
from carstage.annotation.scene import ActorFacts, Scene, build_scene
from carstage.errors import AnnotationError
from carstage.geometry import FloatArray, invert_pose, multiply
from carstage.rawlog.clock import elapsed_s
from carstage.rawlog.reader import ActorInfo, LevelObject, WorldFrame
from carstage.sensor_kinds.model import DETECTIONS, POINTS
from carstage.spec import EpisodeSpec, SpecError
from carstage.tags import (
    dataset_tags,
    numbers_tags_anew,
    server_release,
    vehicle_tags,
    walker_tags,
)

if TYPE_CHECKING:
    from carstage.annotation.object_rows import VisiblePixels
    from carstage.annotation.pixels import ImageEvidence


@dataclass(frozen=True, slots=True)
class CameraImages:
    """What one labelled camera saw in one frame.

    Attributes:
        depth_m: ``(H, W)`` float32, distance along the optical axis (m).
        instance_bgra: ``(H, W, 4)`` uint8 of the instance camera with the same pose, or None.
        semantic_tag: ``(H, W)`` uint8 of a semantic camera with the same pose, or None.
    """

    depth_m: NDArray[np.float32]
    instance_bgra: NDArray[np.uint8] | None = None
    semantic_tag: NDArray[np.uint8] | None = None


@dataclass(frozen=True, slots=True)
class CameraInputs:
    """Streams of the raw log that a labelled camera's labels are made from.

    Attributes:
        depth: the depth camera's stream.
        instance: the instance camera's stream, or None when labels need none.
    """

    depth: str
    instance: str | None


@dataclass(frozen=True, slots=True)
class FrameLabels:
    """Rows of one frame, as ``carstage.annotation.schema`` describes them.

    Attributes:
        objects: one per vehicle, pedestrian, rider that is seen, and level object near enough.
        camera_objects: one per labelled camera and object that its image can hold.
        ego: the ego record; empty when ego motion was not asked for.
        sensor_poses: one per sensor of the dataset.
    """

    objects: list[dict[str, Any]]
    camera_objects: list[dict[str, Any]]
    ego: dict[str, Any]
    sensor_poses: list[dict[str, Any]]


class _Seen(NamedTuple):
    """What cameras see in a frame: their rows; by object, its pixels and the tag of its rider."""

    rows: list[dict[str, Any]]
    pixels: dict[int, VisiblePixels]
    riders: dict[int, int]


class EpisodeLabeller:
    """Labels the frames of one episode; each frame by itself, in any order.

    Args:
        header: the raw log's ``episode.json``.
        actors: static facts by actor id; may grow while the episode is labelled.
        measured: boxes by blueprint that replace those of two-wheelers.
        level_objects: the level's objects, from the raw log.

    Raises:
        AnnotationError: when the header lacks what labels need.
    """

    def __init__(
        self,
        header: Mapping[str, Any],
        actors: Mapping[int, ActorInfo],
        measured: Mapping[str, MeasuredBox] = MEASURED_TWO_WHEELERS,
        level_objects: Sequence[LevelObject] = (),
    ) -> None:
        try:
            spec = EpisodeSpec.from_json(header["spec"])
            actor_ids: Mapping[str, int] = header["sensor_actor_ids"]
            version: str = header["server_version"]
            self._episode_id: str = header["episode_id"]
            self._ego_id: int = header["ego_id"]
            self._spec = spec
            self._first_timestamp_s = float(header["first_timestamp_s"])
            self._episode = EpisodeFacts.from_header(header, spec)
            self._cameras = {
                sensor.id: LabelledCamera.from_spec(sensor, actor_ids)
                for sensor in spec.sensors
                if sensor.labelled
            }
            self._lidars, self._radars = (
                {
                    sensor.id: Mount.from_spec(sensor, actor_ids)
                    for sensor in spec.sensors_of(content)
                }
                for content in (POINTS, DETECTIONS)
            )
            self._mounts = [Mount.from_spec(sensor, actor_ids) for sensor in spec.written_sensors]
            on_ego = dict.fromkeys((sensor.id for sensor in spec.sensors), self._ego_id)
            self._carriers: Mapping[str, int] = header.get("sensor_carrier_ids", on_ego)
        except KeyError as error:
            raise AnnotationError(
                f"The raw log's episode.json lacks {error}.", "Record the episode again."
            ) from error
        except SpecError as error:
            raise AnnotationError(
                f"The raw log's specification is not usable: {error.message}",
                "Record the episode again.",
            ) from error
        self._first_tick_has_past = spec.warmup_ticks > 0
        # Before 0.9.16 the instance camera wrote ids of Unreal's objects, not of actors.
        self._instance_is_actor = server_release(version) >= (0, 9, 16)
        self._server = version
        self._vehicle_tags = _lookup(vehicle_tags(version))
        self._walker_tags = _lookup(walker_tags(version))
        self._actors = actors
        self._measured = measured
        self._level = Level(level_objects, version, spec.ground_truth)
        self._rider_tag = RIDER_TAG if numbers_tags_anew(version) else None
        self._labelled: dict[int, ActorFacts | None] = {}

    @property
    def labels_objects(self) -> bool:
        """Whether any object can be labelled, so that points in boxes are counted."""
        asked = self._spec.ground_truth
        return asked.vehicles or asked.pedestrians or len(self._level.extent) > 0

    @property
    def labelled_cameras(self) -> tuple[str, ...]:
        """Ids of the cameras that objects are labelled for, in the order of the spec."""
        return tuple(self._cameras)

    def inputs(self, camera_id: str) -> CameraInputs:
        """The streams that ``label_frame`` needs for a labelled camera."""
        camera = self._cameras[camera_id]
        return CameraInputs(camera.depth, camera.instance if self._spec.labels.pixels else None)

    def label_frame(
        self,
        world: WorldFrame,
        k: int,
        images: Mapping[str, CameraImages],
        lidar: Mapping[str, NDArray[np.float32]],
        radar: Mapping[str, FloatArray] | None = None,
    ) -> FrameLabels:
        """Label one saved frame.

        Args:
            world: the snapshot of its tick.
            k: index of the saved frame.
            images: by labelled camera; one that is missing gets no rows in this frame.
            lidar: by LiDAR, ``(N, 4)`` float32 points of this tick's sweep, sensor axes.
            radar: by radar, ``(N, 3)`` detections of this tick as points, sensor axes.

        Raises:
            AnnotationError: when the ego or an actor is unknown, or an image has the wrong size.
        """
        ego_row_index = self._ego_row(world)
        scene = self._with_level(self._scene(world, ego_row_index), images)
        time_s = elapsed_s(self._spec, self._first_timestamp_s, world.tick, world.timestamp_s)
        keys = {"k": k, "timestamp_s": time_s, "episode_id": self._episode_id}
        acceleration_valid = world.tick > 0 or self._first_tick_has_past
        points = _count_points(scene, self._lidars, lidar)
        detections = _count_points(scene, self._radars, radar or {})
        seen = _Seen([], {}, {})
        if images:
            seen = self._seen(scene, images, points, keys)
        objects: list[dict[str, Any]] = []
        if scene.facts:
            from carstage.annotation.object_rows import object_rows

            objects = object_rows(
                scene,
                keys,
                self._ego_id,
                self._spec.labels,
                acceleration_valid=acceleration_valid,
                lidar_points=points,
                radar_points=detections,
                pixels=seen.pixels if self._cameras.keys() & images.keys() else None,
                riders=seen.riders,
            )
        ego: dict[str, Any] = {}
        if self._spec.ground_truth.ego_motion:
            ego = ego_row(
                world, ego_row_index, keys, self._episode, acceleration_valid=acceleration_valid
            )
        poses = pose_rows(scene, self._mounts, self._carriers, keys)
        return FrameLabels(objects, seen.rows, ego, poses)

    def _seen(
        self,
        scene: Scene,
        images: Mapping[str, CameraImages],
        points: Mapping[int, list[tuple[str, int]]],
        keys: Mapping[str, Any],
    ) -> _Seen:
        """What the labelled cameras that have an image see of the objects."""
        from carstage.annotation.camera_rows import camera_rows

        seen = _Seen([], {}, {})
        for camera_id, camera in self._cameras.items():
            if camera_id not in images:
                continue
            evidence = self._evidence(camera, images[camera_id], scene.world.tick)
            has_points = self._has_points(scene, camera, points)
            for found in camera_rows(
                scene, camera, evidence, keys, self._too_near(camera), self._spec, has_points
            ):
                seen.rows.append(found.row)
                if found.is_rider and self._rider_tag is not None:
                    seen.riders[found.actor_id] = self._rider_tag
                if found.pixels is not None:
                    visible, amodal = seen.pixels.get(found.actor_id, (0, 0.0))
                    seen.pixels[found.actor_id] = (
                        visible + found.pixels.visible_px,
                        amodal + found.pixels.amodal_px,
                    )
        return seen

    def _has_points(
        self,
        scene: Scene,
        camera: LabelledCamera,
        points: Mapping[int, list[tuple[str, int]]],
    ) -> NDArray[np.bool_]:
        """``(N,)`` whether enough points of LiDARs beside the camera lie in each box.

        Only LiDARs with the camera's own carrier count: what a camera over another street sees,
        the ego's LiDAR need not hit. Without one, every object has enough; so has what hangs high
        or is thin, such as lights and signs.
        """
        carrier = self._carriers.get(camera.mount.sensor_id)
        beside = {name for name in self._lidars if self._carriers.get(name) == carrier}
        least = self._spec.min_lidar_points
        totals = np.zeros(len(scene.facts), dtype=np.int64)
        counted = set()
        for i, fact in enumerate(scene.facts):
            for name, count in points.get(fact.info.id, ()):
                if name in beside:
                    totals[i] += count
                    counted.add(name)
        if not counted or least <= 0:
            return np.ones(len(scene.facts), dtype=np.bool_)
        exempt = np.array([fact.is_fixture for fact in scene.facts], dtype=np.bool_)
        return np.asarray((totals >= least) | exempt)

    def _too_near(self, camera: LabelledCamera) -> int:
        """The actor that a camera sits on and does not label; 0 where it hovers or stands free."""
        return self._carriers.get(camera.mount.sensor_id, 0) if camera.mount.rigid else 0

    def _ego_row(self, world: WorldFrame) -> int:
        try:
            return world.row(self._ego_id)
        except KeyError:
            raise AnnotationError(
                f"The ego (actor {self._ego_id}) is not in the snapshot of tick {world.tick}.",
                "Record the episode again.",
            ) from None

    def _scene(self, world: WorldFrame, ego_row_index: int) -> Scene:
        rows: list[int] = []
        facts: list[ActorFacts] = []
        for row, actor_id in enumerate(world.actor_id.tolist()):
            if actor_id not in self._labelled:
                self._labelled[actor_id] = self._facts_of(actor_id, world.tick)
            fact = self._labelled[actor_id]
            if fact is not None:
                rows.append(row)
                facts.append(fact)
        return build_scene(world, rows, facts, ego_row_index)

    def _with_level(self, scene: Scene, images: Mapping[str, CameraImages]) -> Scene:
        """The scene with the level objects within the maximum distance of the ego or a camera."""
        if not len(self._level.extent):
            return scene
        origins = [scene.world_from_ego[:3, 3]]
        if self._spec.labels.distance_origin == "sensor":
            for camera_id in images:
                mount = self._cameras[camera_id].mount
                origins.append(mount.world_from_sensor(scene.world, scene.world_from_ego)[:3, 3])
        near = self._level.near(np.array(origins), self._spec.max_distance_m)
        return self._level.added_to(scene, near)

    def _facts_of(self, actor_id: int, tick: int) -> ActorFacts | None:
        """Facts of an actor that is to be labelled, else None."""
        info = self._actors.get(actor_id)
        if info is None:
            raise AnnotationError(
                f"Actor {actor_id} is in the snapshot of tick {tick} but in no actor table.",
                "The raw log is incomplete: record the episode again.",
            )
        kind = object_class(info)
        if kind is None:
            return None
        walker = kind in WALKER_CLASSES
        asked = self._spec.ground_truth
        if not (asked.pedestrians if walker else asked.vehicles):
            return None
        tags = self._walker_tags if walker else self._vehicle_tags
        info = replace(info, semantic_tags=dataset_tags(info.semantic_tags, self._server))
        return ActorFacts(info, kind, label_box(info, kind, self._measured), tags)

    def _evidence(self, camera: LabelledCamera, images: CameraImages, tick: int) -> ImageEvidence:
        shape = (camera.height, camera.width)
        from carstage.annotation.pixels import ImageEvidence

        instance_id, tag = None, images.semantic_tag
        if images.instance_bgra is not None and self._spec.labels.pixels:
            ids, instance_tag = decode_instance_bgra(images.instance_bgra)
            instance_id = ids if self._instance_is_actor else None
            tag = instance_tag if tag is None else tag
        for name, image in (("depth", images.depth_m), ("id", instance_id), ("tag", tag)):
            if image is not None and image.shape != shape:
                raise AnnotationError(
                    f"The {name} image of {camera.mount.sensor_id} in tick {tick} has shape "
                    f"{image.shape}; the spec says {shape}."
                )
        return ImageEvidence(images.depth_m, instance_id, tag, self._rider_tag)


def _count_points(
    scene: Scene, mounts: Mapping[str, Mount], clouds: Mapping[str, NDArray[np.floating[Any]]]
) -> dict[int, list[tuple[str, int]]]:
    """Points per LiDAR or radar, by the ids of the objects with a valid box."""
    chosen = np.flatnonzero(scene.valid)
    if not len(chosen):
        return {}
    counts: dict[int, list[tuple[str, int]]] = {scene.facts[i].info.id: [] for i in chosen.tolist()}
    for sensor_id, mount in mounts.items():
        if sensor_id not in clouds:
            continue
        pose = mount.world_from_sensor(scene.world, scene.world_from_ego)
        sensor_from_boxes = multiply(invert_pose(pose), scene.world_from_box[chosen])
        found = count_points(clouds[sensor_id], sensor_from_boxes, scene.extent[chosen])
        for pairs, count in zip(counts.values(), found.tolist(), strict=True):
            pairs.append((sensor_id, count))
    return counts


def _lookup(tags: frozenset[int]) -> NDArray[np.bool_]:
    table = np.zeros(256, dtype=np.bool_)
    table[sorted(tags)] = True
    return table
