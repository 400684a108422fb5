"""Conditions on episodes, each with the index that finds its episodes in order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sqlalchemy import Column, ColumnElement, FromClause, Select, Table, select, true
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.compiler import SQLCompiler
from sqlalchemy.sql.selectable import Join

from carstage.catalog.filters import PageFilter
from carstage.catalog.schema import EPISODES, LABEL_SUMMARIES, SENSORS


@dataclass(frozen=True, slots=True)
class Condition:
    """A column has a value, in the row of the episode or in one of another table.

    Attributes:
        table: of the column; it has an index over the column and the number of the episode.
        column: its name.
        value: what it has to be.
    """

    table: Table
    column: str
    value: Any

    @property
    def holds(self) -> ColumnElement[bool]:
        """For a query over ``episodes``."""
        is_so: ColumnElement[bool] = self.table.c[self.column] == self.value
        if self.table is EPISODES:
            return is_so
        return select(1).where(self._number == EPISODES.c.id, is_so).exists()

    def candidates(self, after: int, limit: int) -> Select[Any]:
        """Numbers of the episodes that meet it, as ``id``, in order."""
        query = select(self._number.label("id")).where(
            self.table.c[self.column] == self.value, self._number > after
        )
        # A rig may have several sensors of a kind.
        query = query.distinct() if self.table is SENSORS else query
        return query.order_by(self._number).limit(limit)

    @property
    def _number(self) -> Column[Any]:
        return self.table.c["id" if self.table is EPISODES else "episode"]


def conditions(key: int | None, wanted: PageFilter) -> list[Condition]:
    """All that have to hold, first those that few episodes use to meet.

    Args:
        key: number of the dataset; None: all.
        wanted: which episodes.
    """
    asked = (
        Condition(EPISODES, "variant", wanted.variant),
        Condition(EPISODES, "weather", wanted.weather),
        Condition(EPISODES, "map", wanted.town),
        Condition(LABEL_SUMMARIES, "class", wanted.label),
        Condition(SENSORS, "kind", wanted.sensor),
        Condition(EPISODES, "split", wanted.split),
        Condition(EPISODES, "dataset", key),
    )
    return [condition for condition in asked if condition.value is not None]


class OrderedJoin(Join):
    """Every row of one table with every row of another; what they have in common is a condition.

    SQLite goes through the left one of a ``CROSS JOIN`` first, whatever it thinks of the sizes
    (https://sqlite.org/optoverview.html#manual_control_of_query_plans_using_cross_join).

    Args:
        left: gone through first.
        right: looked up.
    """

    inherit_cache = True

    def __init__(self, left: FromClause, right: FromClause) -> None:
        super().__init__(left, right, onclause=true())


@compiles(OrderedJoin)
def _as_cross_join(element: OrderedJoin, compiler: SQLCompiler, **options: Any) -> str:
    options["asfrom"] = True
    sides = (compiler.process(side, **options) for side in (element.left, element.right))
    return " CROSS JOIN ".join(sides)
