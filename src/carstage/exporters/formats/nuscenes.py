"""nuScenes: a car's part of an episode is a scene; the devkit loads, draws and evaluates it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from carstage.dataset import Episode
from carstage.errors import BadInputError
from carstage.exporters.exporter import Exporter, register
from carstage.exporters.formats.nuscenes_can_bus import CanBus
from carstage.exporters.formats.nuscenes_categories import check_categories
from carstage.exporters.formats.nuscenes_frame import OCC3D, VERSION, FramePart, SceneWriter
from carstage.exporters.formats.nuscenes_grounds import EXPANSION, grounds_of, town_names
from carstage.exporters.formats.nuscenes_rows import SceneTables
from carstage.exporters.formats.nuscenes_scenes import (
    CarScene,
    key_frame_step,
    scenes_of,
    sensors_without_scene,
)
from carstage.exporters.formats.nuscenes_segmentation import instance_numbers
from carstage.exporters.formats.nuscenes_tables import LABELS, Tables, token
from carstage.exporters.labels import require_labels
from carstage.exporters.road_cells import surface_sensors
from carstage.spec.sensors import EGO

_EPOCH_S = 1_500_000_000
_EPISODE_APART_S = 100_000
# The devkit's CAN-bus reader wants four digits, and knows of gaps in scenes below 1200.
_FIRST_SCENE = 2001
_MOST_SCENES = 10_000 - _FIRST_SCENE


@register
class NuScenes(Exporter):
    """See docs/formats/exports.md."""

    name: ClassVar = "nuscenes"
    summary: ClassVar = "nuScenes: key frames, sweeps, lidarseg, panoptic, CAN bus, map expansion."
    with_maps: ClassVar = True
    uses: ClassVar = frozenset(
        {
            "cameras", "lidar", "min_lidar_points", "max_distance_m", "val_share", "test_share",
            "keyframes_hz", "class_map", "nuscenes_locations",
        }
    )  # fmt: skip

    def begin(self, episodes: Sequence[Episode], folder: Path) -> None:
        """Check the rigs, make the folders, find each map's extent."""
        check_categories(self.options.class_map)
        self._scenes = {}
        for episode in episodes:
            require_labels(episode, self.options, "3d")
            self._scenes[episode.id] = scenes_of(episode, self.options)
        every = [scene for scenes in self._scenes.values() for scene in scenes]
        if len(every) > _MOST_SCENES:
            raise BadInputError(
                f"The dataset would be {len(every)} scenes; the devkit's scenes have four digits, "
                f"which is room for {_MOST_SCENES} beside nuScenes's own.",
                "Export fewer episodes at once.",
            )
        self._names = {scene.key: f"scene-{_FIRST_SCENE + n}" for n, scene in enumerate(every)}
        self._steps = {e.id: key_frame_step(e, self.options) for e in episodes}
        self._labelled = any(scene.tag_source is not None for scene in every)
        self._make_folders(every, folder)
        self._folder = folder
        self._episodes = tuple(episodes)
        self._towns = town_names(episodes)
        self._grounds = grounds_of(
            episodes,
            self._towns,
            nuscenes_locations=self.options.nuscenes_locations,
            lost_maps=self.lost_maps,
        )
        if any(ground.town is not None for ground in self._grounds.values()):
            (folder / EXPANSION).mkdir()
        self._number = 0
        self._tables = Tables(folder / VERSION, labelled=self._labelled)
        self.files.callback(self._tables.close)

    def _make_folders(self, scenes: Sequence[CarScene], folder: Path) -> None:
        kinds = ("samples", "sweeps") if max(self._steps.values()) > 1 else ("samples",)
        for name in sorted({name for scene in scenes for name in scene.channels.values()}):
            for kind in kinds:
                (folder / kind / name).mkdir(parents=True)
        for name in (VERSION, "maps", "can_bus"):
            (folder / name).mkdir()
        for table in LABELS if self._labelled else ():
            (folder / table / VERSION).mkdir(parents=True)

    def begin_episode(self, episode: Episode) -> SceneWriter:
        """Open the scenes of an episode."""
        scenes = self._scenes[episode.id]
        self._without_scene = sensors_without_scene(episode, scenes, self.options)
        self._ground = self._grounds[self._towns[episode.id]]
        step = self._steps[episode.id]
        start_s = _EPOCH_S + self._number * _EPISODE_APART_S
        can_bus = self._folder / "can_bus"
        self._open = tuple(
            SceneTables(
                self._tables,
                episode,
                scene,
                CanBus(can_bus, self._names[scene.key]),
                start_s,
                step,
                self._ground.location,
            )
            for scene in scenes
        )
        for scene in self._open:
            self.files.callback(scene.can_bus.close)
        return SceneWriter(
            scenes=scenes,
            step=step,
            min_points=self.options.min_lidar_points,
            max_distance_m=self.options.max_distance_m or episode.spec.max_distance_m,
            shift_m=self._ground.shift_m,
            numbers=instance_numbers(episode, self.options.class_map) if self._labelled else {},
            labelled=self._labelled,
            surfaces=surface_sensors(episode),
            class_map=self.options.class_map,
            occupancy=self._occupancy_scene(episode),
        )

    def _occupancy_scene(self, episode: Episode) -> str | None:
        """The ego's scene, with its folder made, if the episode has voxels around the ego."""
        asked = episode.spec.labels.occupancy
        egos = [scene for scene in self._scenes[episode.id] if scene.car.is_ego]
        if asked is None or asked.frame != EGO or not egos:
            return None
        name = self._names[egos[0].key]
        (self._folder / OCC3D / name).mkdir(parents=True)
        return name

    def add(self, part: FramePart) -> None:
        """Write the frame's rows, linked to those before."""
        self._ground.surfaces.add(part.surfaces)
        self.sensors_left_out.update(self._without_scene)
        for scene, of_scene in zip(self._open, part.scenes, strict=True):
            scene.add(part.k, part.timestamp_s, of_scene)

    def end_episode(self) -> None:
        """Write the scenes, their logs and their instances."""
        for scene in self._open:
            scene.end(self._names[scene.scene.key])
        self._number += 1

    def finish(self) -> None:
        """Write maps and splits."""
        for name, ground in self._grounds.items():
            mask = ground.write(self._folder)
            on_map = [e for e in self._episodes if self._towns[e.id] == name]
            logs = [token(scene.key, "log") for e in on_map for scene in self._scenes[e.id]]
            self._tables.add(
                "map",
                {
                    "token": ground.mask_token,
                    "log_tokens": logs,
                    "category": "semantic_prior",
                    "filename": mask,
                    "carla_map": on_map[0].document["map"],
                    "global_from_enu_m": list(ground.shift_m),
                },
            )
        self.close()
        splits = {
            f"carstage_{split}": [
                self._names[scene.key]
                for e in self._episodes
                if self.split_of(e) == split
                for scene in self._scenes[e.id]
            ]
            for split in self.used_splits(self._episodes)
        }
        path = self._folder / VERSION / "splits.json"
        path.write_text(json.dumps(splits, indent=1) + "\n")
