"""SQL over the tables of all episodes of a dataset, by DuckDB (extra ``sql``)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import pyarrow as pa

from carstage.errors import BadInputError, DatasetError
from carstage.storage.remote_path import RemotePath

if TYPE_CHECKING:
    from duckdb import DuckDBPyConnection

TABLES = {
    "objects": "objects.parquet",
    "camera_objects": "camera_objects.parquet",
    "ego": "ego.parquet",
    "sensor_poses": "sensor_poses.parquet",
    "frames": "frames.parquet",
}
"""Names in queries, with the file of each episode that they stand for."""

_OWN_EPISODE_ID = frozenset({"objects", "ego"})
"""Tables whose files have the column already."""
_RIG_COLUMNS = frozenset({"frames"})
"""Tables whose columns are named after the sensors of the rig."""
_IO = Path("/proc/self/io")


class RangeFiles(Protocol):
    """Files that are not on this machine, read in parts."""

    def size(self, path: str) -> int:
        """Size of a file in bytes.

        Raises:
            OSError: there is none, or it cannot be reached.
        """

    def read(self, path: str, start: int, end: int) -> bytes:
        """The bytes of a file from ``start`` to before ``end``.

        Raises:
            OSError: they cannot be read.
        """


@dataclass(frozen=True, slots=True)
class EpisodeTables:
    """Where the tables of an episode are.

    Attributes:
        folder: the episode's; a path, or what stands for one in a store.
        version: of the Car-STAGE that wrote them; None: unknown.
    """

    folder: Any
    version: str | None


@dataclass(frozen=True, slots=True)
class Answer:
    """What a query found.

    Attributes:
        table: its rows.
        bytes_read: bytes of files that were read for it; None where the system does not tell.
        files: how many files the tables of the query have; with a condition on ``episode_id`` not
            all of them are opened.
    """

    table: pa.Table
    bytes_read: int | None
    files: int


def query_episodes(
    episodes: Sequence[EpisodeTables], query: str, *, files: RangeFiles | None = None
) -> Answer:
    """The answer to a query over the tables of episodes.

    Each table has the rows of all episodes, and the column ``episode_id``. DuckDB reads of the
    files what the query needs: tables and columns that it names, files of the episodes that a
    condition on ``episode_id`` leaves, and of those the row groups that its other conditions leave.

    Args:
        episodes: committed ones, one at least.
        query: DuckDB's SQL; tables are those of ``TABLES``.
        files: reads the episodes' files; None: they are on this machine, or in the object store
            that their paths name.

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
    if not episodes:
        raise BadInputError("The dataset has no episode to query.", "Record one: carstage run.")
    named = [name for name in TABLES if re.search(rf"\b{name}\b", query, re.IGNORECASE)]
    if files is None and isinstance(episodes[0].folder, RemotePath):
        files = _RemoteRanges(episodes[0].folder)
    with duckdb.connect() as connection:
        meter = _open_files(connection, files)
        before = meter.bytes_read()
        try:
            for name in named:
                rows = _rows_of(name, episodes, meter.prefix)
                connection.execute(f"CREATE VIEW {name} AS {rows}")
        except duckdb.Error as error:
            raise DatasetError(f"A table of the dataset cannot be read: {error}") from error
        try:
            relation = connection.sql(query)
            if relation is None:
                raise BadInputError("The statement has no result.", "Write a SELECT.")
            table: pa.Table = relation.to_arrow_table()
        except duckdb.Error as error:
            # The base class itself: of an error that reading a file elsewhere has raised.
            kinds = (duckdb.IOException, duckdb.InvalidInputException)
            broken = isinstance(error, kinds) or type(error) is duckdb.Error
            if broken and ".parquet" in str(error):
                raise DatasetError(f"A table of the dataset cannot be read: {error}") from error
            raise BadInputError(
                f"DuckDB refuses the query: {error}", f"Tables: {', '.join(TABLES)}."
            ) from error
        after = meter.bytes_read()
    read = None if before is None or after is None else after - before
    return Answer(table, read, len(named) * len(episodes))


def _rows_of(name: str, episodes: Iterable[EpisodeTables], prefix: str) -> str:
    """The rows of one table in all episodes.

    The id is always taken from the file's name, so that DuckDB knows it without opening the file.
    """
    paths, versions = [], set()
    for episode in episodes:
        versions.add(episode.version)
        path = f"{prefix}{episode.folder / TABLES[name]}"
        paths.append("'" + path.replace("'", "''") + "'")
    # Tables of one version have the same columns. Comparing them opens every file.
    by_name = len(versions) > 1 or name in _RIG_COLUMNS
    source = f"read_parquet([{', '.join(paths)}], filename = true, union_by_name = {by_name})"
    episode_id = "regexp_extract(filename, 'episodes/([^/]+)/[^/]+/[^/]+$', 1)"
    own = ", episode_id" if name in _OWN_EPISODE_ID else ""
    return f"SELECT {episode_id} AS episode_id, * EXCLUDE (filename{own}) FROM {source}"


class _RemoteRanges:
    """Files of a dataset in an object store.

    Args:
        place: any in the dataset.
    """

    def __init__(self, place: RemotePath) -> None:
        from carstage.storage.remote_files import remote_files

        self._root = place.root
        self._files = remote_files(place.root)

    def size(self, path: str) -> int:
        return self._files.stat(self._key(path)).st_size

    def read(self, path: str, start: int, end: int) -> bytes:
        return self._files.read_range(self._key(path), start, end)

    def _key(self, path: str) -> str:
        return path.removeprefix(f"{self._root}/")


class _LocalMeter:
    """Files on this machine, which DuckDB reads itself."""

    prefix = ""

    def bytes_read(self) -> int | None:
        """What this process has read so far, by the system's count (proc(5), ``rchar``)."""
        try:
            return int(_IO.read_text("ascii").split()[1])
        except (OSError, IndexError, ValueError):
            return None


def _open_files(connection: DuckDBPyConnection, files: RangeFiles | None) -> Any:
    """Let DuckDB read the files; what counts the bytes."""
    if files is None:
        return _LocalMeter()
    from carstage.dataset.range_files import open_range_files

    found = open_range_files(files)
    connection.register_filesystem(found)
    return found
