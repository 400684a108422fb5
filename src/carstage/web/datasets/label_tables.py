"""Label tables by the page, and counts over them."""

from __future__ import annotations

import threading
from collections import Counter, OrderedDict
from typing import TYPE_CHECKING, Any, Literal

from carstage.web.datasets.catalogue import Catalogue
from carstage.web.datasets.frame_values import plain
from carstage.web.errors import WebError
from carstage.web.messages import Statistics, TableFilter, TablePage, TableRequest
from carstage.web.messages.datasets import Histogram, TableColumn
from carstage.web.roots import Roots

if TYPE_CHECKING:
    import pyarrow as pa

    from carstage.dataset import Episode

_MOST_ROWS = 2_000_000
_MOST_KEPT = 4
_LEFT_OUT = frozenset({"mask_modal"})
_TRUTHS = {"true": True, "yes": True, "false": False, "no": False}
_COMPARISONS = {
    "eq": "equal",
    "ne": "not_equal",
    "lt": "less",
    "le": "less_equal",
    "gt": "greater",
    "ge": "greater_equal",
}


class LabelTables:
    """Reads, filters and counts; keeps the last few tables.

    Args:
        catalogue: finds the episodes.
        roots: finds the datasets.
    """

    def __init__(self, catalogue: Catalogue, roots: Roots) -> None:
        self._catalogue = catalogue
        self._roots = roots
        self._lock = threading.Lock()
        self._tables: OrderedDict[tuple[str, ...], pa.Table] = OrderedDict()
        self._statistics: dict[tuple[str, str], Statistics] = {}

    def page(self, dataset: str, request: TableRequest) -> TablePage:
        """The rows that fit, sorted, from ``offset`` on.

        Raises:
            WebError: no such episode or column, or a value that does not fit its column.
        """
        table = self._table(dataset, request)
        of_class = [condition for condition in request.filters if condition.column == "class"]
        for condition in request.filters:
            if condition not in of_class:
                table = table.filter(_fits(table, condition))
        classes = _classes(table)
        for condition in of_class:
            table = table.filter(_fits(table, condition))
        total = table.num_rows
        if request.sort is not None:
            table = table.take(_order(table, request.sort, descending=request.descending))
        shown = table.slice(request.offset, request.limit)
        columns = [
            [plain(value) for value in shown[name].to_pylist()] for name in shown.column_names
        ]
        return TablePage(
            columns=[_described(request.table, field) for field in table.schema],
            rows=[list(row) for row in zip(*columns, strict=True)],
            total=total,
            classes=classes,
        )

    def statistics(self, dataset: str) -> Statistics:
        """Counts over all episodes; made once per state of the dataset.

        Raises:
            WebError: there is no such dataset.
            DatasetError: a table is missing or damaged.
        """
        from carstage.report.drawing import class_colour
        from carstage.report.statistics import (
            DISTANCE_EDGES_M,
            LIDAR_EDGES,
            OCCLUSION_NAMES,
            bin_names,
            count_labels,
        )

        key = dataset, self._roots.dataset(dataset).fingerprint()
        with self._lock:
            if key in self._statistics:
                return self._statistics[key]
        episodes = self._catalogue.episodes(dataset)
        counted = count_labels(episodes)
        maps: Counter[str] = Counter()
        weathers: Counter[str] = Counter()
        for summary in self._catalogue.summaries(dataset):
            maps[summary.map] += summary.frames
            weathers[summary.weather] += summary.frames
        found = Statistics(
            records=counted.records,
            tracks=counted.tracks,
            visible=counted.visible,
            classes=dict(counted.by_class.most_common()),
            class_colours={name: list(class_colour(name)) for name in counted.by_class},
            frames_by_map=dict(maps),
            frames_by_weather=dict(weathers),
            histograms=[
                Histogram(
                    title="Distance of visible objects",
                    bins=bin_names(DISTANCE_EDGES_M, " m"),
                    counts=counted.distances,
                ),
                Histogram(
                    title="Occlusion by STAGE-VO",
                    bins=list(OCCLUSION_NAMES),
                    counts=counted.occluded,
                ),
                Histogram(
                    title="Occlusion by pixels",
                    bins=list(OCCLUSION_NAMES),
                    counts=counted.occluded_px,
                ),
            ],
        )
        if any(counted.lidar_points):
            found.histograms.append(
                Histogram(
                    title="LiDAR points per object",
                    bins=bin_names(LIDAR_EDGES, ""),
                    counts=counted.lidar_points,
                )
            )
        with self._lock:
            self._statistics = {k: v for k, v in self._statistics.items() if k[0] != dataset}
            self._statistics[key] = found
        return found

    def _table(self, dataset: str, request: TableRequest) -> pa.Table:
        import pyarrow as pa

        found = self._roots.dataset(dataset)
        key = (str(found.path), found.fingerprint(), request.table, request.episode or "")
        with self._lock:
            if key in self._tables:
                self._tables.move_to_end(key)
                return self._tables[key]
        if request.episode is None:
            episodes = self._catalogue.episodes(dataset)
        else:
            episodes = [self._catalogue.episode(dataset, request.episode)]
        parts, rows = [], 0
        for episode in episodes:
            part = _rows(episode, request.table)
            rows += part.num_rows
            if rows > _MOST_ROWS:
                raise WebError(409, "The dataset has too many rows for one table.",
                               "Choose an episode.")  # fmt: skip
            parts.append(part)
        table = pa.concat_tables(parts, promote_options="default") if parts else pa.table({})
        with self._lock:
            self._tables[key] = table
            while len(self._tables) > _MOST_KEPT:
                self._tables.popitem(last=False)
        return table


def _rows(episode: Episode, name: str) -> pa.Table:
    """A table of an episode; rows of cameras also hold class and blueprint, events a frame."""
    import pyarrow as pa

    table = {
        "objects": episode.objects,
        "camera_objects": episode.camera_objects,
        "ego": episode.ego,
        "events": lambda: _events(episode),
        "frames": episode.ledger,
    }[name]()
    table = table.drop_columns([c for c in table.column_names if c in _LEFT_OUT])
    if name == "camera_objects":
        columns = ["k", "track_id", "class", "blueprint"]
        objects = episode.objects().select(columns).to_pydict()
        keys = zip(objects["k"], objects["track_id"], strict=True)
        known = dict(
            zip(keys, zip(objects["class"], objects["blueprint"], strict=True), strict=True)
        )
        found = [
            known.get(key, ("", ""))
            for key in zip(table["k"].to_pylist(), table["track_id"].to_pylist(), strict=True)
        ]
        table = table.add_column(3, "class", pa.array([c for c, _ in found], pa.string()))
        table = table.add_column(4, "blueprint", pa.array([b for _, b in found], pa.string()))
    if "episode_id" not in table.column_names:
        ids = pa.array([episode.id] * table.num_rows, pa.string())
        table = table.add_column(0, "episode_id", ids)
    return table


def _events(episode: Episode) -> pa.Table:
    """The events, with the first saved frame of each; no rows where none was planned."""
    import pyarrow as pa

    from carstage.annotation.schema import EVENT_COLUMNS
    from carstage.conversion.segment import label_schema

    table = episode.events()
    if table is None:
        table = label_schema(EVENT_COLUMNS).empty_table()
    ledger = episode.ledger().select(["tick", "k"]).to_pydict()
    saved = [(tick, k) for tick, k in zip(*ledger.values(), strict=True) if k is not None]
    frames = [
        None if begin is None else next((k for tick, k in saved if tick >= begin), None)
        for begin in table["begin_tick"].to_pylist()
    ]
    return table.add_column(0, "k", pa.array(frames, pa.int32()))


def _classes(table: pa.Table) -> dict[str, int]:
    """Rows by class, the most frequent first; empty where rows have none."""
    if "class" not in table.column_names:
        return {}
    counted: list[Any] = [entry.as_py() for entry in table["class"].value_counts()]
    rows = {entry["values"]: entry["counts"] for entry in counted if entry["values"]}
    return dict(sorted(rows.items(), key=lambda entry: -entry[1]))


def _fits(table: pa.Table, condition: TableFilter) -> Any:
    """A mask of the rows that fit a condition."""
    import pyarrow as pa
    import pyarrow.compute as pc

    column = _column(table, condition.column)
    if condition.value is None:
        empty = pc.is_null(column)
        return empty if condition.op == "eq" else pc.invert(empty)
    try:
        if condition.op == "contains":
            words = pc.utf8_lower(pc.cast(column, pa.string()))
            found = pc.match_substring(words, str(condition.value).lower())
        else:
            value: Any = condition.value
            if pa.types.is_string(column.type):
                value = str(value)
            elif isinstance(value, str) and pa.types.is_boolean(column.type):
                value = _TRUTHS[value.strip().lower()]
            elif isinstance(value, str):
                value = float(value)
            if isinstance(value, float) and pa.types.is_integer(column.type):
                column = pc.cast(column, pa.float64(), safe=False)
            found = pc.call_function(_COMPARISONS[condition.op], [column, pa.scalar(value)])
    except (pa.ArrowException, KeyError, ValueError, TypeError) as error:
        raise WebError(
            422,
            f"{condition.value!r:.60} cannot be compared with {condition.column}.",
            "Give a value of the column's type.",
        ) from error
    return pc.fill_null(found, False)


def _order(table: pa.Table, name: str, *, descending: bool) -> Any:
    import pyarrow as pa
    import pyarrow.compute as pc

    direction: Literal["ascending", "descending"] = "descending" if descending else "ascending"
    try:
        _column(table, name)
        return pc.sort_indices(table, sort_keys=[(name, direction)])
    except (pa.ArrowException, TypeError, ValueError) as error:
        raise WebError(422, f"{name} cannot be sorted by.", "Choose another column.") from error


def _column(table: pa.Table, name: str) -> Any:
    if name not in table.column_names:
        raise WebError(422, f"There is no column {name}.", "See `columns` of the table.")
    return table[name]


def _described(table: str, field: pa.Field[Any]) -> TableColumn:
    from carstage.annotation.schema import EVENT_COLUMNS, EVENTS, TABLES

    known_tables = {**TABLES, EVENTS: EVENT_COLUMNS}
    files = (f"{table}.parquet", "objects.parquet")
    columns = [column for file in files for column in known_tables.get(file, ())]
    known = next((column for column in columns if column.name == field.name), None)
    return TableColumn(
        name=field.name,
        type=str(field.type) if known is None else known.type,
        unit="" if known is None else known.unit,
        meaning="" if known is None else known.description,
    )
