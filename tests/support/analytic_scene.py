"""A raw log without a simulator: a plane and boxes, ray-traced exactly, so that all data agree.

Every object fills its box, so that depth, ids, points and labels follow from one another.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.codecs import SEMANTIC_POINT
from carstage.rawlog import format as raw
from carstage.rawlog import writing
from carstage.sensor_kinds import sensor_kind

DEPTH_CODES = 2**24 - 1
ROAD, BUILDING, LIGHT, SKY, WALKER, CAR, TRUCK = 1, 3, 7, 11, 12, 14, 15
RGB = {ROAD: (90, 90, 95), BUILDING: (150, 120, 100), SKY: (150, 190, 230)}
RGB |= {LIGHT: (230, 200, 40), WALKER: (200, 60, 60), CAR: (40, 70, 160), TRUCK: (60, 120, 80)}


@dataclass(frozen=True)
class Solid:
    """A box that moves along its heading; ``actor_id`` 0 is part of the map."""

    actor_id: int
    type_id: str
    tag: int
    center: tuple[float, float, float]
    yaw_deg: float
    extent: tuple[float, float, float]
    speed: float = 0.0
    attributes: dict[str, str] = field(default_factory=dict)

    def pose(self, time_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Rotation (world from box) and centre at a time."""
        yaw = np.radians(self.yaw_deg)
        c, s = np.cos(yaw), np.sin(yaw)
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return rotation, np.array(self.center) + self.speed * time_s * rotation[:, 0]


MAP = Solid(0, "world", 0, (0.0, 0.0, 0.0), 0.0, (0.0, 0.0, 0.0))
"""What carries a sensor that stands on the map."""
EGO = Solid(
    41,
    "vehicle.tesla.model3",
    CAR,
    (0.0, 0.0, 0.75),
    8.0,
    (2.3, 0.95, 0.75),
    5.0,
    {"base_type": "car", "role_name": "hero"},
)
SOLIDS = (
    Solid(
        50,
        "vehicle.audi.a2",
        CAR,
        (14.0, 1.0, 0.8),
        20.0,
        (1.9, 0.9, 0.8),
        4.0,
        {"base_type": "car", "role_name": "autopilot"},
    ),
    Solid(
        51,
        "vehicle.carlamotors.firetruck",
        TRUCK,
        (24.0, 8.0, 1.9),
        -70.0,
        (4.2, 1.4, 1.9),
        2.0,
        {"base_type": "truck", "special_type": "emergency"},
    ),
    Solid(
        60,
        "walker.pedestrian.0001",
        WALKER,
        (9.0, -3.0, 0.95),
        90.0,
        (0.4, 0.4, 0.95),
        1.2,
        {"age": "adult"},
    ),
    Solid(0, "building", BUILDING, (40.0, -12.0, 5.0), 0.0, (8.0, 5.0, 5.0)),
    Solid(0, "Parked_1", CAR, (18.0, -7.0, 0.8), 5.0, (2.1, 0.9, 0.8)),
    Solid(0, "Light_1", LIGHT, (20.0, 5.0, 4.2), 8.0, (0.3, 0.4, 0.8)),
)
OPENDRIVE = """<?xml version="1.0" standalone="yes"?>
<OpenDRIVE>
  <header revMajor="1" revMinor="4" name="Analytic01"/>
</OpenDRIVE>
"""
LEVEL_IDS = {"Parked_1": 3, "Light_1": 2**63 + 9}
"""Solids of the map that a server tells of as level objects; CARLA's ids have 64 bits."""
LIGHT_ACTOR = 30
LARGE_ID = 2**31 + 9
DETECTIONS = np.array([[-5.0, 0.1, 0.05, 30.0], [2.0, -0.2, -0.1, 12.0]], "<f4")
"""What a radar finds: range rate (m/s), azimuth to the right, altitude (rad), depth (m)."""
_POSE = {"x_m": 1.5, "y_m": 0.0, "z_m": 1.6, "roll_deg": 0.0, "pitch_deg": 0.0, "yaw_deg": 0.0}
_LEFT = {"x_m": 0.5, "y_m": -0.8, "z_m": 1.7, "roll_deg": 0.0, "pitch_deg": -5.0, "yaw_deg": -55.0}
_TOP = {"x_m": 0.0, "y_m": 0.0, "z_m": 2.0, "roll_deg": 0.0, "pitch_deg": 0.0, "yaw_deg": 0.0}


def _camera(
    name: str, kind: str, pose: dict[str, float], size: tuple[int, int], **more: Any
) -> dict[str, Any]:
    blueprints = {
        "semantic": "semantic_segmentation",
        "instance": "instance_segmentation",
        "flow": "optical_flow",
    }
    return {
        "id": name,
        "kind": kind,
        "blueprint": f"sensor.camera.{blueprints.get(kind, kind)}",
        "hidden": False,
        "labelled": False,
        "pose": pose,
        "attributes": {
            "image_size_x": str(size[0]),
            "image_size_y": str(size[1]),
            "fov": "90.0",
        },
        "depth": None,
        "instance": None,
        **more,
    }


def spec(
    *,
    steps: int = 6,
    save_every: int = 1,
    size: tuple[int, int] = (96, 64),
    mode: str = "sync",
    segmentation: bool = False,
    every_kind: bool = False,
) -> dict[str, Any]:
    """The spec of the episode: two labelled cameras, one with hidden twins, and other kinds.

    With ``segmentation`` the LiDAR has a semantic twin, and another car a camera and a semantic
    LiDAR. With ``every_kind``: all kinds that Car-STAGE brings.
    """

    def other(name: str, kind: str, pose: dict[str, float], **more: Any) -> dict[str, Any]:
        blueprint = sensor_kind(kind).blueprint
        return {
            "id": name,
            "kind": kind,
            "blueprint": blueprint,
            "hidden": False,
            "labelled": False,
            "pose": pose,
            "attributes": {},
            "depth": None,
            "instance": None,
            **more,
        }

    twins = {"labelled": True, "depth": "DEPTH_FRONT", "instance": "INST_FRONT"}
    rest = (
        _camera("FLOW_FRONT", "flow", _POSE, size),
        _camera("NORMALS_LEFT", "normals", _LEFT, size),
        other("SEMLIDAR_TOP", "semantic_lidar", _TOP),
        other("RADAR_LEFT", "radar", _LEFT),
    )
    hidden = {"labelled": True, "depth": "CAM_LEFT.depth", "instance": "CAM_LEFT.instance"}
    audi = {"attach_to": SOLIDS[0].type_id}
    names = {"depth": "CAM_AUDI.depth", "instance": "CAM_AUDI.instance"}
    more = [
        other("SEMANTIC_TOP", "semantic_lidar", _TOP),
        other("SEMANTIC_AUDI", "semantic_lidar", _TOP, **audi),
        _camera("CAM_AUDI", "rgb", _POSE, size, labelled=True, **names, **audi),
        *(_camera(id_, kind, _POSE, size, hidden=True, **audi) for kind, id_ in names.items()),
    ]
    return {
        "spec_version": 1, "dialect": "0.9.16", "index": 0, "map": "Analytic01",
        "weather": {"preset": "ClearNoon", "parameters": {}, "lights": "auto"},
        "steps": steps, "fps": 10.0, "save_every": save_every, "warmup_ticks": 5,
        "timing": {"mode": mode, "sensor_sync": True, "max_substep_delta_time_s": 0.01,
                   "max_substeps": 10, "on_incomplete": "wait"},
        "vehicles": {"count": 2, "filter": "vehicle.*"},
        "pedestrians": {"count": 1, "filter": "walker.pedestrian.*"},
        "traffic": {},
        "ego": {"blueprint": EGO.type_id, "spawn_index": 0},
        "scenario": {"kind": "autopilot"},
        "sensors": [
            _camera("CAM_FRONT", "rgb", _POSE, size, **twins),
            _camera("CAM_LEFT", "rgb", _LEFT, size, **hidden),
            _camera("DEPTH_FRONT", "depth", _POSE, size),
            _camera("SEM_FRONT", "semantic", _POSE, size),
            _camera("INST_FRONT", "instance", _POSE, size),
            _camera("CAM_LEFT.depth", "depth", _LEFT, size, hidden=True),
            _camera("CAM_LEFT.instance", "instance", _LEFT, size, hidden=True),
            other("LIDAR_TOP", "lidar", _TOP),
            other("IMU", "imu", _TOP),
            other("GNSS", "gnss", _TOP),
            *(more if segmentation else ()),
            *(rest if every_kind else ()),
        ],
        "labels": {"method": "both", "boxes": ["2d", "3d"]},
        "ground_truth": {"vehicles": True, "pedestrians": True, "ego_motion": True},
        "max_distance_m": 80.0, "min_lidar_points": 5,
        "seeds": {"traffic_manager": 1, "walkers": 2, "spawn": 3, "ego": 4, "sensor_noise": 5,
                  "driving": 6},
    }  # fmt: skip


def header(episode_spec: dict[str, Any], *, attempt: str, ticks_per_segment: int) -> dict[str, Any]:
    """The raw log's ``episode.json``."""
    return {
        "format_version": 1, "episode_id": "0123456789abcdef", "attempt": attempt,
        "spec": episode_spec, "ticks_per_segment": ticks_per_segment,
        "ticks": episode_spec["steps"], "client_version": "0.9.16", "server_version": "0.9.16",
        "map": "Carla/Maps/Analytic01",
        "geo_reference": {"latitude_deg": 0.0, "longitude_deg": 0.0},
        "ego_id": EGO.actor_id,
        "sensor_actor_ids": {s["id"]: 100 + i for i, s in enumerate(episode_spec["sensors"])},
        "sensor_carrier_ids": {s["id"]: carrier_of(s).actor_id for s in episode_spec["sensors"]},
        "first_frame": 12, "first_timestamp_s": 1.1,
        "requested": {"vehicles": 2, "pedestrians": 1},
        "spawned": {"vehicles": 2, "pedestrians": 1},
    }  # fmt: skip


def cast(
    origin: NDArray[np.float64],
    directions: NDArray[np.float64],
    time_s: float,
    solids: tuple[Solid, ...] = SOLIDS,
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Ray parameters of the nearest hits (inf: none) and indices into solids, -1 for the road."""
    with np.errstate(divide="ignore", invalid="ignore"):
        nearest = np.where(directions[..., 2] < 0.0, -origin[2] / directions[..., 2], np.inf)
        hit = np.full(nearest.shape, -1)
        for index, solid in enumerate(solids):
            rotation, center = solid.pose(time_s)
            start, along = rotation.T @ (origin - center), directions @ rotation
            bounds = np.stack([(sign * np.array(solid.extent) - start) / along for sign in (-1, 1)])
            enter = np.nanmax(bounds.min(axis=0), axis=-1)
            leave = np.nanmin(bounds.max(axis=0), axis=-1)
            found = (enter < leave) & (enter > 0.0) & (enter < nearest)
            nearest, hit = np.where(found, enter, nearest), np.where(found, index, hit)
    return nearest, hit


def carrier_of(sensor: dict[str, Any]) -> Solid:
    """What a sensor of the spec sits on."""
    name = sensor.get("attach_to", "ego")
    return EGO if name == "ego" else next(s for s in (MAP, *SOLIDS) if s.type_id == name)


def world_from_sensor(
    pose: dict[str, float], time_s: float, carrier: Solid = EGO
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotation and origin of a sensor on a vehicle (pitch and yaw only)."""
    pitch, yaw = np.radians(pose["pitch_deg"]), np.radians(pose["yaw_deg"])
    cp, sp, cy, sy = np.cos(pitch), np.sin(pitch), np.cos(yaw), np.sin(yaw)
    local = np.array([[cp * cy, -sy, -cy * sp], [cp * sy, cy, -sy * sp], [sp, 0.0, cp]])
    rotation, center = carrier.pose(time_s)
    pivot = center - np.array([0.0, 0.0, carrier.extent[2]])
    return rotation @ local, pivot + rotation @ [pose["x_m"], pose["y_m"], pose["z_m"]]


def image(kind: str, sensor: dict[str, Any], time_s: float) -> NDArray[np.uint8]:
    """A camera's BGRA picture; those beside the ego show it too."""
    carrier = carrier_of(sensor)
    solids = SOLIDS if carrier is EGO else (*SOLIDS, EGO)
    width = int(sensor["attributes"]["image_size_x"])
    height = int(sensor["attributes"]["image_size_y"])
    focal = width / 2.0 / np.tan(np.radians(float(sensor["attributes"]["fov"])) / 2.0)
    u, v = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    right, down = (u - width / 2) / focal, (v - height / 2) / focal
    rays = np.stack([np.ones_like(u), right, -down], axis=-1)  # x = 1: the parameter is depth
    rotation, origin = world_from_sensor(sensor["pose"], time_s, carrier)
    depth, hit = cast(origin, rays @ rotation.T, time_s, solids)
    tags = np.array([*(s.tag for s in solids), ROAD])[hit]
    tags[np.isinf(depth)] = SKY
    pixels = np.zeros((height, width, 4), np.uint8)
    pixels[..., 3] = 255
    if kind == "depth":
        code = np.round(np.minimum(depth, 1000.0) / 1000.0 * DEPTH_CODES).astype(np.uint32)
        for channel, shift in ((2, 0), (1, 8), (0, 16)):
            pixels[..., channel] = code >> shift & 255
    elif kind in ("semantic", "instance"):
        pixels[..., 2] = tags
        if kind == "instance":
            ids = np.array([*(s.actor_id for s in solids), 0])[hit]
            pixels[..., 1], pixels[..., 0] = ids & 255, ids >> 8
    else:
        colours = np.zeros((256, 3), np.float64)
        for tag, rgb in RGB.items():
            colours[tag] = rgb
        shade = np.where(np.isinf(depth), 1.0, np.exp(-np.minimum(depth, 1000.0) / 80.0))
        pixels[..., 2::-1] = (colours[tags] * shade[..., None]).astype(np.uint8)
    return pixels


def sweep(
    pose: dict[str, float], time_s: float, carrier: Solid = EGO
) -> tuple[NDArray[np.float32], list[int]]:
    """One LiDAR turn: points and counts per channel."""
    points, _, counts = _turn(pose, time_s, carrier)
    intensity = np.exp(-0.004 * np.linalg.norm(points, axis=1))
    return np.column_stack([points, intensity]).astype("<f4"), counts


def semantic_sweep(
    pose: dict[str, float], time_s: float, carrier: Solid = EGO
) -> tuple[NDArray[Any], list[int]]:
    """One turn of a semantic LiDAR, along the rays of ``sweep``."""
    points, hit, counts = _turn(pose, time_s, carrier)
    rows = np.zeros(len(points), SEMANTIC_POINT)
    for axis, name in enumerate("xyz"):
        rows[name] = points[:, axis]
    rows["cos_incidence"] = 1.0
    rows["object_tag"] = np.array([*(s.tag for s in SOLIDS), ROAD])[hit]
    # An id of 32 bits, which no actor has.
    ids = [LARGE_ID if s.tag == BUILDING else s.actor_id for s in SOLIDS]
    rows["object_idx"] = np.array([*ids, 0])[hit]
    return rows, counts


def _turn(
    pose: dict[str, float], time_s: float, carrier: Solid
) -> tuple[NDArray[np.float64], NDArray[np.int64], list[int]]:
    """Points, indices into SOLIDS (-1: the road), and points per channel."""
    azimuth = np.radians(np.arange(-180.0, 180.0, 2.0))
    rotation, origin = world_from_sensor(pose, time_s, carrier)
    channels, hits = [], []
    for elevation in np.radians(np.linspace(8.0, -24.0, 16)):
        level = np.cos(elevation)
        rays = np.stack(
            [
                level * np.cos(azimuth),
                level * np.sin(azimuth),
                np.full_like(azimuth, np.sin(elevation)),
            ],
            axis=-1,
        )
        distance, hit = cast(origin, rays @ rotation.T, time_s)
        kept = distance < 60.0
        channels.append(rays[kept] * distance[kept, None])
        hits.append(hit[kept])
    return np.concatenate(channels), np.concatenate(hits), [len(channel) for channel in channels]


def flow(width: int, height: int) -> NDArray[np.float32]:
    """``(H, W, 2)`` shares of half the image, x right and y up, different in every pixel."""
    steps = np.arange(width * height * 2, dtype="<f4").reshape(height, width, 2)
    return (steps / steps.size - 0.5).astype("<f4")


def _actor_row(solid: Solid) -> dict[str, Any]:
    walker = solid.type_id.startswith("walker")
    return {
        "id": solid.actor_id, "type_id": solid.type_id, "parent": 0,
        "attributes": solid.attributes, "semantic_tags": [solid.tag],
        "box": {
            "location": [0.0, 0.0, 0.0 if walker else solid.extent[2]],
            "extent": list(solid.extent), "rotation_deg": [0.0, 0.0, 0.0],
        },
    }  # fmt: skip


def _level_rows() -> list[dict[str, Any]]:
    return [
        {
            "id": LEVEL_IDS[solid.type_id], "name": solid.type_id, "label": solid.tag,
            "light": LIGHT_ACTOR if solid.tag == LIGHT else 0,
            "box": {"location": list(solid.center), "extent": list(solid.extent),
                    "rotation_deg": [0.0, solid.yaw_deg, 0.0]},
        }
        for solid in SOLIDS
        if solid.type_id in LEVEL_IDS
    ]  # fmt: skip


def _actor_bytes(solid: Solid, time_s: float) -> bytes:
    rotation, center = solid.pose(time_s)
    walker = solid.type_id.startswith("walker")
    pivot = center - np.array([0.0, 0.0, 0.0 if walker else solid.extent[2]])
    velocity = solid.speed * rotation[:, 0]
    return raw.ACTOR_RECORD.pack(
        solid.actor_id, 0, *pivot, 0.0, solid.yaw_deg, 0.0, *velocity, *[0.0] * 6
    )


def _sensor_row(sensor: dict[str, Any], ids: dict[str, int]) -> dict[str, Any]:
    return {
        "id": ids[sensor["id"]], "type_id": sensor["blueprint"],
        "parent": carrier_of(sensor).actor_id, "attributes": {}, "semantic_tags": [],
        "box": {"location": [0.0] * 3, "extent": [0.0] * 3, "rotation_deg": [0.0] * 3},
    }  # fmt: skip


def _sensor_bytes(sensor: dict[str, Any], ids: dict[str, int], time_s: float) -> bytes:
    """Where a sensor on another car is, turned about the vertical alone."""
    carrier = carrier_of(sensor)
    _, origin = world_from_sensor(sensor["pose"], time_s, carrier)
    yaw_deg = carrier.yaw_deg + sensor["pose"]["yaw_deg"]
    place = (*origin, 0.0, yaw_deg, 0.0)
    return raw.ACTOR_RECORD.pack(ids[sensor["id"]], 0, *place, *[0.0] * 9)


def write_raw_log(
    folder: Path,
    *,
    steps: int = 6,
    save_every: int = 1,
    ticks_per_segment: int = 3,
    size: tuple[int, int] = (96, 64),
    attempt: str = "a1",
    segments: int | None = None,
    mode: str = "sync",
    period_s: float = 0.1,
    segmentation: bool = False,
    every_kind: bool = False,
) -> dict[str, Any]:
    """Write a raw log as the collector would.

    Args:
        folder: the attempt's folder.
        segments: stop after so many segments, as if the recording had been killed.
        mode: ``sync`` or ``async``.
        period_s: time between ticks; the spec says 0.1 s.
        segmentation: with semantic LiDARs and sensors on another car.
        every_kind: whether the rig has all kinds of sensors.

    Returns:
        The header.
    """
    document = header(
        spec(
            steps=steps,
            save_every=save_every,
            size=size,
            mode=mode,
            segmentation=segmentation,
            every_kind=every_kind,
        ),
        attempt=attempt,
        ticks_per_segment=ticks_per_segment,
    )
    sensors = document["spec"]["sensors"]
    folder.mkdir(parents=True)
    document["map_crc32"] = writing.write_map_file(str(folder), OPENDRIVE)
    writing.write_episode_file(str(folder), document)
    names = [*(sensor["id"] for sensor in sensors), raw.WORLD, raw.LEDGER]
    streams = {name: writing.StreamWriter(str(folder), name, ticks_per_segment) for name in names}
    cast_solids = sorted([EGO, *(s for s in SOLIDS if s.actor_id)], key=lambda s: s.actor_id)
    ids = document["sensor_actor_ids"]
    afield = [sensor for sensor in sensors if carrier_of(sensor) is not EGO]
    for tick in range(steps):
        if segments is not None and tick >= segments * ticks_per_segment:
            break
        time_s, frame = tick * period_s, 12 + tick
        stamp = (tick, frame, 1.1 + time_s)
        if tick == 0:
            rows = [_actor_row(solid) for solid in cast_solids]
            rows += [_sensor_row(sensor, ids) for sensor in afield]
            table = {"actors": rows, "level_objects": _level_rows()}
            streams[raw.WORLD].append(raw.KIND_TABLE, *stamp, table)
        streams[raw.WORLD].append(
            raw.KIND_DATA, *stamp, _world_meta(),
            b"".join(
                [
                    *(_actor_bytes(solid, time_s) for solid in cast_solids),
                    *(_sensor_bytes(sensor, ids, time_s) for sensor in afield),
                ]
            ),
        )  # fmt: skip
        for sensor in sensors:
            meta, payload = _sensor_data(sensor, time_s)
            streams[sensor["id"]].append(raw.KIND_DATA, *stamp, meta, payload)
        state = {"state": "ok", "reason": None, "wait_s": 0.01 * tick}
        k = tick // save_every if tick % save_every == 0 else None
        streams[raw.LEDGER].append(
            raw.KIND_DATA, *stamp,
            {"k": k, "sensors": {s["id"]: state for s in sensors}, "tick_s": 0.05},
        )  # fmt: skip
        if (tick + 1) % ticks_per_segment == 0 or tick == steps - 1:
            for stream in streams.values():
                stream.seal(tick)
    for stream in streams.values():
        stream.close()
    return document


def _world_meta() -> dict[str, Any]:
    return {
        "delta_s": 0.1, "weather": {"cloudiness": 10.0, "sun_altitude_angle": 60.0},
        "ego": {"id": EGO.actor_id, "throttle": 0.4, "steer": 0.0, "brake": 0.0,
                "hand_brake": False, "reverse": False, "gear": 2, "speed_limit_kmh": 50.0,
                "traffic_light_state": "Green"},
        "vehicle_lights": {"41": 0, "50": 0, "51": 0}, "traffic_lights": {str(LIGHT_ACTOR): "Red"},
    }  # fmt: skip


def _sensor_data(sensor: dict[str, Any], time_s: float) -> tuple[dict[str, Any], bytes]:
    if sensor["kind"] == "flow":
        width, height = (int(sensor["attributes"][f"image_size_{axis}"]) for axis in "xy")
        return {"width": width, "height": height, "fov_deg": 90.0}, flow(width, height).tobytes()
    if sensor["blueprint"].startswith("sensor.camera."):
        pixels = image(sensor["kind"], sensor, time_s)
        height, width = pixels.shape[:2]
        return {"width": width, "height": height, "fov_deg": 90.0}, pixels.tobytes()
    if sensor["kind"] in ("lidar", "semantic_lidar"):
        turn = sweep if sensor["kind"] == "lidar" else semantic_sweep
        points, counts = turn(sensor["pose"], time_s, carrier_of(sensor))
        return {"horizontal_angle_rad": 0.0, "counts": counts}, points.tobytes()
    if sensor["kind"] == "radar":
        return {}, DETECTIONS.tobytes()
    if sensor["kind"] == "imu":
        compass = np.radians((EGO.yaw_deg + 90.0) % 360.0)
        return {}, sensor_kind("imu").layout.pack(0.0, 0.0, 9.81, 0.0, 0.0, 0.0, compass)
    return {}, sensor_kind("gnss").layout.pack(*gnss_reading(sensor["pose"], time_s))


def gnss_reading(pose: dict[str, float], time_s: float) -> tuple[float, float, float]:
    """Degrees and metres about 0 N 0 E, where a degree is the same in all directions."""
    x, y, z = world_from_sensor(pose, time_s)[1].tolist()
    metre_deg = np.degrees(1.0 / 6_378_137.0)
    return -y * metre_deg, x * metre_deg, z
