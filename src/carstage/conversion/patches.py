"""Patches in pictures of an episode while it is converted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from carstage.annotation import CameraImages
from carstage.annotation.labeller import FrameLabels
from carstage.annotation.patches import PatchView, faces_of, patch_in_view
from carstage.annotation.rig import LabelledCamera
from carstage.geometry import FloatArray, pose_matrix, rotation_matrix
from carstage.rawlog.reader import ActorInfo, EpisodeLog, WorldFrame
from carstage.spec.patches import PatchSpec, patch_corners, patch_place


@dataclass(frozen=True, slots=True)
class _Board:
    """A patch's board: its actor, who carries it, and the patch's corners on both faces."""

    patch: PatchSpec
    actor_id: int
    target_id: int
    corners: tuple[FloatArray, FloatArray]


class PatchMaker:
    """Makes the rows of an episode's frames, each by itself.

    Args:
        log: the recording.
        actors: what is static about everybody, by id.
    """

    def __init__(self, log: EpisodeLog, actors: Mapping[int, ActorInfo]) -> None:
        by_name = {patch.name: patch for patch in log.spec.patches}
        self._boards = [
            _board(by_name[entry["name"]], actors[entry["actor_id"]], entry["target_id"])
            for entry in log.header.get("patches", ())
            if entry["actor_id"] in actors
        ]
        self._range_m = log.spec.max_distance_m
        cameras = (LabelledCamera.from_spec(s, {}) for s in log.spec.sensors if s.labelled)
        self._cameras = {camera.mount.sensor_id: camera for camera in cameras if camera.pinhole}

    def rows(
        self,
        k: int,
        world: WorldFrame,
        labels: FrameLabels,
        images: Mapping[str, CameraImages],
    ) -> list[dict[str, Any]]:
        """Rows of ``patches.parquet``.

        Args:
            k: index of the saved frame.
            world: everybody in it.
            labels: its rows.
            images: by labelled camera.
        """
        poses = {
            one["sensor_id"]: pose_matrix(one["location"], one["rotation_deg"])
            for one in labels.sensor_poses
        }
        found = []
        for board in self._boards:
            at = np.flatnonzero(world.actor_id == board.actor_id)
            if not len(at):
                continue
            rotation = rotation_matrix(world.rotation_deg[at[0]])
            faces = faces_of(board.corners, rotation, world.location[at[0]])
            for name, camera in self._cameras.items():
                if name not in images:
                    continue
                view = PatchView(camera.k, poses[name], images[name].depth_m, self._range_m)
                for face, corners in zip(("front", "back"), faces, strict=True):
                    seen = patch_in_view(corners, view)
                    if seen is not None:
                        found.append({"k": k, "sensor_id": name, **_columns(board, face), **seen,
                                      "corners": corners.reshape(-1).tolist()})  # fmt: skip
        return found


def _columns(board: _Board, face: str) -> dict[str, Any]:
    return {
        "patch": board.patch.name,
        "target": board.patch.target,
        "shown": board.patch.is_shown,
        "actor_id": board.actor_id,
        "target_id": board.target_id,
        "face": face,
    }


def _board(patch: PatchSpec, actor: ActorInfo, target_id: int) -> _Board:
    extent, middle = actor.box_extent.tolist(), actor.box_location.tolist()
    place = patch_place(patch, extent)
    front, back = (np.array(patch_corners(place, middle, extent, face)) for face in (True, False))
    return _Board(patch, actor.id, target_id, (front, back))
