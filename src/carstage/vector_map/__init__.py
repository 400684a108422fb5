"""A town's vector map from its OpenDRIVE text: lanes, markings, junctions, signals and more.

It reads the text itself, with numpy; CARLA's client is what its tests compare it with. See
docs/formats/vector-map.md. Whoever reads a map that was made needs no reader of XML: what is listed
here is imported when it is first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from carstage.lazy import lazy_names

if TYPE_CHECKING:
    from carstage.vector_map.building import vector_map
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
    from carstage.vector_map.table import from_table, to_geojson, to_table

__all__ = [
    "Crosswalk",
    "Junction",
    "Lane",
    "Marking",
    "PaintedObject",
    "Signal",
    "SpeedLimit",
    "StopLine",
    "VectorMap",
    "from_table",
    "to_geojson",
    "to_table",
    "vector_map",
]

__getattr__ = lazy_names(
    __name__,
    {
        "building": "vector_map",
        "model": "Crosswalk Junction Lane Marking PaintedObject Signal SpeedLimit StopLine "
        "VectorMap",
        "table": "from_table to_geojson to_table",
    },
)
