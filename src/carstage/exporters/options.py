"""What a user may choose about an export."""

from __future__ import annotations

from dataclasses import Field, dataclass, field, fields
from difflib import get_close_matches
from typing import Any, Literal, get_args

from carstage.errors import BadInputError
from carstage.exporters.class_map import ClassMap
from carstage.exporters.classes import CLASSES, DEFAULT_CLASSES

BoxChoice = Literal["amodal", "modal"]
OcclusionChoice = Literal["stage_vo", "pixel"]
CodecChoice = Literal["ffv1", "h264"]
MessagesChoice = Literal["foxglove", "ros2"]
CategoryChoice = Literal["own", "coco80"]


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
        boxes: which 2D boxes: around the silhouette or around the visible pixels, which is the
            default where pictures are what is labelled.
        occlusion: which occlusion levels; the default is by counted pixels.
        min_lidar_points: objects with fewer points, over all LiDARs, are left out.
        max_distance_m: objects farther from the camera (nuScenes: from the ego) are left out.
        include_invisible: whether objects that nothing is seen of are exported too.
        val_share: share of the episodes for validation in this export; like ``test_share`` it
            replaces the splits of the dataset.
        test_share: share for test.
        codec: of videos: lossless or small.
        keyframes_hz: how many frames a second nuScenes has labels of.
        classes: names of the classes to export.
        messages: of MCAP: which messages.
        episodes: ids of the episodes to export; none: all.
        agent: name of the agent beside the ego whose sensors and labels are exported.
        variant: name of the variant whose episodes are exported; none: all.
        categories: Car-STAGE's classes, or COCO's 80.
        class_map: targets of the classes, see ``read_class_map``.
        nuscenes_locations: whether towns get the names of the four locations that nuScenes's
            devkit knows.
    """

    cameras: tuple[str, ...] = field(
        default=(),
        metadata=_shown("A camera to export. Repeatable; KITTI: also all.", "ID", "--camera"),
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
    val_share: float | None = field(
        default=None,
        metadata=_shown("Share of the episodes for validation, instead of the stored splits."),
    )
    test_share: float | None = field(
        default=None, metadata=_shown("Share of the episodes for test, likewise.")
    )
    codec: CodecChoice | None = field(
        default=None, metadata=_shown("Of videos: without loss (default), or small.", "ffv1|h264")
    )
    keyframes_hz: float | None = field(
        default=None,
        metadata=_shown("nuScenes's key frames per second; default 2 where that divides.", "HZ"),
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
    categories: CategoryChoice | None = field(
        default=None,
        metadata=_shown("Car-STAGE's classes (default) or COCO's own 80.", "own|coco80"),
    )
    episodes: tuple[str, ...] = field(
        default=(),
        metadata=_shown("An episode to export; default: all. Repeatable.", "ID", "--episode"),
    )
    agent: str | None = field(
        default=None,
        metadata=_shown("Export what this agent recorded, in place of the ego.", "NAME"),
    )
    variant: str | None = field(
        default=None,
        metadata=_shown("Export the episodes of this variant only.", "NAME"),
    )
    class_map: ClassMap | None = field(
        default=None,
        metadata=_shown("YAML: what each class is called, others are left out.", "FILE"),
    )
    nuscenes_locations: bool = field(
        default=False,
        metadata=_shown("Call towns by the four locations that nuScenes's devkit knows."),
    )

    def __post_init__(self) -> None:
        for name, given, known in (
            ("boxes", self.boxes, get_args(BoxChoice)),
            ("occlusion", self.occlusion, get_args(OcclusionChoice)),
            ("codec", self.codec, get_args(CodecChoice)),
            ("messages", self.messages, get_args(MessagesChoice)),
            ("categories", self.categories, get_args(CategoryChoice)),
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
            if self.class_map is not None and name not in self.class_map.classes:
                raise BadInputError(
                    f"class: {name!r} has no target.",
                    f"These have one: {', '.join(sorted(self.class_map.classes))}.",
                )
        for name, share in (("val-share", self.val_share), ("test-share", self.test_share)):
            if share is not None and not 0.0 <= share < 1.0:
                raise BadInputError(
                    f"{name}: {share} is no share.", "Give a number from 0 to below 1."
                )
        if (self.val_share or 0.0) + (self.test_share or 0.0) >= 1.0:
            raise BadInputError(
                f"val-share and test-share: {self.val_share} and {self.test_share} leave nothing "
                "for training.",
                "Give shares whose sum is below 1.",
            )
        if self.min_lidar_points is not None and self.min_lidar_points < 0:
            raise BadInputError("min-lidar-points: less than 0 points.", "Give 0 or more.")
        if self.max_distance_m is not None and not self.max_distance_m > 0.0:
            raise BadInputError(
                f"max-distance-m: {self.max_distance_m} is no distance.", "Give more than 0."
            )
        if self.keyframes_hz is not None and not self.keyframes_hz > 0.0:
            raise BadInputError(
                f"keyframes-hz: {self.keyframes_hz} is no rate.", "Give more than 0."
            )

    @property
    def chosen_classes(self) -> tuple[str, ...]:
        """The classes to export, in the order of ``CLASSES``."""
        mapped = DEFAULT_CLASSES if self.class_map is None else self.class_map.classes
        wanted = self.classes or mapped
        return tuple(name for name in CLASSES if name in wanted)

    def given(self) -> tuple[str, ...]:
        """Names of the options that differ from their defaults."""
        plain = ExportOptions()
        return tuple(
            f.name for f in fields(self) if getattr(self, f.name) != getattr(plain, f.name)
        )
