"""The towns of a dataset: files that episodes name by their hashes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import pyarrow as pa

from carstage.dataset.tables import table_of
from carstage.errors import DatasetError
from carstage.files.bounded import read_bounded
from carstage.files.hashing import hash_of
from carstage.geometry import FloatArray
from carstage.storage.maps import MapKind, map_name
from carstage.storage.remote_path import DatasetPath
from carstage.vector_map import VectorMap, from_table
from carstage.vector_map.wkb import from_wkb

_NAMED_BY: Mapping[MapKind, str] = {"xodr": "opendrive", "parquet": "vector_map"}
"""The key of ``episode.json`` that holds the hash."""


def map_path(folder: DatasetPath, document: Mapping[str, Any], kind: MapKind) -> DatasetPath | None:
    """Where a map of an episode is; None where it was not recorded.

    Args:
        folder: the episode's.
        document: its ``episode.json``.
        kind: which map.

    Raises:
        DatasetError: ``episode.json`` is damaged.
    """
    named = document.get(_NAMED_BY[kind])  # episodes of earlier versions have no such key
    if named is None:
        return None
    try:
        return folder.parents[2] / map_name(named, kind)
    except (TypeError, ValueError) as error:
        raise DatasetError(f"{folder / 'episode.json'} is damaged: {error}.") from error


def read_map(folder: DatasetPath, document: Mapping[str, Any], kind: MapKind) -> bytes | None:
    """A map as it was committed; None where it was not recorded.

    Raises:
        DatasetError: ``episode.json`` is damaged, or the file is missing or damaged.
    """
    path = map_path(folder, document, kind)
    if path is None:
        return None
    try:
        content = read_bounded(path)
    except OSError as error:
        raise DatasetError(
            f"The map of episode {document.get('episode_id')} cannot be read: {error}.",
            f"Put the dataset's {path.parent.name}/{path.name} back.",
        ) from error
    if hash_of(content) != document[_NAMED_BY[kind]]:
        raise DatasetError(f"{path} is damaged: its hash is not in its name.")
    return content


def read_vector_map(folder: DatasetPath, document: Mapping[str, Any]) -> VectorMap | None:
    """The vector map of an episode's town; None where there is none.

    Raises:
        DatasetError: as of :func:`read_map`, or the file holds no vector map.
    """
    table = vector_map_table(folder, document)
    try:
        return None if table is None else from_table(table)
    except ValueError as error:
        path = map_path(folder, document, "parquet")
        raise DatasetError(f"{path} is damaged: {error}.") from error


def vector_map_table(folder: DatasetPath, document: Mapping[str, Any]) -> pa.Table | None:
    """The same as the table that it is stored as.

    Raises:
        DatasetError: as of :func:`read_map`, or the file holds no table.
    """
    content = read_map(folder, document, "parquet")
    if content is None:
        return None
    try:
        return table_of(content)
    except (OSError, pa.ArrowException) as error:
        path = map_path(folder, document, "parquet")
        raise DatasetError(f"{path} is damaged: {error}.") from error


def vector_map_outlines(
    folder: DatasetPath, document: Mapping[str, Any]
) -> Iterator[tuple[str, FloatArray, FloatArray]]:
    """Of each feature of a stored map: what it is, its places on the globe and in the world.

    Raises:
        DatasetError: as of :func:`vector_map_table`, or one of the two is not to be read.
    """
    table = vector_map_table(folder, document)
    if table is None:
        return
    for row in table.select(["kind", "id", "geometry", "world"]).to_pylist():
        if row["world"] is None and row["geometry"] is None:
            continue
        try:
            yield (
                f"{row['kind']} {row['id']}",
                from_wkb(row["geometry"])[1],
                from_wkb(row["world"])[1],
            )
        except (TypeError, ValueError) as error:
            raise DatasetError(f"{row['kind']} {row['id']} of the vector map: {error}.") from error
