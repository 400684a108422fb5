"""The bird's-eye grids of an episode while it is converted."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

from carstage.annotation.labeller import FrameLabels
from carstage.birds_eye import (
    BirdsEye,
    Grid,
    GridPose,
    TownShapes,
    birds_eye_name,
    draw_birds_eye,
    pack_birds_eye,
)
from carstage.errors import VectorMapError
from carstage.occupancy import Picture, Sweep
from carstage.rawlog.reader import EpisodeLog, WorldFrame
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

    def file(
        self, world: WorldFrame, k: int, labels: FrameLabels, seen: Sequence[Picture | Sweep]
    ) -> tuple[str, bytes]:
        """Name and content of a frame's file.

        Args:
            world: the snapshot of its tick.
            k: index of the saved frame.
            labels: its rows.
            seen: what its sensors saw.
        """
        row = world.row(self._ego_id)
        x, y, z = world.location[row].tolist()
        pose = GridPose(x, y, z, float(world.rotation_deg[row][1]))
        tracks = {one["track_id"] for one in labels.camera_objects if one["visible"]}
        drawn = draw_birds_eye(
            self._grid,
            pose,
            self._town,
            labels.objects,
            tracks,
            [one.view for one in seen if isinstance(one, Picture)],
            [one.cloud for one in seen if isinstance(one, Sweep)],
        )
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
