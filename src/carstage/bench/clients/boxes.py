"""Boxes of all actors as CARLA's tutorials draw them, with STAGE-VO's rule of visibility.

One actor after the other: the eight corners of its bounding box by ``get_world_vertices``, into the
camera by its inverse matrix, onto the picture by the matrix of the intrinsics, each compared with
the depth picture there. Car-STAGE's own labels of the same frames must be equal.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from carstage.bench.clients.boxes_file import BOXES_FILE, COLUMNS
from carstage.bench.clients.scene_session import SceneSession

_NEAR_M = 0.05
_FAR_M = 1000.0


class Boxes:
    """The rows of an episode.

    Args:
        session: the scene; each camera with a depth twin is labelled.
    """

    def __init__(self, session: SceneSession) -> None:
        self._world = session.world
        self._ego_id = session.scene.ego.id
        self._most_m = session.spec.max_distance_m
        self._cameras: list[tuple[str, str, Any]] = []
        for sensor in session.spec.sensors:
            if sensor.labelled and sensor.depth is not None:
                actor = session.scene.rig.actors[sensor.id]
                self._cameras.append((sensor.id, sensor.depth, _intrinsics(actor)))
        self._actors: list[Any] = []
        self._rows: list[tuple[Any, ...]] = []

    def add(self, tick: int, snapshot: Any, data: Mapping[str, Any]) -> None:
        """Label one frame.

        Args:
            tick: its number.
            snapshot: ``carla.WorldSnapshot`` of the frame.
            data: sensor data of the frame by id.
        """
        if not self._actors:
            everybody = self._world.get_actors()
            self._actors = [*everybody.filter("vehicle.*"), *everybody.filter("walker.*")]
        depths: dict[str, Any] = {}
        for camera_id, depth_id, k in self._cameras:
            image = data[depth_id]
            if depth_id not in depths:
                depths[depth_id] = _metres(image)
            to_camera = np.array(image.transform.get_inverse_matrix())
            at = image.transform.location
            for actor in self._actors:
                if actor.id == self._ego_id:
                    continue
                self._add_box(tick, camera_id, actor, snapshot, at, to_camera, k, depths[depth_id])

    def _add_box(
        self,
        tick: int,
        camera_id: str,
        actor: Any,
        snapshot: Any,
        at: Any,
        to_camera: Any,
        k: Any,
        depth: Any,
    ) -> None:
        seen = snapshot.find(actor.id)
        if seen is None:
            return
        transform, box = seen.get_transform(), actor.bounding_box
        vertices = box.get_world_vertices(transform)
        corners = np.array([[v.x, v.y, v.z, 1.0] for v in vertices])
        center = corners[:, :3].mean(axis=0)
        distance = math.dist(center, (at.x, at.y, at.z))
        if distance > self._most_m:
            return
        in_camera = corners @ to_camera.T
        # From CARLA's axes (x ahead, y right, z up) to those of a picture (x right, y down).
        points = np.stack([in_camera[:, 1], -in_camera[:, 2], in_camera[:, 0]], axis=1)
        if (points[:, 2] < _NEAR_M).any():
            return
        pixels = points @ k.T
        u, v = pixels[:, 0] / pixels[:, 2], pixels[:, 1] / pixels[:, 2]
        height, width = depth.shape
        inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
        if not inside.any():
            return
        columns, rows = u[inside].astype(int), v[inside].astype(int)
        n_visible = int((depth[rows, columns] >= points[inside, 2]).sum())
        level = 0 if n_visible >= 6 else 1 if n_visible >= 4 else 2
        low = (max(0.0, u.min()), max(0.0, v.min()))
        high = (min(float(width), u.max()), min(float(height), v.max()))
        extent = box.extent
        self._rows.append(
            (
                tick, camera_id, actor.id, *low, *high, int(inside.all()), n_visible, level,
                distance, *center,
                2.0 * extent.x, 2.0 * extent.y, 2.0 * extent.z,
                transform.rotation.yaw + box.rotation.yaw,
            )
        )  # fmt: skip

    def write(self, folder: Path) -> None:
        """Write all rows."""
        with (folder / BOXES_FILE).open("w", newline="", encoding="utf-8") as file:
            table = csv.writer(file)
            table.writerow(COLUMNS)
            table.writerows(self._rows)


def _intrinsics(camera: Any) -> Any:
    """``(3, 3)``, as CARLA's tutorial on bounding boxes builds it."""
    width = int(camera.attributes["image_size_x"])
    height = int(camera.attributes["image_size_y"])
    focal = width / (2.0 * math.tan(math.radians(float(camera.attributes["fov"])) / 2.0))
    return np.array([[focal, 0.0, width / 2.0], [0.0, focal, height / 2.0], [0.0, 0.0, 1.0]])


def _metres(image: Any) -> Any:
    """``(H, W)`` metres of a depth picture (documentation of CARLA's depth camera)."""
    bgra = np.frombuffer(image.raw_data, np.uint8).reshape(image.height, image.width, 4)
    code = bgra[:, :, 2] + bgra[:, :, 1] * 256.0 + bgra[:, :, 0] * 65536.0
    return code / (2.0**24 - 1.0) * _FAR_M
