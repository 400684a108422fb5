"""A town of one name has one mesh: a library that may draw another is refused, not used."""

from __future__ import annotations

from pathlib import Path

import pytest
import shapely

from carstage_sim.maps import MapCatalogue, MapSamplingError


def test_an_unknown_geometry_library_is_refused_with_the_way_out(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(shapely, "geos_version", (3, 15, 0))
    with pytest.raises(
        MapSamplingError, match=r"GEOS 3\.13\.1 and 3\.14\.1.* has 3\.15\.0"
    ) as caught:
        MapCatalogue(cache_folder=tmp_path).load("Stage01")
    assert "pip install 'shapely>=2.1,<2.3'" in str(caught.value)
    assert not list(tmp_path.iterdir())
