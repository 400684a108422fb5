"""What hides an object in a picture is what the depth image beside it says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.dataset.calibration import SensorCalibration
from carstage.dataset.reading import Episode
from carstage.geometry import OPTICAL_FROM_SENSOR, Z_NEAR_M, invert_pose, project
from carstage.sensor_kinds.columns import Instance
from carstage.spec.labels import LabelsSpec
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labelled_cameras import LabelledCameras
from carstage.validation.checks.labels import LabelledBox
from carstage.validation.checks.silhouettes import BODY_REACH_M, BOX_MARGIN_M, optical_corners

_EDGE_PX = 0.02
_DEPTH_M, _DEPTH_SHARE = 0.01, 1e-4
"""Poses are rounded: vertices so near a pixel's edge, or what they are compared with, may fall
either way."""
_DIAGONALS = ((-1, -1), (-1, 1), (1, -1), (1, 1))
_SAMPLES = 500
"""About so many of a silhouette's pixels are looked at, all of a smaller one."""
_ROAD_M = 0.35
"""Depths so far above a box's bottom may be the road's, which hides nothing."""
_SHARE, _SAMPLED_SHARE, _LEAST_PX = 0.02, 0.2, 6
"""By so much of the silhouette may the count of what is in front be off, where all pixels are
looked at, and where a sample is."""


class OccluderChecks:
    """Counts anew what hides objects, of pinhole cameras with an exact depth image.

    Args:
        episode: the episode.
        findings: check ``occluders``.
    """

    def __init__(self, episode: Episode, findings: Findings) -> None:
        self._findings = findings
        self._labels = episode.spec.labels
        self._cameras, self._depth = LabelledCameras.of(episode)

    def check(
        self,
        k: int,
        rows: Mapping[tuple[int, str], list[dict[str, Any]]],
        boxes: Sequence[LabelledBox],
        data: Mapping[str, NDArray[Any]],
    ) -> None:
        """Compare the counts of frame ``k`` with what follows.

        Args:
            k: the frame.
            rows: rows of ``camera_objects.parquet`` by frame and camera.
            boxes: the frame's 3D boxes.
            data: by sensor, as they are decoded.
        """
        by_track = {box.track_id: box for box in boxes}
        for name, sensor in self._cameras.items():
            beside = self._depth.get(name)
            if beside is None or beside.id not in data:
                continue
            known = [
                (row, box)
                for row in rows.get((k, name), [])
                if (box := by_track.get(row["track_id"])) is not None
            ]
            camera = sensor.calibration_at(k)
            depth_m, instance = data[beside.id], data.get(camera.instance or "")
            ids = None if instance is None else instance[..., Instance.ID]
            for found in (
                *wrong_vertices(camera, known, depth_m, self._labels),
                *wrong_fronts(camera, known, depth_m, ids),
            ):
                self._findings.add("occluders", found, frame=k, sensor=name)


Known = Sequence[tuple[Mapping[str, Any], LabelledBox]]


def wrong_vertices(
    camera: SensorCalibration, known: Known, depth_m: NDArray[np.floating[Any]], labels: LabelsSpec
) -> list[str]:
    """Of which objects the counts of seen and hidden vertices cannot be right.

    Args:
        camera: who looks.
        known: rows of ``camera_objects.parquet``, each with the box.
        depth_m: ``(H, W)`` z-depth of the camera's pixels.
        labels: how vertices were compared.
    """
    known = [(row, box) for row, box in known if row["n_visible"] is not None]
    if not known:
        return []
    corners = optical_corners(camera, [box for _, box in known])
    z = corners[..., 2]
    sure = np.abs(z - Z_NEAR_M) > _DEPTH_M
    ahead = z >= Z_NEAR_M
    uv = project(np.where(ahead[..., None], corners, 1.0), camera.k, 0.0)
    size = np.array([camera.width, camera.height])
    inside = ahead & ((uv >= 0.0) & (uv < size)).all(axis=-1)
    near = (uv > -_EDGE_PX).all(axis=-1) & (uv < size + _EDGE_PX).all(axis=-1)
    on_edge = (np.abs(uv - np.round(uv)) <= _EDGE_PX).any(axis=-1)
    sure &= ~(ahead & near & on_edge)
    slack_m = _DEPTH_M + _DEPTH_SHARE * np.abs(z)
    limit_m = z - labels.stage_vo_tolerance_m
    pixel = np.clip(np.floor(np.where(inside[..., None], uv, 0.0)).astype(np.int64), 0, size - 1)
    hidden, perhaps = (
        _is_hidden(depth_m, pixel, limit_m + shift_m, vote=labels.stage_vo_vote)
        for shift_m in (-slack_m, slack_m)
    )
    sure &= ~inside | (hidden == perhaps)
    found = []
    for number, (row, box) in enumerate(known):
        unsure = int((~sure[number]).sum())
        counts = {
            "n_behind": ~ahead[number],
            "n_visible": inside[number] & ~hidden[number],
            "n_occluded": inside[number] & hidden[number],
            "n_outside": ahead[number] & ~inside[number],
        }
        for column, is_one in counts.items():
            if row[column] is None:
                continue  # the check of nulls says so
            wanted = int((is_one & sure[number]).sum())
            if not wanted <= row[column] <= wanted + unsure:
                about = f"{wanted}" if not unsure else f"{wanted} to {wanted + unsure}"
                found.append(
                    f"object {box.track_id}: {column} is {row[column]}, from its box and the depth "
                    f"image follows {about}"
                )
                break
    return found


def _is_hidden(
    depth_m: NDArray[np.floating[Any]],
    pixel: NDArray[np.int64],
    limit_m: NDArray[np.float64],
    *,
    vote: bool,
) -> NDArray[np.bool_]:
    """Which vertices ``(N, 8)`` lie behind what their pixel shows, or all diagonal neighbours."""
    u, v = pixel[..., 0], pixel[..., 1]
    if not vote:
        return np.asarray(depth_m[v, u] < limit_m)
    height, width = depth_m.shape
    hidden, any_there = np.ones(u.shape, np.bool_), np.zeros(u.shape, np.bool_)
    for down, right in _DIAGONALS:
        there = (v + down >= 0) & (v + down < height) & (u + right >= 0) & (u + right < width)
        shown = depth_m[np.clip(v + down, 0, height - 1), np.clip(u + right, 0, width - 1)]
        hidden &= ~there | (shown < limit_m)
        any_there |= there
    return hidden & any_there


def wrong_fronts(
    camera: SensorCalibration,
    known: Known,
    depth_m: NDArray[np.floating[Any]],
    ids: NDArray[np.uint16] | None = None,
) -> list[str]:
    """Of which objects ``front_px`` is far from what a sample of their silhouette shows.

    Args:
        camera: who looks.
        known: rows of ``camera_objects.parquet``, each with the box.
        depth_m: ``(H, W)`` z-depth of the camera's pixels.
        ids: ``(H, W)`` whose pixels they are, by instance ids: arms and legs leave a walker's box
            and hide nothing of it, an umbrella does. None: what is so near may be either.
    """
    # Of pixels (u, v, 1) along the ego's axes.
    ego_from_pixel = (
        camera.ego_from_sensor[:3, :3] @ OPTICAL_FROM_SENSOR.T @ np.linalg.inv(camera.k)
    )
    found = []
    known = [(row, box) for row, box in known if row["hull_px"] and row["front_px"] is not None]
    for (row, box), (x0, y0, x1, y1) in zip(known, _regions(camera, known), strict=True):
        step = max(1, int(np.sqrt((x1 - x0) * (y1 - y0) / _SAMPLES)))
        v, u = (one.ravel() for one in np.mgrid[y0:y1:step, x0:x1:step])
        box_from_ego = invert_pose(box.ego_from_box)
        eye = box_from_ego[:3, :3] @ camera.ego_from_sensor[:3, 3] + box_from_ego[:3, 3]
        pixels = np.column_stack([u + 0.5, v + 0.5, np.ones(len(u))])
        along = pixels @ (box_from_ego[:3, :3] @ ego_from_pixel).T
        enter_m, leave_m = _ways_through(eye, along, box.extent + BOX_MARGIN_M)
        meets = enter_m <= leave_m
        shown_m = depth_m[v, u].astype(np.float64)
        before = meets & (shown_m < enter_m)
        unsure = (along[:, 2] < 0.0) & (eye[2] + shown_m * along[:, 2] < _ROAD_M - box.extent[2])
        if ids is not None and not box.is_static:
            unsure |= ids[v, u] == box.track_id & 0xFFFF
        elif box.is_capsule:
            reached_m, _ = _ways_through(eye, along, box.extent + BODY_REACH_M)
            unsure |= shown_m >= reached_m
        most, least = int(before.sum()), int((before & ~unsure).sum())
        share = 1.0 / max(int(meets.sum()), 1)
        slack = (_SHARE if step == 1 else _SAMPLED_SHARE) + _LEAST_PX / row["hull_px"]
        given = row["front_px"] / row["hull_px"]
        if not least * share - slack <= given <= most * share + slack:
            found.append(
                f"object {box.track_id}: front_px is {row['front_px']} of {row['hull_px']} pixels, "
                f"and the depth image shows something before {least * share:.0%} to "
                f"{most * share:.0%} of them"
            )
    return found


def _regions(camera: SensorCalibration, known: Known) -> list[list[int]]:
    """Bounds (px) of the boxes in the image, with their margin; all of it where one is too near."""
    if not known:
        return []
    corners = optical_corners(camera, [box for _, box in known], grown_m=BOX_MARGIN_M)
    near = np.asarray((corners[..., 2] < Z_NEAR_M).any(axis=1))
    size = np.array([camera.width, camera.height])
    uv = project(np.where(near[:, None, None], 1.0, corners), camera.k, 0.0)
    low, high = np.floor(uv.min(axis=1)), np.ceil(uv.max(axis=1))
    low[near], high[near] = 0, size
    bounds = np.concatenate([np.clip(low, 0, size - 1), np.clip(high, 1, size)], axis=1)
    regions: list[list[int]] = bounds.astype(np.int64).tolist()
    return regions


def _ways_through(
    eye: NDArray[np.float64], along: NDArray[np.float64], half_m: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Depths ``(N,)`` at which rays enter and leave a box; those that miss it leave before."""
    steps = np.where(along == 0.0, 1e-300, along)
    ends = np.stack([(-half_m - eye) / steps, (half_m - eye) / steps])
    return np.maximum(ends.min(axis=0).max(axis=1), Z_NEAR_M), ends.max(axis=0).min(axis=1)
