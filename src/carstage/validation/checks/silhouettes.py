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
    polygon_area,
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
"""By how much a box is larger whose silhouette ``outside_px`` and ``hull_px`` are about."""
OUTSIDE_TOLERANCE_PX = 2
LEAST_SHARE, LEAST_PX = 0.8, 20
"""Of an object's pixels in the instance picture, and less so many, that its row has at least."""
_EDGE_PX = 0.02
"""So far from its place may an edge of a silhouette be: poses are rounded."""
_FAR_SHARE, _SHARE_TOLERANCE = 1e-4, 1e-3
CHORD_SHARE = 0.1
"""Of an object's pixels, those at its edge that an outline of chords may cut off or add."""


@dataclass(slots=True)
class SilhouetteFigures:
    """What the checks counted: objects with pixels, their pixels, and those outside the hull."""

    objects: int = 0
    pixels: int = 0
    outside: int = 0
    farthest_px: float = 0.0

    def add(self, other: SilhouetteFigures) -> None:
        """Add the counts of other frames."""
        self.objects += other.objects
        self.pixels += other.pixels
        self.outside += other.outside
        self.farthest_px = max(self.farthest_px, other.farthest_px)

    def to_dict(self) -> dict[str, float]:
        """For the report."""
        return {
            "objects": self.objects,
            "pixels": self.pixels,
            "pixels_outside": self.outside,
            "farthest_px": round(self.farthest_px, 3),
        }


def optical_corners(
    camera: SensorCalibration,
    boxes: Sequence[LabelledBox],
    *,
    grown_m: float | NDArray[np.float64] = 0.0,
) -> NDArray[np.float64]:
    """Corners ``(N, 8, 3)`` of one or more boxes in a camera's optical frame (m).

    Args:
        camera: who looks.
        boxes: the boxes.
        grown_m: by how much they are larger, at each side.
    """
    poses = np.stack([box.ego_from_box for box in boxes])
    extents = np.stack([box.extent for box in boxes])
    in_ego = box_corners(poses, extents + grown_m)
    in_camera = transform_points(invert_pose(camera.ego_from_sensor), in_ego.reshape(-1, 3))
    return np.asarray((in_camera @ OPTICAL_FROM_SENSOR.T).reshape(in_ego.shape))


def projected_hulls(
    camera: SensorCalibration,
    boxes: Sequence[LabelledBox],
    *,
    grown_m: float | NDArray[np.float64] = 0.0,
) -> list[list[Point]]:
    """Silhouettes of boxes in a camera's image plane, px; empty when one is behind the camera.

    Of a camera with a lens one need not be convex, and ends where the lens does.

    Args:
        camera: who looks.
        boxes: the boxes.
        grown_m: by how much they are larger, at each side.
    """
    if not boxes:
        return []
    optical = optical_corners(camera, boxes, grown_m=grown_m)
    bent = camera.bent
    if bent is not None:
        outlines = [lens_outline(corners, bent) for corners in optical]
        return [[] if outline is None else outline.polygon for outline in outlines]
    whole = np.asarray((optical[..., 2] >= Z_NEAR_M).all(axis=1))
    pixels = project(np.where(whole[:, None, None], optical, 1.0), camera.k, 0.0)
    hulls = []
    for number, is_whole in enumerate(whole.tolist()):
        if is_whole:
            hulls.append(convex_hull(pixels[number]))
            continue
        seen = clip_to_near_plane(optical[number], Z_NEAR_M)
        hulls.append(convex_hull(project(seen, camera.k, 0.0)) if len(seen) >= 3 else [])
    return hulls


def outside_hull(
    camera: SensorCalibration, hull: Sequence[Point], pixels: Pixels
) -> NDArray[np.float64]:
    """Distance ``(N,)`` of the centres of pixels to what `projected_hulls` gave; 0 inside.

    Args:
        camera: who looks.
        hull: the silhouette.
        pixels: in the order of their rows, or of their columns.
    """
    v, u = pixels
    if camera.bent is None:
        ends = line_ends(pixels)
        if _is_inside(*_sides(hull), _centers(u[ends], v[ends])).all():
            return np.zeros(len(u))
        return distance_outside(hull, _centers(u, v))
    shifts = (-camera.width, 0, camera.width) if camera.bent.wraps else (0,)
    points = _centers(u, v)
    away = [
        distance_outside(hull, points + np.array([shift, 0.0]), convex=False) for shift in shifts
    ]
    return np.asarray(np.min(away, axis=0))


def _centers(u: NDArray[np.int64], v: NDArray[np.int64]) -> NDArray[np.float64]:
    return np.column_stack([u + 0.5, v + 0.5])


def line_ends(pixels: Pixels) -> NDArray[np.int64]:
    """The first and the last pixel of each row, or column: all lie in what is convex if these do.

    Args:
        pixels: in the order of their rows, or of their columns.
    """
    v, u = pixels
    line = v if (v[1:] >= v[:-1]).all() else u
    turns = np.flatnonzero(line[1:] != line[:-1])
    return np.concatenate([[0], turns, turns + 1, [len(line) - 1]]) if len(line) else turns


def distance_outside(
    polygon: Sequence[Point], points: NDArray[np.float64], *, convex: bool = True
) -> NDArray[np.float64]:
    """Distance ``(N,)`` of points ``(N, 2)`` to a polygon; 0 inside."""
    start, along = _sides(polygon)
    inside = _is_inside if convex else _crossings_are_odd
    found = np.zeros(len(points))
    # Few or none are outside: the distance costs ten times as much.
    outside = np.flatnonzero(~inside(start, along, points))
    if len(outside):
        offset = points[outside, None, :] - start[None]
        length = np.maximum(np.sum(along * along, axis=1), 1e-12)
        share = np.clip(np.einsum("nej,ej->ne", offset, along) / length, 0.0, 1.0)
        away = offset - share[..., None] * along[None]
        found[outside] = np.linalg.norm(away, axis=2).min(axis=1)
    return found


def _sides(polygon: Sequence[Point]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """``(E, 2)`` where sides begin, and the vectors along them."""
    corners = np.array(polygon)
    return corners, np.concatenate([corners[1:], corners[:1]]) - corners


def _is_inside(
    start: NDArray[np.float64], along: NDArray[np.float64], points: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Which points ``(N, 2)`` lie on the inner side of all sides of a convex polygon."""
    from_middle = start - start.mean(axis=0)
    inwards = np.sign(from_middle[:, 0] * along[:, 1] - from_middle[:, 1] * along[:, 0])
    across, up = (along[:, 1] * inwards).tolist(), (-along[:, 0] * inwards).tolist()
    u, v = points[:, 0], points[:, 1]
    inside = np.ones(len(points), np.bool_)
    for (x, y), of_u, of_v in zip(start.tolist(), across, up, strict=True):
        inside &= (u - x) * of_u + (v - y) * of_v <= 0.0
    return inside


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
    Further, ``bbox_amodal`` must be the bounds of the hull in the image, ``bbox_amodal_unclipped``
    those of all of it, and ``truncated`` the share outside (``bbox_amodal``). ``hull_px`` must
    count the pixels in it (``hull``). The mask must have ``visible_px`` pixels, the bounds
    ``bbox_modal`` and, with an instance image, only pixels of that id (``mask``).

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
    known = [(row, box) for row in rows if (box := by_track.get(row["track_id"])) is not None]
    if not known or not camera.is_projective:
        return
    hulls = projected_hulls(camera, [box for _, box in known])
    around = _Around(camera, known)
    codes = None if instance is None else InstancePixels(instance)
    for (row, box), hull in zip(known, hulls, strict=True):
        name = f"object {row['track_id']}"
        if len(hull) < 3:
            findings.add("hull", f"{name} is labelled, but its box is out of view", **where)
            continue
        _check_amodal(camera, name, row, hull, findings, where)
        if box.track_id in around.grown:
            check_hull_px(camera, name, row, around.grown[box.track_id], findings, where)
        mask = _mask(camera, name, row, findings, where)
        if not row["visible_px"]:
            continue
        # Where two actors share the bits of an id, the image cannot tell whose pixels they are,
        # and it never does of level objects.
        if codes is None or row["instance_ambiguous"] or box.is_static:
            own = mask
        else:
            own = codes.of(box)
            if mask is not None and not codes.are_of(box, mask).all():
                message = f"{name}: its mask has pixels of another instance id"
                findings.add("mask", message, **where)
        if own is None:
            continue
        if row.get("outside_px") is not None:
            outline = around.grown.get(box.track_id) if box.track_id in around.left else None
            _check_outside(camera, name, row, outline, own, findings, where)
            hull = around.bodies.get(box.track_id, hull)
        beyond = outside_hull(camera, hull, own)
        outside, count = int((beyond > HULL_MARGIN_PX).sum()), len(beyond)
        figures.objects += 1
        figures.pixels += count
        figures.outside += outside
        figures.farthest_px = max(figures.farthest_px, float(beyond.max(initial=0.0)))
        if own is not mask:
            _check_share(name, row, count - outside, findings, where)
        if outside:
            findings.add(
                "hull",
                f"{name}: {outside} of its {count} pixels lie outside the projection of its box, "
                f"the farthest by {beyond.max():.1f} px",
                **where,
            )


class _Around:
    """Silhouettes of boxes that are grown.

    Args:
        camera: who looks.
        known: rows of ``camera_objects.parquet``, each with the box.

    Attributes:
        grown: by track, of the boxes with a margin, which ``hull_px`` and ``outside_px`` are about.
        bodies: by track, of the space that a walker's arms and legs reach.
        left: tracks whose pixels may lie outside: limbs leave a walker's capsule, and a lens's
            pixels are as near as they can be.
    """

    def __init__(
        self, camera: SensorCalibration, known: Sequence[tuple[Mapping[str, Any], LabelledBox]]
    ) -> None:
        measured = [box for row, box in known if row["hull_px"] is not None]
        counted = [
            box for row, box in known if row["visible_px"] and row.get("outside_px") is not None
        ]
        capsules = [box for box in counted if box.is_capsule]
        self.grown = _by_track(measured, projected_hulls(camera, measured, grown_m=BOX_MARGIN_M))
        self.bodies = _by_track(capsules, projected_hulls(camera, capsules, grown_m=BODY_REACH_M))
        self.left = {box.track_id for box in (counted if camera.bent is not None else capsules)}


def _by_track(boxes: Sequence[LabelledBox], hulls: Sequence[list[Point]]) -> dict[int, list[Point]]:
    return {box.track_id: hull for box, hull in zip(boxes, hulls, strict=True)}


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


class InstancePixels:
    """Whose the pixels of an instance image are.

    Args:
        image: ``(H, W, 2)`` id and tag.
    """

    def __init__(self, image: NDArray[np.uint16]) -> None:
        self._width = max(image.shape[1], 1)
        self._ids = np.ascontiguousarray(image[..., Instance.ID])
        self._tags = np.ascontiguousarray(image[..., Instance.TAG])

    def of(self, box: LabelledBox) -> Pixels:
        """The pixels of an object's id with a tag that it has, row by row."""
        places = np.flatnonzero(self._ids == (box.track_id & 0xFFFF))
        rows, columns = np.divmod(places[_any_of(self._tags.ravel()[places], box)], self._width)
        return rows, columns

    def are_of(self, box: LabelledBox, pixels: Pixels) -> NDArray[np.bool_]:
        """Which of some pixels ``(N,)`` are."""
        is_its_id: NDArray[np.bool_] = self._ids[pixels] == (box.track_id & 0xFFFF)
        return is_its_id & _any_of(self._tags[pixels], box)


def _any_of(tags: NDArray[np.uint16], box: LabelledBox) -> NDArray[np.bool_]:
    """Which tags ``(N,)`` an object has; it has one or two."""
    found = np.zeros(len(tags), np.bool_)
    for tag in box.tags:
        found |= tags == tag
    return found


def _check_share(
    name: str, row: Mapping[str, Any], shown: int, findings: Findings, where: dict[str, Any]
) -> None:
    """Whether an object's row has most of its pixels that are where its box is."""
    if row["visible_px"] < LEAST_SHARE * shown - LEAST_PX:
        findings.add(
            "mask",
            f"{name}: visible_px is {row['visible_px']}, and the instance picture shows "
            f"{shown} pixels of it where its box is",
            **where,
        )


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
    for column, polygon in (("bbox_amodal", inside), ("bbox_amodal_unclipped", hull)):
        if row[column] is None:
            continue  # the check of nulls says so
        wanted = np.array(bounds(polygon))
        difference = np.abs(wanted - row[column])
        # Where a box reaches behind the camera its outline ends far away.
        if (difference > BOX_TOLERANCE_PX + _FAR_SHARE * np.abs(wanted)).any():
            findings.add(
                "bbox_amodal",
                f"{name}: {column} is {difference.max():.1f} px off the projection of its box",
                **where,
            )
    if camera.bent is None:
        truncated = 1.0 - polygon_area(inside) / polygon_area(hull)
        if row["truncated"] is not None and abs(row["truncated"] - truncated) > _SHARE_TOLERANCE:
            findings.add(
                "bbox_amodal",
                f"{name}: truncated is {row['truncated']:.4f}, outside lies {truncated:.4f} of it",
                **where,
            )


def check_hull_px(
    camera: SensorCalibration,
    name: str,
    row: Mapping[str, Any],
    hull: list[Point],
    findings: Findings,
    where: dict[str, Any],
) -> None:
    """``hull_px`` counts the centres of pixels inside the silhouette of the box with a margin."""
    if camera.bent is not None or len(hull) < 3:
        return
    inside = centres_inside(hull, camera.width, camera.height)
    if abs(inside - row["hull_px"]) <= OUTSIDE_TOLERANCE_PX:
        return
    # An edge along a column of centres: rounding of poses decides for all of them.
    fewest, most = (
        centres_inside(_grown(hull, by_px), camera.width, camera.height)
        for by_px in (-_EDGE_PX, _EDGE_PX)
    )
    if not fewest - OUTSIDE_TOLERANCE_PX <= row["hull_px"] <= most + OUTSIDE_TOLERANCE_PX:
        findings.add(
            "hull",
            f"{name}: the silhouette of its box has {inside} pixels, hull_px is {row['hull_px']}",
            **where,
        )


def _grown(hull: Sequence[Point], by_px: float) -> list[Point]:
    """The outline with its bounds so much farther out on each side."""
    corners = np.array(hull, np.float64)
    low, high = corners.min(axis=0), corners.max(axis=0)
    share = 1.0 + 2.0 * by_px / np.maximum(high - low, 2.0 * abs(by_px))
    middle = 0.5 * (low + high)
    return [(float(u), float(v)) for u, v in middle + (corners - middle) * share]


def centres_inside(hull: Sequence[Point], width: int, height: int) -> int:
    """Number of an image's pixels whose centres lie in a convex polygon (px)."""
    corners = np.array(hull, np.float64)
    first, last = np.clip(
        np.array([corners[:, 1].min(), corners[:, 1].max()]).round(), 0, height
    ).astype(np.int64)
    y = np.arange(first, last) + 0.5
    left, right = np.full(len(y), np.inf), np.full(len(y), -np.inf)
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        met = (y >= min(y0, y1)) & (y <= max(y0, y1)) & (y0 != y1)
        x = x0 + (x1 - x0) * (y[met] - y0) / (y1 - y0) if met.any() else 0.0
        left[met], right[met] = np.minimum(left[met], x), np.maximum(right[met], x)
    begin = np.clip(np.ceil(left - 0.5), 0, width)
    end = np.clip(np.floor(right - 0.5) + 1.0, 0, width)
    return int(np.maximum(end - begin, 0.0).sum())


def _check_outside(
    camera: SensorCalibration,
    name: str,
    row: Mapping[str, Any],
    grown: list[Point] | None,
    pixels: Pixels,
    findings: Findings,
    where: dict[str, Any],
) -> None:
    """``outside_px`` counts the pixels outside the silhouette; walkers and lenses have such.

    ``grown`` is the silhouette of the box with a margin; None where no pixel can leave the box.
    """
    outside, allowed = 0, 0 if grown is None else OUTSIDE_TOLERANCE_PX
    if camera.bent is not None:  # whose outline is a polygon of chords
        allowed = OUTSIDE_TOLERANCE_PX + round(CHORD_SHARE * len(pixels[0]))
    if grown is not None:
        outside = int((outside_hull(camera, grown, pixels) > 0.0).sum())
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
