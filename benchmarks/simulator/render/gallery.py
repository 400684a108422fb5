"""The pictures of the documentation: presets, qualities, sensors, people, trees, vehicles."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from benchmarks.simulator.render.people_sheet import people_pictures
from benchmarks.simulator.render.scene import ReferenceScene, named_presets, populate, rgb, town_of
from benchmarks.simulator.render.tree_sheet import tree_pictures
from benchmarks.simulator.render.vehicle_sheet import vehicle_pictures
from carstage_sim.render.quality import Quality
from carstage_sim.sensors import WorldSensors
from carstage_sim.sensors.measurements import FlowFrame, ImageFrame, SemanticLidarFrame, SensorFrame

Pixels = NDArray[np.uint8]

_PALETTE = np.random.default_rng(5).integers(40, 256, (256, 3)).astype(np.uint8)


def gallery_sheets(*, town: str, seed: int) -> Iterator[tuple[str, Image.Image]]:
    """File name and picture of each sheet.

    Args:
        town: in which streets and sensors are shown.
        seed: of who is there.
    """
    map_ = town_of(town)
    with WorldSensors(map_) as sensors, WorldSensors(map_, quality=Quality.EPIC) as epic:
        scene = populate(map_, sensors, vehicles=70, walkers=30, seed=seed)
        better = replace(scene, sensors=epic)
        presets = named_presets()
        weathers = {name: scene.picture(weather, 320, 180) for name, weather in presets.items()}
        yield "presets.jpg", _sheet(weathers, 4)
        lights = {
            f"{name}, {quality}": one.picture(presets[name], 640, 360)
            for name in ("ClearNoon", "MidRainyNoon", "ClearSunset", "WetNight")
            for quality, one in (("low", scene), ("epic", better))
        }
        yield "day-and-night.jpg", _sheet(lights, 2)
        yield "sensors.jpg", _sheet(_sensors(scene), 3)
    yield "people.jpg", _sheet(people_pictures(200, 270), 6)
    yield "trees.jpg", _sheet(tree_pictures(200, 250), 6)
    yield "vehicles.jpg", _sheet(vehicle_pictures(200, 126), 6)


def _sheet(pictures: dict[str, Pixels], columns: int) -> Image.Image:
    """Pictures of one size in rows, each with its name."""
    height, width = next(iter(pictures.values())).shape[:2]
    rows = -(-len(pictures) // columns)
    sheet = Image.new("RGB", (columns * width, rows * height))
    pen = ImageDraw.Draw(sheet)
    for place, (name, pixels) in enumerate(pictures.items()):
        corner = (place % columns * width, place // columns * height)
        sheet.paste(Image.fromarray(pixels), corner)
        pen.text((corner[0] + 6, corner[1] + 4), name, (255, 255, 255), stroke_width=2,
                 stroke_fill=(0, 0, 0))  # fmt: skip
    return sheet


def _sensors(scene: ReferenceScene) -> dict[str, Pixels]:
    """One picture for each kind of sensor."""
    noon = named_presets()["ClearNoon"]
    size = {"image_size_x": 480, "image_size_y": 270}
    scene.state(noon)
    cameras: dict[str, tuple[str, Callable[[SensorFrame], Pixels]]] = {
        "rgb": ("camera.rgb", rgb),
        "depth (logarithm)": ("camera.depth", _depth),
        "semantic_segmentation": ("camera.semantic_segmentation", lambda f: _PALETTE[_codes(f)[0]]),
        "instance_segmentation": (
            "camera.instance_segmentation",
            lambda f: _PALETTE[(_codes(f)[1] * 7 + _codes(f)[2] * 13) % 256],
        ),
        "normals": ("camera.normals", rgb),
        "optical_flow": ("camera.optical_flow", _flow),
    }
    pictures = {}
    for name, (kind, show) in cameras.items():
        requests = [scene.request(kind, **size)]
        scene.sensors.reset()
        scene.sensors.capture(scene.state(), requests)
        ((_, frame),) = scene.sensors.capture(scene.state(), requests)
        pictures[name] = show(frame)
    bent = {"lens_circle_multiplier": 3.0, "lens_circle_falloff": 3.0}
    pictures["rgb with lens distortion"] = rgb(
        scene.frame(scene.state(), "camera.rgb", **size, **bent)
    )
    dark = {"exposure_mode": "manual", "exposure_compensation": -1.5}
    pictures["rgb, manual exposure, -1.5 EV"] = rgb(
        scene.frame(scene.state(), "camera.rgb", **size, **dark)
    )
    laser = {"channels": 64, "points_per_second": 1_200_000, "rotation_frequency": 20, "range": 60}
    pictures["lidar.ray_cast_semantic from above"] = _points(
        scene.frame(scene.state(), "lidar.ray_cast_semantic", **laser)
    )
    return pictures


def _codes(frame: SensorFrame) -> tuple[NDArray[np.int64], ...]:
    """Red, green and blue codes."""
    assert isinstance(frame, ImageFrame)
    return tuple(frame.pixels[..., k].astype(np.int64) for k in (2, 1, 0))


def _depth(frame: SensorFrame) -> Pixels:
    low, middle, high = _codes(frame)
    metres = (low + 256 * middle + 65536 * high) / (2**24 - 1) * 1000.0
    grey = 255.0 * np.log(np.maximum(metres, 1.0)) / np.log(1000.0)
    return np.repeat(grey.astype(np.uint8)[..., None], 3, axis=2)


def _flow(frame: SensorFrame) -> Pixels:
    assert isinstance(frame, FlowFrame)
    scaled = np.clip(frame.flow / max(float(np.abs(frame.flow).max()), 1e-6), -0.2, 0.2) * 5.0
    pixels = np.full((*frame.flow.shape[:2], 3), 128, np.uint8)
    pixels[..., :2] = (127.5 + 127.5 * scaled).astype(np.uint8)
    return pixels


def _points(frame: SensorFrame) -> Pixels:
    """Points seen from above, coloured by tag, 25 m up and down and 44 m to the sides."""
    assert isinstance(frame, SemanticLidarFrame)
    pixels = np.zeros((270, 480, 3), np.uint8)
    column = (240 + frame.points["y"] * 5.4).astype(int)
    row = (135 - frame.points["x"] * 5.4).astype(int)
    shown = (column >= 0) & (column < 480) & (row >= 0) & (row < 270)
    pixels[row[shown], column[shown]] = _PALETTE[frame.points["object_tag"][shown] % 256]
    return pixels
