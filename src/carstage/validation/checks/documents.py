"""``episode.json`` and ``calibration.json`` say what other checks compare data with."""

from __future__ import annotations

from carstage.dataset.reading import Episode
from carstage.errors import DatasetError
from carstage.sensor_kinds.model import DEPTH, INSTANCES

_TYPES = {
    "episode_id": str,
    "server_version": str,
    "map": str,
    "ego_id": int,
    "geo_reference": dict,
    "requested": dict,
    "spawned": dict,
    "actors": dict,
}
_GROUPS = ("vehicles", "pedestrians")
_BESIDE = {"depth": DEPTH, "instance": INSTANCES}


def require_twins(episode: Episode) -> None:
    """Refuse a ``calibration.json`` in which a labelled camera's twin is none.

    Raises:
        DatasetError: names the first camera.
    """
    sensors = episode.calibration.sensors
    for camera in (sensor for sensor in sensors.values() if sensor.labelled):
        for key, content in _BESIDE.items():
            name = getattr(camera, key)
            twin = sensors.get(name)
            size = None if twin is None else (twin.content, twin.width, twin.height)
            if name is not None and size != (content, camera.width, camera.height):
                raise DatasetError(
                    f"calibration.json: {key} of {camera.id} is {name[:40]!r}, "
                    "which is no such camera of its size."
                )


def require_document(episode: Episode) -> None:
    """Refuse an ``episode.json`` that does not say what the format promises.

    Raises:
        DatasetError: names the first key.
    """
    document = episode.document
    for key, wanted in _TYPES.items():
        if not isinstance(document.get(key), wanted):
            raise DatasetError(f"episode.json: {key} is missing, or no {wanted.__name__}.")
    for key in ("requested", "spawned"):
        if not all(isinstance(document[key].get(group), int) for group in _GROUPS):
            raise DatasetError(f"episode.json: {key} has no number of {' and '.join(_GROUPS)}.")
    for track, actor in document["actors"].items():
        attributes = actor.get("attributes") if isinstance(actor, dict) else None
        of_text = isinstance(attributes, dict) and all(
            isinstance(value, str) for value in attributes.values()
        )
        if not (of_text and track.isdecimal()):
            raise DatasetError(f"episode.json: actor {track[:40]} has no attributes of text.")
