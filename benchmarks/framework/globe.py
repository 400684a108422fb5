"""Places in degrees, back to world metres: does all that a dataset says of them agree?

In each town and for each version of CARLA a few frames are recorded and exported. GNSS files,
``ego.parquet``, KITTI's ``oxts`` and MCAP's fixes are converted back by the server's projection,
which stands here a second time, from its formula in docs/conventions.md.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.framework.recorded import record
from carstage import Dataset
from carstage.bench.verdict import Figure, Verdict
from carstage.exporters import export_dataset
from carstage.releases import KNOWN

TOWNS = ("Stage01", "Stage02", "Stage03")
VERSIONS = tuple(str(release) for release in KNOWN)
TARGET_M = 0.01
_EARTH_M = 6_378_137.0
_CONFIG = {
    "duration_s": 0.3,
    "fps": 10,
    "vehicles": {"count": 0},
    "pedestrians": {"count": 0},
    "image_size": [64, 36],
    "timing": {"warmup_ticks": 3},
    "conversion": {"workers": 1},
    "rig": {
        "sensors": [
            {"id": "CAM", "kind": "rgb", "pose": {"x": 0.5, "z": 1.7}},
            {"id": "LIDAR", "kind": "lidar", "pose": {"z": 2.0}, "attributes": {"channels": 4}},
            {"id": "GNSS", "kind": "gnss", "pose": {"x": 1.0, "y": 0.5, "z": 1.6}},
        ]
    },
}

Place = tuple[float, float, float]


def world_place(degrees: Place, reference: Mapping[str, Any], north: str) -> Place:
    """World metres of latitude, longitude (deg) and altitude (m).

    Args:
        degrees: the position.
        reference: ``geo_reference`` of the episode.
        north: ``-y`` or ``+y``.
    """
    latitude, longitude = math.radians(degrees[0]), math.radians(degrees[1])
    latitude_0 = math.radians(reference["latitude_deg"])
    turned = longitude - math.radians(reference["longitude_deg"])
    if reference["projection"] == "transverse_mercator":
        scale = 0.9996 * _EARTH_M
        x = scale * math.atanh(math.cos(latitude) * math.sin(turned))
        up = scale * (math.atan2(math.tan(latitude), math.cos(turned)) - latitude_0)
    else:
        scale = _EARTH_M * math.cos(latitude_0)
        x = scale * turned
        up = scale * (_stretched(latitude) - _stretched(latitude_0))
    return x, up if north == "+y" else -up, degrees[2] - reference["altitude_m"]


def _stretched(latitude: float) -> float:
    return math.log(math.tan(math.pi / 4 + latitude / 2))


def _differences_m(dataset: Path, exports: Path) -> Iterator[tuple[str, float]]:
    """Source and distance from where the snapshots have ego and sensor, for each frame."""
    episode = Dataset(dataset).episodes[0]
    reference = episode.document["geo_reference"]
    ego = episode.ego().to_pylist()
    sensors = episode.sensor_poses().to_pylist()
    antenna = [row["location"] for row in sensors if row["sensor_id"] == "GNSS"]
    readings = episode.sensor("GNSS").table.to_pylist()
    for row, read, place in zip(ego, readings, antenna, strict=True):
        yield "ego_parquet", _off(_degrees(row), reference, "-y", row["location"])
        yield "gnss", _off(_degrees(read), reference, reference["gnss_north"], place)
    (oxts,) = (exports / "kitti-tracking").glob("training/oxts/*.txt")
    for line, row in zip(oxts.read_text().splitlines(), ego, strict=True):
        latitude, longitude, altitude = map(float, line.split()[:3])
        yield "oxts", _off((latitude, longitude, altitude), reference, "-y", row["location"])
    for fix, place in zip(_fixes(exports / "mcap"), antenna, strict=True):
        yield "mcap", _off(fix, reference, "-y", place)


def _degrees(row: Mapping[str, Any]) -> Place:
    return row["latitude_deg"], row["longitude_deg"], row["altitude_m"]


def _off(degrees: Place, reference: Mapping[str, Any], north: str, place: Sequence[float]) -> float:
    return float(np.linalg.norm(np.subtract(world_place(degrees, reference, north), place)))


def _fixes(folder: Path) -> Iterator[Place]:
    """The fixes of the one MCAP file."""
    from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
    from mcap.reader import make_reader

    (path,) = folder.glob("*.mcap")
    with path.open("rb") as file:
        for _, _, message in make_reader(file).iter_messages(topics=["/GNSS/fix"]):
            fix = LocationFix.FromString(message.data)
            yield fix.latitude, fix.longitude, fix.altitude


def measure_globe(
    towns: Sequence[str] = TOWNS,
    versions: Sequence[str] = VERSIONS,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Verdict:
    """Record each town with each version, and convert every position back.

    Args:
        towns: names of built-in towns.
        versions: of CARLA; the client wheel of each must be installed.
        progress: called with the recordings done and their total number.
    """
    worst: dict[str, float] = {}
    compared = 0
    pairs = [(town, version) for town in towns for version in versions]
    with tempfile.TemporaryDirectory(prefix="carstage-globe-") as scratch:
        for number, (town, version) in enumerate(pairs, start=1):
            folder = Path(scratch) / f"{town}-{version}"
            (folder / "exports").mkdir(parents=True)
            server = {"kind": "embedded", "carla_version": version}
            dataset = record({**_CONFIG, "map": town, "server": server}, folder)
            for name in ("kitti-tracking", "mcap"):
                export_dataset(name, dataset, folder / "exports" / name, workers=0)
            for source, off_m in _differences_m(dataset, folder / "exports"):
                worst[source] = max(worst.get(source, 0.0), off_m)
                compared += 1
            progress(number, len(pairs))
    return Verdict(
        "globe",
        (
            Figure("recordings", len(pairs), ">=", 1),
            Figure("positions_compared", compared, ">=", 12 * len(pairs)),
            *(
                Figure(f"largest_error_of_{source}_m", off_m, "<=", TARGET_M)
                for source, off_m in sorted(worst.items())
            ),
        ),
    )
