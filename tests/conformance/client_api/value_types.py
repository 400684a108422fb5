"""Enumerations and value types: they live in the client, and are exercised there."""

from __future__ import annotations

import math
import operator
from typing import Any

import carla

from client_api.entries import client_side
from client_api.surface import has
from client_api.trial_scene import TrialScene, expect

_ENUMS = (
    "ActorAttributeType", "ActorState", "AttachmentType", "CityObjectLabel", "ColorConverter",
    "GBufferTextureID", "LandmarkOrientation", "LaneChange", "LaneMarkingColor", "LaneMarkingType",
    "LaneType", "LightGroup", "MapLayer", "MaterialParameter", "RoadMarkOrientation",
    "TrafficLightState", "VehicleDoor", "VehicleFailureState", "VehicleLightState",
    "VehicleWheelLocation",
)  # fmt: skip

_VECTORS = (
    "vector_of_bones", "vector_of_bones_out", "vector_of_gears", "vector_of_ints",
    "vector_of_transform", "vector_of_vector2D", "vector_of_wheels", "vector_of_wheels_telemetry",
)  # fmt: skip


@client_side(*(f"{name}.*" for name in _ENUMS))
def _enumerations(_stage: TrialScene) -> None:
    """Each value is found again by its number."""
    for name in _ENUMS:
        if not hasattr(carla, name):
            continue  # an older client
        kind = getattr(carla, name)
        expect(len(kind.names) > 0, f"{name} has no values")
        for label, value in kind.names.items():
            expect(getattr(kind, label) == value, f"{name}.{label} is not what names holds")
            expect(kind.values[int(value)] == value, f"{name}.{label} is lost by its number")


@client_side("LandmarkType.*")
def _landmark_types(_stage: TrialScene) -> None:
    """Each is the text of an OpenDRIVE signal type."""
    for name in vars(carla.LandmarkType):
        if not name.startswith("__"):
            value = getattr(carla.LandmarkType, name)
            expect(str(value).isdigit(), f"{name} is {value}")


def _fields_keep_values(value: Any, fields: tuple[str, ...]) -> None:
    """Writable numbers read back what was written."""
    for number, field in enumerate(fields, start=1):
        before = getattr(value, field)
        new: Any = (not before) if isinstance(before, bool) else type(before)(number)
        setattr(value, field, new)
        got = getattr(value, field)
        expect(math.isclose(float(got), float(new), rel_tol=1e-5), f"{field}: {new} became {got}")


@client_side("Vector2D.*", "Vector3D.*", "Location.*")
def _vectors(_stage: TrialScene) -> None:
    """Lengths, products, distances and angles come out as in arithmetic."""
    a, b = carla.Vector3D(3.0, 4.0, 0.0), carla.Vector3D(0.0, 0.0, 2.0)
    expect(a.length() == 5.0 and a.squared_length() == 25.0, "length of (3, 4, 0)")
    expect(abs(a.make_unit_vector().length() - 1.0) < 1e-6, "unit vector")
    expect(a.cross(b) == carla.Vector3D(8.0, -6.0, 0.0), "cross product")
    expect(a.dot(b) == 0.0 and a.dot_2d(a) == 25.0, "dot products")
    expect(abs(a.distance(b) ** 2 - a.distance_squared(b)) < 1e-3, "distance")
    expect(abs(a.distance_2d(b) ** 2 - a.distance_squared_2d(b)) < 1e-3, "plane distance")
    expect(abs(a.get_vector_angle(b) - math.pi / 2) < 1e-6, "angle")
    _fields_keep_values(a, ("x", "y", "z"))
    flat = carla.Vector2D(3.0, 4.0)
    expect(flat.length() == 5.0 and flat.squared_length() == 25.0, "length of (3, 4)")
    expect(abs(flat.make_unit_vector().length() - 1.0) < 1e-6, "unit vector in the plane")
    _fields_keep_values(flat, ("x", "y"))
    here = carla.Location(1.0, 2.0, 3.0)
    expect(here.distance(carla.Location(1.0, 2.0, 5.0)) == 2.0, "distance of locations")
    _fields_keep_values(here, ("x", "y", "z"))


@client_side("Rotation.*", "Transform.*")
def _transforms(_stage: TrialScene) -> None:
    """A point goes to the world and back; the axes are CARLA's left-handed ones."""
    turned = carla.Rotation(yaw=90.0)
    expect(turned.get_forward_vector().y > 0.999, "yaw 90 looks along +y")
    expect(turned.get_right_vector().x < -0.999, "its right is -x")
    expect(turned.get_up_vector().z > 0.999, "its up is +z")
    _fields_keep_values(carla.Rotation(), ("pitch", "yaw", "roll"))
    pose = carla.Transform(carla.Location(10.0, 0.0, 0.0), turned)
    point = carla.Location(1.0, 2.0, 3.0)
    there = pose.transform(carla.Location(point.x, point.y, point.z))
    expect(there.distance(carla.Location(8.0, 1.0, 3.0)) < 1e-4, f"{point} went to {there}")
    if has("Transform.inverse_transform"):
        back = pose.inverse_transform(carla.Location(there.x, there.y, there.z))
        expect(back.distance(point) < 1e-4, f"{point} came back as {back}")
    expect(pose.transform_vector(carla.Vector3D(1.0, 0.0, 0.0)).y > 0.999, "vector is turned only")
    expect(pose.get_forward_vector() == turned.get_forward_vector(), "forward of the pose")
    expect(pose.get_right_vector() == turned.get_right_vector(), "right of the pose")
    expect(pose.get_up_vector() == turned.get_up_vector(), "up of the pose")
    there_and_back = [
        sum(map(operator.mul, row, column))
        for row in pose.get_matrix()
        for column in zip(*pose.get_inverse_matrix())
    ]
    identity = [float(i % 5 == 0) for i in range(16)]
    expect(
        all(abs(a) < 1e-4 for a in map(operator.sub, there_and_back, identity)),
        "matrix times inverse",
    )
    pose.location, pose.rotation = point, carla.Rotation(pitch=5.0)
    expect(pose.location == point and pose.rotation.pitch == 5.0, "fields keep values")


@client_side("BoundingBox.*")
def _bounding_box(scene: TrialScene) -> None:
    """It holds what is inside, and its corners are where the pose puts them."""
    box = carla.BoundingBox(carla.Location(0.0, 0.0, 1.0), carla.Vector3D(2.0, 1.0, 1.0))
    pose = carla.Transform(carla.Location(100.0, 0.0, 0.0))
    expect(box.contains(carla.Location(101.0, 0.5, 1.5), pose), "a point inside")
    expect(not box.contains(carla.Location(103.0, 0.0, 1.0), pose), "a point outside")
    expect(len(box.get_local_vertices()) == len(box.get_world_vertices(pose)) == 8, "corners")
    expect(max(v.x for v in box.get_world_vertices(pose)) == 102.0, "foremost corner")
    box.location, box.extent = carla.Location(1.0, 0.0, 0.0), carla.Vector3D(1.0, 1.0, 1.0)
    box.rotation = carla.Rotation(yaw=10.0)
    expect(box.location.x == box.extent.x == 1.0, "fields keep values")
    car = scene.car()
    if has("BoundingBox.actor_id"):
        expect(car.bounding_box.actor_id == car.id, "a car's box has its id")


@client_side("Color.*", "FloatColor.*", "GeoLocation.*", "GearPhysicsControl.*",
             "WheelPhysicsControl.*", "AckermannControllerSettings.*", "VehicleAckermannControl.*",
             "WheelTelemetryData.*", "OpticalFlowPixel.*")  # fmt: skip
def _plain_fields(_stage: TrialScene) -> None:
    """Numbers read back as written."""
    _fields_keep_values(carla.Color(1, 2, 3, 4), ("r", "g", "b", "a"))
    _fields_keep_values(carla.FloatColor(), ("r", "g", "b", "a"))
    _fields_keep_values(carla.GeoLocation(), ("latitude", "longitude", "altitude"))
    _fields_keep_values(carla.OpticalFlowPixel(), ("x", "y"))
    _fields_keep_values(carla.GearPhysicsControl(), ("ratio", "down_ratio", "up_ratio"))
    if has("VehicleAckermannControl.speed"):
        _ackermann_fields()
    for name in ("WheelPhysicsControl", "WheelTelemetryData"):
        if hasattr(carla, name):
            kind = getattr(carla, name)
            fields = tuple(f for f in vars(kind) if not f.startswith("__") and f != "position")
            _fields_keep_values(kind(), fields)
    wheel = carla.WheelPhysicsControl()
    wheel.position = carla.Vector3D(1.0, 2.0, 3.0)
    expect(wheel.position.z == 3.0, "a wheel keeps its place")


def _ackermann_fields() -> None:
    settings = ("speed_kp", "speed_ki", "speed_kd", "accel_kp", "accel_ki", "accel_kd")
    _fields_keep_values(carla.AckermannControllerSettings(), settings)
    control = ("steer", "steer_speed", "speed", "acceleration", "jerk")
    _fields_keep_values(carla.VehicleAckermannControl(), control)


@client_side(*(f"{name}.*" for name in _VECTORS), "bone_transform.*", "FakeImage.*")
def _lists(_stage: TrialScene) -> None:
    """Lists take and give back what they hold."""
    ints = carla.vector_of_ints()
    ints.append(3)
    ints.extend([4, 5])
    expect(list(ints) == [3, 4, 5], "vector_of_ints")
    for name, kind in (
        ("vector_of_gears", "GearPhysicsControl"),
        ("vector_of_wheels", "WheelPhysicsControl"),
        ("vector_of_wheels_telemetry", "WheelTelemetryData"),
        ("vector_of_vector2D", "Vector2D"),
        ("vector_of_transform", "Transform"),
    ):
        if not hasattr(carla, name):
            continue  # an older client
        values, item = getattr(carla, name)(), getattr(carla, kind)()
        values.append(item)
        values.extend([item])
        expect(len(values) == 2, name)
    bone = carla.bone_transform()
    bone.name, bone.transform = "crl_hips__C", carla.Transform(carla.Location(x=1.0))
    bones = carla.vector_of_bones()
    bones.append(bone)
    expect(bones[0].name == "crl_hips__C" and bones[0].transform.location.x == 1.0, "bones")
    expect(len(carla.vector_of_bones_out()) == 0, "vector_of_bones_out")
    fake = carla.FakeImage
    expect(all(hasattr(fake, f) for f in ("width", "height", "fov", "raw_data")), "FakeImage")


@client_side("TextureColor.*", "TextureFloatColor.*")
def _textures(_stage: TrialScene) -> None:
    """Pixels read back as written, in the size that was set."""
    for kind, colour in (
        (carla.TextureColor, carla.Color(1, 2, 3, 4)),
        (carla.TextureFloatColor, carla.FloatColor(0.25, 0.5, 0.75, 1.0)),
    ):
        texture = kind(4, 2)
        texture.set_dimensions(2, 3)
        texture.set(1, 2, colour)
        expect((texture.width, texture.height) == (2, 3), "size")
        expect(texture.get(1, 2) == colour, "pixel")


@client_side("Osm2Odr.*", "Osm2OdrSettings.*")
def _osm_to_opendrive(_stage: TrialScene) -> None:
    """A street of OpenStreetMap becomes an OpenDRIVE road."""
    settings = carla.Osm2OdrSettings()
    settings.default_lane_width, settings.generate_traffic_lights = 3.0, False
    settings.use_offsets, settings.center_map = False, True
    settings.offset_x = settings.offset_y = settings.elevation_layer_height = 0.0
    settings.all_junctions_with_traffic_lights = False
    settings.proj_string = "+proj=tmerc"
    settings.set_osm_way_types(["residential"])
    settings.set_traffic_light_excluded_way_types(["residential"])
    street = """<osm version="0.6"><bounds minlat="0" minlon="0" maxlat="0.01" maxlon="0.01"/>
      <node id="1" visible="true" version="1" lat="0.001" lon="0.001"/>
      <node id="2" visible="true" version="1" lat="0.002" lon="0.002"/>
      <way id="3" visible="true" version="1"><nd ref="1"/><nd ref="2"/>
      <tag k="highway" v="residential"/></way></osm>"""
    expect("<road " in carla.Osm2Odr.convert(street, settings), "no road came out")
