"""A vector map as a table of GeoParquet 1.1, and back; see docs/formats/vector-map.md.

One row is one feature. ``geometry`` is on the globe, so that programs for maps place it; the other
columns of places are metres in CARLA's frame, without a system of coordinates.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import pyarrow as pa

from carstage.geometry import FloatArray, GeoFrame
from carstage.vector_map.model import (
    Crosswalk,
    Junction,
    Lane,
    Marking,
    PaintedObject,
    Signal,
    SpeedLimit,
    StopLine,
    VectorMap,
)
from carstage.vector_map.wkb import Shape, from_wkb, to_wkb

FORMAT_VERSION = 1
GEO_KEY = b"geo"
_LINES = ("centre_line", "left_boundary", "right_boundary")
_DEGREE_DIGITS = 10
"""A hundredth of a millimetre."""


def _list(element: pa.DataType) -> pa.DataType:
    return pa.list_(pa.field("element", element, nullable=False))


_LIMIT = pa.struct(
    [pa.field("s_m", pa.float64(), nullable=False), pa.field("limit_m_s", pa.float64())]
)
_COLUMNS: list[pa.Field[Any]] = [
    pa.field("kind", pa.string(), nullable=False),
    pa.field("id", pa.string(), nullable=False),
    pa.field("geometry", pa.binary()),
    pa.field("world", pa.binary()),
    pa.field("road_id", pa.int64()),
    pa.field("section", pa.int32()),
    pa.field("lane", pa.int32()),
    pa.field("junction_id", pa.int64()),
    pa.field("type", pa.string()),
    pa.field("name", pa.string()),
    pa.field("direction", pa.string()),
    pa.field("centre_line", pa.binary()),
    pa.field("left_boundary", pa.binary()),
    pa.field("right_boundary", pa.binary()),
    pa.field("s_m", _list(pa.float64())),
    pa.field("widths_m", _list(pa.float64())),
    pa.field("predecessors", _list(pa.string())),
    pa.field("successors", _list(pa.string())),
    pa.field("left_neighbour", pa.string()),
    pa.field("right_neighbour", pa.string()),
    pa.field("left_markings", _list(pa.string())),
    pa.field("right_markings", _list(pa.string())),
    pa.field("speed_limits", _list(_LIMIT)),
    pa.field("colour", pa.string()),
    pa.field("width_m", pa.float64()),
    pa.field("lane_change", pa.string()),
    pa.field("lanes", _list(pa.string())),
    pa.field("signals", _list(pa.string())),
    pa.field("source", pa.string()),
    pa.field("roads", _list(pa.int64())),
    pa.field("subtype", pa.string()),
    pa.field("country", pa.string()),
    pa.field("value", pa.float64()),
    pa.field("unit", pa.string()),
    pa.field("dynamic", pa.bool_()),
    pa.field("controllers", _list(pa.string())),
]
SCHEMA = pa.schema(_COLUMNS)

Row = dict[str, Any]


def to_table(town: VectorMap, frame: GeoFrame) -> pa.Table:
    """One row for each feature; metadata for programs that read GeoParquet."""
    rows = list(_rows(town))
    shapes: list[tuple[Shape, FloatArray] | None] = [row.pop("shape") for row in rows]
    globe = _on_the_globe(shapes, frame)
    for row, shape, place in zip(rows, shapes, globe, strict=True):
        row["world"] = None if shape is None else to_wkb(*shape)
        row["geometry"] = None if place is None else to_wkb(*place)
        for name in _LINES:
            if name in row:
                row[name] = to_wkb("LineString", row[name])
    table = pa.Table.from_pylist(rows, schema=SCHEMA)
    return table.replace_schema_metadata({GEO_KEY: json.dumps(_metadata(globe)).encode()})


def from_table(table: pa.Table) -> VectorMap:
    """The map that a table holds.

    Raises:
        ValueError: it lacks a column, or a row is not what :func:`to_table` writes.
    """
    for name in SCHEMA.names:
        if name not in table.column_names:
            raise ValueError(f"the vector map has no column {name}")
    found: dict[str, list[Any]] = {kind: [] for kind in _READERS}
    for row in table.select(SCHEMA.names).to_pylist():
        reader = _READERS.get(row["kind"])
        if reader is None:
            raise ValueError(f"the vector map has a row of kind {str(row['kind'])[:40]!r}")
        try:
            found[row["kind"]].append(reader(row))
        except (TypeError, ValueError, KeyError) as error:
            raise ValueError(f"{row['kind']} {str(row['id'])[:80]}: {error}") from error
    return VectorMap(*(tuple(found[kind]) for kind in _READERS))


def to_geojson(table: pa.Table) -> dict[str, Any]:
    """A FeatureCollection (RFC 7946) of a table's rows on the globe.

    Properties are the other columns of a row but places in metres; what a row lacks is left out.

    Raises:
        ValueError: a geometry is not to be read.
    """
    left_out = {"geometry", "world", *_LINES}
    features = []
    for row in table.to_pylist():
        geometry = None
        if row["geometry"] is not None:
            shape, places = from_wkb(row["geometry"])
            line = places.tolist()
            coordinates = {"Point": line[0], "LineString": line, "Polygon": [line]}[shape]
            geometry = {"type": shape, "coordinates": coordinates}
        properties = {k: v for k, v in row.items() if v is not None and k not in left_out}
        features.append({"type": "Feature", "geometry": geometry, "properties": properties})
    return {"type": "FeatureCollection", "features": features}


def _rows(town: VectorMap) -> Iterator[Row]:
    for lane in town.lanes:
        ring = np.concatenate(
            [lane.left_boundary, lane.right_boundary[::-1], lane.left_boundary[:1]]
        )
        row = _fields(lane, without={"width_m", "speed_limits"})
        limits = [{"s_m": one.s_m, "limit_m_s": one.limit_m_s} for one in lane.speed_limits]
        yield {
            "kind": "lane",
            "shape": ("Polygon", ring),
            **row,
            "widths_m": lane.width_m.tolist(),
            "speed_limits": limits,
        }
    for marking in town.markings:
        row = _fields(marking, without={"line"})
        yield {"kind": "marking", "shape": ("LineString", marking.line), **row}
    for junction in town.junctions:
        row = _fields(junction, without={"outline", "signal_controllers"})
        yield {
            "kind": "junction",
            "id": str(junction.junction_id),
            "shape": None if junction.outline is None else ("Polygon", junction.outline),
            **row,
            "controllers": list(junction.signal_controllers),
        }
    for walk in town.crosswalks:
        row = _fields(walk, without={"outline"})
        yield {"kind": "crosswalk", "shape": ("Polygon", walk.outline), **row}
    for stop in town.stop_lines:
        row = _fields(stop, without={"line"})
        yield {"kind": "stop_line", "shape": ("LineString", stop.line), **row}
    for signal in town.signals:
        row = _fields(signal, without={"place"})
        yield {"kind": "signal", "shape": ("Point", signal.place.reshape(1, 3)), **row}
    for painted in town.painted_objects:
        row = _fields(painted, without={"outline"})
        yield {"kind": "painted_object", "shape": ("Polygon", painted.outline), **row}


def _fields(feature: Any, without: set[str]) -> Row:
    row: Row = {}
    for name in feature.__slots__:
        if name in without:
            continue
        value = getattr(feature, name)
        if isinstance(value, tuple):
            value = list(value)
        elif isinstance(value, np.ndarray) and name not in _LINES:
            value = value.tolist()
        row[name] = value
    return row


def _on_the_globe(
    shapes: list[tuple[Shape, FloatArray] | None], frame: GeoFrame
) -> list[tuple[Shape, FloatArray] | None]:
    """The same shapes as longitude, latitude and altitude; rings run counter-clockwise."""
    places = [np.zeros((0, 3)) if shape is None else shape[1] for shape in shapes]
    together = np.round(frame.places(np.concatenate([np.zeros((0, 3)), *places])), _DEGREE_DIGITS)
    ends = np.cumsum([len(one) for one in places])
    found: list[tuple[Shape, FloatArray] | None] = []
    for shape, part in zip(shapes, np.split(together, ends[:-1]), strict=True):
        if shape is None:
            found.append(None)
            continue
        x, y = part[:, 0] - part[0, 0], part[:, 1] - part[0, 1]
        clockwise = float((x[:-1] * y[1:] - x[1:] * y[:-1]).sum()) < 0
        found.append((shape[0], part[::-1] if shape[0] == "Polygon" and clockwise else part))
    return found


def _metadata(globe: list[tuple[Shape, FloatArray] | None]) -> Mapping[str, Any]:
    """The key ``geo`` of GeoParquet 1.1: columns of geometry, their types and systems."""
    types = sorted({f"{shape[0]} Z" for shape in globe if shape is not None})
    primary: dict[str, Any] = {"encoding": "WKB", "geometry_types": types}
    places = [shape[1] for shape in globe if shape is not None]
    if places:
        together = np.concatenate(places)
        primary["bbox"] = [*together.min(axis=0).tolist(), *together.max(axis=0).tolist()]
        primary["orientation"] = "counterclockwise"
    # Without a key `crs`, a column is OGC:CRS84: longitude and latitude. Null: none is known.
    world = {"encoding": "WKB", "geometry_types": types, "crs": None}
    lines = {"encoding": "WKB", "geometry_types": ["LineString Z"], "crs": None}
    columns = {"geometry": primary, "world": world, **dict.fromkeys(_LINES, lines)}
    return {
        "version": "1.1.0",
        "primary_column": "geometry",
        "columns": columns,
        "carstage": {"format_version": FORMAT_VERSION},
    }


def _line(row: Row, name: str) -> FloatArray:
    shape, places = from_wkb(row[name])
    if shape == "Point":
        raise ValueError(f"{name} is a point")
    return places


def _lane(row: Row) -> Lane:
    limits = tuple(SpeedLimit(one["s_m"], one["limit_m_s"]) for one in row["speed_limits"])
    lines: dict[str, Any] = {name: _line(row, name) for name in _LINES}
    lane = Lane(
        **_same(row, Lane, {"s_m", "width_m", "speed_limits", *_LINES}),
        **lines,
        s_m=np.array(row["s_m"], np.float64),
        width_m=np.array(row["widths_m"], np.float64),
        speed_limits=limits,
    )
    sizes = {len(getattr(lane, name)) for name in (*_LINES, "s_m", "width_m")}
    if len(sizes) != 1 or sizes & {0, 1}:
        raise ValueError("its lines, stations and widths are not of one length")
    return lane


def _marking(row: Row) -> Marking:
    line, s_m = _line(row, "world"), np.array(row["s_m"], np.float64)
    return Marking(**_same(row, Marking, {"line", "s_m"}), line=line, s_m=s_m)


def _junction(row: Row) -> Junction:
    return Junction(
        **_same(row, Junction, {"outline", "signal_controllers"}),
        outline=None if row["world"] is None else _line(row, "world"),
        signal_controllers=tuple(row["controllers"]),
    )


def _crosswalk(row: Row) -> Crosswalk:
    return Crosswalk(**_same(row, Crosswalk, {"outline"}), outline=_line(row, "world"))


def _stop_line(row: Row) -> StopLine:
    return StopLine(**_same(row, StopLine, {"line"}), line=_line(row, "world"))


def _signal(row: Row) -> Signal:
    shape, place = from_wkb(row["world"])
    if shape != "Point":
        raise ValueError("its place is no point")
    return Signal(**_same(row, Signal, {"place"}), place=place[0])


def _painted_object(row: Row) -> PaintedObject:
    return PaintedObject(**_same(row, PaintedObject, {"outline"}), outline=_line(row, "world"))


def _same(row: Row, feature: Any, without: set[str]) -> Row:
    """The columns that have a field's own name; lists as tuples."""
    names = [name for name in feature.__slots__ if name not in without]
    return {n: tuple(row[n]) if isinstance(row[n], list) else row[n] for n in names}


_READERS: dict[str, Callable[[Row], Any]] = {
    "lane": _lane,
    "marking": _marking,
    "junction": _junction,
    "crosswalk": _crosswalk,
    "stop_line": _stop_line,
    "signal": _signal,
    "painted_object": _painted_object,
}
"""In the order of the fields of a ``VectorMap``."""
