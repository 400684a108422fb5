"""Which cameras and which LiDAR of a rig are exported."""

from __future__ import annotations

from carstage.dataset import Episode, SensorCalibration
from carstage.errors import BadInputError
from carstage.exporters.lenses import no_place_for
from carstage.exporters.options import ExportOptions
from carstage.sensor_kinds.model import COLOUR, POINTS


def colour_cameras(
    episode: Episode, options: ExportOptions, *, labelled: bool = True, pinholes: bool = False
) -> tuple[SensorCalibration, ...]:
    """The colour cameras that the options name, else all of the rig.

    Args:
        episode: whose rig it is.
        options: may name cameras.
        labelled: whether only those with labels count; then cameras with CARLA's own lens
            distortion are left out unless they are named, as nothing is projected into them.
        pinholes: whether the format has no place for another camera model; such cameras are left
            out unless they are named.

    Raises:
        BadInputError: there is none, or one that is named is no such camera.
    """
    fitting = {
        sensor.id: sensor.calibration
        for sensor in episode.sensors
        if sensor.content == COLOUR and (sensor.calibration.labelled or not labelled)
    }
    what = "labelled colour camera" if labelled else "colour camera"
    for name in options.cameras:
        if name not in fitting:
            raise BadInputError(
                f"Episode {episode.id} has no {what} {name!r}.",
                f"It has {', '.join(fitting) or 'none'}.",
            )
    if labelled or pinholes:
        _leave_lenses_out(fitting, options, pinholes=pinholes)
    if not fitting:
        raise BadInputError(
            f"Episode {episode.id} has no {what}.",
            "Record one, see `rig.sensors` and `labels.cameras` in the configuration.",
        )
    return tuple(fitting[name] for name in dict.fromkeys(options.cameras) or fitting)


def _leave_lenses_out(
    fitting: dict[str, SensorCalibration], options: ExportOptions, *, pinholes: bool
) -> None:
    """Leave cameras with a lens out, or with one that nothing is projected by.

    Those that are named are refused, and where there is no other.

    Raises:
        BadInputError: which one, and where it has a place.
    """
    bent = {
        name: camera
        for name, camera in fitting.items()
        if not (camera.is_pinhole if pinholes else camera.is_projective)
    }
    refused = [name for name in options.cameras if name in bent] or (
        list(bent) if len(bent) == len(fitting) else []
    )
    if refused:
        raise no_place_for(bent[refused[0]])
    for name in bent:
        del fitting[name]


def main_lidar(episode: Episode, options: ExportOptions) -> SensorCalibration | None:
    """The LiDAR that the options name, else the first one on the ego, else none.

    Raises:
        BadInputError: the one that is named is no LiDAR on the ego.
    """
    fitting = {
        sensor.id: sensor.calibration
        for sensor in episode.sensors
        if sensor.content == POINTS and sensor.calibration.on_ego
    }
    if options.lidar is None:
        return next(iter(fitting.values()), None)
    if options.lidar not in fitting:
        raise BadInputError(
            f"Episode {episode.id} has no LiDAR {options.lidar!r} on the ego.",
            f"It has {', '.join(fitting) or 'none'}.",
        )
    return fitting[options.lidar]
