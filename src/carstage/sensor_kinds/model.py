"""What a row of the table holds."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from typing import Any, Mapping, Optional, Tuple, Union

from carstage.releases import OLDEST, Release

COLOUR = "colour"
DEPTH = "depth"
TAGS = "tags"
INSTANCES = "instances"
FLOW = "flow"
NORMALS = "normals"
POINTS = "points"
TAGGED_POINTS = "tagged points"
DETECTIONS = "detections"
READING = "reading"
MESSAGES = "messages"
"""Of a kind that delivers only when it received something: any number of messages."""
VOXELS = "voxels"
"""Of a kind that labels alone use: occupied voxels, each as a tagged point."""

CAMERAS = (COLOUR, DEPTH, TAGS, INSTANCES, FLOW, NORMALS)
"""Contents that are pictures."""
CLOUDS = (POINTS, TAGGED_POINTS)
"""Contents that are point clouds, one file per frame."""
ROWS = (DETECTIONS, READING, MESSAGES)
"""Contents that are rows of one Parquet file per episode."""

_VIEWERS = {DETECTIONS: "radar", READING: "none", MESSAGES: "none", VOXELS: "none"}
_SIZES = {"|u1": 1, "<f4": 4, "<u4": 4, "<f8": 8}


@dataclass(frozen=True)
class Attribute:
    """An attribute that users set; ``name`` carries the unit, ``carla`` is CARLA's own name.

    Attributes:
        type: ``float``, ``int``, ``bool``, ``word``, ``size`` (width and height in pixels), or
            ``float or auto`` and ``int or auto``.
        default: None leaves the attribute at the server's own default.
        title: the name that a form shows, without the unit.
        sentence: what it does.
        gt, ge, le, lt: bounds of the number; ``gt`` and ``lt`` are excluded.
        words: the values of a ``word``.
        embedded_only: whether no server but the embedded simulator has it.
    """

    name: str
    type: str
    default: Union[bool, int, float, str, None]
    title: str
    sentence: str
    carla: Optional[str]
    unit: Optional[str] = None
    gt: Optional[float] = None
    ge: Optional[float] = None
    le: Optional[float] = None
    lt: Optional[float] = None
    words: Tuple[str, ...] = ()
    embedded_only: bool = False


@dataclass(frozen=True)
class AttributeSet:
    """The attributes that kinds share.

    Attributes:
        name: of the section in the configuration's schema.
        sentence: what the section is.
        shape: what else belongs to it: ``camera`` (a picture's size), ``sweep`` (turns and rays
            that follow the frame rate), ``flash`` (the depth picture that beams are made from),
            ``flash rays`` (beams as the embedded simulator casts them) or ``plain``.
    """

    name: str
    sentence: str
    rows: Tuple[Attribute, ...]
    shape: str = "plain"


@dataclass(frozen=True)
class Column:
    """A number, or ``count`` equal ones, of a raw pixel, point, detection or reading.

    Attributes:
        dtype: numpy's name of the type, such as ``<f4``.
    """

    name: str
    dtype: str
    count: int = 1


@dataclass(frozen=True)
class SensorKind:
    """One kind of sensor.

    Attributes:
        name: what users write as ``kind``.
        blueprint: CARLA's id.
        content: what a frame is; one of :data:`CAMERAS`, :data:`CLOUDS` or :data:`ROWS`. All
            that reads frames goes by it: labels, checks, exports, views.
        title: name in the interface; ``short``: beginning of the ids that it gives.
        description: the kind in a few words; ``summary``: in a sentence.
        collector: ``module:Class`` of the class that makes records of the client's data.
        codecs: ``module:Class`` by codec name, the default first; none for tables.
        columns: what a pixel, point, detection or reading consists of.
        recorded: what a raw pixel or point consists of where frames are made of data of another
            kind of sensor. Empty: a raw datum has the same columns.
        file_bytes: upper estimate of what one of them takes in the dataset; None: as recorded.
        twins: kinds that a labelled sensor of this kind needs at its pose; none: no labels.
        since: CARLA's first release that has it.
        modality: what it measures with: ``camera``, ``truth`` (a camera that shows no colours),
            ``lidar``, ``radar`` or ``inertial`` (radios, too); the interface groups and colours
            sensors by it.
        icon: how it is drawn: ``camera``, ``lidar``, ``radar`` or ``box``.
        field_of_view: ``pyramid``, ``cone``, ``sweep`` or ``none``.
        plugin: of a kind from elsewhere, the module whose import registers this row; collectors
            import it. It must run on the collector's Python.
        simulator: of such a kind, the module that the embedded simulator imports.
    """

    name: str
    blueprint: str
    content: str
    title: str
    short: str
    description: str
    summary: str
    attributes: AttributeSet
    collector: str
    columns: Tuple[Column, ...]
    recorded: Tuple[Column, ...] = ()
    codecs: Mapping[str, str] = field(default_factory=dict)
    file_bytes: Optional[float] = None
    twins: Tuple[str, ...] = ()
    since: Release = OLDEST
    modality: str = "inertial"
    icon: str = "box"
    field_of_view: str = "none"
    plugin: str = ""
    simulator: str = ""

    @property
    def is_camera(self) -> bool:
        """Whether a frame is a picture."""
        return self.content in CAMERAS

    @property
    def has_rows(self) -> bool:
        """Whether frames become rows of one table per episode."""
        return self.content in ROWS

    @property
    def is_sparse(self) -> bool:
        """Whether it may deliver nothing in a tick, which is no fault and an empty frame."""
        return self.content == MESSAGES

    @property
    def tags_points(self) -> bool:
        """Whether its points have a semantic tag beside their intensity."""
        return self.content == POINTS and any(c.name == "object_tag" for c in self.columns)

    @property
    def viewer(self) -> str:
        """What shows a frame: ``image``, ``points``, ``radar`` or ``none``."""
        return "image" if self.is_camera else _VIEWERS.get(self.content, "points")

    @property
    def raw_bytes(self) -> int:
        """Bytes of a raw pixel, point, detection or reading."""
        return _bytes_of(self.recorded or self.columns)

    @property
    def datum_bytes(self) -> int:
        """Bytes of a pixel, point, detection or reading, whatever it is made of."""
        return _bytes_of(self.columns)

    @cached_property
    def layout(self) -> struct.Struct:
        """The columns as they stand in a record."""
        codes = {"|u1": "B", "<f4": "f", "<u4": "I", "<f8": "d"}
        return struct.Struct(
            "<" + "".join(codes[column.dtype] * column.count for column in self.columns)
        )


def _bytes_of(columns: Tuple[Column, ...]) -> int:
    return sum(_SIZES[column.dtype] * column.count for column in columns)


def load_object(path: str) -> Any:
    """The object that ``module:Name`` names.

    Raises:
        ImportError: there is no such module, or no such name in it.
    """
    module, _, name = path.partition(":")
    try:
        return getattr(import_module(module), name)
    except AttributeError as error:
        raise ImportError("%s has no %s" % (module, name)) from error
