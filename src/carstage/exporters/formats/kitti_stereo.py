"""KITTI's stereo benchmark of 2015: rectified pairs of pictures with the left one's disparity."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from carstage.codecs.png import PngPacker
from carstage.dataset import Episode, SensorCalibration
from carstage.dataset.saved_frames import Frame
from carstage.errors import BadInputError
from carstage.exporters.exporter import Exporter, register
from carstage.exporters.formats.kitti_files import numbers
from carstage.exporters.formats.kitti_object import part_of
from carstage.exporters.formats.pictures import copy_as_png
from carstage.exporters.lenses import opencv_matrix
from carstage.exporters.options import ExportOptions
from carstage.exporters.rigs import colour_cameras
from carstage.geometry import FloatArray
from carstage.geometry.stereo import (
    STEPS_PER_PX,
    StereoCamera,
    disparity_steps,
    seen_by_both,
    stereo_baseline_m,
)

_FOLDERS: Final = ("image_2", "image_3", "disp_occ_0", "disp_noc_0", "calib_cam_to_cam")

Depth = NDArray[np.float32]
"""``(H, W)`` m."""


@dataclass(frozen=True, slots=True)
class StereoPair:
    """Two cameras side by side, with their depth or disparity.

    Attributes:
        left, right: of equal intrinsics.
        baseline_m: distance of the two.
        labelled: whether disparity is among the labels; else both have a depth camera.
    """

    left: SensorCalibration
    right: SensorCalibration
    baseline_m: float
    labelled: bool

    @property
    def is_measured(self) -> bool:
        """Whether disparity or depth of both is known."""
        return self.labelled or None not in (self.left.depth, self.right.depth)


def stereo_pair(episode: Episode, options: ExportOptions) -> StereoPair:
    """The pair that the options name, left first, or the first one of the rig that is measured.

    Raises:
        BadInputError: there is none, or it has neither disparity nor depth.
    """
    found = sorted(_pairs(episode, options), key=lambda pair: not pair.is_measured)
    for pair in found[:1]:
        for one in (pair.left, pair.right):
            if one.depth is None and not pair.labelled:
                raise BadInputError(
                    f"Episode {episode.id}: {one.id} has no depth camera beside it.",
                    "Record with labels.disparity: true. Or record a sensor of kind depth with "
                    "the pose and attributes of each of the two, and label both cameras.",
                )
        return pair
    raise BadInputError(
        f"Episode {episode.id} has no rectified stereo pair.",
        "It takes two cameras of equal lenses and directions, one to the right of the other; "
        "--camera LEFT --camera RIGHT names them.",
    )


def _pairs(episode: Episode, options: ExportOptions) -> Iterator[StereoPair]:
    """The pairs of the rig, or those that the options name, left first."""
    cameras = colour_cameras(episode, options, labelled=False, pinholes=True)
    for left in cameras[:1] if options.cameras else cameras:
        for right in cameras:
            baseline_m = _baseline_m(left, right)
            if baseline_m is not None:
                yield StereoPair(left, right, baseline_m, _has_labels(episode, (left, right)))


def _baseline_m(left: SensorCalibration, right: SensorCalibration) -> float | None:
    """How far the right camera is to the right of the left one; None: they are no pair."""
    if not (left.on_ego and right.on_ego):
        return None
    found = (
        StereoCamera(one.id, one.attach_to, one.width, one.height, one.k, one.ego_from_sensor)
        for one in (left, right)
    )
    return stereo_baseline_m(*found)


def _has_labels(episode: Episode, pair: tuple[SensorCalibration, SensorCalibration]) -> bool:
    """Whether the episode has the disparity of a pair as labels."""
    ids = tuple(one.id for one in pair)
    labelled = {(found.left.id, found.right.id) for found in episode.stereo_pairs()}
    return episode.spec.labels.disparity and ids in labelled


@dataclass(frozen=True, slots=True)
class StereoPart:
    """A pair that was written: its name, frame and time."""

    name: str
    k: int
    time_s: float


@dataclass(frozen=True, slots=True)
class StereoWriter:
    """Writes the files of a frame's pair.

    Attributes:
        pair: the cameras.
        first_number: of the episode's first pair.
        part: the folder.
    """

    pair: StereoPair
    first_number: int
    part: str

    def __call__(self, frame: Frame, folder: Path) -> StereoPart | None:
        """Write the frame; ``None`` where one of the four pictures, or disparity, is missing.

        Disparity that a camera has nowhere in a picture is that of a missing depth picture.
        """
        left, right = self.pair.left, self.pair.right
        depths = () if self.pair.labelled else (left.depth or "", right.depth or "")
        if not all(frame.has(name) for name in (left.id, right.id, *depths)):
            return None
        measured = self._measured(frame)
        if measured is None:
            return None
        steps, depth_m, right_depth_m = measured
        if not all(np.isfinite(one).any() for one in (depth_m, right_depth_m)):
            return None
        name, part = f"{self.first_number + frame.k:06d}", folder / self.part
        for camera, place in ((left, "image_2"), (right, "image_3")):
            copy_as_png(frame, camera.id, part / place / f"{name}_10.png")
        both = np.where(seen_by_both(steps, depth_m, right_depth_m), steps, 0).astype(np.uint16)
        packer = PngPacker()
        for place, content in (("disp_occ_0", steps), ("disp_noc_0", both)):
            (part / place / f"{name}_10.png").write_bytes(packer.pack(content))
        text = "".join(f"{key}: {numbers(value)}\n" for key, value in _calibration(self.pair))
        (part / "calib_cam_to_cam" / f"{name}.txt").write_text(text, "ascii")
        return StereoPart(name, frame.k, frame.timestamp_s)

    def _measured(self, frame: Frame) -> tuple[NDArray[np.uint16], Depth, Depth] | None:
        """The left picture's disparity, and the depth of both; ``None`` where it is lost."""
        left, right = self.pair.left, self.pair.right
        focal_baseline = float(left.k[0, 0]) * self.pair.baseline_m
        if self.pair.labelled:
            found = [frame.disparity(one.id) for one in (left, right)]
            disparities = [np.nan_to_num(one) for one in found if one is not None]
            if len(disparities) < len(found):
                return None
            steps = np.rint(disparities[0] * STEPS_PER_PX).astype(np.uint16)
            with np.errstate(divide="ignore"):
                depth_m, right_depth_m = (focal_baseline / one for one in disparities)
            return steps, depth_m.astype(np.float32), right_depth_m.astype(np.float32)
        depth_m, right_depth_m = frame.read(left.depth or ""), frame.read(right.depth or "")
        steps = disparity_steps(depth_m, float(left.k[0, 0]), self.pair.baseline_m)
        return steps, depth_m, right_depth_m


def _calibration(pair: StereoPair) -> list[tuple[str, FloatArray]]:
    """The rows of ``calib_cam_to_cam`` that stereo needs; cameras 02 and 03 are the pair."""
    rows: list[tuple[str, FloatArray]] = []
    for number, camera, shift_m in (("02", pair.left, 0.0), ("03", pair.right, pair.baseline_m)):
        projection = np.hstack([opencv_matrix(camera), np.zeros((3, 1))])
        projection[0, 3] = -camera.k[0, 0] * shift_m
        size = np.array([[camera.width, camera.height]], np.float64)
        rows += [(f"S_rect_{number}", size), (f"R_rect_{number}", np.eye(3))]
        rows.append((f"P_rect_{number}", projection))
    return rows


@register
class KittiStereo(Exporter):
    """See docs/formats/exports.md."""

    name: ClassVar = "kitti-stereo"
    summary: ClassVar = "KITTI stereo 2015: rectified pairs with exact disparity."
    uses: ClassVar = frozenset({"cameras", "val_share", "test_share"})

    def begin(self, episodes: Sequence[Episode], folder: Path) -> None:
        """Find the pairs and make KITTI's folders."""
        for episode in episodes:
            stereo_pair(episode, self.options)
        for part in {part_of(split): None for split in self.used_splits(episodes)}:
            for name in _FOLDERS:
                (folder / part / name).mkdir(parents=True)
        index = (folder / "frames.csv").open("w", encoding="utf-8")
        self._index: IO[str] = self.files.enter_context(index)
        self._index.write("name,split,episode_id,k,timestamp_s\n")
        self._number = 0

    def begin_episode(self, episode: Episode) -> StereoWriter:
        """Number its pairs after those of the episodes before."""
        self._episode = episode
        part = part_of(self.split_of(episode))
        return StereoWriter(stereo_pair(episode, self.options), self._number, part)

    def add(self, part: StereoPart) -> None:
        """List the pair."""
        split = self.split_of(self._episode)
        self._index.write(f"{part.name},{split},{self._episode.id},{part.k},{part.time_s:.6f}\n")

    def end_episode(self) -> None:
        """Go on counting after its pairs."""
        self._number += self._episode.frames

    def finish(self) -> None:
        """Close the list."""
        self.close()
