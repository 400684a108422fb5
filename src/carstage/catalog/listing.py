"""Pages of episodes, and all that a catalog knows of one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sqlalchemy import FromClause, Select, func, select

from carstage.catalog.conditions import OrderedJoin, conditions
from carstage.catalog.filters import EVERYTHING, PageFilter
from carstage.catalog.schema import (
    ARTIFACTS,
    ATTEMPTS,
    DATASETS,
    EPISODES,
    LABEL_SUMMARIES,
    SENSORS,
)
from carstage.errors import BadInputError

if TYPE_CHECKING:
    from sqlalchemy.engine import Connection

    from carstage.catalog.database import Catalog

PAGE_SIZE = 50
_LARGEST_PAGE = 10_000
_COUNTED = 5000
"""Conditions that more rows meet count as equally frequent."""
_FIRST_PORTION = 4
"""Candidates for each row of the page; then more and more."""
_GROWTH, _LARGEST_PORTION = 4, 64_000
_SHOWN = (
    "episode_id",
    "attempt",
    "run_id",
    "frames",
    "duration_s",
    "files",
    "bytes",
    "map",
    "weather",
    "variant",
    "base_id",
    "scenario",
    "split",
    "carstage",
    "client",
    "server",
    "self_test",
)


@dataclass(frozen=True, slots=True)
class Page:
    """Some episodes.

    Attributes:
        episodes: rows of the catalog; ``dataset`` is the dataset's location.
        after: what to give for the next page; None: this is the last one.
    """

    episodes: tuple[dict[str, Any], ...]
    after: int | None


def list_episodes(
    catalog: Catalog,
    location: str | None = None,
    wanted: PageFilter = EVERYTHING,
    *,
    limit: int = PAGE_SIZE,
    after: int = 0,
) -> Page:
    """A page of episodes, in the order in which they came into the catalog.

    The cost does not depend on the number of pages before it.

    Args:
        catalog: is read.
        location: of the one dataset, as the catalog knows it; None: all datasets.
        wanted: which episodes.
        limit: at most so many.
        after: ``Page.after`` of the page before.

    Raises:
        BadInputError: the catalog does not know the dataset, or the limit is out of range.
        CatalogError: the catalog cannot be read.
    """
    if not 1 <= limit <= _LARGEST_PAGE:
        raise BadInputError(f"limit: {limit} is no size of a page.", f"Give 1 to {_LARGEST_PAGE}.")
    with catalog.reading() as connection:
        key = None if location is None else _dataset_key(connection, catalog, location)
        rows = next_episodes(connection, key, wanted, limit + 1, after)
    more = len(rows) > limit
    rows = rows[:limit]
    last = rows[-1]["id"] if more else None
    for row in rows:
        del row["id"]
    return Page(tuple(rows), last)


def wanted_episodes(
    catalog: Catalog, location: str, wanted: PageFilter
) -> list[tuple[str, str, str | None]]:
    """Id, attempt and version of Car-STAGE of all episodes that a filter lets pass.

    Args:
        catalog: is read.
        location: of the dataset.
        wanted: which episodes.

    Raises:
        BadInputError: the catalog does not know the dataset.
        CatalogError: the catalog cannot be read.
    """
    columns = (EPISODES.c.episode_id, EPISODES.c.attempt, EPISODES.c.carstage)
    with catalog.reading() as connection:
        key = _dataset_key(connection, catalog, location)
        query = page_query(key, wanted).with_only_columns(*columns)
        return [(row[0], row[1], row[2]) for row in connection.execute(query)]


def next_episodes(
    connection: Connection, key: int | None, wanted: PageFilter, limit: int, after: int
) -> list[dict[str, Any]]:
    """Rows of :func:`page_query` from a number on.

    Databases guess badly how far they have to look for a page, so the way is given here. The
    condition that the fewest rows meet gives the candidates, by its index, in growing portions; the
    other conditions are looked up one by one.

    Args:
        connection: in a transaction.
        key: number of the dataset; None: all.
        wanted: which episodes.
        limit: at most so many rows.
        after: number of the row before the first.
    """
    asked = conditions(key, wanted)
    if not asked:
        query = page_query(None, wanted).where(EPISODES.c.id > after).limit(limit)
        return [dict(row) for row in connection.execute(query).mappings()]
    rarest = asked[0]
    if len(asked) > 1:
        sizes = [
            connection.execute(
                select(func.count()).select_from(one.candidates(after, _COUNTED).subquery())
            ).scalar_one()
            for one in asked
        ]
        rarest = asked[sizes.index(min(sizes))]
    portion = limit if len(asked) == 1 else _FIRST_PORTION * limit
    rows: list[dict[str, Any]] = []
    while True:
        some = rarest.candidates(after, portion).subquery()
        query = page_query(key, wanted, some).limit(limit - len(rows))
        found = connection.execute(query).mappings()
        rows += [dict(row) for row in found]
        last, count = connection.execute(select(func.max(some.c.id), func.count())).one()
        if len(rows) == limit or count < portion:
            return rows
        after, portion = last, min(_GROWTH * portion, _LARGEST_PORTION)


def show_episode(catalog: Catalog, location: str, episode_id: str) -> dict[str, Any]:
    """What a catalog knows of an episode: its row, ``sensors``, ``artifacts``, ``labels``.

    Args:
        catalog: is read.
        location: of its dataset.
        episode_id: its id.

    Raises:
        BadInputError: the catalog does not know the dataset or the episode.
        CatalogError: the catalog cannot be read.
    """
    with catalog.reading() as connection:
        key = _dataset_key(connection, catalog, location)
        query = page_query(key, EVERYTHING).where(EPISODES.c.episode_id == episode_id)
        found = connection.execute(query).mappings().one_or_none()
        if found is None:
            raise BadInputError(
                f"The catalog {catalog.address.shown} has no episode {episode_id}.",
                "Bring it up to date: carstage catalog rebuild DATASET --update.",
            )
        row = dict(found)
        number = row.pop("id")
        for name, table in (
            ("sensors", SENSORS),
            ("artifacts", ARTIFACTS),
            ("labels", LABEL_SUMMARIES),
        ):
            columns = [column for column in table.c if column.name != "episode"]
            of_episode = select(*columns).where(table.c.episode == number).order_by(columns[0])
            row[name] = [dict(one) for one in connection.execute(of_episode).mappings()]
        tried = select(ATTEMPTS.c.attempt, ATTEMPTS.c.state).where(
            ATTEMPTS.c.dataset == key, ATTEMPTS.c.episode_id == episode_id
        )
        row["attempts"] = {one.attempt: one.state for one in connection.execute(tried)}
    return row


def page_query(
    key: int | None, wanted: PageFilter, candidates: FromClause | None = None
) -> Select[Any]:
    """The rows of a page, by their number.

    Args:
        key: number of the dataset; None: all.
        wanted: which episodes.
        candidates: a query for numbers of episodes, as ``id``: no others come into question.
    """
    shown = [EPISODES.c[name] for name in _SHOWN]
    location = select(DATASETS.c.location).where(DATASETS.c.id == EPISODES.c.dataset)
    query = select(EPISODES.c.id, location.scalar_subquery().label("dataset"), *shown)
    if candidates is not None:
        query = query.select_from(OrderedJoin(candidates, EPISODES))
        query = query.where(candidates.c.id == EPISODES.c.id)
    return query.where(*(one.holds for one in conditions(key, wanted))).order_by(EPISODES.c.id)


def _dataset_key(connection: Connection, catalog: Catalog, location: str) -> int:
    query = select(DATASETS.c.id).where(DATASETS.c.location == location)
    key = connection.execute(query).scalar_one_or_none()
    if key is None:
        raise BadInputError(
            f"The catalog {catalog.address.shown} does not know this dataset ({location}).",
            "Add it: carstage catalog rebuild DATASET.",
        )
    return int(key)
