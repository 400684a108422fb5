"""Crosswalks that were not drawn to fit the sidewalks lead from path to path, or nowhere."""

from __future__ import annotations

import pytest
import shapely

from carstage_sim.maps.crossings import crossings

ROAD = shapely.box(-50.0, -5.0, 50.0, 5.0)
SIDEWALKS = shapely.union_all([shapely.box(-50.0, y, 50.0, y + 2.0) for y in (-7.0, 5.0)])
PATHS = shapely.union_all([shapely.box(-50.0, y, 50.0, y + 0.6) for y in (-6.7, 6.1)])


def ways(*crosswalks: shapely.Polygon, paths: shapely.Geometry = PATHS) -> list[shapely.Geometry]:
    found = crossings(crosswalks, road=ROAD, paved=ROAD.union(SIDEWALKS), paths=paths)
    return [shapely.union(way.on_road, way.to_paths) for way in found]


@pytest.mark.parametrize("short_m", [0.0, 0.6, 3.0])
def test_crosswalk_that_ends_before_the_kerb_is_linked_with_both_paths(short_m: float) -> None:
    (way,) = ways(shapely.box(-1.5, -5.0 + short_m, 1.5, 5.0 - short_m))
    assert shapely.get_num_geometries(way) == 1
    assert all(path.intersects(way) for path in shapely.get_parts(PATHS))


def test_parts_on_the_road_and_on_the_sidewalks_meet_at_the_kerb() -> None:
    (found,) = crossings(
        [shapely.box(-1.5, -4.0, 1.5, 4.0)], road=ROAD, paved=ROAD.union(SIDEWALKS), paths=PATHS
    )
    assert ROAD.buffer(0.01).contains(found.on_road)
    assert found.to_paths.intersection(ROAD).area == pytest.approx(0.0)
    assert found.on_road.intersection(found.to_paths).length > 2.0


def test_crosswalk_that_runs_beyond_the_sidewalk_is_cut_off_there() -> None:
    (way,) = ways(shapely.box(-1.5, -12.0, 1.5, 5.0))
    assert ROAD.union(SIDEWALKS).buffer(0.2).contains(way)


@pytest.mark.parametrize(
    "misplaced",
    [
        shapely.box(-1.5, -4.0, 1.5, 0.0),  # ends in the middle of the road
        shapely.box(-8.0, -4.0, 8.0, -1.0),  # runs along the road
        shapely.box(80.0, -5.0, 83.0, 5.0),  # where no road is
    ],
)
def test_crosswalk_that_leads_nowhere_is_none(misplaced: shapely.Polygon) -> None:
    assert ways(misplaced) == []


def test_without_paths_there_are_no_crossings() -> None:
    assert ways(shapely.box(-1.5, -5.0, 1.5, 5.0), paths=shapely.Polygon()) == []
