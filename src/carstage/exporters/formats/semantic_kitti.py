"""SemanticKITTI: sweeps with a label and an instance for each point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Final

import numpy as np
import yaml
from numpy.typing import NDArray

from carstage.annotation.tracks import FIRST_LEVEL_OBJECT
from carstage.dataset import Episode, Occupancy
from carstage.dataset.saved_frames import Frame
from carstage.exporters.axes import OPTICAL_FROM_FLU, flu_points, flu_pose
from carstage.exporters.clouds import (
    LabelledCloud,
    LabelledLidar,
    is_labelled,
    labelled_lidar,
    moving_actors,
    read_labelled,
)
from carstage.exporters.exporter import Exporter, register
from carstage.exporters.formats.kitti_files import numbers
from carstage.exporters.formats.semantic_kitti_voxels import voxel_files
from carstage.geometry import FloatArray, invert_pose
from carstage.tags import TAGS_0_9_14

MOVING_M_S: Final = 0.2
CLASSES: Final[dict[str, int]] = {
    "Roads": 40, "RoadLine": 60, "SideWalks": 48, "Ground": 49, "RailTrack": 49,
    "Building": 50, "Fence": 51, "GuardRail": 51, "Wall": 52, "Bridge": 52,
    "Vegetation": 70, "Terrain": 72, "Pole": 80, "TrafficSign": 81,
    "Car": 10, "Bicycle": 11, "Bus": 13, "Motorcycle": 15, "Train": 16, "Truck": 18,
    "Pedestrian": 30, "Rider": 31,
    "TrafficLight": 99, "Static": 99, "Dynamic": 99, "Other": 99, "Water": 99,
}  # fmt: skip
"""SemanticKITTI's number of each of our tags; 0 of what is not here."""
NAMES: Final[dict[int, str]] = {
    0: "unlabeled", 10: "car", 11: "bicycle", 13: "bus", 15: "motorcycle", 16: "on-rails",
    18: "truck", 30: "person", 31: "bicyclist", 32: "motorcyclist", 40: "road", 48: "sidewalk",
    49: "other-ground", 50: "building", 51: "fence", 52: "other-structure", 60: "lane-marking",
    70: "vegetation", 72: "terrain", 80: "pole", 81: "traffic-sign", 99: "other-object",
    252: "moving-car", 253: "moving-bicyclist", 254: "moving-person", 255: "moving-motorcyclist",
    256: "moving-on-rails", 257: "moving-bus", 258: "moving-truck",
}  # fmt: skip
_MOVING: Final = {
    10: 252, 11: 253, 31: 253, 30: 254, 15: 255, 32: 255, 16: 256, 13: 257, 18: 258,
}  # fmt: skip
"""What is ridden moves with who rides it, in one class."""
_BICYCLIST, _MOTORCYCLIST = 31, 32
_THINGS: Final = (10, 11, 13, 15, 16, 18, 30, 31, 32)
_TR: Final = np.eye(4)
"""SemanticKITTI's poses are those of a camera; ours stands in the LiDAR."""
_TR[:3, :3] = OPTICAL_FROM_FLU
_SPLITS: Final = {"train": "train", "val": "valid", "test": "test"}


def point_labels(cloud: LabelledCloud, frame: Frame) -> NDArray[np.uint32]:
    """``(N,)`` SemanticKITTI's labels: the class in the low 16 bits, the instance above.

    The instance is the low half of the actor's id, the same in all frames of a sequence.
    """
    table = np.zeros(256, np.uint32)
    for tag, known in TAGS_0_9_14.items():
        table[tag] = CLASSES.get(known.name, 0)
    labels = table[cloud.tags]
    two_wheelers = [t for t, row in frame.objects.items() if row["class"] == "motorcycle"]
    rides = (labels == _BICYCLIST) & np.isin(cloud.objects, two_wheelers)
    labels[rides] = _MOTORCYCLIST
    moving = np.isin(cloud.objects, moving_actors(frame, MOVING_M_S))
    instances = np.where(np.isin(labels, _THINGS), cloud.objects & 0xFFFF, 0)
    for still, moves in _MOVING.items():
        labels[moving & (labels == still)] = moves
    return np.asarray(labels | (instances.astype(np.uint32) << 16), dtype="<u4")


def voxel_labels(content: Occupancy, frame: Frame) -> NDArray[np.uint32]:
    """``(N,)`` the same labels of the voxels in which a surface is, in their order.

    Parked vehicles of the town are no actors, and their track ids have more than 32 bits.
    """
    tags, tracks = content.semantic[content.occupied], content.tracks[content.occupied]
    actors = np.where(tracks < FIRST_LEVEL_OBJECT, tracks, 0).astype(np.uint32)
    return point_labels(LabelledCloud(np.zeros((0, 4), np.float32), tags, actors), frame)


@dataclass(frozen=True, slots=True)
class SweepPart:
    """What a frame adds to the files of its sequence."""

    time_s: float
    world_from_lidar: FloatArray


@dataclass(frozen=True, slots=True)
class SweepWriter:
    """Writes points and labels of a frame."""

    lidar: LabelledLidar
    sequence: str
    voxels: bool = False

    def __call__(self, frame: Frame, folder: Path) -> SweepPart | None:
        """Write the frame; ``None`` without points or labels."""
        if not is_labelled(frame, self.lidar):
            return None
        cloud = read_labelled(frame, self.lidar)
        place, name = folder / "sequences" / self.sequence, f"{frame.k:06d}"
        (place / "velodyne" / f"{name}.bin").write_bytes(flu_points(cloud.points).tobytes())
        (place / "labels" / f"{name}.label").write_bytes(point_labels(cloud, frame).tobytes())
        if self.voxels:
            self._write_voxels(frame, cloud, place / "voxels")
        return SweepPart(frame.timestamp_s, flu_pose(frame.world_from_sensor(self.lidar.points)))

    def _write_voxels(self, frame: Frame, cloud: LabelledCloud, folder: Path) -> None:
        content = frame.occupancy()
        if content is None:
            return
        labels = voxel_labels(content, frame)
        for ending, file in voxel_files(content, cloud.points, labels).items():
            (folder / f"{frame.k:06d}{ending}").write_bytes(file)


@register
class SemanticKitti(Exporter):
    """See docs/formats/exports.md."""

    name: ClassVar = "semantickitti"
    summary: ClassVar = "SemanticKITTI: velodyne, labels, poses; from a semantic LiDAR."
    uses: ClassVar = frozenset({"lidar", "val_share", "test_share"})

    def begin(self, episodes: Sequence[Episode], folder: Path) -> None:
        """Check the rigs."""
        for episode in episodes:
            labelled_lidar(episode, self.options)
        self._folder = folder
        self._sequences: list[tuple[str, Episode]] = []

    def begin_episode(self, episode: Episode) -> SweepWriter:
        """Make the folders of a new sequence."""
        sequence = f"{len(self._sequences):02d}"
        self._sequences.append((sequence, episode))
        self._place = self._folder / "sequences" / sequence
        lidar, asked = labelled_lidar(episode, self.options), episode.spec.labels.occupancy
        voxels = asked is not None and asked.frame == lidar.points
        for name in ("velodyne", "labels", *(["voxels"] if voxels else [])):
            (self._place / name).mkdir(parents=True)
        self._poses = self.files.enter_context((self._place / "poses.txt").open("w"))
        self._times = self.files.enter_context((self._place / "times.txt").open("w"))
        self._first: FloatArray | None = None
        return SweepWriter(lidar, sequence, voxels)

    def add(self, part: SweepPart) -> None:
        """Append pose and time; poses count from the first sweep."""
        if self._first is None:
            self._first = invert_pose(part.world_from_lidar)
        pose = _TR @ self._first @ part.world_from_lidar @ _TR.T
        self._poses.write(numbers(pose[:3]) + "\n")
        self._times.write(f"{part.time_s:.6e}\n")

    def end_episode(self) -> None:
        """Close the files of the sequence, and write its calibration."""
        self.close()
        nowhere = np.eye(4)[:3]
        lines = [f"P{index}: {numbers(nowhere)}\n" for index in range(4)]
        lines.append(f"Tr: {numbers(_TR[:3])}\n")
        (self._place / "calib.txt").write_text("".join(lines), "ascii")

    def finish(self) -> None:
        """Write which sequence is which episode, and the names of the labels."""
        rows = [f"{s},{e.id},{self.split_of(e)}\n" for s, e in self._sequences]
        (self._folder / "sequences.csv").write_text("sequence,episode,split\n" + "".join(rows))
        split = {
            word: [int(s) for s, e in self._sequences if self.split_of(e) == own]
            for own, word in _SPLITS.items()
        }
        document = {"name": "carstage", "labels": NAMES, "split": split}
        text = yaml.safe_dump(document, sort_keys=False)
        (self._folder / "semantic-kitti.yaml").write_text(text, "ascii")
