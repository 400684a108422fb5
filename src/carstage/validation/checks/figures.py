"""What was measured: in some frames, in an episode's tables, and over a whole dataset."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar

from carstage.validation.checks.colours import ColourFigures
from carstage.validation.checks.edges import EdgeFigures, FrameFit, new_fits
from carstage.validation.checks.flow import FlowFigures
from carstage.validation.checks.motion import MotionFigures
from carstage.validation.checks.patch_pairs import PairFigures
from carstage.validation.checks.pictures import PictureFigures
from carstage.validation.checks.population import Population
from carstage.validation.checks.ranging import RangingFigures
from carstage.validation.checks.silhouettes import SilhouetteFigures
from carstage.validation.checks.variants import VariantFigures

_Key = TypeVar("_Key")
_Figures = TypeVar("_Figures", bound="_Summed")


class _Summed(Protocol):
    def add(self, other: Any, /) -> None: ...


@dataclass(slots=True)
class TableFigures:
    """What was measured in the documents and tables of an episode.

    Attributes:
        files, bytes: that were read.
        motion: steps of objects.
        population: who is there and seen; empty for an agent, whose world is the ego's.
    """

    files: int = 0
    bytes: int = 0
    motion: MotionFigures = field(default_factory=MotionFigures)
    population: Population = field(default_factory=Population.empty)


@dataclass(slots=True)
class _Measured:
    """What is measured in frames, and summed over all episodes."""

    frames: int = 0
    files: int = 0
    bytes: int = 0
    points_in_boxes: int = 0
    hull: SilhouetteFigures = field(default_factory=SilhouetteFigures)
    pairs: dict[tuple[str, str], RangingFigures] = field(
        default_factory=lambda: defaultdict(RangingFigures)
    )
    edges: dict[str, EdgeFigures] = field(default_factory=lambda: defaultdict(EdgeFigures))
    fits: dict[str, dict[int, FrameFit]] = field(default_factory=lambda: defaultdict(new_fits))
    flow: dict[str, FlowFigures] = field(default_factory=lambda: defaultdict(FlowFigures))
    pictures: dict[str, PictureFigures] = field(default_factory=lambda: defaultdict(PictureFigures))

    def add_frames(self, frames: FrameFigures) -> None:
        """Add those of frames, but for their number: agents have the ego's."""
        self.files += frames.files
        self.bytes += frames.bytes
        self.points_in_boxes += frames.points_in_boxes
        self.hull.add(frames.hull)
        _add_each(self.pairs, frames.pairs)
        _add_each(self.edges, frames.edges)
        for camera, fits in frames.fits.items():
            _add_each(self.fits[camera], fits)
        _add_each(self.flow, frames.flow)
        _add_each(self.pictures, frames.pictures)


@dataclass(slots=True)
class FrameFigures(_Measured):
    """What was measured in frames of one episode that follow each other.

    Attributes:
        frames, files, bytes: that were read.
        points_in_boxes: points of LiDARs in boxes.
        hull: pixels of objects outside their silhouettes.
        pairs: by LiDAR and depth camera.
        edges, colours, flow, pictures: by camera.
        fits: by camera, how pictures fit the labels of the frame before (-1) and after (1).
        late: by camera, frame after frame the first of these.
    """

    late: dict[str, list[tuple[int, FrameFit]]] = field(default_factory=lambda: defaultdict(list))
    colours: dict[str, ColourFigures] = field(default_factory=lambda: defaultdict(ColourFigures))

    def add(self, later: FrameFigures) -> None:
        """Add those of the frames that follow."""
        self.frames += later.frames
        self.add_frames(later)
        for camera, fits in later.late.items():
            self.late[camera].extend(fits)
        _add_each(self.colours, later.colours)


@dataclass(slots=True)
class Figures(_Measured):
    """What was measured over all episodes so far."""

    motion: MotionFigures = field(default_factory=MotionFigures)
    population: Population = field(default_factory=Population.empty)
    variants: VariantFigures = field(default_factory=VariantFigures)
    patch_pairs: PairFigures = field(default_factory=PairFigures)
    not_decidable: list[str] = field(default_factory=list)

    def add_tables(self, tables: TableFigures) -> None:
        """Add those of an episode's tables."""
        self.files += tables.files
        self.bytes += tables.bytes
        self.motion.add(tables.motion)
        self.population.add(tables.population)

    def to_dict(self, episodes: int) -> dict[str, Any]:
        """For the report."""
        return {
            "episodes": episodes,
            "frames": self.frames,
            "files": self.files,
            "bytes": self.bytes,
            "hull": self.hull.to_dict(),
            "lidar_depth": {
                f"{lidar} / {camera}": pair.to_dict()
                for (lidar, camera), pair in sorted(self.pairs.items())
            },
            "lidar_points_in_boxes": self.points_in_boxes,
            "rgb_edges": {
                camera: None if edges.ratio is None else round(edges.ratio, 3)
                for camera, edges in sorted(self.edges.items())
            },
            "rgb_frame": {
                camera: {str(step): fit.rounded for step, fit in sorted(fits.items())}
                for camera, fits in sorted(self.fits.items())
            },
            "flow": {camera: flow.to_dict() for camera, flow in sorted(self.flow.items())},
            "motion": self.motion.to_dict(),
            "pictures": {camera: p.to_dict() for camera, p in sorted(self.pictures.items())},
            "labels": self.population.to_dict(),
            "variants": self.variants.to_dict(),
            "patch_pairs": self.patch_pairs.to_dict(),
            "not_decidable": self.not_decidable,
        }


def _add_each(totals: dict[_Key, _Figures], others: Mapping[_Key, _Figures]) -> None:
    for key, other in others.items():
        totals[key].add(other)
