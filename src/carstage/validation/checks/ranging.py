"""LiDAR and depth see the same surfaces, and the points in a box are those that were counted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from carstage.dataset.calibration import SensorCalibration
from carstage.geometry import (
    OPTICAL_FROM_SENSOR,
    Z_NEAR_M,
    invert_pose,
    length,
    transform_points,
)
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labels import LabelledBox

ABSOLUTE_TOLERANCE_M = 0.1
RELATIVE_TOLERANCE = 0.01
PARALLAX_PX = 1.0
EDGE_BEND = 0.05
MIN_SHARE = 0.99
MIN_FRAME_SHARE = 0.95
MIN_FRAME_POINTS = 200
MIN_EPISODE_POINTS = 1000
"""Of fewer points, two leaves at the edge of a coarse picture are more than a hundredth."""
BOX_SKIN_M = 0.01

_NEIGHBOURS = [(dv, du) for dv in (-1, 0, 1) for du in (-1, 0, 1)]


@dataclass(slots=True)
class RangingFigures:
    """Counts of one pair of LiDAR and depth camera: points in view, comparable, agreeing."""

    in_view: int = 0
    comparable: int = 0
    agreeing: int = 0

    @property
    def share(self) -> float | None:
        """Share of the comparable points that agree; ``None`` without any."""
        return self.agreeing / self.comparable if self.comparable else None

    def add(self, other: RangingFigures) -> None:
        """Add the counts of another frame."""
        self.in_view += other.in_view
        self.comparable += other.comparable
        self.agreeing += other.agreeing

    def to_dict(self) -> dict[str, float | None]:
        """For the report."""
        share = self.share
        return {
            "points_in_view": self.in_view,
            "points_comparable": self.comparable,
            "points_agreeing": self.agreeing,
            "share": None if share is None else round(share, 6),
        }


def compare_with_depth(
    points: NDArray[np.floating[Any]],
    lidar: SensorCalibration,
    depth_m: NDArray[np.float32],
    camera: SensorCalibration,
) -> RangingFigures:
    """Count the points of one sweep that a depth image of the same frame confirms.

    *In view*: the point projects into the image, at least one pixel from its border.

    *Agreeing*: its depth Z differs by less than 0.1 m + 1 % of Z from the depth image there,
    either interpolated (linearly in 1/depth, which is exact on planes, so that a road seen at a
    grazing angle agrees) or at any of the 3 x 3 pixels around it (so that it may belong to
    either side of an edge).

    *Comparable*, that is "the depth image can see it": resolved, and not hidden by parallax.

    Unresolved is a point at an edge of the depth image (its inverse is no plane over the 3 x 3
    pixels: it bends by more than 5 %) whose depth lies between the nearest and the farthest of
    those pixels: leaves and other things finer than a pixel, of which the image holds one sample.

    Hidden by parallax: the two sensors stand apart, so the camera may see something nearer in
    the point's pixel. Such a nearer surface hides the point only if it does not stand in the
    LiDAR's own ray: seen from the LiDAR its direction must differ from the point's by more than
    one pixel (then the 3 x 3 pixels reach beyond its edge). A nearer surface in the same
    direction would have stopped the ray, and counts against the data; so does any point in front
    of what the camera sees.

    Args:
        points: ``(N, 3)`` or wider in the LiDAR's axes.
        lidar: the LiDAR's calibration.
        depth_m: ``(H, W)`` float32.
        camera: the depth camera's calibration.
    """
    lidar_from_camera = invert_pose(lidar.ego_from_sensor) @ camera.ego_from_sensor
    right, down, forward = OPTICAL_FROM_SENSOR @ invert_pose(lidar_from_camera)[:3]
    xyz = points[:, :3].astype(np.float64).T
    z = _along(forward, xyz)
    if camera.bent is None:
        ahead = np.flatnonzero(z >= Z_NEAR_M)
        xyz, z = xyz[:, ahead], z[ahead]
        u = camera.k[0, 0] * _along(right, xyz) / z + camera.k[0, 2]
        v = camera.k[1, 1] * _along(down, xyz) / z + camera.k[1, 2]
    else:
        optical = np.column_stack([_along(right, xyz), _along(down, xyz), z])
        ahead = np.flatnonzero(camera.bent.shows(optical))
        xyz, z = xyz[:, ahead], camera.bent.depth(optical[ahead])
        u, v = camera.bent.project(optical[ahead]).T
    height, width = depth_m.shape
    inside = np.flatnonzero((u >= 1) & (u < width - 1) & (v >= 1) & (v < height - 1))
    xyz, z, u, v = xyz[:, inside].T, z[inside], u[inside], v[inside]
    column, row = np.floor(u).astype(np.intp), np.floor(v).astype(np.intp)

    tolerance_m = ABSOLUTE_TOLERANCE_M + RELATIVE_TOLERANCE * z
    agrees = np.abs(_interpolated(depth_m, u, v) - z) < tolerance_m
    # What agrees is comparable: the rest of the work is for the few that do not.
    rest = np.flatnonzero(~agrees)
    rest = rest[~_agrees_nearby(depth_m, row[rest], column[rest], z[rest], tolerance_m[rest])]
    row, column, z, tolerance_m = row[rest], column[rest], z[rest], tolerance_m[rest]

    nearest_m, farthest_m, bend = _neighbourhood(depth_m, row, column)
    between = (z > nearest_m - tolerance_m) & (z < farthest_m + tolerance_m)
    unresolved = (bend > EDGE_BEND) & between

    surface_m = depth_m[row, column].astype(np.float64)
    surface_optical = camera.back_project(np.column_stack([u[rest], v[rest]]), surface_m)
    surface = transform_points(lidar_from_camera, surface_optical @ OPTICAL_FROM_SENSOR)
    hidden = (surface_m < z) & (_angle(surface, xyz[rest]) > PARALLAX_PX / camera.k[0, 0])
    agreeing = len(u) - len(rest)
    return RangingFigures(len(u), agreeing + int((~(hidden | unresolved)).sum()), agreeing)


def _along(axis: NDArray[np.float64], xyz: NDArray[np.float64]) -> NDArray[np.float64]:
    """``(N,)`` coordinates of points ``(3, N)`` along one row of a pose ``(4,)``."""
    x, y, z = xyz
    return np.asarray(axis[0] * x + axis[1] * y + axis[2] * z + axis[3])


def _agrees_nearby(
    depth_m: NDArray[np.float32],
    row: NDArray[np.intp],
    column: NDArray[np.intp],
    z: NDArray[np.float64],
    tolerance_m: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Whether a depth is that of any of the 3 x 3 pixels around it."""
    agrees = np.zeros(len(z), np.bool_)
    for dv, du in _NEIGHBOURS:
        agrees |= np.abs(depth_m[row + dv, column + du] - z) < tolerance_m
    return agrees


def _neighbourhood(
    depth_m: NDArray[np.float32], row: NDArray[np.intp], column: NDArray[np.intp]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Nearest and farthest depth of the 3 x 3 pixels, and how far their inverse bends.

    On a plane 1/depth is linear in the pixel: the second difference through the middle is 0 in
    all four directions. The bend is the greatest of the four over the middle's 1/depth.
    """
    around = np.stack([depth_m[row + dv, column + du] for dv, du in _NEIGHBOURS]).astype(np.float64)
    inverse = 1.0 / np.maximum(around, 1e-3)
    middle = len(_NEIGHBOURS) // 2
    second = inverse[:middle] + inverse[:middle:-1] - 2.0 * inverse[middle]
    bend = np.abs(second).max(axis=0) / inverse[middle]
    return around.min(axis=0), around.max(axis=0), bend


def _interpolated(
    depth_m: NDArray[np.float32], u: NDArray[np.float64], v: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Depth between pixel centres, bilinear in its inverse."""
    x, y = u - 0.5, v - 0.5
    x0, y0 = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
    fx, fy = x - x0, y - y0

    def inverse(row: NDArray[np.intp], column: NDArray[np.intp]) -> NDArray[np.float64]:
        return np.asarray(1.0 / np.maximum(depth_m[row, column], 1e-3).astype(np.float64))

    top = inverse(y0, x0) * (1 - fx) + inverse(y0, x0 + 1) * fx
    bottom = inverse(y0 + 1, x0) * (1 - fx) + inverse(y0 + 1, x0 + 1) * fx
    return np.asarray(1.0 / (top * (1 - fy) + bottom * fy))


def _angle(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle (rad) between the vectors ``(N, 3)`` of two arrays, exact for small ones."""
    cross = np.linalg.norm(np.cross(a, b), axis=1)
    return np.asarray(np.arctan2(cross, np.sum(a * b, axis=1)))


def check_share(
    figures: RangingFigures,
    lidar_id: str,
    camera_id: str,
    findings: Findings,
    *,
    frame: int | None = None,
) -> None:
    """Report a pair whose share of agreeing points is too low (check ``lidar_depth``).

    Over an episode 99 % must agree, of fewer than 1,000 points 95 %; in a single frame 95 %, if at
    least 200 points compare.
    """
    share = figures.share
    many = frame is None and figures.comparable >= MIN_EPISODE_POINTS
    limit = MIN_SHARE if many else MIN_FRAME_SHARE
    few = frame is not None and figures.comparable < MIN_FRAME_POINTS
    if share is None or share >= limit or few:
        return
    findings.add(
        "lidar_depth",
        f"{share:.2%} of {figures.comparable} points agree with the depth of {camera_id}; "
        f"at least {limit:.0%} must",
        frame=frame,
        sensor=lidar_id,
    )


def check_point_counts(
    points: NDArray[np.floating[Any]],
    sensor: SensorCalibration,
    k: int,
    boxes: Sequence[LabelledBox],
    findings: Findings,
    by: Literal["lidar", "radar"] = "lidar",
) -> int:
    """Recount the points inside each box (checks ``lidar_counts``, ``radar_counts``).

    The label must lie between the counts of the box shrunk and grown by 1 cm, which is more than
    rounding can move a point.

    Args:
        points: ``(N, 3 or more)`` x, y, z (m) in the sensor's axes.
        sensor: the LiDAR, or the radar.
        k: the frame.
        boxes: of the frame.
        findings: where problems go.
        by: what the sensor is.

    Returns:
        Points inside boxes, the ego's own left out.
    """
    xyz = points[:, :3].astype(np.float64).T
    x, y, z = (_along(axis, xyz) for axis in sensor.ego_from_sensor[:3])
    order = np.argsort(x)
    x, y, z = x[order], y[order], z[order]
    counted = [box for box in boxes if box.points.get(sensor.id) is not None]
    if not counted:
        return 0
    centers = np.stack([box.ego_from_box[:3, 3] for box in counted])
    reaches = length(np.stack([box.extent for box in counted])) + BOX_SKIN_M
    firsts, ends = (
        np.searchsorted(x, centers[:, 0] + side).tolist() for side in (-reaches, reaches)
    )
    total = 0
    for box, first, end, center, reach in zip(
        counted, firsts, ends, centers.tolist(), reaches.tolist(), strict=True
    ):
        labelled = box.points[sensor.id]
        near = first + np.flatnonzero(
            (np.abs(y[first:end] - center[1]) <= reach)
            & (np.abs(z[first:end] - center[2]) <= reach)
        )
        fewest = most = 0
        if len(near):
            in_ego = np.column_stack([x[near], y[near], z[near]])
            local = np.abs(transform_points(invert_pose(box.ego_from_box), in_ego))
            fewest, most = (
                int((local <= box.extent + skin).all(axis=1).sum())
                for skin in (-BOX_SKIN_M, BOX_SKIN_M)
            )
        total += 0 if box.is_ego else labelled
        if not fewest <= labelled <= most:
            findings.add(
                f"{by}_counts",
                f"object {box.track_id}: num_{by}_points is {labelled}, its box holds "
                + (f"{fewest}" if fewest == most else f"{fewest} to {most}"),
                frame=k,
                sensor=sensor.id,
            )
    return total


def check_intensity(
    points: NDArray[np.floating[Any]], lidar_id: str, k: int, findings: Findings
) -> None:
    """Report intensities that no LiDAR gives (check ``lidar_intensity``): they lie in [0, 1].

    Args:
        points: ``(N, 4)`` x, y, z (m), intensity.
        lidar_id: the LiDAR.
        k: the frame.
        findings: where problems go.
    """
    if not len(points):
        return
    low, high = float(points[:, 3].min()), float(points[:, 3].max())
    if not (low >= 0.0 and high <= 1.0) or high == 0.0:
        findings.add(
            "lidar_intensity",
            f"intensities lie in {low:.4g} to {high:.4g}, not within 0 to 1 and above 0",
            frame=k,
            sensor=lidar_id,
        )
