"""The lines in pictures of an episode while it is converted."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from carstage.annotation import CameraImages
from carstage.annotation.labeller import FrameLabels
from carstage.annotation.rig import LabelledCamera
from carstage.errors import VectorMapError
from carstage.geometry import pose_matrix
from carstage.lane_lines import PictureView, TownLines, lines_in_view
from carstage.rawlog.reader import EpisodeLog


class LaneLineMaker:
    """Makes the rows of an episode's frames, each by itself.

    Args:
        log: the recording.
    """

    def __init__(self, log: EpisodeLog) -> None:
        opendrive = log.opendrive()
        self._town = None if opendrive is None else _town(opendrive)
        self._range_m = log.spec.max_distance_m
        cameras = (LabelledCamera.from_spec(s, {}) for s in log.spec.sensors if s.labelled)
        self._cameras = {camera.mount.sensor_id: camera for camera in cameras if camera.pinhole}

    def rows(
        self, k: int, labels: FrameLabels, images: Mapping[str, CameraImages]
    ) -> list[dict[str, Any]]:
        """Rows of ``lane_lines.parquet``.

        Args:
            k: index of the saved frame.
            labels: its rows.
            images: by labelled camera.
        """
        poses = {
            one["sensor_id"]: pose_matrix(one["location"], one["rotation_deg"])
            for one in labels.sensor_poses
        }
        found: list[dict[str, Any]] = []
        for name, camera in self._cameras.items():
            if name in images and self._town is not None:
                view = PictureView(camera.k, poses[name], images[name].depth_m, self._range_m)
                found += [
                    {"k": k, "sensor_id": name, **row} for row in lines_in_view(self._town, view)
                ]
        return found


@lru_cache(maxsize=2)
def _town(opendrive: bytes) -> TownLines | None:
    """The lines of a town, kept for its next segment; None where no map can be made of it."""
    from carstage.vector_map import vector_map  # reads XML: not loaded with the pool's libraries

    try:
        return TownLines.of(vector_map(opendrive))
    except VectorMapError:
        return None  # `make_vector_map` tells why
