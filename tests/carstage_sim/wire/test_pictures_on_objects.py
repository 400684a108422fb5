"""The real client puts pictures on props and on the town's objects; cameras show them."""

from __future__ import annotations

import queue
from collections.abc import Iterator
from typing import Any

import carla
import numpy as np
import pytest

from running_simulator import start_simulator, stop_simulator

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("wire")]

WIDTH, HEIGHT = 192, 96
DIFFUSE = carla.MaterialParameter.Diffuse


class Scene:
    """A camera that looks along a road from a spawn point, in steps."""

    def __init__(self, world: Any) -> None:
        self.world = world
        settings = world.get_settings()
        settings.synchronous_mode, settings.fixed_delta_seconds = True, 0.1
        world.apply_settings(settings)
        weather = carla.WeatherParameters.CloudyNoon
        weather.wind_intensity = 0.0  # else leaves differ from tick to tick
        world.set_weather(weather)
        self.start = world.get_map().get_spawn_points()[0]
        blueprint = world.get_blueprint_library().find("sensor.camera.rgb")
        blueprint.set_attribute("image_size_x", str(WIDTH))
        blueprint.set_attribute("image_size_y", str(HEIGHT))
        pose = carla.Transform(self.start.location + carla.Location(z=1.0), self.start.rotation)
        self.camera = world.spawn_actor(blueprint, pose)
        self.images: queue.Queue[Any] = queue.Queue()
        self.camera.listen(self.images.put)

    def picture(self) -> np.ndarray:
        """``(H, W, 3)`` int RGB of the next tick."""
        frame = self.world.tick()
        while (image := self.images.get(timeout=240.0)).frame != frame:
            pass
        pixels = np.frombuffer(image.raw_data, np.uint8).reshape(HEIGHT, WIDTH, 4)
        return pixels[:, :, 2::-1].astype(int)

    def board(self, ahead_m: float) -> Any:
        """A plate of 2.4 m x 1.2 m across the road, its front towards the camera."""
        forward, yaw = self.start.get_forward_vector(), self.start.rotation.yaw
        at = self.start.location + forward * ahead_m + carla.Location(z=1.0)
        plate = self.world.get_blueprint_library().find("static.prop.ironplank")
        return self.world.spawn_actor(plate, carla.Transform(at, carla.Rotation(90.0, yaw, 0.0)))


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Scene]:
    simulator = start_simulator(tmp_path_factory.mktemp("pictures") / "log", "--map", "Stage01")
    try:
        client = carla.Client(simulator.host, simulator.port)
        client.set_timeout(240.0)
        yield Scene(client.get_world())
    finally:
        stop_simulator(simulator)


def texture(columns: int = 8, rows: int = 4) -> Any:
    """Red top left, green top right, blue bottom left, white bottom right; row 0 is the lowest."""
    made = carla.TextureColor(columns, rows)
    for x in range(columns):
        for y in range(rows):
            upper = ((220, 10, 10), (10, 220, 10))[x >= columns // 2]
            lower = ((10, 10, 220), (220, 220, 220))[x >= columns // 2]
            made.set(x, y, carla.Color(*(upper if y >= rows // 2 else lower), 255))
    return made


def test_a_prop_shows_a_picture_upright_and_the_rest_keeps_its_bytes(scene: Scene) -> None:
    before = set(scene.world.get_names_of_all_objects())
    board = scene.board(5.0)
    plain = scene.picture()
    (name,) = set(scene.world.get_names_of_all_objects()) - before
    scene.world.apply_color_texture_to_object(name, DIFFUSE, texture())
    shown = scene.picture()
    rows, columns = np.nonzero((shown != plain).any(axis=2))
    top, bottom, left, right = rows.min(), rows.max(), columns.min(), columns.max()
    assert (right - left) / (bottom - top) == pytest.approx(2.0, abs=0.25)
    down, across = (bottom - top) // 4, (right - left) // 4
    high, low = top + down, bottom - down
    near, far = left + across, right - across
    quarter = {(0, 0): shown[high, near], (0, 1): shown[high, far]}
    quarter |= {(1, 0): shown[low, near], (1, 1): shown[low, far]}
    assert [int(np.argmax(quarter[key])) for key in ((0, 0), (0, 1), (1, 0))] == [0, 1, 2]
    assert np.ptp(quarter[1, 1]) < 40
    board.destroy()
    scene.world.tick()
    assert name not in scene.world.get_names_of_all_objects()


def test_an_object_of_the_town_shows_a_picture_and_then_a_colour_again(scene: Scene) -> None:
    before = scene.picture()
    buildings = scene.world.get_environment_objects(carla.CityObjectLabel.Buildings)
    names = [building.name for building in buildings]
    scene.world.apply_color_texture_to_objects(names, DIFFUSE, texture(64, 64))
    shown = scene.picture()
    changed = (shown != before).any(axis=2)
    assert changed.mean() > 0.01
    hues = {int(np.argmax(pixel)) for pixel in shown[changed] if np.ptp(pixel) > 60}
    assert {0, 1} <= hues
    red = carla.TextureColor(1, 1)
    red.set(0, 0, carla.Color(220, 10, 10, 255))
    scene.world.apply_color_texture_to_objects(names, DIFFUSE, red)
    plain = scene.picture()
    assert (plain[changed].argmax(axis=1) == 0).mean() > 0.8


def test_a_texture_without_pixels_is_refused(scene: Scene) -> None:
    (name, *_) = scene.world.get_names_of_all_objects()
    with pytest.raises(RuntimeError, match="a texture of 0 x 0"):
        scene.world.apply_color_texture_to_object(name, DIFFUSE, carla.TextureColor(0, 0))
