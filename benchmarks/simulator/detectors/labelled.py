"""The labelled objects of a dataset's pictures, as detectors name them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from benchmarks.simulator.detectors.matching import (
    LEAST_HEIGHT_PX,
    LEAST_VISIBLE,
    Boxes,
    LabelledObject,
    is_end_on,
)
from benchmarks.simulator.detectors.scenes import CAMERA, RAIN
from benchmarks.simulator.detectors.seated import seated_people
from benchmarks.simulator.detectors.umbrellas import boxes_below_umbrellas
from carstage.dataset import Frame

Row = Mapping[str, Any]

MAPPING: dict[str, tuple[str, frozenset[str]]] = {
    "car": ("car", frozenset({"car"})),
    "van": ("car", frozenset({"car", "truck", "bus"})),
    "truck": ("large", frozenset({"truck", "bus"})),
    "bus": ("large", frozenset({"truck", "bus"})),
    "motorcycle": ("two_wheeler", frozenset({"motorcycle", "bicycle", "person"})),
    "bicycle": ("two_wheeler", frozenset({"motorcycle", "bicycle", "person"})),
    "walker_adult": ("person", frozenset({"person"})),
    "walker_child": ("person", frozenset({"person"})),
    "walker_wheelchair": ("person", frozenset({"person"})),
    "traffic_light": ("light", frozenset({"traffic light"})),
}
"""By Car-STAGE's class: the group, and COCO's classes that name it.

A rider and the two-wheeler count as either. COCO calls vans cars, trucks or buses. A pickup is a
truck: COCO's annotators call most of them so. Ours is the Cybertruck, which COCO never shows.
"""
UNJUDGED = frozenset(
    {
        "fire hydrant", "stop sign", "parking meter", "bench", "dog", "backpack", "umbrella",
        "handbag", "suitcase", "cup", "chair", "potted plant", "dining table", "cell phone",
        "clock", "bottle", "tie",
    }
)  # fmt: skip
"""What towns and people have without a label of that class: no box of these is off class."""
_NONE: Mapping[int, Sequence[float]] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class LabelledPicture:
    """One picture with its labels.

    Attributes:
        view: the episode, and whose camera it is.
        frame, camera: where it is.
        objects: all that is labelled and visible, and who is seen in vehicles.
    """

    view: str
    frame: Frame
    camera: str
    objects: tuple[LabelledObject, ...]

    @property
    def rain(self) -> bool:
        """Whether it rains."""
        return self.frame.episode.spec.weather.preset == RAIN


def labelled_pictures(frames: Iterable[Frame]) -> Iterator[LabelledPicture]:
    """The pictures of the ego's camera and the agents'."""
    for frame in frames:
        views = {"ego": frame, **{name: frame.as_agent(name) for name in frame.episode.agents}}
        for name, view in views.items():
            if view.has(CAMERA):
                # Of a picture without anything labelled there is no row.
                rows = view.camera_objects.get(CAMERA, ())
                picture = LabelledPicture(f"{frame.episode.id}-{name}", view, CAMERA, ())
                below = boxes_below_umbrellas(view, CAMERA) if rows and picture.rain else {}
                objects = labelled_objects(view.objects, rows, below)
                yield replace(picture, objects=objects + seated_people(view, CAMERA))


def labelled_objects(
    objects: Mapping[int, Row], rows: Sequence[Row], below: Mapping[int, Sequence[float]] = _NONE
) -> tuple[LabelledObject, ...]:
    """What a camera sees.

    Args:
        objects: rows of ``objects.parquet`` by track id.
        rows: of ``camera_objects.parquet``.
        below: by track id, the box of who is seen below an umbrella.
    """
    riders = {
        objects[row["track_id"]]["parent_track_id"]: row["bbox_modal"]
        for row in rows
        if objects[row["track_id"]]["class"] == "rider" and row["bbox_modal"]
    }
    return tuple(
        _labelled(
            objects[row["track_id"]]["class"],
            row,
            riders.get(row["track_id"]),
            below.get(row["track_id"]),
        )
        for row in rows
        if row["bbox_modal"] and objects[row["track_id"]]["class"] in MAPPING
    )


def _labelled(
    kind: str, row: Row, rider: Sequence[float] | None, below: Sequence[float] | None
) -> LabelledObject:
    group, names = MAPPING[kind]
    boxes = _with_rider(row["bbox_modal"], rider)
    if below is not None:
        boxes = np.concatenate([np.array([below], np.float32), boxes])
    visible = (1.0 - (row["occlusion_ratio"] or 0.0)) * (1.0 - (row["truncated"] or 0.0))
    high = float((boxes[:, 3] - boxes[:, 1]).max()) >= LEAST_HEIGHT_PX
    judged = high and visible >= LEAST_VISIBLE and (group != "two_wheeler" or rider is not None)
    alpha = row["alpha"]
    end_on = alpha is not None and is_end_on(alpha)
    return LabelledObject(group, names, boxes, judged, end_on, row["track_id"])


def _with_rider(box: Sequence[float], rider: Sequence[float] | None) -> Boxes:
    """The object's box; the rider's and that of both where one sits on it."""
    if rider is None:
        return np.array([box], np.float32)
    both = [*np.minimum(box[:2], rider[:2]), *np.maximum(box[2:], rider[2:])]
    return np.array([box, rider, both], np.float32)
