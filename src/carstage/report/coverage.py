"""Where and under what sky the episodes were recorded: maps with tracks, weather, box positions."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from carstage.codecs.semantic_points import points_xyz
from carstage.dataset.reading import Episode
from carstage.dataset.tracks import may_come_back
from carstage.errors import DatasetError
from carstage.geometry import transform_points
from carstage.report import html
from carstage.report.drawing import RgbColour, data_uri, spectrum
from carstage.sensor_kinds.model import CLOUDS

_MAP_PX = 900
_MARGIN_M = 25.0
_SWEEPS = 12
_HEAT_RANGE_M = 60.0
_HEAT_CELL_M = 1.0
_HEAT_PX = 520
_IMAGE_CELLS = (64, 36)
_BACKGROUND: RgbColour = (16, 18, 24)
_EGO_COLOURS: tuple[RgbColour, ...] = (
    (255, 200, 40), (90, 220, 255), (255, 110, 180), (130, 240, 120), (200, 150, 255),
    (255, 140, 60),
)  # fmt: skip
_VEHICLE: RgbColour = (74, 118, 190)
_WALKER: RgbColour = (200, 84, 84)
_LANE_EDGE: RgbColour = (64, 70, 82)
_MARKING: tuple[RgbColour, RgbColour] = (120, 126, 136), (140, 118, 52)
_CROSSWALK: RgbColour = (96, 132, 150)
_STOP_LINE: RgbColour = (190, 110, 70)

Points = dict[str, list[tuple[float, float]]]
"""Right and down, by group of road users."""


def weather_name(episode: Episode) -> str:
    """The preset, or that parameters were given."""
    return episode.spec.weather.preset or "given parameters"


def coverage_section(episodes: Sequence[Episode]) -> str:
    """Frames by map and weather, and for each map a picture of who went where.

    Raises:
        DatasetError: a table is missing or damaged.
    """
    by_map: dict[str, list[Episode]] = defaultdict(list)
    for episode in episodes:
        by_map[episode.spec.map].append(episode)
    pictures = []
    for name, recorded in sorted(by_map.items()):
        plural = "" if len(recorded) == 1 else "s"
        picture = data_uri(_map_picture(recorded), _MAP_PX, lossless=True)
        pictures.append(html.figure(picture, f"{name}: {len(recorded)} episode{plural}"))
    return (
        "<h2>Where and when</h2>"
        '<p class="soft">North is up. Bright lines are the egos, one colour per episode, a dot '
        "where they end; blue are other vehicles, red pedestrians. The ground is what LiDAR "
        "measured on the way, thin lines are the town's vector map.</p>"
        f'<div class="grid maps">{"".join(pictures)}</div>'
        f"<h3>Frames by map and weather</h3>{_weather_table(by_map)}"
    )


def _weather_table(by_map: dict[str, list[Episode]]) -> str:
    frames: Counter[tuple[str, str]] = Counter()
    for name, episodes in by_map.items():
        for episode in episodes:
            frames[name, weather_name(episode)] += episode.frames
    weathers = sorted({weather for _, weather in frames})
    rows = [
        (name, *(frames[name, weather] or "" for weather in weathers)) for name in sorted(by_map)
    ]
    return html.table(("Map", *weathers), rows)


@dataclass(frozen=True, slots=True)
class _Canvas:
    """A picture of the ground, north up.

    Attributes:
        low: ``(2,)`` the least x (east) and y (south) that it shows (m).
        scale: pixels per metre.
        size: width, height (px).
    """

    low: NDArray[np.float64]
    scale: float
    size: tuple[int, int]

    @classmethod
    def around(cls, places: NDArray[np.float64]) -> _Canvas:
        low, high = places.min(axis=0) - _MARGIN_M, places.max(axis=0) + _MARGIN_M
        scale = _MAP_PX / float((high - low).max())
        width, height = np.ceil((high - low) * scale).astype(int).tolist()
        return cls(low, scale, (max(1, width), max(1, height)))

    def pixels(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """``(N, 2)`` pixels of places ``(N, 2)`` or wider."""
        return (places[:, :2] - self.low) * self.scale


def _map_picture(episodes: Sequence[Episode]) -> Image.Image:
    tracks = [_tracks(episode) for episode in episodes]
    egos = [path for _, is_ego, path in (track for found in tracks for track in found) if is_ego]
    everywhere = [path for found in tracks for _, _, path in found]
    # The egos decide what is shown: others may be anywhere on the map.
    canvas = _Canvas.around(np.concatenate(egos or everywhere or [np.zeros((1, 2))]))
    picture = Image.fromarray(_ground(episodes, canvas))
    draw = ImageDraw.Draw(picture)
    _town(draw, canvas, episodes)
    for found in tracks:
        for kind, is_ego, path in found:
            if not is_ego:
                _line(draw, canvas, path, _WALKER if kind.startswith("walker") else _VEHICLE, 2)
    for index, found in enumerate(tracks):
        colour = _EGO_COLOURS[index % len(_EGO_COLOURS)]
        for _, is_ego, path in found:
            if is_ego:
                _line(draw, canvas, path, colour, 4)
                x, y = canvas.pixels(path)[-1].tolist()
                draw.ellipse((x - 6, y - 6, x + 6, y + 6), fill=colour, outline=_BACKGROUND)
    _scale_bar(draw, canvas)
    return picture


def _tracks(episode: Episode) -> list[tuple[str, bool, NDArray[np.float64]]]:
    """Class, whether it is the ego, and path ``(N, 2)`` of everybody."""
    objects = episode.objects()
    moving = objects.filter(~may_come_back(objects))
    table = moving.select(["k", "track_id", "class", "is_ego", "actor_location"])
    paths: dict[int, list[tuple[int, float, float]]] = defaultdict(list)
    facts: dict[int, tuple[str, bool]] = {}
    for row in table.to_pylist():
        x, y, _ = row["actor_location"]
        paths[row["track_id"]].append((row["k"], x, y))
        facts[row["track_id"]] = row["class"], row["is_ego"]
    found = [(*facts[track], np.array(sorted(path))[:, 1:]) for track, path in paths.items()]
    if not any(is_ego for _, is_ego, _ in found):  # vehicles were not to be labelled
        places = [row["location"][:2] for row in episode.ego().select(["location"]).to_pylist()]
        if places:
            found.append(("car", True, np.array(places)))
    return found


def _ground(episodes: Sequence[Episode], canvas: _Canvas) -> NDArray[np.uint8]:
    """``(H, W, 3)`` points of some sweeps from above, the highest on top, in dim greys."""
    width, height = canvas.size
    highest = np.full((height, width), -np.inf)
    for episode in episodes:
        for places in _sweeps(episode, max(1, _SWEEPS // len(episodes))):
            u, v = np.floor(canvas.pixels(places)).astype(np.intp).T
            inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
            np.maximum.at(highest, (v[inside], u[inside]), places[inside, 2])
    picture = np.empty((height, width, 3), np.uint8)
    picture[:] = _BACKGROUND
    seen = np.isfinite(highest)
    if seen.any():
        floor = float(np.percentile(highest[seen], 10.0))
        grey = 46.0 + 90.0 * np.clip((highest[seen] - floor) / 8.0, 0.0, 1.0)
        picture[seen] = grey[:, None].astype(np.uint8)
    return picture


def _town(draw: ImageDraw.ImageDraw, canvas: _Canvas, episodes: Sequence[Episode]) -> None:
    """The town's lanes in outline, where one of the episodes has its vector map."""
    for episode in episodes:
        try:
            town = episode.vector_map()
        except DatasetError:
            continue  # the validation reports it
        if town is not None:
            break
    else:
        return
    edges = [
        (lane.left_boundary, lane.right_boundary) for lane in town.lanes if lane.type != "none"
    ]
    shapes = [*((line, _LANE_EDGE) for pair in edges for line in pair)]
    shapes += [(mark.line, _MARKING[mark.colour == "yellow"]) for mark in town.markings]
    shapes += [(walk.outline, _CROSSWALK) for walk in town.crosswalks]
    shapes += [(stop.line, _STOP_LINE) for stop in town.stop_lines]
    shapes += [(one.outline, _MARKING[one.colour == "yellow"]) for one in town.painted_objects]
    for line, colour in shapes:
        draw.line([tuple(point) for point in canvas.pixels(line).tolist()], fill=colour)


def _sweeps(episode: Episode, wanted: int) -> list[NDArray[np.float64]]:
    """Points ``(N, 3)`` in the world of up to ``wanted`` sweeps, spread over the episode."""
    lidar = next((s for s in episode.sensors if s.content in CLOUDS), None)
    if lidar is None or not episode.frames:
        return []
    poses = episode.world_from_sensor().get(lidar.id, {})
    clouds = []
    for k in np.unique(np.linspace(0, episode.frames - 1, wanted).astype(int)).tolist():
        try:
            points = points_xyz(lidar.read(k))
        except DatasetError:
            continue  # the validation reports it
        if k in poses:
            clouds.append(transform_points(poses[k], points))
    return clouds


def _line(
    draw: ImageDraw.ImageDraw,
    canvas: _Canvas,
    path: NDArray[np.float64],
    colour: RgbColour,
    width: int,
) -> None:
    pixels = [tuple(point) for point in canvas.pixels(path).tolist()]
    if np.ptp(path, axis=0).max() < 1.0:  # it stands: a line would not be seen
        x, y = pixels[0]
        draw.ellipse((x - width, y - width, x + width, y + width), fill=colour)
    else:
        draw.line(pixels, fill=colour, width=width, joint="curve")


def _scale_bar(draw: ImageDraw.ImageDraw, canvas: _Canvas) -> None:
    length_m = next(
        length for length in (1000, 500, 200, 100, 50, 20, 10)
        if length * canvas.scale < canvas.size[0] / 3 or length == 10
    )  # fmt: skip
    y, right = canvas.size[1] - 18, canvas.size[0] - 18
    left = right - length_m * canvas.scale
    draw.line([(left, y), (right, y)], fill=(235, 235, 235), width=3)
    draw.text((left, y - 18), f"{length_m} m", fill=(235, 235, 235))


def positions_section(episodes: Sequence[Episode]) -> str:
    """Heat maps of where visible objects are: around the ego, and in the images.

    Raises:
        DatasetError: a table is missing or damaged.
    """
    places: Points = {"vehicles": [], "pedestrians": []}
    boxes: Points = {"vehicles": [], "pedestrians": []}
    for episode in episodes:
        _add_positions(episode, places, boxes)
    figures = []
    for group, found in places.items():
        cells = int(2 * _HEAT_RANGE_M / _HEAT_CELL_M)
        picture = _heat(
            np.array(found).reshape(-1, 2), (-_HEAT_RANGE_M, _HEAT_RANGE_M), cells, cells
        )
        caption = f"{group} around the ego, {2 * _HEAT_RANGE_M:.0f} m wide: {len(found):,} labels"
        figures.append(html.figure(data_uri(_with_ego(picture), _HEAT_PX, lossless=True), caption))
    around, figures = "".join(figures), []
    for group, found in boxes.items():
        picture = _heat(np.array(found).reshape(-1, 2), (0.0, 1.0), *_IMAGE_CELLS)
        caption = f"middles of {group}' 2D boxes in the images: {len(found):,} labels"
        figures.append(html.figure(data_uri(picture, _HEAT_PX, lossless=True), caption))
    return (
        "<h3>Where visible objects are</h3>"
        '<p class="soft">Dark is none, yellow is most; the scale is logarithmic. Around the ego, '
        f'forward is up.</p><div class="grid">{around}</div>'
        f'<div class="grid below">{"".join(figures)}</div>'
    )


def _add_positions(episode: Episode, places: Points, boxes: Points) -> None:
    """Add where an episode's visible objects are around the ego, and their 2D boxes' middles."""
    cameras = episode.calibration.sensors
    columns = ["k", "track_id", "class", "box_center_ego"]
    objects: dict[tuple[int, int], tuple[str, Any]] = {}
    table = episode.objects()
    for row in table.filter(~may_come_back(table)).select(columns).to_pylist():
        group = "pedestrians" if row["class"].startswith("walker") else "vehicles"
        objects[row["k"], row["track_id"]] = group, row["box_center_ego"]
    table = episode.camera_objects()
    columns = ["k", "track_id", "sensor_id", "bbox_amodal"]
    for row in table.filter(table["visible"]).select(columns).to_pylist():
        key = row["k"], row["track_id"]
        if key not in objects:
            continue
        group, center = objects[key]
        if row["bbox_amodal"] is not None:
            x0, y0, x1, y1 = row["bbox_amodal"]
            camera = cameras[row["sensor_id"]]
            boxes[group].append(((x0 + x1) / 2 / camera.width, (y0 + y1) / 2 / camera.height))
        if center is not None:
            places[group].append((center[1], -center[0]))
            objects[key] = group, None  # once, however many cameras see it


def _heat(
    points: NDArray[np.float64], span: tuple[float, float], columns: int, rows: int
) -> Image.Image:
    """Counts of points ``(N, 2)`` (right, down) per cell as colours, ``_HEAT_PX`` wide."""
    counts, _, _ = np.histogram2d(
        points[:, 1], points[:, 0], bins=(rows, columns), range=(span, span)
    )
    share = np.log1p(counts) / max(float(np.log1p(counts.max())), 1e-9)
    colours = spectrum(share)
    colours[counts == 0] = _BACKGROUND
    picture = Image.fromarray(colours)
    return picture.resize((_HEAT_PX, _HEAT_PX * rows // columns), Image.Resampling.NEAREST)


def _with_ego(picture: Image.Image) -> Image.Image:
    """A heat map around the ego with rings every 20 m and the ego in the middle."""
    draw = ImageDraw.Draw(picture)
    middle, scale = picture.width / 2, picture.width / (2 * _HEAT_RANGE_M)
    for radius_m in (20, 40):
        r = radius_m * scale
        draw.ellipse((middle - r, middle - r, middle + r, middle + r), outline=(70, 76, 92))
        draw.text((middle + 3, middle - r - 12), f"{radius_m} m", fill=(150, 156, 170))
    half_w, half_l = 1.0 * scale, 2.4 * scale
    draw.rectangle((middle - half_w, middle - half_l, middle + half_w, middle + half_l),
                   fill=(240, 240, 240))  # fmt: skip
    return picture
