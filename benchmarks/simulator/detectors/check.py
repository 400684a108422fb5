"""Recall of a dataset's objects by detectors, and boxes that are off class."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from benchmarks.simulator.detectors.labelled import UNJUDGED, LabelledPicture, labelled_pictures
from benchmarks.simulator.detectors.matching import (
    LEAST_HEIGHT_PX,
    LEAST_IOU,
    LEAST_SCORE,
    LEAST_VISIBLE,
    LabelledObject,
    Matching,
    match,
)
from benchmarks.simulator.detectors.packages import COCO_NAMES, LoadedDetector
from benchmarks.simulator.detectors.scenes import PICTURES
from benchmarks.simulator.detectors.tiles import Detector, detect_on_tiles
from carstage.bench.episodes import Progress
from carstage.bench.verdict import Figure, Verdict
from carstage.dataset import Dataset

OFF_CLASS_A_PICTURE = 0.25
_MARGIN = 0.3
"""Share of an object's box that its crop shows beside it."""

Selection = Callable[[LabelledObject, bool], bool]
"""Whether an object counts; the second argument: whether it rains."""

RECALLS: Mapping[str, tuple[float | None, Selection]] = {
    "cars_front_or_rear": (0.85, lambda one, _: one.group == "car" and one.end_on),
    "cars_side": (None, lambda one, _: one.group == "car" and not one.end_on),
    "cars": (0.9, lambda one, _: one.group == "car"),
    "buses_and_trucks": (0.75, lambda one, _: one.group == "large"),
    "two_wheelers_with_riders": (0.6, lambda one, _: one.group == "two_wheeler"),
    "people_without_rain": (0.9, lambda one, rain: one.group == "person" and not rain),
    "people_in_rain": (0.8, lambda one, rain: one.group == "person" and rain),
    "traffic_lights": (0.6, lambda one, _: one.group == "light"),
}
"""Targets by name, and the objects that each is of."""


@dataclass(frozen=True, slots=True)
class Looked:
    """What a detector made of one picture."""

    picture: LabelledPicture
    matching: Matching

    def judged(self, selection: Selection) -> Iterator[bool]:
        """For each object that counts, whether it was found."""
        rain = self.picture.rain
        for one, found in zip(self.picture.objects, self.matching.found, strict=True):
            if one.judged and selection(one, rain):
                yield found


def check_detectors(
    dataset: Path,
    detectors: Sequence[LoadedDetector],
    *,
    workers: int = 1,
    misses: Path | None = None,
    progress: Progress = lambda done, total: None,
) -> Verdict:
    """Let each detector look at each picture of a dataset.

    Args:
        dataset: as ``scenes.record_scenes`` records them.
        detectors: of different families.
        workers: threads that compute.
        misses: folder for a crop of each object that a detector misses; made if missing.
        progress: called with the pictures done and their total number.
    """
    pictures = list(labelled_pictures(Dataset(dataset).iter_frames()))
    figures = [Figure("pictures", len(pictures), ">=", PICTURES), *_distinct(pictures)]
    done = 0
    for one in detectors:
        looked: list[Looked] = []
        for seen in _look(one.detector, pictures, workers):
            looked.append(seen)
            done += 1
            progress(done, len(detectors) * len(pictures))
        figures += figures_of(one.family, looked)
        if misses is not None:
            _save_misses(misses / one.family, looked)
    return Verdict("detectors", tuple(figures), _notes(detectors))


def _distinct(pictures: Sequence[LabelledPicture]) -> Iterator[Figure]:
    """How many objects each recall is of: some are seen by several cameras."""
    for name, (_, selection) in RECALLS.items():
        seen = {
            (one.frame.episode.spec.map, one.frame.episode.spec.seeds.spawn, thing.track_id)
            for one in pictures
            for thing in one.objects
            if thing.judged and selection(thing, one.rain)
        }
        yield Figure(f"distinct_{name}", len(seen))


def _look(
    detector: Detector, pictures: Sequence[LabelledPicture], workers: int
) -> Iterator[Looked]:
    def look(picture: LabelledPicture) -> Looked:
        found = detect_on_tiles(detector, picture.frame.read(picture.camera), COCO_NAMES)
        return Looked(picture, match(picture.objects, found, UNJUDGED))

    with ThreadPoolExecutor(workers) as pool:
        yield from pool.map(look, pictures)


def figures_of(family: str, looked: Sequence[Looked]) -> list[Figure]:
    """Recall of each kind of object with the number of objects, and boxes off class.

    Args:
        family: of the detector; begins the figures' names.
        looked: all pictures.
    """
    figures: list[Figure] = []
    for name, (target, selection) in RECALLS.items():
        found = [hit for one in looked for hit in one.judged(selection)]
        if found or target is not None:
            # A target that no picture tries is not met.
            recall = sum(found) / max(len(found), 1)
            figures.append(Figure(f"{family}_recall_of_{name}", recall, ">=", target))
        figures.append(Figure(f"{family}_number_of_{name}", len(found)))
    boxes = [box.name for one in looked for box in one.matching.off_class]
    a_picture = len(boxes) / max(len(looked), 1)
    often = sorted(set(boxes), key=lambda name: (-boxes.count(name), name))
    return [
        *figures,
        Figure(f"{family}_off_class_boxes_a_picture", a_picture, "<=", OFF_CLASS_A_PICTURE),
        Figure(
            f"{family}_off_class", ", ".join(f"{boxes.count(name)} {name}" for name in often[:8])
        ),
    ]


def _notes(detectors: Sequence[LoadedDetector]) -> tuple[str, ...]:
    return (
        *(f"{one.family}: {one.origin}." for one in detectors),
        f"Objects at least {LEAST_HEIGHT_PX} px high of which {LEAST_VISIBLE:.0%} are visible; "
        f"boxes with a score of {LEAST_SCORE} or more, IoU {LEAST_IOU} or more.",
        "Front or rear: seen within 45 degrees of its axis. Classes: car as car; van as car, truck "
        "or bus; truck (pickups, too) and bus as either; two-wheeler with rider, each or both, as "
        "bicycle, motorcycle or person. Off class: no labelled object of that class overlaps the "
        "box (IoU 0.1). Things without labels are left out: " + ", ".join(sorted(UNJUDGED)) + ".",
    )


def _save_misses(folder: Path, looked: Sequence[Looked]) -> None:
    """Write a crop of each judged object that was not found."""
    folder.mkdir(parents=True, exist_ok=True)
    for one in looked:
        pixels: NDArray[np.uint8] | None = None
        for k, (thing, found) in enumerate(
            zip(one.picture.objects, one.matching.found, strict=True)
        ):
            if thing.judged and not found:
                frame = one.picture.frame
                pixels = frame.read(one.picture.camera) if pixels is None else pixels
                name = f"{thing.group}-{one.picture.view}-{frame.k:03d}-{k:03d}.png"
                _crop(pixels, thing.boxes[-1]).save(folder / name)


def _crop(pixels: NDArray[np.uint8], box: NDArray[np.float32]) -> Image.Image:
    x0, y0, x1, y1 = box.tolist()
    across, down = _MARGIN * (x1 - x0), _MARGIN * (y1 - y0)
    height, width = pixels.shape[:2]
    left, top = max(int(x0 - across), 0), max(int(y0 - down), 0)
    right, bottom = min(int(x1 + across) + 1, width), min(int(y1 + down) + 1, height)
    return Image.fromarray(pixels[top:bottom, left:right])
