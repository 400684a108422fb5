"""The voxels of an episode while it is converted.

A segment leaves a part: what its frames show, and what each voxel is seen by. When all are there,
each segment's voxels are made of what all of them have shown. Exact voxels wait for nothing: a
frame's are in its own record.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.annotation.labeller import FrameLabels
from carstage.annotation.point_sensors import record_dtype
from carstage.conversion.tag_numbers import dataset_payload
from carstage.files.whole import whole_file
from carstage.geometry import FloatArray, pose_matrix
from carstage.occupancy import (
    Gathered,
    Occupancy,
    Picture,
    Placer,
    Sweep,
    VoxelGrid,
    exact_voxels,
    grid_from_world,
    occupancy_name,
    pack_occupancy,
)
from carstage.occupancy.gathering import Cells, Gathering
from carstage.occupancy.placing import ground_bounds
from carstage.occupancy.seeing import FINE, seen_voxels, surface
from carstage.rawlog.reader import EpisodeLog, Record, WorldFrame
from carstage.sensor_kinds.model import VOXELS
from carstage.spec import OccupancySpec
from carstage.spec.sensors import EGO

_CELLS = ("keys", "counts", "steps")


class VoxelFrames:
    """Where the voxels of an episode's frames are.

    Args:
        log: the recording.
        asked: what the specification asks for.
    """

    def __init__(self, log: EpisodeLog, asked: OccupancySpec) -> None:
        self.grid, self._frame = VoxelGrid.of(asked), asked.frame
        self._ego_id = int(log.header["ego_id"])

    def pose(self, world: WorldFrame, poses: Mapping[str, FloatArray]) -> FloatArray:
        """``(4, 4)`` pose of what the voxels are around.

        Args:
            world: the snapshot of the tick.
            poses: of sensors, ``(4, 4)`` in the world.
        """
        if self._frame != EGO:
            return poses[self._frame]
        row = world.row(self._ego_id)
        return pose_matrix(world.location[row], world.rotation_deg[row])


class ExactMaker:
    """Makes the exact voxels of frames.

    Args:
        log: the recording.
        asked: what the specification asks for.

    Attributes:
        stream: of the hidden sensor that says where surfaces are.
    """

    def __init__(self, log: EpisodeLog, asked: OccupancySpec) -> None:
        self._frames = VoxelFrames(log, asked)
        (sensor,) = log.spec.sensors_of(VOXELS)
        self.stream, self._kind = sensor.id, sensor.kind
        self._server = str(log.header["server_version"])

    def file(
        self,
        world: WorldFrame,
        k: int,
        labels: FrameLabels,
        poses: Mapping[str, FloatArray],
        seen: Sequence[Picture | Sweep],
        record: Record | None,
    ) -> tuple[str, bytes]:
        """Name and content of a frame's file; without a record nothing is known to be anywhere.

        Args:
            world, k, labels, poses, seen: as for :meth:`PartMaker.add`.
            record: of :attr:`stream`.
        """
        grid, pose = self._frames.grid, self._frames.pose(world, poses)
        matrix = grid_from_world(pose)
        swept = [surface(grid, matrix, one) if isinstance(one, Sweep) else None for one in seen]
        mask = seen_voxels(grid, matrix, seen, swept)
        points = np.zeros(0, record_dtype(self._kind))
        if record is not None:
            payload = dataset_payload(self._kind, self._server, record.payload)
            points = np.frombuffer(payload, points.dtype)
        voxels = exact_voxels(grid, pose, labels.objects, points)
        return occupancy_name(k), pack_occupancy(Occupancy(grid, pose, voxels, mask))


class PartMaker:
    """Takes the frames of one segment.

    Args:
        log: the recording.
        asked: what the specification asks for.
    """

    def __init__(self, log: EpisodeLog, asked: OccupancySpec) -> None:
        self._frames = VoxelFrames(log, asked)
        self._grid = self._frames.grid
        self._gathering = Gathering(self._grid)
        self._ks: list[int] = []
        self._poses: list[FloatArray] = []
        self._seen: list[NDArray[np.uint8]] = []

    def add(
        self,
        world: WorldFrame,
        k: int,
        labels: FrameLabels,
        poses: Mapping[str, FloatArray],
        seen: Sequence[Picture | Sweep],
    ) -> None:
        """Take a frame.

        Args:
            world: the snapshot of its tick.
            k: index of the saved frame.
            labels: its rows.
            poses: of sensors, ``(4, 4)`` in the world.
            seen: what they saw.
        """
        pose = self._frames.pose(world, poses)
        self._ks.append(k)
        self._poses.append(pose)
        self._seen.append(self._gathering.add(pose, labels.objects, seen))

    def write(self, path: Path) -> None:
        """Keep what the segment has shown; it is read a few times, so it is not compressed."""
        gathered = self._gathering.end()
        moving = gathered.moving
        parts = {-1: gathered.still, **moving}
        arrays: dict[str, Any] = {
            "ks": np.array(self._ks, np.int64),
            "poses": np.array(self._poses).reshape(-1, 4, 4),
            "seen": np.array(self._seen, np.uint8).reshape(-1, *self._grid.shape),
            "tracks": np.array(list(parts), np.int64),
            "lengths": np.array([len(cells.keys) for cells in parts.values()], np.int64),
            **{
                name: np.concatenate([getattr(cells, name) for cells in parts.values()])
                for name in _CELLS
            },
        }
        with whole_file(path) as temporary, temporary.open("wb") as file:
            np.savez(file, **arrays)


def part_path(folder: Path, segment: int) -> Path:
    """Where a segment's part is, below the folder of label parts."""
    return folder / f"{segment:06d}.occupancy.npz"


def occupancy_files(
    asked: OccupancySpec,
    folder: Path,
    segment: int,
    segments: int,
    objects: Mapping[int, Sequence[Mapping[str, Any]]],
) -> list[tuple[str, bytes]]:
    """Names and contents of the files of one segment's frames.

    Args:
        asked: what the specification asks for.
        folder: of label parts.
        segment: which.
        segments: how many there are.
        objects: rows of ``objects.parquet`` by frame.

    Raises:
        OSError, EOFError, KeyError, ValueError, BadZipFile: a part is gone or damaged.
    """
    grid = VoxelGrid.of(asked)
    with _loaded(part_path(folder, segment)) as own:
        ks, poses, seen = own["ks"].tolist(), own["poses"], own["seen"]
    if not ks:
        return []
    tracks = {row["track_id"] for k in ks for row in objects[k]}
    lows, highs = zip(*(ground_bounds(grid, pose) for pose in poses), strict=True)
    bounds = np.min(lows, axis=0), np.max(highs, axis=0)
    parts = [
        _read_part(part_path(folder, number), grid, bounds, tracks) for number in range(segments)
    ]
    placer = Placer(grid, Gathered.together(parts))
    files = []
    for k, pose, mask in zip(ks, poses, seen, strict=True):
        voxels = placer.place(pose, objects[k])
        files.append((occupancy_name(k), pack_occupancy(Occupancy(grid, pose, voxels, mask))))
    return files


@contextmanager
def _loaded(path: Path) -> Iterator[Mapping[str, NDArray[Any]]]:
    # Of a damaged file that it opened itself, numpy leaves the closing to the garbage collector.
    with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
        yield arrays


def _read_part(
    path: Path, grid: VoxelGrid, bounds: tuple[FloatArray, FloatArray], tracks: set[int]
) -> Gathered:
    """What a segment has shown of a place, and of some road users."""
    with _loaded(path) as part:
        all_cells = Cells(*(part[name] for name in _CELLS))
        ids, lengths = part["tracks"].tolist(), part["lengths"]
    ends = np.cumsum(lengths)
    cells = {
        track: Cells(*(getattr(all_cells, name)[begin:end] for name in _CELLS))
        for track, begin, end in zip(ids, (ends - lengths).tolist(), ends.tolist(), strict=True)
    }
    still = cells.pop(-1).between(*bounds, grid.side_m / FINE)
    return Gathered(still, {track: found for track, found in cells.items() if track in tracks})
