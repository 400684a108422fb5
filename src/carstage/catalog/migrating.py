"""Brings a catalog to the schema of this version, by the Alembic modules that ship with it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from alembic.config import Config
from alembic.runtime.environment import EnvironmentContext
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from alembic.util import CommandError
from sqlalchemy import text

from carstage.errors import BadInputError, CatalogError

if TYPE_CHECKING:
    from sqlalchemy.engine import Connection

    from carstage.catalog.database import Catalog

VERSION_TABLE = "catalog_schema"
_LOCK = 0x4361725354414745
"""Of PostgreSQL's advisory locks: one process at a time changes the schema."""


def bring_up_to_date(catalog: Catalog) -> None:
    """Make the tables, or change those of an older version.

    Raises:
        CatalogError: the schema is of a newer version; nothing was written.
    """
    scripts = _scripts()
    with catalog.reading() as connection:
        if _revision(connection, scripts, catalog.address.shown) == scripts.get_current_head():
            return
    with catalog.writing() as connection:
        if catalog.address.kind == "postgresql":
            connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": _LOCK})
        _upgrade(connection, scripts, catalog.address.shown)


def check_schema(catalog: Catalog) -> None:
    """Refuse a database whose schema is not that of this version.

    Raises:
        BadInputError: it holds no catalog.
        CatalogError: the schema is of an older or a newer version.
    """
    scripts = _scripts()
    with catalog.reading() as connection:
        found = _revision(connection, scripts, catalog.address.shown)
    if found is None:
        raise BadInputError(
            f"The database {catalog.address.shown} holds no catalog.",
            "Make it: carstage catalog rebuild DATASET.",
        )
    if found != scripts.get_current_head():
        raise CatalogError(
            f"The catalog {catalog.address.shown} is of an older Car-STAGE (schema {found}).",
            "Bring it up to date: carstage catalog rebuild DATASET.",
        )


def _scripts() -> ScriptDirectory:
    return ScriptDirectory(str(Path(__file__).parent / "migrations"))


def _revision(connection: Connection, scripts: ScriptDirectory, shown: str) -> str | None:
    """The revision of the tables; None where there are none.

    Raises:
        CatalogError: this version does not know it.
    """
    context = MigrationContext.configure(connection, opts={"version_table": VERSION_TABLE})
    found = context.get_current_revision()
    if found is not None:
        try:
            scripts.get_revision(found)
        except CommandError as error:
            raise CatalogError(
                f"The catalog {shown} is of a newer Car-STAGE (schema {found}).",
                "Install the version of Car-STAGE that made it, or name another database.",
            ) from error
    return found


def _upgrade(connection: Connection, scripts: ScriptDirectory, shown: str) -> None:
    _revision(connection, scripts, shown)  # it may have changed since

    def steps(revision: Any, context: Any) -> Any:
        del context
        return scripts._upgrade_revs("head", revision)

    with EnvironmentContext(Config(), scripts, fn=steps) as environment:
        environment.configure(connection=connection, version_table=VERSION_TABLE)
        environment.run_migrations()
