"""Pixels of an object lie inside the projection of its box; 2D boxes and masks follow from both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.dataset.calibration import SensorCalibration
from carstage.dataset.masks import mask_pixels
from carstage.errors import DatasetError
from carstage.geometry import (
    OPTICAL_FROM_SENSOR,
    Z_NEAR_M,
    Point,
    bounds,
    box_corners,
    clip_polygon_to_image,
    clip_to_near_plane,
    convex_hull,
    invert_pose,
    lens_outline,
    project,
    transform_points,
)
from carstage.sensor_kinds.columns import Instance
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labels import LabelledBox

Pixels = tuple[NDArray[np.int64], NDArray[np.int64]]
"""Rows and columns of pixels."""
HULL_MARGIN_PX = 2.0
BOX_TOLERANCE_PX = 0.5
BODY_REACH_M = np.array([0.5, 0.5, 0.2])
"""How far a walker's arms and legs may leave its capsule's box: along, across, up and down."""
BOX_MARGIN_M = 0.05
"""By how much a box is larger whose silhouette ``outside_px`` is about."""
OUTSIDE_TOLERANCE_PX = 2
CHORD_SHARE = 0.1
"""Of an object's pixels, those at its edge that an outline of chords may cut off or add."""


@dataclass(slots=True)
class SilhouetteFigures:
    """What the checks counted: objects with pixels, their pixels, and those outside the hull."""

    objects: int = 0
    pixels: int = 0
    outside: int = 0
    farthest_px: float = 0.0

    def to_dict(self) -> dict[str, float]:
        """For the report."""
        return {
            "objects": self.objects,
            "pixels": self.pixels,
            "pixels_outside": self.outside,
            "farthest_px": round(self.farthest_px, 3),
        }


def projected_hull(
    camera: SensorCalibration, box: LabelledBox, *, grown_m: float | NDArray[np.float64] = 0.0
) -> list[Point]:
    """Silhouette of a box in a camera's image plane, px; empty when it is behind the camera.

    Of a camera with a lens it need not be convex, and ends where the lens does.

    Args:
        camera: who looks.
        box: the box.
        grown_m: by how much it is larger, at each side.
    """
    corners = transform_points(
        invert_pose(camera.ego_from_sensor), box_corners(box.ego_from_box, box.extent + grown_m)
    )
    optical = corners @ OPTICAL_FROM_SENSOR.T
    if camera.bent is not None:
        outline = lens_outline(optical, camera.bent)
        return [] if outline is None else outline.polygon
    seen = clip_to_near_plane(optical, Z_NEAR_M)
    return convex_hull(project(seen, camera.k, 0.0)) if len(seen) >= 3 else []


def outside_hull(
    camera: SensorCalibration, hull: Sequence[Point], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Distance ``(N,)`` of points ``(N, 2)`` to what `projected_hull` gave; 0 inside."""
    if camera.bent is None:
        return distance_outside(hull, points)
    shifts = (-camera.width, 0, camera.width) if camera.bent.wraps else (0,)
    away = [
        distance_outside(hull, points + np.array([shift, 0.0]), convex=False) for shift in shifts
    ]
    return np.asarray(np.min(away, axis=0))


def distance_outside(
    polygon: Sequence[Point], points: NDArray[np.float64], *, convex: bool = True
) -> NDArray[np.float64]:
    """Distance ``(N,)`` of points ``(N, 2)`` to a polygon; 0 inside."""
    corners = np.array(polygon)
    start, along = corners, np.roll(corners, -1, axis=0) - corners
    if convex:
        normals = np.stack([along[:, 1], -along[:, 0]], axis=1)
        normals *= np.sign(np.sum((corners - corners.mean(axis=0)) * normals, axis=1))[:, None]
        inside = np.ones(len(points), np.bool_)
        for (x, y), (across, up) in zip(start.tolist(), normals.tolist(), strict=True):
            inside &= (points[:, 0] - x) * across + (points[:, 1] - y) * up <= 0.0
    else:
        inside = _crossings_are_odd(start, along, points)
    found = np.zeros(len(points))
    outside = np.flatnonzero(~inside)  # few or none: the distance costs ten times as much
    if len(outside):
        offset = points[outside, None, :] - start[None]
        length = np.maximum(np.sum(along * along, axis=1), 1e-12)
        share = np.clip(np.einsum("nej,ej->ne", offset, along) / length, 0.0, 1.0)
        away = offset - share[..., None] * along[None]
        found[outside] = np.linalg.norm(away, axis=2).min(axis=1)
    return found


def _crossings_are_odd(
    start: NDArray[np.float64], along: NDArray[np.float64], points: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Which points ``(N, 2)`` a ray to the right from crosses sides of a polygon oddly often."""
    odd = np.zeros(len(points), np.bool_)
    for (x, y), (across, down) in zip(start.tolist(), along.tolist(), strict=True):
        if down:
            spans = (points[:, 1] >= y) != (points[:, 1] >= y + down)
            odd ^= spans & (points[:, 0] < x + across * (points[:, 1] - y) / down)
    return odd


def check_silhouettes(
    camera: SensorCalibration,
    k: int,
    rows: Sequence[Mapping[str, Any]],
    boxes: Sequence[LabelledBox],
    instance: NDArray[np.uint16] | None,
    figures: SilhouetteFigures,
    findings: Findings,
) -> None:
    """Check the 2D labels of one camera in one frame.

    For every object with visible pixels, all pixels of its instance id (the low 16 bits of the
    actor id, with a tag that the actor has) must have their centres inside the projected hull of
    its box, grown by 2 px (check ``hull``); of walkers, of the space that arms and legs reach, with
    ``outside_px`` of them outside the box's silhouette. The pixels come from the instance image
    with the camera's pose, if the rig has one and no other actor shares the bits, else from
    ``mask_modal``, as those of level objects do.
    Further, ``bbox_amodal`` must be the bounds of the hull in the image (``bbox_amodal``), the mask
    must have ``visible_px`` pixels, the bounds ``bbox_modal`` and, with an instance image, only
    pixels of that id (``mask``).

    Args:
        camera: the labelled camera.
        k: the frame.
        rows: its rows of ``camera_objects.parquet``.
        boxes: the frame's 3D boxes.
        instance: ``(H, W, 2)`` id and tag of the instance sensor with the same pose, if any.
        figures: counts, added to.
        findings: where problems go.
    """
    by_track = {box.track_id: box for box in boxes}
    where: dict[str, Any] = {"frame": k, "sensor": camera.id}
    ids = None if instance is None else np.ascontiguousarray(instance[..., Instance.ID])
    for row in rows:
        box = by_track.get(row["track_id"])
        if box is None or not camera.is_projective:
            continue
        name = f"object {row['track_id']}"
        hull = projected_hull(camera, box)
        if len(hull) < 3:
            findings.add("hull", f"{name} is labelled, but its box is out of view", **where)
            continue
        _check_amodal(camera, name, row, hull, findings, where)
        mask = _mask(camera, name, row, findings, where)
        if not row["visible_px"]:
            continue
        # Where two actors share the bits of an id, the image cannot tell whose pixels they are,
        # and it never does of level objects.
        if instance is None or ids is None or row["instance_ambiguous"] or box.is_static:
            own = mask
        else:
            own, is_own = _own_pixels(ids, instance, box)
            if mask is not None and not is_own[mask].all():
                message = f"{name}: its mask has pixels of another instance id"
                findings.add("mask", message, **where)
        if own is None:
            continue
        v, u = own
        centers = np.column_stack([u + 0.5, v + 0.5])
        if row.get("outside_px") is not None:
            _check_outside(camera, name, row, box, centers, findings, where)
            if box.is_capsule:
                hull = projected_hull(camera, box, grown_m=BODY_REACH_M)
        beyond = outside_hull(camera, hull, centers)
        outside = int((beyond > HULL_MARGIN_PX).sum())
        figures.objects += 1
        figures.pixels += len(u)
        figures.outside += outside
        figures.farthest_px = max(figures.farthest_px, float(beyond.max(initial=0.0)))
        if outside:
            findings.add(
                "hull",
                f"{name}: {outside} of its {len(u)} pixels lie outside the projection of its box, "
                f"the farthest by {beyond.max():.1f} px",
                **where,
            )


def visible_objects(
    camera: SensorCalibration, rows: Sequence[Mapping[str, Any]]
) -> NDArray[np.int64]:
    """``(H, W)`` track ids by the masks of a camera's rows, -1 where there is no object."""
    objects = np.full((camera.height, camera.width), -1, np.int64)
    for row in rows:
        if row["mask_modal"] is not None:
            try:
                pixels = mask_pixels(row["mask_modal"], camera.height, camera.width)
            except DatasetError:
                continue  # check_silhouettes reports it
            objects[pixels] = row["track_id"]
    return objects


def _own_pixels(
    ids: NDArray[np.uint16], instance: NDArray[np.uint16], box: LabelledBox
) -> tuple[Pixels, NDArray[np.bool_]]:
    """Pixels of an object's id with a tag that it has, and where they are, ``(H, W)``."""
    is_own: NDArray[np.bool_] = ids == (box.track_id & 0xFFFF)
    rows, columns = np.divmod(np.flatnonzero(is_own), max(ids.shape[1], 1))
    fits = np.isin(instance[rows, columns, Instance.TAG], list(box.tags))
    is_own[rows[~fits], columns[~fits]] = False
    return (rows[fits], columns[fits]), is_own


def _check_amodal(
    camera: SensorCalibration,
    name: str,
    row: Mapping[str, Any],
    hull: list[Point],
    findings: Findings,
    where: dict[str, Any],
) -> None:
    if row["bbox_amodal"] is None:
        return
    shifts = (-camera.width, 0, camera.width) if camera.bent and camera.bent.wraps else (0,)
    inside = [
        point
        for shift in shifts
        for point in clip_polygon_to_image(
            [(u + shift, v) for u, v in hull], camera.width, camera.height
        )
    ]
    if not inside:
        findings.add("bbox_amodal", f"{name} is labelled, but out of the image", **where)
        return
    difference = np.abs(np.array(bounds(inside)) - row["bbox_amodal"]).max()
    if difference > BOX_TOLERANCE_PX:
        findings.add(
            "bbox_amodal",
            f"{name}: bbox_amodal is {difference:.1f} px off the projection of its box",
            **where,
        )


def _check_outside(
    camera: SensorCalibration,
    name: str,
    row: Mapping[str, Any],
    box: LabelledBox,
    centers: NDArray[np.float64],
    findings: Findings,
    where: dict[str, Any],
) -> None:
    """``outside_px`` counts the pixels outside the silhouette; walkers and lenses have such."""
    outside, allowed = 0, OUTSIDE_TOLERANCE_PX * int(box.is_capsule)
    if camera.bent is not None:  # whose outline is a polygon of chords
        allowed = OUTSIDE_TOLERANCE_PX + round(CHORD_SHARE * len(centers))
    if box.is_capsule or camera.bent is not None:
        hull = projected_hull(camera, box, grown_m=BOX_MARGIN_M)
        outside = int((outside_hull(camera, hull, centers) > 0.0).sum())
    if abs(outside - row["outside_px"]) > allowed:
        findings.add(
            "hull",
            f"{name}: {outside} of its pixels lie outside the silhouette of its box, outside_px is "
            f"{row['outside_px']}",
            **where,
        )


def _mask(
    camera: SensorCalibration,
    name: str,
    row: Mapping[str, Any],
    findings: Findings,
    where: dict[str, Any],
) -> Pixels | None:
    if row["mask_modal"] is None:
        return None
    try:
        v, u = mask_pixels(row["mask_modal"], camera.height, camera.width)
    except DatasetError as error:
        findings.add("mask", f"{name}: {error}", **where)
        return None
    if len(u) != row["visible_px"]:
        findings.add(
            "mask",
            f"{name}: {len(u)} pixels in its mask, visible_px is {row['visible_px']}",
            **where,
        )
    elif len(u) and row["bbox_modal"] != [u.min(), v.min(), u.max() + 1, v.max() + 1]:
        findings.add("mask", f"{name}: bbox_modal does not bound its mask", **where)
    return v, u
