"""Pictures of data and labels: boxes on camera images, depth and ids in colours, bird's eye."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from carstage.dataset.calibration import SensorCalibration
from carstage.geometry import (
    EDGES,
    OPTICAL_FROM_SENSOR,
    Z_NEAR_M,
    Lens,
    box_corners,
    invert_pose,
    project,
    transform_points,
)
from carstage.sensor_kinds.columns import Instance
from carstage.sensor_kinds.model import DEPTH, FLOW, INSTANCES, TAGS
from carstage.validation.checks.labels import LabelledBox

RgbColour = tuple[int, int, int]

CLASS_COLOURS: dict[str, RgbColour] = {
    "car": (58, 150, 255),
    "van": (26, 188, 180),
    "truck": (255, 159, 28),
    "bus": (178, 124, 255),
    "motorcycle": (255, 105, 180),
    "bicycle": (96, 204, 72),
    "walker_adult": (255, 82, 82),
    "walker_child": (255, 196, 61),
    "walker_wheelchair": (236, 112, 99),
    "rider": (255, 140, 200),
    "traffic_light": (250, 210, 40),
    "traffic_sign": (200, 240, 120),
}
OTHER_COLOUR: RgbColour = (200, 200, 200)
_FORWARD_FACE = (4, 5, 7, 6)  # corners with positive x, around the face
_BENT_PARTS = 16
_VIEW_PX = 640
_VIEW_RANGE_M = 50.0
_RING_STEP_M = 10.0
_FAR_M = 120.0
_NEAR_M = 1.5
_APPROACHING: RgbColour = (255, 70, 70)
_RECEDING: RgbColour = (90, 140, 255)
_STANDING: RgbColour = (240, 240, 240)
_GOLDEN_RATIO = 0.6180339887498949


def class_colour(name: str) -> RgbColour:
    """The colour of a class in every picture and chart."""
    return CLASS_COLOURS.get(name, OTHER_COLOUR)


def draw_boxes_3d(
    rgb: NDArray[np.uint8],
    camera: SensorCalibration,
    boxes: Sequence[tuple[LabelledBox, RgbColour]],
) -> Image.Image:
    """A camera image with the edges of boxes; the face in driving direction is crossed."""
    picture = Image.fromarray(rgb)
    draw = ImageDraw.Draw(picture)
    line = max(1, round(camera.width / 400))
    for box, colour in boxes:
        for start, end in box_lines(camera, box.ego_from_box, box.extent):
            draw.line([tuple(start), tuple(end)], fill=colour, width=line)
    return picture


def box_lines(
    camera: SensorCalibration, ego_from_box: NDArray[np.float64], extent: NDArray[np.float64]
) -> list[list[list[float]]]:
    """The edges of a box and the cross on its face in driving direction, as a camera sees them.

    Args:
        camera: with ``ego_from_sensor`` of the frame.
        ego_from_box: ``(4, 4)``.
        extent: ``(3,)`` half sizes (m).

    Returns:
        Segments, each ``[[u, v], [u, v]]`` in px, cut at the near plane and an image's width
        around the image.
    """
    corners = transform_points(
        invert_pose(camera.ego_from_sensor), box_corners(ego_from_box, extent)
    )
    optical = corners @ OPTICAL_FROM_SENSOR.T
    a, b, c, d = _FORWARD_FACE
    if camera.bent is not None:
        return _bent_lines(camera.bent, optical, (*EDGES, (a, c), (b, d)))
    lines = []
    for start, end in (*EDGES, (a, c), (b, d)):
        ends = _before_camera(optical[start], optical[end])
        if ends is not None:
            seen = _near_image(project(ends, camera.k, 0.0), camera.width, camera.height)
            if seen is not None:
                lines.append(seen.tolist())
    return lines


def _bent_lines(
    lens: Lens, optical: NDArray[np.float64], pairs: Sequence[tuple[int, int]]
) -> list[list[list[float]]]:
    """Segments of lines that a lens bends, without those that jump over the picture's edge."""
    share = np.linspace(0.0, 1.0, _BENT_PARTS + 1)[:, None]
    lines = []
    for start, end in pairs:
        uv = lens.project(optical[start] * (1.0 - share) + optical[end] * share)
        for one, next_one in pairwise(uv):
            jump = np.abs(next_one - one).max()
            if jump < lens.width / 4.0:  # false where the lens shows none
                lines.append([one.tolist(), next_one.tolist()])
    return lines


def _before_camera(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """The part of a segment in front of the near plane."""
    if max(a[2], b[2]) < Z_NEAR_M:
        return None
    ends = [a, b]
    for i, j in ((0, 1), (1, 0)):
        if ends[i][2] < Z_NEAR_M:
            share = (Z_NEAR_M - ends[i][2]) / (ends[j][2] - ends[i][2])
            ends[i] = ends[i] + share * (ends[j] - ends[i])
    return np.stack(ends)


def _near_image(uv: NDArray[np.float64], width: int, height: int) -> NDArray[np.float64] | None:
    """The part of a segment ``(2, 2)`` within an image's width around it; ``None``: no part.

    A segment may begin a million pixels away; Pillow would walk them all. Cut, not moved: what is
    left lies on the same line (Liang and Barsky 1984).
    """
    margin = float(width)
    along = uv[1] - uv[0]
    first, last = 0.0, 1.0
    for axis, size in ((0, width), (1, height)):
        if along[axis] == 0.0:
            if not -margin <= uv[0, axis] <= size + margin:
                return None
            continue
        low, high = sorted(
            (bound - uv[0, axis]) / along[axis] for bound in (-margin, size + margin)
        )
        first, last = max(first, low), min(last, high)
    return uv[0] + np.array([[first], [last]]) * along if first < last else None


def draw_boxes_2d(
    rgb: NDArray[np.uint8], rows: Sequence[tuple[Mapping[str, Any], RgbColour]]
) -> Image.Image:
    """A camera image with 2D boxes: modal solid, amodal dashed."""
    picture = Image.fromarray(rgb)
    draw = ImageDraw.Draw(picture)
    line = max(1, round(picture.width / 400))
    for row, colour in rows:
        if row["bbox_amodal"] is not None:
            _dashed(draw, row["bbox_amodal"], colour, line)
        if row["bbox_modal"] is not None:
            x0, y0, x1, y1 = row["bbox_modal"]
            draw.rectangle((x0, y0, max(x0, x1 - 1), max(y0, y1 - 1)), outline=colour, width=line)
    return picture


def _dashed(draw: ImageDraw.ImageDraw, box: Sequence[float], colour: RgbColour, line: int) -> None:
    x0, y0, x1, y1 = box
    dash = 4.0 * line
    for start, end in (((x0, y0), (x1, y0)), ((x1, y0), (x1, y1)),
                       ((x1, y1), (x0, y1)), ((x0, y1), (x0, y0))):  # fmt: skip
        length = float(np.hypot(end[0] - start[0], end[1] - start[1]))
        for offset in np.arange(0.0, length, 2.0 * dash):
            stop = min(offset + dash, length)
            points = [
                (start[0] + (end[0] - start[0]) * t / length,
                 start[1] + (end[1] - start[1]) * t / length)
                for t in (offset, stop)
            ]  # fmt: skip
            draw.line(points, fill=colour, width=line)


def depth_view(depth_m: NDArray[np.float32]) -> Image.Image:
    """Depth as colours, logarithmic from 1.5 m (warm) to 120 m (cold); sky dark."""
    near, far = np.log(_NEAR_M), np.log(_FAR_M)
    share = (far - np.log(np.clip(depth_m, _NEAR_M, _FAR_M))) / (far - near)
    colours = spectrum(share)
    colours[depth_m >= 999.9] = (24, 26, 32)
    return Image.fromarray(colours)


def spectrum(share: NDArray[Any]) -> NDArray[np.uint8]:
    """Colours from violet over green to yellow for values from 0 to 1; ``(..., 3)`` uint8."""
    stops = np.array(
        [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]], np.float64
    )
    place = np.clip(share, 0.0, 1.0) * (len(stops) - 1)
    low = np.minimum(place.astype(np.intp), len(stops) - 2)
    rest = (place - low)[..., None]
    colours: NDArray[np.uint8] = (stops[low] * (1 - rest) + stops[low + 1] * rest).astype(np.uint8)
    return colours


def semantic_view(tags: NDArray[np.uint8], palette: Mapping[int, RgbColour]) -> Image.Image:
    """Tags in the colours of ``dataset.json``."""
    table = np.zeros((256, 3), np.uint8)
    for value, colour in palette.items():
        table[value] = colour
    return Image.fromarray(table[tags])


def instance_view(instance: NDArray[np.uint16]) -> Image.Image:
    """A separate colour for each id of a thing that moves; everything else in greys by tag."""
    ids, tags = instance[..., Instance.ID].astype(np.int64), instance[..., Instance.TAG]
    moves = (tags >= 12) & (tags <= 19)
    hue = (ids * _GOLDEN_RATIO) % 1.0  # neighbouring ids get hues that lie far apart
    hsv = np.stack([hue * 255, np.full_like(hue, 170), np.full_like(hue, 240)], axis=-1)
    colours = np.asarray(Image.fromarray(hsv.astype(np.uint8), mode="HSV").convert("RGB"))
    grey = (36 + (tags.astype(np.uint32) * 37) % 60).astype(np.uint8)
    return Image.fromarray(np.where(moves[..., None], colours, grey[..., None]))


def flow_view(flow_px: NDArray[np.float32]) -> Image.Image:
    """Optical flow as colours: the hue is its direction, the brightness its length.

    The longest twentieth of the flow is as bright as it gets (at least 1 px).
    """
    u, v = flow_px[..., 0], flow_px[..., 1]
    length = np.hypot(u, v)
    brightest = max(1.0, float(np.percentile(length, 95.0)))
    hue = (np.arctan2(v, u) / (2.0 * np.pi)) % 1.0
    value = np.clip(length / brightest, 0.0, 1.0)
    hsv = np.stack([hue * 255.0, np.full_like(hue, 200.0), value * 255.0], axis=-1)
    return Image.fromarray(hsv.astype(np.uint8), mode="HSV").convert("RGB")


def camera_view(content: str, data: NDArray[Any], palette: Mapping[int, RgbColour]) -> Image.Image:
    """What a camera measured, in colours.

    Args:
        content: what its pixels are, as the table of sensor kinds has it.
        data: ``(H, W, ...)``, as ``carstage.dataset.Sensor.read`` gives them.
        palette: colour of each semantic tag.
    """
    if content == TAGS:
        return semantic_view(data, palette)
    view = _VIEWS.get(content)
    return Image.fromarray(np.ascontiguousarray(data)) if view is None else view(data)


_VIEWS: Mapping[str, Callable[[NDArray[Any]], Image.Image]] = {
    DEPTH: depth_view,
    INSTANCES: instance_view,
    FLOW: lambda data: flow_view(np.nan_to_num(data)),
}


def birds_eye_view(
    points_ego: NDArray[np.float64],
    boxes: Sequence[tuple[LabelledBox, RgbColour]],
    radar: Sequence[tuple[NDArray[np.float64], NDArray[np.float32]]] = (),
) -> Image.Image:
    """Points and boxes from above, ego in the middle, forward up; rings every 10 m.

    Args:
        points_ego: ``(N, 3)`` in the ego actor's frame (m), coloured by height.
        boxes: with their colours.
        radar: by radar, ``(N, 3)`` in the ego actor's frame and ``(N,)`` range rates (m/s): red
            dots approach, blue ones recede, white ones do neither.
    """
    scale = _VIEW_PX / (2 * _VIEW_RANGE_M)

    def pixels(xy: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.stack([_VIEW_PX / 2 + xy[:, 1] * scale, _VIEW_PX / 2 - xy[:, 0] * scale], axis=1)

    canvas = np.full((_VIEW_PX, _VIEW_PX, 3), (16, 18, 24), np.uint8)
    order = np.argsort(points_ego[:, 2])  # the highest points last, on top
    ordered = points_ego[order]
    uv = np.floor(pixels(ordered[:, :2])).astype(np.intp)
    inside = ((uv >= 0) & (uv < _VIEW_PX)).all(axis=1)
    colours = spectrum((ordered[:, 2] + 0.3) / 4.0) // 2 + 60
    canvas[uv[inside, 1], uv[inside, 0]] = colours[inside]
    picture = Image.fromarray(canvas)
    draw = ImageDraw.Draw(picture)
    for radius_m in np.arange(_RING_STEP_M, _VIEW_RANGE_M, _RING_STEP_M):
        r = radius_m * scale
        middle = _VIEW_PX / 2
        draw.ellipse((middle - r, middle - r, middle + r, middle + r), outline=(44, 48, 60))
        draw.text((middle + 3, middle - r - 11), f"{radius_m:.0f} m", fill=(110, 116, 132))
    for places, rates in radar:
        for (x, y), rate in zip(pixels(places[:, :2]).tolist(), rates.tolist(), strict=True):
            colour = _RECEDING if rate > 0.5 else _APPROACHING if rate < -0.5 else _STANDING
            draw.ellipse((x - 2, y - 2, x + 2, y + 2), fill=colour)
    for box, colour in boxes:
        corners = box_corners(box.ego_from_box, box.extent)
        outline = [tuple(p) for p in pixels(corners[[0, 4, 6, 2, 0], :2]).tolist()]
        draw.line(outline, fill=colour, width=2)
        axis = np.array([box.ego_from_box[:3, 3], corners[[4, 6]].mean(axis=0)])
        draw.line([tuple(p) for p in pixels(axis[:, :2]).tolist()], fill=colour, width=2)
    return picture


def data_uri(picture: Image.Image, width: int, *, lossless: bool = False) -> str:
    """A picture as a ``data:`` address, scaled down to a width.

    Args:
        picture: RGB.
        width: the most pixels that it shall be wide.
        lossless: PNG instead of JPEG.
    """
    if picture.width > width:
        height = max(1, round(picture.height * width / picture.width))
        picture = picture.resize((width, height), Image.Resampling.LANCZOS)
    stream = io.BytesIO()
    if lossless:
        picture.save(stream, format="PNG")
    else:
        picture.save(stream, format="JPEG", quality=82, subsampling=0)
    kind = "png" if lossless else "jpeg"
    return f"data:image/{kind};base64,{base64.b64encode(stream.getvalue()).decode()}"
