"""The labelled objects of the level: placed once, and each frame those near enough."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from carstage.annotation.boxes import level_box
from carstage.annotation.classes import LEVEL_CLASSES, VEHICLE_CLASSES
from carstage.annotation.scene import ActorFacts
from carstage.annotation.settings import LabelSettings
from carstage.annotation.tracks import level_tracks
from carstage.geometry import FloatArray, box_corners, pose_matrix
from carstage.rawlog.reader import ActorInfo, LevelObject
from carstage.tags import dataset_tags, vehicle_tags


class Level:
    """``N`` level objects of an episode, ascending track; world frame, metres.

    Those whose box cannot be right have no place, and no row.

    Args:
        objects: as recorded.
        server: its version, for the tags.
        settings: without labels of vehicles parked ones have none either.

    Attributes:
        facts: ``N`` static facts.
        world_from_box: ``(N, 4, 4)``.
        extent: ``(N, 3)`` half sizes.
        corners: ``(N, 8, 3)``.
    """

    def __init__(
        self, objects: Sequence[LevelObject], server: str, settings: LabelSettings
    ) -> None:
        tracks = level_tracks(found.id for found in objects)
        chosen = [
            fact
            for track, found in sorted(zip(tracks, objects, strict=True), key=lambda pair: pair[0])
            if (fact := _facts(found, track, server, settings)) is not None
        ]
        self.facts: list[ActorFacts] = chosen
        location = np.array([fact.box.location for fact in chosen]).reshape(-1, 3)
        rotation = np.array([fact.box.rotation_deg for fact in chosen]).reshape(-1, 3)
        self.extent: FloatArray = np.array([f.box.extent for f in chosen]).reshape(-1, 3)
        self.world_from_box: FloatArray = pose_matrix(location, rotation)
        self.corners: FloatArray = box_corners(self.world_from_box, self.extent)

    def near(self, origins: FloatArray, max_distance_m: float) -> NDArray[np.int64]:
        """Which objects have their middle within a distance of one of ``(M, 3)`` places."""
        offset = self.world_from_box[:, None, :3, 3] - origins
        return np.flatnonzero((np.linalg.norm(offset, axis=-1) <= max_distance_m).any(axis=1))


def _facts(
    found: LevelObject, track: int, server: str, settings: LabelSettings
) -> ActorFacts | None:
    """Facts of an object that is to be labelled, else None."""
    (tag,) = dataset_tags([found.label], server)
    kind = LEVEL_CLASSES.get(tag)
    if kind is None or (kind in VEHICLE_CLASSES and not settings.vehicles):
        return None
    box = level_box(found, kind)
    if not box.valid:
        return None
    tags = np.zeros(256, dtype=np.bool_)
    tags[found.label] = True
    if kind in VEHICLE_CLASSES:  # CARLA says Car of every vehicle actor that a level holds
        tags[sorted(vehicle_tags(server))] = True
    info = ActorInfo(
        id=track,
        type_id=found.name,
        parent=found.light,
        attributes={},
        semantic_tags=(tag,),
        box_location=box.location,
        box_extent=box.extent,
        box_rotation_deg=box.rotation_deg,
    )
    return ActorFacts(info, kind, box, tags, is_static=True)
