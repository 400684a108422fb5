"""What differs between the API of the ``carla`` clients 0.9.13 to 0.9.16, and between releases.

No other module of the collector asks for a version or whether a name exists.
"""

from __future__ import annotations

import logging
from typing import Any, Dict, Iterable, List, Optional, Sequence, Tuple

import carla

from carstage.collector.internals.errors import VersionMismatchError
from carstage.collector.internals.needed_names import NEEDED
from carstage.releases import NEWEST, client_release, is_newer, refusal, release_of
from carstage.spec.labels import LEVEL_LABELS

_log = logging.getLogger(__name__)


def check_versions(client: str, server: str, dialects: Iterable[str]) -> None:
    """Compare client, server and the planned dialects.

    A client speaks to servers of its own release. With a server that is newer than every known
    release, the newest known client is used, or one of the server's own release that the user
    names. Such a client must have all names that recording needs; the self-test then shows what
    the server understands.

    Raises:
        VersionMismatchError: they do not go together; names both versions. Or names that an
            unknown client lacks.
    """
    reason = refusal(server)
    if reason:
        raise VersionMismatchError(
            "This carla wheel is %s, but %s." % (client, reason), "Use a newer CARLA server."
        )
    wanted = client_release(server)
    if release_of(client) not in (wanted, release_of(server)):
        raise VersionMismatchError(
            "The server is CARLA %s, the carla wheel of this Python is %s." % (server, client),
            "Run the collector under a Python that has the wheel of CARLA %s." % (wanted,),
        )
    missing = lacking(carla) if is_newer(client) else []
    if missing:
        raise VersionMismatchError(
            "The carla wheel %s lacks %s, which recording needs." % (client, ", ".join(missing)),
            "Leave server.client_python at auto: the wheel %s is then tried." % (NEWEST,),
        )
    if is_newer(server):
        _log.warning("CARLA %s is not known here: recording with the client %s", server, client)
    for dialect in dialects:
        if release_of(dialect) != release_of(server):
            raise VersionMismatchError(
                "The episode is planned for CARLA %s, the server is %s." % (dialect, server),
                "Plan the run anew for this server.",
            )


def lacking(client: Any) -> List[str]:
    """Names that recording needs and the module of a client does not have."""
    missing = []
    for owner, names in NEEDED.items():
        found = getattr(client, owner, None)
        if found is None:
            missing.append("carla." + owner)
        else:
            missing += ["carla.%s.%s" % (owner, n) for n in names if not hasattr(found, n)]
    return missing


def is_listening(sensor: Any) -> bool:
    """Whether a ``carla.Sensor`` is listened to: a property in 0.9.13, a method since."""
    found = sensor.is_listening
    return bool(found() if callable(found) else found)


def attachment_type(name: str) -> Optional[Any]:
    """``carla.AttachmentType`` by name; None where it lacks one: ``SpringArmGhost`` in 0.9.13."""
    return getattr(carla.AttachmentType, name, None)


def set_day_night_cycle(light_manager: Any, active: bool) -> None:
    """Whether the server switches street lamps by the sun; 0.9.13 always does."""
    if hasattr(light_manager, "set_day_night_cycle"):
        light_manager.set_day_night_cycle(active)


def coming_lanes(manager: Any, vehicle: Any) -> Tuple[Tuple[int, int], ...]:
    """Road and lane of where a ``carla.TrafficManager`` is about to turn, as far as it knows.

    None of a vehicle that it has not driven yet: the client raises then.
    """
    try:
        actions = manager.get_all_actions(vehicle)
    except (AttributeError, IndexError, RuntimeError):
        return ()
    return tuple((place.road_id, place.lane_id) for _, place in actions)


def city_object_labels(name: str) -> List[Any]:
    """Values of ``carla.CityObjectLabel`` for a kind of level objects; none: unknown here."""
    known = carla.CityObjectLabel.names
    return [known[label] for label in LEVEL_LABELS[name] if label in known]


def weather_values(weather: Any, names: Sequence[str]) -> Dict[str, float]:
    """Values of a ``carla.WeatherParameters`` by name; 0.9.13 lacks ``dust_storm``."""
    return {name: float(getattr(weather, name)) for name in names if hasattr(weather, name)}
