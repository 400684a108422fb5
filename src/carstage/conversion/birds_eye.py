"""The bird's-eye grids of an episode while it is converted."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

from carstage.annotation import CameraImages
from carstage.annotation.labeller import FrameLabels
from carstage.annotation.rig import LabelledCamera
from carstage.birds_eye import (
    BirdsEye,
    CameraView,
    Cloud,
    Grid,
    GridPose,
    TownShapes,
    birds_eye_name,
    draw_birds_eye,
    pack_birds_eye,
)
from carstage.codecs import codec_for
from carstage.codecs.semantic_points import points_xyz
from carstage.errors import VectorMapError
from carstage.geometry import pose_matrix
from carstage.rawlog.reader import EpisodeLog, Record, WorldFrame
from carstage.sensor_kinds.model import CLOUDS
from carstage.spec import BirdsEyeSpec


class BirdsEyeMaker:
    """Makes the files of an episode's frames, each by itself.

    Args:
        log: the recording.
        asked: what the specification asks for.
    """

    def __init__(self, log: EpisodeLog, asked: BirdsEyeSpec) -> None:
        self._grid = Grid.of(asked)
        self._ego_id = int(log.header["ego_id"])
        opendrive = log.opendrive() if log.spec.labels.vector_map else None
        self._town = None if opendrive is None else _town(opendrive, asked.resolution_m)
        cameras = (LabelledCamera.from_spec(s, {}) for s in log.spec.sensors if s.labelled)
        self._codecs = {
            sensor.id: codec_for(sensor.kind)[1]
            for sensor in log.spec.written_sensors
            if sensor.content in CLOUDS
        }
        self._cameras = {camera.mount.sensor_id: camera for camera in cameras if camera.pinhole}

    @property
    def swept(self) -> tuple[str, ...]:
        """Streams whose points say what LiDARs see."""
        return tuple(self._codecs)

    def file(
        self,
        world: WorldFrame,
        k: int,
        labels: FrameLabels,
        images: Mapping[str, CameraImages],
        sweeps: Mapping[str, Record | None],
    ) -> tuple[str, bytes]:
        """Name and content of a frame's file.

        Args:
            world: the snapshot of its tick.
            k: index of the saved frame.
            labels: its rows.
            images: by labelled camera.
            sweeps: by stream of :attr:`swept`; None where the tick has none.
        """
        row = world.row(self._ego_id)
        x, y, z = world.location[row].tolist()
        pose = GridPose(x, y, z, float(world.rotation_deg[row][1]))
        poses = {
            one["sensor_id"]: pose_matrix(one["location"], one["rotation_deg"])
            for one in labels.sensor_poses
        }
        views = [
            CameraView(camera.k, poses[name], images[name].depth_m, camera.width, camera.height)
            for name, camera in self._cameras.items()
            if name in images
        ]
        seen = {one["track_id"] for one in labels.camera_objects if one["visible"]}
        clouds = [
            Cloud(poses[name], points_xyz(codec.raw_array(record.meta, record.payload)))
            for name, codec in self._codecs.items()
            if (record := sweeps[name]) is not None
        ]
        drawn = draw_birds_eye(self._grid, pose, self._town, labels.objects, seen, views, clouds)
        return birds_eye_name(k), pack_birds_eye(BirdsEye(self._grid, pose, drawn))


@lru_cache(maxsize=2)
def _town(opendrive: bytes, resolution_m: float) -> TownShapes | None:
    """The shapes of a town, kept for its next segment; None where no map can be made of it."""
    from carstage.vector_map import vector_map  # reads XML: not loaded with the pool's libraries

    try:
        town = vector_map(opendrive)
    except VectorMapError:
        return None  # `make_vector_map` tells why
    return TownShapes.of(town, resolution_m) if town.lanes else None
