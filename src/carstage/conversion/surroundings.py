"""What labels say of the surroundings: bird's-eye grids, and the parts that voxels come of.

What makes them is imported where they are asked for.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from carstage.annotation import CameraImages
from carstage.annotation.decoding import decode_instance_bgra
from carstage.annotation.labeller import FrameLabels
from carstage.annotation.rig import LabelledCamera
from carstage.codecs import codec_for
from carstage.codecs.semantic_points import points_xyz
from carstage.conversion.tag_numbers import dataset_payload, dataset_tag_image
from carstage.geometry import FloatArray, pose_matrix
from carstage.rawlog.reader import EpisodeLog, Record, WorldFrame
from carstage.sensor_kinds.model import CLOUDS, TAGGED_POINTS
from carstage.spec import BirdsEyeSpec, OccupancySpec

if TYPE_CHECKING:
    from carstage.conversion.birds_eye import BirdsEyeMaker
    from carstage.conversion.occupancy import ExactMaker, PartMaker
    from carstage.occupancy import Picture, Sweep


class Surroundings:
    """Takes the frames of one segment.

    Args:
        log: the recording.
    """

    def __init__(self, log: EpisodeLog) -> None:
        asked = log.spec.labels
        self._grids = _grids(log, asked.birds_eye)
        self._voxels, self._exact = _voxels(log, asked.occupancy)
        self._server = str(log.header["server_version"])
        cameras = (LabelledCamera.from_spec(s, {}) for s in log.spec.sensors if s.labelled)
        self._cameras = {camera.mount.sensor_id: camera for camera in cameras if camera.pinhole}
        lidars = [s for s in log.spec.written_sensors if s.content in CLOUDS and self.asked]
        self._lidars = tuple(sensor.id for sensor in lidars)
        self._tagged = {s.id: s.kind for s in lidars if s.content == TAGGED_POINTS}

    @property
    def asked(self) -> bool:
        """Whether there is anything to be made of them."""
        return any(one is not None for one in (self._grids, self._voxels, self._exact))

    @property
    def swept(self) -> tuple[str, ...]:
        """Streams whose tagged points say what LiDARs see, or which voxels are occupied."""
        return (*self._tagged, *(() if self._exact is None else (self._exact.stream,)))

    def files(
        self,
        world: WorldFrame,
        k: int,
        labels: FrameLabels,
        images: Mapping[str, CameraImages],
        clouds: Mapping[str, NDArray[np.float32]],
        sweeps: Mapping[str, Record | None],
    ) -> list[tuple[str, bytes]]:
        """Names and contents of a frame's files; gathered voxels come when all segments are there.

        Args:
            world: the snapshot of its tick.
            k: index of the saved frame.
            labels: its rows.
            images: by labelled camera.
            clouds: points by LiDAR; one that the tick lacks has none.
            sweeps: by stream of :attr:`swept`; None where the tick has none.
        """
        if not self.asked:
            return []
        poses = {
            one["sensor_id"]: pose_matrix(one["location"], one["rotation_deg"])
            for one in labels.sensor_poses
        }
        seen: list[Picture | Sweep] = [*self._pictures(poses, images)]
        seen += self._sweeps(poses, clouds, sweeps)
        if self._voxels is not None:
            self._voxels.add(world, k, labels, poses, seen)
        files = [] if self._grids is None else [self._grids.file(world, k, labels, seen)]
        if self._exact is not None:
            record = sweeps[self._exact.stream]
            files.append(self._exact.file(world, k, labels, poses, seen, record))
        return files

    def end(self, folder: Path, segment: int) -> None:
        """Write what voxels come of to a part file, where they are asked for."""
        if self._voxels is not None:
            from carstage.conversion.occupancy import part_path

            self._voxels.write(part_path(folder, segment))

    def _pictures(
        self, poses: Mapping[str, FloatArray], images: Mapping[str, CameraImages]
    ) -> Iterator[Picture]:
        from carstage.birds_eye import CameraView
        from carstage.occupancy import Picture

        for name, camera in self._cameras.items():
            if name in images:
                image = images[name]
                size = camera.width, camera.height
                view = CameraView(camera.k, poses[name], image.depth_m, *size)
                yield Picture(view, self._tags(image) if self._voxels is not None else None)

    def _tags(self, image: CameraImages) -> NDArray[np.uint8] | None:
        if image.instance_bgra is None:
            return None
        return dataset_tag_image(self._server, decode_instance_bgra(image.instance_bgra)[1])

    def _sweeps(
        self,
        poses: Mapping[str, FloatArray],
        clouds: Mapping[str, NDArray[np.float32]],
        sweeps: Mapping[str, Record | None],
    ) -> Iterator[Sweep]:
        from carstage.birds_eye import Cloud
        from carstage.occupancy import Sweep

        for name in self._lidars:
            points: NDArray[Any] | None = clouds.get(name)
            record = sweeps[name] if name in self._tagged else None
            if record is not None:
                kind = self._tagged[name]
                payload = dataset_payload(kind, self._server, record.payload)
                points = codec_for(kind)[1].raw_array(record.meta, payload)
            if points is not None:
                yield Sweep(Cloud(poses[name], points_xyz(points)), point_tags(points))


def _grids(log: EpisodeLog, asked: BirdsEyeSpec | None) -> BirdsEyeMaker | None:
    if asked is None:
        return None
    from carstage.conversion.birds_eye import BirdsEyeMaker

    return BirdsEyeMaker(log, asked)


def _voxels(
    log: EpisodeLog, asked: OccupancySpec | None
) -> tuple[PartMaker | None, ExactMaker | None]:
    """What makes voxels of what is seen, or exact ones."""
    if asked is None:
        return None, None
    from carstage.conversion.occupancy import ExactMaker, PartMaker

    return (None, ExactMaker(log, asked)) if asked.exact else (PartMaker(log, asked), None)


def point_tags(points: NDArray[Any]) -> NDArray[np.uint8] | None:
    """``(N,)`` tags of a semantic LiDAR's points; None: it is an ordinary one."""
    return None if points.dtype.names is None else points["object_tag"].astype(np.uint8)
