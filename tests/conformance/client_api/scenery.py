"""What stands in the town: objects, boxes, layers, textures, and rays that meet them."""

from __future__ import annotations

import math
from typing import Any

import carla

from client_api.entries import limited, works
from client_api.picture import changed
from client_api.surface import has
from client_api.trial_scene import CAR_LABEL, TrialScene, expect, look_at


def _building(scene: TrialScene) -> Any:
    """A building whose front can be looked at from the nearest road."""
    buildings = scene.world.get_environment_objects(carla.CityObjectLabel.Buildings)
    expect(len(buildings) > 3, f"{len(buildings)} buildings")

    def to_road(building: Any) -> float:
        place = building.bounding_box.location
        return float(scene.map.get_waypoint(place).transform.location.distance(place))

    return min(buildings, key=to_road)


def _front(scene: TrialScene, building: Any) -> carla.Transform:
    place = building.bounding_box.location
    eye = scene.map.get_waypoint(place).transform.location + carla.Location(z=2.0)
    toward = place - eye
    yaw = math.degrees(math.atan2(toward.y, toward.x))
    return carla.Transform(eye, carla.Rotation(yaw=yaw))


@works("World.get_environment_objects", "World.enable_environment_objects",
       "EnvironmentObject.*")  # fmt: skip
def _objects_vanish(scene: TrialScene) -> None:
    """A building that is switched off is gone for cameras, LiDAR and rays, and comes back."""
    building = _building(scene)
    expect(building.type == carla.CityObjectLabel.Buildings, "its type")
    expect(bool(building.name) and building.id > 0, "name and id")
    expect(building.bounding_box.extent.z > 1.0, "its box")
    expect(building.transform.location.distance(building.bounding_box.location) < 50.0, "its pose")
    view = _front(scene, building)
    middle = building.bounding_box.location

    def seen() -> tuple[Any, int, int]:
        tags = scene.picture(view, "semantic_segmentation")
        hits = scene.world.cast_ray(view.location, middle)
        lidar = scene.spawn(
            "sensor.lidar.ray_cast_semantic", view, None,
            channels="16", points_per_second="20000", rotation_frequency="20",
        )  # fmt: skip
        points = scene.measure(lidar)
        houses = sum(p.object_tag == int(carla.CityObjectLabel.Buildings) for p in points)
        scene.sweep()
        return tags, sum(h.label == carla.CityObjectLabel.Buildings for h in hits), houses

    there = seen()
    scene.world.enable_environment_objects({building.id}, False)
    gone = seen()
    scene.world.enable_environment_objects({building.id}, True)
    back = seen()
    label = int(carla.CityObjectLabel.Buildings)
    expect(there[0].share(label) > gone[0].share(label) + 0.05, "cameras still see it")
    expect(there[1] > gone[1], f"rays still meet it: {there[1]}, {gone[1]}")
    expect(there[2] > gone[2], f"LiDAR still meets it: {there[2]}, {gone[2]}")
    expect(back == there, "it did not come back")


@works("World.load_map_layer", "World.unload_map_layer")
def _layers(scene: TrialScene) -> None:
    """Without the layer of buildings no camera sees one; loaded again, they are back."""
    view = _front(scene, _building(scene))
    label = int(carla.CityObjectLabel.Buildings)

    def share() -> float:
        return scene.picture(view, "semantic_segmentation").share(label)

    with_buildings = share()
    scene.world.unload_map_layer(carla.MapLayer.Buildings)
    without = share()
    scene.world.load_map_layer(carla.MapLayer.Buildings)
    expect(with_buildings > 0.05 and without == 0.0, f"{with_buildings:.2f}, {without:.2f}")
    expect(share() == with_buildings, "they did not come back")


@works("World.get_level_bbs")
def _boxes(scene: TrialScene) -> None:
    """Boxes of all labels: every lamp pole and light head, and cars where they stand."""
    everything = scene.world.get_level_bbs()
    for label in ("Buildings", "Poles", "Vegetation", "TrafficLight"):
        boxes = scene.world.get_level_bbs(getattr(carla.CityObjectLabel, label))
        expect(0 < len(boxes) < len(everything), f"{len(boxes)} boxes of {label}")
    car = scene.car()
    cars = scene.world.get_level_bbs(CAR_LABEL)
    near = min(box.location.distance(car.get_location()) for box in cars)
    expect(near < 2.0, f"the nearest car's box is {near:.1f} m from the car")


@works("World.cast_ray", "World.project_point", "World.ground_projection", "LabelledPoint.*")
def _rays(scene: TrialScene) -> None:
    """A ray down through a car meets its roof, its floor, and the road."""
    car = scene.car()
    above = car.get_location() + carla.Location(z=10.0)
    below = car.get_location() - carla.Location(z=3.0)
    hits = scene.world.cast_ray(above, below)
    labels = [hit.label for hit in hits]
    expect(labels[0] == CAR_LABEL, f"met {labels}")
    expect(carla.CityObjectLabel.Roads in labels, f"met {labels}")
    heights = [hit.location.z for hit in hits]
    expect(heights == sorted(heights, reverse=True), "nearest first")
    roof = scene.world.project_point(above, carla.Vector3D(0.0, 0.0, -1.0), 20.0)
    expect(roof.label == CAR_LABEL, "project_point meets the roof")
    ground = scene.world.ground_projection(above, 20.0)
    expect(abs(ground.location.z - roof.location.z) < 1e-3, "ground_projection looks down")
    up = scene.world.project_point(above, carla.Vector3D(0.0, 0.0, 1.0), 100.0)
    expect(up is None, "nothing is above")


_UNIFORM = (
    "Objects and props show a picture on the faces of their boxes. Light has its mean colour; "
    "roughness changes nothing."
)


@limited(_UNIFORM, "World.get_names_of_all_objects", "World.apply_color_texture_to_object",
         "World.apply_color_texture_to_objects", "World.apply_float_color_texture_to_object",
         "World.apply_float_color_texture_to_objects", "World.apply_textures_to_object",
         "World.apply_textures_to_objects")  # fmt: skip
def _painted(scene: TrialScene) -> None:
    building = _building(scene)
    names = scene.world.get_names_of_all_objects()
    expect(building.name in names, "its name is listed")
    view = _front(scene, building)
    scene.world.set_weather(carla.WeatherParameters.CloudyNoon)
    before = scene.picture(view)
    paint = carla.TextureColor(2, 2)
    glow = carla.TextureFloatColor(2, 2)
    for x in range(2):
        for y in range(2):
            paint.set(x, y, carla.Color(230, 20, 20, 255))
            glow.set(x, y, carla.FloatColor(0.0, 1.0, 0.0, 1.0))
    diffuse, emissive = carla.MaterialParameter.Diffuse, carla.MaterialParameter.Emissive
    scene.world.apply_color_texture_to_object(building.name, diffuse, paint)
    red = scene.picture(view)
    expect(changed(before, red) > 0.05, "the paint is not seen")
    scene.world.apply_float_color_texture_to_object(building.name, emissive, glow)
    green = scene.picture(view)
    expect(changed(red, green) > 0.05, "the glow is not seen")
    scene.world.apply_color_texture_to_objects([building.name], diffuse, paint)
    scene.world.apply_float_color_texture_to_objects([building.name], diffuse, glow)
    flat = carla.TextureFloatColor(2, 2)
    scene.world.apply_textures_to_object(building.name, paint, flat, flat, flat)
    scene.world.apply_textures_to_objects([building.name], paint, flat, flat, flat)
    scene.ticks()
    scene.world.set_weather(carla.WeatherParameters.Default)
    try:
        scene.world.apply_color_texture_to_object("no such thing", diffuse, paint)
    except RuntimeError as error:
        expect("unable to find Actor to apply the texture" in str(error), str(error))
    else:
        raise AssertionError("an object that does not exist was painted")


@limited("RGB cameras see lines, arrows, boxes and points, behind what is nearer; other sensors "
         "do not.",
         "World.debug", "DebugHelper.draw_point", "DebugHelper.draw_line", "DebugHelper.draw_arrow",
         "DebugHelper.draw_box", "DebugHelper.clear_debug_shape")  # fmt: skip
def _debug_shapes(scene: TrialScene) -> None:
    debug = scene.world.debug
    place = scene.place().location + carla.Location(z=1.0)
    view = look_at(place, 6.0)
    red = carla.Color(255, 0, 0)
    clean = scene.picture(view)
    clears = has("DebugHelper.clear_debug_shape")
    life_s = 5.0 if clears else 1.0

    def shown(name: str, draw: Any) -> None:
        draw()
        drawn = scene.picture(view)
        expect(changed(clean, drawn) > 0.001, f"{name} is not seen")
        if not clears:
            scene.until(lambda: changed(clean, scene.picture(view)) == 0.0, f"{name} goes")
            return
        debug.clear_debug_shape()
        expect(changed(clean, scene.picture(view)) == 0.0, f"{name} stays after clear_debug_shape")

    along = place + carla.Location(x=0.5, y=1.0, z=0.5)
    shown("a point", lambda: debug.draw_point(place, 0.1, red, life_s))
    shown("a line", lambda: debug.draw_line(place, along, 0.05, red, life_s))
    shown("an arrow", lambda: debug.draw_arrow(place, along, 0.05, 0.2, red, life_s))
    box = carla.BoundingBox(place, carla.Vector3D(0.5, 0.5, 0.5))
    shown("a box", lambda: debug.draw_box(box, carla.Rotation(yaw=30.0), 0.05, red, life_s))
    debug.draw_line(place, along, 0.05, red, 0.12)
    scene.ticks(4)
    expect(changed(clean, scene.picture(view)) == 0.0, "a line outlives its life time")


@limited("Accepted; they belong to the window of a server, and this one has none.",
         "DebugHelper.draw_string", "DebugHelper.draw_hud_point", "DebugHelper.draw_hud_line",
         "DebugHelper.draw_hud_arrow", "DebugHelper.draw_hud_box",
         "DebugHelper.clear_debug_string")  # fmt: skip
def _window_shapes(scene: TrialScene) -> None:
    debug, place = scene.world.debug, carla.Location(z=2.0)
    debug.draw_string(place, "here", False, carla.Color(255, 0, 0), 0.1)
    scene.ticks()
    if not has("DebugHelper.draw_hud_point"):
        return
    debug.draw_hud_point(place, 2.0, carla.Color(255, 0, 0), 0.1)
    debug.draw_hud_line(place, carla.Location(x=1.0), 2.0, carla.Color(255, 0, 0), 0.1)
    debug.draw_hud_arrow(place, carla.Location(x=1.0), 2.0, 2.0, carla.Color(255, 0, 0), 0.1)
    box = carla.BoundingBox(place, carla.Vector3D(1.0, 1.0, 1.0))
    debug.draw_hud_box(box, carla.Rotation(), 2.0, carla.Color(255, 0, 0), 0.1)
    debug.clear_debug_string()
    scene.ticks()
