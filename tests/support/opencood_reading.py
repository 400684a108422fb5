"""Reads a folder of OPV2V by the rules of OpenCOOD's reader, written anew.

The rules are those of ``opencood/data_utils/datasets/basedataset.py`` (which folders and files, who
is the ego), ``utils/transformation_utils.py`` (poses), ``utils/box_utils.py`` (boxes) and
``utils/pcd_utils.py`` (points: x, y, z and the red channel).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray


@dataclass(frozen=True)
class CooperativeFrame:
    """One agent's files of one moment."""

    is_ego: bool
    params: dict[str, Any]
    points: NDArray[np.float64]
    cameras: list[Path]


def read_split(folder: Path) -> dict[str, list[dict[str, CooperativeFrame]]]:
    """By scenario, its moments; in each, the agents by their ids in the reader's order."""
    return {path.name: _moments(path) for path in sorted(folder.iterdir()) if path.is_dir()}


def _moments(scenario: Path) -> list[dict[str, CooperativeFrame]]:
    ids = sorted(path.name for path in scenario.iterdir() if path.is_dir())
    assert ids
    if int(ids[0]) < 0:
        ids = [*ids[1:], ids[0]]
    times = [
        sorted(path.name.removesuffix(".yaml") for path in (scenario / one).glob("*.yaml"))
        for one in ids
    ]
    # The reader counts the moments of the first agent and takes the same ones of all others.
    return [
        {one: _read(scenario / one, time, is_ego=one == ids[0]) for one in ids} for time in times[0]
    ]


def _read(folder: Path, time: str, *, is_ego: bool) -> CooperativeFrame:
    params = yaml.safe_load((folder / f"{time}.yaml").read_text("utf-8"))
    cameras = [folder / f"{time}_camera{number}.png" for number in range(4)]
    return CooperativeFrame(is_ego, params, read_pcd(folder / f"{time}.pcd"), cameras)


def read_pcd(path: Path) -> NDArray[np.float64]:
    """``(N, 4)`` x, y, z, red from 0 to 1 of a binary PCD file, as PCL defines the format."""
    header, _, body = path.read_bytes().partition(b"DATA binary\n")
    lines = [line.split(" ") for line in header.decode("ascii").splitlines() if line[0] != "#"]
    entries = {key: values for key, *values in lines}
    assert entries["FIELDS"] == ["x", "y", "z", "rgb"]
    assert entries["SIZE"] == ["4"] * 4
    assert entries["COUNT"] == ["1"] * 4
    count = int(entries["POINTS"][0])
    assert (int(entries["WIDTH"][0]), int(entries["HEIGHT"][0])) == (count, 1)
    words = np.frombuffer(body, "<u4").reshape(count, 4)
    xyz = words[:, :3].copy().view("<f4").astype(np.float64)
    return np.column_stack([xyz, (words[:, 3] >> 16 & 255) / 255.0])


def world_from(pose: list[float]) -> NDArray[np.float64]:
    """``(4, 4)`` of x, y, z, roll, yaw, pitch (m, deg), in CARLA's axes."""
    x, y, z, *angles = pose
    roll, yaw, pitch = np.radians(angles)
    cr, sr, cy, sy, cp, sp = (f(a) for a in (roll, yaw, pitch) for f in (np.cos, np.sin))
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    about_y = np.array([[cp, 0, -sp], [0, 1, 0], [sp, 0, cp]])
    about_x = np.array([[1, 0, 0], [0, cr, sr], [0, -sr, cr]])
    matrix[:3, :3] = about_z @ about_y @ about_x
    return matrix


def corners_from_lidar(vehicle: dict[str, Any], lidar_pose: list[float]) -> NDArray[np.float64]:
    """``(8, 3)`` corners of a vehicle's box in the axes of a LiDAR, as the reader places it."""
    place = np.array(vehicle["location"]) + np.array(vehicle["center"])
    lidar_from_box = np.linalg.inv(world_from(lidar_pose)) @ world_from(
        [*place.tolist(), *vehicle["angle"]]
    )
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    local = signs * np.array(vehicle["extent"])
    return np.asarray(local @ lidar_from_box[:3, :3].T + lidar_from_box[:3, 3])
