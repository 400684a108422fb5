"""A catalog's database: opened, brought to the schema of this version, read and written."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from sqlalchemy import URL, create_engine, event, exc, make_url

from carstage.catalog.address import CatalogAddress
from carstage.catalog.migrating import bring_up_to_date, check_schema
from carstage.errors import BadInputError, CatalogError, CatalogLostError

if TYPE_CHECKING:
    from sqlalchemy.engine import Connection, Engine

logger = logging.getLogger(__name__)

_CONNECT_S = 10
_BUSY_S = 30.0
_MOST_CHARACTERS = 300
_WRITES = "carstage_writes"
"""Option of a connection: its transaction will write."""


class Catalog:
    """An open catalog; a context manager that closes it.

    Args:
        address: of its database.
        create: make the database file or the tables where there are none, and bring older ones
            to the schema of this version.

    Raises:
        BadInputError: a package is not installed, or there is no catalog at a local address.
        CatalogError: it cannot be reached, refuses us, or is of a newer schema. Nothing was
            written then.
    """

    def __init__(self, address: CatalogAddress, *, create: bool = True) -> None:
        self.address = address
        self.engine = _engine(address, create=create)
        try:
            with self._translated():
                if create:
                    bring_up_to_date(self)
                else:
                    check_schema(self)
        except BaseException:
            self.engine.dispose()
            raise

    def __enter__(self) -> Catalog:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Give the connections back."""
        self.engine.dispose()

    def optimise(self) -> None:
        """Let the database look at its tables again, after many rows were written.

        Raises:
            CatalogError: the database refuses it.
        """
        with self.writing() as connection:
            if self.address.kind == "sqlite":  # a look at some rows of each index is enough
                connection.exec_driver_sql("PRAGMA analysis_limit = 1000")
            connection.exec_driver_sql("ANALYZE")

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """A transaction that reads.

        Raises:
            CatalogLostError: the connection broke.
            CatalogError: the database refuses something.
        """
        with self._translated(), self.engine.connect() as connection, connection.begin():
            yield connection

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """A transaction that is committed at the end of the block, or undone by an error.

        Raises:
            CatalogLostError: the connection broke, or another writer holds an SQLite file.
            CatalogError: the database refuses something.
        """
        with self._translated(), self.engine.connect() as connection:
            writer = connection.execution_options(**{_WRITES: True})
            with writer.begin():
                yield writer

    @contextmanager
    def _translated(self) -> Iterator[None]:
        """Errors of the database in our words, without what is secret."""
        try:
            yield
        except exc.OperationalError as error:
            raise self._lost(error) from error
        except exc.DBAPIError as error:
            kind = CatalogLostError if error.connection_invalidated else CatalogError
            raise kind(
                f"The catalog {self.address.shown} refuses: {self._words(error)}",
                "Check the address and the rights of its user.",
            ) from error

    def _lost(self, error: Any) -> CatalogError:
        words = self._words(error)
        # Errors of making a connection have no statement.
        refused = error.statement is None and not error.connection_invalidated
        if refused and any(sign in words for sign in _REFUSALS):
            return CatalogError(
                f"The catalog {self.address.shown} cannot be opened: {words}",
                "Check user, password (PGPASSWORD, ~/.pgpass) and the name of the database.",
            )
        if refused:
            return CatalogUnreachableError(
                f"The catalog {self.address.shown} cannot be reached: {words}",
                "Check host and port, or the file's folder, and that the server runs.",
            )
        return CatalogLostError(
            f"The catalog {self.address.shown} broke off: {words}", "Try again."
        )

    def _words(self, error: Any) -> str:
        """What the driver says, in one line."""
        text = " ".join(str(getattr(error, "orig", None) or type(error).__name__).split())
        text = text if len(text) <= _MOST_CHARACTERS else f"{text[:_MOST_CHARACTERS]} …"
        return self.address.without_secrets(text)


class CatalogUnreachableError(CatalogLostError):
    """No connection to a catalog was made; another try may succeed."""

    exit_code = 2


_REFUSALS = (
    "authentication failed",
    "no password supplied",
    "does not exist",
    "permission denied",
    "no pg_hba.conf entry",
    "unable to open database file",
    "is not a database",
)
"""Words of libpq and SQLite after which another try would end alike."""


def _engine(address: CatalogAddress, *, create: bool) -> Engine:
    if address.file is None:
        try:
            import psycopg
        except ImportError as error:
            raise BadInputError(
                "PostgreSQL needs a package that is not installed.",
                "Install it: pip install 'carstage[postgres]'.",
            ) from error
        del psycopg
        try:
            url = make_url(address.url)
        except (exc.ArgumentError, ValueError) as error:
            raise BadInputError(
                f"catalog: {address.shown} is no address of a database.",
                "Write postgresql://USER@HOST:PORT/DATABASE.",
            ) from error
        defaults = {"connect_timeout": _CONNECT_S, "application_name": "carstage"}
        options = {name: value for name, value in defaults.items() if name not in url.query}
        return create_engine(url, connect_args=options, pool_pre_ping=True, hide_parameters=True)
    file = address.file
    if create:
        file.parent.mkdir(parents=True, exist_ok=True)
    elif not file.is_file():
        raise BadInputError(
            f"There is no catalog at {file}.", "Make it: carstage catalog rebuild DATASET."
        )
    only_read = not create and not all(os.access(one, os.W_OK) for one in (file, file.parent))
    place = _only_read(file) if only_read else URL.create("sqlite", database=str(file))
    engine = create_engine(place, connect_args={"timeout": _BUSY_S})

    @event.listens_for(engine, "connect")
    def _prepare(connection: Any, record: Any) -> None:
        del record
        connection.isolation_level = None  # the driver begins no transactions of its own
        pragmas = ("journal_mode = WAL", "synchronous = NORMAL", "foreign_keys = ON")
        for pragma in () if only_read else pragmas:
            connection.execute(f"PRAGMA {pragma}")

    @event.listens_for(engine, "begin")
    def _begin(connection: Connection) -> None:
        writes = connection.get_execution_options().get(_WRITES, False)
        # A reader that becomes a writer would fail at once where another one writes.
        connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")

    return engine


def _only_read(file: Path) -> URL:
    """An SQLite file that this user may only read.

    What is written ahead lies beside it and is read with it. Where there is nothing, SQLite would
    make those files, unless it is told that the database stays as it is
    (https://sqlite.org/wal.html#readonly).
    """
    options = {"mode": "ro", "uri": "true"}
    if not file.with_name(f"{file.name}-wal").exists():
        options["immutable"] = "1"
    return URL.create("sqlite", database=f"file:{quote(str(file.absolute()))}", query=options)
