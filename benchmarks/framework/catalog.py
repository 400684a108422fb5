"""Whether a catalog of a million episodes answers at once, and finds those of a label query.

The rows of a million episodes are made by the database itself. A thousand of them have label tables
on the disk, with the columns of today's schema. Then pages are listed, with each filter, near the
beginning and far behind it, and the tables of the thousand are asked in SQL.
"""

from __future__ import annotations

import os
import statistics
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from carstage import __version__
from carstage.annotation.schema import OBJECT_COLUMNS, Column
from carstage.bench.verdict import Figure, Verdict
from carstage.catalog import (
    CATALOG_VARIABLE,
    Catalog,
    PageFilter,
    catalog_address,
    list_episodes,
    query_labels,
)
from carstage.catalog.address import location_of, parse_address
from carstage.dataset import Dataset
from carstage.dataset.tables import arrow_type, write_table
from carstage.storage import LocalStore

PAGE_MS = 100.0
LABEL_QUERY_S = 2.0
_FRAMES, _OBJECTS = 50, 40
_ROUNDS = 15
_TOWN = "Labelled"
"""The map of the episodes that have tables."""
_QUERY = (
    "SELECT class, count(*) AS boxes, count(DISTINCT (episode_id, track_id)) AS objects, "
    "min(distance_ego) AS nearest_m FROM objects WHERE NOT is_ego GROUP BY class"
)
_FILTERS = {
    "all": PageFilter(),
    "town": PageFilter(town="Stage03"),
    "weather": PageFilter(weather="Weather05"),
    "split": PageFilter(split="test"),
    "sensor": PageFilter(sensor="radar"),
    "rare_class": PageFilter(label="walker_wheelchair"),
    "class_and_town": PageFilter(label="truck", town="Stage03"),
    "everything": PageFilter("Stage03", "Weather01", "val", "lidar", "truck"),
}
_NOTHING = PageFilter("Stage03", "Weather03", "val", "lidar", "truck")
"""Each part is frequent, and no episode has all: the database has to look through one part."""
_CLASSES = {"car": 1, "walker_adult": 2, "truck": 3, "walker_wheelchair": 1000}
"""One episode in so many has it."""
_SENSORS = {"CAM_FRONT": ("rgb", 1), "LIDAR_TOP": ("lidar", 1), "RADAR": ("radar", 100)}
_FILES = ("calibration.json", "episode.json", "ego.parquet", "frames.parquet", "objects.parquet")
Progress = Callable[[int, int], object]


def measure_catalog(
    episodes: int,
    labelled: int,
    scratch: Path | None = None,
    progress: Progress = lambda done, total: None,
) -> Verdict:
    """List pages and ask labels, on SQLite and on the PostgreSQL that the environment names.

    Args:
        episodes: of the catalog.
        labelled: how many of them have tables of labels.
        scratch: an existing folder for catalog and tables; default: a temporary one.
        progress: called with the number of steps that are done, and of all.
    """
    named = os.environ.get(CATALOG_VARIABLE, "")
    kinds = ["sqlite", *(["postgresql"] if named.startswith("postgres") else [])]
    figures = [Figure("episodes", episodes), Figure("labelled_episodes", labelled)]
    with tempfile.TemporaryDirectory(prefix="catalog-", dir=scratch) as folder:
        place = Path(folder) / "dataset"
        _write_tables(place, labelled)
        for done, kind in enumerate(kinds, 1):
            address = (
                parse_address(str(Path(folder) / "catalog.sqlite"), secret=False)
                if kind == "sqlite"
                else catalog_address(None)
            )
            with Catalog(address) as catalog:
                figures += _measure(catalog, Dataset(place), kind, episodes, labelled)
            progress(done, len(kinds))
    notes = [
        f"pages of 50 episodes, {_ROUNDS} times each; page_ms is the slowest filter's median",
        f"tables of objects have {_FRAMES * _OBJECTS} rows and {len(OBJECT_COLUMNS)} columns each",
    ]
    return Verdict("catalog", tuple(figures), notes)


def _measure(
    catalog: Catalog, dataset: Dataset, kind: str, episodes: int, labelled: int
) -> list[Figure]:
    location = location_of(dataset.path, catalog.address)
    begin_s = time.perf_counter()
    first = _fill(catalog, location, episodes, labelled)
    figures = [Figure(f"{kind}_fill_s", time.perf_counter() - begin_s)]
    medians, slowest_ms = {}, 0.0
    for name, wanted in _FILTERS.items():
        for where, after in (("begin", 0), ("end", first + int(0.9 * episodes))):
            times_ms = [_page_ms(catalog, location, wanted, after) for _ in range(_ROUNDS)]
            medians[f"{name}_{where}"] = statistics.median(times_ms)
            slowest_ms = max(slowest_ms, *times_ms[1:])
    figures += [Figure(f"{kind}_page_{name}_ms", value) for name, value in medians.items()]
    nothing_ms = [_page_ms(catalog, location, _NOTHING, 0) for _ in range(_ROUNDS)]
    figures.append(Figure(f"{kind}_empty_page_ms", statistics.median(nothing_ms)))
    figures.append(Figure(f"{kind}_page_ms", max(medians.values()), "<=", PAGE_MS))
    figures.append(Figure(f"{kind}_slowest_page_ms", slowest_ms))
    times_s, read, rows = [], 0, 0
    for _ in range(3):
        begin_s = time.perf_counter()
        answer = query_labels(dataset, _QUERY, catalog=catalog, wanted=PageFilter(town=_TOWN))
        times_s.append(time.perf_counter() - begin_s)
        read, rows = answer.bytes_read or 0, answer.table.num_rows
        assert answer.files == labelled
    figures.append(Figure(f"{kind}_label_query_s", statistics.median(times_s), "<=", LABEL_QUERY_S))
    figures.append(Figure(f"{kind}_label_query_slowest_s", max(times_s)))
    figures.append(Figure(f"{kind}_label_query_mb_read", read / 1e6))
    figures.append(Figure(f"{kind}_label_query_classes", rows))
    if catalog.address.file is not None:
        size = sum(f.stat().st_size for f in catalog.address.file.parent.glob("catalog.sqlite*"))
        figures.append(Figure(f"{kind}_gb", size / 1e9))
    return figures


def _page_ms(catalog: Catalog, location: str, wanted: PageFilter, after: int) -> float:
    begin_s = time.perf_counter()
    list_episodes(catalog, location, wanted, after=after)
    return 1e3 * (time.perf_counter() - begin_s)


def _fill(catalog: Catalog, location: str, episodes: int, labelled: int) -> int:
    """Let the database make the rows; returns the number of the first episode's row, less one."""
    postgres = catalog.address.kind == "postgresql"
    numbers = (
        f"SELECT i FROM generate_series(1, {episodes}) AS s(i)"
        if postgres
        else "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n "
        f"WHERE i < {episodes}) SELECT i FROM n"
    )
    name = "lpad(to_hex(i), 16, '0')" if postgres else "printf('%016x', i)"
    true = "true" if postgres else "1"
    with catalog.writing() as connection:
        # Without parameters: `%` is modulo here.
        run = partial(connection.exec_driver_sql, execution_options={"no_parameters": True})
        run(f"DELETE FROM datasets WHERE location = '{location}'")
        run(
            "INSERT INTO datasets (location, name, created_by) "
            f"VALUES ('{location}', 'million', 'carstage {__version__}')"
        )
        key = run(f"SELECT id FROM datasets WHERE location = '{location}'").scalar_one()
        first = int(run("SELECT coalesce(max(id), 0) FROM episodes").scalar_one())
        run(
            "INSERT INTO episodes (id, dataset, episode_id, attempt, marker_hash, frames,"
            " duration_s, files, bytes, map, weather, scenario, split, carstage, client, server,"
            f" self_test) SELECT {first} + i, {key}, {name}, 'a1', 'blake3:' || {name}, 50, 5.0,"
            " 400, 400000000,"
            f" CASE WHEN i <= {labelled} THEN '{_TOWN}' ELSE 'Stage0' || (i % 8) END,"
            " 'Weather0' || (i % 10), 'autopilot',"
            " CASE i % 10 WHEN 0 THEN 'test' WHEN 1 THEN 'val' ELSE 'train' END,"
            f" '{__version__}', '0.9.16', '0.9.16', {true} FROM ({numbers}) AS n"
        )
        for sensor, (kind, each) in _SENSORS.items():
            run(
                "INSERT INTO sensors (episode, sensor_id, kind, width, height, labelled) "
                f"SELECT {first} + i, '{sensor}', '{kind}', 0, 0, {true} "
                f"FROM ({numbers}) AS n WHERE i % {each} = 0"
            )
        for file in _FILES:
            run(
                "INSERT INTO artifacts (episode, path, files, bytes, hash) "
                f"SELECT {first} + i, '{file}', 1, 10000, 'blake3:' || {name} FROM ({numbers}) AS n"
            )
        for label, each in _CLASSES.items():
            run(
                'INSERT INTO label_summaries (episode, class, tracks, "rows", frames_1, frames_3,'
                " frames_5, frames_10, most_in_frame, nearest_m) "
                f"SELECT {first} + i, '{label}', 5, 200, 50, 20, 5, 0, 9, 4.5 "
                f"FROM ({numbers}) AS n WHERE i % {each} = 0"
            )
    catalog.optimise()
    return first


def _write_tables(folder: Path, labelled: int) -> None:
    """The tables of objects of the first episodes."""
    store = LocalStore(folder)
    store.initialise("million")
    rng = np.random.default_rng(1)
    rows = _FRAMES * _OBJECTS
    columns = {column.name: _values(column, rows, rng) for column in OBJECT_COLUMNS}
    columns["k"] = pa.array(np.repeat(np.arange(_FRAMES, dtype=np.int32), _OBJECTS))
    columns["track_id"] = pa.array(np.tile(np.arange(_OBJECTS), _FRAMES))
    columns["class"] = pa.array(np.tile(np.array(list(_CLASSES)), rows // len(_CLASSES)))
    columns["is_ego"] = pa.array(np.tile(np.arange(_OBJECTS) == 0, _FRAMES))
    for number in range(1, labelled + 1):
        episode_id = f"{number:016x}"
        columns["episode_id"] = pa.array([episode_id] * rows)
        target = store.attempt_folder(episode_id, "a1") / "objects.parquet"
        write_table(pa.table(columns), target)


def _values(column: Column, rows: int, rng: np.random.Generator) -> pa.Array[Any]:
    kind = arrow_type(column.type, nullable=column.nullable)
    if column.type.startswith("f64["):
        width = int(column.type[4:-1])
        return pa.array(list(rng.normal(size=(rows, width))), kind)
    if column.type == "f64":
        return pa.array(rng.normal(size=rows), kind)
    plain: dict[str, Any] = {"bool": False, "str": "vehicle.tesla.model3", "u8[]": [14]}
    value = plain.get(column.type, [("LIDAR_TOP", 7)] if column.type.startswith("map") else 3)
    return pa.array([value] * rows, kind)
