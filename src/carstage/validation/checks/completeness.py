"""No label row is missing: tracks have no gaps, and what an image can hold has a row."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pyarrow as pa

from carstage.dataset.calibration import SensorCalibration
from carstage.dataset.tracks import may_come_back
from carstage.geometry import (
    OPTICAL_FROM_SENSOR,
    Z_NEAR_M,
    clip_polygon_to_image,
    invert_pose,
    length,
    polygon_area,
    transform_points,
)
from carstage.validation.checks.findings import Findings, Severity
from carstage.validation.checks.labels import LabelledBox
from carstage.validation.checks.silhouettes import projected_hulls

MIN_AREA_PX = 1.0
DISTANCE_MARGIN_M = 0.01
_BALL_MARGIN_M = 0.01


def check_gaps(objects: pa.Table, frames: int, *, ego_labelled: bool, findings: Findings) -> None:
    """Check that no track has a gap, and the ego's none at all (check ``label_gaps``).

    A server uses an actor's id once in an episode: who is gone does not come back. Level
    objects do, when the ego comes near again; riders have rows where a camera sees them.

    Args:
        objects: ``objects.parquet``.
        frames: number of frames of the episode.
        ego_labelled: whether vehicles, and so the ego, were to be labelled.
        findings: where problems go.
    """
    ks_of: dict[int, set[int]] = defaultdict(set)
    egos: set[int] = set()
    ks: list[Any] = objects["k"].to_pylist()
    tracks: list[Any] = objects["track_id"].to_pylist()
    is_ego: list[Any] = objects["is_ego"].to_pylist()
    comes_back: list[Any] = may_come_back(objects).tolist()
    for k, track, ego, returns in zip(ks, tracks, is_ego, comes_back, strict=True):
        if not returns:
            ks_of[track].add(k)
        if ego:
            egos.add(k)
    for track, present in sorted(ks_of.items()):
        in_order = sorted(present)
        gaps = [k + 1 for k, following in pairwise(in_order) if following > k + 1]
        if gaps:
            missing = in_order[-1] - in_order[0] + 1 - len(in_order)
            findings.add(
                "label_gaps",
                f"object {track} has no row in {missing} frames between its first and its last",
                frame=gaps[0],
            )
    absent = set(range(frames)) - egos
    if ego_labelled and absent:
        findings.add(
            "label_gaps", f"the ego has no row in {len(absent)} of {frames} frames",
            frame=min(absent),
        )  # fmt: skip


def check_missing_rows(
    camera: SensorCalibration,
    k: int,
    boxes: Sequence[LabelledBox],
    labelled: set[int],
    max_distance_m: float,
    *,
    carrier: int | None,
    from_ego: bool,
    severity: Severity,
    findings: Findings,
) -> None:
    """Check that every object that an image can hold has a row (check ``label_missing``).

    These are the objects whose box lies within the maximum distance and whose silhouette covers
    at least a pixel of the image.

    Args:
        camera: the labelled camera, as it stood in the frame.
        k: the frame.
        boxes: the frame's objects.
        labelled: tracks that have a row of this camera in this frame.
        max_distance_m: the spec's.
        carrier: the track that carries the camera, which it does not label.
        from_ego: measure it from the ego's pivot instead of the camera.
        severity: of a missing row.
        findings: where problems go.
    """
    origin = np.zeros(3) if from_ego else camera.ego_from_sensor[:3, 3]
    unlabelled = [b for b in boxes if b.track_id not in labelled and b.track_id != carrier]
    near = []
    for box in perhaps_in_view(camera, unlabelled):
        distance_m = float(np.linalg.norm(box.ego_from_box[:3, 3] - origin))
        if distance_m <= max_distance_m - DISTANCE_MARGIN_M:
            near.append((box, distance_m))
    hulls = projected_hulls(camera, [box for box, _ in near])
    for (box, distance_m), hull in zip(near, hulls, strict=True):
        if len(hull) < 3:
            continue
        if polygon_area(clip_polygon_to_image(hull, camera.width, camera.height)) >= MIN_AREA_PX:
            findings.add(
                "label_missing",
                f"object {box.track_id}, {distance_m:.1f} m away, has no row of this camera, "
                "whose image can hold it",
                frame=k,
                sensor=camera.id,
                severity=severity,
            )


def perhaps_in_view(camera: SensorCalibration, boxes: Sequence[LabelledBox]) -> list[LabelledBox]:
    """The boxes whose ball reaches into what a camera sees: for the others no hull is needed."""
    if not boxes or camera.bent is not None:
        return list(boxes)
    centers = np.stack([box.ego_from_box[:3, 3] for box in boxes])
    reach = length(np.stack([box.extent for box in boxes])) + _BALL_MARGIN_M
    optical = transform_points(invert_pose(camera.ego_from_sensor), centers) @ OPTICAL_FROM_SENSOR.T
    # Rows are planes through the camera: u >= 0, u <= width, v >= 0, v <= height, Z >= near.
    first, second, third = camera.k
    width, height = camera.width, camera.height
    planes = np.stack([first, width * third - first, second, height * third - second, third])
    above = optical @ planes.T / length(planes)
    above[:, 4] -= Z_NEAR_M
    inside = ~(above < -reach[:, None]).any(axis=1)
    return [box for box, seen in zip(boxes, inside.tolist(), strict=True) if seen]
