"""SQL over the tables of all episodes of a dataset, by DuckDB (extra ``sql``)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import pyarrow as pa

from carstage.errors import BadInputError, DatasetError
from carstage.storage.names import AGENTS, agent_folder
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
AGENT_TABLES = {f"agent_{name}": name for name in TABLES}
"""Names of the same tables of agents beside the ego, of all agents together."""

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
        agents: names of the agents beside the ego, whose tables lie below the folder.
    """

    folder: Any
    version: str | None
    agents: tuple[str, ...] = ()

    def paths(self, name: str) -> list[Any]:
        """The files of a table: one, or of an agents' table one for each agent."""
        if name in TABLES:
            return [self.folder / TABLES[name]]
        file = TABLES[AGENT_TABLES[name]]
        return [self.folder / agent_folder(agent) / file for agent in self.agents]


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

    Each table has the rows of all episodes, and the column ``episode_id``. The tables of agents,
    such as ``agent_objects``, have the column ``agent``, too. DuckDB reads of the files what the
    query needs: tables and columns that it names, files of the episodes that a condition on
    ``episode_id`` leaves, and of those the row groups that its other conditions leave.

    Args:
        episodes: committed ones, one at least.
        query: DuckDB's SQL; tables are those of ``TABLES`` and ``AGENT_TABLES``.
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
    named = named_tables(query)
    paths = {name: [path for one in episodes for path in one.paths(name)] for name in named}
    for name in named:
        if not paths[name]:
            raise BadInputError(
                f"No episode has agents, so there is no table {name}.",
                f"Ask {AGENT_TABLES[name]}, or record a fleet: docs/how-to/record-a-fleet.md.",
            )
    if files is None and isinstance(episodes[0].folder, RemotePath):
        files = _RemoteRanges(episodes[0].folder)
    with duckdb.connect() as connection:
        meter = _open_files(connection, files)
        before = meter.bytes_read()
        try:
            for name in named:
                rows = _rows_of(name, paths[name], episodes, meter.prefix)
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
                f"DuckDB refuses the query: {error}",
                f"Tables: {', '.join(TABLES)}; of agents the same with agent_ before them.",
            ) from error
        after = meter.bytes_read()
    read = None if before is None or after is None else after - before
    return Answer(table, read, sum(len(files_of) for files_of in paths.values()))


def named_tables(query: str) -> list[str]:
    """The tables that a query names, agents' ones too."""
    return [
        name for name in (*TABLES, *AGENT_TABLES) if re.search(rf"\b{name}\b", query, re.IGNORECASE)
    ]


def _rows_of(
    name: str, paths: Iterable[Any], episodes: Iterable[EpisodeTables], prefix: str
) -> str:
    """The rows of one table in all episodes.

    The id is always taken from the file's name, so that DuckDB knows it without opening the file.
    """
    kind = AGENT_TABLES.get(name, name)
    quoted = ["'" + f"{prefix}{path}".replace("'", "''") + "'" for path in paths]
    # Tables of one version have the same columns. Comparing them opens every file.
    by_name = len({episode.version for episode in episodes}) > 1 or kind in _RIG_COLUMNS
    # Else folders that are called such as `class=car` would take the place of columns.
    options = f"filename = true, hive_partitioning = false, union_by_name = {by_name}"
    source = f"read_parquet([{', '.join(quoted)}], {options})"
    place = rf"episodes/([^/]+)/[^/]+/(?:{AGENTS}/([^/]+)/)?[^/]+$"
    columns = [f"regexp_extract(filename, '{place}', 1) AS episode_id"]
    if name in AGENT_TABLES:
        columns.append(f"regexp_extract(filename, '{place}', 2) AS agent")
    own = ", episode_id" if kind in _OWN_EPISODE_ID else ""
    return f"SELECT {', '.join(columns)}, * EXCLUDE (filename{own}) FROM {source}"


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
