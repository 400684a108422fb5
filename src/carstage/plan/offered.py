"""Refusing what a server does not offer: blueprints, attributes, more than it computes."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from fnmatch import fnmatchcase

from carstage.config import Config, Sensor
from carstage.config.agents import VehicleAgent
from carstage.config.attributes import CameraAttributes
from carstage.config.fields import path_text, unknown
from carstage.config.traffic import Pedestrians, VehicleGroup, Vehicles
from carstage.config.weather import WeatherConfig
from carstage.errors import ConfigError
from carstage.plan.facts import ServerFacts
from carstage.plan.scenario import Recording, Storyboard
from carstage.plan.sources import Source
from carstage.releases import OLDEST, release_of
from carstage.sensor_kinds import sensor_kind
from carstage.spec.sensors import SPRING_ARM_GHOST

_DUST_PRESET = "DustStorm"
_SIDES = ("image_size_x", "image_size_y")


def check_offered(config: Config, facts: ServerFacts, recording: Source | None) -> None:
    """Refuse blueprints, attributes, weathers and attachments that the server does not have.

    Args:
        config: what the user asks for.
        facts: what the server offers; where its blueprints are unknown, none are checked.
        recording: what scenario or driver plays, where that is a file.

    Raises:
        ConfigError: with the field's path.
    """
    _check_blueprints(config, facts, recording)
    _check_limits(config, facts)
    _check_release(config, facts.dialect)


def offered_presets(weather: WeatherConfig, dialect: str) -> tuple[str, ...]:
    """The presets that an episode may get; of ``all``, those that the server's release has."""
    if "all" not in (weather.random_from or ()) or not _is_oldest(dialect):
        return weather.presets
    return tuple(name for name in weather.presets if name != _DUST_PRESET)


def _is_oldest(dialect: str) -> bool:
    return release_of(dialect) == OLDEST


def _check_release(config: Config, dialect: str) -> None:
    """Refuse dust and attachments that CARLA has from 0.9.14 on."""
    if not _is_oldest(dialect):
        return
    for field, lacking in (*_dust(config.weather), *_ghosts(config)):
        raise ConfigError(
            f"{field}: CARLA {OLDEST} has no {lacking}.", "Leave it out, or use a newer CARLA."
        )


def _dust(weather: WeatherConfig) -> Iterator[tuple[str, str]]:
    """Each place at which a weather names dust, with what is named."""
    named = [("weather.choice", weather.choice)]
    named += [(f"weather.random_from[{i}]", n) for i, n in enumerate(weather.random_from or ())]
    given = [("weather", weather.parameters)]
    for position, change in enumerate(weather.changes):
        named.append((f"weather.changes[{position}].choice", change.choice))
        given.append((f"weather.changes[{position}]", change.parameters))
    yield from ((field, name) for field, name in named if name == _DUST_PRESET)
    for place, parameters in given:
        if parameters.dust_storm:
            yield f"{place}.parameters.dust_storm", "dust"


def _ghosts(config: Config) -> Iterator[tuple[str, str]]:
    for place, sensor in config.located_sensors():
        if sensor.attachment == SPRING_ARM_GHOST:
            yield path_text((*place, "attachment")), SPRING_ARM_GHOST


def _check_blueprints(config: Config, facts: ServerFacts, recording: Source | None) -> None:
    """Refuse blueprints and attributes that the server does not have."""
    known = facts.blueprints
    if not known:
        return
    vehicles = [name for name in known if name.startswith("vehicle.")]
    if config.ego.blueprint not in vehicles:
        message, hint = unknown("blueprint", config.ego.blueprint, vehicles)
        raise ConfigError(f"ego.blueprint: {message}", hint)
    for position, agent in enumerate(config.agents):
        if isinstance(agent, VehicleAgent) and agent.blueprint not in vehicles:
            message, hint = unknown("blueprint", agent.blueprint, vehicles)
            raise ConfigError(f"agents[{position}].blueprint: {message}", hint)
    if isinstance(recording, Recording):
        for track in recording.tracks:
            if track.blueprint not in known:
                raise ConfigError(
                    f"{recording.field}: this server has no {track.blueprint}, which was recorded.",
                    "Use a server like the one that it was recorded with.",
                )
    if isinstance(recording, Storyboard):
        for entity in recording.spec.entities:
            if entity.blueprint not in known:
                message, hint = unknown("blueprint", entity.blueprint, known)
                raise ConfigError(f"{recording.field}: {entity.name}: {message}", hint)
    walkers = [name for name in known if name.startswith("walker.")]
    _check_labels(config, known)
    for position, group in enumerate(config.vehicles.groups):
        _check_group(f"vehicles.groups[{position}]", group, known, vehicles)
    _check_group("vehicles", config.vehicles, known, vehicles)
    _check_group("pedestrians", config.pedestrians, known, walkers)
    for place, sensor in config.located_sensors():
        if sensor.row.blueprint not in known:
            raise ConfigError(
                f"{path_text((*place, 'kind'))}: this server has no {sensor.row.blueprint}.",
                "Leave the sensor out or use another server.",
            )
        if recording is None:
            _check_carrier(place, sensor, known)
        strings = sensor.carla(fps=config.fps, image_size=config.image_size)
        for name in strings:
            if name not in known[sensor.row.blueprint]:
                message, hint = unknown("attribute", name, known[sensor.row.blueprint])
                raise ConfigError(f"{path_text((*place, 'attributes', name))}: {message}", hint)


def _check_labels(config: Config, known: Mapping[str, Mapping[str, str]]) -> None:
    """Refuse labels that need a sensor which the server does not have."""
    asked, needed = config.labels.occupancy, sensor_kind("occupancy").blueprint
    if asked is not None and asked.exact and needed not in known:
        raise ConfigError(
            f"labels.occupancy.exact: this server has no {needed}.",
            "Leave it out, or use `server: {kind: embedded}`.",
        )


def _check_group(
    path: str,
    group: VehicleGroup | Vehicles | Pedestrians,
    known: Mapping[str, Mapping[str, str]],
    family: list[str],
) -> None:
    """Refuse a group of road users that no blueprint of its family is for."""
    if not group.count:
        return
    left = [name for name in family if fnmatchcase(name, group.filter)]
    if not left:
        message, hint = unknown("blueprint", group.filter, {_family(name) for name in family})
        raise ConfigError(f"{path}.filter: {message}", hint)
    wanted = {"base_type": getattr(group, "base_type", None)}
    wanted["generation"] = None if group.generation == "all" else group.generation
    for name, value in wanted.items():
        there = {known[blueprint].get(name, "").lower() for blueprint in left} - {""}
        if value is not None and value.lower() not in there:
            message, hint = unknown(name.replace("_", " "), value, there)
            raise ConfigError(f"{path}.{name}: {message}", hint)
        left = [
            one
            for one in left
            if value is None or known[one].get(name, "").lower() == value.lower()
        ]


def _check_limits(config: Config, facts: ServerFacts) -> None:
    """Refuse sensors that are more than the server can compute."""
    for place, sensor in config.located_sensors():
        strings = sensor.carla(fps=config.fps, image_size=config.image_size)
        sides = [int(strings[axis]) for axis in _SIDES if axis in strings]
        given = [(name, float(strings[name])) for name in facts.limits if name in strings]
        if len(sides) == 2:
            given.append(("pixels", float(sides[0] * sides[1])))
        for name, value in given:
            most = facts.limits.get(name, math.inf)
            if value > most:
                raise ConfigError(
                    f"{_field(place, sensor, name)}: {name} of {value:.0f} is more than this "
                    f"server computes.",
                    f"Give at most {most:.0f}.",
                )


def _field(place: tuple[str | int, ...], sensor: Sensor, name: str) -> str:
    """Path of the setting that one of CARLA's attributes, or a number of pixels, comes from."""
    attributes = sensor.attributes
    if isinstance(attributes, CameraAttributes) and name in (*_SIDES, "pixels"):
        own = attributes.image_size is not None
        return path_text((*place, "attributes", "image_size") if own else ("image_size",))
    friendly = {row.carla: row.name for row in sensor.row.attributes.rows}
    return path_text((*place, "attributes", friendly.get(name, name)))


def _check_carrier(
    place: tuple[str | int, ...], sensor: Sensor, known: Mapping[str, Mapping[str, str]]
) -> None:
    """Refuse to attach a sensor to vehicles or walkers that the server does not have."""
    pattern = sensor.attach_to
    for family in ("vehicle.", "walker."):
        names = [name for name in known if name.startswith(family)]
        if pattern.startswith(family) and not any(fnmatchcase(name, pattern) for name in names):
            message, hint = unknown("blueprint", pattern, {_family(name) for name in names})
            raise ConfigError(f"{path_text((*place, 'attach_to'))}: {message}", hint)


def _family(blueprint: str) -> str:
    return re.sub(r"\.[^.]*$", ".*", blueprint)
