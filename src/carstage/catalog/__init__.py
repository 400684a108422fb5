"""An index over datasets in SQLite or PostgreSQL; the datasets themselves need none of it.

What is listed here is imported when it is first used: SQLAlchemy and Alembic are the extra
``catalog``, the driver of PostgreSQL is ``postgres``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from carstage.errors import BadInputError
from carstage.lazy import lazy_names

if TYPE_CHECKING:
    from carstage.catalog.address import CATALOG_VARIABLE, CatalogAddress, catalog_address
    from carstage.catalog.collecting import Leftover, collect, leftovers
    from carstage.catalog.database import Catalog
    from carstage.catalog.filters import PageFilter
    from carstage.catalog.following import CatalogFollower
    from carstage.catalog.indexing import IndexSummary, rebuild, record_episode, run_row
    from carstage.catalog.listing import Page, list_episodes, show_episode
    from carstage.catalog.loading import load_labels
    from carstage.catalog.querying import query_catalog, query_labels
    from carstage.catalog.verifying import Difference, verify

__all__ = [
    "CATALOG_VARIABLE",
    "Catalog",
    "CatalogAddress",
    "CatalogFollower",
    "Difference",
    "IndexSummary",
    "Leftover",
    "Page",
    "PageFilter",
    "catalog_address",
    "collect",
    "leftovers",
    "list_episodes",
    "load_labels",
    "query_catalog",
    "query_labels",
    "rebuild",
    "record_episode",
    "run_row",
    "show_episode",
    "verify",
]

if not TYPE_CHECKING:  # else every misspelt name would count as known
    _find = lazy_names(
        __name__,
        {
            "address": "CATALOG_VARIABLE CatalogAddress catalog_address",
            "collecting": "Leftover collect leftovers",
            "database": "Catalog",
            "following": "CatalogFollower",
            "indexing": "IndexSummary rebuild record_episode run_row",
            "filters": "PageFilter",
            "listing": "Page list_episodes show_episode",
            "loading": "load_labels",
            "querying": "query_catalog query_labels",
            "verifying": "Difference verify",
        },
    )

    def __getattr__(name):
        """Find a name in its module.

        Raises:
            BadInputError: its module needs a package that is not installed.
        """
        try:
            return _find(name)
        except ModuleNotFoundError as error:
            if (error.name or "").partition(".")[0] in ("alembic", "sqlalchemy"):
                raise BadInputError(
                    "The catalog needs a package that is not installed.",
                    "Install it: pip install 'carstage[catalog]'.",
                ) from error
            raise
