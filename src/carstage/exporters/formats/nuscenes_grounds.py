"""The ground of each map of a nuScenes export: its frame, its mask, its map expansion."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from carstage.dataset import Episode
from carstage.errors import BadInputError
from carstage.exporters.formats.nuscenes_expansion import (
    LOCATIONS,
    map_expansion,
    surface_cells_of,
)
from carstage.exporters.formats.nuscenes_files import METRES_PER_PX, write_mask
from carstage.exporters.formats.nuscenes_tables import token
from carstage.exporters.road_cells import SurfaceMap
from carstage.vector_map import VectorMap

EXPANSION: Final = "maps/expansion"
_MARGIN_M, _STEP_M = 150.0, 100.0
_MOST_MASK_M = 4000.0
_HASH_DIGITS = 8


@dataclass(frozen=True, slots=True)
class Ground:
    """One map.

    Attributes:
        location: what the devkit calls it.
        mask_token: of its mask, which is the name of the file as well.
        shift_m: where its frame begins: what is added to east and north.
        size_px: of the mask.
        surfaces: where roads and sidewalks are.
        town: its vector map; None: the dataset has none.
    """

    location: str
    mask_token: str
    shift_m: tuple[float, float]
    size_px: tuple[int, int]
    surfaces: SurfaceMap
    town: VectorMap | None

    def write(self, folder: Path) -> str:
        """Write mask and expansion; returns the mask's place in the export."""
        mask = f"maps/{self.mask_token}.png"
        if self.town is not None:
            self.surfaces.add(surface_cells_of(self.town, self.shift_m))
            width_m, height_m = (size * METRES_PER_PX for size in self.size_px)
            document = map_expansion(
                self.town, self.location, self.shift_m, (round(width_m, 1), round(height_m, 1))
            )
            path = folder / EXPANSION / f"{self.location}.json"
            path.write_text(json.dumps(document, separators=(",", ":")) + "\n", "utf-8")
        write_mask(folder / mask, *self.size_px, self.surfaces.closed())
        return mask


def town_names(episodes: Iterable[Episode]) -> dict[str, str]:
    """The town of each episode by the episode's id: the map's name.

    Of towns that share a name, and have different vector maps, the map's hash is in it, too.
    """
    named = {e.id: (e.document["map"], e.document.get("vector_map")) for e in episodes}
    maps = Counter(name for name, found in set(named.values()) if found is not None)
    return {
        episode: name
        if found is None or maps[name] == 1
        else f"{name}-{found.partition(':')[2][:_HASH_DIGITS]}"
        for episode, (name, found) in named.items()
    }


def grounds_of(
    episodes: Sequence[Episode],
    towns: Mapping[str, str],
    *,
    nuscenes_locations: bool,
    lost_maps: Container[str] = (),
) -> dict[str, Ground]:
    """The ground of each town by its name.

    Args:
        episodes: all that are exported.
        towns: see :func:`town_names`.
        nuscenes_locations: whether maps get the names of the devkit's four locations.
        lost_maps: ids of the episodes whose vector map is missing or damaged.

    Raises:
        BadInputError: there are more maps than names, or one is larger than the devkit draws.
    """
    names = sorted(set(towns.values()))
    locations = _locations(names, nuscenes_locations=nuscenes_locations)
    return {
        name: _ground([e for e in episodes if towns[e.id] == name], *locations[name], lost_maps)
        for name in names
    }


def _locations(names: Iterable[str], *, nuscenes_locations: bool) -> Mapping[str, tuple[str, str]]:
    """The location of each map, and the token of its mask."""
    if not nuscenes_locations:
        return {name: (Path(name).name, token("map", name)) for name in names}
    found = dict(zip(names, LOCATIONS.items(), strict=False))
    left = [name for name in names if name not in found]
    if left:
        raise BadInputError(
            f"nuscenes-locations: the devkit knows {len(LOCATIONS)} locations; there is none left "
            f"for {', '.join(left)}.",
            "Export fewer towns at once with --episode, or leave the option out.",
        )
    return found


def _ground(
    episodes: Sequence[Episode], location: str, mask_token: str, lost_maps: Container[str]
) -> Ground:
    """The area around all that drove on a map; nuScenes's maps begin at (0, 0)."""
    places = [
        np.array(episode.sensor_poses()["location"].to_pylist()).reshape(-1, 3)
        for episode in episodes
    ]
    x, y, _ = np.concatenate(places).T
    east, north = x, -y
    shift = tuple(
        float(math.ceil((_MARGIN_M - values.min()) / _STEP_M) * _STEP_M) for values in (east, north)
    )
    sizes = [
        values.max() + offset + _MARGIN_M
        for values, offset in zip((east, north), shift, strict=True)
    ]
    if max(sizes) > _MOST_MASK_M:
        raise BadInputError(
            f"The episodes on {episodes[0].document['map']} spread over {max(sizes):.0f} m; the "
            f"devkit draws maps of at most {_MOST_MASK_M:.0f} m.",
            "Export fewer episodes of that map at once.",
        )
    width, height = (math.ceil(size / METRES_PER_PX) for size in sizes)
    towns = (episode.vector_map() for episode in episodes if episode.id not in lost_maps)
    return Ground(
        location,
        mask_token,
        (shift[0], shift[1]),
        (width, height),
        SurfaceMap(*sizes),
        next((town for town in towns if town is not None), None),
    )
