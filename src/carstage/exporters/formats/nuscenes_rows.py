"""The rows of one scene of nuScenes, written as its frames come."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime, timezone
from typing import Any

from carstage.dataset import Episode
from carstage.exporters.formats.nuscenes_can_bus import CanBus
from carstage.exporters.formats.nuscenes_frame import ScenePart, calibrated_sensor, data_token
from carstage.exporters.formats.nuscenes_scenes import CarScene
from carstage.exporters.formats.nuscenes_tables import Chain, Tables, token

_MODALITIES = {"CAM": "camera", "LID": "lidar", "RAD": "radar"}


class SceneTables:
    """One scene.

    Args:
        tables: all tables.
        episode: whose part the scene is.
        scene: the car.
        can_bus: its messages.
        start_s: time of the episode's first frame since 1970; invented.
        step: every how many frames one is a key frame.
        location: what the devkit calls the map.
    """

    def __init__(
        self,
        tables: Tables,
        episode: Episode,
        scene: CarScene,
        can_bus: CanBus,
        start_s: int,
        step: int,
        location: str,
    ) -> None:
        self.scene = scene
        self.can_bus = can_bus
        self._tables, self._episode = tables, episode
        self._start_s, self._step = start_s, step
        self._location = location
        self._last_key = (episode.frames - 1) // step * step
        self._samples = Chain(tables, "sample")
        self._data = {name: Chain(tables, "sample_data") for name in scene.channels}
        self._annotations: dict[int, Chain] = {}
        self._categories: dict[int, str] = {}

    def add(self, k: int, timestamp_s: float, part: ScenePart) -> None:
        """Write a frame, linked to the one before; annotations if it is a key frame."""
        key, tables = self.scene.key, self._tables
        time_us = self._start_s * 1_000_000 + round(1e6 * timestamp_s)
        is_key = k % self._step == 0
        pose = token(key, "ego_pose", k)
        tables.add("ego_pose", {"token": pose, "timestamp": time_us, **part.pose})
        if is_key:
            row = {"token": self._sample(k), "timestamp": time_us}
            self._samples.add({**row, "scene_token": token(key, "scene")})
        for sensor_id, file in part.data.items():
            self._data[sensor_id].add(
                {
                    "token": data_token(self.scene, sensor_id, k),
                    "sample_token": self._sample(k),
                    "ego_pose_token": pose,
                    "calibrated_sensor_token": self._calibrated(sensor_id),
                    "timestamp": time_us,
                    "is_key_frame": is_key,
                    **file,
                }
            )
        for table, filename in part.labels.items():
            data = data_token(self.scene, self.scene.lidar or "", k)
            row = {"token": data, "sample_data_token": data, "filename": filename}
            tables.add(table, row)
        for track_id, annotation in part.annotations.items():
            self._annotate(k, track_id, annotation, part.categories[track_id])
        self.can_bus.add(time_us, part.can_messages)

    def end(self, name: str) -> None:
        """Write the scene under its name, its log and its instances."""
        tables, key = self._tables, self.scene.key
        self.can_bus.end()
        for chain in (self._samples, *self._data.values(), *self._annotations.values()):
            chain.end()
        for track_id, chain in self._annotations.items():
            tables.add(
                "instance",
                {
                    "token": token(key, "instance", track_id),
                    "category_token": token("category", self._categories[track_id]),
                    "nbr_annotations": chain.count,
                    "first_annotation_token": chain.first,
                    "last_annotation_token": chain.last,
                },
            )
        captured = datetime.fromtimestamp(self._start_s, timezone.utc)
        log = tables.add(
            "log",
            {
                "token": token(key, "log"),
                "logfile": key,
                "vehicle": self.scene.car.blueprint,
                "date_captured": captured.date().isoformat(),
                "location": self._location,
            },
        )
        tables.add(
            "scene",
            {
                "token": token(key, "scene"),
                "log_token": log,
                "nbr_samples": self._samples.count,
                "first_sample_token": self._samples.first,
                "last_sample_token": self._samples.last,
                "name": name,
                "description": _description(self._episode),
            },
        )

    def _sample(self, k: int) -> str:
        """The sample of a frame: a sweep belongs to the next key frame, the last ones to the last.

        So has nuScenes; the devkit interpolates a sweep's boxes between it and the one before.
        """
        key_frame = -(-k // self._step) * self._step
        return token(self.scene.key, "sample", min(key_frame, self._last_key))

    def _annotate(
        self, k: int, track_id: int, annotation: Mapping[str, Any], category: str
    ) -> None:
        key = self.scene.key
        if track_id not in self._annotations:
            self._annotations[track_id] = Chain(self._tables, "sample_annotation")
            self._categories[track_id] = category
        row = dict(annotation)
        attribute = row.pop("attribute")
        self._annotations[track_id].add(
            {
                "token": token(key, "annotation", track_id, k),
                "sample_token": self._sample(k),
                "instance_token": token(key, "instance", track_id),
                "attribute_tokens": [] if attribute is None else [token("attribute", attribute)],
                **row,
            }
        )

    def _calibrated(self, sensor_id: str) -> str:
        channel = self.scene.channels[sensor_id]
        sensor = self._tables.add_once(
            "sensor",
            {
                "token": token("sensor", channel),
                "channel": channel,
                "modality": _MODALITIES[channel[:3]],
            },
        )
        return self._tables.add_once(
            "calibrated_sensor",
            {
                "token": token(self.scene.key, "calibrated_sensor", sensor_id),
                "sensor_token": sensor,
                **calibrated_sensor(self._episode.calibration.sensors[sensor_id]),
            },
        )


def _description(episode: Episode) -> str:
    """What a scene shows: its variant, where there are any, and its weather."""
    variant = "" if episode.variant is None else f"variant {episode.variant}"
    return ", ".join(filter(None, (variant, episode.spec.weather.preset)))
