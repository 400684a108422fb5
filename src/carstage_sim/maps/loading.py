"""The way in: which towns there are, and how one is loaded."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import carstage_sim.cache
from carstage_sim.maps.baking import EVERYTHING, BakeOptions, bake
from carstage_sim.maps.cache import cached_town, town_path
from carstage_sim.maps.checking import MapSamplingError, check_geometry_library
from carstage_sim.maps.town import Town
from carstage_sim.maps.writer import PLANS, opendrive_of

MOST_TRIANGLES = 12_000_000
"""Of one town. CARLA's Town15 has two million; the thread that owns the world takes them in."""
_SPAWN_POINTS = {"Stage01": 214, "Stage02": 451, "Stage03": 1329}
"""Of each built-in town, which nobody has to bake to know them. A test counts them."""


@dataclass(frozen=True, slots=True)
class TownSource:
    """All that a town is baked from.

    Attributes:
        name: the map's short name.
        opendrive: the file's text.
        options: what to make of it apart from the roads.
        origin: where the text comes from, for messages; empty if no message needs it.
    """

    name: str
    opendrive: str
    options: BakeOptions = EVERYTHING
    origin: str = ""


class UnknownTownError(LookupError):
    """No town has the name that was asked for.

    Attributes:
        name: what was asked for.
        nearest: the town whose name is most like it.
    """

    def __init__(self, name: str, available: Iterable[str] = tuple(PLANS)) -> None:
        self.name = name
        ranked = difflib.get_close_matches(name, list(available), n=1, cutoff=0.0)
        self.nearest = ranked[0]
        super().__init__(f"there is no map {name!r}; did you mean {self.nearest!r}?")


def available_towns() -> tuple[str, ...]:
    """Short names of the built-in towns."""
    return tuple(PLANS)


@cache
def built_in_source(name: str) -> TownSource:
    """What a built-in town is baked from.

    Raises:
        UnknownTownError: if there is no such town.
    """
    if name not in PLANS:
        raise UnknownTownError(name)
    return TownSource(name, opendrive_of(PLANS[name]))


def load_town(name: str, *, cache_folder: Path | None = None) -> Town:
    """A built-in town, from the cache or baked now (some seconds).

    Args:
        name: one of :func:`available_towns`.
        cache_folder: where baked towns are kept; by default in the user's cache folder.

    Raises:
        UnknownTownError: if there is no such town.
        MapSamplingError: if the bake's child process fails.
    """
    return town_of(built_in_source(name), cache_folder=cache_folder)


def spawn_point_count(name: str) -> int:
    """Number of a built-in town's spawn points, without the town.

    Args:
        name: one of :func:`available_towns`.

    Raises:
        UnknownTownError: if there is no such town.
    """
    if name not in _SPAWN_POINTS:
        raise UnknownTownError(name)
    return _SPAWN_POINTS[name]


def town_from_opendrive(
    name: str,
    opendrive: str,
    options: BakeOptions = EVERYTHING,
    *,
    cache_folder: Path | None = None,
) -> Town:
    """The town of an OpenDRIVE text, from the cache or baked now (seconds to minutes).

    Args:
        name: the map's short name.
        opendrive: the file's text.
        options: what to make of it apart from the roads.
        cache_folder: where baked towns are kept; by default in the user's cache folder.

    Raises:
        MapSamplingError: if nothing can be made of the text.
    """
    return town_of(TownSource(name, opendrive, options), cache_folder=cache_folder)


def town_of(source: TownSource, *, cache_folder: Path | None = None) -> Town:
    """The town of a source, from the cache or baked now (seconds to minutes).

    Args:
        source: what it is baked from.
        cache_folder: where baked towns are kept; by default in the user's cache folder.

    Raises:
        MapSamplingError: if nothing can be made of the text.
    """
    check_geometry_library()
    try:
        return cached_town(source.name, _key(source), lambda: _baked(source), _folder(cache_folder))
    except MapSamplingError as error:
        if not source.origin:
            raise
        raise MapSamplingError(f"{source.origin}: {error}") from error


def _baked(source: TownSource) -> Town:
    town = bake(source.name, source.opendrive, source.options)
    count = len(town.static_mesh.triangles)
    if count > MOST_TRIANGLES:
        raise MapSamplingError(
            f"map {source.name}: {count} triangles are too many for one town (at most "
            f"{MOST_TRIANGLES}); cut the map into pieces"
        )
    return town


def is_baked(source: TownSource, *, cache_folder: Path | None = None) -> bool:
    """Whether :func:`town_of` need not bake."""
    return town_path(source.name, _key(source), _folder(cache_folder)).exists()


def _key(source: TownSource) -> str:
    return f"{source.name} {source.options}\n{source.opendrive}"


def _folder(given: Path | None) -> Path:
    return given or carstage_sim.cache.cache_folder() / "towns"
