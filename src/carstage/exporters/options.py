"""What a user may choose about an export."""

from __future__ import annotations

from dataclasses import Field, dataclass, field, fields
from difflib import get_close_matches
from typing import Any, Literal, get_args

from carstage.errors import BadInputError
from carstage.exporters.classes import CLASSES, DEFAULT_CLASSES

BoxChoice = Literal["amodal", "modal"]
OcclusionChoice = Literal["stage_vo", "pixel"]
CodecChoice = Literal["ffv1", "h264"]
MessagesChoice = Literal["foxglove", "ros2"]


def _shown(text: str, metavar: str | None = None, flag: str | None = None) -> dict[str, Any]:
    """What the command line shows of a field."""
    return {"help": text, "metavar": metavar, "flag": flag}


def flag_of(option: Field[Any]) -> str:
    """How the command line calls a field of ``ExportOptions``."""
    return str(option.metadata["flag"] or "--" + option.name.replace("_", "-"))


@dataclass(frozen=True, slots=True)
class ExportOptions:
    """Choices; ``None`` and empty mean the format's own default.

    Attributes:
        cameras: ids of the cameras to export.
        lidar: id of the LiDAR to export.
        boxes: which 2D boxes: around the silhouette or around the visible pixels.
        occlusion: which occlusion levels.
        min_lidar_points: objects with fewer points, over all LiDARs, are left out.
        max_distance_m: objects farther from the camera (nuScenes: from the ego) are left out.
        include_invisible: whether objects that nothing is seen of are exported too.
        validation_share: share of the episodes that goes to the validation split.
        codec: of videos: lossless or small.
        classes: names of the classes to export.
        messages: of MCAP: which messages.
    """

    cameras: tuple[str, ...] = field(
        default=(), metadata=_shown("A camera to export. Repeatable.", "ID", "--camera")
    )
    lidar: str | None = field(default=None, metadata=_shown("The LiDAR to export.", "ID"))
    boxes: BoxChoice | None = field(
        default=None,
        metadata=_shown(
            "2D boxes around the silhouette or around the visible pixels.", "amodal|modal"
        ),
    )
    occlusion: OcclusionChoice | None = field(
        default=None,
        metadata=_shown(
            "KITTI's occlusion levels by STAGE-VO or by counted pixels.", "stage_vo|pixel"
        ),
    )
    min_lidar_points: int | None = field(
        default=None, metadata=_shown("Leave out objects with fewer LiDAR points.")
    )
    max_distance_m: float | None = field(
        default=None, metadata=_shown("Leave out objects farther away.")
    )
    include_invisible: bool = field(
        default=False, metadata=_shown("Export objects that nothing is seen of.")
    )
    validation_share: float = field(
        default=0.0, metadata=_shown("Share of the episodes for validation.")
    )
    codec: CodecChoice | None = field(
        default=None, metadata=_shown("Of videos: without loss (default), or small.", "ffv1|h264")
    )
    classes: tuple[str, ...] = field(
        default=(),
        metadata=_shown(
            "A class to export, also rider, pole and the like. Repeatable.", "NAME", "--class"
        ),
    )
    messages: MessagesChoice | None = field(
        default=None,
        metadata=_shown("Of MCAP: Foxglove's messages (default), or ROS 2's.", "foxglove|ros2"),
    )

    def __post_init__(self) -> None:
        for name, given, known in (
            ("boxes", self.boxes, get_args(BoxChoice)),
            ("occlusion", self.occlusion, get_args(OcclusionChoice)),
            ("codec", self.codec, get_args(CodecChoice)),
            ("messages", self.messages, get_args(MessagesChoice)),
        ):
            if given is not None and given not in known:
                raise BadInputError(f"{name}: {given!r}.", f"Give {' or '.join(known)}.")
        for name in self.classes:
            if name not in CLASSES:
                near = get_close_matches(name, CLASSES, n=1)
                hint = f"Did you mean {near[0]!r}? " if near else ""
                raise BadInputError(
                    f"class: {name!r} is no class.", f"{hint}Known: {', '.join(CLASSES)}."
                )
        if not 0.0 <= self.validation_share < 1.0:
            raise BadInputError(
                f"validation-share: {self.validation_share} is no share.",
                "Give a number from 0 to below 1.",
            )
        if self.min_lidar_points is not None and self.min_lidar_points < 0:
            raise BadInputError("min-lidar-points: less than 0 points.", "Give 0 or more.")
        if self.max_distance_m is not None and not self.max_distance_m > 0.0:
            raise BadInputError(
                f"max-distance-m: {self.max_distance_m} is no distance.", "Give more than 0."
            )

    @property
    def chosen_classes(self) -> tuple[str, ...]:
        """The classes to export, in the order of ``CLASSES``."""
        wanted = self.classes or DEFAULT_CLASSES
        return tuple(name for name in CLASSES if name in wanted)

    def given(self) -> tuple[str, ...]:
        """Names of the options that differ from their defaults."""
        plain = ExportOptions()
        return tuple(
            f.name for f in fields(self) if getattr(self, f.name) != getattr(plain, f.name)
        )
