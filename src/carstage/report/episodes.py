"""The report's section on one episode: contact sheet, views, bird's eye, rig, ledger."""

from __future__ import annotations

import json
from collections import Counter, OrderedDict, defaultdict
from collections.abc import Mapping
from html import escape
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from carstage.annotation.point_sensors import radar_points
from carstage.codecs.semantic_points import points_xyz
from carstage.dataset.masks import decode_mask
from carstage.dataset.reading import Episode, Sensor
from carstage.errors import DatasetError
from carstage.geometry import transform_points
from carstage.report import html
from carstage.report.birds_eye import birds_eye_section
from carstage.report.disparity import disparity_section
from carstage.report.drawing import (
    RgbColour,
    birds_eye_view,
    camera_view,
    class_colour,
    data_uri,
    draw_boxes_2d,
    draw_boxes_3d,
)
from carstage.report.film import MOST_FRAMES, film
from carstage.report.fleet import fleet_section
from carstage.report.lane_lines import lane_lines_section
from carstage.report.messages import messages_section
from carstage.report.occupancy import occupancy_section
from carstage.report.patches import patches_section
from carstage.sensor_kinds.columns import Detection
from carstage.sensor_kinds.model import CAMERAS, CLOUDS, COLOUR, DETECTIONS, ROWS
from carstage.spec.story_parts import STORY_ACTION, STORY_EVENT
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labels import LabelledBox, LabelTables, labelled_boxes

CONTACT_FRAMES = 6
VIEW_FRAMES = 2
SHOWCASE_CAMERAS = 2
_CONTACT_PX = 560
_BIRDS_EYE_PX = 640
_MASK_SHARE = 0.6
_KEPT_FRAMES = CONTACT_FRAMES


def frames_per_second(episode: Episode) -> float:
    """Rate of the saved frames."""
    return episode.spec.saved_fps


def episode_section(pictures: EpisodePictures, *, films: bool = False) -> str:
    """The section, as markup.

    Args:
        pictures: of the episode.
        films: whether to add a film of each labelled colour camera.
    """
    episode = pictures.episode
    parts = [
        f"<h2>Episode <code>{escape(episode.id)}</code></h2>",
        f"<p>{escape(_summary(episode))}</p>",
        html.legend((name, class_colour(name)) for name in pictures.classes()),
    ]
    for sensor in episode.sensors:
        if sensor.calibration.labelled and sensor.content == COLOUR:
            parts.append(_contact_sheet(pictures, sensor))
            if films:
                parts.append(_film(pictures, sensor, episode))
    middle = pictures.fullest_frames(None, VIEW_FRAMES)
    views = pictures.views(middle)
    if views:
        parts.append(f'<h3>Other views</h3><div class="grid">{views}</div>')
    birds_eye = pictures.birds_eye(middle)
    if birds_eye:
        parts.append(
            "<h3>LiDAR and radar from above</h3>"
            '<p class="soft">Forward is up; points are coloured by height; boxes are all labelled '
            f'objects.</p><div class="grid wide">{birds_eye}</div>'
        )
    parts += [lane_lines_section(episode, middle), birds_eye_section(episode, middle)]
    parts += [occupancy_section(episode, middle), patches_section(episode, middle)]
    parts.append(disparity_section(episode, middle))
    parts += [_events(episode), _rig(episode), fleet_section(episode), _agents_views(pictures)]
    parts += [messages_section(episode), _ledger(episode)]
    return "\n".join(parts)


def _events(episode: Episode) -> str:
    """What happened to the ego, event by event; empty where none was planned."""
    table = episode.events()
    if table is None:
        return ""
    rows = []
    for row in table.to_pylist():
        began = row["begin_s"] is not None
        until = "the end" if row["end_s"] is None else f"{row['end_s']:.1f} s"
        never = "never" if row["min_ttc"] is None else f"{row['min_ttc']:.1f} s"
        near = "" if row["min_distance"] is None else f"{row['min_distance']:.1f} m"
        rows.append(
            (
                _event_name(row),
                row["state"] if began else f"{row['state']}: {row['reason']}",
                f"{row['begin_s']:.1f} s to {until}" if began else "",
                ", ".join(str(track) for track in row["actors"]),
                near,
                never if began else "",
                ("yes" if row["collision"] else "no") if began else "",
            )
        )
    head = ("event", "state", "when", "tracks", "nearest", "least time to collision", "collision")
    return "<h3>Events</h3>" + html.table(head, rows)


def _agents_views(pictures: EpisodePictures) -> str:
    """What labelled cameras of agents see where they see most; empty without any."""
    shown = []
    for view in pictures.episode.views[1:]:
        labelled = [s for s in view.sensors if s.calibration.labelled and s.content == COLOUR]
        if not labelled:
            continue
        own = pictures.of_agent(view)
        for sensor in labelled[:SHOWCASE_CAMERAS]:
            title = f"{view.agent_name}, {sensor.id} with 3D boxes, "
            shown.append(own.boxes_3d(sensor, own.fullest_frames(sensor, 1), title))
    return f'<div class="grid below">{"".join(shown)}</div>' if any(shown) else ""


def _event_name(row: Mapping[str, Any]) -> str:
    """Kind of an event; of a storyboard's, what the file calls it."""
    if row["kind"] not in (STORY_EVENT, STORY_ACTION):
        return str(row["kind"])
    part = json.loads(row["parameters"])
    name = part["event"] if row["kind"] == STORY_EVENT else f"{part['event']}: {part['action']}"
    again = f" ({part['execution']})" if part["execution"] > 1 else ""
    return f"{name}{again}"


def showcase(pictures: EpisodePictures) -> str:
    """The frame with most to see: through the cameras with boxes, its masks, from above.

    Empty where no sensor has a picture of it.
    """
    sensors = pictures.episode.sensors
    labelled = [s for s in sensors if s.calibration.labelled and s.content == COLOUR]
    frames = pictures.fullest_frames(None, 1)
    labelled.sort(key=lambda sensor: -sum(pictures.visible(k, sensor) for k in frames))
    shown = labelled[:SHOWCASE_CAMERAS]
    parts = [
        *(pictures.boxes_3d(sensor, frames, f"{sensor.id} with 3D boxes, ") for sensor in shown),
        pictures.birds_eye(frames, "LiDAR from above, "),
        *(pictures.masks(sensor, frames) for sensor in shown),
    ]
    if not any(parts):
        return ""
    return f'<div class="grid showcase">{"".join(parts)}</div>' + html.legend(
        (name, class_colour(name)) for name in pictures.classes()
    )


def _contact_sheet(pictures: EpisodePictures, sensor: Sensor) -> str:
    frames = pictures.fullest_frames(sensor, CONTACT_FRAMES)
    with_objects = [k for k in frames if pictures.visible(k, sensor)]
    if not with_objects:
        return (
            f"<h3>{escape(sensor.id)}: no object is visible</h3>"
            f'<div class="grid">{pictures.boxes_3d(sensor, frames[::2])}</div>'
        )
    return (
        f"<h3>{escape(sensor.id)}: visible objects</h3>"
        '<p class="soft">Of each part of the episode, the frame with the most objects. First 3D '
        "boxes, whose crossed face is the front; below them 2D boxes, solid around the visible "
        "pixels and dashed around the whole object.</p>"
        f'<div class="grid">{pictures.boxes_3d(sensor, frames)}</div>'
        f'<div class="grid below">{pictures.boxes_2d(sensor, with_objects)}</div>'
    )


def _film(pictures: EpisodePictures, sensor: Sensor, episode: Episode) -> str:
    frames = range(min(episode.frames, MOST_FRAMES))
    shown = ((k, drawn[0]) for k in frames if (drawn := pictures.drawn_3d(sensor, k)) is not None)
    first = next(shown, None)
    if first is None:
        return ""
    source = film(chain([first], shown), frames_per_second(episode))
    cut = f", first {MOST_FRAMES} frames" if episode.frames > MOST_FRAMES else ""
    return html.film(source, f"{sensor.id} with 3D boxes{cut}")


def _summary(episode: Episode) -> str:
    spec, document = episode.spec, episode.document
    spawned = document["spawned"]
    weather = spec.weather.preset or "given parameters"
    variant = "" if episode.variant is None else f", variant {episode.variant}"
    return (
        f"{spec.map}, {weather}{variant}; "
        f"{episode.frames} frames at {frames_per_second(episode):g} Hz; "
        f"ego {spec.ego.blueprint}, scenario {spec.scenario.kind}; "
        f"{spawned['vehicles']} of {spec.vehicles.total} vehicles and "
        f"{spawned['pedestrians']} of {spec.pedestrians.count} pedestrians; "
        f"CARLA client {document['client_version']}, server {document['server_version']}."
    )


class EpisodePictures:
    """Draws what one episode needs; reads its labels once, and the same frames seldom twice.

    Args:
        episode: the episode.
        description: ``dataset.json``, for the colours of the tags.
    """

    def __init__(self, episode: Episode, description: Mapping[str, Any]) -> None:
        self.episode = episode
        self._description = description
        self._kept: OrderedDict[tuple[str, int], NDArray[Any] | None] = OrderedDict()
        self._palette: dict[int, RgbColour] = {
            tag["value"]: tuple(tag["rgb"]) for tag in description["tags"]
        }
        tables = LabelTables.load(episode)
        self._boxes = labelled_boxes(tables, Findings(episode.id))
        columns = ["track_id", "class"]
        self._classes = {
            row["track_id"]: row["class"] for row in tables.objects.select(columns).to_pylist()
        }
        self._rows: dict[tuple[int, str], list[dict[str, Any]]] = defaultdict(list)
        columns = ["k", "sensor_id", "track_id", "bbox_amodal", "bbox_modal", "visible"]
        columns += ["mask_modal", "distance"]
        for row in tables.camera_objects.select(columns).to_pylist():
            if row["visible"]:
                self._rows[row["k"], row["sensor_id"]].append(row)

    def of_agent(self, view: Episode) -> EpisodePictures:
        """Pictures of the episode as an agent's."""
        return EpisodePictures(view, self._description)

    def classes(self) -> list[str]:
        """Classes that occur, the most frequent first."""
        return [name for name, _ in Counter(self._classes.values()).most_common()]

    def fullest_frames(self, sensor: Sensor | None, wanted: int) -> list[int]:
        """Of each of ``wanted`` equal parts of the episode, the frame with most to see.

        Args:
            sensor: count its visible objects; ``None``: those of all sensors.
            wanted: number of frames.
        """
        counts = np.zeros(self.episode.frames, np.int64)
        for (k, sensor_id), rows in self._rows.items():
            if sensor is None or sensor_id == sensor.id:
                counts[k] += len(rows)
        parts = np.array_split(np.arange(len(counts)), min(wanted, len(counts)) or 1)
        return [int(part[np.argmax(counts[part])]) for part in parts if len(part)]

    def visible(self, k: int, sensor: Sensor) -> int:
        """Number of visible objects."""
        return len(self._rows[k, sensor.id])

    def _read(self, sensor: Sensor, k: int) -> NDArray[Any] | None:
        """The data of a frame; ``None`` where there is none, which the validation reports."""
        place = sensor.id, k
        if place not in self._kept:
            try:
                self._kept[place] = sensor.read(k)
            except DatasetError:
                self._kept[place] = None
            if len(self._kept) > _KEPT_FRAMES:
                self._kept.popitem(last=False)
        return self._kept[place]

    def masks(self, sensor: Sensor, frames: list[int]) -> str:
        """A camera's images with the masks of what is visible, the nearest on top."""
        figures = []
        for k in frames:
            if (drawn := self._masked(sensor, k)) is not None:
                source = data_uri(Image.fromarray(drawn), _CONTACT_PX)
                figures.append(html.figure(source, f"{sensor.id} with masks, frame {k}"))
        return "".join(figures)

    def _masked(self, sensor: Sensor, k: int) -> NDArray[np.uint8] | None:
        """``(H, W, 3)``: a camera's image with the masks of what is visible."""
        if (image := self._read(sensor, k)) is None:
            return None
        drawn = image.astype(np.float64)
        height, width = drawn.shape[:2]
        for row in sorted(self._rows[k, sensor.id], key=lambda row: -row["distance"]):
            if row["mask_modal"] is None:
                continue
            mask = decode_mask(row["mask_modal"], height, width)
            colour = np.array(class_colour(self._classes.get(row["track_id"], "")))
            drawn[mask] = (1 - _MASK_SHARE) * drawn[mask] + _MASK_SHARE * colour
        return drawn.astype(np.uint8)

    def boxes_3d(self, sensor: Sensor, frames: list[int], note: str = "") -> str:
        """A camera's images with the 3D boxes of what is visible."""
        figures = []
        for k in frames:
            if (drawn := self.drawn_3d(sensor, k)) is not None:
                picture, count = drawn
                caption = note + self._caption(k, count)
                figures.append(html.figure(data_uri(picture, _CONTACT_PX), caption))
        return "".join(figures)

    def drawn_3d(
        self, sensor: Sensor, k: int, *, masks: bool = False
    ) -> tuple[Image.Image, int] | None:
        """A camera's image with the boxes of what is visible, and how many these are.

        Args:
            sensor: the camera.
            k: the frame.
            masks: whether masks are below the boxes.
        """
        image = self._masked(sensor, k) if masks else self._read(sensor, k)
        if image is None:
            return None
        visible = {row["track_id"] for row in self._rows[k, sensor.id]}
        boxes = [(b, self._colour(b)) for b in self._boxes.get(k, []) if b.track_id in visible]
        return draw_boxes_3d(image, sensor.calibration_at(k), boxes), len(boxes)

    def boxes_2d(self, sensor: Sensor, frames: list[int]) -> str:
        """A camera's images with the 2D boxes of what is visible."""
        figures = []
        for k in frames:
            if (drawn := self.drawn_2d(sensor, k)) is not None:
                picture, count = drawn
                caption = self._caption(k, count)
                figures.append(html.figure(data_uri(picture, _CONTACT_PX), caption))
        return "".join(figures)

    def drawn_2d(self, sensor: Sensor, k: int) -> tuple[Image.Image, int] | None:
        """A camera's image with the 2D boxes of what is visible, and how many these are."""
        if (image := self._read(sensor, k)) is None:
            return None
        rows = [
            (row, class_colour(self._classes.get(row["track_id"], "")))
            for row in self._rows[k, sensor.id]
        ]
        return draw_boxes_2d(image, rows), len(rows)

    def views(self, frames: list[int]) -> str:
        """What the cameras for depth, tags and the like measured, in colours."""
        figures = []
        for k in frames:
            for sensor in self.episode.sensors:
                if sensor.content == COLOUR or sensor.content not in CAMERAS:
                    continue
                if (picture := self.drawn_view(sensor, k)) is not None:
                    caption = f"{sensor.id}, frame {k}"
                    figures.append(html.figure(data_uri(picture, _CONTACT_PX), caption))
        return "".join(figures)

    def drawn_view(self, sensor: Sensor, k: int) -> Image.Image | None:
        """What a camera measured, in colours; None where that is missing."""
        if (image := self._read(sensor, k)) is None:
            return None
        return camera_view(sensor.content, image, self._palette)

    def birds_eye(self, frames: list[int], note: str = "") -> str:
        """Points of all LiDARs and radars from above, with all boxes."""
        figures = []
        for k in frames:
            if (drawn := self.drawn_from_above(k)) is not None:
                picture, count, detections = drawn
                caption = f"{note}frame {k}: {count:,} points"
                if detections is not None:
                    caption += f", {detections} radar detections"
                figures.append(
                    html.figure(data_uri(picture, _BIRDS_EYE_PX, lossless=True), caption)
                )
        return "".join(figures)

    def drawn_from_above(self, k: int) -> tuple[Image.Image, int, int | None] | None:
        """Points of LiDARs and radars with all boxes; None where neither has data.

        Returns:
            The picture, the number of points, and that of radar detections (None: no radar).
        """
        sensors = self.episode.sensors
        clouds = [cloud for s in sensors if (cloud := self._cloud(s, k)) is not None]
        radar = [
            (
                transform_points(s.calibration_at(k).ego_from_sensor, radar_points(found)),
                found[:, Detection.RANGE_RATE],
            )
            for s in sensors
            if s.content == DETECTIONS and (found := self._read(s, k)) is not None
        ]
        if not clouds and not radar:
            return None
        boxes = [(box, self._colour(box)) for box in self._boxes.get(k, [])]
        points = np.concatenate([np.empty((0, 3)), *clouds])
        detections = sum(len(rates) for _, rates in radar) if radar else None
        return birds_eye_view(points, boxes, radar), len(points), detections

    def _cloud(self, sensor: Sensor, k: int) -> NDArray[np.float64] | None:
        """``(N, 3)`` points of a LiDAR in the ego actor's frame; None for what is no LiDAR."""
        if sensor.content not in CLOUDS:
            return None
        points = self._read(sensor, k)
        if points is None:
            return None
        return transform_points(sensor.calibration_at(k).ego_from_sensor, points_xyz(points))

    def _colour(self, box: LabelledBox) -> RgbColour:
        return (255, 255, 255) if box.is_ego else class_colour(self._classes[box.track_id])

    def _caption(self, k: int, objects: int) -> str:
        time_s = k / frames_per_second(self.episode)
        return f"frame {k}, {time_s:.1f} s: {objects} visible"


def _rig(episode: Episode) -> str:
    sizes: Counter[str] = Counter()
    for entry in episode.marker.files:
        parts = entry.path.split("/")
        if parts[0] == "sensors":
            sizes[parts[1].removesuffix(".parquet")] += entry.bytes
    rows = []
    for sensor in episode.sensors:
        c = sensor.calibration
        x, y, z = c.carrier_from_sensor[:3, 3]
        carrier = c.attach_to if c.attachment == "rigid" else f"{c.attach_to}, {c.attachment}"
        image = f"{c.width}×{c.height}, {c.fov_deg:g}°" if c.is_camera else ""
        if c.flash is not None:
            image = f"{c.flash.columns}×{c.flash.rows}, {c.flash.horizontal_fov_deg:g}°"
        rows.append(
            (sensor.id, sensor.kind, carrier, f"{x:.2f}, {y:.2f}, {z:.2f}", image, c.codec,
             html.size(sizes[sensor.id]))
        )  # fmt: skip
    head = (
        "Sensor",
        "Kind",
        "Carried by",
        "Position x, y, z (m)",
        "Image, field of view",
        "Files",
        "Size",
    )
    return html.folded("Rig", html.table(head, rows))


def _ledger(episode: Episode) -> str:
    ledger = episode.ledger()
    rows = []
    for sensor in episode.sensors:
        states = Counter(ledger[f"{sensor.id}.state"].to_pylist())
        on_disk = _frames_on_disk(episode, sensor)
        rows.append((sensor.id, *(states.get(s, 0) for s in _STATES), on_disk))
    frames = ledger["server_frame"].to_pylist()
    span = f"server frames {frames[0]} to {frames[-1]}" if frames else "no frames"
    saved = ledger.num_rows - ledger["k"].null_count
    return html.folded(
        f"Ledger: {ledger.num_rows} ticks ({span}), {saved} of them saved",
        html.table(("Sensor", *_STATES, "frames on disk"), rows),
    )


_STATES = ("ok", "missing", "late", "mismatched", "off")


def _frames_on_disk(episode: Episode, sensor: Sensor) -> int:
    if sensor.content in ROWS:
        try:
            return int(sensor.table.num_rows)
        except DatasetError:
            return 0
    return sum(sensor.paths(k)[0].is_file() for k in range(episode.frames))
