"""The tables are those of the schema, and a schema of a newer version is left alone."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.runtime.migration import MigrationContext

from benchmarks.framework.postgres_servers import PostgresServer
from carstage.catalog import Catalog, CatalogAddress
from carstage.catalog.address import parse_address
from carstage.catalog.migrating import VERSION_TABLE
from carstage.catalog.schema import METADATA
from carstage.errors import BadInputError, CatalogError

pytestmark = pytest.mark.xdist_group("postgres")


@pytest.fixture(params=["sqlite", "wheel_postgres", "debian_postgres"])
def address(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[CatalogAddress]:
    if request.param == "sqlite":
        yield parse_address(f"sqlite:///{tmp_path / 'catalog.sqlite'}", secret=False)
        return
    server: PostgresServer = request.getfixturevalue(request.param)
    server.create("catalog")
    yield parse_address(server.good_address, secret=True)


def set_revision(catalog: Catalog, revision: str) -> None:
    with catalog.writing() as connection:
        connection.exec_driver_sql(f"UPDATE {VERSION_TABLE} SET version_num = '{revision}'")


def tables(catalog: Catalog) -> list[str]:
    from sqlalchemy import inspect

    with catalog.reading() as connection:
        return sorted(inspect(connection).get_table_names())


def test_an_empty_database_becomes_what_the_schema_says(address: CatalogAddress) -> None:
    with Catalog(address) as catalog, catalog.reading() as connection:
        options = {"version_table": VERSION_TABLE, "compare_type": True}
        context = MigrationContext.configure(connection, opts=options)
        assert compare_metadata(context, METADATA) == []


def test_many_may_open_an_empty_database_at_once(address: CatalogAddress) -> None:
    def opened(number: int) -> list[str]:
        with Catalog(address) as catalog:
            return tables(catalog)

    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(opened, range(4)))
    assert found == [sorted([*METADATA.tables, VERSION_TABLE])] * 4


@pytest.mark.parametrize("create", [True, False])
def test_a_newer_schema_is_refused_and_stays_as_it_is(
    address: CatalogAddress, create: bool
) -> None:
    with Catalog(address) as catalog:
        set_revision(catalog, "9999")
        with catalog.writing() as connection:
            connection.exec_driver_sql("DROP TABLE splits")
        before = tables(catalog)
        with pytest.raises(CatalogError, match="newer Car-STAGE") as caught:
            Catalog(address, create=create)
        assert caught.value.exit_code == 2
        assert tables(catalog) == before


def test_a_database_without_a_catalog_is_not_read_as_one(
    address: CatalogAddress, tmp_path: Path
) -> None:
    with pytest.raises(BadInputError, match="no catalog"):
        Catalog(address, create=False)
    assert not list(tmp_path.glob("*.sqlite"))
