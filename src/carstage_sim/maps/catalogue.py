"""The maps that a server offers: built-in towns, OpenDRIVE files of the user, and aliases.

A program that asks for a map of CARLA's that is not here gets the built-in town that is most like
it, under the name that it asked for: programs compare ``world.get_map().name`` with what they
loaded. A map of the true name always wins over an alias.
"""

from __future__ import annotations

import dataclasses
import logging
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from carstage_sim.maps.background import BakeLimits
from carstage_sim.maps.baking import BakeOptions
from carstage_sim.maps.loading import (
    TownSource,
    UnknownTownError,
    available_towns,
    built_in_source,
    is_baked,
    town_of,
)
from carstage_sim.maps.town import Town

logger = logging.getLogger(__name__)

GENERATED = "OpenDriveMap"
"""What CARLA calls the map that a client's ``generate_opendrive_world`` makes."""

_SUFFIX = ".xodr"
_CARLA_TOWN = re.compile(r"Town\d\d(HD)?(_Opt)?")
_OPTIMISED = "_Opt"
_LIKE_CARLAS = {"Town04": "Stage03", "Town06": "Stage03", "Town01": "Stage01", "Town02": "Stage01"}
_OTHERWISE = ("Stage02", "Stage01")


class MapFileError(ValueError):
    """A file or folder that was named as a map is none."""


class MapCatalogue:
    """Which maps there are, and the way to load one.

    Args:
        sources: OpenDRIVE files, and folders of them; a file's stem is the map's name.
        aliases: names that stand for maps.
        cache_folder: where baked towns are kept; by default in the user's cache folder.
        bake_limits: what the bake of a map for a client may take.

    Attributes:
        cache_folder, bake_limits: as given.

    Raises:
        MapFileError: a source is missing or holds no map, or an alias leads nowhere.
    """

    def __init__(
        self,
        sources: Sequence[Path] = (),
        aliases: Mapping[str, str] | None = None,
        *,
        cache_folder: Path | None = None,
        bake_limits: BakeLimits | None = None,
    ) -> None:
        self._files: dict[str, Path] = {}
        for source in sources:
            for path in _maps_in(source):
                self._files.setdefault(path.stem, path)
        self._aliases = dict(aliases or {})
        self._generated: dict[str, TownSource] = {}
        self.cache_folder = cache_folder
        self.bake_limits = bake_limits
        self._announced: set[str] = set()
        for alias, name in self._aliases.items():
            if self._true_name(name) is None:
                raise MapFileError(
                    f"alias {alias}={name}: there is no map {name!r}; there are "
                    f"{', '.join(self.names)}"
                )

    @property
    def names(self) -> tuple[str, ...]:
        """What clients are offered: built-in towns, the user's files and aliases."""
        return tuple(dict.fromkeys([*available_towns(), *self._files, *self._aliases]))

    def _true_name(self, name: str) -> str | None:
        if name in self._generated or name in self._files or name in available_towns():
            return name
        return None

    def resolve(self, name: str) -> str:
        """The true name of the map that a client gets when it asks for ``name``.

        Raises:
            UnknownTownError: there is none.
        """
        plain = name.removesuffix(_OPTIMISED)
        for candidate in (name, self._aliases.get(name), plain, self._aliases.get(plain)):
            if candidate is not None and (true := self._true_name(candidate)) is not None:
                return true
        if _CARLA_TOWN.fullmatch(name):
            for stage in (_LIKE_CARLAS.get(plain), *_OTHERWISE):
                if stage in available_towns():
                    return stage
        raise UnknownTownError(name, self.names)

    def __contains__(self, name: str) -> bool:
        try:
            self.resolve(name)
        except UnknownTownError:
            return False
        return True

    def load(self, name: str) -> Town:
        """The map, from the cache or baked now, under the name that was asked for.

        Raises:
            UnknownTownError: there is no such map.
            MapFileError: its file cannot be read.
            MapSamplingError: nothing can be made of the file.
        """
        true = self.resolve(name)
        if true != name and name not in self._announced:
            self._announced.add(name)
            logger.warning("there is no map %s: %s stands in for it", name, true)
        town = town_of(self.source(true), cache_folder=self.cache_folder)
        return town if true == name else dataclasses.replace(town, name=name)

    def source(self, name: str) -> TownSource:
        """What the map that answers to a name is baked from.

        Raises:
            UnknownTownError: there is no such map.
            MapFileError: its file cannot be read.
        """
        true = self.resolve(name)
        if true in self._generated:
            return self._generated[true]
        if true in self._files:
            path = self._files[true]
            return TownSource(true, _read(path), origin=str(path))
        return built_in_source(true)

    def is_baked(self, source: TownSource) -> bool:
        """Whether a map need not be baked before it is loaded."""
        return is_baked(source, cache_folder=self.cache_folder)

    def generate(self, source: TownSource) -> None:
        """Bakes what a client sent; it can then be loaded under its name.

        Raises:
            MapSamplingError: nothing can be made of it; what was generated before stays.
        """
        town_of(source, cache_folder=self.cache_folder)
        self._generated[source.name] = source


def generated_source(opendrive: str, options: BakeOptions) -> TownSource:
    """The source of a map that a client sent; it will be ``OpenDriveMap``."""
    return TownSource(GENERATED, opendrive, options)


def _maps_in(source: Path) -> list[Path]:
    if source.is_dir():
        found = sorted(source.glob(f"*{_SUFFIX}"))
        if not found:
            raise MapFileError(f"{source}: no *{_SUFFIX} file in this folder")
        return found
    if not source.is_file():
        raise MapFileError(f"{source}: no such file or folder")
    if source.suffix != _SUFFIX:
        raise MapFileError(f"{source}: not an OpenDRIVE file; its name must end in {_SUFFIX}")
    return [source]


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise MapFileError(f"{path}: cannot be read: {error}") from error
