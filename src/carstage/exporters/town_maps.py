"""The vector maps of a dataset's towns in formats for maps: GeoJSON and Lanelet2."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from carstage import __version__
from carstage.dataset import Dataset, Episode
from carstage.errors import BadInputError, DatasetError
from carstage.exporters.lanelet2 import to_lanelet2
from carstage.exporters.target import check_target, export_folder, write_document
from carstage.storage import DatasetPath
from carstage.vector_map import to_geojson


@dataclass(frozen=True, slots=True)
class _MapFormat:
    suffix: str
    content: Callable[[Episode], bytes]


def _geojson(episode: Episode) -> bytes:
    table = episode.vector_map_table()
    assert table is not None
    try:
        return (json.dumps(to_geojson(table), separators=(",", ":")) + "\n").encode()
    except ValueError as error:
        raise DatasetError(f"{episode.vector_map_file} is damaged: {error}.") from error


def _lanelet2(episode: Episode) -> bytes:
    town = episode.vector_map()
    assert town is not None
    return to_lanelet2(town, episode.geo_frame)


MAP_FORMATS: Final = {
    "geojson": _MapFormat(".geojson", _geojson),
    "lanelet2": _MapFormat(".osm", _lanelet2),
}


def export_maps(
    format_name: str,
    dataset: str | DatasetPath,
    out: str | Path,
    *,
    maps: Iterable[str] = (),
    overwrite: bool = False,
) -> tuple[Path, ...]:
    """Write the vector map of each town of a dataset, in degrees of longitude and latitude.

    Args:
        format_name: one of ``MAP_FORMATS``.
        dataset: folder of the dataset, or its place in an object store.
        out: the folder to make; it is there when all is written.
        maps: names of towns; default: all.
        overwrite: replace an export that stands there.

    Returns:
        The files, one for each town: ``TOWN.geojson`` or ``TOWN.osm``.

    Raises:
        BadInputError: no such format or town, no episode has a vector map, or an unfit folder.
        DatasetError: the dataset or a map of it is damaged.
    """
    if format_name not in MAP_FORMATS:
        raise BadInputError(
            f"No format of maps {format_name!r}.", f"Formats: {', '.join(MAP_FORMATS)}."
        )
    source, target = Dataset(dataset), Path(out)
    check_target(target, source.path, overwrite=overwrite)
    towns = _towns(source, tuple(maps))
    made = MAP_FORMATS[format_name]
    with export_folder(target) as folder:
        for name, episode in towns.items():
            (folder / f"{name}{made.suffix}").write_bytes(made.content(episode))
        write_document(
            folder,
            {
                "format": format_name,
                "maps": sorted(towns),
                "created_by": f"carstage {__version__}",
                "dataset": source.name,
            },
        )
    return tuple(target / f"{name}{made.suffix}" for name in towns)


def _towns(dataset: Dataset, wanted: tuple[str, ...]) -> dict[str, Episode]:
    """An episode of each town by the name of its file; of towns with one name also its hash."""
    found: dict[tuple[str, str], Episode] = {}
    for episode in dataset.episodes:
        named = episode.document.get("vector_map")
        if named is not None:
            found.setdefault((Path(episode.document["map"]).name, named), episode)
    names = [name for name, _ in found]
    if not found:
        raise BadInputError(
            f"No episode of {dataset.path} has a vector map.",
            "Record one with labels.vector_map: true.",
        )
    for name in wanted:
        if name not in names:
            known = ", ".join(sorted(set(names)))
            raise BadInputError(f"map: the dataset has none of {name!r}.", f"It has {known}.")
    return {
        name if names.count(name) == 1 else f"{name}-{named.partition(':')[2][:8]}": episode
        for (name, named), episode in sorted(found.items())
        if not wanted or name in wanted
    }
