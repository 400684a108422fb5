"""Which scenes of nuScenes an episode becomes: one for each car with sensors, with its rates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from carstage.dataset import Episode
from carstage.errors import BadInputError
from carstage.exporters.cars import Car, car_cameras, car_lidar, car_radars, chosen_cars
from carstage.exporters.clouds import label_source
from carstage.exporters.options import ExportOptions
from carstage.sensor_kinds.model import COLOUR, DETECTIONS, POINTS, TAGGED_POINTS

LIDAR_CHANNEL: Final = "LIDAR_TOP"
_KEYFRAMES_HZ = 2.0
_WHOLE = 1e-6


@dataclass(frozen=True, slots=True)
class CarScene:
    """A car's part of an episode.

    Attributes:
        key: what tokens and file names begin with: the episode's id, for others than the ego
            with the car's track id.
        car: who carries the sensors.
        own_id: its actor id.
        channels: nuScenes's channel of each sensor that is exported, by sensor id.
        lidar: id of the sensor that is ``LIDAR_TOP``.
        tag_source: id of the semantic LiDAR that knows what its points are of.
        radars: ids of the radars.
    """

    key: str
    car: Car
    own_id: int
    channels: Mapping[str, str]
    lidar: str | None
    tag_source: str | None
    radars: tuple[str, ...]

    @property
    def ranged(self) -> bool:
        """Whether it has a LiDAR or a radar."""
        return self.lidar is not None or bool(self.radars)


def scenes_of(episode: Episode, options: ExportOptions) -> tuple[CarScene, ...]:
    """The scenes of an episode, the ego's first.

    Raises:
        BadInputError: no car has sensors that can be exported, or two of them get one name.
    """
    return tuple(_scene(episode, car, options) for car in chosen_cars(episode, options))


def _scene(episode: Episode, car: Car, options: ExportOptions) -> CarScene:
    """The LiDAR is ``LIDAR_TOP``, whatever its id: the devkit finds the car by that name."""
    lidar, radars = car_lidar(car, options), car_radars(car)
    channels = {} if lidar is None else {lidar.id: LIDAR_CHANNEL}
    for prefix, sensors in (("CAM_", car_cameras(car, options)), ("RADAR_", radars)):
        for sensor in sensors:
            name = sensor.id.upper()
            channel = name if name.startswith(prefix) else prefix + name
            if channel in channels.values():
                raise BadInputError(
                    f"Episode {episode.id}: two sensors would be nuScenes's {channel}.",
                    f"Choose the cameras by --camera, or rename {sensor.id} when you record.",
                )
            channels[sensor.id] = channel
    return CarScene(
        key=episode.id if car.is_ego else f"{episode.id}-{car.track_id}",
        car=car,
        own_id=int(episode.document["ego_id"]) if car.track_id is None else car.track_id,
        channels=channels,
        lidar=None if lidar is None else lidar.id,
        tag_source=None if lidar is None else label_source(episode, lidar),
        radars=tuple(radar.id for radar in radars),
    )


def sensors_without_scene(
    episode: Episode, scenes: Sequence[CarScene], options: ExportOptions
) -> tuple[str, ...]:
    """Ids of colour cameras, LiDARs and radars that no scene shows, but those not asked for."""
    shown = {sensor for scene in scenes for sensor in (*scene.channels, scene.tag_source)}
    return tuple(
        sensor.id
        for sensor in episode.sensors
        if sensor.calibration.content in (COLOUR, POINTS, TAGGED_POINTS, DETECTIONS)
        and sensor.id not in shown
        and not (options.cameras and sensor.calibration.content == COLOUR)
    )


def key_frame_step(episode: Episode, options: ExportOptions) -> int:
    """Every how many frames one is a key frame.

    Two a second, as nuScenes has them, where the episode's rate is a multiple of that; else every
    frame is one, also in asynchronous mode, where frames have no rate.

    Raises:
        BadInputError: the options ask for a rate that the episode's is no multiple of.
    """
    saved_hz = episode.spec.fps / episode.spec.save_every
    steps = saved_hz / (options.keyframes_hz or _KEYFRAMES_HZ)
    fits = episode.spec.timing.synchronous and steps > 0.5 and abs(steps - round(steps)) < _WHOLE
    if fits:
        return round(steps)
    if options.keyframes_hz is not None:
        raise BadInputError(
            f"keyframes-hz: episode {episode.id} has {saved_hz:g} frames per second"
            f"{'' if episode.spec.timing.synchronous else ', at times of their own'}, no multiple "
            f"of {options.keyframes_hz:g}.",
            "Give a rate that divides it, or leave the option out.",
        )
    return 1
