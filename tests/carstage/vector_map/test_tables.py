"""Vector maps as GeoParquet and GeoJSON: other readers see what was written, and back again."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import shapely

import small_maps
from carstage.dataset.tables import write_table
from carstage.geometry import GeoFrame, GeoPoint
from carstage.vector_map import VectorMap, from_table, to_geojson, to_table, vector_map
from carstage.vector_map.table import GEO_KEY
from carstage_sim.maps.writer import PLANS, opendrive_of

FRAMES = [
    GeoFrame(GeoPoint(49.0, 8.4, 110.0), projection)
    for projection in ("spherical_mercator", "transverse_mercator")
]


@pytest.fixture(scope="module")
def town() -> VectorMap:
    arrow = (
        '<object id="a" name="Stencil_ArrowType7L" type="-1" s="20" t="-1.75" hdg="0" width="1.1" '
        'length="3.9"/>'
    )
    painted = vector_map(small_maps.document(small_maps.road(1, 0, 0, 0, 50, objects=arrow)))
    whole = vector_map(opendrive_of(PLANS["Stage01"]))
    return replace(whole, painted_objects=painted.painted_objects)


@pytest.fixture(scope="module")
def table(town: VectorMap) -> pa.Table:
    return to_table(town, FRAMES[1])


def same(one: Any, other: Any) -> bool:
    if isinstance(one, np.ndarray):
        return bool(np.array_equal(one, other))
    return bool(one == other)


def test_a_map_comes_back_as_it_was(town: VectorMap, table: pa.Table) -> None:
    back = from_table(table)
    for kind in fields(VectorMap):
        ours, theirs = getattr(town, kind.name), getattr(back, kind.name)
        assert len(ours) == len(theirs) > 0, kind.name
        for one, other in zip(ours, theirs, strict=True):
            for name in (field.name for field in fields(one)):
                assert same(getattr(one, name), getattr(other, name)), (kind.name, name)


def test_equal_maps_are_equal_bytes_and_say_that_they_are_geoparquet(
    table: pa.Table, tmp_path: Path
) -> None:
    for name in ("a", "b"):
        write_table(table, tmp_path / name, keep=(GEO_KEY,))
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    file = pq.ParquetFile(tmp_path / "a")
    geo = json.loads(file.metadata.metadata[GEO_KEY])
    assert (geo["version"], geo["primary_column"]) == ("1.1.0", "geometry")
    for name, column in geo["columns"].items():
        index = file.schema_arrow.get_field_index(name)
        assert file.schema_arrow.field(index).type == pa.binary()
        assert column["encoding"] == "WKB"
        shapes = shapely.from_wkb(file.read([name]).column(name).to_pylist())
        found = {f"{shape.geom_type} Z" for shape in shapes if shape is not None}
        assert found == set(column["geometry_types"]), name
    assert "crs" not in geo["columns"]["geometry"]  # longitude and latitude, as where none is named
    assert geo["columns"]["world"]["crs"] is None
    low, high = np.split(np.array(geo["columns"]["geometry"]["bbox"]), 2)
    assert (low < (8.4, 49.0, 110.01)).all()
    assert (high > (8.4, 49.0, 109.99)).all()


def test_areas_are_valid_and_run_counter_clockwise_on_the_globe(table: pa.Table) -> None:
    shapes = shapely.from_wkb(table.column("geometry").to_pylist())
    areas = [shape for shape in shapes if shape is not None and shape.geom_type == "Polygon"]
    assert len(areas) > 200
    assert all(shapely.is_ccw(area.exterior) for area in areas)
    assert np.mean(shapely.is_valid(areas)) > 0.99


@pytest.mark.parametrize("frame", FRAMES, ids=lambda frame: frame.projection)
def test_features_lie_on_the_globe_where_their_world_places_do(
    town: VectorMap, frame: GeoFrame
) -> None:
    rows = to_table(town, frame).select(["geometry", "world"]).slice(0, 40).to_pylist()
    for row in rows:
        on_the_globe, world = (shapely.from_wkb(row[name]) for name in ("geometry", "world"))
        expected = [
            (place.longitude_deg, place.latitude_deg, place.altitude_m)
            for place in map(frame.place, shapely.get_coordinates(world, include_z=True))
        ]
        found = shapely.get_coordinates(on_the_globe, include_z=True)
        assert any(np.allclose(found, way, rtol=0, atol=1e-9) for way in (expected, expected[::-1]))


def test_geojson_has_a_feature_for_each_row(table: pa.Table) -> None:
    document = json.loads(json.dumps(to_geojson(table), allow_nan=False))
    assert document["type"] == "FeatureCollection"
    assert len(document["features"]) == table.num_rows
    shapes = shapely.from_wkb(table.column("geometry").to_pylist())
    for feature, shape in zip(document["features"], shapes, strict=True):
        assert shapely.geometry.shape(feature["geometry"]).equals_exact(shape, 0.0)
    lane = next(one["properties"] for one in document["features"])
    assert (lane["kind"], lane["type"]) == ("lane", "sidewalk")
    assert "centre_line" not in lane
    assert "subtype" not in lane


@pytest.mark.parametrize(
    ("column", "value", "reason"),
    [
        ("kind", "tree", "a row of kind 'tree'"),
        ("centre_line", b"", "no point, line or area"),
        ("centre_line", b"\x01" + b"\xff" * 12, "no point, line or area"),
        ("left_boundary", b"\x01\xea\x03\x00\x00\xff\xff\xff\xff", "another length"),
        ("s_m", [0.0], "not of one length"),
        ("world", None, None),
    ],
)
def test_a_table_that_is_no_vector_map_is_refused(
    table: pa.Table, column: str, value: object, reason: str | None
) -> None:
    rows = table.slice(0, 1).to_pylist()
    rows[0][column] = value
    damaged = pa.Table.from_pylist(rows, schema=table.schema)
    if reason is None:  # a lane's own lines say where it is
        assert len(from_table(damaged).lanes) == 1
    else:
        with pytest.raises(ValueError, match=reason):
            from_table(damaged)
    with pytest.raises(ValueError, match="no column"):
        from_table(table.drop_columns(["lanes"]))
