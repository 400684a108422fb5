"""The episode of the self-test: a rig that is put elsewhere at every tick, and things to see.

Nothing drives: scenario ``replay`` puts the ego, a vehicle ahead of it and a walker where the plan
says, so that every pose is known beforehand. The steps differ from one tick to the next: with even
steps, pictures that lag a tick behind their poses would look as right as pictures in time.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from carstage.errors import ServerError
from carstage.geometry import FloatArray, pose_matrix, rotation_deg
from carstage.sensor_kinds import sensor_kind
from carstage.spec import (
    EgoSpec,
    EpisodeSpec,
    GroundTruthSpec,
    LabelsSpec,
    PedestriansSpec,
    PoseSpec,
    ReplayedActor,
    ReplaySpec,
    Seeds,
    SensorSpec,
    Stand,
    TimingSpec,
    TrafficSpec,
    VehiclesSpec,
    WeatherSpec,
)
from carstage.spec.defaults import MAX_DISTANCE_M

FPS = 10.0
WARMUP_TICKS = 8
VEHICLES = ("vehicle.tesla.model3", "vehicle.lincoln.mkz_2017", "vehicle.lincoln.mkz_2020")
WALKER = "walker.pedestrian.0001"
CAMERA_KINDS = ("rgb", "depth", "semantic", "instance", "flow")

# At each tick: metres ahead of and beside the start, and degrees of pitch, yaw and roll.
_EGO_MOTION = (
    (0.00, 0.00, 0.0, 0.0, 0.0),
    (0.30, 0.05, 0.5, 2.0, 0.0),
    (0.38, 0.00, 0.0, -1.5, 1.0),
    (0.80, 0.15, -0.8, 1.0, 0.5),
    (0.92, 0.05, 0.3, 4.0, -1.0),
    (1.40, 0.10, 0.9, 1.0, 0.0),
    (1.45, 0.30, 0.0, -2.0, 0.7),
    (1.95, 0.10, -0.5, 1.5, -0.6),
)
# Metres that the vehicle ahead has moved to its left and the walker to its right at each tick.
_TARGET_MOTION_M = (0.0, 1.0, 2.0, 3.0, 2.2, 1.2, 0.2, -0.8)

_CAMERA = {"image_size_x": "320", "image_size_y": "180", "fov": "90.0"}
_LIDAR = {
    "channels": "32",
    "points_per_second": "115200",
    "rotation_frequency": "10.0",
    "range": "60.0",
    "upper_fov": "8.0",
    "lower_fov": "-22.0",
    "dropoff_general_rate": "0.0",
    "dropoff_intensity_limit": "0.0",
    "dropoff_zero_intensity": "0.0",
    "noise_stddev": "0.0",
}
_CAMERA_POSE = PoseSpec(2.4, 0.2, 1.5, 0.0, -3.0, 4.0)
_LIDAR_POSE = PoseSpec(0.6, -0.3, 2.2, 0.0, 0.0, 30.0)
_GNSS_POSE = PoseSpec(0.0, 0.0, 1.8, 0.0, 0.0, 0.0)

_NEAREST_M, _BEST_M, _FARTHEST_M = 10.0, 14.0, 30.0
_WIDEST_M = 4.0
_WALKER_BESIDE_M = 2.5
_WALKER_ABOVE_M = 0.9


def plan_self_test(
    dialect: str, map_name: str, spawn_points: FloatArray, blueprints: Collection[str]
) -> EpisodeSpec:
    """The episode to record.

    Args:
        dialect: the server's version.
        map_name: the map that it has loaded.
        spawn_points: ``(N, 6)`` of that map: x, y, z (m), pitch, yaw, roll (deg).
        blueprints: what the server has.

    Raises:
        ServerError: the map has no spawn point, or the server no vehicle or sensor to test with.
    """
    if not len(spawn_points):
        raise ServerError(
            f"Map {map_name} has no spawn points: the self-test has no place to stand.",
            "Load another map, or set server.self_test: off.",
        )
    start, target = choose_places(spawn_points)
    vehicle = _vehicle(blueprints)
    ego = [_moved(start, ahead, right, tilt) for ahead, right, *tilt in _EGO_MOTION]
    ahead = [_moved(target, 0.0, -left) for left in _TARGET_MOTION_M]
    actors = [_actor(vehicle, ego), _actor(vehicle, ahead)]
    if WALKER in blueprints:
        beside = [
            _moved(target, 0.0, _WALKER_BESIDE_M + right / 4.0, up=_WALKER_ABOVE_M)
            for right in _TARGET_MOTION_M
        ]
        actors.append(_actor(WALKER, beside))
    x_m, y_m, z_m, _, yaw_deg, _ = (float(value) for value in start)
    place = Stand(x_m=x_m, y_m=y_m, z_m=z_m, yaw_deg=yaw_deg)
    return EpisodeSpec(
        dialect=dialect,
        index=0,
        map=map_name,
        map_layers=None,
        weather=WeatherSpec(preset="ClearNoon", parameters={}, lights="auto"),
        steps=len(_EGO_MOTION),
        fps=FPS,
        save_every=1,
        warmup_ticks=WARMUP_TICKS,
        timing=TimingSpec(
            mode="sync",
            sensor_sync=True,
            max_substep_delta_time_s=0.01,
            max_substeps=10,
            on_incomplete="wait",
        ),
        vehicles=VehiclesSpec(0, "vehicle.*", None),
        pedestrians=PedestriansSpec(0, "walker.pedestrian.*", None),
        traffic=TrafficSpec(),
        ego=EgoSpec(vehicle, color=None, spawn_index=None, spawn_place=place),
        scenario=ReplaySpec("self-test", tuple(actors)),
        sensors=_sensors(blueprints),
        labels=LabelsSpec(),
        ground_truth=GroundTruthSpec(),
        max_distance_m=MAX_DISTANCE_M,
        min_lidar_points=0,
        seeds=Seeds(1, 1, 1, 1, 1, 1),
    )


def choose_places(spawn_points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where the ego starts and where the vehicle ahead of it stands, each ``(6,)``.

    Two spawn points of which one lies ahead of the other, so that both stand on a road that is
    free; on a map without such a pair, the first one and a place ahead of it.
    """
    points = np.asarray(spawn_points, dtype=np.float64)
    poses = pose_matrix(points[:, :3], points[:, 3:])
    best: tuple[float, int, int] | None = None
    for first, start in enumerate(poses):
        local = (points[:, :3] - start[:3, 3]) @ start[:3, :3]
        fits = (
            (local[:, 0] >= _NEAREST_M)
            & (local[:, 0] <= _FARTHEST_M)
            & (np.abs(local[:, 1]) <= _WIDEST_M)
            & (np.abs(local[:, 2]) <= 1.0)
        )
        cost = np.abs(local[:, 0] - _BEST_M) + np.abs(local[:, 1])
        for second in np.flatnonzero(fits).tolist():
            if best is None or cost[second] < best[0] - 1e-6:
                best = (float(cost[second]), first, second)
    if best is None:
        return points[0], _moved(points[0], _BEST_M, 0.0)
    return points[best[1]], points[best[2]]


def _moved(
    place: FloatArray,
    ahead_m: float,
    right_m: float,
    tilt_deg: Sequence[float] = (0.0, 0.0, 0.0),
    up: float = 0.0,
) -> FloatArray:
    """A place moved along its own axes and turned by pitch, yaw, roll (deg)."""
    pose = pose_matrix(place[:3], place[3:]) @ pose_matrix([ahead_m, right_m, up], list(tilt_deg))
    return np.concatenate([pose[:3, 3], rotation_deg(pose[:3, :3])])


def _actor(blueprint: str, poses: Sequence[FloatArray]) -> ReplayedActor:
    rounded = (tuple(round(float(value), 6) for value in pose) for pose in poses)
    return ReplayedActor(blueprint, {}, tuple(rounded))


def _vehicle(blueprints: Collection[str]) -> str:
    known = [name for name in VEHICLES if name in blueprints]
    known += sorted(name for name in blueprints if name.startswith("vehicle."))
    if not known:
        raise ServerError(
            "The server has no vehicle: the self-test has nothing to look at.",
            "Use a CARLA release, or set server.self_test: off.",
        )
    return known[0]


def _sensors(blueprints: Collection[str]) -> tuple[SensorSpec, ...]:
    wanted: list[tuple[str, PoseSpec, dict[str, str]]] = [
        (kind, _CAMERA_POSE, _CAMERA) for kind in CAMERA_KINDS
    ]
    wanted += [("lidar", _LIDAR_POSE, _LIDAR), ("gnss", _GNSS_POSE, {})]
    return tuple(
        SensorSpec(
            id=kind,
            kind=kind,
            blueprint=sensor_kind(kind).blueprint,
            hidden=False,
            labelled=False,
            pose=pose,
            attributes=attributes,
        )
        for kind, pose, attributes in wanted
        if sensor_kind(kind).blueprint in blueprints
    )


def camera_in_ego() -> FloatArray:
    """``(4, 4)`` ego_from_camera as planned."""
    return _in_ego(_CAMERA_POSE)


def lidar_in_ego() -> FloatArray:
    """``(4, 4)`` ego_from_lidar as planned."""
    return _in_ego(_LIDAR_POSE)


def _in_ego(pose: PoseSpec) -> FloatArray:
    rotation = [pose.pitch_deg, pose.yaw_deg, pose.roll_deg]
    return pose_matrix([pose.x_m, pose.y_m, pose.z_m], rotation)
