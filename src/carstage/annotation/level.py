"""The labelled objects of the level: placed once, and each frame those near enough."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from carstage.annotation.boxes import LabelBox, are_plausible_in_level
from carstage.annotation.classes import LEVEL_CLASSES
from carstage.annotation.scene import ActorFacts, Scene
from carstage.annotation.tracks import level_tracks
from carstage.geometry import FloatArray, box_corners, length, pose_matrix
from carstage.rawlog.reader import ActorInfo, LevelObject
from carstage.spec import GroundTruthSpec
from carstage.spec.vehicle_classes import VEHICLE_CLASSES
from carstage.tags import dataset_tags, vehicle_tags

_T = TypeVar("_T", bound=np.generic)


class Level:
    """``N`` level objects of an episode, ascending track; world frame, metres.

    Those whose box cannot be right have no place, and no row. A town may have ten thousand, of
    which an episode meets some hundred: facts are made for those alone.

    Args:
        objects: as recorded.
        server: its version, for the tags.
        ground_truth: without labels of vehicles parked ones have none either.

    Attributes:
        world_from_box: ``(N, 4, 4)``.
        extent: ``(N, 3)`` half sizes.
        corners: ``(N, 8, 3)``.
    """

    def __init__(
        self, objects: Sequence[LevelObject], server: str, ground_truth: GroundTruthSpec
    ) -> None:
        self._server = server
        self._class_of = {
            label: LEVEL_CLASSES.get(dataset_tags([label], server)[0])
            for label in sorted({found.label for found in objects})
        }
        wanted = [
            kind is not None and (ground_truth.vehicles or kind not in VEHICLE_CLASSES)
            for kind in (self._class_of[found.label] for found in objects)
        ]
        parked = [self._class_of[found.label] in VEHICLE_CLASSES for found in objects]
        location = np.array([found.box_location for found in objects]).reshape(-1, 3)
        extent = np.array([found.box_extent for found in objects]).reshape(-1, 3)
        rotation = np.array([found.box_rotation_deg for found in objects]).reshape(-1, 3)
        plausible = are_plausible_in_level(
            location, extent, rotation, np.array(parked, dtype=np.bool_)
        )
        tracks = np.array(level_tracks(found.id for found in objects), dtype=np.int64)
        chosen = np.flatnonzero(plausible & np.array(wanted, dtype=np.bool_))
        chosen = chosen[np.argsort(tracks[chosen])]
        self._objects = [objects[i] for i in chosen.tolist()]
        self._tracks: list[int] = tracks[chosen].tolist()
        self._facts: dict[int, ActorFacts] = {}
        self.extent: FloatArray = extent[chosen]
        self.world_from_box: FloatArray = pose_matrix(location[chosen], rotation[chosen])
        self.corners: FloatArray = box_corners(self.world_from_box, self.extent)

    def near(self, origins: FloatArray, max_distance_m: float) -> NDArray[np.int64]:
        """Which objects have their middle within a distance of one of ``(M, 3)`` places."""
        offset = self.world_from_box[:, None, :3, 3] - origins
        return np.flatnonzero((length(offset) <= max_distance_m).any(axis=1))

    def facts(self, chosen: NDArray[np.int64]) -> list[ActorFacts]:
        """Static facts of some objects."""
        for i in chosen.tolist():
            if i not in self._facts:
                self._facts[i] = self._facts_of(self._objects[i], self._tracks[i])
        return [self._facts[i] for i in chosen.tolist()]

    def added_to(self, scene: Scene, chosen: NDArray[np.int64]) -> Scene:
        """The scene, and some objects of the level after it; their pivot is their middle."""
        if not len(chosen):
            return scene
        facts = self.facts(chosen)
        poses, extent = self.world_from_box[chosen], self.extent[chosen]
        rotation = np.array([fact.box.rotation_deg for fact in facts])
        still = np.zeros((len(facts), 3))

        def both(here: NDArray[_T], more: NDArray[_T]) -> NDArray[_T]:
            return np.concatenate([here, more])

        return replace(
            scene,
            facts=[*scene.facts, *facts],
            location=both(scene.location, poses[:, :3, 3]),
            rotation_deg=both(scene.rotation_deg, rotation),
            velocity=both(scene.velocity, still),
            acceleration=both(scene.acceleration, still),
            angular_velocity_deg=both(scene.angular_velocity_deg, still),
            valid=both(scene.valid, np.ones(len(facts), dtype=np.bool_)),
            world_from_box=both(scene.world_from_box, poses),
            extent=both(scene.extent, extent),
            ground=both(scene.ground, -extent[:, 2]),
            corners=both(scene.corners, self.corners[chosen]),
        )

    def _facts_of(self, found: LevelObject, track: int) -> ActorFacts:
        kind = self._class_of[found.label] or ""
        tags = np.zeros(256, dtype=np.bool_)
        tags[found.label] = True
        if kind in VEHICLE_CLASSES:  # CARLA says Car of every vehicle actor that a level holds
            tags[sorted(vehicle_tags(self._server))] = True
        box = LabelBox("level", found.box_location, found.box_extent, found.box_rotation_deg)
        info = ActorInfo(
            id=track,
            type_id=found.name,
            parent=found.light,
            attributes={},
            semantic_tags=dataset_tags([found.label], self._server),
            box_location=box.location,
            box_extent=box.extent,
            box_rotation_deg=box.rotation_deg,
        )
        return ActorFacts(info, kind, box, tags, is_static=True)
