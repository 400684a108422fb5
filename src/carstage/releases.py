"""CARLA's releases: which ones Car-STAGE knows, and what the older of them lack.

Standard library only, for the collector runs it under an older Python.
"""

from __future__ import annotations

import re
from typing import Dict, List, Literal, Mapping, NamedTuple, Optional, Tuple, get_args

_NUMBERS = re.compile(r"(\d+)\.(\d+)\.(\d+)")


class Release(NamedTuple):
    """The numbers of a release; compares as they do."""

    major: int
    minor: int
    patch: int

    def __str__(self) -> str:
        return "%d.%d.%d" % self


KNOWN = (Release(0, 9, 13), Release(0, 9, 14), Release(0, 9, 15), Release(0, 9, 16))
"""Releases whose wire protocol, tags and conventions are known here, the oldest first."""

OLDEST = KNOWN[0]
NEWEST = KNOWN[-1]

CLIENT_PYTHONS: Dict[Release, List[str]] = {
    Release(0, 9, 13): ["3.8"],
    Release(0, 9, 14): ["3.8"],
    Release(0, 9, 15): ["3.10", "3.8"],
    Release(0, 9, 16): ["3.11", "3.12", "3.10"],
}
"""Pythons that run the collector and that a release's client wheel exists for, preferred first."""


Projection = Literal["spherical_mercator", "transverse_mercator"]
North = Literal["-y", "+y"]
PROJECTIONS: Tuple[Projection, ...] = get_args(Projection)
NORTHS: Tuple[North, ...] = get_args(North)


class GnssConvention(NamedTuple):
    """What a server's GNSS sensors read: by which projection, and which way latitudes grow."""

    projection: str
    north: str


def gnss_convention(server: str) -> GnssConvention:
    """The convention of a release, as ``GeoLocation.cpp`` of its sources has it."""
    release = release_of(server)
    if release is not None and release < Release(0, 9, 16):
        return GnssConvention("spherical_mercator", "-y")
    return GnssConvention("transverse_mercator", "+y")


def release_of(version: str) -> Optional[Release]:
    """The release in a version text: ``0.9.15-dirty`` is 0.9.15; None for other texts."""
    match = _NUMBERS.search(version)
    return Release(*(int(number) for number in match.groups())) if match else None


def refusal(server: str, since: Optional[Mapping[str, Release]] = None) -> str:
    """Why a server of this version cannot be recorded from; empty when it can.

    Args:
        server: the version that it reports.
        since: of the kinds of sensors that are wanted, the first release that has each.
    """
    release = release_of(server)
    if release is None:
        return "the server's version %r is not of the form %s" % (server, NEWEST)
    if release < OLDEST:
        return "the server is CARLA %s; the oldest that can be recorded from is %s" % (
            server,
            OLDEST,
        )
    for kind, first in (since or {}).items():
        if release < first:
            return "the server is CARLA %s; sensors of kind %s exist since %s" % (
                server,
                kind,
                first,
            )
    return ""


def is_newer(server: str) -> bool:
    """Whether a server is newer than every release that is known here."""
    release = release_of(server)
    return release is not None and release > NEWEST


def client_release(server: str) -> Release:
    """The release of the client wheel that fits a server: its own, or the newest known one.

    Raises:
        ValueError: the text is no version.
    """
    release = release_of(server)
    if release is None:
        raise ValueError("%r is not a version such as %s" % (server, NEWEST))
    return min(release, NEWEST)
