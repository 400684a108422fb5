"""SQL over the tables of all episodes of a dataset, by DuckDB (extra ``sql``)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa

from carstage.errors import BadInputError, DatasetError

TABLES = {
    "objects": "objects.parquet",
    "camera_objects": "camera_objects.parquet",
    "ego": "ego.parquet",
    "sensor_poses": "sensor_poses.parquet",
    "frames": "frames.parquet",
}
"""Names in queries, with the file of each episode that they stand for."""


def query_episodes(folders: Sequence[Path], query: str) -> pa.Table:
    """The result of a query over the tables of episodes.

    Each table has the rows of all episodes, and the column ``episode_id`` where its file has none.
    DuckDB reads of the files what the query needs.

    Args:
        folders: of committed episodes, one at least.
        query: DuckDB's SQL; tables are those of ``TABLES``.

    Raises:
        BadInputError: DuckDB is not installed, or refuses the query.
        DatasetError: a table is missing or damaged.
    """
    try:
        import duckdb
    except ImportError as error:
        raise BadInputError(
            "SQL needs a package that is not installed.",
            "Install it: pip install 'carstage[sql]'.",
        ) from error
    if not folders:
        raise BadInputError("The dataset has no episode to query.", "Record one: carstage run.")
    with duckdb.connect() as connection:
        try:
            for name, file in TABLES.items():
                paths = [str(folder / file) for folder in folders]
                connection.execute(f"CREATE VIEW {name} AS {_rows_of(name, paths)}")
        except (duckdb.IOException, duckdb.InvalidInputException) as error:
            raise DatasetError(f"A table of the dataset cannot be read: {error}") from error
        try:
            relation = connection.sql(query)
            if relation is None:
                raise BadInputError("The statement has no result.", "Write a SELECT.")
            table: pa.Table = relation.to_arrow_table()
        except duckdb.Error as error:
            raise BadInputError(
                f"DuckDB refuses the query: {error}", f"Tables: {', '.join(TABLES)}."
            ) from error
    return table


def _rows_of(name: str, paths: Sequence[str]) -> str:
    """The rows of one table in all episodes."""
    files = ", ".join("'" + path.replace("'", "''") + "'" for path in paths)
    # Ledgers of other rigs have other columns.
    source = f"read_parquet([{files}], filename = true, union_by_name = true)"
    if name in ("objects", "ego"):
        return f"SELECT * EXCLUDE (filename) FROM {source}"
    episode = "regexp_extract(filename, 'episodes/([^/]+)/[^/]+/[^/]+$', 1)"
    return f"SELECT {episode} AS episode_id, * EXCLUDE (filename) FROM {source}"
