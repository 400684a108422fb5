"""An index over datasets in SQLite or PostgreSQL; the datasets themselves need none of it.

What is listed here is imported when it is first used: SQLAlchemy and Alembic are the extra
``catalog``, the driver of PostgreSQL is ``postgres``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from carstage.lazy import lazy_names

if TYPE_CHECKING:
    from carstage.catalog.address import CATALOG_VARIABLE, CatalogAddress, catalog_address
    from carstage.catalog.collecting import Leftover, collect, leftovers
    from carstage.catalog.conditions import PageFilter
    from carstage.catalog.database import Catalog
    from carstage.catalog.following import CatalogFollower
    from carstage.catalog.indexing import IndexSummary, rebuild, record_episode
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
    "show_episode",
    "verify",
]

if not TYPE_CHECKING:
    __getattr__ = lazy_names(
        __name__,
        {
            "address": "CATALOG_VARIABLE CatalogAddress catalog_address",
            "collecting": "Leftover collect leftovers",
            "database": "Catalog",
            "following": "CatalogFollower",
            "indexing": "IndexSummary rebuild record_episode",
            "conditions": "PageFilter",
            "listing": "Page list_episodes show_episode",
            "loading": "load_labels",
            "querying": "query_catalog query_labels",
            "verifying": "Difference verify",
        },
    )
