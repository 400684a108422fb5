"""Sensors agree with each other to the pixel: one scene, one geometry, many outputs."""

from __future__ import annotations

import numpy as np
import pytest
from shapely import MultiPoint, contains_xy

from carstage_sim.geometry import pose_matrix, rotation_matrix
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material
from carstage_sim.render.cast import NOTHING
from carstage_sim.render.caster import RayCaster
from carstage_sim.render.normals import smooth_normals
from carstage_sim.sensors import WorldSensors
from carstage_sim.sensors.view import Camera, pixel_rays
from carstage_sim.world.blueprints import catalogue
from sensor_worlds import GROUND, WALL, box, request, state, town

pytestmark = pytest.mark.xdist_group("kernels")

_WIDTH, _HEIGHT, _FOV = 160, 120, 90.0
_FOCAL = _WIDTH / 2.0
_BLOCK = box((6.0, -5.0, 0.0), (7.5, -3.0, 1.5), Material.CONCRETE, CityObjectLabel.STATIC, 6)
_CARS = [(40, (7.0, 1.5, 0.0), 30.0), (41, (8.5, -1.0, 0.0), 100.0)]
_EYE, _TURN = (0.0, 0.0, 1.8), (-6.0, 3.0, 2.0)


@pytest.fixture(scope="module")
def sensors():
    with WorldSensors(town(GROUND, WALL, _BLOCK), threads=2) as made:
        yield made


def camera(kind, sensor_id, location=_EYE, rotation=_TURN, **attributes):
    return request(
        f"camera.{kind}", sensor_id, location=location, rotation_deg=rotation,
        image_size_x=_WIDTH, image_size_y=_HEIGHT, fov=_FOV, **attributes,
    )  # fmt: skip


def frames(sensors, world, *requests):
    return [frame for _, frame in sensors.capture(world, list(requests))]


def metres(frame):
    code = frame.pixels.astype(np.int64)
    return (code[..., 2] + 256 * code[..., 1] + 65536 * code[..., 0]) / (2**24 - 1) * 1000.0


def project(points, location, rotation):
    """Column, row (pixel centres at .5) and depth of world points."""
    local = (points - np.asarray(location)) @ rotation_matrix(rotation)
    column = _WIDTH / 2 + _FOCAL * local[:, 1] / local[:, 0]
    return column, _HEIGHT / 2 - _FOCAL * local[:, 2] / local[:, 0], local[:, 0]


def unproject(column, row, depth, location, rotation):
    right, up = (column - _WIDTH / 2) / _FOCAL, -(row - _HEIGHT / 2) / _FOCAL
    local = np.stack([depth, depth * right, depth * up], axis=-1)
    return local @ rotation_matrix(rotation).T + np.asarray(location)


def interpolated(values, column, row):
    """Values between the four pixel centres around each place."""
    x, y = column - 0.5, row - 0.5
    i, j = np.floor(y).astype(int), np.floor(x).astype(int)
    a, b = y - i, x - j
    top = values[i, j] * (1 - b) + values[i, j + 1] * b
    return top * (1 - a) + (values[i + 1, j] * (1 - b) + values[i + 1, j + 1] * b) * a


def inside(column, row, edge=2.0):
    return (column > edge) & (column < _WIDTH - edge) & (row > edge) & (row < _HEIGHT - edge)


def test_lidar_hits_lie_on_the_back_projected_depth(sensors):
    world = state(1)
    laser = request(
        "lidar.ray_cast_semantic", 300, location=_EYE, rotation_deg=_TURN, channels=32, range=80,
        points_per_second=100000, rotation_frequency=10, upper_fov=20, lower_fov=-40,
    )  # fmt: skip
    depth, points = frames(sensors, world, camera("depth", 301), laser)
    local = np.stack([points.points[axis] for axis in "xyz"], axis=-1).astype(np.float64)
    found = local @ rotation_matrix(_TURN).T + np.asarray(_EYE)
    ahead = local[:, 0] > 0.5
    column, row, forward = project(found[ahead], _EYE, _TURN)
    shown = inside(column, row)
    column, row, forward = column[shown], row[shown], forward[shown]
    # The inverse of depth is linear on a plane; pixels on two surfaces are left out.
    inverse = 1.0 / metres(depth)
    bend = np.abs(np.diff(inverse, 2, axis=0))[:, 1:-1] + np.abs(np.diff(inverse, 2, axis=1))[1:-1]
    i, j = np.floor(row - 0.5).astype(int), np.floor(column - 0.5).astype(int)
    bent = np.pad(bend, 1, constant_values=1.0)
    flat = np.max([bent[i + a, j + b] for a in (0, 1) for b in (0, 1)], axis=0) < 1e-5
    assert flat.sum() > 1000
    seen = 1.0 / interpolated(inverse, column, row)
    assert np.abs(seen - forward)[flat].max() < 2e-3 * forward[flat].max()
    assert np.median(np.abs(seen - forward)[flat]) < 1e-3


def test_instances_cover_exactly_the_mask_of_their_class(sensors):
    tags, instances = frames(
        sensors, state(1, vehicles=_CARS), camera("semantic_segmentation", 310),
        camera("instance_segmentation", 311),
    )  # fmt: skip
    assert np.array_equal(tags.pixels[..., 2], instances.pixels[..., 2])
    ids = instances.pixels[..., 1].astype(int) + 256 * instances.pixels[..., 0].astype(int)
    cars = tags.pixels[..., 2] == CityObjectLabel.CAR
    assert cars.sum() > 500
    assert set(np.unique(ids[cars])) == {40, 41}
    assert np.array_equal(cars, np.isin(ids, (40, 41)))


def test_pixels_of_a_car_lie_in_the_hull_of_its_box(sensors):
    (instances,) = frames(sensors, state(1, vehicles=_CARS), camera("instance_segmentation", 320))
    shape = catalogue()["vehicle.tesla.model3"]
    corner = np.array([[(k >> axis) & 1 for axis in range(3)] for k in range(8)]) * 2.0 - 1.0
    corner = corner * shape.box_extent + shape.box_center
    for actor_id, place, yaw in _CARS:
        matrix = pose_matrix(np.array(place), np.array([0.0, yaw, 0.0]))
        column, row, _ = project(corner @ matrix[:3, :3].T + matrix[:3, 3], _EYE, _TURN)
        hull = MultiPoint(np.stack([column, row], axis=1)).convex_hull.buffer(0.51)
        rows, columns = np.nonzero(instances.pixels[..., 1] == actor_id)
        assert len(rows) > 200
        assert contains_xy(hull, columns + 0.5, rows + 0.5).all()


@pytest.mark.parametrize("lens", [{}, {"lens_circle_multiplier": 2.0}])
def test_flow_leads_back_to_where_each_point_was(sensors, lens):
    """Half a pixel in the median, on static and on moving pixels, with a lens too."""
    sensors.reset()
    moved = [(i, (x + 0.25, y + 0.1, z), yaw + 4.0) for i, (x, y, z), yaw in _CARS]
    eye, turn = (0.3, 0.1, 1.85), (-5.0, 4.0, 1.0)
    requests = [camera(kind, n) for n, kind in ((330, "depth"), (331, "instance_segmentation"))]
    depth, _ = frames(sensors, state(1, vehicles=_CARS), *requests)
    frames(sensors, state(2, vehicles=_CARS), camera("optical_flow", 332, **lens))
    later = [
        camera(kind, n, eye, turn, **lens)
        for n, kind in ((332, "optical_flow"), (333, "depth"), (334, "instance_segmentation"))
    ]
    flow, depth_now, ids_now = frames(sensors, state(3, vehicles=moved), *later)
    row, column = np.indices((_HEIGHT, _WIDTH)).reshape(2, -1) + 0.5
    ids = ids_now.pixels[..., 1].reshape(-1)
    view = Camera(_WIDTH, _HEIGHT, _FOV, eye, turn, 0, _lens(lens))
    seen = pixel_rays(view).astype(np.float64) * metres(depth_now).reshape(-1, 1) + eye
    before_column = column - flow.flow[..., 0].reshape(-1) * _WIDTH / 2
    before_row = row + flow.flow[..., 1].reshape(-1) * _HEIGHT / 2
    truth = seen.copy()
    for (actor_id, place, yaw), (_, now, yaw_now) in zip(_CARS, moved, strict=True):
        mine = ids == actor_id
        back = rotation_matrix([0.0, yaw, 0.0]) @ rotation_matrix([0.0, yaw_now, 0.0]).T
        truth[mine] = (seen[mine] - now) @ back.T + place
    true_column, true_row, forward = project(truth, _EYE, _TURN)
    if lens:
        x, y = _lens(lens).distorted(true_column / _WIDTH * 2 - 1, true_row / _HEIGHT * 2 - 1)
        true_column, true_row = (x + 1) * _WIDTH / 2, (y + 1) * _HEIGHT / 2
    near = (metres(depth_now).reshape(-1) < 900.0) & (forward > 0.1)
    off = np.hypot(true_column - before_column, true_row - before_row)
    moving = np.isin(ids, (40, 41))
    assert np.median(off[near & ~moving]) < 0.05
    assert moving.sum() > 500
    assert np.median(off[near & moving]) < 0.05
    if not lens:
        # What the earlier picture shows there is the same point, where nothing has covered it.
        kept = near & inside(before_column, before_row)
        there = interpolated(metres(depth), before_column[kept], before_row[kept])
        place = unproject(before_column[kept], before_row[kept], there, _EYE, _TURN)
        u, v, _ = project(place, _EYE, _TURN)
        w, h, _ = project(truth[kept], _EYE, _TURN)
        apart = np.linalg.norm(place - truth[kept], axis=1) / truth[kept, 0]
        assert np.median(np.hypot(u - w, v - h)) < 0.5
        assert np.median(apart) < 0.01


def _lens(attributes):
    from carstage_sim.sensors.lens import Lens

    return Lens.of({name: str(value) for name, value in attributes.items()})


def test_normals_are_unit_vectors_that_face_the_camera(sensors):
    frame = sensors.frame_of(state(1, vehicles=_CARS))
    caster = RayCaster(1)
    rays = pixel_rays(Camera(_WIDTH, _HEIGHT, _FOV, _EYE, _TURN, 0))
    hits = caster.cast(frame.scene, np.asarray(_EYE), rays, low=0.1, high=1000.0)
    normals = smooth_normals(caster, frame, hits)
    met = hits.row != NOTHING
    assert np.abs(np.linalg.norm(normals[met], axis=1) - 1.0).max() < 1e-5
    assert (normals[met] * rays[met]).sum(axis=1).max() < 0.0
    assert not normals[~met].any()


def test_all_cameras_have_the_same_bytes_with_any_number_of_threads(sensors):
    kinds = (
        "rgb", "depth", "semantic_segmentation", "instance_segmentation", "normals", "optical_flow"
    )  # fmt: skip
    requests = [camera(kind, 350 + n) for n, kind in enumerate(kinds)]

    def content(of):
        taken = frames(of, state(1, vehicles=_CARS), *requests)
        return [getattr(frame, "pixels", getattr(frame, "flow", None)).tobytes() for frame in taken]

    sensors.reset()
    many = content(sensors)
    with WorldSensors(town(GROUND, WALL, _BLOCK), threads=1) as alone:
        assert content(alone) == many
