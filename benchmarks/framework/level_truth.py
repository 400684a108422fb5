"""Labels of level objects against truth: of parked vehicles and signs what is seen without them, of
lights the pixels with their actor's id. The labels themselves go by depth and tag.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.framework.label_scenes import LabelScene
from benchmarks.framework.label_scores import MIN_VISIBLE_PX, f1, iou
from benchmarks.framework.masks import inside_polygon, tight_box
from carstage.annotation.classes import LEVEL_CLASSES
from carstage.annotation.decoding import decode_instance_bgra
from carstage.annotation.pixels import BOX_MARGIN_M
from carstage.annotation.tracks import level_tracks
from carstage.bench.verdict import Figure
from carstage.geometry import (
    Z_NEAR_M,
    FloatArray,
    box_corners,
    clip_to_near_plane,
    convex_hull,
    pose_matrix,
    project,
    transform_points,
)
from carstage.rawlog.reader import LevelObject
from carstage.spec.vehicle_classes import VEHICLE_CLASSES
from carstage.tags import dataset_tags, vehicle_tags

LEVEL_BOX_PX: Final = 100
"""2D boxes are compared of level objects with so many visible pixels; many are small."""


@dataclass(frozen=True, slots=True)
class LevelFinding:
    """A level object in a picture.

    Attributes:
        town: where.
        object_class: Car-STAGE class.
        visible_px: its pixels in truth.
        labelled_px: its pixels by the labels.
        visible: the decision of the labels.
        outside_px: true pixels outside the silhouette of its inflated box.
        box_iou: of the modal 2D box with the true one; None where there are too few pixels.
    """

    town: str
    object_class: str
    visible_px: int
    labelled_px: int
    visible: bool
    outside_px: int
    box_iou: float | None


def compare_level(
    town: str,
    scene: LabelScene,
    objects: Sequence[LevelObject],
    server: str,
    rows: Mapping[int, Mapping[str, Any]],
    optical: FloatArray,
    k: FloatArray,
    max_distance_m: float,
) -> Iterator[LevelFinding]:
    """Compare the labels of a scene's level objects with the truth.

    Args:
        town: where.
        scene: with what was taken away.
        objects: of the raw log.
        server: its version.
        rows: of ``camera_objects``, by track.
        optical: ``(4, 4)`` world to optical axes.
        k: ``(3, 3)`` intrinsics.
        max_distance_m: of the labels.
    """
    tracks = level_tracks(found.id for found in objects)
    for track, found in zip(tracks, objects, strict=True):
        world_from_box = pose_matrix(found.box_location, found.box_rotation_deg)
        center = transform_points(optical, world_from_box[:3, 3])
        if center[2] <= 0.0 or np.linalg.norm(center) > max_distance_m:
            continue
        truth = _true_pixels(scene, found, objects, server, optical, k)
        if truth is None:
            continue
        corners = box_corners(world_from_box, found.box_extent + BOX_MARGIN_M)
        seen = clip_to_near_plane(transform_points(optical, corners), Z_NEAR_M)
        hull = convex_hull(project(seen, k))
        row = rows.get(track)
        count = int(truth.sum())
        overlap = None
        if count >= LEVEL_BOX_PX:
            modal = None if row is None else row["bbox_modal"]
            overlap = 0.0 if modal is None else iou(tight_box(truth), modal)
        yield LevelFinding(
            town=town,
            object_class=_class_of(found, server),
            visible_px=count,
            labelled_px=0 if row is None else row["visible_px"],
            visible=row is not None and row["visible_pixel"],
            outside_px=int((~inside_polygon(truth, hull)).sum()),
            box_iou=overlap,
        )


def _class_of(found: LevelObject, server: str) -> str:
    return LEVEL_CLASSES[dataset_tags([found.label], server)[0]]


def _true_pixels(
    scene: LabelScene,
    found: LevelObject,
    objects: Sequence[LevelObject],
    server: str,
    optical: FloatArray,
    k: FloatArray,
) -> NDArray[np.bool_] | None:
    """``(H, W)`` which pixels are the object's; None where that is unknown."""
    ids, tags = decode_instance_bgra(scene.instance_bgra)
    if found.id in scene.missed:
        own = {found.label}
        if _class_of(found, server) in VEHICLE_CLASSES:
            own |= vehicle_tags(server)
        # A sign goes with its post, which is no sign.
        return np.asarray(scene.missed[found.id] & np.isin(tags, sorted(own)))
    if not found.light:
        return None
    lit = np.asarray((ids == found.light & 0xFFFF) & (tags == found.label))
    heads = [other for other in objects if other.light == found.light]
    rows, columns = np.nonzero(lit)
    middles = transform_points(optical, np.array([head.box_location for head in heads]))
    uv = np.where(middles[:, 2:] > Z_NEAR_M, project(middles, k), np.inf)
    offset = np.stack([columns + 0.5, rows + 0.5], axis=-1)[:, None] - uv
    nearest = np.hypot(offset[..., 0], offset[..., 1]).argmin(axis=1)
    mine = nearest == heads.index(found)
    lit[rows[~mine], columns[~mine]] = False
    return lit


def level_figures(findings: Sequence[LevelFinding]) -> list[Figure]:
    """The figures of the comparison, with their targets."""
    seen = [f for f in findings if f.visible_px or f.labelled_px]
    wrong = sum(abs(f.labelled_px - f.visible_px) for f in seen)
    whole = sum(f.visible_px for f in seen)
    ious = [f.box_iou for f in findings if f.box_iou is not None]
    decided = ((f.visible_px >= MIN_VISIBLE_PX, f.visible) for f in findings)
    return [
        Figure("level_objects_in_view", len(findings)),
        Figure("level_objects_seen", len(seen)),
        Figure("level_objects_outside_their_box", sum(f.outside_px > 0 for f in seen), "==", 0),
        Figure("level_wrong_pixels_share", wrong / whole if whole else float("nan"), "<=", 0.02),
        Figure(
            "level_box_iou_median", float(np.median(ious)) if ious else float("nan"), ">=", 0.95
        ),
        Figure("level_f1", f1(decided), ">=", 0.99),
    ]
