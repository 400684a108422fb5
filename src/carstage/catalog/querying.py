"""SQL over what a catalog knows, and over the label tables of the episodes that it finds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pyarrow as pa

from carstage.catalog.address import location_of
from carstage.catalog.filters import EVERYTHING, PageFilter
from carstage.catalog.listing import wanted_episodes
from carstage.dataset import Dataset
from carstage.dataset.querying import (
    AGENT_TABLES,
    Answer,
    EpisodeTables,
    RangeFiles,
    named_tables,
    query_episodes,
)
from carstage.errors import BadInputError

if TYPE_CHECKING:
    from carstage.catalog.database import Catalog


def query_labels(
    dataset: Dataset,
    query: str,
    *,
    catalog: Catalog | None = None,
    wanted: PageFilter = EVERYTHING,
    files: RangeFiles | None = None,
) -> Answer:
    """The answer to DuckDB's SQL over the label tables of a dataset's episodes.

    Args:
        dataset: its episodes' tables are read.
        query: see :func:`carstage.dataset.querying.query_episodes` for the names of tables.
        catalog: finds the episodes that ``wanted`` lets pass; files of others are not opened.
            None: all episodes that have markers.
        wanted: which episodes.
        files: reads the files of a dataset that is not on this machine.

    Raises:
        BadInputError: DuckDB is not installed or refuses the query, or no episode is wanted.
        CatalogError: the catalog cannot be read.
        DatasetError: a table is missing or damaged.
    """
    if catalog is None:
        return query_episodes([one.tables for one in dataset.episodes], query, files=files)
    # No marker is read: the dataset may have a million, and the catalog knows what is needed.
    found = wanted_episodes(catalog, location_of(dataset.path, catalog.address), wanted)
    if not found:
        raise BadInputError("No episode is like that.", "See: carstage catalog list DATASET.")
    if any(name in AGENT_TABLES for name in named_tables(query)):
        # Which agents there are stands in the markers.
        tables = [dataset.episode(name).tables for name, _, _ in found]
        return query_episodes(tables, query, files=files)
    folder = dataset.path / "episodes"
    tables = [EpisodeTables(folder / name / attempt, version) for name, attempt, version in found]
    return query_episodes(tables, query, files=files)


def query_catalog(catalog: Catalog, query: str) -> pa.Table:
    """The rows that the catalog's own database finds; it is only read.

    Args:
        catalog: is read; its tables are those of ``carstage.catalog.schema``.
        query: SQL of its database.

    Raises:
        BadInputError: the database refuses the query, or the statement would write.
        CatalogError: the catalog cannot be read.
    """
    from sqlalchemy import exc, text

    first = query.split(None, 1)[0].lower() if query.split() else ""
    if first not in ("select", "with", "values"):
        raise BadInputError("The statement is no question.", "Write a SELECT.")
    postgres = catalog.address.kind == "postgresql"
    with catalog.reading() as connection:
        read_only = "SET TRANSACTION READ ONLY" if postgres else "PRAGMA query_only = ON"
        connection.execute(text(read_only))
        try:
            # Without parameters, so that a `%` of the query is no place for one.
            options = {"no_parameters": True}
            found = connection.exec_driver_sql(query, execution_options=options)
            names = list(found.keys())
            rows: list[Any] = [tuple(row) for row in found]
        except (exc.ProgrammingError, exc.OperationalError, exc.InternalError) as error:
            if getattr(error, "connection_invalidated", False):
                raise
            words = str(error.orig).strip().splitlines()[0]
            raise BadInputError(
                f"The catalog refuses the query: {catalog.address.without_secrets(words)}",
                "Tables: datasets, runs, episodes, attempts, sensors, artifacts, splits, "
                "label_summaries.",
            ) from error
        finally:
            if not postgres and not connection.invalidated:
                connection.execute(text("PRAGMA query_only = OFF"))
    columns = zip(*rows, strict=True) if rows else ([] for _ in names)
    return pa.table([_column(list(column)) for column in columns], names=names)


def _column(values: list[Any]) -> pa.Array[Any]:
    """Values as Arrow has them, or as texts: an SQLite column may hold a number and a text."""
    try:
        column: pa.Array[Any] = pa.array(values)
    except (pa.ArrowException, OverflowError):
        column = pa.array([None if value is None else str(value) for value in values], pa.string())
    return column
