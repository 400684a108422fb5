"""Pictures on a board and on a house in a small scene: seen where they are, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from carstage_sim.content.props import prop_mesh
from carstage_sim.geometry import rotation_matrix
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, TriangleMesh, build_mesh, merge_meshes
from carstage_sim.render.caster import Hits, RayCaster
from carstage_sim.render.picture import Picture, PictureMaker
from carstage_sim.render.scene import Frame, Placement, SceneStore
from carstage_sim.sensors.view import Camera, pixel_rays
from carstage_sim.world.pictures import PlacedPicture
from carstage_sim.world.state import Weather
from carstage_sim.world.town_changes import TownChanges
from ray_scenes import turned_box

pytestmark = pytest.mark.xdist_group("kernels")

WIDTH, HEIGHT, FOV_DEG = 128, 72, 70.0
EYE = (-6.0, 0.0, 1.5)
BOARD = 7
EXTENT = (0.6, 1.2, 0.01)
CLOUDS = Weather(sun_altitude_angle=60.0, cloudiness=100.0)


def town() -> TriangleMesh:
    """Ground, and a house (object 1) to the right."""
    corners = np.array([[-60, -60, 0], [60, -60, 0], [60, 60, 0], [-60, 60, 0]], float)
    ground = build_mesh(corners, [[0, 1, 2], [0, 2, 3]], Material.DEFAULT, CityObjectLabel.ROADS)
    box = turned_box((4.0, 4.0, 4.0))
    house = build_mesh(
        box.vertices + np.array([6.0, 5.0, 2.0]), box.triangles, Material.PLASTER,
        CityObjectLabel.BUILDINGS, object_id=1,
    )  # fmt: skip
    return merge_meshes([ground, house])


def quarters() -> np.ndarray:
    """Red top left, green top right, blue bottom left, white bottom right."""
    made = np.zeros((32, 64, 3), np.float32)
    made[16:, :32, 0], made[16:, 32:, 1] = 0.8, 0.8
    made[:16, :32, 2], made[:16, 32:] = 0.8, 0.8
    return made


def frame_with(board: np.ndarray | None, house: np.ndarray | None = None) -> Frame:
    """The board stands 6 m ahead, its front towards the camera."""
    on_house, on_board = [], []
    if house is not None:
        on_house = [PlacedPicture(house, (6.0, 5.0, 2.0), np.eye(3), (2.0, 2.0, 2.0))]
    if board is not None:
        on_board = [PlacedPicture(board, (0.0, 0.0, EXTENT[2]), np.eye(3), EXTENT)]
    changes = TownChanges(
        placed_pictures=(*on_house, *on_board),
        paint=dict.fromkeys(range(1, 1 + len(on_house)), (0.0, 0.0, 0.0)),
        picture_rows={1: 0} if on_house else {},
    )
    plank = prop_mesh("static.prop.ironplank", EXTENT)
    if board is not None:
        plank = replace(
            plank,
            material=np.full_like(plank.material, int(Material.PICTURE)),
            object_id=np.full_like(plank.object_id, len(on_house)),
        )
    store = SceneStore(town(), {"plank": plank}.__getitem__, cache=None)
    pose = rotation_matrix((90.0, 0.0, 0.0))
    return store.frame([Placement(BOARD, "plank", np.array([0.0, 0.0, 1.2]), pose)], changes)


def painted(frame: Frame, weather: Weather = CLOUDS) -> tuple[np.ndarray, Hits]:
    camera = Camera(WIDTH, HEIGHT, FOV_DEG, EYE, (0.0, 0.0, 0.0), 0)
    caster = RayCaster(1)
    maker = PictureMaker(caster)
    hits = caster.cast(frame.scene, np.asarray(EYE), pixel_rays(camera), low=0.1, high=1000.0)
    turn = rotation_matrix((0.0, 0.0, 0.0))
    picture = Picture(WIDTH, HEIGHT, FOV_DEG, turn, hits, -1, 0.1, 1000.0)
    codes = maker.paint(frame, picture, maker.sky.lighting(weather, 0.0))
    caster.close()
    return codes.astype(int), hits


def grown(mask: np.ndarray, px: int) -> np.ndarray:
    for axis in (0, 1):
        mask = np.any([np.roll(mask, by, axis) for by in range(-px, px + 1)], axis=0)
    return mask


def test_a_board_shows_its_picture_upright_and_nothing_else_changes():
    shown, hits = painted(frame_with(quarters()))
    plain, _ = painted(frame_with(np.full((32, 64, 3), 0.5, np.float32)))
    board = (hits.row == 0).reshape(HEIGHT, WIDTH)
    rows, columns = np.nonzero(board)
    top, bottom, left, right = rows.min(), rows.max(), columns.min(), columns.max()
    down, across = (bottom - top) // 4, (right - left) // 4
    assert shown[top + down, left + across].argmax() == 0
    assert shown[top + down, right - across].argmax() == 1
    assert shown[bottom - down, left + across].argmax() == 2
    assert np.ptp(shown[bottom - down, right - across]) < 30
    differs = (shown != plain).any(axis=2)
    assert differs[board].mean() > 0.9
    assert not (differs & ~grown(board, 2)).any()


def test_a_house_shows_a_picture_on_its_front():
    shown, hits = painted(frame_with(None, quarters()))
    plain, _ = painted(frame_with(None))
    house = (hits.row < 0) & (hits.triangle >= 2)
    house = house.reshape(HEIGHT, WIDTH)
    differs = (shown != plain).any(axis=2)
    assert differs[house].mean() > 0.9
    assert not (differs & ~grown(house, 2)).any()
    hues = {int(pixel.argmax()) for pixel in shown[house] if np.ptp(pixel) > 60}
    assert {0, 1, 2} <= hues


def test_the_same_picture_gives_the_same_bytes():
    one, _ = painted(frame_with(quarters(), quarters()))
    again, _ = painted(frame_with(quarters(), quarters()))
    assert np.array_equal(one, again)
