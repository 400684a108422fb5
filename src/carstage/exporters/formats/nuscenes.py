"""nuScenes: an episode is a scene, a frame a sample; the devkit loads, draws and evaluates it."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import ClassVar, Final

import numpy as np

from carstage.dataset import Episode
from carstage.errors import BadInputError
from carstage.exporters.exporter import Exporter, register
from carstage.exporters.formats.nuscenes_files import write_blank_mask
from carstage.exporters.formats.nuscenes_frame import (
    SamplePart,
    SampleWriter,
    calibrated_sensor,
    channels,
)
from carstage.exporters.formats.nuscenes_tables import Chain, Tables, token
from carstage.exporters.labels import require_labels

VERSION: Final = "v1.0-carstage"
_EPOCH_S = 1_500_000_000
_EPISODE_APART_S = 100_000
_MARGIN_M, _STEP_M, _METRES_PER_PX = 150.0, 100.0, 0.1
_MOST_MASK_M = 4000.0


@register
class NuScenes(Exporter):
    """See docs/formats/exports.md."""

    name: ClassVar = "nuscenes"
    summary: ClassVar = "nuScenes: scenes for nuscenes-devkit, every frame a key frame."
    uses: ClassVar = frozenset(
        {"cameras", "lidar", "min_lidar_points", "max_distance_m", "val_share", "test_share"}
    )

    def begin(self, episodes: Sequence[Episode], folder: Path) -> None:
        """Check the rigs, make the folders, find each map's extent."""
        names = set()
        for episode in episodes:
            require_labels(episode, self.options, "3d")
            names |= set(channels(episode, self.options).values())
        for name in sorted(names):
            (folder / "samples" / name).mkdir(parents=True)
        (folder / VERSION).mkdir()
        (folder / "maps").mkdir()
        self._folder = folder
        self._episodes = tuple(episodes)
        self._grounds = {
            name: _ground([e for e in episodes if e.document["map"] == name])
            for name in sorted({episode.document["map"] for episode in episodes})
        }
        self._number = 0
        self._tables = Tables(folder / VERSION)
        self.files.callback(self._tables.close)

    def begin_episode(self, episode: Episode) -> SampleWriter:
        """Open a scene."""
        self._episode = episode
        self._channels = channels(episode, self.options)
        self._samples = Chain(self._tables, "sample")
        self._data = {name: Chain(self._tables, "sample_data") for name in self._channels}
        self._annotations: dict[int, Chain] = {}
        self._categories: dict[int, str] = {}
        ranged = any(name[:3] != "CAM" for name in self._channels.values())
        least = self.options.min_lidar_points
        return SampleWriter(
            replace(
                self.options,
                max_distance_m=self.options.max_distance_m or episode.spec.max_distance_m,
            ),
            self._channels,
            least if least is not None else int(ranged),
            self._grounds[episode.document["map"]].shift_m,
        )

    def add(self, part: SamplePart) -> None:
        """Write the sample, linked to the one before."""
        tables, episode = self._tables, self._episode
        time_us = self._time_us(part.timestamp_s)
        sample = token(episode.id, "sample", part.k)
        scene = token(episode.id, "scene")
        self._samples.add({"token": sample, "timestamp": time_us, "scene_token": scene})
        pose = token(episode.id, "ego_pose", part.k)
        tables.add("ego_pose", {"token": pose, "timestamp": time_us, **part.ego_pose})
        for sensor_id, row in part.data.items():
            self._data[sensor_id].add(
                {
                    "token": token(episode.id, "sample_data", sensor_id, part.k),
                    "sample_token": sample,
                    "ego_pose_token": pose,
                    "calibrated_sensor_token": self._calibrated(sensor_id),
                    "timestamp": time_us,
                    "is_key_frame": True,
                    **row,
                }
            )
        for track_id, annotation in part.annotations.items():
            if track_id not in self._annotations:
                self._annotations[track_id] = Chain(tables, "sample_annotation")
                self._categories[track_id] = part.categories[track_id]
            row = dict(annotation)
            attribute = token("attribute", row.pop("attribute"))
            self._annotations[track_id].add(
                {
                    "token": token(episode.id, "annotation", track_id, part.k),
                    "sample_token": sample,
                    "instance_token": token(episode.id, "instance", track_id),
                    "attribute_tokens": [attribute],
                    **row,
                }
            )

    def end_episode(self) -> None:
        """Write the scene, its log and its instances."""
        tables, episode = self._tables, self._episode
        for chain in (self._samples, *self._data.values(), *self._annotations.values()):
            chain.end()
        for track_id, chain in self._annotations.items():
            tables.add(
                "instance",
                {
                    "token": token(episode.id, "instance", track_id),
                    "category_token": token("category", self._categories[track_id]),
                    "nbr_annotations": chain.count,
                    "first_annotation_token": chain.first,
                    "last_annotation_token": chain.last,
                },
            )
        captured = datetime.fromtimestamp(self._time_us(0.0) // 1_000_000, timezone.utc)
        log = tables.add(
            "log",
            {
                "token": token(episode.id, "log"),
                "logfile": episode.id,
                "vehicle": episode.spec.ego.blueprint,
                "date_captured": captured.date().isoformat(),
                "location": Path(episode.document["map"]).name,
            },
        )
        tables.add(
            "scene",
            {
                "token": token(episode.id, "scene"),
                "log_token": log,
                "nbr_samples": self._samples.count,
                "first_sample_token": self._samples.first,
                "last_sample_token": self._samples.last,
                "name": scene_name(episode),
                "description": episode.spec.weather.preset or "",
            },
        )
        self._number += 1

    def finish(self) -> None:
        """Write maps and splits."""
        for name, ground in self._grounds.items():
            mask = f"maps/{token('map', name)}.png"
            write_blank_mask(self._folder / mask, *ground.size_px)
            logs = [token(e.id, "log") for e in self._episodes if e.document["map"] == name]
            self._tables.add(
                "map",
                {
                    "token": token("map", name),
                    "log_tokens": logs,
                    "category": "semantic_prior",
                    "filename": mask,
                    "carla_map": name,
                    "global_from_enu_m": list(ground.shift_m),
                },
            )
        self._tables.close()
        splits = {
            f"carstage_{split}": [
                scene_name(e) for e in self._episodes if self.split_of(e) == split
            ]
            for split in self.used_splits(self._episodes)
        }
        path = self._folder / VERSION / "splits.json"
        path.write_text(json.dumps(splits, indent=1) + "\n")

    def _time_us(self, time_s: float) -> int:
        """An invented epoch: episodes lie a day apart, so that none overlap."""
        start_s = _EPOCH_S + self._number * _EPISODE_APART_S
        return start_s * 1_000_000 + round(1e6 * time_s)

    def _calibrated(self, sensor_id: str) -> str:
        channel = self._channels[sensor_id]
        modality = {"CAM": "camera", "LID": "lidar", "RAD": "radar"}[channel[:3]]
        sensor = self._tables.add_once(
            "sensor",
            {"token": token("sensor", channel), "channel": channel, "modality": modality},
        )
        return self._tables.add_once(
            "calibrated_sensor",
            {
                "token": token(self._episode.id, "calibrated_sensor", sensor_id),
                "sensor_token": sensor,
                **calibrated_sensor(self._episode.calibration.sensors[sensor_id]),
            },
        )


def scene_name(episode: Episode) -> str:
    """``scene-`` and the episode's id."""
    return f"scene-{episode.id}"


@dataclass(frozen=True, slots=True)
class _Ground:
    """Where a map's frame begins, and how large its mask is."""

    shift_m: tuple[float, float]
    size_px: tuple[int, int]


def _ground(episodes: Sequence[Episode]) -> _Ground:
    """The area around all that drove on a map; nuScenes's maps begin at (0, 0)."""
    places = [
        np.array(episode.sensor_poses()["location"].to_pylist()).reshape(-1, 3)
        for episode in episodes
    ]
    x, y, _ = np.concatenate(places).T
    east, north = x, -y
    shift = tuple(
        float(math.ceil((_MARGIN_M - values.min()) / _STEP_M) * _STEP_M) for values in (east, north)
    )
    sizes = [
        values.max() + offset + _MARGIN_M
        for values, offset in zip((east, north), shift, strict=True)
    ]
    if max(sizes) > _MOST_MASK_M:
        raise BadInputError(
            f"The episodes on {episodes[0].document['map']} spread over {max(sizes):.0f} m; the "
            f"devkit draws maps of at most {_MOST_MASK_M:.0f} m.",
            "Export fewer episodes of that map at once.",
        )
    width, height = (math.ceil(size / _METRES_PER_PX) for size in sizes)
    return _Ground((shift[0], shift[1]), (width, height))
