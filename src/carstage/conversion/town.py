"""The vector map of an episode's town, made once per town while a run goes on."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

from carstage.errors import ConversionError, VectorMapError
from carstage.geometry import GeoFrame
from carstage.rawlog.reader import EpisodeLog


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
    # Only the first episode of a town needs them: not loaded with the pool's libraries.
    from carstage.dataset.tables import write_table
    from carstage.vector_map import to_table, vector_map
    from carstage.vector_map.table import GEO_KEY

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
