"""``episode.json`` says what other checks compare tables with."""

from __future__ import annotations

from carstage.dataset.reading import Episode
from carstage.errors import DatasetError

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
