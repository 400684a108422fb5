"""Rows of ``camera_objects.parquet``: one per object whose silhouette a camera's image holds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.annotation.classes import TWO_WHEELERS
from carstage.annotation.in_picture import (
    corner_depths,
    corner_pixels,
    near_picture,
    outlines,
    rays_of,
    regions,
    wide_regions,
)
from carstage.annotation.pixels import (
    BODY_REACH_M,
    BOX_MARGIN_M,
    BoxView,
    ImageEvidence,
    ModalMask,
    PixelVisibility,
    Reach,
    measure,
    occlusion_bin,
    shared_low_ids,
)
from carstage.annotation.riders import rider_camera_row, rider_pixels
from carstage.annotation.rig import LabelledCamera
from carstage.annotation.scene import ActorFacts, Scene
from carstage.annotation.silhouette import Silhouette
from carstage.annotation.stage_vo import (
    LEVEL_UNKNOWN,
    count_vertices,
    occlusion_level,
    truncation_paper,
    within_distance,
)
from carstage.geometry import (
    FloatArray,
    box_corners,
    length,
    multiply,
    observation_angle,
    optical_from_world,
    proper_box_rotation,
    quaternion_from_matrix,
    rotate,
    rotation_y,
    transform_points,
)
from carstage.spec import EpisodeSpec, LabelsSpec


@dataclass(frozen=True, slots=True)
class CameraRow:
    """One object in one camera: the finished row, and what object rows sum up.

    Attributes:
        actor_id: the object; of a rider, the two-wheeler.
        row: as ``CAMERA_OBJECT_COLUMNS`` lists it.
        pixels: None when pixels are not counted, or counted with the two-wheeler's.
        is_rider: it is a rider.
    """

    actor_id: int
    row: dict[str, Any]
    pixels: PixelVisibility | None
    is_rider: bool = False


def camera_rows(
    scene: Scene,
    camera: LabelledCamera,
    evidence: ImageEvidence,
    keys: Mapping[str, Any],
    carrier_id: int,
    spec: EpisodeSpec,
    has_points: NDArray[np.bool_],
) -> list[CameraRow]:
    """Label the objects of a scene for one camera.

    Args:
        scene: the frame's actors.
        camera: with its intrinsics.
        evidence: what it saw.
        keys: ``k`` and ``timestamp_s``.
        carrier_id: the actor that the camera sits on, which is not labelled for it; 0: none.
        spec: what is asked for.
        has_points: ``(N,)`` whether enough LiDAR points lie in each box.
    """
    if not camera.is_projective:
        return []
    labels = spec.labels
    world_from_sensor = camera.mount.world_from_sensor(scene.world, scene.world_from_ego)
    optical = optical_from_world(world_from_sensor)
    origin = (world_from_sensor if labels.distance_origin == "sensor" else scene.world_from_ego)[
        :3, 3
    ]
    keep = scene.valid & within_distance(
        scene.world_from_box[:, :3, 3], origin, spec.max_distance_m
    )
    keep &= np.array([fact.info.id != carrier_id for fact in scene.facts], dtype=np.bool_)
    chosen = np.flatnonzero(keep)
    corners = _to_optical(optical, scene.corners[chosen])
    near = near_picture(camera, corners)
    chosen, corners = chosen[near], corners[near]
    found = outlines(camera, corners)
    seen = [i for i, outline in enumerate(found) if outline is not None]
    if not seen:
        return []
    chosen, corners = chosen[seen], corners[seen]
    in_picture = [outline for outline in found if outline is not None]
    columns = _columns(scene, chosen, corners, optical, evidence, camera, labels)
    counted: list[PixelVisibility | None] = [None] * len(seen)
    if labels.pixels:
        counted = [*_count_pixels(scene, chosen, optical, camera, evidence, world_from_sensor)]
    shared = shared_low_ids(scene.world.actor_id)
    rows = []
    for i, (actor, outline, pixels) in enumerate(
        zip(chosen.tolist(), in_picture, counted, strict=True)
    ):
        info = scene.facts[actor].info
        row: dict[str, Any] = {
            "k": keys["k"],
            "timestamp_s": keys["timestamp_s"],
            "track_id": info.id,
            "sensor_id": camera.mount.sensor_id,
            **{name: values[i] for name, values in columns.items()},
            **_rectangles(outline, pixels, camera, labels),
            "truncated": outline.truncated,
            "crosses_near": outline.crosses_near,
            "pinhole": camera.pinhole,
            "instance_ambiguous": not scene.facts[actor].is_static and info.id & 0xFFFF in shared,
            **_pixel_columns(pixels, labels),
        }
        verdict = row["visible_pixel"] if labels.pixels else row["visible_stage_vo"]
        row["visible"] = bool(verdict and has_points[actor])
        rows.append(CameraRow(info.id, row, pixels))
        rider = _rider(scene.facts[actor], pixels, evidence)
        if rider is not None:
            enough = bool(has_points[actor])
            of_rider = rider_camera_row(row, rider, camera, labels, has_points=enough)
            rows.append(CameraRow(info.id, of_rider, None, is_rider=True))
    return rows


def _rider(
    fact: ActorFacts, pixels: PixelVisibility | None, evidence: ImageEvidence
) -> ModalMask | None:
    """The pixels of an actor's rider; None where there is none, or none that can be identified."""
    if pixels is None or evidence.tag is None or evidence.rider_tag is None or fact.is_static:
        return None
    if fact.object_class not in TWO_WHEELERS:
        return None
    return rider_pixels(pixels, evidence.tag, evidence.rider_tag)


def _to_optical(optical: FloatArray, corners_world: FloatArray) -> FloatArray:
    flat = transform_points(optical, corners_world.reshape(-1, 3))
    return flat.reshape(corners_world.shape)


def _columns(
    scene: Scene,
    chosen: NDArray[np.int64],
    corners: FloatArray,
    optical: FloatArray,
    evidence: ImageEvidence,
    camera: LabelledCamera,
    labels: LabelsSpec,
) -> dict[str, Sequence[Any]]:
    """The columns that are computed for all objects at once, as lists."""
    center = transform_points(optical, scene.world_from_box[chosen, :3, 3])
    optical_from_box = multiply(optical[:3, :3], scene.world_from_box[chosen, :3, :3])
    extent = scene.extent[chosen]
    heading = rotation_y(optical_from_box)
    uv = corner_pixels(camera, corners)
    counts = count_vertices(
        uv,
        corner_depths(camera, corners),
        evidence.depth_m,
        tolerance_m=labels.stage_vo_tolerance_m,
        vote=labels.stage_vo_vote,
    )
    half_height = np.zeros_like(center)
    half_height[:, 1] = extent[:, 2]
    three_d = {
        "center_cam": center.tolist(),
        "location": (center + half_height).tolist(),
        "dimensions": (2.0 * extent[:, ::-1]).tolist(),
        "rotation_y": heading.tolist(),
        "alpha": observation_angle(heading, center).tolist(),
        "rotation_cam": quaternion_from_matrix(proper_box_rotation(optical_from_box)).tolist(),
        "corners_uv": _without_nan(uv),
    }
    if not labels.boxes_3d:
        three_d = {name: [None] * len(chosen) for name in three_d}
    return {
        **three_d,
        "distance": length(center).tolist(),
        "depth_center": center[:, 2].tolist(),
        "n_visible": counts.visible.tolist(),
        "n_occluded": counts.occluded.tolist(),
        "n_outside": counts.outside.tolist(),
        "n_behind": counts.behind.tolist(),
        "occluded": occlusion_level(counts, strict=labels.stage_vo_strict).tolist(),
        "truncation_paper": truncation_paper(counts.visible).tolist(),
        "visible_stage_vo": (counts.visible >= 1).tolist(),
    }


def _without_nan(uv: FloatArray) -> list[list[Any]]:
    """``(N, 8, 2)`` as lists, with None for points that have no projection."""
    boxes: list[list[Any]] = uv.tolist()
    for i in np.flatnonzero(np.isnan(uv[..., 0]).any(axis=-1)).tolist():
        boxes[i] = [None if math.isnan(point[0]) else point for point in boxes[i]]
    return boxes


def _count_pixels(
    scene: Scene,
    chosen: NDArray[np.int64],
    optical: FloatArray,
    camera: LabelledCamera,
    evidence: ImageEvidence,
    world_from_sensor: FloatArray,
) -> Iterator[PixelVisibility]:
    """The pixels of each object."""
    poses, extents = scene.world_from_box[chosen], scene.extent[chosen]
    reaches = _reaches(scene, chosen, optical, camera)
    inflated = _to_optical(optical, box_corners(poses, extents + BOX_MARGIN_M))
    found, rays = regions(camera, inflated), rays_of(camera)
    box_from_world = np.swapaxes(poses[:, :3, :3], -1, -2)
    to_camera = world_from_sensor[:3, 3] - poses[:, :3, 3]
    origins = rotate(box_from_world, to_camera)
    box_from_optical = multiply(box_from_world, optical[:3, :3].T)
    for i, actor in enumerate(chosen.tolist()):
        fact = scene.facts[actor]
        view = BoxView(
            origin_box=origins[i],
            box_from_optical=box_from_optical[i],
            extent_m=extents[i],
            ground_m=float(scene.ground[actor]),
            region=found[i],
            reach=reaches.get(actor),
        )
        actor_id = None if fact.is_static else fact.info.id
        yield measure(view, camera.k, evidence, actor_id, fact.tags, rays)


def _reaches(
    scene: Scene, chosen: NDArray[np.int64], optical: FloatArray, camera: LabelledCamera
) -> dict[int, Reach]:
    """Of walkers whose box is a capsule's: where their arms and legs may be.

    A lens's pixel takes its id from the nearest recorded one, which may look past the box's edge by
    a pixel. So all objects in its pictures reach as far.
    """
    is_walker = [scene.facts[i].box.source == "capsule" for i in chosen.tolist()]
    actors = chosen if camera.lens is not None else chosen[is_walker]
    half_m = scene.extent[actors] + np.where(
        np.isin(actors, chosen[is_walker])[:, None], BODY_REACH_M, 0.0
    )
    if camera.lens is not None:
        away_m = length(transform_points(optical, scene.world_from_box[actors, :3, 3]))
        half_m = half_m + BOX_MARGIN_M + (away_m / camera.lens.fx)[:, None]
    corners = _to_optical(optical, box_corners(scene.world_from_box[actors], half_m))
    around = wide_regions(camera, corners)
    return {actor: Reach(*of) for actor, *of in zip(actors.tolist(), half_m, around, strict=True)}


def _rectangles(
    outline: Silhouette,
    pixels: PixelVisibility | None,
    camera: LabelledCamera,
    labels: LabelsSpec,
) -> dict[str, Any]:
    mask = pixels.mask if pixels is not None and labels.boxes_2d else None
    return {
        "bbox_amodal_unclipped": list(outline.bbox_unclipped) if labels.boxes_2d else None,
        "bbox_amodal": list(outline.bbox) if labels.boxes_2d else None,
        "bbox_modal": list(mask.bounds()) if mask is not None else None,
        "mask_modal": mask.rle(camera.width, camera.height) if mask is not None else None,
    }


def _pixel_columns(pixels: PixelVisibility | None, labels: LabelsSpec) -> dict[str, Any]:
    if pixels is None:
        return {
            "visible_px": None,
            "outside_px": None,
            "front_px": None,
            "hull_px": None,
            "amodal_px": None,
            "occlusion_ratio": None,
            "occluded_px": LEVEL_UNKNOWN,
            "visibility_method": "none",
            "amodal_method": "none",
            "visible_pixel": None,
        }
    # A silhouette between the pixel centres holds no evidence.
    known = pixels.hull_px > 0
    return {
        "visible_px": pixels.visible_px,
        "outside_px": pixels.outside_px,
        "front_px": pixels.front_px,
        "hull_px": pixels.hull_px,
        "amodal_px": pixels.amodal_px,
        "occlusion_ratio": pixels.occlusion_ratio if known else None,
        "occluded_px": occlusion_bin(pixels.occlusion_ratio) if known else LEVEL_UNKNOWN,
        "visibility_method": pixels.method,
        "amodal_method": pixels.amodal_method,
        "visible_pixel": pixels.visible_px >= labels.min_visible_px,
    }
