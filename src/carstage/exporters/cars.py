"""The vehicles of an episode that carry sensors, each with a view of every frame of its own."""

from __future__ import annotations

from dataclasses import dataclass, replace

from carstage.dataset import Episode, SensorCalibration
from carstage.dataset.saved_frames import Frame
from carstage.errors import BadInputError
from carstage.exporters.lenses import no_place_for
from carstage.exporters.options import ExportOptions
from carstage.geometry import FloatArray, invert_pose, pose_matrix
from carstage.sensor_kinds.model import COLOUR, DETECTIONS, POINTS, TAGGED_POINTS

_VEHICLE = "vehicle."


@dataclass(frozen=True, slots=True)
class Car:
    """A vehicle with sensors that sit rigidly on it.

    Attributes:
        track_id: of the vehicle; ``None``: the ego.
        blueprint: CARLA's type id of the vehicle.
        sensors: in the order of the rig.
    """

    track_id: int | None
    blueprint: str
    sensors: tuple[SensorCalibration, ...]

    @property
    def is_ego(self) -> bool:
        """Whether it is the episode's ego."""
        return self.track_id is None

    def frame(self, frame: Frame) -> Frame:
        """The frame with this car's surroundings: without its own row, with the ego's for others.

        ``distance_ego`` and all that is told from the ego stays as it was recorded.
        """
        if self.is_ego:
            return frame
        objects = {key: row for key, row in frame.objects.items() if key != self.track_id}
        if frame.ego_object is not None:
            objects[frame.ego_object["track_id"]] = frame.ego_object
        return replace(frame, objects=objects, ego=None)

    def world_from_car(self, frame: Frame) -> FloatArray:
        """``(4, 4)`` pose of its pivot in a frame as it was recorded, CARLA's axes.

        Raises:
            DatasetError: no table holds it.
        """
        if self.track_id is None:
            return frame.world_from_ego
        row = frame.objects.get(self.track_id)
        if row is not None:
            return pose_matrix(row["actor_location"], row["actor_rotation_deg"])
        sensor = self.sensors[0]
        return frame.world_from_sensor(sensor.id) @ invert_pose(sensor.carrier_from_sensor)


def cars_with_sensors(episode: Episode) -> tuple[Car, ...]:
    """The ego, then the other vehicles that carry sensors rigidly, by track id."""
    by_carrier: dict[int | None, list[SensorCalibration]] = {None: []}
    carriers: dict[str, int | None] | None = None
    for sensor in episode.sensors:
        calibration = sensor.calibration
        if calibration.on_ego:
            by_carrier[None].append(calibration)
        elif calibration.attachment == "rigid" and calibration.attach_to.startswith(_VEHICLE):
            carriers = carriers if carriers is not None else episode.carriers()
            track = carriers.get(calibration.id)
            if track is not None:
                by_carrier.setdefault(track, []).append(calibration)
    actors = episode.document.get("actors", {})
    return tuple(
        Car(
            track,
            episode.spec.ego.blueprint
            if track is None
            else str(actors.get(str(track), {}).get("type_id", _VEHICLE)),
            tuple(by_carrier[track]),
        )
        for track in sorted(by_carrier, key=lambda track: -1 if track is None else track)
    )


def car_cameras(car: Car, options: ExportOptions) -> tuple[SensorCalibration, ...]:
    """Its labelled colour cameras; if the options name cameras, those among them.

    Raises:
        BadInputError: one that is named has a lens, which formats with several cameras in a frame
            have no place for; such cameras are left out else.
    """
    cameras = _labelled_cameras(car)
    for sensor in cameras:
        if not sensor.is_pinhole and sensor.id in options.cameras:
            raise no_place_for(sensor)
    return tuple(
        sensor
        for sensor in cameras
        if sensor.is_pinhole and (not options.cameras or sensor.id in options.cameras)
    )


def car_lidar(car: Car, options: ExportOptions) -> SensorCalibration | None:
    """Its LiDAR: the one that the options name, else its first, else its first semantic one."""
    fitting = [
        sensor for kind in (POINTS, TAGGED_POINTS) for sensor in car.sensors
        if sensor.content == kind
    ]  # fmt: skip
    named = [sensor for sensor in fitting if sensor.id == options.lidar]
    return next(iter(named or fitting), None)


def car_radars(car: Car) -> tuple[SensorCalibration, ...]:
    """Its radars."""
    return tuple(sensor for sensor in car.sensors if sensor.content == DETECTIONS)


def chosen_cars(episode: Episode, options: ExportOptions) -> tuple[Car, ...]:
    """The cars with a camera or a LiDAR, if the options name sensors those with one of them.

    Raises:
        BadInputError: a sensor that is named is on no car or has a lens, or no car has a camera
            or a LiDAR.
    """
    cars = cars_with_sensors(episode)
    named = (*options.cameras, *([options.lidar] if options.lidar else []))
    for name in options.cameras:
        known = [camera.id for car in cars for camera in _labelled_cameras(car)]
        _require(episode, "labelled colour camera", name, known)
    if options.lidar is not None:
        lidars = [
            sensor.id
            for car in cars
            for sensor in car.sensors
            if sensor.content in (POINTS, TAGGED_POINTS)
        ]
        _require(episode, "LiDAR", options.lidar, lidars)
    found = tuple(
        car
        for car in cars
        if (car_cameras(car, options) or car_lidar(car, options) is not None)
        and (not named or any(sensor.id in named for sensor in car.sensors))
    )
    if not found:
        raise BadInputError(
            f"Episode {episode.id} has no labelled colour camera and no LiDAR on a vehicle.",
            "Record one, see `rig.sensors` in the configuration.",
        )
    return found


def _labelled_cameras(car: Car) -> list[SensorCalibration]:
    return [sensor for sensor in car.sensors if sensor.content == COLOUR and sensor.labelled]


def _require(episode: Episode, what: str, name: str, known: list[str]) -> None:
    if name not in known:
        raise BadInputError(
            f"Episode {episode.id} has no {what} {name!r} on a vehicle.",
            f"It has {', '.join(known) or 'none'}.",
        )
