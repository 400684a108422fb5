"""Datasets, episodes, frames, label rows, statistics."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from carstage.web.messages.base import DatasetId, Document, Label, Message, Name

Vector = list[float]
Colour = list[int]
TableName = Literal["objects", "camera_objects", "ego", "events", "frames"]
Cell = str | float | int | bool | list[Any] | None


class DatasetSummary(Message):
    """A dataset below one of the roots.

    Attributes:
        path: below its root, for people.
        state: ``recording`` while a run writes to it; ``damaged``: see ``problem``.
        validity: what the last validation from here found.
        changed: Unix time of the last commit.
        location: its folder, or its address.
    """

    dataset: DatasetId
    name: str
    path: str
    state: Literal["empty", "ready", "recording", "damaged"]
    problem: str | None = None
    episodes: int = 0
    frames: int = 0
    bytes: int = 0
    changed: float | None = None
    validity: Literal["unknown", "valid", "invalid", "outdated"] = "unknown"
    location: str = ""


class DatasetChange(Message):
    """A new name for a dataset."""

    name: Label


class Removed(Message):
    """What is left where something was removed.

    Attributes:
        left: names of what stays in its folder, as it was not ours.
    """

    left: list[str] = Field(default_factory=list)


class DatasetList(Message):
    """All datasets, newest first, and where they are.

    Attributes:
        root: the folder in which new ones are made, or an address.
        problems: what is wrong with object stores, a sentence each.
    """

    datasets: list[DatasetSummary]
    root: str
    disk_free_bytes: int
    problems: list[str] = Field(default_factory=list)


class EpisodeSummary(Message):
    """An episode of a dataset.

    Attributes:
        saved_fps: saved frames per simulated second.
        index: in the configuration that it was recorded by.
        number: in the dataset, from 1.
        thumbnail: a camera whose pictures show it.
    """

    episode_id: Name
    index: int
    map: str
    weather: str
    frames: int
    saved_fps: float
    duration_s: float
    bytes: int
    sensors: int
    number: int
    thumbnail: Name | None = None


class Tag(Message):
    """A semantic tag and its colour."""

    value: int
    name: str
    rgb: Colour


class DatasetDetail(Message):
    """A dataset with its episodes.

    Attributes:
        class_colours: RGB by class, as in all pictures.
    """

    summary: DatasetSummary
    episodes: list[EpisodeSummary]
    tags: list[Tag]
    class_colours: dict[str, Colour]


class CampaignBin(Message):
    """Values of a sampled setting, and its episodes; see ``carstage.dataset.campaigns.Bin``."""

    label: str
    planned: int
    episodes: int


class CampaignAxis(Message):
    """A sampled setting.

    Attributes:
        path: of the setting.
        title: as the form has it; empty where that has none.
    """

    path: str
    title: str
    bins: list[CampaignBin]


class CampaignQuota(Message):
    """How far a quota is."""

    name: str
    wanted: int
    frames: int
    met: bool


class CampaignMessage(Message):
    """How far a campaign is in a dataset, see ``carstage.dataset.campaigns.CampaignState``.

    Attributes:
        run_id: the newest run of its configuration.
        others: episodes of the dataset that are of other configurations.
        covered: combinations with a committed episode, of ``combinations``.
    """

    run_id: Name
    name: str
    method: str
    planned: int
    committed: int
    others: int
    axes: list[CampaignAxis]
    combinations: int
    covered: int
    quotas: list[CampaignQuota]


class CampaignList(Message):
    """The campaigns that have been recorded into a dataset, the newest first.

    Attributes:
        problems: why others cannot be shown, a sentence each.
    """

    campaigns: list[CampaignMessage]
    problems: list[str] = Field(default_factory=list)


class RigSensor(Message):
    """A sensor of an episode.

    Attributes:
        K: 3x3 rows; None for what is no camera.
        ego_from_sensor: 4x4 rows, CARLA's left-handed axes; None where it moves.
        data: how it is shown: a picture, a cloud of points, radar detections, or not.
    """

    id: Name
    kind: str
    labelled: bool
    width: int
    height: int
    fov_deg: float
    K: list[Vector] | None
    ego_from_sensor: list[Vector] | None
    attach_to: str
    data: Literal["image", "points", "radar", "none"]


class EpisodeDetail(Message):
    """An episode: its rig, its times.

    Attributes:
        times_s: of each frame, since the first.
        incomplete: number of ticks with a sensor that is neither ``ok`` nor ``off``.
        spec: what was asked for.
        tags: semantic tags with their colours.
    """

    episode: EpisodeSummary
    sensors: list[RigSensor]
    times_s: list[float]
    ego_box: dict[str, Vector]
    incomplete: int
    requested: Document
    spawned: Document
    spec: Document
    tags: list[Tag]


class EgoPose(Message):
    """The ego in the world; rotation is pitch, yaw, roll."""

    location: Vector
    rotation_deg: Vector
    speed_m_s: float | None = None
    throttle: float | None = None
    steer: float | None = None
    brake: float | None = None
    weather: Document | None = None


class FrameObject(Message):
    """An object in one frame; the box is in the ego's axes (CARLA's, left-handed).

    Attributes:
        extent: half sizes, m.
        ego_from_box: 4x4 rows.
        location: of the box's centre in the world.
        yaw_deg: of the box in the world.
    """

    track_id: int
    class_name: str
    type_id: str
    ego_from_box: list[Vector]
    extent: Vector
    location: Vector
    yaw_deg: float
    speed_m_s: float
    num_lidar_points: int | None
    colour: Colour


class CameraObject(Message):
    """An object in one camera's picture.

    Attributes:
        bbox_amodal, bbox_modal: x0, y0, x1, y1 in px.
        lines: edges of the 3D box as they are seen: x0, y0, x1, y1 each, cut near the picture.
        row: all columns of the label table but the mask.
    """

    track_id: int
    class_name: str
    visible: bool
    bbox_amodal: Vector | None
    bbox_modal: Vector | None
    occlusion_ratio: float | None
    truncated: float | None
    distance_m: float | None
    has_mask: bool
    lines: list[Vector]
    colour: Colour
    row: Document


class FrameMessage(Message):
    """One frame but for its pictures and points.

    Attributes:
        available: sensors that have data of it.
        states: by sensor, from the ledger.
        readings: of IMU and GNSS, by sensor and column.
    """

    k: int
    timestamp_s: float
    ego: EgoPose | None
    objects: list[FrameObject]
    camera_objects: dict[str, list[CameraObject]]
    available: list[str]
    states: dict[str, str]
    readings: dict[str, dict[str, Any]]


class EpisodeMap(Message):
    """The top view: lanes of the map (empty where they are not known) and where all went.

    Attributes:
        lanes: polylines of lane centres, x, y in world metres, with the lane's width.
        track: the ego's x, y, yaw in degrees, per frame.
        bounds: x0, y0, x1, y1 of the track, with a margin.
    """

    map: str
    lanes: list[list[Vector]]
    lane_widths_m: list[float]
    track: list[Vector]
    bounds: Vector


class EgoSignals(Message):
    """How the ego drove: one value per frame, None where it is not known; empty without ego motion.

    Attributes:
        acceleration_m_s2: along the ego's x axis.
        steer: -1 (left) to 1.
    """

    speed_m_s: list[float | None]
    acceleration_m_s2: list[float | None]
    steer: list[float | None]


class Span(Message):
    """Frames, from the first to the last, over which something has one value."""

    value: str
    first: int
    last: int


class TrackSpan(Message):
    """When an object is in the labels.

    Attributes:
        spans: first and last frame of each stretch.
        nearest_m, nearest_k: its least distance from the ego, and when.
        signals: when its brake lights or blinkers are on.
    """

    track_id: int
    class_name: str
    colour: Colour
    spans: list[list[int]]
    nearest_m: float | None
    nearest_k: int | None
    signals: list[Span]


class Moment(Message):
    """A frame that is worth a look.

    Attributes:
        kind: what moments of its sort have in common.
        sensor_id: the camera in which it is seen.
    """

    kind: str
    text: str
    k: int
    track_id: int | None = None
    sensor_id: str | None = None


class EpisodeHistory(Message):
    """What happens in an episode, and when.

    Attributes:
        near_m: from where on a pedestrian is near.
        lights: what the traffic light that affects the ego shows.
        weather: presets.
        faults: by sensor, its states that are neither ``ok`` nor ``off``.
    """

    near_m: float
    tracks: list[TrackSpan]
    lights: list[Span]
    weather: list[Span]
    faults: dict[str, list[Span]]
    moments: list[Moment]


class TableFilter(Message):
    """A condition on one column."""

    column: Annotated[str, Field(max_length=100)]
    op: Literal["eq", "ne", "lt", "le", "gt", "ge", "contains"]
    value: str | float | bool | None


class TableRequest(Message):
    """A page of a label table.

    Attributes:
        episode: left out: all episodes.
    """

    table: TableName = "camera_objects"
    episode: Name | None = None
    filters: Annotated[list[TableFilter], Field(max_length=20)] = Field(default_factory=list)
    sort: Annotated[str, Field(max_length=100)] | None = None
    descending: bool = False
    offset: Annotated[int, Field(ge=0, le=1_000_000_000)] = 0
    limit: Annotated[int, Field(ge=1, le=1000)] = 100


class TableColumn(Message):
    """A column: name, Arrow type, unit, meaning."""

    name: str
    type: str
    unit: str
    meaning: str


class TablePage(Message):
    """Rows of a table; ``total`` counts all that fit the filters.

    Attributes:
        classes: rows of each class that fit the filters, conditions on the class left out.
    """

    columns: list[TableColumn]
    rows: list[list[Cell]]
    total: int
    classes: dict[str, int] = Field(default_factory=dict)


class Histogram(Message):
    """Counts by bin; the bins' names carry the unit."""

    title: str
    bins: list[str]
    counts: list[int]


class Statistics(Message):
    """What a dataset holds, counted over its labels.

    Attributes:
        records: rows of ``objects``, the egos left out; ``tracks``: different objects among them.
        visible: rows of ``camera_objects`` that are visible.
        classes: tracks by class.
        frames_by_map, frames_by_weather: frames.
    """

    records: int
    tracks: int
    visible: int
    classes: dict[str, int]
    class_colours: dict[str, Colour]
    frames_by_map: dict[str, int]
    frames_by_weather: dict[str, int]
    histograms: list[Histogram]
