"""Sensors: listening, and what their measurements hold."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from queue import Queue
from typing import Any

import carla

from carstage.collector.internals.dialect import is_listening
from client_api.entries import client_side, limited, works
from client_api.picture import Picture, floats
from client_api.surface import has
from client_api.trial_scene import CAR_LABEL, TrialScene, expect, look_at


def _camera(scene: TrialScene, kind: str = "rgb", parent: Any = None) -> Any:
    where = carla.Transform(carla.Location(x=1.5, z=2.0)) if parent else look_at(
        scene.place().location, 10.0)  # fmt: skip
    return scene.spawn(
        f"sensor.camera.{kind}", where, parent, image_size_x="64", image_size_y="48", fov="90.0"
    )


@works("Sensor.listen", "Sensor.is_listening", "Sensor.stop", "SensorData.*", "ServerSideSensor",
       "Sensor")  # fmt: skip
def _listening(scene: TrialScene) -> None:
    """Data come with the frame, time and pose of their tick, until the sensor is stopped."""
    car = scene.car()
    sensor = scene.spawn("sensor.other.gnss", carla.Transform(carla.Location(z=1.0)), car)
    inbox: Queue[Any] = Queue(maxsize=1000)
    sensor.listen(inbox.put)
    expect(is_listening(sensor), "it does not listen")
    frame = scene.ticks()
    data = inbox.get(timeout=20.0)
    while data.frame < frame:
        data = inbox.get(timeout=20.0)
    expect(data.frame == data.frame_number == frame, f"frame {data.frame}, ticked {frame}")
    snapshot = scene.world.get_snapshot()
    expect(data.timestamp == snapshot.timestamp.elapsed_seconds, "time")
    expect(data.transform.location.distance(sensor.get_location()) < 0.01, "pose")
    sensor.stop()
    expect(not is_listening(sensor), "it still listens")


@works("Image.*")
def _images(scene: TrialScene) -> None:
    """A picture has the size that was asked for, converts, and is saved as PNG."""
    image = scene.measure(_camera(scene, "depth"))
    expect((image.width, image.height, image.fov) == (64, 48, 90.0), "size")
    expect(len(image.raw_data) == len(image) * 4 == 64 * 48 * 4, "bytes")
    image.convert(carla.ColorConverter.LogarithmicDepth)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "image.png"
        image.save_to_disk(str(path))
        expect(path.read_bytes()[1:4] == b"PNG", "no PNG")


@works("OpticalFlowImage.*")
def _flow(scene: TrialScene) -> None:
    """A camera that moves sees the street flow; its colour code is a picture."""
    car = scene.car()
    camera = _camera(scene, "optical_flow", car)
    car.enable_constant_velocity(carla.Vector3D(8.0, 0.0, 0.0))
    images: list[Any] = []
    camera.listen(images.append)
    scene.until(lambda: len(images) > 3, "pictures")
    image = images[-1]
    expect((image.width, image.height, image.fov) == (64, 48, 90.0), "size")
    flow = floats(bytes(image.raw_data))
    expect(len(flow) == 64 * 48 * 2 and max(map(abs, flow)) > 1e-3, "nothing flows")
    coded = image.get_color_coded_flow()
    expect(len(coded.raw_data) == 64 * 48 * 4, "colour code")


@works("LidarMeasurement.*", "LidarDetection.*", "SemanticLidarMeasurement.*",
       "SemanticLidarDetection.*")  # fmt: skip
def _lidar(scene: TrialScene) -> None:
    """Points lie around the car; the semantic ones say what they hit."""
    car = scene.car()
    mount = carla.Transform(carla.Location(z=2.4))
    common = {"channels": "8", "points_per_second": "8000", "rotation_frequency": "20"}
    points = scene.measure(scene.spawn("sensor.lidar.ray_cast", mount, car, **common))
    expect(points.channels == 8 and len(points) > 50, f"{len(points)} points")
    expect(sum(points.get_point_count(k) for k in range(8)) == len(points), "points per channel")
    expect(len(points.raw_data) == 16 * len(points), "bytes")
    expect(math.isfinite(points.horizontal_angle), "angle")
    expect(points[0].point.distance(carla.Location()) > 0.5, "a point inside the sensor")
    expect(0.0 <= points[0].intensity <= 1.0, "intensity")
    marked = scene.measure(scene.spawn("sensor.lidar.ray_cast_semantic", mount, car, **common))
    expect(marked.channels == 8 and len(marked.raw_data) == 24 * len(marked), "semantic bytes")
    expect(sum(marked.get_point_count(k) for k in range(8)) == len(marked), "semantic channels")
    expect(math.isfinite(marked.horizontal_angle), "semantic angle")
    road = int(carla.CityObjectLabel.Roads)
    expect(any(p.object_tag == road for p in marked), "no point on the road")
    expect(all(0.0 <= abs(p.cos_inc_angle) <= 1.0001 for p in marked), "angle of incidence")
    expect(all(p.object_idx >= 0 and p.point is not None for p in marked), "object and place")
    with tempfile.TemporaryDirectory() as folder:
        for name, data in (("plain", points), ("semantic", marked)):
            path = Path(folder) / f"{name}.ply"
            data.save_to_disk(str(path))
            expect(path.read_bytes()[:3] == b"ply", f"no PLY of {name} points")


@works("RadarMeasurement.*", "RadarDetection.*")
def _radar(scene: TrialScene) -> None:
    """Detections have a distance, angles and a speed."""
    car = scene.car()
    mount = carla.Transform(carla.Location(x=2.6, z=1.0), carla.Rotation(pitch=-4.0))
    data = scene.measure(scene.spawn("sensor.other.radar", mount, car))
    expect(data.get_detection_count() == len(data) > 0, "no detections")
    expect(len(data.raw_data) == 16 * len(data), "bytes")
    one = data[0]
    expect(0.0 < one.depth <= 100.0 and abs(one.azimuth) < 1.0, "distance and azimuth")
    expect(abs(one.altitude) < 1.0 and math.isfinite(one.velocity), "altitude and speed")


@works("IMUMeasurement.*", "GnssMeasurement.*")
def _navigation(scene: TrialScene) -> None:
    """At rest an IMU feels gravity alone; GNSS agrees with the map's georeference."""
    car = scene.car()
    imu = scene.spawn("sensor.other.imu", carla.Transform(), car)
    felt: list[Any] = []
    imu.listen(felt.append)
    scene.until(lambda: len(felt) > 6, "the IMU measures")
    expect(abs(felt[-1].accelerometer.z - 9.81) < 0.3, f"it feels {felt[-1].accelerometer}")
    expect(felt[-1].gyroscope.length() < 0.1, "it turns")
    expect(0.0 <= felt[-1].compass < 6.4, f"compass {felt[-1].compass}")
    gnss = scene.measure(scene.spawn("sensor.other.gnss", carla.Transform(), car))
    geo = scene.map.transform_to_geolocation(gnss.transform.location)
    expect(abs(gnss.latitude - geo.latitude) < 1e-9, "latitude")
    expect(abs(gnss.longitude - geo.longitude) < 1e-9, "longitude")
    expect(abs(gnss.altitude - geo.altitude) < 0.5, "altitude")


def _collide(scene: TrialScene) -> tuple[Any, Any]:
    """A car, and a parked truck a bit ahead of it on its lane."""
    car = scene.car()
    pose = car.get_transform()
    pose.location += 10.0 * pose.get_forward_vector() + carla.Location(z=0.3)
    truck = scene.spawn("vehicle.carlamotors.carlacola", pose)
    car.enable_constant_velocity(carla.Vector3D(8.0, 0.0, 0.0))
    return car, truck


@works("CollisionEvent.*")
def _collision(scene: TrialScene) -> None:
    """A crash is reported with both cars and an impulse."""
    car, truck = _collide(scene)
    sensor = scene.spawn("sensor.other.collision", carla.Transform(), car)
    event = scene.measure(sensor, tries=60)
    expect(event.actor.id == car.id and event.other_actor.id == truck.id, "who")
    expect(event.normal_impulse.length() > 0.0, "impulse")


@works("ObstacleDetectionEvent.*")
def _obstacle(scene: TrialScene) -> None:
    """What stands ahead is reported with its distance."""
    car, _ = _collide(scene)
    sensor = scene.spawn(
        "sensor.other.obstacle", carla.Transform(carla.Location(x=2.5, z=1.0)), car,
        distance="20", only_dynamics="true",
    )  # fmt: skip
    event = scene.measure(sensor, tries=60)
    expect(0.0 < event.distance <= 20.0, f"distance {event.distance}")
    expect(event.actor is not None and event.other_actor is not None, "who")


@works("LaneInvasionEvent.crossed_lane_markings", "LaneInvasionSensor", "ClientSideSensor")
def _lane_invasion(scene: TrialScene) -> None:
    """A car that leaves its lane reports the marking that it crossed."""
    car = scene.car()
    sensor = scene.spawn("sensor.other.lane_invasion", carla.Transform(), car)
    car.enable_constant_velocity(carla.Vector3D(6.0, 4.0, 0.0))
    event = scene.measure(sensor, tries=60)
    expect(len(event.crossed_lane_markings) > 0, "no marking")


@client_side("LaneInvasionEvent.actor")
def _lane_invader(_stage: TrialScene) -> None:
    """The 0.9.16 wheel raises when it is read, with any server: such an event knows no episode."""
    expect(hasattr(carla.LaneInvasionEvent, "actor"), "actor")


@works("DVSEvent.*", "DVSEventArray.width", "DVSEventArray.height", "DVSEventArray.fov",
       "DVSEventArray.raw_data", "DVSEventArray.to_image", "DVSEventArray.to_array_x",
       "DVSEventArray.to_array_y", "DVSEventArray.to_array_t",
       "DVSEventArray.to_array_pol")  # fmt: skip
def _events(scene: TrialScene) -> None:
    """A camera that moves sees events of both signs."""
    car = scene.car()
    camera = _camera(scene, "dvs", car)
    car.enable_constant_velocity(carla.Vector3D(10.0, 0.0, 0.0))
    scene.ticks(2)
    events = scene.measure(camera)
    expect((events.width, events.height, events.fov) == (64, 48, 90.0), "size")
    columns = (events.to_array_x(), events.to_array_y(), events.to_array_t(), events.to_array_pol())
    expect({len(c) for c in columns} == {len(events)} and len(events) > 0, "columns")
    expect(len(events.raw_data) > 0, "bytes")
    one = events[0]
    expect(0 <= one.x < 64 and 0 <= one.y < 48 and one.t >= 0, "an event")
    expect(one.pol in (True, False), "its sign")
    expect(len(events.to_image()) == 64 * 48, "as a picture")


@client_side("DVSEventArray.to_array")
def _events_as_array(_stage: TrialScene) -> None:
    """The 0.9.16 wheel has no converter for what this returns, with any server."""
    expect(hasattr(carla.DVSEventArray, "to_array"), "to_array")


@limited("Colours, depths, normals and tags. Rays are traced, so all others are black, as what "
         "CARLA lacks.",
         "ServerSideSensor.enable_gbuffers", "ServerSideSensor.listen_to_gbuffer",
         "ServerSideSensor.is_listening_gbuffer", "ServerSideSensor.stop_gbuffer")  # fmt: skip
def _gbuffers(scene: TrialScene) -> None:
    camera = _camera(scene)
    if has("ServerSideSensor.enable_gbuffers"):
        camera.enable_gbuffers(True)
    buffers = carla.GBufferTextureID
    queues: dict[Any, Queue[Any]] = {}
    for buffer in (buffers.SceneColor, buffers.SceneDepth, buffers.GBufferA, buffers.SSAO):
        queues[buffer] = Queue()
        camera.listen_to_gbuffer(buffer, queues[buffer].put)
        expect(camera.is_listening_gbuffer(buffer), f"it does not listen to {buffer}")
    frame = scene.ticks(2)
    for buffer, queue in queues.items():
        image = queue.get(timeout=20.0)
        while image.frame < frame:
            image = queue.get(timeout=20.0)
        picture = Picture(bytes(image.raw_data))
        expect((image.width, image.height) == (64, 48), "its size is another")
        expect(picture.is_black is (buffer == buffers.SSAO), f"{buffer} is black")
        camera.stop_gbuffer(buffer)
    expect(not camera.is_listening_gbuffer(buffers.SceneDepth), "it still listens")
    if has("ServerSideSensor.enable_gbuffers"):
        camera.enable_gbuffers(False)


@limited("Kept off: nothing is published to ROS.", "ServerSideSensor.enable_for_ros",
         "ServerSideSensor.disable_for_ros", "ServerSideSensor.is_enabled_for_ros")  # fmt: skip
def _ros(scene: TrialScene) -> None:
    camera = _camera(scene)
    camera.enable_for_ros()
    scene.ticks()
    expect(not camera.is_enabled_for_ros(), "it is enabled")
    camera.disable_for_ros()


@works("ServerSideSensor.set_ignored_vehicles")
def _ignored_vehicles(scene: TrialScene) -> None:
    """A vehicle that a camera ignores is not in its pictures."""
    car = scene.car()
    view = look_at(car.get_location() + carla.Location(z=0.7), 7.0)
    camera = scene.spawn(
        "sensor.camera.semantic_segmentation", view, image_size_x="64", image_size_y="48"
    )

    def share() -> float:
        picture = Picture(bytes(scene.measure(camera).raw_data))
        return picture.share(int(CAR_LABEL))

    seen = share()
    camera.set_ignored_vehicles([car.id])
    ignored = share()
    camera.set_ignored_vehicles([])
    expect(seen > 0.02 and ignored == 0.0, f"share {seen:.3f}, ignored {ignored:.3f}")
    expect(share() == seen, "it does not come back")


@client_side("ServerSideSensor.get_ignored_vehicles")
def _read_ignored(_stage: TrialScene) -> None:
    """The 0.9.16 wheel has no converter for what this returns, with any server."""
    expect(hasattr(carla.ServerSideSensor, "get_ignored_vehicles"), "get_ignored_vehicles")


def _two_stations(scene: TrialScene, type_id: str, **attributes: str) -> tuple[Any, Any]:
    """V2X sensors on two cars that stand near each other."""
    here = scene.place()
    there = carla.Transform(
        here.location + 15.0 * here.get_forward_vector() + carla.Location(z=0.2), here.rotation
    )
    roof = carla.Transform(carla.Location(z=2.0))
    pair = []
    for where in (here, there):
        car = scene.spawn("vehicle.tesla.model3", where)
        pair.append(scene.spawn(type_id, roof, car, custom_fading_stddev="0.0",
                                use_etsi_fading="false", **attributes))  # fmt: skip
    return pair[0], pair[1]


@works("CAMEvent.*", "CAMMessage.*")
def _awareness(scene: TrialScene) -> None:
    """A car hears where another one is, which way it looks and how strong its signal is."""
    receiver, sender = _two_stations(scene, "sensor.other.v2x", gen_cam_max="0.2")
    car = sender.parent
    event = scene.measure(receiver)
    expect(event.get_message_count() == 1, f"{event.get_message_count()} messages")
    message = next(iter(event))
    told = message.get()
    expect(abs(told["Power"] - message.power) < 1e-6, "two powers")
    # WINNER+ on a highway at 15 m and 5.9 GHz: 21.5 dBm + 10 dBi - 71.3 dB.
    expect(abs(message.power + 39.8) < 0.3, f"{message.power} dBm")
    body = told["Message"]
    expect(body["Header"]["Station ID"] == car.id, "station")
    basic = body["Message"]["CAM Parameters"]["Basic Container"]
    expect(basic["Station Type"] == "Passenger Car", basic["Station Type"])
    place = scene.map.transform_to_geolocation(car.get_location())
    latitude = basic["Reference Position"]["Latitude"] / 1e7
    expect(abs(latitude - place.latitude) < 1e-6, f"latitude {latitude}, not {place.latitude}")
    fast = body["Message"]["CAM Parameters"]["High Frequency Container"]
    motion = fast["Basic Vehicle Container High Frequency"]
    heading = (car.get_transform().rotation.yaw + 90.0) % 360.0
    expect(abs(motion["Heading"]["Value"] / 10.0 - heading) < 0.1, str(motion["Heading"]))
    length = 2.0 * car.bounding_box.extent.x
    expect(abs(motion["Vehicle Length"]["Value"] / 10.0 - length) < 0.06, "length")


@works("ServerSideSensor.send", "CustomV2XData.*", "CustomV2XEvent.*")
def _texts(scene: TrialScene) -> None:
    """A text of up to 99 bytes arrives as it was sent, a longer one not at all."""
    receiver, sender = _two_stations(scene, "sensor.other.v2x_custom")
    texts = iter(["x" * 100, "ice on the road"])
    event = scene.measure(receiver, lambda: sender.send(next(texts, "nothing more")))
    expect(event.get_message_count() == 1, f"{event.get_message_count()} messages")
    received = next(iter(event))
    told = received.get()["Message"]
    expect(told["Message"] == "ice on the road", told["Message"])
    expect(told["Header"]["Station ID"] == sender.parent.id, "station")
    expect(-60.0 < received.power < -30.0, f"{received.power} dBm")
