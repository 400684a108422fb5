"""The ground: no holes, no doubles, no cracks, the right names."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps import Town
from carstage_sim.maps.drape import Drape
from carstage_sim.maps.ground import ground_height
from carstage_sim.maps.ground_mesh import LevelSurface
from carstage_sim.maps.partition import partition
from carstage_sim.maps.strips import LaneMark, Strip
from carstage_sim.maps.surfaces import Layer
from carstage_sim.mesh import Material, TriangleMesh

ROADS, ROAD_LINES = CityObjectLabel.ROADS, CityObjectLabel.ROAD_LINES
SIDEWALKS = CityObjectLabel.SIDEWALKS


@pytest.fixture(scope="module")
def ground(stage01: Town) -> TriangleMesh:
    mesh = stage01.static_mesh
    rows = (mesh.object_id == 0) & (mesh.tag != CityObjectLabel.VEGETATION)  # tufts and hills
    return TriangleMesh(
        mesh.vertices,
        mesh.triangles[rows],
        mesh.normals[rows],
        mesh.material[rows],
        mesh.tag[rows],
        mesh.object_id[rows],
    )


def straight_lane(length_m: float, rise_m: float = 0.0, y_m: float = 0.0) -> Strip:
    """A lane along x that climbs evenly."""
    x = np.linspace(0.0, length_m, int(length_m) + 1)
    none = (LaneMark("NONE", False, 0.15),) * int(length_m)
    return Strip(
        kind="driving", road_id=1, section_id=0, lane_id=-1, junction_id=-1, level=0,
        center=np.stack([x, np.full_like(x, y_m)], axis=1), z_m=rise_m * x / length_m,
        yaw_deg=np.zeros_like(x), width_m=np.full_like(x, 3.5), station=np.arange(len(x)),
        inner=none, outer=none,
    )  # fmt: skip


def hits(mesh: TriangleMesh, points: np.ndarray) -> list[list[int]]:
    """Flat triangles above each point."""
    corners = mesh.vertices[mesh.triangles].astype(np.float64)[..., :2]
    flat = np.abs(mesh.normals[:, 0, 2]) > 0.5
    found = []
    for x, y in points:
        near = flat & (corners.min(axis=1) <= (x, y)).all(axis=1)
        rows = np.flatnonzero(near & (corners.max(axis=1) >= (x, y)).all(axis=1))
        a, b, c = corners[rows, 0], corners[rows, 1], corners[rows, 2]
        sides = [
            (q[:, 0] - p[:, 0]) * (y - p[:, 1]) - (q[:, 1] - p[:, 1]) * (x - p[:, 0])
            for p, q in ((a, b), (b, c), (c, a))
        ]
        inside = np.all(np.array(sides) >= 0, axis=0) | np.all(np.array(sides) <= 0, axis=0)
        found.append([int(row) for row in rows[inside]])
    return found


def test_a_ray_from_above_meets_the_ground_exactly_once(ground):
    points = np.random.default_rng(5).uniform((-230, -160), (230, 160), (600, 2))
    counts = Counter(len(found) for found in hits(ground, points))
    assert counts == {1: 600}


def test_the_surface_has_no_cracks(ground):
    places = np.rint(ground.vertices.astype(np.float64) * 1e4).astype(np.int64)
    _, weld = np.unique(places, axis=0, return_inverse=True)
    corners = weld.reshape(-1)[ground.triangles]
    edges = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2))
    unique, first, count = np.unique(edges, axis=0, return_index=True, return_counts=True)
    open_edges = first[count % 2 == 1]
    ends = ground.vertices[ground.triangles].reshape(-1, 3)[open_edges]
    corners = ground.vertices[ground.triangles]
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    border = (np.abs(ends[:, :2] - low[:2]) < 1e-3) | (np.abs(ends[:, :2] - high[:2]) < 1e-3)
    assert border.any(axis=1).all()
    assert len(unique) > 1000


def test_every_driving_lane_is_road_at_height_zero(stage01, ground):
    points = stage01.lanes.location[::40, :2] + 0.013
    for found in hits(ground, points):
        assert ground.tag[found[0]] in (ROADS, ROAD_LINES)
    assert np.abs(ground_height(stage01)(points)).max() < 1e-6


def test_junctions_are_filled(stage01, ground):
    for junction in np.unique(stage01.lanes.junction_id):
        if junction == -1:
            continue
        rows = stage01.lanes.junction_id == junction
        center = np.median(stage01.lanes.location[rows, :2], axis=0)
        around = center + np.random.default_rng(1).uniform(-5.0, 5.0, (30, 2))
        assert {int(ground.tag[f[0]]) for f in hits(ground, around)} <= {ROADS, ROAD_LINES}


def test_the_kerb_is_a_step_and_crosswalks_have_ramps(stage01):
    height = ground_height(stage01)
    outline = _crosswalks(stage01)[0]
    corners = outline[:4]
    middle = corners.mean(axis=0)
    sides = [(corners[i] + corners[(i + 1) % 4]) / 2 for i in range(4)]
    ends = max(((sides[0], sides[2]), (sides[1], sides[3])), key=lambda s: np.ptp(s, axis=0).max())
    for end in ends:
        outward = (end - middle) / np.linalg.norm(end - middle)
        run = np.array([end + outward * d for d in (-0.5, 0.01, 0.6, 1.19, 1.6)])
        heights = height(run)
        assert heights == pytest.approx([0.0, 0.001, 0.075, 0.149, 0.15], abs=0.003)


def _crosswalks(town: Town) -> list[np.ndarray]:
    import carla

    points = carla.Map(town.name, town.opendrive).get_crosswalks()
    corners = np.array([(p.x, p.y) for p in points])
    return [corners[i : i + 5] for i in range(0, len(corners), 5)]


def test_tags_and_materials_go_together(ground):
    pairs = set(zip(ground.tag.tolist(), ground.material.tolist(), strict=True))
    assert (ROADS, Material.ASPHALT) in pairs
    assert (SIDEWALKS, Material.KERB) in pairs
    paint = {Material.LANE_MARKING_WHITE, Material.LANE_MARKING_YELLOW, Material.CROSSWALK_WHITE}
    assert {material for tag, material in pairs if tag == ROAD_LINES} == paint
    assert {tag for tag, material in pairs if material in paint} == {ROAD_LINES}


def test_the_terrain_reaches_far_beyond_the_town(stage01, ground):
    low, high = ground.bounds
    streets = stage01.lanes.location[:, :2]
    assert (low[:2] < streets.min(axis=0) - 200.0).all()
    assert (high[:2] > streets.max(axis=0) + 200.0).all()


boxes = st.lists(
    st.tuples(st.integers(0, 40), st.integers(0, 40), st.integers(1, 25), st.integers(1, 25)),
    min_size=1,
    max_size=6,
)


@settings(max_examples=40, deadline=None)
@given(boxes)
def test_a_partition_covers_the_union_once_and_the_first_area_wins(specs):
    areas = [shapely.box(x, y, x + w, y + h) for x, y, w, h in specs]
    plan = partition(areas, tile_m=17.0)
    corners = plan.points[plan.triangles]
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    size = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    assert (size > 0).all()
    above = shapely.Polygon()
    for index, area in enumerate(areas):
        shown = area.difference(above)
        assert size[plan.area == index].sum() == pytest.approx(shown.area, abs=1e-6)
        above = above.union(area)


def test_layers_of_different_height_are_joined_by_a_wall():
    upper = shapely.box(2, 2, 4, 4)
    mesh = LevelSurface(
        [
            Layer(upper, Material.SIDEWALK, SIDEWALKS, 0.15),
            Layer(shapely.box(0, 0, 6, 6), Material.ASPHALT, ROADS, 0.0),
        ],
        Drape([straight_lane(length_m=6.0)]),
    ).mesh
    vertical = np.abs(mesh.normals[:, 0, 2]) < 1e-6
    corners = mesh.vertices[mesh.triangles[vertical]].astype(np.float64)
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    ).sum()
    assert area / 2 == pytest.approx(upper.exterior.length * 0.15, rel=1e-5)
    assert set(mesh.material[vertical]) == {Material.KERB}


def test_ground_height_takes_places_anywhere(stage01):
    height = ground_height(stage01)
    assert height(np.zeros((0, 2))).shape == (0,)
    # On a lane with any z, far out on the terrain, beyond the world's edge.
    lane = stage01.lanes.location[0]
    places = np.array([[lane[0], lane[1], 7.0], [-450.0, 0.0, 0.0], [5000.0, 0.0, 0.0]])
    assert height(places) == pytest.approx([0.0, 0.15, 0.0], abs=1e-6)
