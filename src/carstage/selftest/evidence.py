"""The raw log of a self-test as arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.annotation.point_sensors import record_dtype
from carstage.errors import RawLogError
from carstage.geometry import FloatArray, intrinsics, pose_matrix
from carstage.rawlog import format as raw
from carstage.rawlog.reader import ActorInfo, EpisodeLog, Record, WorldFrame

CAMERAS = ("rgb", "depth", "semantic", "instance", "flow")
LIDAR = "lidar"
GNSS = "gnss"


@dataclass(frozen=True, slots=True)
class Body:
    """Something that moves while the camera looks on.

    Attributes:
        info: what is static about it.
        world_from_box: ``(T, 4, 4)`` pose of its bounding box at each tick.
    """

    info: ActorInfo
    world_from_box: FloatArray

    @property
    def extent(self) -> FloatArray:
        """``(3,)`` half sizes of the box, m."""
        return self.info.box_extent


@dataclass(frozen=True, slots=True)
class Evidence:
    """What was recorded in ``T`` ticks; sensors that the server lacks have no entry.

    Attributes:
        header: the raw log's ``episode.json``.
        ledger: one row per tick.
        worlds: ``T`` snapshots.
        records: by sensor, its records in order.
        pictures: by camera, ``(T, H, W, 4)`` uint8 BGRA; ``flow``: ``(T, H, W, 2)`` float32.
        points: per tick ``(N, 3)`` of the LiDAR, as it delivers them.
        k: ``(3, 3)`` intrinsics of the cameras.
        world_from_camera: ``(T, 4, 4)`` as the snapshots have the depth camera's actor.
        world_from_lidar: ``(T, 4, 4)`` likewise.
        world_from_gnss: ``(T, 4, 4)`` likewise.
        world_from_ego: ``(T, 4, 4)``.
        vehicle: the vehicle ahead.
        walker: the walker; None where there is none.
    """

    header: Mapping[str, Any]
    ledger: list[dict[str, Any]]
    worlds: list[WorldFrame]
    records: Mapping[str, list[Record]]
    pictures: Mapping[str, NDArray[Any]]
    points: list[FloatArray]
    k: FloatArray
    world_from_camera: FloatArray
    world_from_lidar: FloatArray | None
    world_from_gnss: FloatArray | None
    world_from_ego: FloatArray
    vehicle: Body
    walker: Body | None

    @property
    def ticks(self) -> int:
        """``T``."""
        return len(self.worlds)

    @property
    def bodies(self) -> tuple[Body, ...]:
        """The vehicle and, where there is one, the walker."""
        return (self.vehicle,) if self.walker is None else (self.vehicle, self.walker)


def read_evidence(folder: Path) -> Evidence:
    """Read the log of a self-test.

    Raises:
        RawLogError: it is damaged, or lacks what every self-test has.
    """
    log = EpisodeLog(folder)
    header = log.header
    segments = log.sealed_segments(raw.WORLD)
    worlds = [world for segment in segments for world in log.world_frames(segment)]
    ids: Mapping[str, int] = header["sensor_actor_ids"]
    records = {
        name: [
            record
            for segment in segments
            for record in log.read_segment(name, segment)
            if record.kind == raw.KIND_DATA
        ]
        for name in ids
    }
    if not worlds or any(len(found) != len(worlds) for found in records.values()):
        counts = {name: len(found) for name, found in records.items()}
        raise RawLogError(
            f"The self-test's log has {len(worlds)} ticks and these frames: {counts}.",
            "The server lost sensor data: try again, then look at its log.",
        )
    meta = records["depth"][0].meta
    actors = log.actors()
    others = sorted(
        (actor for actor in actors.values() if actor.id != header["ego_id"]), key=lambda a: a.id
    )
    vehicles = [actor for actor in others if actor.type_id.startswith("vehicle.")]
    if not vehicles:
        raise RawLogError(
            "The self-test's vehicle is not in its log.", "There was no room for it: try again."
        )
    walkers = [actor for actor in others if actor.type_id.startswith("walker.")]
    return Evidence(
        header=header,
        ledger=log.ledger(),
        worlds=worlds,
        records=records,
        pictures={name: _pictures(name, records[name]) for name in CAMERAS if name in records},
        points=[_points(record) for record in records.get(LIDAR, ())],
        k=intrinsics(int(meta["width"]), int(meta["height"]), float(meta["fov_deg"])),
        world_from_camera=_poses(worlds, ids["depth"]),
        world_from_lidar=_poses(worlds, ids[LIDAR]) if LIDAR in ids else None,
        world_from_gnss=_poses(worlds, ids[GNSS]) if GNSS in ids else None,
        world_from_ego=_poses(worlds, int(header["ego_id"])),
        vehicle=_body(vehicles[0], worlds),
        walker=_body(walkers[0], worlds) if walkers else None,
    )


def _body(info: ActorInfo, worlds: list[WorldFrame]) -> Body:
    box = pose_matrix(info.box_location, info.box_rotation_deg)
    return Body(info, np.asarray(_poses(worlds, info.id) @ box, dtype=np.float64))


def _pictures(name: str, records: list[Record]) -> NDArray[Any]:
    dtype, channels = (np.dtype("<f4"), 2) if name == "flow" else (np.dtype(np.uint8), 4)
    return np.stack(
        [
            np.frombuffer(record.payload, dtype).reshape(
                int(record.meta["height"]), int(record.meta["width"]), channels
            )
            for record in records
        ]
    )


def _points(record: Record) -> FloatArray:
    found = np.frombuffer(record.payload, record_dtype(LIDAR))
    return np.stack([found["x"], found["y"], found["z"]], axis=-1).astype(np.float64)


def _poses(worlds: list[WorldFrame], actor_id: int) -> FloatArray:
    rows = [world.row(actor_id) for world in worlds]
    return pose_matrix(
        [world.location[row] for world, row in zip(worlds, rows, strict=True)],
        [world.rotation_deg[row] for world, row in zip(worlds, rows, strict=True)],
    )
