"""The blueprint library and what its blueprints say."""

from __future__ import annotations

import carla

from client_api.entries import works
from client_api.surface import has
from client_api.trial_scene import TrialScene, expect


@works("World.get_blueprint_library", "BlueprintLibrary.*")
def _library(scene: TrialScene) -> None:
    """Filters by wildcard and by attribute give the same cars; ``find`` gives one blueprint."""
    library = scene.world.get_blueprint_library()
    cars = library.filter("vehicle.*")
    if has("BlueprintLibrary.filter_by_attribute"):
        cars = cars.filter_by_attribute("base_type", "car")
        expect(all(b.get_attribute("base_type") == "car" for b in cars), "filter_by_attribute")
    expect(len(cars) > 15, f"{len(cars)} cars")
    expect(library.find("vehicle.tesla.model3").id == "vehicle.tesla.model3", "find")
    try:
        library.find("vehicle.none.such")
    except IndexError as error:
        expect("vehicle.none.such" in str(error), f"the error does not name it: {error}")
    else:
        raise AssertionError("an unknown id was found")


@works("ActorBlueprint.*", "ActorAttribute.*")
def _blueprint(scene: TrialScene) -> None:
    """Attributes have types, recommended values and CARLA's rules of what may be changed."""
    model3 = scene.library.find("vehicle.tesla.model3")
    expect(model3.has_tag("tesla") and model3.match_tags("*model3*"), "tags")
    expect("vehicle" in list(model3.tags), f"tags {list(model3.tags)}")
    expect(model3.has_attribute("color") and not model3.has_attribute("colour"), "has_attribute")
    wheels = model3.get_attribute("number_of_wheels")
    expect(wheels.as_int() == 4 and not wheels.is_modifiable, "number_of_wheels")
    expect(wheels.type == carla.ActorAttributeType.Int, "its type")
    colour = model3.get_attribute("color")
    expect(colour.id == "color" and len(list(colour.recommended_values)) > 3, "paints")
    model3.set_attribute("color", "10,20,30")
    expect(model3.get_attribute("color").as_color() == carla.Color(10, 20, 30), "colour")
    expect(model3.get_attribute("sticky_control").as_bool() is True, "as_bool")
    expect(model3.get_attribute("role_name").as_str() == "autopilot", "as_str")
    camera = scene.library.find("sensor.camera.rgb")
    expect(camera.get_attribute("fov").as_float() == 90.0, "as_float")
    try:
        model3.set_attribute("number_of_wheels", "3")
    except ValueError as error:
        expect("read-only" in str(error), f"unclear: {error}")
    else:
        raise AssertionError("number_of_wheels could be changed")
    car = scene.car(color="10,20,30")
    expect(car.attributes["color"] == "10,20,30", "the car has the colour that was asked for")
