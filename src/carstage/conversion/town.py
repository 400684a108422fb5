"""The vector map of an episode's town, made once per town and kept in the cache folder."""

from __future__ import annotations

import hashlib
import json
import tempfile
from dataclasses import dataclass
from pathlib import Path

from carstage import __version__
from carstage.cache import cache_folder, keep_in_cache
from carstage.errors import ConversionError, VectorMapError
from carstage.files.hashing import hash_of
from carstage.geometry import GeoFrame
from carstage.rawlog.reader import EpisodeLog

_SOURCES = ("vector_map", "geometry", "dataset/tables.py", "conversion/town.py")
"""What a map is made by, below the package's folder."""


@dataclass(frozen=True, slots=True)
class Town:
    """What became of a town's OpenDRIVE text.

    Attributes:
        content: the vector map's file; None: the text has no road, or there is a problem.
        problem: why no map could be made.
    """

    content: bytes | None = None
    problem: str | None = None


def make_vector_map(raw_folder: Path) -> Town:
    """The vector map of the town that a raw log names, for the pool of processes.

    A text that no map can be made of costs the map, not the recording.

    Raises:
        RawLogError: the raw log is damaged.
        ConversionError: it does not say where its town lies.
    """
    log = EpisodeLog(raw_folder)
    try:
        frame = GeoFrame.from_json(log.header["geo_reference"])
    except (KeyError, TypeError, ValueError) as error:
        raise ConversionError(
            f"{raw_folder} does not say how its town lies on the globe: {error!r}.",
            "Record the episode again.",
        ) from error
    opendrive = log.opendrive()
    if opendrive is None:
        return Town()
    kept = _place_in_cache(opendrive, log.header["geo_reference"])
    content = _read_kept(kept)
    if content is not None:
        return Town(content)
    town = _made(opendrive, frame)
    if town.content is not None:
        keep_in_cache(kept, b"%s\n%s" % (hash_of(town.content).encode(), town.content))
    return town


def _made(opendrive: bytes, frame: GeoFrame) -> Town:
    # Only the first episode of a town needs them: not loaded with the pool's libraries.
    from carstage.dataset.tables import write_table
    from carstage.vector_map import to_table, vector_map
    from carstage.vector_map.table import GEO_KEY

    try:
        town = vector_map(opendrive)
    except VectorMapError as error:
        return Town(problem=str(error))
    if not town.lanes:
        return Town()
    with tempfile.TemporaryDirectory(prefix="carstage-") as folder:
        path = Path(folder) / "map.parquet"
        write_table(to_table(town, frame), path, keep=(GEO_KEY,))
        return Town(path.read_bytes())


def _place_in_cache(opendrive: bytes, geo_reference: object) -> Path:
    """Where a town's map is kept: named by all that it is made of, the code included."""
    import pyarrow as pa

    digest = hashlib.sha256(f"{__version__} {pa.__version__}".encode())
    package = Path(__file__).parents[1]
    for source in _SOURCES:
        place = package / source
        for file in [place] if place.is_file() else sorted(place.glob("*.py")):
            digest.update(f"{file.name} {file.stat().st_size}\n".encode() + file.read_bytes())
    digest.update(json.dumps(geo_reference, sort_keys=True).encode())
    digest.update(hash_of(opendrive).encode())
    return cache_folder() / "vector-maps" / f"{digest.hexdigest()[:32]}.map"


def _read_kept(path: Path) -> bytes | None:
    """A map as it was made, without the hash before it; None: it is not there, or damaged."""
    try:
        named, _, content = path.read_bytes().partition(b"\n")
    except OSError:
        return None
    return content if named == hash_of(content).encode() else None
