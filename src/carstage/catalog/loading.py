"""Label tables of a dataset, copied into PostgreSQL by ADBC where somebody asks for them."""

from __future__ import annotations

from collections.abc import Callable, Collection
from contextlib import closing
from typing import TYPE_CHECKING, Any, Final

import pyarrow as pa

from carstage.catalog.address import location_of
from carstage.dataset import Dataset, Episode
from carstage.errors import BadInputError, CatalogError

if TYPE_CHECKING:
    from carstage.catalog.database import Catalog

LOADED: Final[dict[str, Callable[[Episode], pa.Table]]] = {
    "loaded_objects": Episode.objects,
    "loaded_camera_objects": Episode.camera_objects,
    "loaded_ego": Episode.ego,
}
"""Tables of PostgreSQL, and what of an episode they hold."""

_SIGNED: Final = {
    pa.uint8(): pa.int16(),
    pa.uint16(): pa.int32(),
    pa.uint32(): pa.int64(),
    pa.uint64(): pa.int64(),
}
"""PostgreSQL has no unsigned numbers; light states and counts fit into these."""


def load_labels(
    catalog: Catalog,
    dataset: Dataset,
    *,
    progress: Callable[[int, int], object] = lambda done, total: None,
) -> int:
    """Copy the label tables of all episodes into the catalog's database.

    What it has of the dataset is replaced, episode by episode, each in one transaction. The columns
    are those of the files, and ``dataset`` (its location) and ``episode_id``. Lists become arrays,
    nested lists and maps become JSON texts.

    Args:
        catalog: in PostgreSQL.
        dataset: is read.
        progress: called with the number of episodes that are done, and of all.

    Returns:
        The number of rows.

    Raises:
        BadInputError: the catalog is not in PostgreSQL, or a package is not installed.
        CatalogError: the database refuses something.
        DatasetError: a table is missing or damaged.
    """
    if catalog.address.kind != "postgresql":
        raise BadInputError(
            f"Label tables are not loaded into SQLite ({catalog.address.shown}).",
            "Ask their files: carstage catalog query DATASET SQL. Or use PostgreSQL.",
        )
    try:
        from adbc_driver_postgresql import dbapi
    except ImportError as error:
        raise BadInputError(
            "Loading label tables needs a package that is not installed.",
            "Install it: pip install 'carstage[postgres]'.",
        ) from error
    location = location_of(dataset.path, catalog.address)
    uri = catalog.address.url.replace("postgresql+psycopg://", "postgresql://", 1)
    rows = 0
    try:
        with closing(dbapi.connect(uri)) as connection, closing(connection.cursor()) as cursor:
            for done, episode in enumerate(dataset.episodes, 1):
                for name, read in LOADED.items():
                    table = _as_postgres_has_it(read(episode), location, episode.id)
                    _replace(cursor, name, table, location, episode.id)
                    rows += table.num_rows
                connection.commit()
                progress(done, len(dataset.episodes))
            for name in LOADED:
                _drop_others(cursor, name, location, {one.id for one in dataset.episodes})
            connection.commit()
    except dbapi.Error as error:
        words = " ".join(str(error).split())
        raise CatalogError(
            f"Loading into {catalog.address.shown} failed: "
            f"{catalog.address.without_secrets(words)}",
            "Where another version has loaded them, drop the tables loaded_objects, "
            "loaded_camera_objects and loaded_ego.",
        ) from error
    return rows


def _replace(cursor: Any, name: str, table: pa.Table, location: str, episode_id: str) -> None:
    """Exchange the rows of one episode; the table is made where it is missing."""
    if _is_there(cursor, name):
        _delete(cursor, name, location, episode_id)
        cursor.adbc_ingest(name, table, mode="append")
        return
    cursor.adbc_ingest(name, table, mode="create")
    cursor.execute(f"CREATE INDEX ON {name} (episode_id, dataset)")


def _drop_others(cursor: Any, name: str, location: str, kept: Collection[str]) -> None:
    """Drop the rows of episodes that a dataset has no more."""
    if not _is_there(cursor, name):  # of a dataset without episodes
        return
    cursor.execute(f"SELECT DISTINCT episode_id FROM {name} WHERE dataset = $1", (location,))
    for (episode_id,) in cursor.fetchall():
        if episode_id not in kept:
            _delete(cursor, name, location, episode_id)


def _is_there(cursor: Any, name: str) -> bool:
    cursor.execute("SELECT to_regclass($1)::text", (name,))
    return cursor.fetchone()[0] is not None


def _delete(cursor: Any, name: str, location: str, episode_id: str) -> None:
    cursor.execute(
        f"DELETE FROM {name} WHERE dataset = $1 AND episode_id = $2", (location, episode_id)
    )


def _as_postgres_has_it(table: pa.Table, location: str, episode_id: str) -> pa.Table:
    """A label table in types that ADBC can write."""
    if "episode_id" in table.column_names:
        table = table.drop_columns(["episode_id"])
    columns, names = [], []
    for name, value in (("dataset", location), ("episode_id", episode_id)):
        columns.append(pa.chunked_array([pa.array([value] * table.num_rows, pa.string())]))
        names.append(name)
    for name in table.column_names:
        columns.append(_column(table[name]))
        names.append(name)
    return pa.table(columns, names=names)


def _column(column: pa.ChunkedArray[Any]) -> pa.ChunkedArray[Any]:
    import json

    kind = column.type
    if kind in _SIGNED:
        return column.cast(_SIGNED[kind])
    if pa.types.is_map(kind) or (_is_list(kind) and _is_list(kind.value_type)):
        # A map comes as pairs.
        texts = [
            None if value is None else json.dumps(dict(value) if pa.types.is_map(kind) else value)
            for value in column.to_pylist()
        ]
        return pa.chunked_array([pa.array(texts, pa.string())])
    if _is_list(kind):
        element = _SIGNED.get(kind.value_type, kind.value_type)
        return pa.chunked_array([pa.array(column.to_pylist(), pa.list_(element))])
    return column


def _is_list(kind: pa.DataType) -> bool:
    return bool(
        pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind) or pa.types.is_large_list(kind)
    )
