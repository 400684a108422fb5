"""Colour images that show nothing, and data that are the frame before once more."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from carstage.dataset.reading import Episode, Sensor
from carstage.sensor_kinds.model import COLOUR, ROWS
from carstage.validation.checks.findings import Findings

BLACK_LEVEL = 8
WHITE_LEVEL = 252
WHITE_SHARE = 0.5
FLAT_LEVELS = 3
MOST_BAD_SHARE = 0.1
MOVED_M = 0.1
TURNED_RAD = 0.01
MOST_STILL_SHARE = 0.5
_MIN_STILL_FRAMES = 4
_STRIDE = 2

Fault = Literal["black", "blown out", "of one colour"]


@dataclass(slots=True)
class PictureFigures:
    """What was found in the colour images of one camera.

    Attributes:
        frames: images looked at.
        brightness: sum of their mean brightness, 0 to 255.
        faults: number of images by what is wrong with them.
        flat: frames of one episode whose image shows nothing, so that it may well repeat.
    """

    frames: int = 0
    brightness: float = 0.0
    faults: dict[Fault, int] = field(default_factory=dict)
    flat: set[int] = field(default_factory=set)

    def add_picture(self, k: int, rgb: NDArray[np.uint8]) -> None:
        """Count the image ``(H, W, 3)`` of frame ``k``."""
        red, green, blue = (rgb[::_STRIDE, ::_STRIDE, channel] for channel in range(3))
        brightness = np.maximum(np.maximum(red, green), blue)  # faster than over the last axis
        self.frames += 1
        self.brightness += float(brightness.mean())
        fault = fault_of(brightness)
        if fault is not None:
            self.faults[fault] = self.faults.get(fault, 0) + 1
            self.flat.add(k)

    def add(self, other: PictureFigures) -> None:
        """Add the counts of other frames, or of another episode."""
        self.flat |= other.flat
        self.frames += other.frames
        self.brightness += other.brightness
        for fault, count in other.faults.items():
            self.faults[fault] = self.faults.get(fault, 0) + count

    def to_dict(self) -> dict[str, Any]:
        """For the report."""
        mean = self.brightness / self.frames if self.frames else 0.0
        faults = {str(fault): count for fault, count in self.faults.items()}
        return {"frames": self.frames, "brightness": round(mean, 1), **faults}


def fault_of(brightness: NDArray[np.uint8]) -> Fault | None:
    """What is wrong with an image of which ``(H, W)`` is each pixel's strongest channel."""
    low, high = np.percentile(brightness, [1.0, 99.0])
    if high < BLACK_LEVEL:
        return "black"
    if (brightness >= WHITE_LEVEL).mean() > WHITE_SHARE:
        return "blown out"
    return "of one colour" if high - low < FLAT_LEVELS else None


def check_exposure(camera_id: str, figures: PictureFigures, findings: Findings) -> None:
    """Warn of a camera of which more than a tenth of the images show nothing (``exposure``)."""
    for fault, count in sorted(figures.faults.items()):
        if count > MOST_BAD_SHARE * figures.frames:
            findings.add(
                "exposure",
                f"{count} of {figures.frames} images are {fault}",
                sensor=camera_id,
                severity="warning",
            )


def check_repeats(
    episode: Episode,
    poses: Mapping[str, Mapping[int, NDArray[np.float64]]],
    flat: Mapping[str, set[int]],
    findings: Findings,
) -> None:
    """Find data that are the frame before once more, byte by byte (check ``repeated``).

    While the sensor moves (0.1 m or 0.01 rad) a colour image that shows something cannot repeat:
    an error. For the other kinds it is a warning, as they may see a featureless world. While the
    sensor stands, a warning is given only if more than half of a camera's colour images repeat.

    Args:
        episode: the episode; the hashes of its commit marker are compared.
        poses: ``world_from_sensor`` by sensor and frame.
        flat: by camera, frames whose images show nothing.
        findings: where problems go.
    """
    hashes = {entry.path: entry.hash for entry in episode.marker.files}
    for sensor in episode.sensors:
        if sensor.content in ROWS:
            continue
        content = [_content(episode, sensor, k, hashes) for k in range(episode.frames)]
        still = 0
        for k in range(1, episode.frames):
            if content[k] is None or content[k] != content[k - 1]:
                continue
            if not _moves(poses.get(sensor.id, {}), k):
                still += 1
            elif k not in flat.get(sensor.id, ()):
                findings.add(
                    "repeated",
                    "the data are those of the frame before, though the sensor has moved",
                    frame=k,
                    sensor=sensor.id,
                    severity="error" if sensor.content == COLOUR else "warning",
                )
        steps = episode.frames - 1
        if (
            sensor.content == COLOUR
            and still >= _MIN_STILL_FRAMES
            and still > MOST_STILL_SHARE * steps
        ):
            findings.add(
                "repeated",
                f"{still} of {episode.frames} images are the one before once more: "
                "the camera stands and nothing in its view moves",
                sensor=sensor.id,
                severity="warning",
            )


def check_repeated_episodes(episodes: tuple[Episode, ...], findings: Findings) -> None:
    """Warn of episodes that hold the sensor data of another one (check ``repeated_episode``)."""
    first: dict[frozenset[str], str] = {}
    for episode in episodes:
        data = frozenset(
            entry.hash for entry in episode.marker.files if entry.path.startswith("sensors/")
        )
        if data and data in first:
            findings.add(
                "repeated_episode",
                f"episodes {first[data]} and {episode.id} hold the same sensor data",
                severity="warning",
            )
        first.setdefault(data, episode.id)


def _content(
    episode: Episode, sensor: Sensor, k: int, hashes: Mapping[str, str]
) -> tuple[str, ...] | None:
    names = sensor.file_names(k)
    found = tuple(hashes[name] for name in names if name in hashes)
    return found if len(found) == len(names) else None


def _moves(poses: Mapping[int, NDArray[np.float64]], k: int) -> bool:
    if k not in poses or k - 1 not in poses:
        return False
    moved_m = float(np.linalg.norm(poses[k][:3, 3] - poses[k - 1][:3, 3]))
    # |R - 1| in Frobenius' norm is sqrt(8) sin(angle / 2).
    turned = np.linalg.norm(poses[k - 1][:3, :3].T @ poses[k][:3, :3] - np.eye(3)) / np.sqrt(2.0)
    return moved_m >= MOVED_M or float(turned) >= TURNED_RAD
