"""Whether the point clouds of a fleet fit together on what stands still.

Each agent's points are brought into the world by its LiDAR's pose. Around each point of one agent,
the points of another that are near make a plane, by principal components (Hoppe et al., "Surface
reconstruction from unorganized points", 1992). How far the point is from that plane is compared
with what the LiDARs' noise along their rays makes of it: the component along the plane's normal,
of the point itself and of the plane. Points in or near boxes of objects are left out, as are
places that are no plane.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from carstage import Dataset
from carstage.bench.verdict import Figure, Verdict
from carstage.dataset import Episode, Frame
from carstage.geometry import FloatArray, invert_pose, pose_matrix, transform_points
from carstage.sensor_kinds.model import POINTS

LARGEST_RATIO = 1.25
"""Spread of the distances over what the noise makes of it, at most."""
LEAST_WITHIN_3_SIGMA = 0.95
LEAST_POINTS = 1000
_NEIGHBOURS = 12
_RADIUS_M = 0.6
_BOX_MARGIN_M = 0.4
_ROUGHNESS_M = 0.004
"""What is added to the noise: curbs, leaves and cobbles are no planes, and floats are short."""
_FLAT = 0.05
"""Smallest over middle principal component of a plane's points, at most."""
_SAME_AS_MEDIAN = 1.4826
"""From a median of absolute values to a standard deviation, for a normal distribution."""


@dataclass(frozen=True, slots=True)
class WorldCloud:
    """What an agent's LiDAR measured of what stands still.

    Attributes:
        points: ``(N, 3)`` m, world.
        rays: ``(N, 3)`` unit vectors from the LiDAR to the points, world.
        noise_m: standard deviation along the rays.
    """

    points: FloatArray
    rays: FloatArray
    noise_m: float


def measure_fusion(
    datasets: Sequence[Path], progress: Callable[[int, int], None] = lambda done, total: None
) -> Verdict:
    """Compare the clouds of all pairs of agents in all frames.

    Args:
        datasets: with agents that have LiDARs.
        progress: called with the frames done and their number.

    Raises:
        ValueError: no episode has two agents with LiDARs.
    """
    episodes = [episode for path in datasets for episode in Dataset(path).episodes]
    total, done = sum(episode.frames for episode in episodes), 0
    found: list[NDArray[np.float64]] = []
    for episode in episodes:
        for frame in episode.iter_frames():
            clouds = list(world_clouds(episode, frame))
            for one, other in permutations(clouds, 2):
                found.append(normalised_distances(one, other))
            done += 1
            progress(done, total)
    if not found:
        raise ValueError("no episode has two agents with LiDARs")
    distances = np.concatenate(found)
    spread = float(np.median(np.abs(distances))) * _SAME_AS_MEDIAN if len(distances) else np.inf
    within = float(np.mean(np.abs(distances) <= 3.0)) if len(distances) else 0.0
    return Verdict(
        "fleet-fusion",
        (
            Figure("points compared", len(distances), ">=", LEAST_POINTS),
            Figure("spread over noise", round(spread, 3), "<=", LARGEST_RATIO),
            Figure("share within 3 sigma", round(within, 4), ">=", LEAST_WITHIN_3_SIGMA),
        ),
    )


def world_clouds(episode: Episode, frame: Frame) -> Iterator[WorldCloud]:
    """What stands still, of each LiDAR of ego and agents that has data of the frame."""
    for view in episode.views:
        own = frame if view.agent_name is None else frame.as_agent(view.agent_name)
        for sensor in view.sensors:
            if sensor.content == POINTS and own.has(sensor.id):
                pose = own.world_from_sensor(sensor.id)
                points = transform_points(pose, own.read(sensor.id)[:, :3].astype(np.float64))
                points = points[~_in_boxes(points, frame)]
                rays = points - pose[:3, 3]
                rays /= np.linalg.norm(rays, axis=1, keepdims=True)
                noise_m = float(sensor.calibration.attributes.get("noise_stddev", 0.0))
                yield WorldCloud(points, rays, noise_m)


def normalised_distances(one: WorldCloud, other: WorldCloud) -> NDArray[np.float64]:
    """Signed distances of one cloud's points from planes of another's, over what noise makes them.

    Returns:
        ``(M,)`` of the points around which the other cloud has a plane; standard deviation 1 is
        what the noise explains.
    """
    if len(other.points) < _NEIGHBOURS or not len(one.points):
        return np.zeros(0)
    distance, near = KDTree(other.points).query(one.points, k=_NEIGHBOURS)
    chosen = np.flatnonzero(distance[:, -1] <= _RADIUS_M)
    points, neighbours = one.points[chosen], other.points[near[chosen]]
    middle = neighbours.mean(axis=1)
    offsets = neighbours - middle[:, None]
    values, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", offsets, offsets) / _NEIGHBOURS)
    normal = axes[:, :, 0]
    along_one = np.abs(np.einsum("ni,ni->n", normal, one.rays[chosen])) * one.noise_m
    rays = other.rays[near[chosen]]
    along_other = np.abs(np.einsum("ni,nki->nk", normal, rays)).mean(axis=1) * other.noise_m
    # A plane's own points must be as flat as their noise lets them be, and cover an area.
    limit = (2.0 * np.hypot(along_other, _ROUGHNESS_M)) ** 2
    flat = (values[:, 0] <= limit) & (values[:, 0] <= _FLAT * values[:, 1])
    inside = np.linalg.norm(points - middle, axis=1) <= np.sqrt(values[:, 1])
    kept = flat & inside
    gap = np.einsum("ni,ni->n", normal, points - middle)[kept]
    of_plane = along_other[kept] * np.sqrt(3.0 / _NEIGHBOURS)  # three parameters are fitted
    explained = np.sqrt(along_one[kept] ** 2 + of_plane**2 + _ROUGHNESS_M**2)
    result: NDArray[np.float64] = gap / explained
    return result


def _in_boxes(points: FloatArray, frame: Frame) -> NDArray[np.bool_]:
    """``(N,)`` whether a point lies in or near the box of something that may move."""
    inside = np.zeros(len(points), np.bool_)
    rows: list[Any] = [row for row in frame.objects.values() if not row["is_static"]]
    rows += [] if frame.ego_object is None else [frame.ego_object]
    for row in rows:
        if row["box_center"] is None:
            continue
        world_from_box = pose_matrix(row["box_center"], row["box_rotation_deg"])
        local = transform_points(invert_pose(world_from_box), points)
        inside |= (np.abs(local) <= np.array(row["box_extent"]) + _BOX_MARGIN_M).all(axis=1)
    return inside
