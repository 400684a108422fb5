"""The navigation mesh: its bytes, and whether walkers can get everywhere on it."""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from carstage_sim.maps import Town
from carstage_sim.maps.ground import ground_height
from carstage_sim.maps.navmesh import navigation_file
from carstage_sim.maps.surfaces import KERB_HEIGHT_M
from carstage_sim.maps.walkways import Walkways

pytestmark = pytest.mark.xdist_group("town10")  # loaded once


@dataclass(frozen=True)
class ReadTile:
    points: NDArray[np.float32]
    polygons: list[list[int]]
    across: list[list[int]]
    flags: list[int]
    areas: list[int]
    details: list[list[tuple[int, int, int, int]]]


def read(data: bytes) -> ReadTile:
    """A reader of its own: offsets are written out from the format's description."""
    magic, version, tiles = struct.unpack_from("<3i", data, 0)
    assert (magic, version, tiles) == (0x4D534554, 1, 1)
    most_tiles, most_polygons = struct.unpack_from("<2i", data, 32)
    reference, size = struct.unpack_from("<Ii", data, 40)
    assert most_tiles == 1
    assert reference == most_polygons
    assert 48 + size == len(data)
    tile = data[48:]
    head = struct.unpack_from("<15i", tile, 0)
    assert head[:6] == (0x444E4156, 7, 0, 0, 0, 0)
    polygon_count, point_count, link_count, detail_count = head[6:10]
    detail_points, triangle_count, volumes, off_mesh, off_mesh_base = head[10:15]
    assert (detail_points, volumes, off_mesh, off_mesh_base) == (0, 0, 0, polygon_count)
    assert detail_count == polygon_count <= most_polygons
    at = 100
    points = np.frombuffer(tile, "<f4", 3 * point_count, at).reshape(-1, 3)
    at += 12 * point_count
    polygons, across, flags, areas = [], [], [], []
    for _ in range(polygon_count):
        row = struct.unpack_from("<I6H6HHBB", tile, at)
        count = row[14]
        polygons.append(list(row[1 : 1 + count]))
        across.append([n - 1 for n in row[7 : 7 + count]])
        flags.append(row[13])
        areas.append(row[15])
        at += 32
    assert link_count >= sum(n >= 0 for row in across for n in row)
    at += 12 * link_count
    spans = [struct.unpack_from("<IIBB", tile, at + 12 * i) for i in range(polygon_count)]
    at += 12 * polygon_count
    triangles = [tuple(tile[at + 4 * i : at + 4 * i + 4]) for i in range(triangle_count)]
    details = [triangles[base : base + count] for _, base, _, count in spans]
    assert at + 4 * triangle_count == len(tile)
    low, high = struct.unpack_from("<6f", tile, 72)[:3], struct.unpack_from("<6f", tile, 72)[3:]
    assert (points >= np.array(low)).all()
    assert (points <= np.array(high)).all()
    return ReadTile(points, polygons, across, flags, areas, details)


@pytest.fixture(scope="module", params=["stage01", "town10"])
def town(request: pytest.FixtureRequest) -> Town:
    """A town drawn with ramps, and one of CARLA's with crosswalks that end anywhere."""
    found: Town = request.getfixturevalue(request.param)
    return found


@pytest.fixture(scope="module")
def tile(town: Town) -> ReadTile:
    return read(town.navigation)


def test_polygons_are_convex_clockwise_and_small(tile):
    for polygon in tile.polygons:
        assert 3 <= len(polygon) <= 6
        corners = tile.points[polygon][:, [0, 2]].astype(np.float64)
        edges = np.roll(corners, -1, axis=0) - corners
        turns = edges[:, 0] * np.roll(edges, -1, axis=0)[:, 1]
        turns -= edges[:, 1] * np.roll(edges, -1, axis=0)[:, 0]
        assert (turns < 1e-3).all()
        assert turns.sum() < 0


def test_neighbours_know_each_other_and_share_a_whole_edge(tile):
    for i, polygon in enumerate(tile.polygons):
        for k, other in enumerate(tile.across[i]):
            if other < 0:
                continue
            a, b = polygon[k], polygon[(k + 1) % len(polygon)]
            theirs = tile.polygons[other]
            edges = [(theirs[m], theirs[(m + 1) % len(theirs)]) for m in range(len(theirs))]
            assert tile.across[other][edges.index((b, a))] == i


def test_all_of_the_surface_is_connected(tile):
    seen, todo = {0}, [0]
    while todo:
        for other in tile.across[todo.pop()]:
            if other >= 0 and other not in seen:
                seen.add(other)
                todo.append(other)
    assert len(seen) == len(tile.polygons)


def test_only_sidewalks_and_crosswalks_with_their_flags(tile, town):
    kinds = set(zip(tile.flags, tile.areas, strict=True))
    assert kinds == {(0x02, 1), (0x04, 2)}
    assert tile.flags.count(0x04) >= len(town.traffic_lights)


def test_detail_triangles_flag_exactly_the_outline(tile):
    for polygon, triangles in zip(tile.polygons, tile.details, strict=True):
        count = len(polygon)
        assert len(triangles) == count - 2
        for a, b, c, flags in triangles:
            for edge, (v, w) in enumerate(((a, b), (b, c), (c, a))):
                on_outline = (v + 1) % count == w or (w + 1) % count == v
                assert (flags >> (2 * edge)) & 3 == int(on_outline)


def test_walkers_stand_on_the_ground(tile, town):
    height = ground_height(town)
    corners = [tile.points[polygon].astype(np.float64).mean(axis=0) for polygon in tile.polygons]
    middles = np.array(corners)
    off = np.abs(height(middles[:, [0, 2]]) - middles[:, 1])
    on_crosswalk = np.array(tile.flags) == 0x04
    assert off[~on_crosswalk].max() < 0.02
    # Where a crosswalk has no ramp, walkers step up just before the kerb.
    assert off[on_crosswalk].max() < (0.02 if town.name == "Stage01" else KERB_HEIGHT_M)


def test_walkways_keep_clear_of_trees_and_poles(tile, town):
    mesh = town.static_mesh
    low = mesh.vertices[mesh.triangles][:, :, 2].min(axis=1) < 0.3
    prefixes = ("Tree", "StreetLamp", "SpeedLimit", "Hydrant", "Bin")
    things = [site.location[:2] for site in town.traffic_lights]
    for entry in town.level_objects:
        if entry.name.startswith(prefixes):
            foot = mesh.vertices[mesh.triangles[low & (mesh.object_id == entry.object_id)]]
            things.append(tuple(foot.reshape(-1, 3).mean(axis=0)[:2]))
    places = tile.points[:, [0, 2]].astype(np.float64)
    walked = shapely.union_all([shapely.Polygon(places[polygon]) for polygon in tile.polygons])
    assert shapely.distance(walked, shapely.points(things)).min() > 0.3


def test_too_many_points_for_a_tile_are_refused():
    walk = Walkways(np.zeros((0x10000, 3)), ((0, 1, 2),), (False,))
    with pytest.raises(ValueError, match="do not fit"):
        navigation_file(walk)
