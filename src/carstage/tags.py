"""CARLA's semantic tags: both tables, the way from the old one to the new, tags of actors.

Clients up to 0.9.13 number the labels otherwise than those from 0.9.14 on (CARLA's
``ObjectLabel.h`` and ``CityScapesPalette.h`` of both). A dataset stores the table it uses.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from carstage.errors import AnnotationError
from carstage.releases import NEWEST, Release, release_of

Rgb = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Tag:
    """One semantic label: its name and its colour in CARLA's CityScapes palette."""

    name: str
    rgb: Rgb


def _table(*rows: tuple[str, Rgb]) -> Mapping[int, Tag]:
    return MappingProxyType({value: Tag(name, rgb) for value, (name, rgb) in enumerate(rows)})


TAGS_0_9_13: Final = _table(
    ("Unlabeled", (0, 0, 0)),
    ("Building", (70, 70, 70)),
    ("Fence", (100, 40, 40)),
    ("Other", (55, 90, 80)),
    ("Pedestrian", (220, 20, 60)),
    ("Pole", (153, 153, 153)),
    ("RoadLine", (157, 234, 50)),
    ("Road", (128, 64, 128)),
    ("SideWalk", (244, 35, 232)),
    ("Vegetation", (107, 142, 35)),
    ("Vehicles", (0, 0, 142)),
    ("Wall", (102, 102, 156)),
    ("TrafficSign", (220, 220, 0)),
    ("Sky", (70, 130, 180)),
    ("Ground", (81, 0, 81)),
    ("Bridge", (150, 100, 100)),
    ("RailTrack", (230, 150, 140)),
    ("GuardRail", (180, 165, 180)),
    ("TrafficLight", (250, 170, 30)),
    ("Static", (110, 190, 160)),
    ("Dynamic", (170, 120, 50)),
    ("Water", (45, 60, 150)),
    ("Terrain", (145, 170, 100)),
)
"""Tags of servers up to 0.9.13."""

TAGS_0_9_14: Final = _table(
    ("Unlabeled", (0, 0, 0)),
    ("Roads", (128, 64, 128)),
    ("SideWalks", (244, 35, 232)),
    ("Building", (70, 70, 70)),
    ("Wall", (102, 102, 156)),
    ("Fence", (190, 153, 153)),
    ("Pole", (153, 153, 153)),
    ("TrafficLight", (250, 170, 30)),
    ("TrafficSign", (220, 220, 0)),
    ("Vegetation", (107, 142, 35)),
    ("Terrain", (152, 251, 152)),
    ("Sky", (70, 130, 180)),
    ("Pedestrian", (220, 20, 60)),
    ("Rider", (255, 0, 0)),
    ("Car", (0, 0, 142)),
    ("Truck", (0, 0, 70)),
    ("Bus", (0, 60, 100)),
    ("Train", (0, 80, 100)),
    ("Motorcycle", (0, 0, 230)),
    ("Bicycle", (119, 11, 32)),
    ("Static", (110, 190, 160)),
    ("Dynamic", (170, 120, 50)),
    ("Other", (55, 90, 80)),
    ("Water", (45, 60, 150)),
    ("RoadLine", (157, 234, 50)),
    ("Ground", (81, 0, 81)),
    ("Bridge", (150, 100, 100)),
    ("RailTrack", (230, 150, 140)),
    ("GuardRail", (180, 165, 180)),
)
"""Tags of servers from 0.9.14 on; 1 to 19 are Cityscapes' train ids plus one."""

# The old table has one tag for all vehicles: its class is lost and comes from the actor.
_NEW_FROM_OLD: Final = (
    (0, 3, 5, 22, 12, 6, 24, 1, 2, 9, 14, 4, 8, 11, 25, 26, 27, 28, 7, 20, 21, 23, 10)
)  # fmt: skip


def server_release(version: str) -> Release:
    """The release of a server that reports ``0.9.16`` or ``0.9.16-dirty``.

    Raises:
        AnnotationError: when the text holds no three numbers.
    """
    release = release_of(version)
    if release is None:
        raise AnnotationError(
            f"The server's version {version!r} is not of the form {NEWEST}.",
            "Record again from a released CARLA server.",
        )
    return release


def numbers_tags_anew(server_version: str) -> bool:
    """Whether a server numbers its tags as datasets do, that is since 0.9.14.

    A server newer than all known ones does, as far as is known; the self-test finds out.

    Raises:
        AnnotationError: the text is no version.
    """
    return server_release(server_version) >= (0, 9, 14)


def dataset_tags(tags: Iterable[int], server_version: str) -> tuple[int, ...]:
    """Tags of a server in the numbering of datasets.

    Raises:
        AnnotationError: the server's table has no such tag.
    """
    if numbers_tags_anew(server_version):
        return tuple(tags)
    return tuple(new_tag(tag) for tag in tags)


def tag_table(server_version: str) -> Mapping[int, Tag]:
    """The tags that a server of this version writes; see ``numbers_tags_anew``."""
    return TAGS_0_9_14 if numbers_tags_anew(server_version) else TAGS_0_9_13


def new_tag(old_tag: int) -> int:
    """The tag from 0.9.14 on of a tag up to 0.9.13; vehicles become Car.

    Raises:
        AnnotationError: when the old table has no such tag.
    """
    if old_tag not in TAGS_0_9_13:
        raise AnnotationError(f"Semantic tag {old_tag} is not in CARLA 0.9.13's table (0 to 22).")
    return _NEW_FROM_OLD[old_tag]


def vehicle_tags(server_version: str) -> frozenset[int]:
    """Tags that pixels of a vehicle actor may carry, its rider's included."""
    if tag_table(server_version) is TAGS_0_9_13:
        return frozenset({10, 4})
    return frozenset({13, 14, 15, 16, 17, 18, 19})


def walker_tags(server_version: str) -> frozenset[int]:
    """Tags that pixels of a walker actor may carry."""
    return frozenset({4 if tag_table(server_version) is TAGS_0_9_13 else 12})
