"""Writes datasets into a catalog: one episode as it is committed, or all from their markers."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sqlalchemy import BigInteger, bindparam, delete, select
from sqlalchemy.dialects import postgresql, sqlite

from carstage.catalog.address import location_of
from carstage.catalog.schema import (
    ARTIFACTS,
    ATTEMPTS,
    DATASETS,
    EPISODES,
    LABEL_SUMMARIES,
    RUNS,
    SENSORS,
    SPLITS,
)
from carstage.catalog.summaries import EpisodeRows, Row, hash_of_marker, rows_of
from carstage.dataset import Dataset, Episode
from carstage.errors import DatasetError
from carstage.files.bounded import LARGEST_DOCUMENT_BYTES, open_regular, read_bounded
from carstage.storage import open_store
from carstage.storage.marker import read_marker

if TYPE_CHECKING:
    from sqlalchemy import Table
    from sqlalchemy.engine import Connection

    from carstage.catalog.database import Catalog

_BATCH = 64
"""Episodes of one transaction: others write between them."""
_DELETED_AT_ONCE = 500
Progress = Callable[[int, int], object]


@dataclass(slots=True)
class IndexSummary:
    """What :func:`rebuild` did.

    Attributes:
        episodes: that the dataset has.
        written: of them, those that were read and written.
        removed: episodes that the catalog had and the dataset has no more.
        problems: by episode, why it is not in the catalog.
    """

    episodes: int = 0
    written: int = 0
    removed: int = 0
    problems: dict[str, str] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """For ``--json``."""
        return {
            "episodes": self.episodes,
            "written": self.written,
            "removed": self.removed,
            "problems": self.problems,
        }


def rebuild(
    catalog: Catalog,
    dataset: Dataset,
    *,
    update: bool = False,
    progress: Progress = lambda done, total: None,
) -> IndexSummary:
    """Make the catalog say of a dataset what its markers and files say.

    Runs may commit and record episodes meanwhile: what they write stays.

    Args:
        catalog: is written.
        dataset: is read.
        update: leave episodes as they are whose marker is the one that the catalog knows.
        progress: called with the number of episodes that are done, and of all.

    Raises:
        CatalogLostError: the connection broke; what was written before stays.
        CatalogError: the database refuses something.
        DatasetError: the dataset or one of its markers cannot be read.
    """
    location = location_of(dataset.path, catalog.address)
    with catalog.writing() as connection:
        key = _dataset_key(connection, dataset, location)
        known = _known_episodes(connection, key)
    summary = IndexSummary(episodes=len(dataset.episodes))
    commits = _committed_by(dataset)
    changed = [
        episode
        for episode in dataset.episodes
        if not update or known.get(episode.id) != hash_of_marker(episode.marker)
    ]
    done = summary.episodes - len(changed)
    for batch in _batches(changed):
        read = list(_read(batch, summary))
        with catalog.writing() as connection:
            for rows in read:
                run_id = commits.get((rows.episode["episode_id"], rows.episode["attempt"]))
                _write_episode(connection, key, dataset, rows, run_id)
        summary.written += len(read)
        done += len(batch)
        progress(done, summary.episodes)
    gone = known.keys() - {episode.id for episode in dataset.episodes}
    summary.removed = len(gone)
    with catalog.writing() as connection:
        _delete_episodes(connection, key, sorted(gone))
        _write_splits(connection, key, dataset)
        if isinstance(dataset.path, Path):  # else their folders are on the machines of the runs
            _replace(connection, RUNS, key, _runs(dataset))
        _replace(connection, ATTEMPTS, key, _attempts(dataset))
    catalog.optimise()
    return summary


def record_episode(
    catalog: Catalog, dataset: Dataset, episode: Episode, run_id: str | None = None
) -> None:
    """Write one committed episode, whether the catalog has it or not.

    Args:
        catalog: is written, in one transaction.
        dataset: the episode's.
        episode: is read.
        run_id: name of the run that has committed it.

    Raises:
        CatalogLostError: the connection broke; nothing was written.
        CatalogError: the database refuses something.
        DatasetError: the episode cannot be read.
    """
    rows = _rows_of(episode)
    with catalog.writing() as connection:
        key = _dataset_key(connection, dataset, location_of(dataset.path, catalog.address))
        _write_episode(connection, key, dataset, rows, run_id)
        row = {"dataset": key, "episode_id": episode.id, "attempt": episode.marker.attempt}
        _upsert(connection, ATTEMPTS, {**row, "state": "committed"}, tuple(row))


def record_run(catalog: Catalog, dataset: Dataset, run: Mapping[str, Any]) -> None:
    """Write what is known of a run.

    Args:
        catalog: is written.
        dataset: the run's.
        run: a row of ``runs`` without ``dataset``; ``run_id`` at least.

    Raises:
        CatalogLostError: the connection broke; nothing was written.
        CatalogError: the database refuses something.
    """
    with catalog.writing() as connection:
        key = _dataset_key(connection, dataset, location_of(dataset.path, catalog.address))
        _upsert(connection, RUNS, {**run, "dataset": key}, ("dataset", "run_id"))


def _read(batch: Sequence[Episode], summary: IndexSummary) -> Iterator[EpisodeRows]:
    """The rows of episodes; those that cannot be read become problems."""
    for episode in batch:
        try:
            yield _rows_of(episode)
        except DatasetError as error:
            summary.problems[episode.id] = error.message


def _rows_of(episode: Episode) -> EpisodeRows:
    """The rows of an episode, which the database can hold.

    Raises:
        DatasetError: the episode cannot be read, or has a value of another kind.
    """
    rows = rows_of(episode)
    parts = (
        (EPISODES, (rows.episode,)),
        (SENSORS, rows.sensors),
        (ARTIFACTS, rows.artifacts),
        (LABEL_SUMMARIES, rows.label_summaries),
    )
    for table, of_table in parts:
        for row in of_table:
            for name, value in row.items():
                if not _fits(table, name, value):
                    raise DatasetError(f"Its {name} cannot be {value!r:.40} ({table.name}).")
    return rows


def _fits(table: Table, name: str, value: Any) -> bool:
    """Whether a value, which may come from elsewhere, can stand in a column."""
    column = table.c[name]
    if value is None:
        return bool(column.nullable)
    if isinstance(value, str):
        if column.type.python_type is not str or "\0" in value:
            return False
        return value.isascii() or not any("\ud800" <= letter <= "\udfff" for letter in value)
    if type(value) is int and column.type.python_type is int:
        bits = 63 if isinstance(column.type, BigInteger) else 31
        return -(1 << bits) <= value < 1 << bits
    return type(value) is column.type.python_type


def _batches(episodes: Sequence[Episode]) -> Iterator[list[Episode]]:
    left = iter(episodes)
    while batch := list(islice(left, _BATCH)):
        yield batch


def _dataset_key(connection: Connection, dataset: Dataset, location: str) -> int:
    """The dataset's row, which is made if it is missing."""
    row = {
        "location": location,
        "name": dataset.name,
        "created_by": str(dataset.description.get("created_by", "")),
    }
    return int(_upsert(connection, DATASETS, row, ("location",)))


def _known_episodes(connection: Connection, key: int) -> dict[str, str]:
    """Hash of the marker by episode, as the catalog has it."""
    query = select(EPISODES.c.episode_id, EPISODES.c.marker_hash).where(EPISODES.c.dataset == key)
    return {row.episode_id: row.marker_hash for row in connection.execute(query)}


def _write_episode(
    connection: Connection, key: int, dataset: Dataset, rows: EpisodeRows, run_id: str | None
) -> None:
    """Replace an episode's rows. Of two who write it at once, the second waits for the first."""
    stored = dataset.stored_splits
    name = rows.episode["episode_id"]
    split = None if stored is None else stored.of(name, rows.episode["base_id"] or name)
    row = {**rows.episode, "dataset": key, "split": split}
    if run_id is not None:  # else what is known of it stays
        row["run_id"] = run_id
    episode = _upsert(connection, EPISODES, row, ("dataset", "episode_id"))
    parts = (
        (SENSORS, rows.sensors),
        (ARTIFACTS, rows.artifacts),
        (LABEL_SUMMARIES, rows.label_summaries),
    )
    for table, of_table in parts:
        connection.execute(delete(table).where(table.c.episode == episode))
        if of_table:
            connection.execute(table.insert(), [{**one, "episode": episode} for one in of_table])


def _upsert(connection: Connection, table: Table, row: Row, unique: Collection[str]) -> Any:
    """Insert a row or replace the one that has its key; returns the key of its table, if it has."""
    made = postgresql.insert if connection.dialect.name == "postgresql" else sqlite.insert
    statement = made(table).values(row)
    others = {name: statement.excluded[name] for name in row if name not in unique}
    changed = statement.on_conflict_do_update(index_elements=list(unique), set_=others)
    if "id" not in table.c:
        connection.execute(changed)
        return None
    return connection.execute(changed.returning(table.c.id)).scalar_one()


def _delete_episodes(connection: Connection, key: int, names: Sequence[str]) -> None:
    statement = delete(EPISODES).where(
        EPISODES.c.dataset == key,
        EPISODES.c.episode_id.in_(bindparam("names", expanding=True)),
    )
    for begin in range(0, len(names), _DELETED_AT_ONCE):
        connection.execute(statement, {"names": names[begin : begin + _DELETED_AT_ONCE]})


def _replace(connection: Connection, table: Table, key: int, rows: Sequence[Row]) -> None:
    """Make these the rows that a table has of a dataset."""
    connection.execute(delete(table).where(table.c.dataset == key))
    if rows:
        connection.execute(table.insert(), [{**row, "dataset": key} for row in rows])


def _write_splits(connection: Connection, key: int, dataset: Dataset) -> None:
    """The stored splits, and the split of every episode."""
    stored, rows = dataset.stored_splits, list[Row]()
    wanted = _splits_of(dataset)
    if stored is not None:
        rule, drawn = stored.rule, list(wanted.values())
        shares = {"train": 1.0 - rule.val - rule.test, "val": rule.val, "test": rule.test}
        for name in rule.wanted:
            counts = {"share": round(shares[name], 9), "episodes": drawn.count(name)}
            rows.append({"name": name, "seed": rule.seed, **counts})
    _replace(connection, SPLITS, key, rows)
    query = select(EPISODES.c.id, EPISODES.c.episode_id, EPISODES.c.split)
    found = connection.execute(query.where(EPISODES.c.dataset == key)).all()
    moved = [
        {"row": row.id, "drawn": wanted[row.episode_id]}
        for row in found
        if row.episode_id in wanted and row.split != wanted[row.episode_id]
    ]
    if moved:
        update = EPISODES.update().where(EPISODES.c.id == bindparam("row"))
        connection.execute(update.values(split=bindparam("drawn")), moved)


def _splits_of(dataset: Dataset) -> dict[str, str | None]:
    """The split of each episode, None without stored splits; those that cannot be read lack."""
    stored, found = dataset.stored_splits, dict[str, str | None]()
    for episode in dataset.episodes:
        if stored is None:
            found[episode.id] = None
            continue
        with suppress(DatasetError):  # what is in the catalog of it stays
            drawn = stored.episodes.get(episode.id)
            found[episode.id] = drawn or stored.of(episode.id, episode.base_id)
    return found


def _attempts(dataset: Dataset) -> list[Row]:
    """Every attempt that has files: the episode itself, overtaken by it, or open."""
    committed = {episode.id: episode.marker.attempt for episode in dataset.episodes}
    store, rows = open_store(dataset.path), []
    for episode_id, attempt in store.attempts():
        if episode_id not in committed and store.has(episode_id):  # since the markers were read
            marker = read_marker(dataset.path / "commits" / f"{episode_id}.json")
            committed[episode_id] = marker.attempt
        winner = committed.get(episode_id)
        state = "open" if winner is None else "committed" if winner == attempt else "overtaken"
        rows.append({"episode_id": episode_id, "attempt": attempt, "state": state})
    return rows


def _run_folders(dataset: Dataset) -> list[Path]:
    """Folders of the runs; those of a dataset in a store are elsewhere."""
    path = dataset.path
    return sorted((path / "runs").glob("*")) if isinstance(path, Path) else []


def _runs(dataset: Dataset) -> list[Row]:
    rows = []
    for folder in _run_folders(dataset):
        plan, status = (_document(folder / name) for name in ("plan.json", "status.json"))
        if (plan or status) and _fits(RUNS, "run_id", folder.name):
            row = {"run_id": folder.name, **run_row(plan, status)}
            rows.append({key: row[key] if _fits(RUNS, key, row[key]) else None for key in row})
    return rows


def run_row(plan: Mapping[str, Any], status: Mapping[str, Any]) -> Row:
    """What ``plan.json`` and ``status.json`` say of a run, without its name."""
    counts = status.get("episodes") if isinstance(status.get("episodes"), dict) else {}
    config = plan.get("config") if isinstance(plan.get("config"), dict) else {}
    return {
        "name": (config or {}).get("name"),
        "state": status.get("state"),
        "shard": plan.get("shard"),
        **{name: (counts or {}).get(name) for name in ("total", "committed", "failed", "skipped")},
    }


def _document(path: Path) -> dict[str, Any]:
    """The JSON object of a run's file; empty where there is none that can be read."""
    try:
        found = json.loads(read_bounded(path, LARGEST_DOCUMENT_BYTES))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _committed_by(dataset: Dataset) -> dict[tuple[str, str], str]:
    """Which run has committed an attempt, by the events of the runs that are still there."""
    found = {}
    for folder in _run_folders(dataset):
        with suppress(OSError), os.fdopen(open_regular(folder / "events.jsonl"), "rb") as lines:
            for line in lines:
                if b'"episode_committed"' in line:
                    with suppress(ValueError, KeyError, TypeError):  # of a full disk: torn
                        event = json.loads(line)
                        found[str(event["episode_id"]), str(event["attempt"])] = folder.name
    return found
